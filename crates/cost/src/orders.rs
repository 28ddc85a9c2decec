//! Order of convergence of the quadrature rules for ray marching in heterogeneous media: the error of each rule by its
//! number of steps (lecture A2, numerics S8).
//!
//! The pictures are ray-traced with one sample. They differ only by the quadrature, so that no noise hides the error;
//! path-traced pictures would have noise.

use anyhow::{Context as _, Result, ensure};

use super::statistics::Interval;
use super::table::QuadratureOrder;
use super::warm::Bench;
use etalon::image::Picture;
use etalon::plan::{Knobs, Model};

/// Numbers of steps; the reference has the last number of steps and Simpson's rule.
const STEPS: [u32; 5] = [4, 8, 16, 32, 64];
const RULES: [&str; 3] = ["left", "midpoint", "simpson"];

/// Relative error below which f32 rounding dominates.
const ROUNDING: f64 = 1e-8;

/// Estimated order: median of the slopes of log error over log steps between neighbouring numbers of steps. The median
/// ignores the last slopes, where kinks of the grid or rounding stop the convergence.
#[must_use]
pub fn order(steps: &[u32], errors: &[f64]) -> Option<f64> {
    let told: Vec<(f64, f64)> =
        steps.iter().zip(errors).filter(|(_, e)| **e > ROUNDING).map(|(&n, &e)| (f64::from(n), e)).collect();
    let slopes: Vec<f64> =
        told.windows(2).map(|pair| -(pair[1].1 / pair[0].1).ln() / (pair[1].0 / pair[0].0).ln()).collect();
    (!slopes.is_empty()).then(|| Interval::of(&slopes).median)
}

fn mean_square(picture: &Picture, value: impl Fn(usize, usize) -> f64) -> f64 {
    let pixels = picture.rgba.len();
    (0..pixels).map(|i| (0..3).map(|c| value(i, c).powi(2)).sum::<f64>()).sum::<f64>() / (3 * pixels.max(1)) as f64
}

fn knobs(steps: u32, rule: &str) -> Result<Knobs> {
    let mut knobs = Knobs::of(Model::Recursive);
    for choice in ["samples=1", &format!("absorption=march:{steps}"), &format!("quadrature={rule}")] {
        knobs.set(choice)?;
    }
    Ok(knobs)
}

/// Number of pictures that [`orders`] draws.
pub const PICTURES: usize = RULES.len() * STEPS.len();

/// Draws every rule with every number of steps; calls `tell` before each picture.
///
/// # Errors
/// When a picture cannot be drawn, or contains NaN or infinity.
pub fn orders(bench: &Bench<'_>, tell: &mut dyn FnMut(&str)) -> Result<Vec<QuadratureOrder>> {
    let mut films: Vec<(Picture, f64)> = Vec::new();
    for (rule, steps) in RULES.iter().flat_map(|rule| STEPS.map(|steps| (rule, steps))) {
        tell(&format!("orders: {rule}, {steps} steps"));
        let mut warm = bench.warm_up(&knobs(steps, rule)?)?;
        let ms = bench.time(&mut warm)?;
        films.push((warm.renderer.film()?, ms));
    }
    let finite = |(film, _): &(Picture, f64)| film.rgba.iter().flatten().all(|value| value.is_finite());
    ensure!(films.iter().all(finite), "a picture has NaN or infinite radiance");
    let truth = &films.last().context("the list of rules is empty")?.0;
    let whole = mean_square(truth, |i, c| f64::from(truth.rgba[i][c])).sqrt().max(f64::MIN_POSITIVE);
    let of = |rule: usize| {
        let films = &films[rule * STEPS.len()..(rule + 1) * STEPS.len()];
        let error = |(film, _): &(Picture, f64)| {
            mean_square(truth, |i, c| f64::from(film.rgba[i][c]) - f64::from(truth.rgba[i][c])).sqrt() / whole
        };
        // The reference itself has no error.
        let told = STEPS.len() - usize::from(rule + 1 == RULES.len());
        let errors: Vec<f64> = films[..told].iter().map(error).collect();
        QuadratureOrder {
            rule: RULES[rule].to_owned(),
            steps: STEPS[..told].to_vec(),
            order: order(&STEPS, &errors),
            errors,
            gpu_ms: films[..told].iter().map(|(_, ms)| *ms).collect(),
        }
    };
    Ok((0..RULES.len()).map(of).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_are_those_of_powers() {
        for p in [1, 2, 4] {
            let errors = STEPS.map(|n| 0.1 * f64::from(n).powi(-p));
            let found = order(&STEPS, &errors).unwrap();
            assert!((found - f64::from(p)).abs() < 1e-9, "{found}");
        }
        // Errors hidden by rounding have no slope.
        assert_eq!(order(&STEPS, &[1e-3, 1e-9, 3e-9, 2e-9, 1e-9]), None);
        // A last step limited by kinks does not change the median.
        let kinks = order(&STEPS[..4], &[1e-2, 1e-2 / 16.0, 1e-2 / 256.0, 2e-5]).unwrap();
        assert!((kinks - 4.0).abs() < 1e-9, "{kinks}");
    }
}
