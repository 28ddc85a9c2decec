//! Light that arrives at a surface (lecture R2–R4): punctual lights, spheres, and solid angles. Directions are
//! normalised first.
//!
//! Read pbrt 4.1, 4.2 and 12; KHR_lights_punctual.

use std::f64::consts::FRAC_PI_2;

use glam::DVec3;

use super::brdf::{at_cosine, cosine, cosine_in, grazing_allowed, normal};
use super::catalogue::{Axis, Equation, Output, Region, SplitMix64, columns, ulp, vector};

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

/// Smallest distance of a point light in m (shaders/lib/light.glsl).
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

/// @eq R2: 1 − cosθ of the cone of a ball; a hemisphere from inside.
#[must_use]
pub fn sphere_cone(radius2: f64, distance2: f64) -> f64 {
    // 1 − cos θ = 2 sin²(θ/2)
    let half = 0.5 * (radius2 / distance2).min(1.0).sqrt().asin();
    2.0 * half.sin().powi(2)
}

/// @eq R3 R4: direction of the light and E_⊥/I; of a light infinitely far the direction as it is and 1.
#[must_use]
pub fn arriving_light(to_light: DVec3, directional: bool, inv_range2: f64, spot: (DVec3, f64, f64)) -> [f64; 4] {
    if directional {
        return [to_light.x, to_light.y, to_light.z, 1.0];
    }
    let l = to_light.normalize();
    let (axis, scale, offset) = spot;
    let share = point_falloff(to_light.length_squared(), inv_range2) * spot_share(-axis.dot(l), scale, offset);
    [l.x, l.y, l.z, share]
}

/// @eq N34: the smaller root of |t l − c|² = r² for a unit direction l at θ from a ball's middle c, no less than
/// 1e-6 |c|.
#[must_use]
pub fn ball_reach(distance2: f64, radius: f64, cos_theta: f64, sin2_theta: f64) -> f64 {
    let d = distance2.sqrt();
    (d * cos_theta - (radius * radius - distance2 * sin2_theta).max(0.0).sqrt()).max(1e-6 * d)
}

/// @eq R4: importance of a node of the light hierarchy: I cos⁺θ'/max(d², r²), 0 where θ' > θ_e; `node` is the radius,
/// cosθ_o, cosθ_e and I.
#[must_use]
pub fn light_importance(to_point: DVec3, axis: DVec3, node: [f64; 4], two_sided: bool) -> f64 {
    let [radius, cos_o, cos_e, intensity] = node;
    let (d2, r2) = (to_point.length_squared(), (radius * radius).max(LIGHT_RADIUS * LIGHT_RADIUS));
    if d2 <= r2 {
        return intensity / r2;
    }
    let beyond = emission_angle(to_point, axis, two_sided) - cos_o.acos() - (r2 / d2).sqrt().asin();
    let cosine = beyond.max(0.0).cos();
    if cosine < cos_e { 0.0 } else { intensity * cosine.max(0.0) / d2 }
}

/// Angle between an axis and the direction to a point; of a two-sided emitter with the nearer end of the axis.
fn emission_angle(to_point: DVec3, axis: DVec3, two_sided: bool) -> f64 {
    let across = axis.cross(to_point).length();
    let along = axis.dot(to_point);
    across.atan2(if two_sided { along.abs() } else { along })
}

/// @eq R2: density per solid angle of what was drawn per area.
#[must_use]
pub fn density_per_solid_angle(per_area: f64, r2: f64, cos_theta: f64) -> f64 {
    per_area * r2 / cos_theta
}

fn point_row(p: DVec3, l: DVec3, n: DVec3, intensity: f64) -> Vec<f32> {
    let mut row = columns(&[p, p + l, n]);
    row.push(intensity as f32);
    row
}

/// A vector of length `distance` from a surface with normal N to a light on either side.
fn to_light(d: &mut SplitMix64, n: DVec3, distance: f64) -> DVec3 {
    let c = cosine_in(d) * if d.below(4) == 0 { -1.0 } else { 1.0 };
    at_cosine(d, n, c) * distance
}

/// A node whose radius is `part` of its distance, with a cone of axes of cosine in `cosines`.
fn importance_row(d: &mut SplitMix64, part: f64, cosines: [f64; 2]) -> Vec<f32> {
    let distance = d.log(1e-3, 1e3);
    let [low, high] = cosines;
    let mut row = columns(&[d.direction() * distance]);
    row.push((part * distance) as f32);
    row.extend(columns(&[d.direction()]));
    let two_sided = if d.below(2) == 0 { 0.0 } else { 1.0 };
    row.extend([d.between(low, high) as f32, d.unit() as f32, two_sided, d.log(1e-6, 1.0) as f32]);
    row
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
            bound: "2.5 ulp + 2.4e-7/r² of the window's end",
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
                // KHR_lights_punctual: cones whose cosines differ by less than 0.001 are treated as 0.001 apart.
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
        twin: |x| vec![sphere_cone(x[0], x[1])],
        regions: &[
            Region {
                name: "far away",
                share: 2,
                draw: |d| {
                    let distance2 = d.log(1e-6, 1e12);
                    vec![(distance2 * d.log(1e-18, 1.0)) as f32, distance2 as f32]
                },
            },
            Region {
                name: "at the surface",
                share: 1,
                draw: |d| {
                    let distance2 = d.log(1e-6, 1e12);
                    vec![(distance2 * (1.0 + d.sign() * d.log(1e-7, 0.1))) as f32, distance2 as f32]
                },
            },
        ],
        outputs: &[Output {
            name: "one_minus_cos",
            bound: "4 ulp + 0.6 of the rounding of q² over cosθ, at most 1.2 of its root",
            allowed: |c| {
                let sin2 = (c.inputs[0] / c.inputs[1]).min(1.0);
                let error = 2_f64.powi(-24) * sin2;
                c.ulps(4.0) + (0.6 * error / (1.0 - sin2).max(0.0).sqrt()).min(1.2 * error.sqrt())
            },
        }],
        axis: Axis { name: "radius²/distance²", log: true, of: |x| x[0] / x[1], column: 0, relative: true },
        extreme: -1.0,
    },
    Equation {
        name: "arriving_light",
        twin: |x| arriving_light(vector(x, 0), x[3] != 0.0, x[4], (vector(x, 5), x[8], x[9])).to_vec(),
        regions: &[
            Region {
                name: "points, half of them with a range",
                share: 2,
                draw: |d| {
                    let r = d.log(1e-3, 1e3);
                    let range2 = if d.below(2) == 0 { 0.0 } else { 1.0 / (r * r * d.log(1.5, 100.0)) };
                    let q = columns(&[d.direction() * r]);
                    let a = columns(&[d.direction()]);
                    [q, vec![0.0, range2 as f32], a, vec![0.0, 1.0]].concat()
                },
            },
            Region {
                name: "spots, between their cones",
                share: 2,
                draw: |d| {
                    let l = d.direction();
                    let outer = d.between(0.1, 1.5);
                    let inner = outer * d.between(0.0, 0.9);
                    let scale = 1.0 / (inner.cos() - outer.cos()).max(1e-3);
                    let angle = d.between(inner, outer);
                    let axis = d.at_angle(-l, angle);
                    let q = columns(&[l * d.log(1e-3, 1e3)]);
                    [q, vec![0.0, 0.0], columns(&[axis]), vec![scale as f32, (-outer.cos() * scale) as f32]].concat()
                },
            },
            Region {
                name: "infinitely far",
                share: 1,
                draw: |d| {
                    [columns(&[d.direction()]), vec![1.0, 0.0], columns(&[d.direction()]), vec![0.0, 1.0]].concat()
                },
            },
        ],
        outputs: &[
            Output { name: "lx", bound: "3e-7; as given where infinitely far", allowed: |_| 3e-7 },
            Output { name: "ly", bound: "as lx", allowed: |_| 3e-7 },
            Output { name: "lz", bound: "as lx", allowed: |_| 3e-7 },
            Output {
                name: "share",
                bound: "8 ulp + (2.4e-7 of the window's end + 1e-6 scale of the ramp + (5e-7 scale)²)/r²",
                allowed: |c| {
                    if c.inputs[3] != 0.0 {
                        return 0.0;
                    }
                    let r2 = vector(c.inputs, 0).length_squared();
                    let ramp = c.inputs[8] * 5e-7;
                    c.ulps(8.0) + (2.4e-7 + (2.0 + ramp) * ramp) / r2
                },
            },
        ],
        axis: Axis { name: "r, m", log: true, of: |x| vector(x, 0).length(), column: 3, relative: true },
        extreme: -1.0,
    },
    Equation {
        name: "ball_reach",
        twin: |x| vec![ball_reach(x[0], x[1], x[2], x[3])],
        regions: &[Region {
            name: "in the cone of a ball",
            share: 1,
            draw: |d| {
                let radius = d.log(1e-3, 1e2);
                let distance = radius * (1.0 + d.log(1e-6, 1e5));
                let sin2 = (radius / distance).powi(2) * d.unit();
                vec![(distance * distance) as f32, radius as f32, (1.0 - sin2).sqrt() as f32, sin2 as f32]
            },
        }],
        outputs: &[Output {
            name: "t",
            bound: "2.4e-7 d + half of 4e-7 r² over the root + 2e-7 of it, the root of 4e-7 r² where the root is less",
            allowed: |c| {
                let d = c.inputs[0].sqrt();
                let disc = (c.inputs[1].powi(2) - c.inputs[0] * c.inputs[3]).max(0.0);
                let error = 4e-7 * c.inputs[1].powi(2);
                2.4e-7 * d + if disc > error { 0.5 * error / disc.sqrt() + 2e-7 * disc.sqrt() } else { error.sqrt() }
            },
        }],
        axis: Axis { name: "distance/radius", log: true, of: |x| x[0].sqrt() / x[1], column: 0, relative: true },
        extreme: -1.0,
    },
    Equation {
        name: "light_importance",
        twin: |x| vec![light_importance(vector(x, 0), vector(x, 4), [x[3], x[7], x[8], x[10]], x[9] != 0.0)],
        regions: &[
            Region { name: "points and spots", share: 1, draw: |d| importance_row(d, 0.0, [-1.0, 1.0]) },
            Region {
                name: "from outside",
                share: 3,
                draw: |d| {
                    let part = d.log(1e-4, 0.99);
                    importance_row(d, part, [-1.0, 1.0])
                },
            },
            Region {
                name: "from inside",
                share: 1,
                draw: |d| {
                    let part = d.log(1.01, 1e4);
                    importance_row(d, part, [-1.0, 1.0])
                },
            },
            Region {
                name: "narrow cones",
                share: 1,
                draw: |d| {
                    let part = d.log(1e-4, 0.1);
                    importance_row(d, part, [0.99, 1.0])
                },
            },
        ],
        outputs: &[Output {
            name: "importance",
            bound: "I/d² times 2e-6 + the roundings of three cosines over the sines, each at most its root; none at θ_e",
            allowed: |c| {
                let (to_point, axis) = (vector(c.inputs, 0), vector(c.inputs, 4));
                let d2 = to_point.length_squared();
                let sin_b = c.inputs[3].max(LIGHT_RADIUS) / d2.sqrt();
                if sin_b >= 1.0 {
                    return c.ulps(6.0);
                }
                let theta = emission_angle(to_point, axis, c.inputs[9] != 0.0);
                // Of an angle, from a cosine that has the error 5e-7.
                let error = |sine: f64| (5e-7 / sine).min(1.1e-3);
                let cos_b = (1.0 - sin_b * sin_b).sqrt();
                let all = error(theta.sin()) + error((1.0 - c.inputs[7].powi(2)).max(0.0).sqrt()) + error(cos_b) + 2e-6;
                let beyond = (theta - c.inputs[7].acos() - sin_b.asin()).max(0.0).cos();
                if (beyond - c.inputs[8]).abs() <= all { f64::INFINITY } else { c.inputs[10] / d2 * all }
            },
        }],
        axis: Axis {
            name: "radius/distance",
            log: true,
            of: |x| x[3] / vector(x, 0).length(),
            column: 0,
            relative: true,
        },
        extreme: -1.0,
    },
    Equation {
        name: "density_per_solid_angle",
        twin: |x| vec![density_per_solid_angle(x[0], x[1], x[2])],
        regions: &[Region {
            name: "triangles of any size",
            share: 1,
            draw: |d| vec![d.log(1e-6, 1e6) as f32, d.log(1e-6, 1e6) as f32, d.log(1e-6, 1.0) as f32],
        }],
        outputs: &[Output { name: "pdf", bound: "2 ulp", allowed: |c| c.ulps(2.0) }],
        axis: Axis { name: "cosθ", log: true, of: |x| x[2], column: 0, relative: true },
        extreme: -1.0,
    },
];
