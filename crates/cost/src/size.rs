//! Extrapolation of times from few pixels to many: of a smaller picture, or of a share of a picture's tiles.
//!
//! A time is the sum of a constant per picture and a constant per pixel; measurements with two numbers of pixels
//! determine both.

use std::collections::BTreeMap;

use anyhow::Result;

use super::command::set;
use super::statistics::Interval;
use super::table::Point;
use super::warm::{Bench, total};
use etalon::frame::{Settings, TileShare};
use etalon::plan::Knobs;

/// Relative scatter of an extrapolated time in addition to noise, because caches behave differently (measured:
/// docs/cost.md).
const OTHER_SIZE: f64 = 0.1;

/// Total milliseconds of the renders of which the fastest counts, unless there are five.
const ENOUGH_MS: f64 = 300.0;

/// Number of pixels.
#[must_use]
pub fn pixels(size: [u32; 2]) -> f64 {
    size.map(f64::from).iter().product()
}

/// Number of pixels that a bench draws: all tiles of its share, also those that `tiles.rs` leaves out.
#[must_use]
pub fn drawn_pixels(bench: &Bench<'_>) -> f64 {
    pixels(bench.settings.size) / f64::from(bench.settings.share.of)
}

/// A size with about `times` times fewer pixels.
#[must_use]
pub fn fewer(size: [u32; 2], times: f64) -> [u32; 2] {
    size.map(|side| (f64::from(side) / times.sqrt()).round().max(1.0) as u32)
}

/// The bench with another size of the picture.
#[must_use]
pub fn resized<'a>(bench: &Bench<'a>, size: [u32; 2]) -> Bench<'a> {
    Bench { settings: Settings { size, ..bench.settings.clone() }, ..*bench }
}

/// The bench with a share of the picture's tiles.
#[must_use]
pub fn shared<'a>(bench: &Bench<'a>, share: TileShare) -> Bench<'a> {
    Bench { settings: Settings { share, ..bench.settings.clone() }, ..*bench }
}

/// Growth factors of times from one size to another, for path-traced pictures and for all others.
#[derive(Debug, Clone)]
pub struct Growth {
    paths: PassGrowth,
    others: PassGrowth,
}

/// Growth factors of each pass, by name, and of a whole picture.
#[derive(Debug, Clone, Default)]
struct PassGrowth {
    passes: BTreeMap<String, f64>,
    whole: f64,
}

impl PassGrowth {
    /// Growth factor of a picture: the mean of those of its passes, weighted by their times.
    fn of(&self, point: &Point) -> f64 {
        let (grown, all) = point.passes.iter().fold((0.0, 0.0), |(grown, all), (name, ms)| {
            (grown + ms * self.passes.get(name).copied().unwrap_or(self.whole), all + ms)
        });
        if all > 0.0 { grown / all } else { self.whole }
    }
}

impl Growth {
    /// Growth from the bench's pixels to those of `size`. Times are measured with the bench's pixels and with a quarter
    /// of them, with the exact rungs in RGB, which every run has compiled, and with `rasters`, rungs without path
    /// tracing.
    ///
    /// # Errors
    /// When a picture cannot be drawn.
    pub fn of(bench: &Bench<'_>, size: [u32; 2], rasters: &[Knobs]) -> Result<Self> {
        let exact = set(&set(&Knobs::exact(), "samples", "1")?, "colour", "rgb")?;
        let TileShare { index, of } = bench.settings.share;
        let few = match bench.settings.share {
            TileShare::ALL => resized(bench, fewer(bench.settings.size, 4.0)),
            _ => shared(bench, TileShare { index, of: 4 * of }),
        };
        let of = |all: &[Knobs]| measured([&few, bench], pixels(size), all);
        Ok(Self { paths: of(&[exact])?, others: of(rasters)? })
    }

    /// Growth in proportion to pixels, without measuring.
    #[must_use]
    pub fn by_pixels(bench: &Bench<'_>, size: [u32; 2]) -> Self {
        let all = PassGrowth { whole: pixels(size) / drawn_pixels(bench), ..PassGrowth::default() };
        Self { paths: all.clone(), others: all }
    }

    /// Extrapolated time of a point.
    #[must_use]
    pub fn of_time(&self, point: &Point) -> Interval {
        let growth = if point.is_path_traced() { &self.paths } else { &self.others };
        scaled(point, growth.of(point))
    }
}

/// A point's time, `factor` times as long, with the scatter of another number of pixels.
#[must_use]
pub fn scaled(point: &Point, factor: f64) -> Interval {
    let Interval { median, low, high } = point.gpu_ms;
    Interval {
        median: factor * median,
        low: factor * low * (1.0 - OTHER_SIZE),
        high: factor * high * (1.0 + OTHER_SIZE),
    }
}

/// Growth factors to the number of pixels `asked`, measured with some rungs and two benches, the one with fewer pixels
/// first. A pass of several of the rungs goes by the last.
fn measured([small, bench]: [&Bench<'_>; 2], asked: f64, all: &[Knobs]) -> Result<PassGrowth> {
    let [few, here] = [small, bench].map(drawn_pixels);
    // A time is a + b·pixels.
    let grown = |few_ms: f64, here_ms: f64| {
        let each = (here_ms - few_ms) / (here - few).max(1.0);
        let share = (1.0 - each * here / here_ms.max(1e-9)).clamp(0.0, 1.0);
        share + (1.0 - share) * asked / here
    };
    let mut growth = PassGrowth::default();
    for knobs in all {
        let [few, here] = [least(small, knobs)?, least(bench, knobs)?];
        growth.whole = grown(few.values().sum(), here.values().sum());
        let known = here.iter().filter_map(|(name, ms)| Some((name.clone(), grown(*few.get(name)?, *ms))));
        growth.passes.extend(known);
    }
    Ok(growth)
}

/// Milliseconds of each pass, by name, in the fastest of several renders.
fn least(bench: &Bench<'_>, knobs: &Knobs) -> Result<BTreeMap<String, f64>> {
    let mut warm = bench.warm_up(knobs)?;
    let (mut least, mut all, mut count) = (f64::INFINITY, 0.0, 0);
    let mut passes = BTreeMap::new();
    while count < 5 && all < ENOUGH_MS {
        let rendered = warm.renderer.render(bench.camera, &mut |_| ())?;
        let ms = total(&rendered);
        (all, count) = (all + ms, count + 1);
        if ms < least {
            least = ms;
            passes.clear();
            for pass in rendered.passes {
                *passes.entry(pass.name).or_insert(0.0) += pass.ms;
            }
        }
    }
    Ok(passes)
}
