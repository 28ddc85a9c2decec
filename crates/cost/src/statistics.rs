//! Estimates with standard errors, and significance tests with a Bonferroni correction for many simultaneous
//! statements.

use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF as _, StudentsT};

/// Family-wise error rate: probability that any statement of a report is wrong due to noise.
const LEVEL: f64 = 0.01;

/// Standard errors of a confidence interval to each side: about 95 % of normally distributed values.
pub const IN_95: f64 = 2.0;

/// A number with an interval: the range of measurements, or a confidence interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Median or estimate.
    pub median: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// Median, minimum and maximum of at least one number.
    #[must_use]
    pub fn of(values: &[f64]) -> Self {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        let at = |i: usize| sorted.get(i).copied().unwrap_or_default();
        Self { median: 0.5 * (at(n.saturating_sub(1) / 2) + at(n / 2)), low: at(0), high: at(n.saturating_sub(1)) }
    }

    /// Square root of an interval of mean squares; negative values count as 0.
    #[must_use]
    pub fn root(&self) -> Self {
        let root = |square: f64| square.max(0.0).sqrt();
        Self { median: root(self.median), low: root(self.low), high: root(self.high) }
    }
}

/// An estimate with its standard error and a bound of its bias.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Mean.
    pub mean: f64,
    /// Standard error of the mean.
    pub deviation: f64,
    /// Bound of the bias.
    pub bias: f64,
}

impl Estimate {
    /// Confidence interval of two standard errors (95 %), widened by the bound of the bias.
    #[must_use]
    pub fn interval(&self) -> Interval {
        let reach = IN_95 * self.deviation + self.bias;
        Interval { median: self.mean, low: self.mean - reach, high: self.mean + reach }
    }

    /// Whether the mean is significantly above 0: by more than `standard_errors` standard errors and the bound of the
    /// bias.
    #[must_use]
    pub fn is_above(&self, standard_errors: f64) -> bool {
        self.mean > standard_errors * self.deviation + self.bias
    }

    /// Whether the mean is significantly below 0.
    #[must_use]
    pub fn is_below(&self, standard_errors: f64) -> bool {
        -self.mean > standard_errors * self.deviation + self.bias
    }

    /// Whether the mean differs significantly from 0.
    #[must_use]
    pub fn is_significant(&self, standard_errors: f64) -> bool {
        self.is_above(standard_errors) || self.is_below(standard_errors)
    }
}

/// Number of standard errors from zero that makes one of `statements` statements significant, so that the probability
/// of any wrong statement is at most 1 % (two-sided test, Bonferroni correction). It is a quantile of Student's t
/// distribution with `freedom` degrees of freedom of the standard error (Student 1908).
#[must_use]
pub fn standard_errors(statements: usize, freedom: f64) -> f64 {
    let tail = LEVEL / (2.0 * statements.max(1) as f64);
    StudentsT::new(0.0, 1.0, freedom.max(1.0)).map_or(f64::INFINITY, |t| t.inverse_cdf(1.0 - tail))
}

/// Resolution of a reference with a bias of at most β (`off`), whose resolution by its noise alone is √(z σ): the least
/// m with m² > z σ + 2mβ + β².
#[must_use]
pub fn resolved(off: f64, by_noise: f64) -> f64 {
    (off + (2.0 * off * off + by_noise * by_noise).sqrt()).min(1.0)
}

/// Degrees of freedom of estimates over pixels, for which Student's t distribution is practically normal.
pub const MANY: f64 = 1e4;

/// Pooled standard deviation within groups, and its degrees of freedom; `None` where every group has a single number.
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

/// Mean of at least one number.
#[must_use]
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_statements_take_more() {
        // Tabulated quantiles: normal distribution at 0.995 and 0.99995, Student's t with 2 degrees of freedom at
        // 0.995.
        assert!((standard_errors(1, MANY) - 2.576).abs() < 2e-3, "{}", standard_errors(1, MANY));
        assert!((standard_errors(100, MANY) - 3.891).abs() < 5e-3, "{}", standard_errors(100, MANY));
        assert!((standard_errors(1, 2.0) - 9.925).abs() < 1e-3, "{}", standard_errors(1, 2.0));
    }

    #[test]
    fn groups_have_one_spread() {
        // Groups about 1 and 10, each with a deviation of √2 and one degree of freedom.
        let (deviation, freedom) = pooled(&[vec![0.0, 2.0], vec![9.0, 11.0], vec![5.0]]).expect("a spread");
        assert!((deviation - 2.0_f64.sqrt()).abs() < 1e-12 && freedom == 2.0);
        assert!(pooled(&[vec![1.0]]).is_none());
    }

    #[test]
    fn estimates_far_from_zero_are_significant() {
        let far = Estimate { mean: 1.0, deviation: 0.2, bias: 0.0 };
        assert!(far.is_above(4.0) && !far.is_above(6.0) && !far.is_below(0.0));
        let off = Estimate { bias: 0.3, ..far };
        assert!(off.is_significant(3.0) && !off.is_significant(4.0));
        assert!((off.interval().low - 0.3).abs() < 1e-12 && (off.interval().high - 1.7).abs() < 1e-12);
        let root = Interval { median: 4.0, low: -1.0, high: 9.0 }.root();
        assert_eq!(root, Interval { median: 2.0, low: 0.0, high: 3.0 });
    }
}
