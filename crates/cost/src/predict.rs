//! Time and error of every rung at some size, from pictures of few pixels: nothing is drawn at that size.
//!
//! Errors are those of few pixels; times grow with pixels as two sizes tell.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Result;
use serde::{Deserialize, Serialize};

use super::pace::Step;
use super::size::{Growth, fewer, pixels, resized};
use super::statistics::Interval;
use super::sweep::{Listener, Sweep, SweepExtent};
use super::table::{Point, REFERENCE, Table};
use super::warm::Bench;

/// Pixels that are drawn, at most, unless something else is asked for.
pub const PIXELS: f64 = 160.0 * 90.0;
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
    /// How much is drawn.
    pub extent: SweepExtent,
    /// Of so many pixels at most.
    pub pixels: f64,
}

/// Expectations of every picture that a run of `cost` would draw and that there was time for.
///
/// # Errors
/// When something cannot be drawn or written.
pub fn predict(bench: &Bench<'_>, trial: &Trial<'_>, progress: &mut dyn FnMut(Step<'_>)) -> Result<Vec<Prediction>> {
    let size = bench.settings.size;
    let few = resized(bench, fewer(size, (pixels(size) / trial.pixels).max(1.0)));
    let growth = Growth::of(&few, size)?;
    let sweep = Sweep::alone(few, trial.folder, trial.extent.clone());
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

/// How right predictions were.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// Pictures that were both foretold and measured, with errors that the reference tells.
    pub pictures: usize,
    /// Rank correlation of errors and of times (Spearman 1904), −1 to 1.
    pub rank: [f64; 2],
    /// Errors and times that lie in their predictions' intervals.
    pub covered: [usize; 2],
}

/// Holds predictions against what was measured.
#[must_use]
pub fn score(predictions: &[Prediction], table: &Table) -> Score {
    let found = |p: &Prediction| table.points.iter().find(|point| point.name == p.picture && point.knobs == p.knobs);
    let pairs: Vec<(&Prediction, &Point)> = predictions
        .iter()
        .filter_map(|p| Some((p, found(p)?)))
        .filter(|(_, point)| point.error() > table.reference.resolution)
        .collect();
    let errors: Vec<(Interval, f64)> = pairs.iter().map(|(p, point)| (p.error, point.error())).collect();
    let times: Vec<(Interval, f64)> = pairs.iter().map(|(p, point)| (p.gpu_ms, point.gpu_ms.median)).collect();
    let rank = [&errors, &times].map(|all| {
        let (foretold, measured): (Vec<f64>, Vec<f64>) = all.iter().map(|(p, found)| (p.median, found)).unzip();
        correlation(&ranks(&foretold), &ranks(&measured))
    });
    let covered = [&errors, &times].map(|all| all.iter().filter(|(p, found)| (p.low..=p.high).contains(found)).count());
    Score { pictures: pairs.len(), rank, covered }
}

/// Places in order; equal values share the mean of theirs.
fn ranks(values: &[f64]) -> Vec<f64> {
    let place = |x: &f64| {
        let (less, same) = values.iter().fold((0, 0), |(l, s), v| (l + usize::from(v < x), s + usize::from(v == x)));
        less as f64 + 0.5 * (same as f64 - 1.0)
    };
    values.iter().map(place).collect()
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (a, b) = (a.iter().copied(), b.iter().copied());
    let deviation = |all: f64| all.sqrt().max(f64::MIN_POSITIVE);
    let [mean_a, mean_b] = [a.clone(), b.clone()].map(|all| all.clone().sum::<f64>() / all.count().max(1) as f64);
    let sum =
        |of: &dyn Fn(f64, f64) -> f64| a.clone().zip(b.clone()).map(|(a, b)| of(a - mean_a, b - mean_b)).sum::<f64>();
    sum(&|a, b| a * b) / (deviation(sum(&|a, _| a * a)) * deviation(sum(&|_, b| b * b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_are_those_of_order_alone() {
        let (a, b) = ([1.0, 2.0, 3.0, 50.0], [0.1, 0.4, 0.5, 0.6]);
        assert!((correlation(&ranks(&a), &ranks(&b)) - 1.0).abs() < 1e-12);
        let back = [4.0, 3.0, 2.0, 1.0];
        assert!((correlation(&ranks(&a), &ranks(&back)) + 1.0).abs() < 1e-12);
        assert_eq!(ranks(&[5.0, 1.0, 5.0, 2.0]), [2.5, 0.0, 2.5, 1.0]);
    }
}
