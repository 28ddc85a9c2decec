//! Light that arrives at a surface (lecture R2–R4), and solid angles. Directions are normalised first.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::DVec3;

use super::brdf::{at_cosine, cosine, cosine_in, grazing_allowed, normal};
use super::catalogue::{Axis, Case, Draw, Equation, Output, Region, columns, ulp, vector};

/// @eq R3: cos⁺θ, E cos⁺θ.
#[must_use]
pub fn light_directional(n: DVec3, l: DVec3, e: f64) -> [f64; 2] {
    let cos_plus = cosine(n, l).max(0.0);
    [cos_plus, e * cos_plus]
}

/// @eq R4: r², cos⁺θ, I/r², I/r² cos⁺θ. At r = 0: 0, 0, ∞ for I > 0, 0. NaN for the last where the rounding of the
/// cosine decides whether f32 holds it.
#[must_use]
pub fn light_point(p: DVec3, q: DVec3, n: DVec3, intensity: f64) -> [f64; 4] {
    let l = q - p;
    let r2 = l.length_squared();
    if r2 == 0.0 {
        return [0.0, 0.0, if intensity > 0.0 { f64::INFINITY } else { 0.0 }, 0.0];
    }
    let cos_plus = cosine(n, l).max(0.0);
    let e = intensity / r2;
    let fits = |cos_plus: f64| e * cos_plus <= f64::from(f32::MAX);
    let decided = fits(cos_plus - 3e-7) == fits(cos_plus + 3e-7);
    [r2, cos_plus, e, if decided { e * cos_plus } else { f64::NAN }]
}

/// Least distance of a point light, m (shaders/lib/light.glsl).
pub const LIGHT_RADIUS: f64 = 1e-12;

/// @eq R4: irradiance per intensity of a point light with a range (KHR_lights_punctual).
#[must_use]
pub fn point_falloff(r2: f64, inv_range2: f64) -> f64 {
    (1.0 - (r2 * inv_range2).powi(2)).clamp(0.0, 1.0) / r2.max(LIGHT_RADIUS * LIGHT_RADIUS)
}

/// @eq R4: share of a spot light's intensity (KHR_lights_punctual).
#[must_use]
pub fn spot_share(cos_angle: f64, scale: f64, offset: f64) -> f64 {
    (cos_angle * scale + offset).clamp(0.0, 1.0).powi(2)
}

/// @eq R2: 1 − cosθ and solid angle of the cone of a sphere; all around from inside.
#[must_use]
pub fn sphere_cone(radius: f64, distance: f64) -> [f64; 2] {
    // 1 − cos θ = 2 sin²(θ/2)
    let half = if distance < radius { FRAC_PI_2 } else { 0.5 * (radius / distance).asin() };
    let one_minus_cos = 2.0 * half.sin().powi(2);
    [one_minus_cos, TAU * one_minus_cos]
}

/// @eq R2: solid angle of a triangle (van Oosterom and Strackee 1983). The volume from the edges, as in the shader: of
/// slivers L'Huilier's theorem and a·(b × c) leave four digits in f64 as well.
#[must_use]
pub fn triangle_solid_angle(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let volume = a.dot((b - a).cross(c - a)).abs();
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    2.0 * volume.atan2(la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
}

fn point_row(p: DVec3, l: DVec3, n: DVec3, intensity: f64) -> Vec<f32> {
    let mut row = columns(&[p, p + l, n]);
    row.push(intensity as f32);
    row
}

/// From a surface with normal N a vector to the light: any side, `distance` long.
fn to_light(d: &mut Draw, n: DVec3, distance: f64) -> DVec3 {
    let c = cosine_in(d) * if d.below(4) == 0 { -1.0 } else { 1.0 };
    at_cosine(d, n, c) * distance
}

/// Errors that the corners' rounding to f32 products leave in numerator and denominator of tan(Ω/2).
fn triangle_allowed(case: &Case<'_>) -> f64 {
    let (a, b, c) = (vector(case.inputs, 0), vector(case.inputs, 3), vector(case.inputs, 6));
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let lengths = la * lb * lc;
    let numerator = a.dot((b - a).cross(c - a)).abs() / lengths;
    let denominator = 1.0 + a.dot(b) / (la * lb) + b.dot(c) / (lb * lc) + c.dot(a) / (lc * la);
    let edges = (b - a).length() * (c - a).length() * la / lengths;
    let numerator_error = case.tiered(4e-7 * edges, 1e-12 * edges + 1.2e-7 * numerator);
    let size2 = numerator * numerator + denominator * denominator;
    case.ulps(4.0) + 2.0 * (denominator.abs() * numerator_error + numerator * 1e-6) / size2
}

/// The equations of this file.
pub(super) const EQUATIONS: &[Equation] = &[
    Equation {
        name: "light_directional",
        twin: |x| {
            let l = vector(x, 3);
            if l == DVec3::ZERO { vec![0.0; 2] } else { light_directional(vector(x, 0), l, x[6]).to_vec() }
        },
        regions: &[
            Region {
                name: "unit length",
                share: 1,
                draw: |d| {
                    let n = normal(d);
                    let mut row = columns(&[n, to_light(d, n, 1.0)]);
                    row.push(d.log(1e-3, 1e6) as f32);
                    row
                },
            },
            Region {
                name: "any length",
                share: 2,
                draw: |d| {
                    let (n, length) = (normal(d), d.log(1e-30, 1e37));
                    let mut row = columns(&[n, to_light(d, n, length)]);
                    row.push(d.log(1e-3, 1e6) as f32);
                    row
                },
            },
        ],
        outputs: &[
            Output { name: "cos_plus", bound: "8 ulp + 1e-14", allowed: |c| grazing_allowed(c.x()) },
            Output {
                name: "irradiance",
                bound: "E times that + 1 ulp",
                allowed: |c| c.inputs[6] * grazing_allowed(c.exact[0]) + c.ulps(1.0),
            },
        ],
        axis: Axis { name: "|L|", log: true, of: |x| vector(x, 3).length(), column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "light_point",
        twin: |x| light_point(vector(x, 0), vector(x, 3), vector(x, 6), x[9]).to_vec(),
        regions: &[
            Region {
                name: "in a scene",
                share: 2,
                draw: |d| {
                    let p = d.direction() * d.between(0.0, 100.0);
                    let (n, r) = (normal(d), d.log(1e-3, 1e3));
                    let l = to_light(d, n, r);
                    point_row(p, l, n, d.log(1e-3, 1e6))
                },
            },
            Region {
                name: "far from the origin",
                share: 2,
                draw: |d| {
                    let p = d.direction() * d.between(0.5e6, 1.5e6);
                    let (n, r) = (normal(d), d.log(0.06, 1e4));
                    let l = to_light(d, n, r);
                    point_row(p, l, n, d.log(1e-3, 1e6))
                },
            },
            Region {
                name: "any distance",
                share: 2,
                draw: |d| {
                    let (n, r) = (normal(d), d.log(1e-30, 1e30));
                    let p = if d.below(2) == 0 { DVec3::ZERO } else { d.direction() * (r * d.unit()) };
                    let l = to_light(d, n, r);
                    point_row(p, l, n, d.log(1e-3, 1e6))
                },
            },
            Region {
                name: "at the light",
                share: 1,
                draw: |d| {
                    let p = d.direction() * d.log(1e-3, 1e6);
                    let n = normal(d);
                    let moved = if d.below(2) == 0 { DVec3::ZERO } else { d.direction() * 1e-7 * p.length() };
                    point_row(p, moved, n, d.log(1e-3, 1e6))
                },
            },
        ],
        outputs: &[
            Output { name: "r2", bound: "5 ulp", allowed: |c| c.ulps(5.0) },
            Output { name: "cos_plus", bound: "8 ulp + 1e-14", allowed: |c| grazing_allowed(c.x()) },
            Output { name: "E_perp", bound: "6 ulp", allowed: |c| c.ulps(6.0) },
            Output {
                name: "irradiance",
                bound: "E_⊥ times that of cos⁺ + 8 ulp",
                allowed: |c| {
                    let at_light = c.exact[0] == 0.0;
                    let part = if at_light { 0.0 } else { c.exact[2] * grazing_allowed(c.exact[1]) };
                    c.ulps(8.0) + part
                },
            },
        ],
        axis: Axis {
            name: "r, m",
            log: true,
            of: |x| (vector(x, 3) - vector(x, 0)).length(),
            column: 2,
            relative: true,
        },
        extreme: 1e38,
    },
    Equation {
        name: "point_falloff",
        twin: |x| vec![point_falloff(x[0], x[1])],
        regions: &[
            Region { name: "no range", share: 1, draw: |d| vec![d.log(1e-20, 1e20) as f32, 0.0] },
            Region {
                name: "with a range",
                share: 1,
                draw: |d| {
                    let range2 = d.log(1e-4, 1e8);
                    vec![(range2 * d.log(1e-8, 2.0)) as f32, (1.0 / range2) as f32]
                },
            },
            Region {
                name: "at its end",
                share: 1,
                draw: |d| {
                    let range2 = d.log(1e-4, 1e8);
                    vec![(range2 * (1.0 + d.sign() * d.log(1e-7, 0.1))) as f32, (1.0 / range2) as f32]
                },
            },
        ],
        outputs: &[Output {
            name: "falloff",
            bound: "2 ulp + 2.4e-7/r² of the window's end",
            allowed: |c| {
                let x = c.inputs[0] * c.inputs[1];
                let window = if x > 0.0 && x < 1.01 { 2.4e-7 * x * x } else { 0.0 };
                c.ulps(2.5) + window / c.inputs[0].max(LIGHT_RADIUS * LIGHT_RADIUS)
            },
        }],
        axis: Axis { name: "r/range", log: true, of: |x| (x[0] * x[1]).sqrt(), column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "spot_share",
        twin: |x| vec![spot_share(x[0], x[1], x[2])],
        regions: &[Region {
            name: "between the cones",
            share: 1,
            draw: |d| {
                let inner = d.log(1e-2, 1.5);
                let outer = (inner + d.log(1e-3, 1.0)).min(FRAC_PI_2);
                // KHR_lights_punctual: cones nearer than 0.001 in the cosine are one.
                let scale = 1.0 / (inner.cos() - outer.cos()).max(1e-3);
                let angle = d.between(0.9 * inner, 1.1 * outer);
                vec![angle.cos() as f32, scale as f32, (-outer.cos() * scale) as f32]
            },
        }],
        outputs: &[Output {
            name: "share",
            bound: "of the ramp 1.2e-7 (scale cosθ + 1); compensated 4 ulp",
            allowed: |c| {
                let (ramp, product) = (c.x().sqrt(), (c.inputs[0] * c.inputs[1]).abs());
                let error = c.tiered(0.51 * ulp(product) + 0.51 * ulp(ramp), 0.0);
                c.ulps(4.0) + (2.0 * ramp + error) * error
            },
        }],
        axis: Axis { name: "scale cosθ + offset", log: true, of: |x| x[0] * x[1] + x[2], column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "sphere_cone",
        twin: |x| sphere_cone(x[0], x[1]).to_vec(),
        regions: &[
            Region {
                name: "far away",
                share: 2,
                draw: |d| {
                    let distance = d.log(1e-3, 1e6);
                    vec![(distance * d.log(1e-9, 1.0)) as f32, distance as f32]
                },
            },
            Region {
                name: "at the surface",
                share: 1,
                draw: |d| {
                    let distance = d.log(1e-3, 1e6);
                    vec![(distance * (1.0 + d.sign() * d.log(1e-7, 0.1))) as f32, distance as f32]
                },
            },
        ],
        outputs: &[
            Output { name: "one_minus_cos", bound: "4 ulp", allowed: |c| c.ulps(4.0) },
            Output { name: "omega", bound: "6 ulp", allowed: |c| c.ulps(6.0) },
        ],
        axis: Axis { name: "radius/distance", log: true, of: |x| x[0] / x[1], column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "triangle_solid_angle",
        twin: |x| vec![triangle_solid_angle(vector(x, 0), vector(x, 3), vector(x, 6))],
        regions: &[
            Region {
                name: "any three directions",
                share: 1,
                draw: |d| {
                    let corners = [0; 3].map(|_| d.direction() * d.log(0.1, 10.0));
                    columns(&corners)
                },
            },
            Region {
                name: "small or far",
                share: 2,
                draw: |d| {
                    let (centre, size) = (d.direction() * d.log(1e-3, 1e6), d.log(1e-4, 1.0));
                    let corners = [0; 3].map(|_| centre + d.direction() * size * centre.length());
                    columns(&corners)
                },
            },
        ],
        outputs: &[Output {
            name: "omega",
            bound: "4 ulp + rounding of numerator and denominator; compensated: of the denominator",
            allowed: triangle_allowed,
        }],
        axis: Axis {
            name: "Ω, sr",
            log: true,
            of: |x| triangle_solid_angle(vector(x, 0), vector(x, 3), vector(x, 6)),
            column: 0,
            relative: true,
        },
        extreme: 1e38,
    },
];
