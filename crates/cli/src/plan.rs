//! `etalon plan`: reports which effects a scene calls for and why, and what drawing takes (passes, pipelines, memory,
//! rays), without drawing. See docs/plan.md.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context as _, Result, ensure};
use clap::Args;
use comfy_table::{ContentArrangement, Table, presets};

use super::options::{DeviceOptions, PictureOptions, PlanExtent as Planned, SceneOptions};
use super::report::{Expected, PipelineFact, PlanFacts};
use super::setup::{self, Setup, validated};
use super::{extensions, heading, print, usage};
use etalon::frame::{Renderer, Settings};
use etalon::open::Opened;
use etalon::plan::rungs::Interfaces;
use etalon::plan::{Effect, EffectState};
use etalon::scene::Camera;
use etalon::scene::canonical::canonicalise;
use etalon::transport::sight::{Sight, along_lines};
use etalon_cost::explain::Price;
use etalon_cost::predict::{PIXELS, Prediction, Trial, predict};
use etalon_cost::sweep::SweepExtent;

/// Show which effects a scene calls for and why, and what drawing takes
///
/// With -v it also lists the effects that are not needed, the pipelines, and what is not loaded. A folder in place of
/// the scene gives a table of the glTF extensions that the files below it need, and the files that cannot be read.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
    etalon plan study:pool
    etalon plan -v study:pool --model global
    etalon plan - --json < scene.glb
    etalon plan models")]
pub struct PlanArgs {
    #[command(flatten)]
    scene: SceneOptions,
    #[command(flatten)]
    picture: PictureOptions,
    #[command(flatten)]
    device: DeviceOptions,
    /// Predict the time and the error of each rung at this size, from some of the picture's tiles
    #[arg(long, help_heading = heading::QUALITY)]
    forecast: bool,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Time budget of a forecast, in seconds.
const FORECAST_S: u32 = 60;

/// Runs the command.
///
/// # Errors
/// One sentence with the action, its object and the cause.
pub fn run(args: &PlanArgs, whole: bool) -> Result<ExitCode> {
    let mut settings = args.picture.settings(&args.scene)?;
    usage(args.picture.check_error_is_told())?;
    if Path::new(&args.scene.scene).is_dir() {
        usage(args.check_folder())?;
        extensions::run(Path::new(&args.scene.scene), args.json)?;
        return Ok(ExitCode::SUCCESS);
    }
    let (opened, device) = setup::open(&args.scene, args.picture.prune(&args.scene, &settings.knobs), &args.device)?;
    args.picture.colour_of(opened.scene(), &mut settings.knobs)?;
    let camera = args.scene.choose_camera(opened.scene(), settings.size)?;
    let sight = sight(&opened, &camera, &settings)?;
    let read = opened.warnings.clone();
    // Costs and pixel counts of effects need a device; effects and their reasons need only the scene.
    let wants_device = args.device.device.is_some()
        || args.device.validate
        || args.forecast
        || args.picture.plan == Planned::ExplainCost;
    let facts = match device {
        Ok(device) => on_device(args, Setup { device, opened }, settings, sight.as_ref(), read)?,
        Err(error) if wants_device => return Err(error),
        Err(error) => {
            let interfaces = settings.knobs.interfaces.count();
            let prepared = opened.prepared(settings)?;
            let mut facts = PlanFacts::of(&prepared.plan);
            let without = format!("passes, pipelines, memory and pixels are unknown without a device: {error:#}");
            let lines = sight.filter(|_| prepared.plan.rays.is_some_and(|rays| rays.refraction));
            let lost = lines.and_then(|sight| lost(&sight, interfaces));
            facts.warnings.splice(0..0, read.into_iter().chain([without]).chain(prepared.warnings).chain(lost));
            facts
        }
    };
    if args.json {
        print(&serde_json::to_string_pretty(&facts)?)?;
    } else {
        print(&text(&facts, whole))?;
    }
    Ok(ExitCode::SUCCESS)
}

impl PlanArgs {
    /// Refuses options about a picture: files of a folder are only read.
    fn check_folder(&self) -> Result<()> {
        let PictureOptions { set, model, max_error, plan, seed, .. } = &self.picture;
        let is_plain = set.is_empty() && model.is_none() && max_error.is_none() && *plan == Planned::Scene;
        let is_plain = is_plain && *seed == 0 && self.picture.words().len() == 1;
        let is_alone = self.scene.words().len() == 1 && self.device.device.is_none() && !self.device.validate;
        ensure!(
            is_plain && is_alone && !self.forecast,
            "{}: this is a folder, whose files are only read; the one option for it is --json",
            self.scene.scene
        );
        Ok(())
    }
}

/// Transparent surfaces along the lines of sight; `None` where no material transmits light.
fn sight(opened: &Opened, camera: &Camera, settings: &Settings) -> Result<Option<Sight>> {
    if opened.scene().materials.iter().all(|material| material.transmission <= 0.0) {
        return Ok(None);
    }
    let mut scene = opened.scene().clone();
    canonicalise(&mut scene);
    Ok(Some(along_lines(&scene, &*opened.original.bvh()?, camera, settings.size)))
}

/// A warning about light that `interfaces` surfaces per path cannot follow along the lines of sight; `None` where they
/// suffice.
fn lost(sight: &Sight, interfaces: u32) -> Option<String> {
    let more = match sight.most {
        0..=32 => format!("--set interfaces={} traces all of them", sight.most.next_power_of_two()),
        _ => "no rung traces all of them".to_owned(),
    };
    (sight.most > interfaces).then(|| {
        format!(
            "lines of sight pass through up to {} transparent surfaces: interfaces={interfaces} loses up to {:.1} % of the light \
             of a pixel; {more}",
            sight.most,
            100.0 * sight.lost(interfaces)
        )
    })
}

/// The plan, with passes, pipelines, memory and pixel counts on a device.
fn on_device(
    args: &PlanArgs,
    setup: Setup,
    settings: Settings,
    sight: Option<&Sight>,
    mut warnings: Vec<String>,
) -> Result<PlanFacts> {
    let interfaces = settings.knobs.interfaces.count();
    let device = setup.device.clone();
    let explained = (args.picture.plan == Planned::ExplainCost).then(|| (setup.clone(), settings.clone()));
    let forecast = args.forecast.then(|| (setup.clone(), settings.clone()));
    let (mut renderer, camera) = setup.renderer(&args.scene, settings)?;
    warnings.extend(renderer.warnings.iter().cloned());
    let passes = renderer.passes(&camera)?;
    let mut pipelines = renderer.device().pipelines();
    pipelines.extend(passes.iter().flat_map(|pass| pass.pipelines.iter().cloned()));
    let lighting = passes.iter().filter(|pass| pass.name == "lighting").count();
    let mut names: Vec<String> = Vec::new();
    for pass in passes {
        if !names.contains(&pass.name) {
            names.push(pass.name);
        }
    }
    let mut facts = PlanFacts::of(renderer.plan()).on(renderer.device(), names, pipelines);
    // After the list of pipelines and buffers: counting pixels adds a pipeline and a buffer.
    let pixels = renderer.pixels_by_material(&camera)?;
    for effect in facts.effects.iter_mut().filter(|effect| !effect.materials.is_empty()) {
        let seen: u64 = effect.materials.iter().filter_map(|&material| pixels.get(material)).sum();
        effect.evidence.insert("pixels", seen.to_string());
    }
    let rays = renderer.plan().rays.unwrap_or_default();
    let sight = sight.filter(|_| rays.refraction);
    warnings.extend(sight.and_then(|sight| lost(sight, interfaces)));
    facts.expected = Some(expected(&facts, &renderer, sight, [interfaces, lighting as u32]));
    facts.warnings.splice(0..0, warnings);
    drop(renderer);
    if let Some((setup, settings)) = forecast {
        let folder = tempfile::tempdir().context("creating a temporary folder")?;
        let extent = SweepExtent { budget_s: FORECAST_S, reference_samples: None, shard: [1, 1] };
        let trial = Trial { folder: &folder.path().join("forecast"), extent, pixels: PIXELS };
        facts.forecast = setup.bench(&args.scene, settings, |bench| {
            predict(&bench, &trial, &mut |step| eprintln!("{}, about {:.0} s left", step.name, step.left_s))
        })?;
    }
    if let Some((setup, settings)) = explained {
        facts.costs = setup.prices(&args.scene, &args.device, settings, &facts.effects, &mut |effect| {
            eprintln!("measuring the cost of \"{effect}\"");
        })?;
    }
    validated(&device)?;
    Ok(facts)
}

fn expected(
    facts: &PlanFacts,
    renderer: &Renderer,
    sight: Option<&Sight>,
    [interfaces, lighting]: [u32; 2],
) -> Expected {
    let rays = renderer.plan().rays.unwrap_or_default();
    let lost = |rung: &Interfaces| Some((rung.name(), sight?.lost(rung.count())));
    Expected {
        bytes: facts.buffers.iter().map(|made| made.bytes).sum(),
        shadow_rounds: if rays.shadows { lighting } else { 0 },
        ray_rounds: sight.map_or(0, |sight| sight.most).max(u32::from(rays.mirrors || rays.refraction)).min(interfaces),
        interfaces: sight.map_or(0, |sight| sight.most),
        lost: Interfaces::RUNGS.iter().filter_map(lost).collect(),
    }
}

fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING).set_content_arrangement(ContentArrangement::Dynamic).set_header(header);
    table
}

/// Table of what the effects that the plan leaves out would cost.
pub(super) fn cost_table(prices: &[Price]) -> Table {
    let mut costs = table(&[
        "effect",
        "enabled by",
        "first picture",
        "per sample",
        "lowest … highest",
        "of a sample",
        "pipelines",
        "KB of SPIR-V",
        "MB",
    ]);
    for price in prices {
        if let Some(fails) = &price.fails {
            costs.add_row([price.effect, &price.by, &format!("cannot be drawn: {fails}")]);
            continue;
        }
        let [low, high] = price.frame_range_ms;
        costs.add_row([
            price.effect.to_owned(),
            price.by.clone(),
            format!("{:+.0} ms", price.start_ms),
            format!("{:+.2} ms", price.frame_ms),
            format!("{low:+.2} … {high:+.2}"),
            format!("{:+.1} %", 100.0 * price.frame_share),
            format!("{:+}", price.pipelines),
            format!("{:+.1}", price.spirv_bytes as f64 / 1e3),
            format!("{:+.2}", price.bytes as f64 / 1e6),
        ]);
    }
    costs
}

/// Table of predicted time and error of each rung.
fn forecast_table(predictions: &[Prediction]) -> Table {
    let mut all = table(&["picture", "GPU ms", "low … high", "error %", "low … high"]);
    for Prediction { picture, gpu_ms: ms, error, .. } in predictions {
        all.add_row([
            picture.clone(),
            format!("{:.1}", ms.median),
            format!("{:.1} … {:.1}", ms.low, ms.high),
            format!("{:.2}", 100.0 * error.median),
            format!("{:.2} … {:.2}", 100.0 * error.low, 100.0 * error.high),
        ]);
    }
    all
}

/// Table of what the driver's compiler made of each pipeline; empty where the driver does not tell.
fn footprints(pipelines: &[PipelineFact]) -> String {
    let mut all = table(&["program", "stage", "registers", "spilled", "scratch B", "shared B", "code KB", "subgroups"]);
    for pipeline in pipelines {
        for compiled in &pipeline.compiled {
            let Some(of) = compiled.footprint() else { continue };
            let figures =
                [of.registers, of.spilled, of.scratch_bytes, of.shared_bytes, of.code_bytes / 1024, of.subgroups];
            let names = [pipeline.name.to_owned(), compiled.stage.clone()];
            all.add_row(names.into_iter().chain(figures.map(|figure| figure.to_string())));
        }
    }
    if all.is_empty() { String::new() } else { format!("{all}\n\n") }
}

/// The plan in words. `whole` lists also what the scene does not need.
fn text(facts: &PlanFacts, whole: bool) -> String {
    let mut effects = table(&["effect", "state", "rung", "pixels", "reason"]);
    let is_needed = |effect: &&Effect| effect.state != EffectState::NotCalledFor;
    for effect in facts.effects.iter().filter(|effect| whole || is_needed(effect)) {
        let pixels = effect.evidence.get("pixels").map_or("", String::as_str);
        effects.add_row([effect.id.name(), effect.state.name(), effect.rung(), pixels, &effect.reason()]);
    }
    // Pipelines of one program differ only in specialization constants, which --json lists.
    let mut programs: BTreeMap<&str, (usize, usize)> = BTreeMap::new();
    for pipeline in &facts.pipelines {
        let (count, bytes) = programs.entry(pipeline.name).or_default();
        *count += 1;
        *bytes += pipeline.spirv_bytes;
    }
    let mut pipelines = table(&["program", "pipelines", "KB of SPIR-V"]);
    for (name, (count, bytes)) in &programs {
        pipelines.add_row([(*name).to_owned(), count.to_string(), format!("{:.1}", *bytes as f64 / 1e3)]);
    }
    let pipelines = if whole { format!("{pipelines}\n\n{}", footprints(&facts.pipelines)) } else { String::new() };
    let (bytes, rounds) = facts.expected.as_ref().map_or((0, 0), |expected| (expected.bytes, expected.ray_rounds));
    let spirv: usize = facts.pipelines.iter().map(|pipeline| pipeline.spirv_bytes).sum();
    let loses: String = facts
        .expected
        .iter()
        .flat_map(|expected| &expected.lost)
        .filter(|(_, lost)| **lost > 0.0)
        .map(|(rung, lost)| {
            format!("; interfaces={rung} would lose up to {:.1} % of the light of a pixel", 100.0 * lost)
        })
        .collect();
    let sight = match facts.expected.as_ref().map_or(0, |expected| expected.interfaces) {
        0 => String::new(),
        most => format!("lines of sight pass through up to {most} transparent surfaces{loses}\n"),
    };
    let unread: String = facts.unread.iter().map(|unread| format!("not loaded: {unread}\n")).collect();
    let unread = if whole { unread } else { String::new() };
    let left = facts.effects.len() - facts.effects.iter().filter(is_needed).count();
    let left = match (whole, facts.unread.len()) {
        (true, _) => String::new(),
        (false, 0) => format!("{left} effects are not needed (-v lists them)\n"),
        (false, n) => {
            format!("{left} effects are not needed, {n} textures or coordinates are not loaded (-v lists them)\n")
        }
    };
    let costs = if facts.costs.is_empty() { String::new() } else { format!("{}\n", cost_table(&facts.costs)) };
    let forecast =
        if facts.forecast.is_empty() { String::new() } else { format!("\n{}\n", forecast_table(&facts.forecast)) };
    let warnings: String = facts.warnings.iter().map(|warning| format!("warning: {warning}\n")).collect();
    if facts.expected.is_none() {
        return format!("{effects}\n\n{} samples per pixel\n{left}{unread}{warnings}", facts.samples)
            .trim_end()
            .to_owned();
    }
    format!(
        "{effects}\n\n{} samples per pixel; passes of each sample: {}\n\n{pipelines}{} pipelines with {:.0} KB of SPIR-V; {} \
         buffers and images with {:.1} MB; at least {rounds} ray dispatches in a row\n{sight}{left}{unread}{costs}{forecast}{warnings}",
        facts.samples,
        facts.passes.join(", "),
        facts.pipelines.len(),
        spirv as f64 / 1e3,
        facts.buffers.len(),
        bytes as f64 / 1e6,
    )
    .trim_end()
    .to_owned()
}
