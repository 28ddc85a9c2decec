//! `etalon render` of one picture. Sequences are drawn in `sequence.rs`, parts of a picture in `shard.rs`.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, IsTerminal as _};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Result, anyhow, bail, ensure};
use serde_json::json;

use super::budget::{Budget, Chosen, command};
use super::exposure;
use super::interrupt::{INTERRUPTED, Interrupt};
use super::options::{DeviceOptions, PlanExtent};
use super::picture::{
    Format, RenderArgs, are_same, check_layers, check_same_scene, default_stem, differs, format_of, is_standard,
    layers, metadata, output_format, scene_text, settings_size, warn_about,
};
use super::plan::cost_table;
use super::progress::{ProgressForm, Steps};
use super::report::{
    ColourFacts, MemoryFacts, PassFacts, PipelineFacts, PlanFacts, Report, Sampling, SceneReport, Spread, Validation,
    WrittenFile, knob_map,
};
use super::sequence;
use super::setup::Setup;
use super::shard;
use super::summary::sentence;
use super::{print, print_bytes, usage};
use etalon::frame::Rendered;
use etalon::gpu::{Severity, is_lost};
use etalon::image::{Picture, exr, file, png};
use etalon::scene::{Prune, Scene};

/// Wall time of named phases, in milliseconds.
struct Phases {
    start: Instant,
    last: Instant,
    all: BTreeMap<&'static str, f64>,
}

impl Phases {
    fn end(&mut self, name: &'static str) {
        let now = Instant::now();
        *self.all.entry(name).or_default() += (now - self.last).as_secs_f64() * 1e3;
        self.last = now;
    }
}

/// Runs the command.
///
/// # Errors
/// One sentence with the action, its object and the cause.
pub fn run(args: &RenderArgs, quiet: bool) -> Result<ExitCode> {
    let mut printed = BTreeSet::new();
    match draw_any(args, quiet, &mut printed) {
        // Standard input can be read only once.
        Err(error) if is_lost(&error) && args.scene.scene != "-" => {
            // Frames whose files are complete are not drawn again.
            let what = if args.sequence.is_sequence() { "what is missing" } else { "the picture" };
            tracing::warn!("{error:#}; {what} is drawn once more, in short submissions");
            let device = DeviceOptions { short_submissions: true, ..args.device.clone() };
            draw_any(&RenderArgs { device, ..args.clone() }, quiet, &mut printed)
        }
        drawn => drawn,
    }
}

/// Draws a sequence, a part or a picture. `printed` holds the frames whose paths this command has printed.
fn draw_any(args: &RenderArgs, quiet: bool, printed: &mut BTreeSet<PathBuf>) -> Result<ExitCode> {
    if args.sequence.is_sequence() {
        return sequence::run(args, quiet, printed);
    }
    match args.sequence.shard {
        Some(part) => shard::run(args, part, quiet),
        None => draw(args, quiet),
    }
}

/// Draws one picture and writes it.
fn draw(args: &RenderArgs, quiet: bool) -> Result<ExitCode> {
    let now = Instant::now();
    let mut phases =
        Phases { start: now, last: now, all: BTreeMap::from(["bvh", "pipelines"].map(|name| (name, 0.0))) };
    let mut settings = args.render_settings()?;
    usage(args.sequence.check_one())?;
    let budget = usage(Budget::of(args.within, &args.picture))?;
    usage(check_layers(&args.aov, &settings))?;
    let outputs = outputs(args)?;
    let steps = Steps::new(args.progress, quiet);
    phases.end("start");

    steps.step(&format!("loading {}", args.scene.label()), 1);
    let prune = if budget.is_some() { Prune::Nothing } else { args.picture.prune(&args.scene, &settings.knobs) };
    let mut setup = Setup::load(&args.scene, prune, &args.device)?;
    args.spares_files(setup.opened.scene(), outputs.iter().map(|(path, _)| path.as_path()))?;
    phases.end("load");
    let mut chosen = None;
    if budget.is_none() {
        args.picture.colour_of(setup.opened.scene(), &mut settings.knobs)?;
    }
    let camera = args.scene.choose_camera(setup.opened.scene(), settings.size)?;
    let exposure = exposure::choose(args.picture.exposure, &setup.opened, &setup.device, &settings, &camera)?;
    settings.exposure = exposure.stops;
    phases.end("meter");
    if let Some(budget) = budget {
        // The chosen rungs were measured in this light.
        setup.opened.keep_light(&settings.knobs);
        let scene = args.scene.with_light_of(&setup.opened, &settings.knobs);
        let command = command(&scene, &args.picture.with_exposure(&exposure), &args.device);
        let found = budget.choose([&args.scene.scene, &command], &args.scene, &setup, &settings, &steps)?;
        settings.max_error = None;
        settings.knobs = found.knobs.clone();
        chosen = Some(found);
        phases.end("choose");
    }
    let device = setup.device.clone();
    let info = device.info().clone();
    if !quiet {
        let software = if info.kind == "cpu" { ", a software device" } else { "" };
        steps.say(&format!("drawing on {} ({}{software})", info.name, info.driver));
    }
    exposure.sentence.iter().for_each(|line| steps.tell(line));
    for warning in &setup.opened.warnings {
        tracing::warn!("{warning}");
    }
    let facts = facts(setup.opened.scene());

    steps.step("uploading", 1);
    let knobs = settings.knobs.clone();
    let sources = setup.opened.sources(&settings);
    let explained = (args.picture.plan == PlanExtent::ExplainCost).then(|| (setup.clone(), settings.clone()));
    let (mut renderer, camera) = setup.renderer(&args.scene, settings)?;
    phases.end("upload");
    phases.all.insert("bvh", renderer.bvh().map_or(0.0, |bvh| bvh.build_ms + bvh.layout_ms));
    for warning in &renderer.warnings {
        tracing::warn!("{warning}");
    }
    for warning in &renderer.plan().warnings {
        tracing::info!("{warning}");
    }
    if tracing::enabled!(tracing::Level::INFO) {
        for effect in &renderer.plan().effects {
            tracing::info!("{}: {} ({})", effect.id, effect.state, effect.reason());
        }
    }

    let lit_by = sources.lit_by(renderer.plan());
    let samples = renderer.plan().samples;
    let mut rounds = Vec::new();
    let mut first: Option<(Rendered, Option<Picture>)> = None;
    if chosen.is_some() {
        // A budget applies to a warmed-up renderer, as the measured tables do: compile everything first.
        renderer.render_samples(&camera, 2, &mut |_| ())?;
        phases.end("frame");
    }
    let needs_film =
        args.report.is_some() || outputs.iter().any(|(_, format)| *format == Format::Exr) || args.repeat > 1;
    let interrupt = args
        .keep
        .then(|| Interrupt::listen("stopping after this sample; the picture with the samples so far is written"));
    let is_stopped = || interrupt.as_ref().is_some_and(Interrupt::is_asked);
    for round in 0..args.repeat {
        steps.step("drawing", samples);
        let mut clock = Instant::now();
        let begun = clock;
        let mut progress = |progress| steps.sampled(progress, begun, &mut clock);
        let rendered = renderer.render_until(&camera, &mut progress, &is_stopped)?;
        phases.end("frame");
        let film = if needs_film { Some(renderer.film()?) } else { None };
        phases.end("readback");
        rounds.push(rendered.passes.clone());
        match &first {
            None => first = Some((rendered, film)),
            Some((known, known_film)) => {
                let same = |a: &Picture, b: &Picture| {
                    bytemuck::cast_slice::<_, u8>(&a.rgba) == bytemuck::cast_slice::<_, u8>(&b.rgba)
                };
                let films = known_film.as_ref().zip(film.as_ref()).is_none_or(|(a, b)| same(a, b));
                if known.display != rendered.display || !films {
                    bail!("--repeat: picture {} differs from the first picture", round + 1);
                }
            }
        }
    }
    let (rendered, film) = first.ok_or_else(|| anyhow!("nothing was drawn"))?;
    let is_cut = is_stopped() && rendered.samples < samples;
    if let Some(chosen) = chosen.as_mut().filter(|_| !is_cut) {
        chosen.check(&rendered, args.picture.size, &mut renderer, &camera)?;
    }
    let mut aov = args.aov.clone();
    if is_cut && rendered.samples < 2 && aov.iter().any(|name| name.of_halves()) {
        tracing::warn!("--aov: one sample has no halves, so their layers are left out");
        aov.retain(|name| !name.of_halves());
    }
    let aovs = if aov.is_empty() { Vec::new() } else { layers(&mut renderer, &camera, &aov)? };
    phases.end("readback");
    warn_about(&rendered, settings_size(&args.picture), &knobs, renderer.plan().bands);

    steps.step("encoding", outputs.len() as u32);
    let mut written = Vec::new();
    for (index, (path, format)) in outputs.iter().enumerate() {
        let bytes = match (format, &film) {
            (Format::Exr, Some(film)) => exr::encode_exr(film, &aovs, &metadata(args, renderer.plan()))?,
            _ if args.output.is_empty() => {
                let texts = [scene_text(&args.scene.scene)];
                png::encode_png_with(args.picture.size, &rendered.display, rendered.has_alpha, &texts)?
            }
            _ => renderer.png(&rendered)?,
        };
        if is_standard(path) {
            print_bytes(&bytes)?;
        } else {
            file::write(path, &bytes)?;
        }
        written.push(WrittenFile { path: path.display().to_string(), hash: file::hash(&bytes) });
        steps.at(index as u32 + 1);
    }
    phases.end("encode");
    let costs = match &explained {
        Some((setup, settings)) => {
            let effects = &renderer.plan().effects;
            let prices = setup.prices(&args.scene, &args.device, settings.clone(), effects, &mut |effect| {
                steps.step(&format!("measuring the cost of \"{effect}\""), 1);
            })?;
            steps.say(&cost_table(&prices).to_string());
            prices
        }
        None => Vec::new(),
    };
    let validation = Validation::of(&device, args.device.validate);
    let failed = validation.messages.iter().find(|m| m.severity == Severity::Error).map(|m| m.text.clone());
    if let (Some(path), Some(film)) = (&args.report, &film) {
        let total = phases.start.elapsed().as_secs_f64() * 1e3;
        phases.all.insert("total", total);
        phases.all.insert("pipelines", device.pipelines_ms());
        let passes = rendered.passes.iter().map(|p| p.name.clone()).collect();
        let mut plan = PlanFacts::of(renderer.plan()).on(&device, passes, device.pipelines());
        plan.costs = costs;
        let spirv_bytes = plan.pipelines.iter().map(|pipeline| pipeline.spirv_bytes).sum();
        let report = Report {
            schema: "etalon.report/1",
            device: info,
            scene: facts,
            lit_by: lit_by.clone(),
            exposure,
            knobs: knob_map(&knobs),
            plan,
            passes: pass_facts(&rounds),
            phases_ms: phases.all,
            work: (&rendered.work).into(),
            sampling: Sampling::of(&rendered),
            colour: ColourFacts::of(renderer.plan(), &rendered),
            bvh: renderer.bvh(),
            pipelines: PipelineFacts { count: device.pipelines().len(), spirv_bytes },
            memory: MemoryFacts::now(&device),
            image: film.statistics(),
            validation,
            outputs: written,
            budget: chosen.clone().map(|chosen| json!(chosen)),
        };
        file::write(path, serde_json::to_string_pretty(&report)?.as_bytes())?;
    }
    steps.tell(&sentence(args.picture.size, &rendered, phases.start.elapsed(), &lit_by.sentence));
    drop(steps);
    if !outputs.iter().any(|(path, _)| is_standard(path)) {
        for (path, _) in &outputs {
            print(&path.display().to_string())?;
        }
    }
    if is_cut {
        return Ok(ExitCode::from(INTERRUPTED));
    }
    if let Some(text) = chosen.as_ref().and_then(Chosen::broken) {
        bail!("{text}");
    }
    if let Some(text) = failed {
        bail!("validation: {text}");
    }
    Ok(ExitCode::SUCCESS)
}

/// Checks formats and names of the outputs, then whether they can be written, before any work is done.
fn outputs(args: &RenderArgs) -> Result<Vec<(PathBuf, Format)>> {
    let all = match &args.output[..] {
        [] => {
            let path = PathBuf::from(format!("{}.png", default_stem(&args.scene.scene)?));
            check_same_scene(&path, &args.scene.scene)?;
            vec![(path, Format::Png)]
        }
        paths => usage(named(paths, args))?,
    };
    if !args.aov.is_empty() && !all.iter().any(|(_, format)| *format == Format::Exr) {
        return usage(Err(anyhow!("--aov: layers are written to an EXR; add -o FILE.exr")));
    }
    let files = || all.iter().map(|(path, _)| path).filter(|path| !is_standard(path));
    let check = || -> Result<()> {
        files().try_for_each(|path| args.spares_inputs("--output", path))?;
        args.report.iter().try_for_each(|report| {
            args.spares_inputs("--report", report)?;
            files().try_for_each(|path| differs("--report", report, path))
        })
    };
    usage(check())?;
    files().chain(&args.report).try_for_each(|path| file::check_writable(path))?;
    Ok(all)
}

/// The outputs of `-o` with their formats; no two are one file.
fn named(paths: &[PathBuf], args: &RenderArgs) -> Result<Vec<(PathBuf, Format)>> {
    let mut all: Vec<(PathBuf, Format)> = Vec::new();
    for path in paths {
        let format = output_format(path, args.format)?;
        if is_standard(path) {
            ensure!(!io::stdout().is_terminal(), "--output -: standard output is a terminal; redirect it to a file");
            let is_used = args.progress == ProgressForm::Openjd;
            ensure!(!is_used, "--output - contradicts --progress openjd, which writes to standard output too");
        }
        let mut others = all.iter().map(|(other, _)| other).chain(&args.report);
        ensure!(!others.any(|other| are_same(other, path)), "--output {}: this file is named twice", path.display());
        all.push((path.clone(), format));
    }
    let is_idle = args.format.is_some() && all.iter().all(|(path, _)| format_of(path).is_ok());
    ensure!(!is_idle, "--format: the names of all outputs end in their format already");
    Ok(all)
}

fn facts(scene: &Scene) -> SceneReport {
    SceneReport {
        path: scene.name.clone(),
        triangles: scene.triangles(),
        instances: scene.instances.len(),
        materials: scene.materials.len(),
        lights: scene.lights.len(),
        textures: scene.images.len(),
        warnings: scene.warnings.clone(),
    }
}

fn pass_facts(rounds: &[Vec<etalon::gpu::PassTime>]) -> Vec<PassFacts> {
    let Some(first) = rounds.first() else { return Vec::new() };
    first
        .iter()
        .map(|pass| {
            let times = rounds.iter().flatten().filter(|p| p.name == pass.name).map(|p| p.ms).collect();
            PassFacts { name: pass.name.clone(), gpu_ms: Spread::of(times) }
        })
        .collect()
}
