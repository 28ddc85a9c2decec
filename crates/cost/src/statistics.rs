//! Estimates and how sure they are, where many statements are made at once.

use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF as _, StudentsT};

/// Chance that any one of a report's statements is wrong by noise alone.
const LEVEL: f64 = 0.01;

/// A number and how well it is known.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// In the middle.
    pub median: f64,
    /// At least.
    pub low: f64,
    /// At most.
    pub high: f64,
}

impl Interval {
    /// The middle and both ends of some numbers, at least one.
    #[must_use]
    pub fn of(values: &[f64]) -> Self {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        let at = |i: usize| sorted.get(i).copied().unwrap_or_default();
        Self { median: 0.5 * (at(n.saturating_sub(1) / 2) + at(n / 2)), low: at(0), high: at(n.saturating_sub(1)) }
    }

    /// The root of a mean square, which is not below 0.
    #[must_use]
    pub fn root(&self) -> Self {
        let root = |square: f64| square.max(0.0).sqrt();
        Self { median: root(self.median), low: root(self.low), high: root(self.high) }
    }
}

/// A number that was estimated.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// In the mean.
    pub mean: f64,
    /// Its standard error.
    pub deviation: f64,
    /// What it may be off by beside noise, whatever the noise is.
    pub bias: f64,
}

impl Estimate {
    /// Two standard errors either way, and what it may be off by.
    #[must_use]
    pub fn interval(&self) -> Interval {
        let reach = 2.0 * self.deviation + self.bias;
        Interval { median: self.mean, low: self.mean - reach, high: self.mean + reach }
    }

    /// Whether it is above 0 by more than so many standard errors and what it may be off by.
    #[must_use]
    pub fn is_above(&self, standard_errors: f64) -> bool {
        self.mean > standard_errors * self.deviation + self.bias
    }

    /// Whether it is below 0 by more than that.
    #[must_use]
    pub fn is_below(&self, standard_errors: f64) -> bool {
        -self.mean > standard_errors * self.deviation + self.bias
    }

    /// Whether it is one or the other.
    #[must_use]
    pub fn is_significant(&self, standard_errors: f64) -> bool {
        self.is_above(standard_errors) || self.is_below(standard_errors)
    }
}

/// How many standard errors one of so many statements has to be away from nothing, so that all of them together are wrong with a
/// chance of one in a hundred (Bonferroni). Standard errors that were themselves estimated from few numbers are less sure:
/// `freedom` is how many, less what was estimated from them (Student 1908).
#[must_use]
pub fn standard_errors(statements: usize, freedom: f64) -> f64 {
    let tail = LEVEL / (2.0 * statements.max(1) as f64);
    StudentsT::new(0.0, 1.0, freedom.max(1.0)).map_or(f64::INFINITY, |t| t.inverse_cdf(1.0 - tail))
}

/// Degrees of freedom from which nobody tells Student's distribution from the normal one: those of pixels.
pub const MANY: f64 = 1e4;

/// The standard deviation of numbers about the mean of their group, and its degrees of freedom. Groups of one tell nothing.
#[must_use]
pub fn pooled(groups: &[Vec<f64>]) -> Option<(f64, f64)> {
    let (mut squares, mut freedom) = (0.0, 0.0);
    for group in groups.iter().filter(|group| group.len() > 1) {
        let mean = mean(group);
        squares += group.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>();
        freedom += group.len() as f64 - 1.0;
    }
    (freedom > 0.0).then(|| ((squares / freedom).sqrt(), freedom))
}

/// The mean of some numbers, at least one.
#[must_use]
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_statements_take_more() {
        // Quantiles of the normal distribution at 0.995 and 0.99995, and Student's with 2 at 0.995 (tables).
        assert!((standard_errors(1, MANY) - 2.576).abs() < 2e-3, "{}", standard_errors(1, MANY));
        assert!((standard_errors(100, MANY) - 3.891).abs() < 5e-3, "{}", standard_errors(100, MANY));
        assert!((standard_errors(1, 2.0) - 9.925).abs() < 1e-3, "{}", standard_errors(1, 2.0));
    }

    #[test]
    fn groups_have_one_spread() {
        // Two about 1 and 10, both with a deviation of √2 from one degree of freedom each.
        let (deviation, freedom) = pooled(&[vec![0.0, 2.0], vec![9.0, 11.0], vec![5.0]]).expect("a spread");
        assert!((deviation - 2.0_f64.sqrt()).abs() < 1e-12 && freedom == 2.0);
        assert!(pooled(&[vec![1.0]]).is_none());
    }

    #[test]
    fn what_is_far_from_nothing_is_told() {
        let far = Estimate { mean: 1.0, deviation: 0.2, bias: 0.0 };
        assert!(far.is_above(4.0) && !far.is_above(6.0) && !far.is_below(0.0));
        let off = Estimate { bias: 0.3, ..far };
        assert!(off.is_significant(3.0) && !off.is_significant(4.0));
        assert!((off.interval().low - 0.3).abs() < 1e-12 && (off.interval().high - 1.7).abs() < 1e-12);
        let root = Interval { median: 4.0, low: -1.0, high: 9.0 }.root();
        assert_eq!(root, Interval { median: 2.0, low: 0.0, high: 3.0 });
    }
}
