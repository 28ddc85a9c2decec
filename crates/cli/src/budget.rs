//! Rungs for a budget of time or error: out of what was measured of the same picture on this device, or is measured now.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, Result, bail, ensure};
use serde::Serialize;

use super::options::{DeviceOptions, PictureOptions, SceneOptions};
use super::progress::Steps;
use super::setup::Setup;
use etalon::frame::{Rendered, Renderer, Settings};
use etalon::gpu::DeviceInfo;
use etalon::image::file;
use etalon::image::png::Display;
use etalon::plan::{Demand, Knobs};
use etalon::scene::Camera;
use etalon_cost::choose::{SPARE, at_most, most_exact, quickest, within};
use etalon_cost::difference::Truth;
use etalon_cost::reference::{NotMeasured, Refined};
use etalon_cost::sitting::Bench;
use etalon_cost::statistics::Interval;
use etalon_cost::sweep::{Extent, Listener, Sweep};
use etalon_cost::table::{Point, Table};

/// Seconds for a table that nobody has asked for.
const QUICK_S: u32 = 30;
/// Settings that are tried before the quickest is taken.
const TRIALS: usize = 4;
/// Rungs are chosen by what is drawn with these random numbers, whatever the picture's own.
const SEED: u32 = 0;
/// What is written of a run for later budgets; the table last.
const KEPT: [&str; 4] = ["reference.png", "reference.exr", "reference.json", "cost.json"];

/// What a picture may take, or how wrong it may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Budget {
    /// Milliseconds of GPU time.
    Within(f64),
    /// Root mean squared error of displayed values against the scene's reference.
    MaxError(f64),
}

/// What was chosen, and what that gives up.
#[derive(Clone, Serialize)]
pub(super) struct Chosen {
    /// `within` or `max-error`.
    budget: &'static str,
    /// Milliseconds, or a share of the range of displayed values.
    limit: f64,
    /// The point of the table.
    point: String,
    /// GPU time that it took when it was measured.
    gpu_ms: Interval,
    /// Its error against the reference then.
    error: Interval,
    /// Whether the limit can be kept, as far as was measured.
    possible: bool,
    /// Knobs on other rungs than the reference's.
    given_up: String,
    /// GPU time that the picture took: the middle of three where the first took longer than the limit.
    pub(super) took_ms: Option<f64>,
    /// Error of the picture against the reference.
    pub(super) found_error: Option<Interval>,
    #[serde(skip)]
    pub(super) knobs: Knobs,
    #[serde(skip)]
    truth: Arc<Truth>,
}

/// All that a picture depends on beside its knobs, as a command line.
pub(super) fn command(scene: &SceneOptions, picture: &PictureOptions, device: &DeviceOptions) -> String {
    format!("etalon render {}", [scene.words(), picture.words(), device.words()].concat().join(" "))
}

/// Where tables of this picture on this device are kept: named by the command, all that is drawn, the device and the program.
fn folder(command: &str, contents: &str, info: &DeviceInfo) -> Option<PathBuf> {
    let version = env!("CARGO_PKG_VERSION");
    let known = [version, command, contents, &info.name, &info.driver, &info.version].join("\n");
    Some(file::cache_folder()?.join(format!("cost-{}", file::hash(known.as_bytes()))))
}

/// Where an earlier run of a picture left its reference.
pub(super) fn kept(command: &str, setup: &Setup) -> Option<PathBuf> {
    folder(command, &setup.contents(), setup.device.info())
}

/// What was measured of a picture before; `None` where nothing was.
#[cfg(feature = "window")]
pub(super) fn known(command: &str, contents: &str, info: &DeviceInfo) -> Option<Table> {
    let bytes = file::read(&folder(command, contents, info)?.join("cost.json")).ok()?;
    serde_json::from_slice(&bytes).ok()
}

/// Keeps a finished run's table for later budgets; a cache that cannot be written costs time later, nothing else.
pub(super) fn keep(command: &str, setup: &Setup, from: &Path) {
    let Some(to) = folder(command, &setup.contents(), setup.device.info()) else { return };
    let copy = || -> Result<()> {
        // A quick run's own account would not be that of this table.
        let _ = std::fs::remove_dir_all(&to);
        std::fs::create_dir_all(&to)?;
        for name in KEPT {
            file::write(&to.join(name), &file::read(&from.join(name))?)?;
        }
        Ok(())
    };
    if let Err(error) = copy() {
        tracing::info!("keeping the table for --within: {error:#}");
    }
}

impl Budget {
    /// What the options say; `None` where they leave the rungs to the user.
    ///
    /// # Errors
    /// One sentence for a number that is none, and for what contradicts it.
    pub(super) fn of(within: Option<&str>, picture: &PictureOptions) -> Result<Option<Self>> {
        let chosen = !picture.set.is_empty() || picture.model.is_some();
        if let Some(text) = within {
            let number = text.strip_suffix("ms").unwrap_or(text).trim().parse::<f64>().ok();
            let Some(ms) = number.filter(|ms| *ms > 0.0 && ms.is_finite()) else {
                bail!("--within {text}: expected milliseconds above 0, for example 8 or 8ms");
            };
            ensure!(!chosen, "--within {text} contradicts --model and --set: it chooses the rungs");
            ensure!(
                picture.max_error.is_none(),
                "--within {text} contradicts --max-error: the one or the other is the limit"
            );
            return Ok(Some(Self::Within(ms)));
        }
        if chosen || picture.max_error.is_none() {
            return Ok(None);
        }
        Ok(picture.max_error()?.map(Self::MaxError))
    }

    /// Chooses rungs: of a limit of time those with the least error that keep it when they are tried, of one of error the quickest
    /// that keep it. Where none do, those that come nearest.
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
        // What no table depends on: parts beside the picture, effects that are not called for, other noise.
        let demand = Demand::Scene;
        let settings = Settings { max_error: None, demand, parts: Vec::new(), seed: SEED, ..settings.clone() };
        let temporary = tempfile::tempdir().context("making a folder")?;
        let kept = folder(command, &setup.contents(), setup.device.info())
            .filter(|kept| std::fs::create_dir_all(kept).is_ok());
        let folder = kept.unwrap_or_else(|| temporary.path().join("cost"));
        let (table, truth) = match measured(&folder, &settings) {
            Ok(known) => known,
            Err(_) => {
                steps.tell(
                    "nothing was measured of this picture on this device yet: measuring (etalon cost measures better)",
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
        let nothing = "nothing was measured: our mistake";
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
        let nearest = if possible { "" } else { ", which is nearest of what was measured" };
        steps.tell(&format!(
            "{budget} {limit}: \"{}\"{nearest}: it took {:.1} ms ({:.1} … {:.1}) with an error of {:.2} % of the range ({:.2} … {:.2}) \
             against the reference; given up: {}",
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

/// A table and its reference, as they were kept.
fn measured(folder: &Path, settings: &Settings) -> Result<(Table, Truth)> {
    let table = serde_json::from_slice(&file::read(&folder.join("cost.json"))?)?;
    let (refined, _) = Refined::read(folder)?.context("there is no reference")?;
    Ok((table, refined.truth(settings)))
}

/// Measures quickly, or as quickly as it can be done.
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
        if !folder.join("run.json").exists() || budget_s != QUICK_S {
            // What is left of something that was not finished.
            let _ = std::fs::remove_dir_all(folder);
        }
        setup.bench(options, settings.clone(), |bench| {
            let extent = Extent { budget_s, reference_samples: None, shard: [1, 1] };
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

/// The rungs with the least error of those that keep a time: by the table, and by three pictures drawn now. A machine that is slower
/// than when the table was measured is slower for all.
fn first_that_fits<'a>(table: &'a Table, ms: f64, bench: &Bench<'_>) -> Result<Option<&'a Point>> {
    let mut slower = 1.0_f64;
    for _ in 0..TRIALS {
        let Some(&point) = within(table, ms / slower).first() else { return Ok(None) };
        let mut sitting = bench.sit(&point.rungs()?)?;
        let times = [bench.time(&mut sitting)?, bench.time(&mut sitting)?, bench.time(&mut sitting)?];
        let found = Interval::of(&times);
        if found.median * SPARE <= ms {
            return Ok(Some(point));
        }
        slower = (found.median / point.gpu_ms.median).max(1.1 * slower);
    }
    Ok(None)
}

impl Chosen {
    /// Holds a picture against the reference, and its time against the limit: where it took longer than that, it is drawn twice more,
    /// and the middle counts.
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
        self.found_error = Some(self.truth.shown.error(&picture).interval().root());
        Ok(())
    }

    /// What became of the budget: a sentence where it was not kept.
    pub(super) fn broken(&self) -> Option<String> {
        let drawn = if self.possible { "" } else { "; nothing that was measured keeps it, and this is the nearest" };
        match (self.budget, self.took_ms, self.found_error) {
            ("within", Some(ms), _) if ms > self.limit => {
                Some(format!("--within {}: the picture takes {ms:.1} ms of GPU time{drawn}", self.limit))
            }
            ("max-error", _, Some(error)) if error.median > self.limit || !self.possible => Some(format!(
                "--max-error {}%: the picture's error is {:.2} % of the range ({:.2} … {:.2}){drawn}; --model global with --max-error \
                 draws until its noise is small enough",
                // As it was typed: without the digits that dividing by a hundred leaves behind.
                (1e8 * self.limit).round() / 1e6,
                100.0 * error.median,
                100.0 * error.low,
                100.0 * error.high
            )),
            _ => None,
        }
    }
}
