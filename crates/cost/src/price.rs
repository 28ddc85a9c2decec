//! What one picture costs and buys beside another that has one knob on another rung.

use anyhow::Result;
use serde::{Deserialize, Serialize};

use super::agenda::Change;
use super::difference::{in_blocks, significant};
use super::statistics::{Estimate, Interval, mean, pooled, standard_errors};
use super::table::{Family, INVISIBLE, Price};
use super::warm::Measurement;
use etalon::image::Picture;
use etalon::image::metric::{AnyPicture, Metric, compare};

/// Times of one program on the same rungs differ by so much between two places in memory: less is no difference of the rungs.
const SAME_PROGRAM: f64 = 0.02;
/// Spread of the logarithms of two times whose turns tell none, and how well that is known.
const NO_TURNS: (f64, f64) = (0.05, 5.0);

/// What two pictures say of each other, whatever the reference.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Pair {
    /// Mean FLIP between both.
    pub flip: f64,
    /// Whether they are the same to the last bit.
    pub same: bool,
    /// The mean squared difference of displayed values of what both converge to, in squares of several sides; of pictures by paths.
    pub squares: Vec<(u32, Estimate)>,
    /// Of a knob that changes chance alone: relative mean squared error by chance over that of the base.
    pub noise_ratio: Option<f64>,
    /// Of a knob that changes rounding alone, where no chance is in the pictures: mean radiance over that of the base.
    #[serde(default)]
    pub brightness: Option<f64>,
}

/// Mean radiance differs by so much at most where rounding alone does (measured: docs/cost.md).
const BY_ROUNDING: f64 = 2e-5;

/// Radiance of all pixels and channels.
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
                // Where all is black there is nothing to compare.
                .filter(|ratio| ratio.is_finite()),
        })
    }
}

/// How well times are known: the spread of the logarithms of ratios within their turns, over all pictures drawn in turns with one base.
#[derive(Debug, Clone, Copy)]
pub struct TimeNoise {
    deviation: f64,
    freedom: f64,
}

fn logs(ms: &[f64], baseline_ms: &[f64]) -> Vec<f64> {
    ms.iter().zip(baseline_ms).filter(|(a, b)| **a > 0.0 && **b > 0.0).map(|(a, b)| (a / b).ln()).collect()
}

impl TimeNoise {
    /// By the turns of some pictures: each its own times and those of the base.
    #[must_use]
    pub fn of<'a>(turns: impl Iterator<Item = (&'a [f64], &'a [f64])>) -> Self {
        let groups: Vec<Vec<f64>> = turns.map(|(ms, others)| logs(ms, others)).collect();
        let (deviation, freedom) = pooled(&groups).unwrap_or(NO_TURNS);
        Self { deviation, freedom }
    }

    /// Whether a picture takes more or less time than its base, one of so many statements.
    fn tells(&self, ms: &[f64], baseline_ms: &[f64], statements: usize) -> bool {
        let logs = logs(ms, baseline_ms);
        let error = self.deviation / (logs.len().max(1) as f64).sqrt();
        !logs.is_empty() && mean(&logs).abs() > SAME_PROGRAM + standard_errors(statements, self.freedom) * error
    }
}

/// Times of a picture and of its base in turns.
#[derive(Clone, Copy)]
pub struct PairedTimes<'a> {
    /// Its own, in milliseconds.
    pub ms: &'a [f64],
    /// The base's.
    pub baseline_ms: &'a [f64],
    /// How well both are known.
    pub clock: TimeNoise,
}

/// The price of a change. `more_error`: how much more mean squared error it has than its base, where a reference tells that; `None`
/// of pictures by paths, which are compared with each other. It is of no point yet, and `flip_delta` is FLIP between both.
#[must_use]
pub fn price(
    change: &Change,
    pair: &Pair,
    more_error: Option<Estimate>,
    turns: PairedTimes<'_>,
    statements: usize,
    sure: f64,
) -> Price {
    let PairedTimes { ms, baseline_ms, clock } = turns;
    let differences: Vec<f64> = ms.iter().zip(baseline_ms).map(|(a, b)| a - b).collect();
    let gpu_ms_delta = Interval::of(&differences);
    let base_ms = Interval::of(baseline_ms).median;
    let (base, squares, more) = match more_error {
        Some(more) => (Family::Local, 1, more),
        None => {
            let (side, found) = significant(&pair.squares, sure).unwrap_or((1, Estimate::default()));
            (Family::Exact, side, found)
        }
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

/// Whether a change is one of chance alone: the light is the same in the mean.
fn by_chance(change: &Change) -> bool {
    match change.knob.as_str() {
        "guiding" => true,
        "lights" => change.from != "points" && change.to != "points",
        _ => false,
    }
}

/// What a price says, in a sentence; nothing of errors that a reference cannot tell.
fn verdict(price: &Price) -> String {
    let median = price.gpu_ms_delta.median;
    let (longer, shorter) = (price.takes_longer(), price.saves());
    let time = if longer {
        format!("takes {median:.1} ms longer ({:+.0} %)", 100.0 * price.share)
    } else if shorter {
        format!("saves {:.1} ms (−{:.0} %)", -median, -100.0 * price.share)
    } else {
        "takes the same time as far as can be told".to_owned()
    };
    let flip = price.flip_between;
    let error = price.shown_delta;
    let seen = if price.same {
        "the picture is the same to the last bit".to_owned()
    } else if let Some(ratio) = price.noise_ratio {
        format!("the same light, {:.2} times the noise", ratio.sqrt())
    } else if flip < INVISIBLE {
        format!("nobody sees it (FLIP {flip:.4} between both)")
    } else if price.base != Family::Exact && !price.error_told {
        format!("which is nearer to the truth cannot be told from the reference's noise (FLIP {flip:.3} between both)")
    } else if price.base != Family::Exact && error.median < 0.0 {
        let less = 100.0 * (-error.median).sqrt();
        let undoes = if price.undoes_another() { ", though it approximates more: it undoes another error" } else { "" };
        format!("less error by {less:.2} % of the range (FLIP {flip:.3} between both){undoes}")
    } else if price.is_seen() {
        // From the reference's rungs a cheaper one is wrong; a dearer one says what they leave out.
        let more = match (price.base, price.to_more_exact()) {
            (Family::Exact, false) => "an error of",
            (Family::Exact, true) => "another picture by",
            _ => "more error by",
        };
        let squares =
            if price.squares > 1 { format!(" in squares of {} pixels", price.squares) } else { String::new() };
        format!("{more} {:.2} % of the range{squares} (FLIP {flip:.3} between both)", 100.0 * error.median.sqrt())
    } else {
        format!("no error beyond noise (FLIP {flip:.3} between both)")
    };
    let nearer = price.base != Family::Exact && price.error_told && error.median < 0.0;
    let seen = match price.brightness {
        Some(ratio) if (ratio - 1.0).abs() > BY_ROUNDING => format!(
            "{seen}; the mean brightness changes by {:+.4} %, which rounding alone does not do: one of both is wrong here",
            100.0 * (ratio - 1.0)
        ),
        _ => seen,
    };
    let better = price.noise_ratio.is_some_and(|ratio| ratio < 1.0) || nearer;
    if longer && !better && !price.is_seen() {
        return format!("{time}; {seen}: wasted here");
    }
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
            price(&change, &pair, Some(Estimate::default()), turns, 100, 4.0).verdict
        };
        // π off by a thousandth in the lobe of a tier: study:lamps and study:materials at 160x90.
        assert!(said(0.999_947_5).contains("one of both is wrong here") && said(0.999_962_4).contains("wrong here"));
        // The tiers as they are, there and in study:metals.
        assert!(![1.0, 1.000_000_9, 1.000_007_3].iter().any(|&same| said(same).contains("wrong here")));
    }

    #[test]
    fn times_that_differ_by_chance_are_not_told() {
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
        // All seven turns may agree, and it is still what two places in memory differ by.
        assert!(!tells(1.03) && !tells(1.0));
        assert!(!clock.tells(&[], &[], 100));
    }
}
