//! Predicts the time and error of every rung from a share of the picture's tiles (`etalon plan --forecast`).
//!
//! Errors are those of the tiles. Times are extrapolated by the growth between two shares. See docs/cost.md.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Result;
use serde::{Deserialize, Serialize};

use super::pace::Step;
use super::size::{Growth, pixels, scaled, shared};
use super::statistics::{IN_95, Interval};
use super::sweep::{Listener, Sweep, SweepExtent};
use super::table::{Point, REFERENCE, Table};
use super::tiles::{spread, standard_error};
use super::warm::Bench;
use etalon::image::png::read_display;
use etalon::plan::{Knobs, Model};

/// Default number of pixels that are drawn.
pub const PIXELS: f64 = 160.0 * 90.0;
/// Standard errors of an interval that holds 90 % of normally distributed values.
const IN_90: f64 = 1.645;
/// The same of errors that are estimated from tiles: a regular pattern of tiles scatters less than tiles at random.
/// Fitted to four scenes whose pictures were known whole: 0.4 to 1.3 (docs/cost.md).
const IN_90_OF_TILES: f64 = 0.8;

/// Predicted time and error of a picture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Prediction {
    /// Name of the picture in a table of `cost`.
    pub picture: String,
    /// Rungs by knob.
    pub knobs: BTreeMap<String, String>,
    /// GPU milliseconds.
    pub gpu_ms: Interval,
    /// Error of display values 0 to 1.
    pub error: Interval,
}

/// Settings of the run with few pixels.
pub struct Trial<'a> {
    /// An empty folder.
    pub folder: &'a Path,
    /// Budget of the run.
    pub extent: SweepExtent,
    /// About how many pixels are drawn.
    pub pixels: f64,
}

/// Predicts every picture that a run of `cost` would draw and for which there was time.
///
/// # Errors
/// When a picture cannot be drawn or written.
pub fn predict(bench: &Bench<'_>, trial: &Trial<'_>, progress: &mut dyn FnMut(Step<'_>)) -> Result<Vec<Prediction>> {
    let size = bench.settings.size;
    let share = spread(size, pixels(size) / trial.pixels);
    let few = shared(bench, share);
    let left_out = 1.0 - 1.0 / f64::from(share.of);
    let growth = Growth::of(&few, size, &[Knobs::of(Model::Recursive), Knobs::of(Model::Local)])?;
    let sweep = Sweep::alone(few, trial.folder, trial.extent.clone());
    let table = sweep.run(&mut Listener { step: progress, early: &mut |_| Ok(()) })?;
    let display = |name: &str| read_display(&trial.folder.join(name));
    let reference = display("reference.png")?;
    let of = |point: &Point| {
        let e = point.errors.error;
        // Beside noise: the tiles that are drawn are not those that are left out.
        let picture = display(&format!("pictures/{}.png", point.picture))?;
        let scatter = IN_90_OF_TILES * standard_error(&picture, &reference, left_out) * e.median;
        let [below, above] = [e.median - e.low, e.high - e.median].map(|noise| (noise * IN_90 / IN_95).hypot(scatter));
        let whole = sweep.bench.draws_all(&point.rungs()?)?;
        Ok(Prediction {
            picture: point.name.clone(),
            knobs: point.knobs.clone(),
            gpu_ms: if whole { scaled(point, 1.0) } else { growth.of_time(point) },
            error: Interval { median: e.median, low: (e.median - below).max(0.0), high: e.median + above },
        })
    };
    table.points.iter().filter(|point| point.name != REFERENCE).map(of).collect()
}

/// Quality of predictions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// Number of pictures that were both predicted and measured, with errors above the resolution of the reference.
    pub pictures: usize,
    /// Rank correlation of errors and of times (Spearman 1904), −1 to 1.
    pub rank: [f64; 2],
    /// The same over pairs of pictures that the measurement tells apart, because their intervals do not overlap
    /// (Goodman and Kruskal 1954): pairs in the right order less those in the wrong one, over both.
    pub told_apart: [f64; 2],
    /// Number of errors and of times that lie in their predicted intervals.
    pub covered: [usize; 2],
}

/// Compares predictions with a measured table.
#[must_use]
pub fn score(predictions: &[Prediction], table: &Table) -> Score {
    let found = |p: &Prediction| table.points.iter().find(|point| point.name == p.picture && point.knobs == p.knobs);
    let pairs: Vec<(&Prediction, &Point)> = predictions
        .iter()
        .filter_map(|p| Some((p, found(p)?)))
        .filter(|(_, point)| point.error() > table.reference.resolution)
        .collect();
    let errors: Vec<[Interval; 2]> = pairs.iter().map(|(p, point)| [p.error, point.errors.error]).collect();
    let times: Vec<[Interval; 2]> = pairs.iter().map(|(p, point)| [p.gpu_ms, point.gpu_ms]).collect();
    let both = [&errors[..], &times[..]];
    let rank = both.map(|all| {
        let [foretold, measured] = [0, 1].map(|i| ranks(&all.iter().map(|of| of[i].median).collect::<Vec<_>>()));
        correlation(&foretold, &measured)
    });
    let covered = both.map(|all| all.iter().filter(|[p, found]| (p.low..=p.high).contains(&found.median)).count());
    Score { pictures: pairs.len(), rank, told_apart: both.map(told_apart), covered }
}

/// Rank correlation over pairs whose second intervals do not overlap; 1 where there are none.
fn told_apart(all: &[[Interval; 2]]) -> f64 {
    let (mut right, mut wrong) = (0.0, 0.0);
    for ([foretold, measured], [slower, more]) in all.iter().flat_map(|a| all.iter().map(move |b| (a, b))) {
        if measured.high < more.low {
            let order = if foretold.median < slower.median { &mut right } else { &mut wrong };
            *order += 1.0;
        }
    }
    if right + wrong > 0.0 { (right - wrong) / (right + wrong) } else { 1.0 }
}

/// Ranks of the values, from 0; equal values get their mean rank.
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
    fn pairs_that_nothing_tells_apart_have_no_order() {
        let exact = |x: f64| Interval { median: x, low: x, high: x };
        let about = |x: f64| Interval { median: x, low: x - 1.0, high: x + 1.0 };
        // The last two overlap, and may be foretold in either order.
        let all = [[exact(1.0), about(1.0)], [exact(9.0), about(5.0)], [exact(8.0), about(5.5)]];
        assert!((told_apart(&all) - 1.0).abs() < 1e-12);
        let wrong = [[exact(10.0), about(1.0)], all[1], all[2]];
        assert!((told_apart(&wrong) + 1.0).abs() < 1e-12);
    }

    #[test]
    fn ranks_are_those_of_order_alone() {
        let (a, b) = ([1.0, 2.0, 3.0, 50.0], [0.1, 0.4, 0.5, 0.6]);
        assert!((correlation(&ranks(&a), &ranks(&b)) - 1.0).abs() < 1e-12);
        let back = [4.0, 3.0, 2.0, 1.0];
        assert!((correlation(&ranks(&a), &ranks(&back)) + 1.0).abs() < 1e-12);
        assert_eq!(ranks(&[5.0, 1.0, 5.0, 2.0]), [2.5, 0.0, 2.5, 1.0]);
    }
}
