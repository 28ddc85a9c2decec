//! Extrapolation of errors and times between sizes of the same picture.
//!
//! The mean error of a picture depends little on the number of pixels. A time is the sum of a constant per picture and
//! a constant per pixel; measurements at two sizes determine both.

use anyhow::Result;

use super::command::set;
use super::statistics::Interval;
use super::table::Point;
use super::warm::Bench;
use etalon::frame::Settings;
use etalon::plan::{Knobs, Model};

/// Relative scatter of an extrapolated time in addition to noise, because caches behave differently (measured:
/// docs/cost.md).
const OTHER_SIZE: f64 = 0.25;

/// Total milliseconds of the renders of which the fastest counts, unless there are five.
const ENOUGH_MS: f64 = 300.0;

/// Number of pixels.
#[must_use]
pub fn pixels(size: [u32; 2]) -> f64 {
    size.map(f64::from).iter().product()
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

/// Growth factors of times from one size to another, for path-traced pictures and for all others.
#[derive(Debug, Clone, Copy)]
pub struct Growth {
    paths: f64,
    others: f64,
}

impl Growth {
    /// Growth from the bench's size to `size`. Times are measured at the bench's size and at a quarter of its pixels,
    /// with the exact rungs in RGB, which every run has compiled, and with `local`.
    ///
    /// # Errors
    /// When a picture cannot be drawn.
    pub fn of(bench: &Bench<'_>, size: [u32; 2]) -> Result<Self> {
        let times = pixels(size) / pixels(bench.settings.size);
        let factor = |knobs: &Knobs| -> Result<f64> {
            let share = share_of_a_picture(bench, knobs)?;
            Ok(share + (1.0 - share) * times)
        };
        let exact = set(&set(&Knobs::exact(), "samples", "1")?, "colour", "rgb")?;
        let paths = factor(&exact)?;
        Ok(Self { paths, others: factor(&Knobs::of(Model::Local))? })
    }

    /// Growth in proportion to pixels, without measuring.
    #[must_use]
    pub fn by_pixels(bench: &Bench<'_>, size: [u32; 2]) -> Self {
        let times = pixels(size) / pixels(bench.settings.size);
        Self { paths: times, others: times }
    }

    /// Extrapolated time of a point.
    #[must_use]
    pub fn of_time(&self, point: &Point) -> Interval {
        let by_paths = point.knobs.get("indirect").is_some_and(|rung| rung == "path");
        let factor = if by_paths { self.paths } else { self.others };
        let Interval { median, low, high } = point.gpu_ms;
        Interval {
            median: factor * median,
            low: factor * low * (1.0 - OTHER_SIZE),
            high: factor * high * (1.0 + OTHER_SIZE),
        }
    }
}

/// Fraction of a time that does not depend on the number of pixels, measured at two sizes.
fn share_of_a_picture(bench: &Bench<'_>, knobs: &Knobs) -> Result<f64> {
    let time = |bench: &Bench<'_>| -> Result<f64> {
        let mut warm = bench.warm_up(knobs)?;
        let (mut least, mut all, mut count) = (f64::INFINITY, 0.0, 0);
        while count < 5 && all < ENOUGH_MS {
            let ms = bench.time(&mut warm)?;
            (least, all, count) = (ms.min(least), all + ms, count + 1);
        }
        Ok(least)
    };
    let small = resized(bench, fewer(bench.settings.size, 4.0));
    let [all, few] = [time(bench)?, time(&small)?];
    let more = (pixels(bench.settings.size) - pixels(small.settings.size)).max(1.0);
    let each = (all - few) / more;
    Ok((1.0 - each * pixels(bench.settings.size) / all.max(1e-9)).clamp(0.0, 1.0))
}
