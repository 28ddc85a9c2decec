//! Monte Carlo variance from two independent halves of a picture's samples: an unbiased error estimate, relative MSE,
//! convergence rate.

use rayon::prelude::*;
use serde::Serialize;

/// Pixels that one thread adds up at a time.
const CHUNK: usize = 1 << 14;

/// Error estimate of a mean of samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SampleError {
    /// Samples per pixel.
    pub samples: u32,
    /// Mean over pixels and colours of squared error over squared value plus 0.01, as in `diff --metric relmse`.
    pub relmse: f64,
    /// Root of the mean squared error.
    pub rmse: f64,
}

/// Error estimate from two sums of n and m samples. Their means a and b have independent errors, whose variances are
/// 1/n and 1/m of that of a sample, so that (a − b)² nm/(n + m)² has the variance of the mean of all samples as
/// expected value; with n = m that is (a − b)²/4.
#[must_use]
pub fn error_of_halves(sums: [&[[f32; 4]]; 2], counts: [u32; 2]) -> SampleError {
    let samples = counts[0] + counts[1];
    let scale = 1.0 / f64::from(samples);
    let [n, m] = counts.map(f64::from);
    let weights = [(m / n).sqrt(), (n / m).sqrt()];
    let of_chunk = |(a, b): (&[[f32; 4]], &[[f32; 4]])| {
        let (mut relative, mut squared) = (0.0, 0.0);
        for (a, b) in a.iter().zip(b).flat_map(|(a, b)| a[..3].iter().zip(&b[..3])) {
            let (a, b) = (f64::from(*a) * scale, f64::from(*b) * scale);
            let variance = (weights[0] * a - weights[1] * b).powi(2);
            let value = a + b;
            relative += variance / (value * value + 0.01);
            squared += variance;
        }
        [relative, squared]
    };
    // Chunks have one size and their sums one order, so the estimate does not depend on the number of threads.
    let [a, b] = sums.map(|sum| sum.par_chunks(CHUNK));
    let chunks: Vec<[f64; 2]> = a.zip(b).map(of_chunk).collect();
    let [relative, squared] = [0, 1].map(|i| chunks.iter().map(|sums| sums[i]).sum::<f64>());
    let count = 3.0 * sums[0].len().min(sums[1].len()) as f64;
    SampleError { samples, relmse: relative / count, rmse: (squared / count).sqrt() }
}

/// Convergence rate: slope of log √relmse over log samples, by least squares; −0.5 for independent samples.
/// `None` for fewer than two estimates.
#[must_use]
pub fn slope(errors: &[SampleError]) -> Option<f64> {
    let points: Vec<(f64, f64)> =
        errors.iter().filter(|e| e.relmse > 0.0).map(|e| (f64::from(e.samples).ln(), 0.5 * e.relmse.ln())).collect();
    let n = points.len() as f64;
    let (x, y) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
    let across: f64 = points.iter().map(|p| (p.0 - x) * (p.0 - x)).sum();
    (across > 0.0).then(|| points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>() / across)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_tell_the_error_of_their_mean() {
        // Each half has errors of ±0.2 around 1, so the root mean square error of the mean is 0.1√2.
        let half = |signs: [f32; 4]| -> Vec<[f32; 4]> { signs.iter().map(|s| [8.0 * (1.0 + 0.2 * s); 4]).collect() };
        let (a, b) = (half([1.0, 1.0, -1.0, -1.0]), half([1.0, -1.0, 1.0, -1.0]));
        let error = error_of_halves([&a, &b], [8, 8]);
        assert!((error.rmse - 0.2 / 2.0_f64.sqrt()).abs() < 1e-7, "{error:?}");
        let same = error_of_halves([&a, &a], [8, 8]);
        assert_eq!((same.rmse, same.relmse), (0.0, 0.0));
    }

    #[test]
    fn a_half_with_one_more_sample_is_no_error() {
        let sum = |samples: f32| vec![[samples; 4]; 4];
        let error = error_of_halves([&sum(3.0), &sum(2.0)], [3, 2]);
        assert!(error.samples == 5 && error.rmse < 1e-12, "{error:?}");
        // Means 1.2 and 0.8: the variance of the picture is 0.4² times 6/25.
        let error = error_of_halves([&sum(3.6), &sum(1.6)], [3, 2]);
        assert!((error.rmse - (0.16 * 0.24_f64).sqrt()).abs() < 1e-6, "{error:?}");
    }

    #[test]
    fn slopes_are_those_of_powers() {
        let of = |power: f64| -> Vec<SampleError> {
            [2, 4, 64, 1024]
                .map(|n| SampleError { samples: n, relmse: 3.0 * f64::from(n).powf(2.0 * power), rmse: 0.0 })
                .into()
        };
        assert!((slope(&of(-0.5)).unwrap() + 0.5).abs() < 1e-12);
        assert!((slope(&of(-0.75)).unwrap() + 0.75).abs() < 1e-12);
        assert!(slope(&of(-0.5)[..1]).is_none() && slope(&[]).is_none());
    }
}
