//! Reflected and refracted directions at a smooth surface (lecture F4–F6): Snell's law. Directions are normalised
//! first.
//!
//! Read pbrt 9.3; Born & Wolf, Principles of Optics, 1.5.

use glam::DVec3;

use super::catalogue::{Axis, Case, EXACT, Equation, Output, Region, SplitMix64, columns, flag, vector};

/// @eq F4: the mirrored direction.
#[must_use]
pub fn reflect(v: DVec3, n_surface: DVec3) -> DVec3 {
    let (v, n) = (v.normalize(), n_surface.normalize());
    let cos_in = -v.dot(n);
    v + 2.0 * n * cos_in
}

/// @eq F5: the refracted direction, total reflection, cos²β. The direction is NaN on total reflection.
#[must_use]
pub fn refract(v: DVec3, n_surface: DVec3, n: f64) -> (DVec3, bool, f64) {
    let sin2_in = v.cross(n_surface).length_squared() / (v.length_squared() * n_surface.length_squared());
    let disc = 1.0 - sin2_in / (n * n);
    let (v, normal) = (v.normalize(), n_surface.normalize());
    let cos_in = -v.dot(normal);
    let t = if disc < 0.0 { DVec3::NAN } else { v / n + normal * (cos_in / n - disc.sqrt()) };
    (t, disc < 0.0, disc)
}

/// @eq F6: whether there is a critical angle; radians, degrees and cosine (90° where there is none).
#[must_use]
pub fn critical_angle(n_in: f64, n_out: f64) -> [f64; 4] {
    if n_in <= n_out {
        return [0.0, std::f64::consts::FRAC_PI_2, 90.0, 0.0];
    }
    let cosine = ((n_in - n_out) * (n_in + n_out)).sqrt() / n_in;
    let theta = (n_out / n_in).asin();
    [1.0, theta, theta.to_degrees(), cosine]
}

/// @eq F6: Brewster's angle in radians, and its cosine.
#[must_use]
pub fn brewster_angle(n_in: f64, n_out: f64) -> [f64; 2] {
    let theta = (n_out / n_in).atan();
    [theta, n_in / n_in.hypot(n_out)]
}

/// v and N with the angle of incidence `angle` in radians.
fn incident(d: &mut SplitMix64, angle: f64) -> [DVec3; 2] {
    let n = d.direction();
    [-d.at_angle(n, angle), n]
}

fn with_index(d: &mut SplitMix64, angle: f64, n: f64) -> Vec<f32> {
    let pair = incident(d, angle);
    let mut all = columns(&pair);
    all.push(n as f32);
    all
}

/// n and disc = cos²β of a case, which determine the sensitivity of the direction.
fn refraction(case: &Case<'_>) -> (f64, f64) {
    (case.inputs[6], case.exact[4])
}

/// Row 11 of docs/numerics.md: 2^-22 (1 + 1/(n² √disc)). Compensated: 5e-7, near the critical angle the rounding of the
/// compensated cosine, a relative 2^-24 of g.
fn direction_allowed(case: &Case<'_>) -> f64 {
    let (n, disc) = refraction(case);
    case.tiered(2_f64.powi(-22) * (1.0 + 1.0 / (n * n * disc.sqrt())), 5e-7)
}

/// The equations of this file.
pub(super) const EQUATIONS: &[Equation] = &[
    Equation {
        name: "reflect",
        twin: |x| reflect(vector(x, 0), vector(x, 3)).to_array().to_vec(),
        regions: &[
            Region {
                name: "every angle",
                share: 2,
                draw: |d| {
                    let angle = d.between(0.0, 1.57);
                    columns(&incident(d, angle))
                },
            },
            Region {
                name: "normal incidence",
                share: 1,
                draw: |d| {
                    let angle = d.log(1e-9, 0.1);
                    columns(&incident(d, angle))
                },
            },
            Region {
                name: "grazing",
                share: 1,
                draw: |d| {
                    let angle = std::f64::consts::FRAC_PI_2 - d.log(1e-8, 0.1);
                    columns(&incident(d, angle))
                },
            },
        ],
        outputs: &[
            Output { name: "Rx", bound: "abs 3e-7", allowed: |_| 3e-7 },
            Output { name: "Ry", bound: "abs 3e-7", allowed: |_| 3e-7 },
            Output { name: "Rz", bound: "abs 3e-7", allowed: |_| 3e-7 },
        ],
        axis: Axis { name: "angle of incidence, rad", log: true, of: incidence, column: 0, relative: false },
        extreme: 1e38,
    },
    Equation {
        name: "refract",
        twin: |x| {
            let (t, tir, disc) = refract(vector(x, 0), vector(x, 3), x[6]);
            vec![t.x, t.y, t.z, flag(tir), disc]
        },
        regions: &[
            Region {
                name: "every angle",
                share: 2,
                draw: |d| {
                    let (angle, n) = (d.between(0.0, 1.57), d.log(0.3, 3.0));
                    with_index(d, angle, n)
                },
            },
            Region {
                name: "normal incidence",
                share: 1,
                draw: |d| {
                    let (angle, n) = (d.log(1e-9, 0.1), d.log(0.3, 3.0));
                    with_index(d, angle, n)
                },
            },
            Region {
                name: "n → 1",
                share: 1,
                draw: |d| {
                    let (angle, n) = (d.between(0.0, 1.57), 1.0 + d.sign() * d.log(6e-8, 0.1));
                    with_index(d, angle, n)
                },
            },
            Region {
                name: "below the critical angle",
                share: 2,
                draw: |d| {
                    let n = d.between(0.3, 0.999);
                    let angle = n.asin() * (1.0 - d.log(1e-6, 0.1));
                    with_index(d, angle, n)
                },
            },
            Region {
                name: "above the critical angle",
                share: 1,
                draw: |d| {
                    let n = d.between(0.3, 0.999);
                    let angle = (n.asin() * (1.0 + d.log(1e-6, 0.1))).min(1.57);
                    with_index(d, angle, n)
                },
            },
        ],
        outputs: &[
            Output { name: "Tx", bound: "2^-22 (1 + 1/(n²√disc)); compensated 5e-7", allowed: direction_allowed },
            Output { name: "Ty", bound: "as Tx", allowed: direction_allowed },
            Output { name: "Tz", bound: "as Tx", allowed: direction_allowed },
            Output {
                name: "tir",
                bound: "exact where |disc| > 1e-13 max(1, 1/n²)",
                allowed: |c| {
                    let (n, disc) = refraction(c);
                    flag(disc.abs() <= 1e-13 * 1_f64.max(1.0 / (n * n)))
                },
            },
            Output {
                name: "disc",
                bound: "6 ulp + 1e-13 max(1, 1/n²)",
                allowed: |c| {
                    let (n, _) = refraction(c);
                    let scale = 1_f64.max(1.0 / (n * n));
                    c.ulps(6.0) + 1e-13 * scale
                },
            },
        ],
        axis: Axis {
            name: "cos²β (0 is the critical angle)",
            log: true,
            of: |x| refract(vector(x, 0), vector(x, 3), x[6]).2,
            column: 0,
            relative: false,
        },
        extreme: 1e38,
    },
    Equation {
        name: "critical_angle",
        twin: |x| critical_angle(x[0], x[1]).to_vec(),
        regions: &[
            Region { name: "glasses", share: 1, draw: |d| vec![d.log(1.0, 10.0) as f32, d.log(1.0, 10.0) as f32] },
            Region {
                name: "nearly equal",
                share: 1,
                draw: |d| {
                    let n = d.between(1.0, 3.0);
                    vec![(n * (1.0 + d.sign() * d.log(1e-7, 0.1))) as f32, n as f32]
                },
            },
            Region {
                name: "special",
                share: 1,
                draw: |d| vec![d.near(&[10.0, 1.5, 1.333, 2.42]), d.near(&[1.0, 1.333])],
            },
        ],
        outputs: &[
            Output { name: "exists", bound: "exact", allowed: EXACT },
            Output { name: "theta_rad", bound: "4 ulp", allowed: |c| c.ulps(4.0) },
            Output { name: "theta_deg", bound: "5 ulp: the angle's and one product's", allowed: |c| c.ulps(5.0) },
            Output { name: "cos_theta", bound: "4 ulp", allowed: |c| c.ulps(4.0) },
        ],
        axis: Axis { name: "n_in/n_out − 1", log: true, of: |x| x[0] / x[1] - 1.0, column: 3, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "brewster_angle",
        twin: |x| brewster_angle(x[0], x[1]).to_vec(),
        regions: &[Region {
            name: "glasses",
            share: 1,
            draw: |d| vec![d.log(0.1, 10.0) as f32, d.log(0.1, 10.0) as f32],
        }],
        outputs: &[
            Output { name: "theta_rad", bound: "4 ulp", allowed: |c| c.ulps(4.0) },
            Output { name: "cos_theta", bound: "4 ulp", allowed: |c| c.ulps(4.0) },
        ],
        axis: Axis { name: "n_out/n_in", log: true, of: |x| x[1] / x[0], column: 0, relative: true },
        extreme: 1e38,
    },
];

/// Angle between −v and N in radians.
fn incidence(x: &[f64]) -> f64 {
    let (v, n) = (vector(x, 0), vector(x, 3));
    v.cross(n).length().atan2(-v.dot(n))
}
