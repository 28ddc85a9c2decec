//! What pictures say once the reference is as good as it gets: errors, prices, and which of them nothing beats.
//!
//! Drawing and judging are apart, so that pictures which were drawn before a better reference was there are judged by it.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::agenda::Change;
use super::difference::Truth;
use super::price::{Pair, PairedTimes, TimeNoise, price};
use super::reference::display_of;
use super::statistics::{Interval, MANY, standard_errors};
use super::table::{Errors, Family, Other, Point, Price, REFERENCE, Recommended, Reference, WorstPixel};
use etalon::frame::Settings;
use etalon::gpu::Compiled;
use etalon::image::metric::{AnyPicture, Comparison, map_rgba};
use etalon::image::png::{Display, read_display};
use etalon::image::{Picture, exr, file, png};

/// Half of the side of what is shown of the worst pixel.
const AROUND: i64 = 20;
/// A step along the frontier that is recommended whatever the wish: so much less squared error for so much more time.
const CHEAP: [f64; 2] = [0.6, 2.0];
/// How far below the line a corner is, of the whole way in logarithms: what is less is no corner, and the quick setting stands.
const CORNER: f64 = 0.05;
/// The reference is recommended where nothing else comes so near to what it resolves.
const FAR: f64 = 2.0;
/// Two times of which the longer is no more than so many times the shorter are the same.
const SAME_TIME: f64 = 1.02;

/// A picture as it was drawn and timed.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Record {
    /// Unique in a run.
    pub name: String,
    /// Where it comes from.
    pub family: Family,
    /// Rungs.
    pub knobs: BTreeMap<String, String>,
    /// GPU milliseconds of each picture …
    pub ms: Vec<f64>,
    /// … and of the base's, drawn in turns with them.
    pub baseline_ms: Vec<f64>,
    /// Wall time of a start.
    pub start_ms: f64,
    /// GPU milliseconds of each pass.
    pub passes: Vec<(String, f64)>,
    /// Relative mean squared error by chance alone, of pictures by paths.
    pub noise: Option<f64>,
    /// Counts that are the same on every machine.
    pub work: BTreeMap<String, u64>,
    /// What the driver's compiler made of each program, where it tells.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub compiled: BTreeMap<String, Vec<Compiled>>,
    /// Draws it again.
    pub command: String,
    /// Hash of the picture's file.
    pub image: String,
    /// Stem of its files: the picture in `pictures`, and its radiance in `points`.
    pub picture: String,
    /// What was changed of its base, and what both pictures say of each other.
    pub pair: Option<(Change, Pair)>,
}

/// What is needed to judge.
pub struct Judge<'a> {
    /// What errors are told against.
    pub truth: &'a Truth,
    /// What is said of it.
    pub reference: &'a Reference,
    /// The run's folder.
    pub folder: &'a Path,
}

/// What was found.
pub struct Judged {
    /// A point for each record, and the reference.
    pub points: Vec<Point>,
    /// See the table.
    pub frontier: Vec<usize>,
    /// See the table.
    pub recommended: Vec<Recommended>,
    /// Of each record that changed one knob.
    pub prices: Vec<Price>,
    /// What a statement had to be away from nothing.
    pub standard_errors: f64,
}

impl Judge<'_> {
    /// A picture as it was drawn.
    ///
    /// # Errors
    /// When its file cannot be read.
    pub fn display(&self, record: &Record) -> Result<Display> {
        read_display(&self.folder.join("pictures").join(format!("{}.png", record.picture)))
    }

    /// Judges all, and writes the maps of their errors.
    ///
    /// # Errors
    /// When a picture cannot be read, compared or written.
    pub fn judge(&self, records: &[Record]) -> Result<Judged> {
        // Of each price an error, in squares of three sides, and a time; of each point whether it is better than another.
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
            let base = base(record.family).context("a base is drawn before what is changed of it")?;
            let local = record.family == Family::Local;
            let more = local.then(|| self.truth.shown.more_error(&displays[i], &displays[base]));
            let clock = clocks[usize::from(!local)];
            let [ms, baseline_ms] = in_the_middle([&record.ms, &record.baseline_ms], points[base].gpu_ms.median);
            let turns = PairedTimes { ms: &ms, baseline_ms: &baseline_ms, clock };
            prices.push(Price {
                point: record.name.clone(),
                flip_delta: points[i].errors.flip_mean - points[base].errors.flip_mean,
                ..price(change, pair, more, turns, statements, sure)
            });
        }
        let frontier = self.frontier(&points, &displays, sure);
        let recommended = recommended(&points, &frontier);
        Ok(Judged { points, frontier, recommended, prices, standard_errors: sure })
    }

    /// Judges a picture that another program drew.
    ///
    /// # Errors
    /// When it has another size, or cannot be compared.
    pub fn other(&self, name: &str, picture: &AnyPicture, settings: &Settings) -> Result<Other> {
        let (film, display, radiance) = match picture {
            AnyPicture::Linear(film) => (film.clone(), display_of(film, settings), true),
            // Its radiance is not known: errors of radiance are those of none.
            AnyPicture::Display(display) => (self.truth.film.clone(), display.clone(), false),
        };
        let [width, height] = settings.size;
        let size = [display.width, display.height];
        ensure!(size == settings.size, "judging {name}: it is {}x{}, the reference {width}x{height}", size[0], size[1]);
        let (errors, _) = self.truth.errors(&film, &display)?;
        let mean = |film: &Picture, c: usize| film.rgba.iter().map(|p| f64::from(p[c])).sum::<f64>();
        let ratio = || [0, 1, 2].map(|c| mean(&film, c) / mean(&self.truth.film, c));
        Ok(Other { file: name.to_owned(), errors, mean_ratio: radiance.then(ratio) })
    }

    fn point(&self, record: &Record, display: &Display, gpu_ms: Interval) -> Result<Point> {
        let film = exr::read_exr(&self.folder.join("points").join(format!("{}.exr", record.picture)))?;
        let (errors, flip) = self.truth.errors(&film, display)?;
        let write = |end: &str, bytes: &[u8]| {
            file::write(&self.folder.join("pictures").join(format!("{}{end}", record.picture)), bytes)
        };
        write(".error.png", &png::encode_png(flip.width, flip.height, &map_rgba(&flip), false)?)?;
        write(".worst.png", &around(&flip, [&self.truth.display.rgba, &display.rgba])?)?;
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

    /// Places of the points that no other beats in time and error at once, the quickest first, the reference last. Each has less
    /// error than the one before by more than the reference's noise, or it is not there; and of two that take the same time the
    /// better one.
    fn frontier(&self, points: &[Point], displays: &[Display], sure: f64) -> Vec<usize> {
        let reference = points.iter().position(|point| point.name == REFERENCE);
        let time = |i: usize| points[i].gpu_ms.median;
        // What takes longer than the reference and is no better is beaten by it.
        let limit = reference.map_or(f64::INFINITY, time);
        let mut order: Vec<usize> = (0..displays.len()).filter(|&i| time(i) < limit).collect();
        order.sort_by(|&a, &b| time(a).total_cmp(&time(b)));
        let mut all: Vec<usize> = Vec::new();
        for i in order {
            let better = |&known: &usize| self.truth.shown.more_error(&displays[i], &displays[known]).is_below(sure);
            if !all.last().is_none_or(better) {
                continue;
            }
            while all.last().is_some_and(|&last| time(i) < SAME_TIME * time(last)) {
                all.pop();
            }
            all.push(i);
        }
        all.extend(reference);
        all
    }
}

/// Of the frontier the quickest from which no step is cheap, the one farthest below the line from there to the most exact, and that:
/// the reference itself where nothing comes near to it. What differs from `local` by one knob may owe its place to two errors that undo
/// each other: presets and what the search found are meant as they are.
fn recommended(points: &[Point], frontier: &[usize]) -> Vec<Recommended> {
    let (time, error) = (|i: usize| points[i].gpu_ms.median, |i: usize| points[i].error());
    let meant =
        |i: &usize| points[*i].name == REFERENCE || matches!(points[*i].family, Family::Preset | Family::Search);
    let mut all: Vec<usize> = frontier.iter().copied().filter(meant).collect();
    if let [.., best, reference] = all[..]
        && points[reference].name == REFERENCE
        && error(best) < FAR * error(reference)
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
    // Where the corner of a curve is, in logarithms (Satopää et al. 2011).
    let part = |value: f64, [from, to]: [f64; 2]| {
        if from == to { 0.0 } else { (value.max(1e-9) / from.max(1e-9)).ln() / (to.max(1e-9) / from.max(1e-9)).ln() }
    };
    let below = |i: usize| part(error(i), [error(quick), error(exact)]) - part(time(i), [time(quick), time(exact)]);
    let between = all.iter().copied().filter(|&i| time(i) > time(quick) && below(i) > CORNER);
    let balanced = between.max_by(|&a, &b| below(a).total_cmp(&below(b))).unwrap_or(quick);
    let named = [("quick", quick), ("balanced", balanced), ("exact", exact)];
    named.map(|(setting, point)| Recommended { setting: setting.to_owned(), point }).into()
}

/// Times of a picture and of the base that it was drawn in turns with, as quick as the machine was in the middle of the run, where that
/// base took so many milliseconds: the times of points are told so, too.
fn in_the_middle([ms, baseline_ms]: [&[f64]; 2], base_ms: f64) -> [Vec<f64>; 2] {
    let factor = base_ms / Interval::of(baseline_ms).median;
    let factor = if factor.is_finite() && factor > 0.0 { factor } else { 1.0 };
    [ms, baseline_ms].map(|all| all.iter().map(|ms| factor * ms).collect())
}

/// Times as if the machine had been as quick all along: each is told as so many times the base's that was drawn in turns with it,
/// and the base's is the middle of all of its own. Whoever draws the picture again finds the machine somewhere else: the ends are
/// as far apart as those of the turns and those of the base over the whole run together.
fn normalise_by_baseline(records: &[Record]) -> Vec<Interval> {
    let of_exact = |record: &Record| record.family == Family::Exact;
    let bases = [false, true].map(|exact| {
        let in_turns = || records.iter().filter(move |r| of_exact(r) == exact && !r.baseline_ms.is_empty());
        let all: Vec<f64> = in_turns().flat_map(|r| r.baseline_ms.iter().copied()).collect();
        let medians: Vec<f64> = in_turns().map(|r| Interval::of(&r.baseline_ms).median).collect();
        // A device without timestamps tells 0 of every picture, which is no base.
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

/// The reference as a point: its error is what it resolves. It is timed once: the ends of its time are as far apart as those of the
/// picture with its rungs and fewer samples.
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

/// What draws the reference, or, where it has many rounds, a picture with about as many samples.
fn drawing(reference: &Reference) -> String {
    let [first, ..] = &reference.rounds[..] else { return reference.command.clone() };
    let rung = 4_u32.pow((f64::from(reference.samples).log2() / 2.0).round().min(6.0) as u32);
    reference.command.replace(&format!("samples={}", first.samples), &format!("samples={rung}"))
}

/// The reference and the picture around the worst pixel, side by side and four times as large.
fn around(flip: &Comparison, pictures: [&Vec<[u8; 4]>; 2]) -> Result<Vec<u8>> {
    let [wx, wy] = flip.worst.map(i64::from);
    let side = 2 * AROUND;
    let (width, height) = (2 * side * 4 + 8, side * 4);
    let mut rgba = Vec::with_capacity((width * height * 4) as usize);
    for y in 0..height {
        for x in 0..width {
            let right = x >= side * 4 + 8;
            let gap = x >= side * 4 && !right;
            let at = if right { x - side * 4 - 8 } else { x };
            let (px, py) = (wx - AROUND + at / 4, wy - AROUND + y / 4);
            let inside = px >= 0 && py >= 0 && px < i64::from(flip.width) && py < i64::from(flip.height);
            let pixel = if gap || !inside {
                [128, 128, 128, 255]
            } else {
                let [r, g, b, _] = pictures[usize::from(right)][(py * i64::from(flip.width) + px) as usize];
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

    fn record(name: &str, ms: &[f64], baseline_ms: &[f64]) -> Record {
        serde_json::from_value(serde_json::json!({
            "name": name, "family": "local", "knobs": {}, "ms": ms, "baseline_ms": baseline_ms, "start_ms": 0.0, "passes": [],
            "noise": null, "work": {}, "command": "", "image": "", "picture": name, "pair": null,
        }))
        .expect("a record")
    }

    #[test]
    fn what_a_change_adds_is_a_part_of_what_its_picture_takes() {
        // The machine was half as quick when the second picture was drawn in turns with the base.
        let all = [record("local", &[50.0, 50.0], &[]), record("a", &[80.0], &[50.0]), record("b", &[300.0], &[100.0])];
        let times = normalise_by_baseline(&all);
        let base = times[0].median;
        let [ms, baseline_ms] = in_the_middle([&all[2].ms, &all[2].baseline_ms], base);
        assert!((times[2].median - (base + ms[0] - baseline_ms[0])).abs() < 1e-9, "{times:?}, {ms:?}, {baseline_ms:?}");
    }

    #[test]
    fn a_device_without_timestamps_tells_no_time() {
        let all = [record("local", &[0.0], &[]), record("a", &[0.0, 0.0], &[0.0, 0.0])];
        assert!(normalise_by_baseline(&all).iter().all(|time| time.median == 0.0 && time.high == 0.0));
        let [ms, baseline_ms] = in_the_middle([&all[1].ms, &all[1].baseline_ms], 0.0);
        assert!([ms, baseline_ms].concat().iter().all(|ms| *ms == 0.0));
    }
}
