//! Absorption along a path (lecture A1, A2): Beer-Lambert transmittance, and quadratures of heterogeneous media.
//!
//! Read pbrt 11.2. σ is in 1/m.

use super::catalogue::{Axis, Case, EXACT, Equation, Output, Region, SplitMix64};

/// @eq A1: optical depth, transmittance, 1 − transmittance, what is left of L0 (Beer 1852).
#[must_use]
pub fn beer_lambert(l0: f64, sigma: f64, d: f64) -> [f64; 4] {
    let tau = sigma * d;
    [tau, (-tau).exp(), -(-tau).exp_m1(), l0 * (-tau).exp()]
}

/// @eq A2: the sum over `n` steps of `ds`: optical depth, transmittance, 1 − transmittance. The sum is exact where `s0`
/// is a power of two.
#[must_use]
pub fn beer_lambert_sum(n: u32, s0: f64, ds: f64, seed: u32) -> [f64; 3] {
    let sigma = |i: u32| {
        let m = i.wrapping_mul(2_654_435_761).wrapping_add(seed) >> 9;
        s0 * (1.0 + f64::from(m) * 2_f64.powi(-23))
    };
    let sum: f64 = (0..n).map(sigma).sum();
    let tau = sum * ds;
    [tau, (-tau).exp(), -(-tau).exp_m1()]
}

/// @eq A2: weights of a step's first point and middle, of what the end of all counts more than the beginning, and what
/// all is divided by: left sums, midpoints, Simpson's rule (1, 4, 1 over 6) with neighbouring ends joined.
#[must_use]
pub fn quadrature_weights(rule: usize) -> [f64; 4] {
    [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [1.0 + 1.0, 4.0, 1.0, 6.0]][rule.min(2)]
}

/// @eq A2: ∫σ ds for σ(s) = `sigma0` e^(−`falloff` s) over 0..=`d` in closed form, and its transmittance. What a sum
/// over steps approaches; steps and rule do not matter.
#[must_use]
pub fn march_optical_depth(sigma0: f64, falloff: f64, d: f64) -> [f64; 2] {
    let x = falloff * d;
    let mean = if x == 0.0 { 1.0 } else { -(-x).exp_m1() / x };
    let tau = sigma0 * d * mean;
    [tau, (-tau).exp()]
}

/// Error bound of a quadrature of smooth σ: d Δs^p/c max|σ^(p)|, with p and c 1 and 2 for the left sum, 2 and 24 for
/// midpoints, 4 and 2880 for Simpson's rule.
#[must_use]
pub fn quadrature_error(sigma0: f64, falloff: f64, d: f64, steps: f64, rule: usize) -> f64 {
    let (order, divisor) = [(1, 2.0), (2, 24.0), (4, 2880.0)][rule];
    let step = falloff.abs() * d / steps;
    d * step.powi(order) / divisor * sigma0 * (-falloff * d).exp().max(1.0)
}

/// Bound of the marched τ: the error of the quadrature and the rounding. Each exponential has 3 units of 2^-24 times
/// its argument, plus 4 units of its own; mean and product add 4.
fn march_allowed(case: &Case<'_>) -> f64 {
    let x = case.inputs;
    let tau = march_optical_depth(x[0], x[1], x[2])[0];
    let error = quadrature_error(x[0], x[1], x[2], x[3], x[4] as usize);
    let growth = (-x[1] * x[2]).max(1.0);
    error + (8.0 + 3.0 * growth) * 2_f64.powi(-24) * (tau + error)
}

/// σ and d with an optical depth of `tau`.
fn path(d: &mut SplitMix64, tau: f64) -> [f32; 2] {
    let sigma = d.log(1e-3, 1e8);
    [sigma as f32, (tau / sigma) as f32]
}

/// n, s0, ds and seed of about the optical depth `tau`; s0 is a power of two, so that every σ_i is a value of f32.
fn steps(d: &mut SplitMix64, n: f64, tau: f64) -> Vec<f32> {
    let s0 = 2_f64.powi(d.below(21) as i32 - 10);
    // Seeds over all 32 bits; verify adds the low digits that a float does not have.
    let seed = (d.unit() * 4294967040.0) as f32;
    vec![n.floor() as f32, s0 as f32, (tau / (1.5 * n * s0)) as f32, seed]
}

fn medium(d: &mut SplitMix64, rule: f32) -> Vec<f32> {
    let length = d.log(1e-2, 1e4);
    let falloff = match d.below(8) {
        0 => 0.0,
        1 => -d.log(1e-3, 3.0) / length,
        _ => d.log(1e-3, 12.0) / length,
    };
    let sigma = d.log(1e-3, 12.0) / length;
    vec![sigma as f32, falloff as f32, length as f32, d.log(1.0, 4096.9).floor() as f32, rule]
}

/// The equations of this file.
pub(super) const EQUATIONS: &[Equation] = &[
    Equation {
        name: "beer_lambert",
        twin: |x| beer_lambert(x[0], x[1], x[2]).to_vec(),
        regions: &[
            Region {
                name: "τ up to 87",
                share: 3,
                draw: |d| {
                    let tau = d.between(0.0, 87.0);
                    let [sigma, length] = path(d, tau);
                    vec![d.log(1e-3, 1e6) as f32, sigma, length]
                },
            },
            Region {
                name: "τ → 0",
                share: 3,
                draw: |d| {
                    let tau = d.log(1e-30, 1.0);
                    let [sigma, length] = path(d, tau);
                    vec![d.log(1e-3, 1e6) as f32, sigma, length]
                },
            },
            Region {
                name: "T below the range, L within",
                share: 1,
                draw: |d| {
                    let tau = d.between(87.0, 170.0);
                    let [sigma, length] = path(d, tau);
                    vec![((tau - d.between(0.0, 80.0)).exp().min(3e38)) as f32, sigma, length]
                },
            },
            Region {
                name: "nothing, everything",
                share: 1,
                draw: |d| {
                    let ends = [0.0, 1.0, f32::MAX, 1e30, 1e-30];
                    vec![ends[d.below(5)], ends[d.below(5)], ends[d.below(5)]]
                },
            },
        ],
        outputs: &[
            Output { name: "tau", bound: "1 ulp", allowed: |c| c.ulps(1.0) },
            Output { name: "T", bound: "2 ulp", allowed: |c| c.ulps(2.0) },
            Output { name: "one_minus_T", bound: "3 ulp", allowed: |c| c.ulps(3.0) },
            Output {
                name: "L",
                bound: "3 ulp; 5 where T is below 2^-126",
                allowed: |c| c.ulps(if c.exact[1] < f64::from(f32::MIN_POSITIVE) { 5.0 } else { 3.0 }),
            },
        ],
        axis: Axis { name: "τ", log: true, of: |x| x[1] * x[2], column: 2, relative: true },
        extreme: f32::MAX,
    },
    Equation {
        name: "quadrature_weights",
        twin: |x| quadrature_weights(x[0] as usize).to_vec(),
        regions: &[Region { name: "the three rules", share: 1, draw: |d| vec![d.below(3) as f32] }],
        outputs: &[
            Output { name: "wx", bound: "exact", allowed: EXACT },
            Output { name: "wy", bound: "exact", allowed: EXACT },
            Output { name: "wz", bound: "exact", allowed: EXACT },
            Output { name: "ww", bound: "exact", allowed: EXACT },
        ],
        axis: Axis { name: "rule", log: false, of: |x| x[0], column: 0, relative: false },
        extreme: 1e38,
    },
    Equation {
        name: "beer_lambert_sum",
        twin: |x| beer_lambert_sum(x[0] as u32, x[1], x[2], x[3] as u32).to_vec(),
        regions: &[
            Region {
                name: "up to 1000 steps",
                share: 399,
                draw: |d| {
                    let (n, tau) =
                        (d.log(1.0, 1e3), if d.below(2) == 0 { d.log(1e-6, 1.0) } else { d.between(0.0, 60.0) });
                    steps(d, n, tau)
                },
            },
            Region {
                name: "up to 2 million steps",
                share: 1,
                draw: |d| {
                    let (n, tau) = (d.log(1e4, 2_097_152.9), d.between(0.0, 60.0));
                    steps(d, n, tau)
                },
            },
            // Seen by a reader that rounded the seed to f32: 11.7 ulp in this region.
            Region {
                name: "up to 20,000 steps, τ to 87",
                share: 4,
                draw: |d| {
                    let (n, tau) = (d.log(1e3, 2e4), d.between(60.0, 87.0));
                    steps(d, n, tau)
                },
            },
        ],
        outputs: &[
            Output { name: "tau", bound: "1 ulp", allowed: |c| c.ulps(1.0) },
            Output { name: "T", bound: "2 ulp", allowed: |c| c.ulps(2.0) },
            Output { name: "one_minus_T", bound: "3 ulp", allowed: |c| c.ulps(3.0) },
        ],
        axis: Axis { name: "steps", log: true, of: |x| x[0], column: 1, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "march_optical_depth",
        twin: |x| march_optical_depth(x[0], x[1], x[2]).to_vec(),
        regions: &[
            Region { name: "left sums", share: 1, draw: |d| medium(d, 0.0) },
            Region { name: "midpoints", share: 1, draw: |d| medium(d, 1.0) },
            Region { name: "Simpson's rule", share: 1, draw: |d| medium(d, 2.0) },
        ],
        outputs: &[
            Output {
                name: "tau",
                bound: "d Δs^p/c max|σ^(p)| with (p, c) = (1, 2), (2, 24), (4, 2880) by rule, + 11·2^-24 of τ",
                allowed: march_allowed,
            },
            Output {
                name: "T",
                bound: "T (e^δτ − 1) + 2 ulp",
                allowed: |c| (march_allowed(c).exp_m1() * c.x()).min(1.0) + c.ulps(2.0),
            },
        ],
        axis: Axis { name: "falloff · Δs", log: true, of: |x| x[1] * x[2] / x[3], column: 0, relative: true },
        extreme: 1e38,
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    /// The sums as in textbooks: within the bound, with the error of their order.
    #[test]
    fn the_rules_are_of_order_one_two_and_four() {
        let (sigma0, falloff, d) = (2.0, 0.5, 10.0);
        let exact = march_optical_depth(sigma0, falloff, d)[0];
        for (rule, order) in [(0, 1), (1, 2), (2, 4)] {
            let error = |steps: u32| {
                let ds = d / f64::from(steps);
                let sigma = |i: u32, part: f64| sigma0 * (-falloff * (f64::from(i) + part) * ds).exp();
                let one = |i: u32| match rule {
                    0 => sigma(i, 0.0),
                    1 => sigma(i, 0.5),
                    _ => (sigma(i, 0.0) + 4.0 * sigma(i, 0.5) + sigma(i, 1.0)) / 6.0,
                };
                let error = ((0..steps).map(one).sum::<f64>() * ds - exact).abs();
                assert!(error <= quadrature_error(sigma0, falloff, d, f64::from(steps), rule));
                error
            };
            let found = (error(32) / error(64)).log2();
            assert!((found - f64::from(order)).abs() < 0.1, "rule {rule} is of order {found}");
        }
    }

    /// A homogeneous medium is the limit of a falling σ.
    #[test]
    fn no_falloff_is_homogeneous() {
        let [tau, _] = march_optical_depth(0.3, 0.0, 7.0);
        assert!((tau - 0.3 * 7.0).abs() < 1e-15);
        assert!((march_optical_depth(0.3, 1e-12, 7.0)[0] - tau).abs() < 1e-11);
    }
}
