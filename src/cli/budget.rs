//! Rungs for a budget of time or error: out of what was measured of the same picture on this device, or is measured now.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail, ensure};
use serde::Serialize;

use super::options::{DeviceOptions, PictureOptions, SceneOptions};
use super::progress::Steps;
use super::setup::Setup;
use crate::cost::choose::{at_most, most_exact, quickest, within};
use crate::cost::sweep::{Extent, Sweep};
use crate::cost::table::{Interval, Table};
use crate::frame::{Rendered, Settings};
use crate::image::file;
use crate::image::metric::{AnyPicture, Metric, compare};
use crate::image::png::{Display, read_display};
use crate::plan::{Knobs, Model};

/// Seconds for a table that nobody has asked for, and samples of its reference.
const QUICK_S: u32 = 10;
const QUICK_SAMPLES: u32 = 16;
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
    reference: PathBuf,
}

/// All that a picture depends on beside its knobs, as a command line.
pub(super) fn command(scene: &SceneOptions, picture: &PictureOptions, device: &DeviceOptions) -> String {
    format!("etalon render {}", [scene.words(), picture.words(), device.words()].concat().join(" "))
}

/// Where tables of this picture on this device are kept: named by the command, the scene's file, the device and the program.
fn folder(scene: &SceneOptions, command: &str, setup: &Setup) -> Result<Option<PathBuf>> {
    let Some(cache) = file::cache_folder() else { return Ok(None) };
    let mut known = vec![env!("CARGO_PKG_VERSION").to_owned(), command.to_owned()];
    for path in [Some(&scene.scene), scene.env.as_ref()].into_iter().flatten() {
        if !path.starts_with("study:") && path != "none" {
            known.push(file::hash(&file::read(Path::new(path))?));
        }
    }
    let info = setup.device.info();
    known.extend([info.name.clone(), info.driver.clone(), info.version.clone()]);
    Ok(Some(cache.join(format!("cost-{}", file::hash(known.join("\n").as_bytes())))))
}

/// Keeps a finished run's table for later budgets; a cache that cannot be written costs time later, nothing else.
pub(super) fn keep(scene: &SceneOptions, command: &str, setup: &Setup, from: &Path) {
    let Ok(Some(to)) = folder(scene, command, setup) else { return };
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
        let chosen = !picture.set.is_empty() || picture.model != Model::default();
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
        let settings = Settings { max_error: None, ..settings.clone() };
        let kept = folder(options, command, setup)?;
        let temporary = tempfile::tempdir().context("making a folder")?;
        let folder = kept.unwrap_or_else(|| temporary.path().join("cost"));
        let path = folder.join("cost.json");
        if !path.exists() {
            steps.say(
                "nothing was measured of this picture on this device yet: measuring (etalon cost measures better)",
            );
            if let Some(parent) = folder.parent() {
                std::fs::create_dir_all(parent).with_context(|| format!("making the folder {}", parent.display()))?;
            }
            let table = setup.bench(options, settings, |bench| {
                let extent = Extent { budget_s: QUICK_S, reference_samples: Some(QUICK_SAMPLES), shard: [1, 1] };
                let sweep = Sweep { bench, folder: &folder, extent, command, scene };
                sweep.run(&mut |step| steps.of(step.name, step.done, step.of, step.left_s))
            })?;
            file::write(&folder.join("reference.png"), &file::read(&folder.join("pictures/reference.png"))?)?;
            file::write(&path, serde_json::to_string_pretty(&table)?.as_bytes())?;
        }
        let table: Table =
            serde_json::from_slice(&file::read(&path)?).with_context(|| format!("reading {}", path.display()))?;
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
            reference: folder.join("reference.png"),
        };
        steps.say(&format!(
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
        let reference = read_display(&self.reference)?;
        let flip = compare(Metric::Flip, &AnyPicture::Display(reference), &AnyPicture::Display(picture))?;
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
