//! Chooses rungs for a time or error budget (`render --within`, `--max-error`) from measurements of `etalon cost`.
//!
//! The measurements are of the same picture on the same device, and are kept in the cache folder. Where there are none,
//! a quick run measures first. See docs/cost.md, "Budgets of pictures".

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, Result, bail};
use serde::Serialize;

use super::options::{DeviceOptions, PictureOptions, SceneOptions};
use super::progress::Steps;
use super::setup::Setup;
use etalon::frame::{Rendered, Renderer, Settings};
use etalon::gpu::DeviceInfo;
use etalon::image::file;
use etalon::image::png::Display;
use etalon::plan::{ForcedEffects, Knobs};
use etalon::scene::Camera;
use etalon_cost::choose::{SPARE, at_most, most_exact, quickest, within};
use etalon_cost::difference::Truth;
use etalon_cost::reference::{NotMeasured, Refined};
use etalon_cost::statistics::Interval;
use etalon_cost::sweep::{Listener, Sweep, SweepExtent, extent_of};
use etalon_cost::table::{Point, Table};
use etalon_cost::warm::Bench;

/// Seconds of the quick run that measures where no table is kept.
const QUICK_S: u32 = 60;
/// Points that are timed before the fastest point is taken.
const TRIALS: usize = 4;
/// Random seed of all measurements; the seed of the picture does not change the choice.
const SEED: u32 = 0;
/// Files of a run that are kept for later budgets: the table, which is written last, and the reference.
const KEPT: [&str; 4] = ["cost.json", "reference.png", "reference.exr", "reference.json"];

/// Limit for a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Budget {
    /// Milliseconds of GPU time.
    Within(f64),
    /// Root mean squared error of displayed values 0 to 1 against the scene's reference.
    MaxError(f64),
}

/// The chosen rungs, their measurements, and the measurements of the picture drawn with them.
#[derive(Clone, Serialize)]
pub(super) struct Chosen {
    /// `within` or `max-error`.
    budget: &'static str,
    /// Milliseconds, or a fraction of the range of displayed values.
    limit: f64,
    /// Name of the chosen point of the table.
    point: String,
    /// Measured GPU time of the point, in milliseconds.
    gpu_ms: Interval,
    /// Measured error of the point against the reference.
    error: Interval,
    /// Whether a measured point keeps the limit.
    possible: bool,
    /// Knobs whose rungs differ from the reference.
    given_up: String,
    /// GPU milliseconds of the picture: the median of three renders where the first took longer than the limit.
    pub(super) took_ms: Option<f64>,
    /// Error of the picture against the reference.
    pub(super) found_error: Option<Interval>,
    #[serde(skip)]
    pub(super) knobs: Knobs,
    #[serde(skip)]
    truth: Arc<Truth>,
}

/// The command line of a picture without its knobs: scene, camera, size, display and device.
pub(super) fn command(scene: &SceneOptions, picture: &PictureOptions, device: &DeviceOptions) -> String {
    format!("etalon render {}", [scene.words(), picture.words(), device.words()].concat().join(" "))
}

/// Cache folder of the measurements of a picture on a device. The name is a hash of the program version, the command,
/// the scene contents, the device and its driver.
fn folder(command: &str, contents: &str, info: &DeviceInfo) -> Option<PathBuf> {
    let version = env!("CARGO_PKG_VERSION");
    let known = [version, command, contents, &info.name, &info.driver, &info.version].join("\n");
    Some(file::cache_folder()?.join(format!("cost-{}", file::hash(known.as_bytes()))))
}

/// Cache folder with the reference of an earlier run of the same picture.
pub(super) fn kept(command: &str, setup: &Setup) -> Option<PathBuf> {
    folder(command, &setup.contents(), setup.device.info())
}

/// The kept table of a picture; `None` where it has not been measured.
#[cfg(feature = "window")]
pub(super) fn known(command: &str, contents: &str, info: &DeviceInfo) -> Option<Table> {
    let bytes = file::read(&folder(command, contents, info)?.join("cost.json")).ok()?;
    serde_json::from_slice(&bytes).ok()
}

/// Copies the table and the reference of a finished run to the cache, unless the ones there are better. Where the cache
/// cannot be written, later budgets measure again.
pub(super) fn keep(command: &str, setup: &Setup, from: &Path) {
    let Some(to) = folder(command, &setup.contents(), setup.device.info()) else { return };
    let read =
        |folder: &Path| -> Option<Table> { serde_json::from_slice(&file::read(&folder.join("cost.json")).ok()?).ok() };
    let [before, now] = [&to, from].map(read);
    let better =
        |of: &dyn Fn(&Table) -> (u32, u32)| before.as_ref().is_none_or(|known| now.as_ref().map(of) >= Some(of(known)));
    if !better(&|table| table.reference.extent()) {
        return;
    }
    let [table, reference @ ..] = KEPT;
    let has_more = better(&|table| (table.points.len() as u32, 0));
    let copy = || -> Result<()> {
        if has_more {
            // The run.json of a quick run does not describe this table.
            let _ = std::fs::remove_dir_all(&to);
        }
        std::fs::create_dir_all(&to)?;
        for name in reference.into_iter().chain(has_more.then_some(table)) {
            file::write(&to.join(name), &file::read(&from.join(name))?)?;
        }
        Ok(())
    };
    if let Err(error) = copy() {
        tracing::info!("the measurements cannot be kept for --within: {error:#}");
    }
}

impl Budget {
    /// The budget that the options give; `None` where the user chooses the rungs.
    ///
    /// # Errors
    /// One sentence for options that contradict the budget.
    pub(super) fn of(within: Option<f64>, picture: &PictureOptions) -> Result<Option<Self>> {
        let chosen = !picture.set.is_empty() || picture.model.is_some();
        match (within, picture.max_error) {
            (Some(_), _) if chosen => {
                bail!("--within contradicts --model and --set: --within chooses the rungs itself")
            }
            (Some(_), Some(_)) => bail!("--within contradicts --max-error: give only one limit"),
            (Some(ms), None) => Ok(Some(Self::Within(ms))),
            (None, Some(_)) if chosen => picture.check_error_is_told().map(|()| None),
            (None, limit) => Ok(limit.map(Self::MaxError)),
        }
    }

    /// Chooses rungs. A time limit gets the rungs with the least error that keep the limit when they are timed now; an
    /// error limit gets the fastest rungs that keep it. Where no measured rungs keep the limit, the closest ones are
    /// chosen.
    ///
    /// # Errors
    /// When nothing can be measured.
    pub(super) fn choose(
        self,
        [scene, command]: [&str; 2],
        options: &SceneOptions,
        setup: &Setup,
        settings: &Settings,
        steps: &Steps,
    ) -> Result<Chosen> {
        // No table depends on extra layers, forced effects or the seed.
        let forced = ForcedEffects::None;
        let settings = Settings { max_error: None, forced, parts: Vec::new(), seed: SEED, ..settings.clone() };
        let temporary = tempfile::tempdir().context("creating a temporary folder")?;
        let kept = folder(command, &setup.contents(), setup.device.info())
            .filter(|kept| std::fs::create_dir_all(kept).is_ok());
        let folder = kept.unwrap_or_else(|| temporary.path().join("cost"));
        let (table, truth) = match measured(&folder, &settings) {
            Ok(known) => known,
            Err(_) => {
                steps.tell(
                    "this picture has not been measured on this device: a quick measurement comes first (etalon cost measures more precisely)",
                );
                measure(&folder, [scene, command], options, setup, &settings, steps)?;
                measured(&folder, &settings)?
            }
        };
        setup.bench(options, settings, |bench| self.choose_of(&table, truth, &bench, steps))
    }

    fn choose_of(self, table: &Table, truth: Truth, bench: &Bench<'_>, steps: &Steps) -> Result<Chosen> {
        let (budget, limit) = match self {
            Self::Within(ms) => ("within", ms),
            Self::MaxError(error) => ("max-error", error),
        };
        let nothing = "the table has no points: a bug of Etalon";
        let (point, possible) = match self {
            Self::Within(ms) => match first_that_fits(table, ms, bench)? {
                Some(point) => (point, true),
                None => (quickest(table).context(nothing)?, false),
            },
            Self::MaxError(error) => match at_most(table, error) {
                Some(point) => (point, true),
                None => (most_exact(table).context(nothing)?, false),
            },
        };
        let chosen = Chosen {
            budget,
            limit,
            point: point.name.clone(),
            gpu_ms: point.gpu_ms,
            error: point.errors.error,
            possible,
            given_up: table.given_up(point),
            took_ms: None,
            found_error: None,
            knobs: point.rungs()?,
            truth: Arc::new(truth),
        };
        let Interval { median, low, high } = chosen.error;
        let nearest = if possible { String::new() } else { format!(" ({NEAREST})") };
        steps.tell(&format!(
            "{budget} {limit}: using \"{}\"{nearest}: {:.1} ms ({:.1} … {:.1}) and an error of {:.2} % ({:.2} … {:.2}) when measured; \
             simplified: {}",
            chosen.point,
            chosen.gpu_ms.median,
            chosen.gpu_ms.low,
            chosen.gpu_ms.high,
            100.0 * median,
            100.0 * low,
            100.0 * high,
            chosen.given_up
        ));
        Ok(chosen)
    }
}

/// What is said of a choice that may break its limit.
const NEAREST: &str = "no measured choice is sure to keep the limit; this one comes closest";

/// Reads a kept table and its reference.
fn measured(folder: &Path, settings: &Settings) -> Result<(Table, Truth)> {
    let table = serde_json::from_slice(&file::read(&folder.join("cost.json"))?)?;
    let (refined, _) = Refined::read(folder)?.context("the folder has no reference")?;
    Ok((table, refined.truth(&settings.view_transform())))
}

/// Measures with a budget of [`QUICK_S`] seconds, or with the smallest budget that measures something.
fn measure(
    folder: &Path,
    [scene, command]: [&str; 2],
    options: &SceneOptions,
    setup: &Setup,
    settings: &Settings,
    steps: &Steps,
) -> Result<()> {
    let contents = setup.contents();
    let run = |budget_s: u32| -> Result<Table> {
        let extent = SweepExtent { budget_s, reference_samples: None, shard: [1, 1] };
        if extent_of(folder).as_ref() != Some(&extent) {
            // Remove the remains of an unfinished run.
            let _ = std::fs::remove_dir_all(folder);
        }
        setup.bench(options, settings.clone(), |bench| {
            let extent = extent.clone();
            let sweep = Sweep {
                bench,
                folder,
                extent,
                command: &|_| command.to_owned(),
                scene,
                contents: &contents,
                kept: &|_| None,
                may_shrink: false,
                others: &[],
                stopped: &|| false,
            };
            sweep.run(&mut Listener {
                step: &mut |step| steps.of(step.name, step.done, step.of, step.left_s),
                early: &mut |_| Ok(()),
            })
        })
    };
    let table = run(QUICK_S).or_else(|error| match error.downcast_ref::<NotMeasured>() {
        Some(small) => run(small.enough_s),
        None => Err(error),
    })?;
    file::write(&folder.join("cost.json"), serde_json::to_string_pretty(&table)?.as_bytes())
}

/// The point with the least error that takes at most `ms` milliseconds, by the table and by the median of three renders
/// now. If the machine is slower than when the table was measured, the same factor is assumed for all points.
fn first_that_fits<'a>(table: &'a Table, ms: f64, bench: &Bench<'_>) -> Result<Option<&'a Point>> {
    let mut slower = 1.0_f64;
    for _ in 0..TRIALS {
        let Some(&point) = within(table, ms / slower).first() else { return Ok(None) };
        let mut warm = bench.warm_up(&point.rungs()?)?;
        let times = [bench.time(&mut warm)?, bench.time(&mut warm)?, bench.time(&mut warm)?];
        let found = Interval::of(&times);
        if found.median * SPARE <= ms {
            return Ok(Some(point));
        }
        slower = (found.median / point.gpu_ms.median).max(1.1 * slower);
    }
    Ok(None)
}

impl Chosen {
    /// Measures the error of a picture against the reference, and its GPU time. Where the time is above the limit, the
    /// picture is drawn twice more, and the median counts.
    ///
    /// # Errors
    /// When the picture cannot be drawn again.
    pub(super) fn check(
        &mut self,
        rendered: &Rendered,
        size: [u32; 2],
        renderer: &mut Renderer,
        camera: &Camera,
    ) -> Result<()> {
        let total = |rendered: &Rendered| rendered.passes.iter().map(|pass| pass.ms).sum::<f64>();
        let mut times = vec![total(rendered)];
        if self.budget == "within" && times[0] > self.limit {
            for _ in 0..2 {
                times.push(total(&renderer.render(camera, &mut |_| ())?));
            }
        }
        self.took_ms = Some(Interval::of(&times).median);
        let rgba = rendered.display.chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]]).collect();
        let picture = Display { width: size[0], height: size[1], rgba };
        self.found_error = Some(self.truth.shown.error_interval(&picture));
        Ok(())
    }

    /// A sentence about a budget that the picture did not keep; `None` where it was kept.
    pub(super) fn broken(&self) -> Option<String> {
        let drawn = if self.possible { String::new() } else { format!("; {NEAREST}") };
        match (self.budget, self.took_ms, self.found_error) {
            ("within", Some(ms), _) if ms > self.limit => {
                Some(format!("--within {}: the picture took {ms:.1} ms of GPU time{drawn}", self.limit))
            }
            ("max-error", _, Some(error)) if error.median > self.limit || !self.possible => Some(format!(
                "--max-error {}%: the picture's error is {:.2} % ({:.2} … {:.2}){drawn}; --model global with --max-error draws samples \
                 until the noise is small enough",
                // As typed: dividing by a hundred leaves further digits behind.
                (1e8 * self.limit).round() / 1e6,
                100.0 * error.median,
                100.0 * error.low,
                100.0 * error.high
            )),
            _ => None,
        }
    }
}
