//! `etalon render --shard` of one picture: draws the part of one process, and resumes a part that was stopped. See
//! docs/farm.md.

use std::iter;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail, ensure};

use super::exposure;
use super::options::PlanExtent;
use super::picture::{RenderArgs, check_layers, is_standard, layers};
use super::progress::Steps;
use super::report::Validation;
use super::setup::Setup;
use super::{print, usage};
use etalon::frame::{Renderer, Settings, Sums, TileShare};
use etalon::gpu::Severity;
use etalon::image::file;
use etalon::plan::Plan;
use etalon::scene::Camera;
use etalon_farm::identity::{Identity, contents, device_name};
use etalon_farm::part::{Drawn, Part, Split};
use etalon_farm::worker::FarmWorker;

/// Least time between two copies of the sums. The process writes the last copy when it receives SIGTERM.
const KEEP: Duration = Duration::from_secs(1);
/// Exit code after SIGTERM, as shells define it.
const TERMINATED: u8 = super::exit_codes::ENDED;

/// Division into tiles, or into samples if the plan uses screen-space reflection or refraction, which read the whole
/// picture.
fn split(args: &RenderArgs, plan: &Plan) -> Result<Split> {
    let looks = plan.screen != etalon::plan::Screen::default();
    match args.sequence.split.map(Split::from) {
        Some(Split::Tiles) if looks => bail!(
            "--split tiles: reflection=screen and refraction=screen need the whole picture, not a tile of it; choose --split samples"
        ),
        Some(split) => Ok(split),
        None => Ok(if looks { Split::Samples } else { Split::Tiles }),
    }
}

/// The output of a part, after a check of the options that are about whole pictures.
pub(super) fn only_output<'a>(args: &'a RenderArgs, [index, of]: [u32; 2], settings: &Settings) -> Result<&'a PathBuf> {
    ensure!(args.repeat == 1, "--repeat does not work with --shard: a part of a picture is drawn once");
    ensure!(args.within.is_none(), "--within chooses rungs for one process; with --shard choose rungs with --set");
    ensure!(args.picture.plan != PlanExtent::ExplainCost, "--plan explain-cost works with a whole picture only");
    ensure!(
        args.report.is_none(),
        "--report: a part file holds its own report; `etalon merge --report` writes the report of all parts"
    );
    let [output] = &args.output[..] else {
        bail!("--shard {index}/{of}: name the one file of this part with -o, for example -o {index}.part")
    };
    ensure!(!is_standard(output), "--output -: a part is continued from its file; name one");
    args.spares_inputs("--output", output)?;
    check_layers(&args.aov, settings)?;
    ensure!(
        settings.max_error.is_none(),
        "--max-error: a process that draws a part does not know the error of the whole picture; choose --set samples"
    );
    Ok(output)
}

/// Runs the command.
///
/// # Errors
/// One sentence with the action, its object and the cause.
pub(super) fn run(args: &RenderArgs, shard: [u32; 2], quiet: bool) -> Result<ExitCode> {
    let begun = Instant::now();
    let [index, of] = shard;
    let mut settings = args.render_settings()?;
    usage(args.sequence.check_one())?;
    let output = usage(only_output(args, shard, &settings))?;
    file::check_writable(output)?;
    let stopped = Arc::new(AtomicBool::new(false));
    signal_hook::flag::register(signal_hook::consts::SIGTERM, stopped.clone())
        .context("installing the handler of SIGTERM")?;
    let steps = Steps::new(args.progress, quiet);
    steps.step(&format!("loading {}", args.scene.label()), 1);
    let prune = args.picture.prune(&args.scene, &settings.knobs);
    let setup = Setup::load(&args.scene, prune, &args.device)?;
    args.spares_files(setup.opened.scene(), iter::once(output.as_path()))?;
    args.picture.colour_of(setup.opened.scene(), &mut settings.knobs)?;
    setup.opened.warnings.iter().for_each(|warning| tracing::warn!("{warning}"));
    let camera = args.scene.choose_camera(setup.opened.scene(), settings.size)?;
    let exposure = exposure::choose(args.picture.exposure, &setup.opened, &setup.device, &settings, &camera)?;
    settings.exposure = exposure.stops;
    let plan = setup.opened.plan(settings.clone())?;
    let lit_by = setup.opened.sources(&settings).lit_by(&plan);
    [Some(lit_by.sentence), exposure.sentence].iter().flatten().for_each(|line| steps.tell(line));
    let split = split(args, &plan)?;
    if split == Split::Tiles {
        settings.share = TileShare { index: index - 1, of };
        ensure!(
            of <= TileShare::ALL.tiles(settings.size),
            "--shard {index}/{of}: a picture of {}x{} has fewer tiles of 8x8 pixels than parts",
            settings.size[0],
            settings.size[1]
        );
    } else {
        ensure!(settings.parts.is_empty(), "--split samples: --aov reflection and refraction need --split tiles");
    }
    let scene = contents(setup.opened.scene(), setup.opened.environment());
    let device = setup.device.clone();
    let (_, lit) = setup.opened.lit(settings.clone());
    steps.step("uploading", 1);
    let (renderer, camera) = setup.renderer(&args.scene, settings)?;
    renderer.warnings.iter().for_each(|warning| tracing::warn!("{warning}"));
    let mut identity = Identity::of(&args.scene.scene, scene, &camera, &lit, device.info());
    identity.settings.insert("aov".to_owned(), format!("{:?}", args.aov));
    identity.settings.insert("plan".to_owned(), format!("{:?}", args.picture.plan));
    let mut work =
        ShardWork { args, renderer, camera, steps: &steps, stopped: &stopped, begun, prepared: begun.elapsed() };
    let starts = work.renderer.block_starts();
    let wanted = match split {
        Split::Tiles => vec![starts[0], starts[starts.len() - 1]],
        Split::Samples => {
            let blocks = starts.len() as u32 - 1;
            ensure!(
                of <= blocks,
                "--shard {index}/{of} --split samples: the {} samples are added in {blocks} blocks, and there can be no more parts than \
                 blocks; --split tiles allows more",
                work.renderer.plan().samples
            );
            let at = |i: u32| (u64::from(blocks) * u64::from(i) / u64::from(of)) as usize;
            starts[at(index - 1)..=at(index)].to_vec()
        }
    };
    let drawn = |work: &ShardWork<'_>, pieces: Vec<Sums>, aovs| Drawn {
        identity: identity.clone(),
        shard,
        split,
        samples: work.renderer.plan().samples,
        bands: work.renderer.plan().bands,
        parts: lit.parts.iter().map(|part| part.name().to_owned()).collect(),
        wanted: [wanted[0], wanted[wanted.len() - 1]],
        pieces,
        aovs,
        worker: work.worker(),
    };
    let known = match Part::read(output) {
        Ok(known) => {
            let same = known.head.identity.same_as(&identity).is_ok()
                && (known.head.shard, known.head.split, known.head.samples)
                    == (shard, split, work.renderer.plan().samples);
            if same && known.is_whole() {
                steps.tell(&format!("{} is already complete", output.display()));
                drop(steps);
                return print(&output.display().to_string()).map(|()| ExitCode::SUCCESS);
            }
            if same { known.into_sums() } else { Vec::new() }
        }
        // There is no file, or it is not a part.
        Err(_) => Vec::new(),
    };
    let (pieces, is_whole) = match split {
        Split::Tiles => work.tiles(&starts, known.into_iter().next())?,
        Split::Samples => work.samples(&wanted, known)?,
    };
    let aovs = if index == 1 && is_whole { work.layers()? } else { Vec::new() };
    if !pieces.is_empty() {
        steps.step("encoding", 1);
        file::write(output, &Part::of(drawn(&work, pieces, aovs))?.encode()?)?;
    }
    if !is_whole {
        drop(steps);
        tracing::warn!("stopped by SIGTERM; the same command continues from {}", output.display());
        return Ok(ExitCode::from(TERMINATED));
    }
    drop(steps);
    print(&output.display().to_string())?;
    let messages = Validation::of(&device, args.device.validate).messages;
    match messages.iter().find(|message| message.severity == Severity::Error) {
        Some(message) => bail!("validation: {}", message.text),
        None => Ok(ExitCode::SUCCESS),
    }
}

/// State of drawing a part.
struct ShardWork<'a> {
    args: &'a RenderArgs,
    renderer: Renderer,
    camera: Camera,
    steps: &'a Steps,
    stopped: &'a AtomicBool,
    begun: Instant,
    prepared: Duration,
}

impl ShardWork<'_> {
    fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    fn worker(&self) -> FarmWorker {
        FarmWorker::here(device_name(self.renderer.device().info()), self.begun.elapsed(), self.prepared)
    }

    /// Draws all samples of a share of the tiles; returns the sums and whether the part is complete.
    fn tiles(&mut self, starts: &[u32], known: Option<Sums>) -> Result<(Vec<Sums>, bool)> {
        let end = starts[starts.len() - 1];
        let from = known.as_ref().map_or(0, |known| known.samples[1]);
        self.steps.step("drawing", end);
        let mut drawing = self.renderer.begin_part(&self.camera, [from, end], known.as_ref())?;
        let (mut kept, mut when) = (known, Instant::now());
        while !drawing.is_done() {
            if self.is_stopped() {
                return Ok((kept.into_iter().collect(), false));
            }
            self.renderer.step(&mut drawing)?;
            let done = drawing.samples();
            self.steps.at(done);
            self.steps.done(f64::from(done) / f64::from(end));
            if drawing.is_whole() && starts.contains(&done) && (when.elapsed() >= KEEP || kept.is_none()) {
                kept = Some(self.renderer.sums(&drawing)?);
                when = Instant::now();
            }
        }
        Ok((vec![self.renderer.sums(&drawing)?], true))
    }

    /// Draws some blocks of samples for all pixels; returns the sums of each block and whether the part is complete.
    fn samples(&mut self, starts: &[u32], mut pieces: Vec<Sums>) -> Result<(Vec<Sums>, bool)> {
        let (first, end) = (starts[0], starts[starts.len() - 1]);
        self.steps.step("drawing", end - first);
        for block in starts.windows(2).skip(pieces.len()) {
            let mut drawing = self.renderer.begin_part(&self.camera, [block[0], block[1]], None)?;
            while !drawing.is_done() {
                if self.is_stopped() {
                    return Ok((pieces, false));
                }
                self.renderer.step(&mut drawing)?;
                let done = drawing.samples() - first;
                self.steps.at(done);
                self.steps.done(f64::from(done) / f64::from(end - first));
            }
            pieces.push(self.renderer.sums(&drawing)?);
        }
        Ok((pieces, true))
    }

    /// Layers of surfaces. Layers of half buffers are computed by `etalon merge`.
    fn layers(&mut self) -> Result<Vec<etalon::image::Aov>> {
        let own = self.args.aov.iter().copied().filter(|name| name.part().is_none() && !name.of_halves());
        let names: Vec<_> = own.collect();
        if names.is_empty() { Ok(Vec::new()) } else { layers(&mut self.renderer, &self.camera, &names) }
    }
}

/// Settings that convert a film to display values, read from the identity of a part.
pub(super) fn display_settings(identity: &Identity) -> Settings {
    let text = |name: &str| identity.settings.get(name).map_or("", String::as_str);
    let tonemap = etalon::image::tone::ToneMap::ALL.iter().copied().find(|curve| curve.name() == text("tonemap"));
    Settings {
        size: identity.size,
        tonemap: tonemap.unwrap_or_default(),
        exposure: text("exposure").parse().unwrap_or_default(),
        background: super::options::background(text("background")).unwrap_or_default(),
        ..Settings::default()
    }
}
