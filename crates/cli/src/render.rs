//! `etalon render`: one picture, or a sequence of them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context as _, Result, anyhow, bail};
use clap::{Args, ValueEnum};
use glam::DVec3;
use serde_json::json;

use super::budget::{Budget, Chosen, command};
use super::options::{DeviceOptions, Extent, PictureOptions, SceneOptions};
use super::plan::cost_table;
use super::print;
use super::progress::{ProgressForm, Steps};
use super::report::{
    ColourFacts, MemoryFacts, Output, PassFacts, PipelineFacts, PlanFacts, Report, Sampling, SceneFacts, Spread,
    Validation, knob_map,
};
use super::sequence::{self, SequenceOptions};
use super::setup::Setup;
use super::shard;
use etalon::frame::{Part, Rendered, Renderer, Settings};
use etalon::gpu::Severity;
use etalon::image::{Aov, AovData, Picture, exr, file};
use etalon::plan::rungs::Indirect;
use etalon::plan::{Knobs, Plan};
use etalon::scene::{Camera, Reads, Scene};
use etalon::share::AovPixel;
use etalon::spectra;
use etalon::upload::view::View;

/// Draw a picture of a scene.
#[derive(Debug, Clone, Args)]
pub struct RenderArgs {
    #[command(flatten)]
    pub(super) scene: SceneOptions,
    /// Output file: .png (display) or .exr (scene-linear radiance); repeatable [default: the scene's name with .png]. Of a sequence also
    /// .apng, an animated preview; of a part of a picture the one file that it goes to
    #[arg(short, long, value_name = "FILE")]
    pub(super) output: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) picture: PictureOptions,
    /// Choose the rungs with the least error that take no more GPU time than this, out of what `cost` measured of the same picture
    /// on this device or is measured first
    #[arg(long, value_name = "MS")]
    pub(super) within: Option<String>,
    #[command(flatten)]
    pub(super) device: DeviceOptions,
    /// Further layers of the EXR: the nearest opaque surface at the pixel centres; and, of the picture itself, the light
    /// that rays brought which were first mirrored (reflection) or first went through (refraction)
    #[arg(long, value_enum, value_delimiter = ',', value_name = "NAME,...")]
    pub(super) aov: Vec<AovName>,
    /// Draw N times and fail unless all are bit-identical
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) repeat: u32,
    /// Write a machine-readable account of the run
    #[arg(long, value_name = "FILE.json")]
    pub(super) report: Option<PathBuf>,
    /// How progress is told
    #[arg(long, value_enum, default_value_t = ProgressForm::Auto)]
    pub progress: ProgressForm,
    #[command(flatten)]
    pub(super) sequence: SequenceOptions,
}

impl RenderArgs {
    /// What the renderer needs to know.
    pub(super) fn render_settings(&self) -> Result<Settings> {
        let mut settings = self.picture.settings(&self.scene)?;
        for part in self.aov.iter().filter_map(|name| name.part()) {
            if !settings.parts.contains(&part) {
                settings.parts.push(part);
            }
        }
        Ok(settings)
    }
}

/// Layers that can be asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum AovName {
    /// Base colour.
    Albedo,
    /// Shading normal in world space.
    Normal,
    /// Normal of the triangle, towards the viewer.
    GeometricNormal,
    /// Position in world space, metres.
    Position,
    /// Distance along the viewing direction, metres.
    Depth,
    /// Distance from the eye, metres.
    Distance,
    /// Perceptual roughness.
    Roughness,
    /// Metallic.
    Metallic,
    /// Emitted radiance.
    Emissive,
    /// Index of the material, counted from 1; 0 is nothing.
    Material,
    /// Index of the instance, counted from 1; 0 is nothing.
    Instance,
    /// Radiance by rays that the nearest surface mirrored.
    Reflection,
    /// Radiance by rays that went through it.
    Refraction,
    /// Of a picture by paths, the variance of each pixel that its halves tell.
    Variance,
    /// The mean of its even samples.
    HalfA,
    /// The mean of its odd samples, whose random numbers have nothing in common with those of the even ones.
    HalfB,
}

impl AovName {
    /// Of the picture, not of the surfaces.
    pub(super) fn part(self) -> Option<Part> {
        match self {
            Self::Reflection => Some(Part::Reflection),
            Self::Refraction => Some(Part::Refraction),
            _ => None,
        }
    }

    /// Told by the halves of a picture's samples.
    pub(super) fn of_halves(self) -> bool {
        matches!(self, Self::Variance | Self::HalfA | Self::HalfB)
    }
}

/// What an output path asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    Png,
    Exr,
}

pub(super) fn format_of(path: &Path) -> Result<Format> {
    match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
        Some("png") => Ok(Format::Png),
        Some("exr") => Ok(Format::Exr),
        _ => bail!("--output {}: only .png and .exr are written", path.display()),
    }
}

/// Wall time of named phases.
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
/// One sentence with what was being done, to what, and the cause.
pub fn run(args: &RenderArgs, quiet: bool) -> Result<ExitCode> {
    if args.sequence.is_sequence() {
        return sequence::run(args, quiet);
    }
    if let Some(part) = args.sequence.shard {
        return shard::run(args, part, quiet);
    }
    let now = Instant::now();
    let mut phases =
        Phases { start: now, last: now, all: BTreeMap::from(["bvh", "pipelines"].map(|name| (name, 0.0))) };
    let outputs = outputs(args)?;
    let budget = Budget::of(args.within.as_deref(), &args.picture)?;
    let mut settings = args.render_settings()?;
    let steps = Steps::new(args.progress, quiet);
    phases.end("start");

    steps.step(&format!("loading {}", args.scene.scene), 1);
    let reads = if budget.is_some() { Reads::Everything } else { args.picture.reads(&args.scene, &settings.knobs) };
    let setup = Setup::load(&args.scene, reads, &args.device)?;
    phases.end("load");
    let mut chosen = None;
    if let Some(budget) = budget {
        let command = command(&args.scene, &args.picture, &args.device);
        let found = budget.choose([&args.scene.scene, &command], &args.scene, &setup, &settings, &steps)?;
        settings.max_error = None;
        settings.knobs = found.knobs.clone();
        chosen = Some(found);
        phases.end("choose");
    } else {
        args.picture.colour_of(setup.opened.scene(), &mut settings.knobs)?;
    }
    let device = setup.device.clone();
    let info = device.info().clone();
    if !quiet {
        let software = if info.kind == "cpu" { ", a software device" } else { "" };
        steps.say(&format!("drawing on {} ({}{software})", info.name, info.driver));
    }
    for warning in &setup.opened.warnings {
        tracing::warn!("{warning}");
    }
    let facts = facts(setup.opened.scene());

    check_halves(&args.aov, &settings)?;
    steps.step("uploading", 1);
    let knobs = settings.knobs.clone();
    let explained = (args.picture.plan == Extent::ExplainCost).then(|| (setup.clone(), settings.clone()));
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

    let samples = renderer.plan().samples;
    let mut rounds = Vec::new();
    let mut first: Option<(Rendered, Option<Picture>)> = None;
    if chosen.is_some() {
        // A budget is that of a picture with everything compiled, as tables are.
        renderer.render_samples(&camera, 2, &mut |_| ())?;
        phases.end("frame");
    }
    let needs_film =
        args.report.is_some() || outputs.iter().any(|(_, format)| *format == Format::Exr) || args.repeat > 1;
    for round in 0..args.repeat {
        steps.step("drawing", samples);
        let mut clock = Instant::now();
        let begun = clock;
        let rendered = renderer.render(&camera, &mut |progress| steps.sampled(progress, begun, &mut clock))?;
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
                    bail!("--repeat: picture {} differs from the first", round + 1);
                }
            }
        }
    }
    let (rendered, film) = first.ok_or_else(|| anyhow!("nothing was drawn"))?;
    if let Some(chosen) = &mut chosen {
        chosen.check(&rendered, args.picture.size, &mut renderer, &camera)?;
    }
    let aovs = if args.aov.is_empty() { Vec::new() } else { layers(&mut renderer, &camera, &args.aov)? };
    phases.end("readback");
    warn_about(&rendered, settings_size(&args.picture), &knobs, renderer.plan().bands);

    steps.step("encoding", outputs.len() as u32);
    let mut written = Vec::new();
    for (index, (path, format)) in outputs.iter().enumerate() {
        let bytes = match (format, &film) {
            (Format::Exr, Some(film)) => exr::encode_exr(film, &aovs, &metadata(args, renderer.plan()))?,
            _ => renderer.png(&rendered)?,
        };
        file::write(path, &bytes)?;
        written.push(Output { path: path.display().to_string(), hash: file::hash(&bytes) });
        steps.at(index as u32 + 1);
    }
    phases.end("encode");
    let costs = match &explained {
        Some((setup, settings)) => {
            let effects = &renderer.plan().effects;
            let prices = setup.prices(&args.scene, &args.device, settings.clone(), effects, &mut |effect| {
                steps.step(&format!("measuring what \"{effect}\" would cost"), 1);
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
    drop(steps);
    for (path, _) in &outputs {
        print(&path.display().to_string())?;
    }
    if let Some(text) = chosen.as_ref().and_then(Chosen::broken) {
        bail!("{text}");
    }
    if let Some(text) = failed {
        bail!("validation: {text}");
    }
    Ok(ExitCode::SUCCESS)
}

pub(super) fn settings_size(picture: &PictureOptions) -> u64 {
    u64::from(picture.size[0]) * u64::from(picture.size[1])
}

/// Checks everything about the outputs that can be checked before any work is done.
fn outputs(args: &RenderArgs) -> Result<Vec<(PathBuf, Format)>> {
    let mut paths = args.output.clone();
    if paths.is_empty() {
        let name = args.scene.scene.strip_prefix("study:").map_or_else(|| Path::new(&args.scene.scene), Path::new);
        paths.push(PathBuf::from(name.file_stem().unwrap_or_default()).with_extension("png"));
    }
    let mut all = Vec::new();
    for path in paths {
        let format = format_of(&path)?;
        file::check_writable(&path)?;
        if all.iter().any(|(known, _)| *known == path) {
            bail!("--output {}: named twice", path.display());
        }
        all.push((path, format));
    }
    if let Some(report) = &args.report {
        file::check_writable(report)?;
    }
    if !args.aov.is_empty() && !all.iter().any(|(_, format)| *format == Format::Exr) {
        bail!("--aov: layers go into an EXR; add -o FILE.exr");
    }
    Ok(all)
}

fn facts(scene: &Scene) -> SceneFacts {
    SceneFacts {
        path: scene.name.clone(),
        triangles: scene.triangles(),
        instances: scene.instances.len(),
        materials: scene.materials.len(),
        lights: scene.lights.len(),
        textures: scene.images.len(),
        warnings: scene.warnings.clone(),
    }
}

/// What the EXR says of its making.
pub(super) fn metadata(args: &RenderArgs, plan: &Plan) -> Vec<(String, String)> {
    made(&args.scene.scene, plan.bands)
}

/// The same of a scene, in so many bands of wavelengths.
pub(super) fn made(scene: &str, bands: u32) -> Vec<(String, String)> {
    let mut all = vec![
        ("software".to_owned(), format!("etalon {}", env!("CARGO_PKG_VERSION"))),
        ("scene".to_owned(), scene.to_owned()),
    ];
    if bands > 0 {
        all.push(("observer".to_owned(), spectra::OBSERVER.to_owned()));
    }
    all
}

pub(super) fn warn_about(rendered: &Rendered, pixels: u64, knobs: &Knobs, bands: u32) {
    let counts = rendered.counts;
    let negative = if bands > 0 { 0 } else { counts.negative };
    if bands > 0 && counts.negative > 0 {
        tracing::warn!(
            "{} of {pixels} pixels have colours outside of Rec. 709: shown less saturated at the same luminance, negative in \
             an EXR",
            counts.negative
        );
    }
    for (count, what) in [(counts.nan, "NaN"), (counts.inf, "infinite"), (negative, "negative")] {
        if count > 0 {
            tracing::warn!("{count} of {pixels} pixels hold {what} radiance, shown as black or white");
        }
    }
    let work = &rendered.work;
    if let Some(first) = work.first_not_finite {
        tracing::warn!(
            "{} estimates of paths were no finite numbers and were left out; the first at pixel {},{}, surface {} of its path, \
             material {}",
            work.not_finite,
            first.pixel[0],
            first.pixel[1],
            first.event,
            first.material
        );
    }
    if work.stray_interfaces > 0 {
        tracing::warn!(
            "{} rays left a transparent body that they had not entered: shells that are open, turned or cross without \
             priorities (extras.etalon.priority)",
            work.stray_interfaces
        );
    }
    if work.mean_lost > 0.01 {
        tracing::warn!(
            "{:.1} % of the light was not followed to its end, in the worst pixel {:.0} %{}",
            work.mean_lost * 100.0,
            work.most_lost * 100.0,
            if knobs.interfaces.count() < 32 { ": --set interfaces=32 follows more" } else { "" }
        );
    }
    if rendered.dropped > 0 {
        tracing::warn!(
            "{} pixels have more see-through surfaces than one invocation sorts; their farthest were left out",
            rendered.dropped
        );
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

/// Layers of halves are those of pictures that have halves.
pub(super) fn check_halves(names: &[AovName], settings: &Settings) -> Result<()> {
    if let Some(name) = names.iter().find(|name| name.of_halves()) {
        let name = name.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned());
        if settings.knobs.indirect != Indirect::Path {
            bail!("--aov {name}: only paths tell their error; add --model global");
        }
        if settings.knobs.samples.count() == 1 && settings.max_error.is_none() {
            bail!("--aov {name}: one sample has no halves; add --set samples=4");
        }
    }
    Ok(())
}

/// The asked layers in the order asked.
pub(super) fn layers(renderer: &mut Renderer, camera: &Camera, names: &[AovName]) -> Result<Vec<Aov>> {
    let (pixels, view) = renderer.aovs(camera).context("reading the G-buffer")?;
    let of = |&name: &AovName| match name.part() {
        Some(part) => layer_of_part(renderer, part),
        None if name.of_halves() => layer_of_halves(renderer, name),
        None => Ok(layer(&pixels, &view, name)),
    };
    names.iter().map(of).collect()
}

fn layer_of_part(renderer: &Renderer, part: Part) -> Result<Aov> {
    let picture = renderer.part(part)?.ok_or_else(|| anyhow!("--aov {}: this layer was not drawn", part.name()))?;
    Ok(Aov {
        name: part.name().to_owned(),
        channels: ["R", "G", "B"].map(str::to_owned).into(),
        samples: AovData::F32(picture.rgba.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect()),
    })
}

fn layer_of_halves(renderer: &Renderer, name: AovName) -> Result<Aov> {
    let halves = renderer.half_means()?;
    let halves = halves.ok_or_else(|| anyhow!("--aov: variance and halves are those of several samples by paths"))?;
    Ok(layer_between(&halves, name))
}

/// What the means of even and odd samples tell.
pub(super) fn layer_between([a, b]: &[Picture; 2], name: AovName) -> Aov {
    let colors = |picture: &Picture| -> Vec<f32> { picture.rgba.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect() };
    let variance = |(a, b): (&f32, &f32)| (0.5 * (a - b)).powi(2);
    let (title, samples) = match name {
        AovName::HalfA => ("half_a", colors(a)),
        AovName::HalfB => ("half_b", colors(b)),
        _ => ("variance", colors(a).iter().zip(&colors(b)).map(variance).collect()),
    };
    Aov { name: title.to_owned(), channels: ["R", "G", "B"].map(str::to_owned).into(), samples: AovData::F32(samples) }
}

fn layer(pixels: &[AovPixel], view: &View, name: AovName) -> Aov {
    let drawn = |p: &AovPixel| p.material != 0;
    let vectors = |get: &dyn Fn(&AovPixel) -> [f32; 3]| AovData::F32(pixels.iter().flat_map(get).collect());
    let numbers = |get: &dyn Fn(&AovPixel) -> f32| AovData::F32(pixels.iter().map(get).collect());
    let (rgb, xyz): (&[&str], &[&str]) = (&["R", "G", "B"], &["X", "Y", "Z"]);
    // World positions are sums in f64: far from the origin f32 is only good for the difference.
    let world = |p: &AovPixel| {
        if drawn(p) { (glam::Vec3::from(p.p_rel).as_dvec3() + view.eye).as_vec3().to_array() } else { [0.0; 3] }
    };
    let along = |p: &AovPixel| {
        let p_rel: DVec3 = glam::Vec3::from(p.p_rel).as_dvec3();
        p_rel.dot(view.axes[2]) as f32
    };
    let (title, channels, samples) = match name {
        AovName::Albedo => ("albedo", rgb, vectors(&|p| p.albedo)),
        AovName::Normal => ("normal", xyz, vectors(&|p| p.normal)),
        AovName::GeometricNormal => ("geometric_normal", xyz, vectors(&|p| p.geometric_normal)),
        AovName::Position => ("position", xyz, vectors(&world)),
        AovName::Depth => ("depth", &["Z"][..], numbers(&along)),
        AovName::Distance => ("distance", &["Z"][..], numbers(&|p| p.distance)),
        AovName::Roughness => ("roughness", &["Y"][..], numbers(&|p| p.roughness)),
        AovName::Metallic => ("metallic", &["Y"][..], numbers(&|p| p.metallic)),
        AovName::Emissive => ("emissive", rgb, vectors(&|p| p.emissive)),
        AovName::Material => ("material", &["id"][..], AovData::U32(pixels.iter().map(|p| p.material).collect())),
        AovName::Instance => ("instance", &["id"][..], AovData::U32(pixels.iter().map(|p| p.instance).collect())),
        AovName::Reflection | AovName::Refraction | AovName::Variance | AovName::HalfA | AovName::HalfB => {
            unreachable!("of the picture")
        }
    };
    Aov { name: title.to_owned(), channels: channels.iter().map(|c| (*c).to_owned()).collect(), samples }
}
