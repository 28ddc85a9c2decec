//! Rungs for a budget of time or error: out of what was measured of the same picture on this device, or is measured now.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail, ensure};
use serde::Serialize;

use super::options::{DeviceOptions, PictureOptions, SceneOptions};
use super::progress::Steps;
use super::setup::Setup;
use etalon::frame::{Rendered, Settings};
use etalon::gpu::DeviceInfo;
use etalon::image::file;
use etalon::image::metric::{AnyPicture, Metric, compare};
use etalon::image::png::{Display, read_display};
use etalon::plan::{Demand, Knobs, Model};
use etalon_cost::choose::{at_most, most_exact, quickest, within};
use etalon_cost::sweep::{Extent, Sweep};
use etalon_cost::table::{Interval, Table};

/// Seconds for a table that nobody has asked for, and samples of its reference.
const QUICK_S: u32 = 10;
const QUICK_SAMPLES: u32 = 16;
/// Rungs are chosen by what is drawn with these random numbers, whatever the picture's own.
const SEED: u32 = 0;
/// What is written of a run for later budgets; the table last.
const KEPT: [&str; 3] = ["reference.png", "reference.json", "cost.json"];

/// What a picture may take, or how wrong it may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Budget {
    /// Milliseconds of GPU time.
    Within(f64),
    /// FLIP's mean against the scene's reference.
    MaxError(f64),
}

/// What was chosen, and what that gives up.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Chosen {
    /// `within` or `max-error`.
    budget: &'static str,
    /// Milliseconds, or FLIP.
    limit: f64,
    /// The point of the table.
    point: String,
    /// GPU time that it took when it was measured.
    gpu_ms: Interval,
    /// FLIP against the reference then.
    flip_mean: f64,
    /// The reference's own, which is how sure that is.
    own_flip: f64,
    /// Knobs on other rungs than the reference's.
    given_up: String,
    /// GPU time that the picture took.
    pub(super) took_ms: Option<f64>,
    /// FLIP of the picture against the reference, where that was checked.
    pub(super) found_flip: Option<f64>,
    #[serde(skip)]
    pub(super) knobs: Knobs,
    #[serde(skip)]
    reference: Display,
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
            let path = if name == "reference.png" { from.join("pictures").join(name) } else { from.join(name) };
            file::write(&to.join(name), &file::read(&path)?)?;
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

    /// Chooses rungs.
    ///
    /// # Errors
    /// When nothing can be measured, or no rungs keep the budget: what the nearest take.
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
        let read = || -> Result<(Table, Display)> {
            let table = serde_json::from_slice(&file::read(&folder.join("cost.json"))?)?;
            Ok((table, read_display(&folder.join("reference.png"))?))
        };
        let (table, reference) = match read() {
            Ok(known) => known,
            Err(_) => {
                steps.tell(
                    "nothing was measured of this picture on this device yet: measuring (etalon cost measures better)",
                );
                if !folder.join("run.json").exists() {
                    // What is left of something that was not finished.
                    let _ = std::fs::remove_dir_all(&folder);
                }
                let table = setup.bench(options, settings, |bench| {
                    let extent = Extent { budget_s: QUICK_S, reference_samples: Some(QUICK_SAMPLES), shard: [1, 1] };
                    let contents = setup.contents();
                    let sweep = Sweep { bench, folder: &folder, extent, command, scene, contents: &contents };
                    sweep.run(&mut |step| steps.of(step.name, step.done, step.of, step.left_s))
                })?;
                let reference = file::read(&folder.join("pictures/reference.png"))?;
                file::write(&folder.join("reference.png"), &reference)?;
                file::write(&folder.join("cost.json"), serde_json::to_string_pretty(&table)?.as_bytes())?;
                (table, read_display(&folder.join("reference.png"))?)
            }
        };
        let (budget, limit) = match self {
            Self::Within(ms) => ("within", ms),
            Self::MaxError(error) => ("max-error", error),
        };
        let point = match self {
            Self::Within(ms) => within(&table, ms),
            Self::MaxError(error) => at_most(&table, error),
        };
        let Some(point) = point else {
            match (self, quickest(&table), most_exact(&table)) {
                (Self::Within(ms), Some(least), _) => bail!(
                    "--within {ms}: the quickest rungs take {:.2} ms of GPU time here ({}); the nearest choice is --within {:.0}",
                    least.gpu_ms.median,
                    least.name,
                    (least.gpu_ms.high * 1.1).ceil()
                ),
                (_, _, Some(least)) => bail!(
                    "--max-error {limit}: the least error that was measured is FLIP {:.4} ({}), and that of the reference's own noise \
                     {:.4}; the nearest choice is --model global with --max-error, which draws until its error is small enough",
                    least.error(),
                    least.name,
                    table.reference.own_flip
                ),
                _ => bail!("nothing was measured: our mistake"),
            }
        };
        let mut knobs = Knobs::of(Model::Local);
        for (knob, rung) in &point.knobs {
            knobs.set(&format!("{knob}={rung}"))?;
        }
        knobs.check()?;
        let chosen = Chosen {
            budget,
            limit,
            point: point.name.clone(),
            gpu_ms: point.gpu_ms,
            flip_mean: point.error(),
            own_flip: table.reference.own_flip,
            given_up: table.given_up(point),
            took_ms: None,
            found_flip: None,
            knobs,
            reference,
        };
        steps.tell(&format!(
            "{budget} {limit}: \"{}\" took {:.1} ms ({:.1} … {:.1}) with FLIP {:.4} ± {:.4} against the reference; given up: {}",
            chosen.point,
            chosen.gpu_ms.median,
            chosen.gpu_ms.low,
            chosen.gpu_ms.high,
            chosen.flip_mean,
            chosen.own_flip,
            chosen.given_up
        ));
        Ok(chosen)
    }
}

impl Chosen {
    /// Holds a picture against the reference, and its time against the limit.
    ///
    /// # Errors
    /// When the pictures cannot be compared.
    pub(super) fn check(&mut self, rendered: &Rendered, size: [u32; 2]) -> Result<()> {
        self.took_ms = Some(rendered.passes.iter().map(|pass| pass.ms).sum());
        let rgba = rendered.display.chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]]).collect();
        let picture = Display { width: size[0], height: size[1], rgba };
        let reference = AnyPicture::Display(self.reference.clone());
        let flip = compare(Metric::Flip, &reference, &AnyPicture::Display(picture))?;
        self.found_flip = Some(flip.value);
        Ok(())
    }

    /// What became of the budget: a sentence where it was not kept.
    pub(super) fn broken(&self) -> Option<String> {
        match (self.budget, self.took_ms, self.found_flip) {
            ("within", Some(ms), _) if ms > self.limit * 1.1 => {
                Some(format!("--within {}: the picture took {ms:.1} ms of GPU time", self.limit))
            }
            ("max-error", _, Some(flip)) if flip > self.limit + self.own_flip => {
                Some(format!("--max-error {}: the picture's FLIP against the reference is {flip:.4}", self.limit))
            }
            _ => None,
        }
    }
}
