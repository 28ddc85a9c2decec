//! Evaluates the drawn pictures against the final reference: errors, costs of rungs, the Pareto frontier of error and
//! GPU time, and recommended settings. See docs/cost.md, "Frontier and recommended settings".
//!
//! Evaluation is separate from drawing, so that pictures drawn early are compared with the final, better reference.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::agenda::Change;
use super::difference::{ShownReference, Truth, significant};
use super::price::{Pair, PairedTimes, TimeNoise, price};
use super::reference::display_of;
use super::statistics::{Estimate, Interval, MANY, standard_errors};
use super::table::{Errors, Family, Other, Point, Price, REFERENCE, RESOLVED, Recommended, Reference, WorstPixel};
use etalon::frame::Settings;
use etalon::gpu::Compiled;
use etalon::image::metric::{AnyPicture, map_rgba};
use etalon::image::png::{Display, read_display};
use etalon::image::{exr, file, png};

/// Half side in pixels of the detail around the place that differs most.
const AROUND: i64 = 20;
/// Side in pixels of the squares whose means are compared, and the step between them.
const REGION: usize = 16;
const STRIDE: usize = 4;
/// A step along the frontier is always worth taking if it reduces the squared error to this factor for at most this
/// factor of time.
const CHEAP: [f64; 2] = [0.6, 2.0];
/// Largest ratio of the times of `balanced` and `quick`.
pub const DEARER: f64 = 10.0;
/// Largest ratio of the error of `balanced` and the least for that time: a smaller gain is worth no time.
pub const WORTH: f64 = 1.1;
/// The reference itself is recommended as `exact` where no other point has an error below this multiple of its
/// resolution.
const FAR: f64 = 2.0;
/// Two times count as equal if their ratio is at most this.
const SAME_TIME: f64 = 1.02;

/// A picture as drawn and timed, stored as `points/NAME.json`.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Record {
    /// Name, unique in a run.
    pub name: String,
    /// Family of the picture.
    pub family: Family,
    /// Rungs by knob.
    pub knobs: BTreeMap<String, String>,
    /// GPU milliseconds of each timed render.
    pub ms: Vec<f64>,
    /// GPU milliseconds of the base, timed interleaved with `ms`.
    pub baseline_ms: Vec<f64>,
    /// Wall milliseconds of the start: uploading and compiling.
    pub start_ms: f64,
    /// GPU milliseconds of each pass.
    pub passes: Vec<(String, f64)>,
    /// Relative mean squared error due to Monte Carlo noise alone; only of path tracing.
    pub noise: Option<f64>,
    /// Work counts, equal on every machine.
    pub work: BTreeMap<String, u64>,
    /// Compiler statistics of each program, if the driver reports any.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub compiled: BTreeMap<String, Vec<Compiled>>,
    /// Command that draws the picture again.
    pub command: String,
    /// Hash of the picture file.
    pub image: String,
    /// Stem of the file names: the picture in `pictures`, its radiance in `points`.
    pub picture: String,
    /// Change relative to the base, and the comparison of both pictures.
    pub pair: Option<(Change, Pair)>,
}

/// Input of the evaluation.
pub struct Judge<'a> {
    /// The reference picture.
    pub truth: &'a Truth,
    /// Facts of the reference.
    pub reference: &'a Reference,
    /// Folder of the run.
    pub folder: &'a Path,
}

/// Result of the evaluation.
pub struct Judged {
    /// A point for each record, and the reference.
    pub points: Vec<Point>,
    /// [`Table::frontier`](super::table::Table::frontier).
    pub frontier: Vec<usize>,
    /// [`Table::recommended`](super::table::Table::recommended).
    pub recommended: Vec<Recommended>,
    /// Cost of each record that changed one knob.
    pub prices: Vec<Price>,
    /// Standard errors from zero that make a statement significant.
    pub standard_errors: f64,
}

impl Judge<'_> {
    /// Display values of a drawn picture.
    ///
    /// # Errors
    /// When the picture's file cannot be read.
    pub fn display(&self, record: &Record) -> Result<Display> {
        read_display(&self.folder.join("pictures").join(format!("{}.png", record.picture)))
    }

    /// Evaluates all records, and writes error maps.
    ///
    /// # Errors
    /// When a picture cannot be read, compared or written.
    pub fn judge(&self, records: &[Record]) -> Result<Judged> {
        // Number of statements for the Bonferroni correction: per price an error for three block sizes and a time, per
        // point a comparison.
        let prices = records.iter().filter(|record| record.pair.is_some()).count();
        let statements = 4 * prices + records.len();
        let sure = standard_errors(statements, MANY);
        let displays: Vec<Display> =
            records.par_iter().map(|record| self.display(record)).collect::<Result<Vec<_>>>()?;
        let times = normalise_by_baseline(records);
        let points: Vec<Result<Point>> =
            (0..records.len()).into_par_iter().map(|i| self.point(&records[i], &displays[i], times[i])).collect();
        let mut points = points.into_iter().collect::<Result<Vec<Point>>>()?;
        let exact_ms = points.iter().find(|point| point.name == "exact").map(|point| point.gpu_ms);
        points.push(the_reference(self.reference, exact_ms));
        let clocks = [Family::Local, Family::Exact].map(|family| {
            let of_family = records.iter().filter(|r| r.pair.is_some() && r.family == family);
            TimeNoise::of(of_family.map(|r| (&r.ms[..], &r.baseline_ms[..])))
        });
        let base = |family: Family| {
            let name = if family == Family::Local { "local" } else { "exact" };
            records.iter().position(|record| record.name == name)
        };
        let mut prices = Vec::new();
        for (i, record) in records.iter().enumerate() {
            let Some((change, pair)) = &record.pair else { continue };
            let base = base(record.family).context("a base must be drawn before its changes")?;
            let local = record.family == Family::Local;
            let more = match record.family {
                Family::Local => Some(self.truth.shown.more_error(&displays[i], &displays[base])),
                _ => (!points[i].is_path_traced()).then(|| self.error_without_paths(records, &displays, i, sure)),
            };
            let clock = clocks[usize::from(!local)];
            let [ms, baseline_ms] = in_the_middle([&record.ms, &record.baseline_ms], points[base].gpu_ms.median);
            let turns = PairedTimes { ms: &ms, baseline_ms: &baseline_ms, clock };
            // What `local` leaves out may be what the knob is about: dispersion, where nothing is refracted.
            let place = if local { "in local" } else { "here" };
            prices.push(Price {
                point: record.name.clone(),
                flip_delta: points[i].errors.flip_mean - points[base].errors.flip_mean,
                ..price(change, (pair, record.family), more, turns, statements, sure).says_where_wasted(place)
            });
        }
        let frontier = self.frontier(&points, &displays, sure, |_| true);
        // `local` with one knob changed may owe its place to two errors that cancel.
        let meant = |point: &Point| matches!(point.family, Family::Preset | Family::Search);
        let recommended = recommended(&points, &self.frontier(&points, &displays, sure, meant));
        Ok(Judged { points, frontier, recommended, prices, standard_errors: sure })
    }

    /// Squared difference of a picture without paths from the limit of the base `exact`. It has no half buffers, and is
    /// compared with the reference. What its few samples for each pixel add is the squared difference between `local`
    /// with as many and with 64; what RGB adds, where the reference has bands, is the price of the knob `colour`. Both
    /// are taken away, and bound the bias of what is left.
    fn error_without_paths(&self, records: &[Record], displays: &[Display], i: usize, sure: f64) -> Estimate {
        let found = self.truth.shown.error(&displays[i]);
        let local = |samples: &str| {
            let like = |record: &Record| match record.name.strip_prefix("local") {
                Some("") => record.knobs["samples"] == samples,
                Some(rest) => rest.strip_prefix(" samples=") == Some(samples),
                None => false,
            };
            Some(&displays[records.iter().position(like)?])
        };
        let of_samples = || Some(ShownReference::exact(local("64")?).error(local(&records[i].knobs["samples"])?).mean);
        let bands = &self.reference.knobs["colour"];
        let of_colour = || {
            let is_price = |record: &&Record| record.name.strip_prefix("exact colour=") == Some(bands);
            let (_, pair) = records.iter().find(is_price)?.pair.as_ref()?;
            let Estimate { mean, deviation, .. } = significant(&pair.squares, sure)?.1;
            Some(mean + 2.0 * deviation)
        };
        let colour = if *bands == records[i].knobs["colour"] { Some(0.0) } else { of_colour() };
        let others = of_samples().zip(colour).map_or(found.mean, |(samples, colour)| samples + colour);
        Estimate { mean: found.mean - others, bias: found.bias + others, ..found }
    }

    /// Evaluates a picture of another program.
    ///
    /// # Errors
    /// When the picture has another size, or cannot be compared.
    pub fn other(&self, name: &str, picture: &AnyPicture, settings: &Settings) -> Result<Other> {
        let (film, display, radiance) = match picture {
            AnyPicture::Linear(film) => (film.clone(), display_of(film, &settings.view_transform()), true),
            // The file has no radiance: its radiance errors are 0.
            AnyPicture::Display(display) => (self.truth.film.clone(), display.clone(), false),
        };
        let [width, height] = settings.size;
        let size = [display.width, display.height];
        ensure!(
            size == settings.size,
            "comparing {name} with the reference: it has {}x{} pixels, the reference has {width}x{height}",
            size[0],
            size[1]
        );
        let (errors, _) = self.truth.errors(&film, &display)?;
        let is_finite = |pixel: &[f32; 4]| pixel.iter().all(|value| value.is_finite());
        let pixels = || film.rgba.iter().zip(&self.truth.film.rgba).filter(|&(x, r)| is_finite(x) && is_finite(r));
        let ratio = |c: usize| {
            let sums = pixels().fold([0.0; 2], |[x, r], (p, q)| [x + f64::from(p[c]), r + f64::from(q[c])]);
            // A colour that both pictures lack is the same in both.
            if sums == [0.0; 2] { 1.0 } else { sums[0] / sums[1] }
        };
        // JSON has no infinity.
        let mean_ratio = radiance.then(|| [0, 1, 2].map(ratio)).filter(|all| all.iter().all(|ratio| ratio.is_finite()));
        Ok(Other { file: name.to_owned(), errors, mean_ratio })
    }

    fn point(&self, record: &Record, display: &Display, gpu_ms: Interval) -> Result<Point> {
        let film = exr::read_exr(&self.folder.join("points").join(format!("{}.exr", record.picture)))?;
        let (errors, flip) = self.truth.errors(&film, display)?;
        let write = |end: &str, bytes: &[u8]| {
            file::write(&self.folder.join("pictures").join(format!("{}{end}", record.picture)), bytes)
        };
        write(".error.png", &png::encode_png(flip.width, flip.height, &map_rgba(&flip), false)?)?;
        write(".worst.png", &around([&self.truth.display, display])?)?;
        Ok(Point {
            name: record.name.clone(),
            family: record.family,
            knobs: record.knobs.clone(),
            gpu_ms,
            timed: record.ms.len(),
            start_ms: record.start_ms,
            passes: record.passes.clone(),
            compiled: record.compiled.clone(),
            errors,
            noise: record.noise,
            work: record.work.clone(),
            command: record.command.clone(),
            image: record.image.clone(),
            picture: record.picture.clone(),
        })
    }

    /// Pareto frontier of some points: indices of those that no other of them beats in time and error at once, the
    /// fastest first, the reference last. Each point has significantly less error than the one before, and no quicker
    /// picture has significantly less error than it. Of two points with equal times the better one is kept.
    fn frontier(&self, points: &[Point], displays: &[Display], sure: f64, some: impl Fn(&Point) -> bool) -> Vec<usize> {
        let reference = points.iter().position(|point| point.name == REFERENCE);
        let time = |i: usize| points[i].gpu_ms.median;
        // The reference dominates every point that takes longer.
        let limit = reference.map_or(f64::INFINITY, time);
        let mut order: Vec<usize> = (0..displays.len()).filter(|&i| time(i) < limit && some(&points[i])).collect();
        order.sort_by(|&a, &b| time(a).total_cmp(&time(b)));
        let differs = |a: usize, b: usize| match self.truth.shown.more_error(&displays[a], &displays[b]) {
            more if more.is_above(sure) => Ordering::Greater,
            more if more.is_below(sure) => Ordering::Less,
            _ => Ordering::Equal,
        };
        let mut all = undominated(order, time, |i| points[i].error(), differs);
        all.extend(reference);
        all
    }
}

/// Those of `order`, the fastest first, that no quicker one beats. `differs` compares errors; `Equal` is a difference
/// that is not significant.
fn undominated(
    order: Vec<usize>,
    time: impl Fn(usize) -> f64,
    error: impl Fn(usize) -> f64,
    differs: impl Fn(usize, usize) -> Ordering,
) -> Vec<usize> {
    let mut all: Vec<usize> = Vec::new();
    let mut least: Option<usize> = None;
    for i in order {
        let beaten = least.is_some_and(|least| differs(i, least).is_gt());
        let better = !beaten && all.last().is_none_or(|&last| differs(i, last).is_lt());
        if least.is_none_or(|least| error(i) < error(least)) {
            least = Some(i);
        }
        if !better {
            continue;
        }
        while all.last().is_some_and(|&last| time(i) < SAME_TIME * time(last)) {
            all.pop();
        }
        all.push(i);
    }
    all
}

/// Recommended settings from a frontier. `quick` is the fastest point from which no step is cheap ([`CHEAP`]).
/// `balanced` is the fastest whose error is within [`WORTH`] of the least for at most [`DEARER`] times the time of
/// `quick`. `exact` is the most exact point, or the reference where no point is known to come close to it.
fn recommended(points: &[Point], frontier: &[usize]) -> Vec<Recommended> {
    let (time, error) = (|i: usize| points[i].gpu_ms.median, |i: usize| points[i].error());
    let mut all = frontier.to_vec();
    if let [.., best, reference] = all[..]
        && points[reference].name == REFERENCE
        && error(best) < FAR * error(reference)
        // An error below that of a noisy reference is unknown.
        && (error(reference) <= RESOLVED || error(best) > error(reference))
    {
        all.pop();
    }
    let Some(&exact) = all.last() else { return Vec::new() };
    let cheap = |from: usize| {
        let better = |&to: &usize| {
            error(to).powi(2) < CHEAP[0] * error(from).powi(2) && time(to) < CHEAP[1] * time(from) && to != from
        };
        all.iter().copied().filter(|&to| time(to) > time(from)).find(better)
    };
    let mut quick = all[0];
    while let Some(next) = cheap(quick) {
        quick = next;
    }
    // Points of a frontier have less error the longer they take.
    let affordable = |&i: &usize| time(i) <= DEARER * time(quick);
    let least = all.iter().copied().rfind(affordable).unwrap_or(quick);
    let close = |&i: &usize| time(i) >= time(quick) && error(i) <= WORTH * error(least);
    let balanced = all.iter().copied().find(close).unwrap_or(least);
    let named = [("quick", quick), ("balanced", balanced), ("exact", exact)];
    named.map(|(setting, point)| Recommended { setting: setting.to_owned(), point }).into()
}

/// Scales the interleaved times of a picture and its base so that the median of the base is `base_ms`, its median over
/// the whole run. The times of points are normalised the same way.
fn in_the_middle([ms, baseline_ms]: [&[f64]; 2], base_ms: f64) -> [Vec<f64>; 2] {
    let factor = base_ms / Interval::of(baseline_ms).median;
    let factor = if factor.is_finite() && factor > 0.0 { factor } else { 1.0 };
    [ms, baseline_ms].map(|all| all.iter().map(|ms| factor * ms).collect())
}

/// Times normalised by the paired baseline, as if the machine had been equally fast all along: the ratio of a picture
/// to its interleaved base, times the median of the base over the run. The interval covers later runs too: its ends
/// combine the extremes of the ratios with the extremes of the base over the whole run.
fn normalise_by_baseline(records: &[Record]) -> Vec<Interval> {
    let of_exact = |record: &Record| record.family == Family::Exact;
    let bases = [false, true].map(|exact| {
        let in_turns = || records.iter().filter(move |r| of_exact(r) == exact && !r.baseline_ms.is_empty());
        let all: Vec<f64> = in_turns().flat_map(|r| r.baseline_ms.iter().copied()).collect();
        let medians: Vec<f64> = in_turns().map(|r| Interval::of(&r.baseline_ms).median).collect();
        // A device without timestamps reports 0 for every picture, which cannot be a baseline.
        let timed = all.iter().all(|&ms| ms > 0.0);
        (!all.is_empty() && timed).then(|| Interval { median: Interval::of(&medians).median, ..Interval::of(&all) })
    });
    let of = |record: &Record| {
        let base = bases[usize::from(of_exact(record))];
        match base {
            Some(base) if ["local", "exact"].contains(&record.name.as_str()) => base,
            Some(base) if !record.baseline_ms.is_empty() => {
                let ratios: Vec<f64> =
                    record.ms.iter().zip(&record.baseline_ms).map(|(ms, other)| ms / other).collect();
                let ratios = Interval::of(&ratios);
                Interval {
                    median: ratios.median * base.median,
                    low: ratios.low * base.low,
                    high: ratios.high * base.high,
                }
            }
            _ => Interval::of(&record.ms),
        }
    };
    records.iter().map(of).collect()
}

/// The reference as a point. Its error is its resolution. It is timed once; the relative interval of its time is that
/// of the point `exact`.
fn the_reference(reference: &Reference, wandered: Option<Interval>) -> Point {
    let relmse = reference.own_error * reference.own_error;
    let share = |end: f64, median: f64| if median > 0.0 { reference.gpu_ms * end / median } else { reference.gpu_ms };
    let ends = wandered.map(|ms| [share(ms.low, ms.median), share(ms.high, ms.median)]);
    let [low, high] = ends.unwrap_or([reference.gpu_ms; 2]);
    Point {
        name: REFERENCE.to_owned(),
        family: Family::Exact,
        knobs: reference.knobs.clone(),
        gpu_ms: Interval { median: reference.gpu_ms, low, high },
        timed: 1,
        start_ms: 0.0,
        passes: Vec::new(),
        compiled: BTreeMap::new(),
        errors: Errors {
            error: Interval { median: reference.resolution, low: 0.0, high: reference.resolution },
            flip_mean: reference.own_flip,
            flip_p95: 0.0,
            relmse: Interval { median: relmse, low: relmse, high: relmse },
            rmse: 0.0,
            delta_e_mean: 0.0,
            worst_pixel: WorstPixel { x: 0, y: 0, error: 0.0 },
        },
        noise: Some(relmse),
        work: BTreeMap::new(),
        command: drawing(reference),
        image: reference.image.clone(),
        picture: "reference".to_owned(),
    }
}

/// Command that draws the reference, or a picture with about as many samples if the reference has several rounds.
fn drawing(reference: &Reference) -> String {
    let [first, ..] = &reference.rounds[..] else { return reference.command.clone() };
    let rung = 4_u32.pow((f64::from(reference.samples).log2() / 2.0).round().min(6.0) as u32);
    let [given, wanted] = [first.samples, rung].map(|samples| format!(" --set samples={samples} "));
    match reference.command.contains(&given) {
        true => reference.command.replace(&given, &wanted),
        // The preset's samples are not said.
        false => reference.command.replace(" -o ", &format!("{wanted}-o ")),
    }
}

/// Middle of the square of [`REGION`] pixels whose mean display values differ most between two pictures. Noise and
/// fireflies of single pixels, which the largest FLIP error often shows, count little there.
fn worst_region(pictures: [&Display; 2]) -> [i64; 2] {
    let [width, height] = [pictures[0].width, pictures[0].height].map(|side| side as usize);
    let [across, down] = [width, height].map(|side| REGION.min(side));
    // Sums of the differences above and to the left of each pixel (summed-area table; Crow 1984).
    let mut sums = vec![[0_i64; 3]; (width + 1) * (height + 1)];
    let at = |x: usize, y: usize| y * (width + 1) + x;
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let [a, b] = pictures.map(|picture| picture.rgba[y * width + x]);
        sums[at(x + 1, y + 1)] = std::array::from_fn(|c| {
            let [above, left, both] = [at(x + 1, y), at(x, y + 1), at(x, y)].map(|i| sums[i][c]);
            above + left - both + i64::from(a[c]) - i64::from(b[c])
        });
    }
    let difference = |&[x, y]: &[usize; 2]| -> i64 {
        let corners = [at(x + across, y + down), at(x, y + down), at(x + across, y), at(x, y)];
        (0..3)
            .map(|c| corners.map(|i| sums[i][c]))
            .map(|[all, left, above, both]| (all - left - above + both).abs())
            .sum()
    };
    let squares =
        (0..=height - down).step_by(STRIDE).flat_map(|y| (0..=width - across).step_by(STRIDE).map(move |x| [x, y]));
    let [x, y] = squares.max_by_key(difference).unwrap_or_default();
    [(x + across / 2) as i64, (y + down / 2) as i64]
}

/// The reference and a picture beside each other, four times as large, around the place where they differ most.
fn around(pictures: [&Display; 2]) -> Result<Vec<u8>> {
    let [wx, wy] = worst_region(pictures);
    let side = 2 * AROUND;
    let (width, height) = (2 * side * 4 + 8, side * 4);
    let mut rgba = Vec::with_capacity((width * height * 4) as usize);
    for y in 0..height {
        for x in 0..width {
            let right = x >= side * 4 + 8;
            let gap = x >= side * 4 && !right;
            let at = if right { x - side * 4 - 8 } else { x };
            let (px, py) = (wx - AROUND + at / 4, wy - AROUND + y / 4);
            let inside = px >= 0 && py >= 0 && px < i64::from(pictures[0].width) && py < i64::from(pictures[0].height);
            let pixel = if gap || !inside {
                [128, 128, 128, 255]
            } else {
                let [r, g, b, _] = pictures[usize::from(right)].rgba[(py * i64::from(pictures[0].width) + px) as usize];
                [r, g, b, 255]
            };
            rgba.extend_from_slice(&pixel);
        }
    }
    png::encode_png(width as u32, height as u32, &rgba, false)
}

#[cfg(test)]
mod tests {
    use super::*;
    use etalon::optics::SplitMix64;

    fn record(name: &str, ms: &[f64], baseline_ms: &[f64]) -> Record {
        serde_json::from_value(serde_json::json!({
            "name": name, "family": "local", "knobs": {}, "ms": ms, "baseline_ms": baseline_ms, "start_ms": 0.0, "passes": [],
            "noise": null, "work": {}, "command": "", "image": "", "picture": name, "pair": null,
        }))
        .expect("a record")
    }

    #[test]
    fn no_quicker_point_beats_one_of_the_frontier() {
        // Errors differ significantly from 0.1 on.
        let frontier = |points: &[[f64; 2]]| {
            let differs = |a: usize, b: usize| match points[a][1] - points[b][1] {
                more if more > 0.1 => Ordering::Greater,
                more if more < -0.1 => Ordering::Less,
                _ => Ordering::Equal,
            };
            undominated((0..points.len()).collect(), |i| points[i][0], |i| points[i][1], differs)
        };
        assert_eq!(frontier(&[[1.0, 0.9], [2.0, 0.5], [3.0, 0.7], [4.0, 0.2]]), [0, 1, 3]);
        // A step that is not significant does not hide the next one.
        assert_eq!(frontier(&[[1.0, 0.50], [2.0, 0.41], [3.0, 0.39]]), [0, 2]);
        assert_eq!(frontier(&[[1.0, 0.50], [2.0, 0.41], [3.0, 0.52]]), [0]);
        assert_eq!(frontier(&[[1.0, 0.58], [2.0, 0.50], [3.0, 0.30], [4.0, 0.42], [5.0, 0.45]]), [0, 2]);
        // The second is not significantly better than the first, but beats the third, which is.
        let differs = |a: usize, b: usize| match (a, b) {
            (2, 1) => Ordering::Greater,
            (2, 0) => Ordering::Less,
            _ => Ordering::Equal,
        };
        assert_eq!(undominated(vec![0, 1, 2], |i| i as f64 + 1.0, |i| [0.6, 0.5, 0.55][i], differs), [0]);
        // Of two with the same time the better one stays.
        assert_eq!(frontier(&[[1.0, 0.9], [1.01, 0.5], [3.0, 0.2]]), [1, 2]);
    }

    #[test]
    fn a_region_that_is_off_counts_more_than_noise() {
        let (width, height) = (64_usize, 40_usize);
        let mut random = SplitMix64::new(3);
        let noisy: Vec<[u8; 4]> =
            (0..width * height).map(|_| [random.between(60.0, 140.0) as u8, 100, 100, 255]).collect();
        let mut shown: Vec<[u8; 4]> = vec![[100, 100, 100, 255]; width * height];
        // A firefly, and a square that is off by less than the noise of a pixel.
        shown[5 * width + 5] = [255; 4];
        for (y, x) in (20..36).flat_map(|y| (40..56).map(move |x| (y, x))) {
            shown[y * width + x][1] = 120;
        }
        let display = |rgba: &Vec<[u8; 4]>| Display { width: width as u32, height: height as u32, rgba: rgba.clone() };
        assert_eq!(worst_region([&display(&noisy), &display(&shown)]), [48, 28]);
        // A picture that is smaller than a square is one.
        let small = Display { width: 3, height: 2, rgba: vec![[0; 4]; 6] };
        assert_eq!(worst_region([&small, &small]), [1, 1]);
    }

    #[test]
    fn settings_are_as_dear_as_they_may_be() {
        let record = |name: &str| record(name, &[1.0], &[]);
        let point = |name: &str, ms: f64, error: f64| {
            let interval = |x: f64| serde_json::json!({ "median": x, "low": x, "high": x });
            let mut point = serde_json::to_value(record(name)).expect("JSON");
            let more = serde_json::json!({
                "gpu_ms": interval(ms), "timed": 1, "error": interval(error), "flip_mean": 0.0, "flip_p95": 0.0,
                "relmse": interval(0.0), "rmse": 0.0, "delta_e_mean": 0.0,
                "worst_pixel": { "x": 0, "y": 0, "error": 0.0 },
            });
            point.as_object_mut().expect("a point").extend(more.as_object().expect("a point").clone());
            serde_json::from_value::<Point>(point).expect("a point")
        };
        let named = |errors: &[(f64, f64)]| {
            let mut points: Vec<Point> = errors.iter().map(|&(ms, error)| point("a", ms, error)).collect();
            points.push(point(REFERENCE, 3132.0, 0.004));
            let frontier: Vec<usize> = (0..points.len()).collect();
            recommended(&points, &frontier).iter().map(|r| r.point).collect::<Vec<_>>()
        };
        // study:cornell and study:absorber at 128x72: the first step of absorber that is worth its time takes four
        // times as long, and no step of cornell within ten times the time is cheap.
        assert_eq!(named(&[(1.44, 0.09545), (1.73, 0.08731), (4.15, 0.08515), (58.3, 0.07578)]), [0, 1, 4]);
        assert_eq!(named(&[(5.28, 0.06742), (19.64, 0.06582), (20.37, 0.02912)]), [0, 2, 3]);
        assert_eq!(named(&[(8.15, 0.01881)]), [0, 0, 1]);
        // Nine times the time for one percent of the error, and for little after a step that gains more.
        assert_eq!(named(&[(1.0, 0.100), (9.0, 0.099)]), [0, 0, 2]);
        assert_eq!(named(&[(1.0, 0.100), (3.0, 0.082), (9.0, 0.080)]), [0, 1, 3]);
        assert_eq!(named(&[(1.0, 0.100), (3.0, 0.080), (9.0, 0.050)]), [0, 2, 3]);
    }

    #[test]
    fn what_a_change_adds_is_a_part_of_what_its_picture_takes() {
        // The machine was half as fast while the second picture and the base were timed.
        let all = [record("local", &[50.0, 50.0], &[]), record("a", &[80.0], &[50.0]), record("b", &[300.0], &[100.0])];
        let times = normalise_by_baseline(&all);
        let base = times[0].median;
        let [ms, baseline_ms] = in_the_middle([&all[2].ms, &all[2].baseline_ms], base);
        assert!((times[2].median - (base + ms[0] - baseline_ms[0])).abs() < 1e-9, "{times:?}, {ms:?}, {baseline_ms:?}");
    }

    #[test]
    fn a_device_without_timestamps_reports_no_time() {
        let all = [record("local", &[0.0], &[]), record("a", &[0.0, 0.0], &[0.0, 0.0])];
        assert!(normalise_by_baseline(&all).iter().all(|time| time.median == 0.0 && time.high == 0.0));
        let [ms, baseline_ms] = in_the_middle([&all[1].ms, &all[1].baseline_ms], 0.0);
        assert!([ms, baseline_ms].concat().iter().all(|ms| *ms == 0.0));
    }
}
