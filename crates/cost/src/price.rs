//! Cost of changing one knob: paired comparison of a picture with its base, in time and error, with significance tests
//! and a verdict in words.

use anyhow::Result;
use serde::{Deserialize, Serialize};

use super::agenda::Change;
use super::difference::{in_blocks, significant};
use super::statistics::{Estimate, Interval, mean, pooled, standard_errors};
use super::table::{Family, INVISIBLE, Price};
use super::warm::Measurement;
use etalon::image::Picture;
use etalon::image::metric::{AnyPicture, Metric, compare};

/// Relative time difference of one program at two places in memory; a smaller difference does not come from the rungs.
const SAME_PROGRAM: f64 = 0.02;
/// Default standard deviation of the logarithm of time ratios, and its degrees of freedom, where no ratio was repeated.
const NO_TURNS: (f64, f64) = (0.05, 5.0);

/// Comparison of a picture with its base, independent of the reference.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Pair {
    /// Mean FLIP error between both pictures.
    pub flip: f64,
    /// Whether the pictures are bit-identical.
    pub same: bool,
    /// Mean squared difference between the limits of both pictures in display values, by block side in pixels; only of
    /// path tracing.
    pub squares: Vec<(u32, Estimate)>,
    /// Relative mean squared error due to noise, over that of the base; only of knobs that change noise alone.
    pub noise_ratio: Option<f64>,
    /// Mean radiance over that of the base; only of knobs that change rounding alone, in pictures without noise.
    #[serde(default)]
    pub brightness: Option<f64>,
}

/// Largest relative change of the mean radiance due to rounding (measured: docs/cost.md).
const BY_ROUNDING: f64 = 2e-5;

/// Sum of the radiance of all pixels and channels.
fn sum(film: &Picture) -> f64 {
    film.rgba.iter().map(|p| p[..3].iter().copied().map(f64::from).sum::<f64>()).sum()
}

impl Pair {
    /// Compares a picture with its base.
    ///
    /// # Errors
    /// When the pictures cannot be compared.
    pub fn of(change: &Change, measured: &Measurement, base: &Measurement) -> Result<Self> {
        let shown = |measured: &Measurement| AnyPicture::Display(measured.display.clone());
        let squares = match (&measured.halves, &base.halves) {
            (Some(a), Some(b)) => in_blocks(a, b, measured.film.width as usize),
            _ => Vec::new(),
        };
        Ok(Self {
            flip: compare(Metric::Flip, &shown(base), &shown(measured))?.value,
            same: base.is(&measured.film),
            squares,
            noise_ratio: match (by_chance(change), measured.noise, base.noise) {
                (true, Some(noise), Some(before)) if before > 0.0 => Some(noise / before),
                _ => None,
            },
            brightness: (change.knob == "arithmetic" && measured.halves.is_none())
                .then(|| sum(&measured.film) / sum(&base.film))
                // Black pictures have no ratio.
                .filter(|ratio| ratio.is_finite()),
        })
    }
}

/// Uncertainty of time ratios: the standard deviation of their logarithms within a picture, pooled over all pictures
/// with one base, and its degrees of freedom.
#[derive(Debug, Clone, Copy)]
pub struct TimeNoise {
    deviation: f64,
    freedom: f64,
}

fn logs(ms: &[f64], baseline_ms: &[f64]) -> Vec<f64> {
    ms.iter().zip(baseline_ms).filter(|(a, b)| **a > 0.0 && **b > 0.0).map(|(a, b)| (a / b).ln()).collect()
}

impl TimeNoise {
    /// Estimate from the interleaved times of several pictures and their base.
    #[must_use]
    pub fn of<'a>(turns: impl Iterator<Item = (&'a [f64], &'a [f64])>) -> Self {
        let groups: Vec<Vec<f64>> = turns.map(|(ms, others)| logs(ms, others)).collect();
        let (deviation, freedom) = pooled(&groups).unwrap_or(NO_TURNS);
        Self { deviation, freedom }
    }

    /// Whether the time difference between a picture and its base is significant, as one of `statements` statements.
    /// Mean and median of the ratios must agree in sign: one turn that was disturbed moves the mean alone.
    fn tells(&self, ms: &[f64], baseline_ms: &[f64], statements: usize) -> bool {
        let logs = logs(ms, baseline_ms);
        let error = self.deviation / (logs.len().max(1) as f64).sqrt();
        let mean = mean(&logs);
        !logs.is_empty()
            && mean.abs() > SAME_PROGRAM + standard_errors(statements, self.freedom) * error
            && mean * Interval::of(&logs).median > 0.0
    }
}

/// Interleaved times of a picture and its base.
#[derive(Clone, Copy)]
pub struct PairedTimes<'a> {
    /// Milliseconds of the picture.
    pub ms: &'a [f64],
    /// Milliseconds of the base.
    pub baseline_ms: &'a [f64],
    /// Uncertainty of the ratios.
    pub clock: TimeNoise,
}

/// Cost of a change in a picture of a family. `more_error` is the mean squared error that it adds, judged by a
/// reference; `None` for path-traced pictures, which are compared with each other. The caller sets `point`;
/// `flip_delta` is the FLIP error between both.
#[must_use]
pub fn price(
    change: &Change,
    (pair, base): (&Pair, Family),
    more_error: Option<Estimate>,
    turns: PairedTimes<'_>,
    statements: usize,
    sure: f64,
) -> Price {
    let PairedTimes { ms, baseline_ms, clock } = turns;
    let differences: Vec<f64> = ms.iter().zip(baseline_ms).map(|(a, b)| a - b).collect();
    let gpu_ms_delta = Interval::of(&differences);
    let base_ms = Interval::of(baseline_ms).median;
    let (squares, more) = match more_error {
        Some(more) => (1, more),
        None => significant(&pair.squares, sure).unwrap_or((1, Estimate::default())),
    };
    let mut price = Price {
        knob: change.knob.clone(),
        from: change.from.clone(),
        to: change.to.clone(),
        base,
        point: String::new(),
        gpu_ms_delta,
        turns: differences.len(),
        share: if base_ms > 0.0 { gpu_ms_delta.median / base_ms } else { 0.0 },
        flip_between: pair.flip,
        flip_delta: pair.flip,
        shown_delta: more.interval(),
        error_told: !pair.same && more.is_significant(sure),
        time_told: clock.tells(ms, baseline_ms, statements),
        squares,
        noise_ratio: pair.noise_ratio,
        brightness: pair.brightness,
        same: pair.same,
        called_for: true,
        verdict: String::new(),
    };
    price.verdict = verdict(&price);
    price
}

/// Whether a change affects the noise alone, not the expected value.
fn by_chance(change: &Change) -> bool {
    match change.knob.as_str() {
        "light-sampler" | "guiding" => true,
        "lights" => change.from != "points" && change.to != "points",
        _ => false,
    }
}

/// Verdict in words; it states only significant differences.
fn verdict(price: &Price) -> String {
    let median = price.gpu_ms_delta.median;
    let (longer, shorter) = (price.takes_longer(), price.saves());
    let time = if longer {
        format!("takes {median:.1} ms longer ({:+.0} %)", 100.0 * price.share)
    } else if shorter {
        format!("saves {:.1} ms (−{:.0} %)", -median, -100.0 * price.share)
    } else {
        "no measurable time difference".to_owned()
    };
    let flip = price.flip_between;
    let error = price.shown_delta;
    let seen = if price.same {
        "the picture is bit-identical".to_owned()
    } else if let Some(ratio) = price.noise_ratio {
        format!("the same mean with {:.2} times the noise", ratio.sqrt())
    } else if flip < INVISIBLE {
        format!("no visible difference (FLIP {flip:.4})")
    } else if price.base != Family::Exact && !price.error_told {
        format!("the noise of the reference hides which picture is more accurate (FLIP {flip:.3} between them)")
    } else if price.base != Family::Exact && error.median < 0.0 {
        let less = 100.0 * (-error.median).sqrt();
        let undoes =
            if price.undoes_another() { ", although it approximates more: it cancels another error" } else { "" };
        format!("removes an error of {less:.2} % (FLIP {flip:.3} between the pictures){undoes}")
    } else if price.is_seen() {
        // Relative to the reference's rungs, a cheaper rung has an error; a more exact one shows what the reference
        // leaves out.
        let more = match (price.base, price.to_more_exact()) {
            (Family::Exact, false) => "an error of",
            (Family::Exact, true) => "a difference of",
            _ => "adds an error of",
        };
        let squares = if price.squares > 1 {
            format!(" averaged over blocks {} pixels wide", price.squares)
        } else {
            String::new()
        };
        format!("{more} {:.2} %{squares} (FLIP {flip:.3} between the pictures)", 100.0 * error.median.sqrt())
    } else {
        format!("no error above the noise (FLIP {flip:.3} between the pictures)")
    };
    let seen = match price.brightness {
        Some(ratio) if (ratio - 1.0).abs() > BY_ROUNDING => format!(
            "{seen}; the mean brightness changes by {:+.4} %, more than rounding can: one of the two rungs is wrong here, \
             {} rather than the more exact one",
            100.0 * (ratio - 1.0),
            price.cheaper_rung()
        ),
        _ => seen,
    };
    format!("{time}; {seen}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_rounding_does_not_do_is_named() {
        let change = Change { knob: "arithmetic".to_owned(), from: "compensated".to_owned(), to: "fast".to_owned() };
        let said = |brightness: f64| {
            let brightness = Some(brightness);
            let pair = Pair { flip: 0.0001, same: false, squares: Vec::new(), noise_ratio: None, brightness };
            let turns =
                PairedTimes { ms: &[10.0], baseline_ms: &[10.0], clock: TimeNoise { deviation: 0.01, freedom: 9.0 } };
            price(&change, (&pair, Family::Local), Some(Estimate::default()), turns, 100, 4.0).verdict
        };
        // Measured with an error of one thousandth in π in the lobe of one tier: study:lamps and study:materials at
        // 160x90.
        assert!(
            said(0.999_947_5).contains("one of the two rungs is wrong here")
                && said(0.999_962_4).contains("wrong here")
        );
        // The real tiers, in these scenes and in study:metals.
        assert!(![1.0, 1.000_000_9, 1.000_007_3].iter().any(|&same| said(same).contains("wrong here")));
    }

    #[test]
    fn what_noise_hides_is_not_called_wasted() {
        let change = Change { knob: "indirect".to_owned(), from: "path".to_owned(), to: "occlusion:16".to_owned() };
        let wasted = |flip: f64| {
            let pair = Pair { flip, same: false, squares: Vec::new(), noise_ratio: None, brightness: None };
            let clock = TimeNoise { deviation: 0.01, freedom: 9.0 };
            let turns = PairedTimes { ms: &[20.0, 20.0], baseline_ms: &[10.0, 10.0], clock };
            price(&change, (&pair, Family::Exact), None, turns, 100, 4.0).is_wasted()
        };
        // study:pool with few samples: no picture resembles the other, and no difference is significant.
        assert!(wasted(0.001) && !wasted(0.38));
    }

    #[test]
    fn times_that_differ_by_chance_are_not_significant() {
        let turns = |ratio: f64| -> (Vec<f64>, Vec<f64>) {
            let noise = [0.99, 1.02, 1.0, 0.98, 1.01, 1.0, 1.005];
            (noise.iter().map(|n| 10.0 * ratio * n).collect(), vec![10.0; 7])
        };
        let all = [turns(1.0), turns(1.2), turns(0.9)];
        let clock = TimeNoise::of(all.iter().map(|(ms, others)| (&ms[..], &others[..])));
        let tells = |ratio: f64| {
            let (ms, others) = turns(ratio);
            clock.tells(&ms, &others, 100)
        };
        assert!(tells(1.2) && tells(0.9));
        // All seven ratios may agree, and still the difference may come from the place in memory.
        assert!(!tells(1.03) && !tells(1.0));
        // One turn that took ten times as long says nothing about the others, which are quicker.
        let (mut ms, others) = turns(0.995);
        ms[3] *= 10.0;
        assert!(!TimeNoise { deviation: 0.01, freedom: 100.0 }.tells(&ms, &others, 100));
        assert!(!clock.tells(&[], &[], 100));
    }
}
