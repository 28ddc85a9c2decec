//! How quickly the sum through media that vary comes near to the integral: the error of each rule by its number of steps, and the
//! order that it tells (lecture A2, numerics S8).
//!
//! Drawn with rays, whose pictures with one sample differ by the sum alone: no noise has to be told from the error, as there is in
//! prices from the reference's rungs.

use anyhow::{Context as _, Result, ensure};

use super::statistics::Interval;
use super::table::QuadratureOrder;
use super::warm::Bench;
use etalon::image::Picture;
use etalon::plan::{Knobs, Model};

/// Steps that are tried; the truth has as many as the last, with Simpson's rule.
const STEPS: [u32; 5] = [4, 8, 16, 32, 64];
const RULES: [&str; 3] = ["left", "midpoint", "simpson"];

/// Below this share of the picture an error is that of f32.
const ROUNDING: f64 = 1e-8;

/// The middle of the slopes of log error over log steps from each number of steps to the next: where a grid's kinks or rounding end
/// the descent, most of them come before.
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

/// How many pictures [`orders`] draws.
pub const PICTURES: usize = RULES.len() * STEPS.len();

/// Draws every rule with every number of steps; `tell` hears of each before.
///
/// # Errors
/// When something cannot be drawn.
pub fn orders(bench: &Bench<'_>, tell: &mut dyn FnMut(&str)) -> Result<Vec<QuadratureOrder>> {
    let mut films: Vec<(Picture, f64)> = Vec::new();
    for (rule, steps) in RULES.iter().flat_map(|rule| STEPS.map(|steps| (rule, steps))) {
        tell(&format!("orders: {rule}, {steps} steps"));
        let mut warm = bench.warm_up(&knobs(steps, rule)?)?;
        let ms = bench.time(&mut warm)?;
        films.push((warm.renderer.film()?, ms));
    }
    let finite = |(film, _): &(Picture, f64)| film.rgba.iter().flatten().all(|value| value.is_finite());
    ensure!(films.iter().all(finite), "some picture has values that are no numbers");
    let truth = &films.last().context("there are rules")?.0;
    let whole = mean_square(truth, |i, c| f64::from(truth.rgba[i][c])).sqrt().max(f64::MIN_POSITIVE);
    let of = |rule: usize| {
        let films = &films[rule * STEPS.len()..(rule + 1) * STEPS.len()];
        let error = |(film, _): &(Picture, f64)| {
            mean_square(truth, |i, c| f64::from(film.rgba[i][c]) - f64::from(truth.rgba[i][c])).sqrt() / whole
        };
        // The truth has no error that can be told.
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
        // What rounding hides has no slope.
        assert_eq!(order(&STEPS, &[1e-3, 1e-9, 3e-9, 2e-9, 1e-9]), None);
        // Nor has what kinks leave.
        let kinks = order(&STEPS[..4], &[1e-2, 1e-2 / 16.0, 1e-2 / 256.0, 2e-5]).unwrap();
        assert!((kinks - 4.0).abs() < 1e-9, "{kinks}");
    }
}
