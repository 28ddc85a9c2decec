//! Time and error of every rung at some size, from pictures of few pixels: nothing is drawn at that size.
//!
//! What an error is in the mean over a picture depends little on how many pixels sample it. A time is one part for each picture and one
//! for each pixel, which two sizes tell.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Result;
use serde::{Deserialize, Serialize};

use super::command::set;
use super::pace::Step;
use super::sitting::Bench;
use super::statistics::Interval;
use super::sweep::{Extent, Listener, Sweep};
use super::table::{Point, REFERENCE};
use etalon::frame::Settings;
use etalon::plan::{Knobs, Model};

/// Pixels that are drawn, at most.
const PIXELS: f64 = 96.0 * 54.0;
/// What an error scatters by beside noise, because few pixels sample edges and small things by chance; and a time, because caches are
/// filled otherwise (measured: docs/cost.md).
const OTHER_PIXELS: f64 = 0.15;
const OTHER_SIZE: f64 = 0.25;

/// What a picture is expected to take, and how far off it will be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Prediction {
    /// Its name in a table of `cost`.
    pub picture: String,
    /// Its rungs.
    pub knobs: BTreeMap<String, String>,
    /// Milliseconds of GPU time.
    pub gpu_ms: Interval,
    /// Error, of displayed values 0 to 1.
    pub error: Interval,
}

/// Where it is tried, and for how long.
pub struct Trial<'a> {
    /// An empty folder.
    pub folder: &'a Path,
    /// Seconds.
    pub budget_s: u32,
}

/// A bench with so many times fewer pixels, at least.
fn smaller<'a>(bench: &Bench<'a>, times: f64) -> Bench<'a> {
    let size = bench.settings.size.map(|side| (f64::from(side) / times.sqrt()).round().max(1.0) as u32);
    Bench { settings: Settings { size, ..bench.settings.clone() }, ..*bench }
}

fn pixels(bench: &Bench<'_>) -> f64 {
    bench.settings.size.map(f64::from).iter().product()
}

/// The share of a time that does not go with pixels, by two sizes.
fn share_of_a_picture(bench: &Bench<'_>, knobs: &Knobs) -> Result<f64> {
    let time = |bench: &Bench<'_>| -> Result<f64> {
        let mut sitting = bench.sit(knobs)?;
        let times = (0..5).map(|_| bench.time(&mut sitting)).collect::<Result<Vec<f64>>>()?;
        Ok(times.into_iter().fold(f64::INFINITY, f64::min))
    };
    let small = smaller(bench, 4.0);
    let [all, few] = [time(bench)?, time(&small)?];
    let each = (all - few) / (pixels(bench) - pixels(&small)).max(1.0);
    Ok((1.0 - each * pixels(bench) / all.max(1e-9)).clamp(0.0, 1.0))
}

/// Expectations of every picture that a run of `cost` would draw and that there was time for.
///
/// # Errors
/// When something cannot be drawn or written.
pub fn predict(bench: &Bench<'_>, trial: &Trial<'_>, progress: &mut dyn FnMut(Step<'_>)) -> Result<Vec<Prediction>> {
    let few = smaller(bench, (pixels(bench) / PIXELS).max(1.0));
    let times = pixels(bench) / pixels(&few);
    let local = share_of_a_picture(&few, &Knobs::of(Model::Local))?;
    let paths = share_of_a_picture(&few, &set(&Knobs::of(Model::Global), "samples", "1")?)?;
    let sweep = Sweep {
        bench: few,
        folder: trial.folder,
        extent: Extent { budget_s: trial.budget_s, reference_samples: None, shard: [1, 1] },
        command: "",
        scene: "",
        contents: "",
        kept: None,
        others: &[],
        stopped: &|| false,
    };
    let table = sweep.run(&mut Listener { step: progress, early: &mut |_| Ok(()) })?;
    let of = |point: &Point| {
        let share = if point.knobs.get("indirect").is_some_and(|rung| rung == "path") { paths } else { local };
        let scale = share + (1.0 - share) * times;
        let Interval { median, low, high } = point.gpu_ms;
        let e = point.errors.error;
        Prediction {
            picture: point.name.clone(),
            knobs: point.knobs.clone(),
            gpu_ms: Interval {
                median: scale * median,
                low: scale * low * (1.0 - OTHER_SIZE),
                high: scale * high * (1.0 + OTHER_SIZE),
            },
            error: Interval {
                median: e.median,
                low: e.low * (1.0 - OTHER_PIXELS),
                high: e.high * (1.0 + OTHER_PIXELS),
            },
        }
    };
    Ok(table.points.iter().filter(|point| point.name != REFERENCE).map(of).collect())
}
