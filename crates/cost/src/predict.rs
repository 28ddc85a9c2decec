//! Time and error of every rung at some size, from pictures of few pixels: nothing is drawn at that size.
//!
//! Errors are those of few pixels; times grow with pixels as two sizes tell.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Result;
use serde::{Deserialize, Serialize};

use super::pace::Step;
use super::sitting::Bench;
use super::size::{Growth, fewer, pixels, resized};
use super::statistics::Interval;
use super::sweep::{Extent, Listener, Sweep};
use super::table::{Point, REFERENCE};

/// Pixels that are drawn, at most.
const PIXELS: f64 = 96.0 * 54.0;
/// What an error scatters by beside noise, because few pixels sample edges and small things by chance (measured: docs/cost.md).
const OTHER_PIXELS: f64 = 0.15;

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

/// Expectations of every picture that a run of `cost` would draw and that there was time for.
///
/// # Errors
/// When something cannot be drawn or written.
pub fn predict(bench: &Bench<'_>, trial: &Trial<'_>, progress: &mut dyn FnMut(Step<'_>)) -> Result<Vec<Prediction>> {
    let size = bench.settings.size;
    let few = resized(bench, fewer(size, (pixels(size) / PIXELS).max(1.0)));
    let growth = Growth::of(&few, size)?;
    let sweep = Sweep {
        bench: few,
        folder: trial.folder,
        extent: Extent { budget_s: trial.budget_s, reference_samples: None, shard: [1, 1] },
        command: &|_| String::new(),
        scene: "",
        contents: "",
        kept: &|_| None,
        may_shrink: false,
        others: &[],
        stopped: &|| false,
    };
    let table = sweep.run(&mut Listener { step: progress, early: &mut |_| Ok(()) })?;
    let of = |point: &Point| {
        let e = point.errors.error;
        Prediction {
            picture: point.name.clone(),
            knobs: point.knobs.clone(),
            gpu_ms: growth.of_time(point),
            error: Interval {
                median: e.median,
                low: e.low * (1.0 - OTHER_PIXELS),
                high: e.high * (1.0 + OTHER_PIXELS),
            },
        }
    };
    Ok(table.points.iter().filter(|point| point.name != REFERENCE).map(of).collect())
}
