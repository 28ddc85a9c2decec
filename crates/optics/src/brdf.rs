//! BRDF models of the lecture (B1–B6): Lambert, Phong, GGX with Smith masking-shadowing, VNDF sampling, and the MIS
//! power heuristic.
//!
//! Read Walter et al. 2007 (GGX); Heitz, JCGT 3(2) 2014 (Smith) and JCGT 7(4) 2018 (VNDF); Veach 1997 (the power
//! heuristic); Turquin 2019 (energy compensation). Directions are normalised first.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::catalogue::{Axis, Case, EXACT, Equation, Output, Region, SplitMix64, columns, ulp, vector};

/// Cosine of the angle between two directions; 0 for a zero vector.
pub(super) fn cosine(a: DVec3, b: DVec3) -> f64 {
    a.normalize_or_zero().dot(b.normalize_or_zero())
}

/// @eq B4: cos⁺θ, L.
#[must_use]
pub fn lambert(n: DVec3, l: DVec3, lin: f64, kd: f64) -> [f64; 2] {
    let cos_plus = cosine(n, l).max(0.0);
    [cos_plus, lin * kd * cos_plus]
}

/// @eq B1: cosδ, sin²δ of N and L/|L| + V/|V|, and the square of that sum. NaN for the angle where L = −V.
#[must_use]
pub fn half_angle(n: DVec3, l: DVec3, v: DVec3) -> (f64, f64, f64) {
    // p L + q V = (L + V)(p + q)/2 + (L − V)(p − q)/2: for L near −V the sum of normalised vectors would have nine
    // digits.
    let (sum, difference) = (l + v, l - v);
    let (p, q) = (1.0 / l.length(), 1.0 / v.length());
    let p_less_q = -sum.dot(difference) * p * q / (l.length() + v.length());
    let s = 0.5 * ((p + q) * sum + p_less_q * difference);
    let n = n.normalize();
    let s2 = s.length_squared();
    (n.dot(s) / s2.sqrt(), n.cross(s).length_squared() / s2, s2)
}

/// (cos⁺δ)^shine, 0 for L = −V.
fn lobe(cos_delta: f64, shine: f64) -> f64 {
    if cos_delta > 0.0 { cos_delta.powf(shine.max(0.0)) } else { 0.0 }
}

/// @eq B5 B9: cosθ, cosδ, sin²δ, the lobe, L.
#[must_use]
pub fn blinn_phong(n: DVec3, l: DVec3, v: DVec3, [lin, kd, ks, shine]: [f64; 4]) -> [f64; 5] {
    let cos_in = cosine(n, l);
    let (cos_delta, sin2_delta, _) = half_angle(n, l, v);
    if cos_in < 0.0 {
        return [cos_in, cos_delta, sin2_delta, f64::NAN, 0.0];
    }
    let spec = lobe(cos_delta, shine);
    [cos_in, cos_delta, sin2_delta, spec, lin * kd * cos_in + lin * ks * spec]
}

/// @eq B6: (L + V)², the specular part of f_r, L.
#[must_use]
pub fn reciprocal_phong(n: DVec3, l: DVec3, v: DVec3, [lin, kd, ks, shine]: [f64; 4]) -> [f64; 3] {
    let cos_in = cosine(n, l);
    let (cos_delta, _, s2) = half_angle(n, l, v);
    if cos_in < 0.0 {
        return [s2, f64::NAN, 0.0];
    }
    let fr_spec = if s2 > 0.0 { ks * lobe(cos_delta, shine) / s2 } else { 0.0 };
    [s2, fr_spec, lin * (kd + fr_spec) * cos_in]
}

/// D from cosine and sin². The sum of squares replaces c²(α² − 1) + 1, which loses the peak of α = 1e-5 even in f64.
fn distribution(cos_h: f64, sin2_h: f64, alpha: f64) -> f64 {
    if cos_h > 0.0 { alpha * alpha / (PI * (cos_h * cos_h * alpha * alpha + sin2_h).powi(2)) } else { 0.0 }
}

/// @eq B1: cosθ_h, sin²θ_h, D.
#[must_use]
pub fn ggx_d(n: DVec3, h: DVec3, alpha: f64) -> [f64; 3] {
    let cos_h = cosine(n, h);
    let sin2_h = n.cross(h).length_squared() / (n.length_squared() * h.length_squared());
    [cos_h, sin2_h, distribution(cos_h, sin2_h, alpha)]
}

/// @eq B1: Λ of Smith's shadowing.
#[must_use]
pub fn ggx_lambda(cos_v: f64, alpha: f64) -> f64 {
    let tan2 = (1.0 - cos_v) * (1.0 + cos_v) / (cos_v * cos_v);
    // √(1 + x) − 1 without cancellation for small x.
    let x = alpha * alpha * tan2;
    0.5 * x / ((1.0 + x).sqrt() + 1.0)
}

/// @eq B1: G₁ of L and of V, height-correlated G₂, G₂/(4 cosθ_l cosθ_v). NaN for the last at 90°.
#[must_use]
pub fn ggx_g(cos_l: f64, cos_v: f64, alpha: f64) -> [f64; 4] {
    let [g1_l, g1_v] = [cos_l, cos_v].map(|c| if c > 0.0 { 1.0 / (1.0 + ggx_lambda(c, alpha)) } else { 0.0 });
    if cos_l <= 0.0 || cos_v <= 0.0 {
        return [g1_l, g1_v, 0.0, f64::NAN];
    }
    let g2 = 1.0 / (1.0 + ggx_lambda(cos_l, alpha) + ggx_lambda(cos_v, alpha));
    [g1_l, g1_v, g2, g2 / (4.0 * cos_l * cos_v)]
}

/// @eq F2: Schlick's curve from F0.
#[must_use]
pub fn ggx_f(f0: f64, cos_d: f64) -> f64 {
    f0 + (1.0 - f0) * (1.0 - cos_d.min(1.0)).powi(5)
}

/// @eq B1 B2: D, G₂, F, f_r, f_r cosθ_l. NaN where L or V is below the surface.
#[must_use]
pub fn ggx(n: DVec3, l: DVec3, v: DVec3, alpha: f64, f0: f64) -> [f64; 5] {
    let (cos_l, cos_v) = (cosine(n, l), cosine(n, v));
    if cos_l <= 0.0 || cos_v <= 0.0 {
        return [f64::NAN; 5];
    }
    let (cos_h, sin2_h, s2) = half_angle(n, l, v);
    // At N·H = 0 rounding decides the side of the step.
    let d = if cos_h.abs() > 3e-7 { distribution(cos_h, sin2_h, alpha) } else { f64::NAN };
    let [_, _, g2, _] = ggx_g(cos_l, cos_v, alpha);
    let f = ggx_f(f0, 0.5 * s2.sqrt());
    let fr = d * g2 * f / (4.0 * cos_l * cos_v);
    [d, g2, f, fr, fr * cos_l]
}

/// @eq B1: 1 + F0 (1/E − 1).
#[must_use]
pub fn ggx_compensation(f0: f64, albedo: f64) -> f64 {
    1.0 + f0 * (1.0 / albedo - 1.0)
}

/// @eq B1: sin and cos of θ_h = arctan(α √(u/(1 − u))) (Walter et al. 2007, eq. 35).
#[must_use]
pub fn ggx_sample(u: f64, alpha: f64) -> [f64; 2] {
    let theta = (alpha * (u / (1.0 - u)).sqrt()).atan();
    [theta.sin(), theta.cos()]
}

/// @eq B1: density of a direction mirrored at a half vector that the viewer sees (Heitz 2018).
#[must_use]
pub fn mirrored_pdf(cos_v: f64, cos_h: f64, sin2_h: f64, alpha: f64) -> f64 {
    ggx_distribution(cos_h, sin2_h, alpha) / (1.0 + ggx_lambda(cos_v, alpha)) / (4.0 * cos_v)
}

/// @eq B1: a half vector among those that the viewer sees (Heitz, JCGT 7(4) 2018): v stretched by α along both axes, a
/// point of the disk across it moved by what is seen of the lower half, back on the hemisphere, and stretched again.
#[must_use]
pub fn visible_half_vector(v: DVec3, alphas: [f64; 2], u: [f64; 2]) -> DVec3 {
    let vh = DVec3::new(alphas[0] * v.x, alphas[1] * v.y, v.z).normalize();
    let t1 = if vh.x == 0.0 && vh.y == 0.0 { DVec3::X } else { DVec3::new(-vh.y, vh.x, 0.0).normalize() };
    let t2 = vh.cross(t1);
    let (r, phi) = (u[0].sqrt(), TAU * u[1]);
    let (p1, across) = (r * phi.cos(), r * phi.sin());
    let s = 0.5 * (1.0 + vh.z);
    let p2 = (1.0 - s) * (1.0 - p1 * p1).max(0.0).sqrt() + s * across;
    let h = p1 * t1 + p2 * t2 + (1.0 - p1 * p1 - p2 * p2).max(0.0).sqrt() * vh;
    DVec3::new(alphas[0] * h.x, alphas[1] * h.y, h.z.max(0.0)).normalize()
}

/// @eq B1: G₂/G₁ of the viewer, cosines from 1e-4 on.
#[must_use]
pub fn smith_g2_over_g1(cos_v: f64, cos_l: f64, alpha: f64) -> f64 {
    let [v, l] = [cos_v, cos_l].map(|c| ggx_lambda(c.abs().max(f64::from(1e-4_f32)), alpha));
    (1.0 + v) / (1.0 + v + l)
}

/// @eq B4: f_r of a ground that reflects all of the light that reaches it.
#[must_use]
pub fn diffuse_brdf(enters: f64) -> f64 {
    enters / PI
}

/// @eq B5: cos^shine of an angle given by its cosine and its sin²: by the latter below 45°, where it has the digits.
#[must_use]
pub fn phong_lobe(cos_h: f64, sin2_h: f64, shine: f64) -> f64 {
    match (cos_h > 0.0, sin2_h < 0.5) {
        (false, _) => 0.0,
        (_, true) => (0.5 * shine * (-sin2_h).ln_1p()).exp(),
        _ => cos_h.powf(shine),
    }
}

/// @eq B6: the lobe over (L + V)²; 0 for L = −V.
#[must_use]
pub fn reciprocal_lobe(sum2: f64, lobe: f64) -> f64 {
    if sum2 > 0.0 { lobe / sum2 } else { 0.0 }
}

/// @eq B1: D where cos² and sin² are 1 together; 0 below the surface.
#[must_use]
pub fn ggx_distribution(cos_h: f64, sin2_h: f64, alpha: f64) -> f64 {
    distribution(if cos_h > 0.0 { (1.0 - sin2_h).max(0.0).sqrt().max(f64::MIN_POSITIVE) } else { 0.0 }, sin2_h, alpha)
}

/// @eq B1: G₂/(4 cosθ_l cosθ_v).
#[must_use]
pub fn ggx_visibility(cos_l: f64, cos_v: f64, alpha: f64) -> f64 {
    ggx_g(cos_l, cos_v, alpha)[3]
}

/// @eq B4: a direction with density cosθ/π, and that.
#[must_use]
pub fn cosine_sample(u1: f64, u2: f64) -> [f64; 4] {
    let (r, phi, z) = (u1.sqrt(), TAU * u2, (1.0 - u1).sqrt());
    [r * phi.cos(), r * phi.sin(), z, z / PI]
}

/// @eq N24: the power heuristic with exponent 2.
#[must_use]
pub fn mis_weight(p: f64, q: f64) -> f64 {
    if p == 0.0 { 0.0 } else { p * p / (p * p + q * q) }
}

// --------------------------------------------------------------------------------------------------------------------
// Test regions

const AXES: [DVec3; 6] = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z];

/// A coordinate axis, with which f32 directions have cosines of 1e-8 and less, or a random direction.
pub(super) fn normal(d: &mut SplitMix64) -> DVec3 {
    if d.below(5) < 2 { AXES[d.below(6)] } else { d.direction() }
}

/// A direction at a given cosine from `from`.
pub(super) fn at_cosine(d: &mut SplitMix64, from: DVec3, cosine: f64) -> DVec3 {
    let across = d.perpendicular(from);
    from * cosine + across * ((1.0 - cosine) * (1.0 + cosine)).max(0.0).sqrt()
}

/// A cosine: uniform, grazing, or near 1.
pub(super) fn cosine_in(d: &mut SplitMix64) -> f64 {
    match d.below(8) {
        0..3 => d.unit(),
        3..6 => d.log(1e-8, 1.0),
        6 => d.log(1e-7, 1.5).cos(),
        _ => [0.0, 1.0, 0.5, 0.25][d.below(4)],
    }
}

pub(super) fn alpha(d: &mut SplitMix64) -> f64 {
    if d.below(8) == 0 { f64::from(d.near(&[1e-5, 1e-3, 0.1, 1.0])).clamp(1e-5, 1.0) } else { d.log(1e-5, 1.0) }
}

/// Rounds to f32, so that later steps use the direction that the shader gets.
fn rounded(v: DVec3) -> DVec3 {
    v.as_vec3().as_dvec3()
}

/// N at `angle` from the half vector of L and V.
fn around_half(d: &mut SplitMix64, l: DVec3, v: DVec3, angle: f64) -> DVec3 {
    let s = rounded(l).normalize() + rounded(v).normalize();
    let h = if s.length() > 1e-9 { s.normalize() } else { d.perpendicular(l) };
    d.at_angle(h, angle)
}

/// L and V at a random angle, or nearly opposite.
fn pair(d: &mut SplitMix64, opposite: bool) -> [DVec3; 2] {
    let l = if opposite && d.below(3) == 0 { AXES[d.below(6)] } else { d.direction() };
    let angle = if opposite { PI - d.log(1e-7, 1.0) } else { d.between(0.0, 2.5) };
    [l, d.at_angle(l, angle)]
}

/// L_in, k_d, k_s and the shininess.
fn strengths(d: &mut SplitMix64, shine: f64) -> [f32; 4] {
    [d.log(1e-3, 1e6) as f32, d.unit() as f32, d.unit() as f32, shine as f32]
}

/// A shininess, and δ for which the lobe is at least e^-13.8.
fn in_lobe(d: &mut SplitMix64) -> (f64, f64) {
    let shine = d.log(1.0, 1e7);
    let depth = if d.below(2) == 0 { d.between(0.0, 13.8) } else { d.log(1e-6, 13.8) };
    (shine, (-depth / shine).exp().acos())
}

fn phong_row(vectors: [DVec3; 3], strengths: [f32; 4]) -> Vec<f32> {
    let mut row = columns(&vectors);
    row.extend(strengths);
    row
}

const PHONG: &[Region] = &[
    Region {
        name: "in the lobe",
        share: 4,
        draw: |d| {
            let (shine, delta) = in_lobe(d);
            let [l, v] = pair(d, false);
            phong_row([around_half(d, l, v, delta), l, v], strengths(d, shine))
        },
    },
    Region {
        name: "L near −V",
        share: 3,
        draw: |d| {
            let (shine, delta) = in_lobe(d);
            let [l, v] = pair(d, true);
            phong_row([around_half(d, l, v, delta), l, v], strengths(d, shine))
        },
    },
    Region {
        name: "both grazing",
        share: 2,
        draw: |d| {
            let n = AXES[d.below(6)];
            let (cl, cv) = (d.log(1e-8, 1.0), d.sign() * d.log(1e-8, 1.0));
            let (l, v) = (at_cosine(d, n, cl), at_cosine(d, n, cv));
            let shine = d.log(1.0, 30.0);
            phong_row([n, l, v], strengths(d, shine))
        },
    },
    Region {
        name: "anywhere",
        share: 1,
        draw: |d| {
            let shine = d.log(1.0, 1e4);
            phong_row([d.direction(), d.direction(), d.direction()], strengths(d, shine))
        },
    },
];

/// L and V above the surface, N near their half vector.
const GGX: &[Region] = &[
    Region {
        name: "at the peak",
        share: 4,
        draw: |d| {
            let alpha = alpha(d);
            let [l, v] = pair(d, false);
            let angle = (alpha * d.log(1e-3, 1e3)).atan();
            ggx_row([around_half(d, l, v, angle), l, v], alpha, d)
        },
    },
    Region {
        name: "L near −V",
        share: 2,
        draw: |d| {
            let alpha = alpha(d);
            let [l, v] = pair(d, true);
            let angle = (alpha * d.log(1e-3, 1e3)).atan();
            ggx_row([around_half(d, l, v, angle), l, v], alpha, d)
        },
    },
    Region {
        name: "any cosines",
        share: 4,
        draw: |d| {
            let n = normal(d);
            let (cl, cv) = (cosine_in(d), cosine_in(d));
            let (l, v) = (at_cosine(d, n, cl), at_cosine(d, n, cv));
            let alpha = alpha(d);
            ggx_row([n, l, v], alpha, d)
        },
    },
];

fn ggx_row(vectors: [DVec3; 3], alpha: f64, d: &mut SplitMix64) -> Vec<f32> {
    let mut row = columns(&vectors);
    let f0 = match d.below(4) {
        0 => 0.04,
        1 => d.log(1e-4, 1.0),
        _ => d.unit(),
    };
    row.extend([alpha as f32, f0 as f32]);
    row
}

// --------------------------------------------------------------------------------------------------------------------
// Error bounds

/// Error of a cosine from exact products, over the lengths (row 25 of docs/numerics.md requires 32 ulp).
pub(super) fn grazing_allowed(exact: f64) -> f64 {
    8.0 * ulp(exact) + 1e-14
}

/// Error of a cosine by plain sums: three products and two sums round to at most 1e-7, and each of the two lengths,
/// which are not divided out, is off by 5.2e-8 for components of equal size.
pub(super) fn cosine_allowed(case: &Case<'_>, exact: f64) -> f64 {
    case.tiered(1.0e-7 + 1.04e-7 * exact.abs(), 8.0 * ulp(exact) + 1e-14)
}

/// Rotation of the half vector by rounding, in radians: L + V, minus its part along L − V, and H, each to 2^-24 of a
/// component.
const TURN: f64 = 2e-7;

/// Error of the cosine of the half vector, whose length is off by 2 ulp of inversesqrt.
fn half_cosine_allowed(case: &Case<'_>, exact: f64) -> f64 {
    let turn = TURN * (1.0 - exact * exact).max(0.0).sqrt();
    case.tiered(1.0e-7 + 1.6e-7 * exact.abs() + turn, 8.0 * ulp(exact) + 1e-14)
}

/// Error of sin² that results from the error of the angle.
fn sin2_allowed(case: &Case<'_>, sin2: f64, ulps: f64) -> f64 {
    let turn = case.tiered(TURN, 1e-13);
    ulps * ulp(sin2) + (2.0 * sin2.sqrt() + turn) * turn
}

fn phong_vectors(x: &[f64]) -> (f64, f64, f64, f64) {
    let (n, l, v) = (vector(x, 0), vector(x, 3), vector(x, 6));
    let (cos_delta, sin2_delta, s2) = half_angle(n, l, v);
    (cosine(n, l), cos_delta, sin2_delta, s2)
}

/// Error of the lobe (row 17 of docs/numerics.md). Stable: d ln f = −shine tanδ dδ, where dδ is the rotation of the
/// half vector, and 1e-5 for exp and log. For narrow lobes it is √(2 shine |ln f|) dδ, 4e-7 √shine at |ln f| = 2.
/// Beyond 45° it is that of the cosine. Compensated: (8 + 6 |ln f|) ulp.
fn lobe_allowed(case: &Case<'_>) -> f64 {
    let (_, cos_delta, sin2_delta, _) = phong_vectors(case.inputs);
    let shine = case.inputs[12];
    let spec = lobe(cos_delta, shine);
    if spec == 0.0 {
        return case.tiered(lobe(2e-7, shine), 0.0);
    }
    let depth = -spec.ln();
    let stable = shine * (sin2_delta.sqrt() / cos_delta * TURN + TURN * TURN) + 1e-5;
    let wide = if sin2_delta > 0.45 { shine * 2e-7 / cos_delta } else { 0.0 };
    // A lobe below the normal range of f32 has no correct digits, whatever divides it later.
    case.tiered((stable + wide) * spec, (8.0 + 6.0 * depth) * ulp(spec)) + f64::from(f32::MIN_POSITIVE)
}

/// Whether rounding decides the sign of N·L.
fn at_terminator(cos_in: f64) -> bool {
    cos_in.abs() < 1e-14
}

/// Relative error of G₂ and G₂/(4 cosθ_l cosθ_v) that results from the cosines: the sum of their relative errors.
fn grazing(case: &Case<'_>) -> f64 {
    let n = vector(case.inputs, 0);
    let part = |l: DVec3| {
        let c = cosine(n, l);
        grazing_allowed(c) / c
    };
    part(vector(case.inputs, 3)) + part(vector(case.inputs, 6))
}

/// Relative error of D that results from the angle, d ln D = 4 s ds/(c²α² + s²), beyond row 20 of docs/numerics.md.
fn d_part(case: &Case<'_>, alpha: f64) -> f64 {
    let (_, cos_h, sin2_h, _) = phong_vectors(case.inputs);
    let denominator = cos_h * cos_h * alpha * alpha + sin2_h;
    2.0 * (sin2_allowed(case, sin2_h, 0.0)) / denominator
}

/// The equations of this file.
pub(super) const EQUATIONS: &[Equation] = &[
    Equation {
        name: "half_angle",
        twin: |x| {
            let (cos_h, sin2_h, s2) = half_angle(vector(x, 0), vector(x, 3), vector(x, 6));
            vec![cos_h, sin2_h, 0.5 * s2.sqrt(), s2]
        },
        regions: &[
            Region { name: "in the lobe", share: 4, draw: |d| (PHONG[0].draw)(d)[..9].to_vec() },
            Region { name: "L near −V", share: 3, draw: |d| (PHONG[1].draw)(d)[..9].to_vec() },
            Region { name: "both grazing", share: 2, draw: |d| (PHONG[2].draw)(d)[..9].to_vec() },
            Region { name: "anywhere", share: 1, draw: |d| (PHONG[3].draw)(d)[..9].to_vec() },
        ],
        outputs: &[
            Output {
                name: "cos_h",
                bound: "1.2e-7 + 1.6e-7 |cos| + a turn of 2e-7 rad; compensated 8 ulp + 1e-14",
                // Not clamped to 1, unlike the laboratory functions.
                allowed: |c| half_cosine_allowed(c, c.x()) + c.tiered(2e-8, 0.0),
            },
            Output {
                name: "sin2_h",
                bound: "8 ulp + a turn of 2e-7 rad, compensated 1e-13 rad",
                allowed: |c| sin2_allowed(c, c.x(), 8.0),
            },
            Output {
                name: "cos_d",
                bound: "half of sum2's + 2 ulp",
                allowed: |c| c.ulps(2.0) + c.rel(0.5 * lv2_part(c, c.exact[3])),
            },
            Output { name: "sum2", bound: LV2_BOUND, allowed: lv2_allowed },
        ],
        axis: Axis { name: "|L + V|", log: true, of: |x| phong_vectors(x).3.sqrt(), column: 3, relative: true },
        extreme: 1e4,
    },
    Equation {
        name: "diffuse_brdf",
        twin: |x| vec![diffuse_brdf(x[0])],
        regions: &[Region { name: "any share", share: 1, draw: |d| vec![d.unit() as f32] }],
        outputs: &[Output { name: "fr", bound: "1.5 ulp", allowed: |c| c.ulps(1.5) }],
        axis: Axis { name: "share that enters", log: false, of: |x| x[0], column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "phong_lobe",
        twin: |x| vec![phong_lobe(x[0], x[1], x[4])],
        regions: &[
            Region {
                name: "narrow",
                share: 2,
                draw: |d| {
                    let (shine, delta) = in_lobe(d);
                    lobe_row(d, delta, shine)
                },
            },
            Region {
                name: "wide",
                share: 1,
                draw: |d| {
                    let (delta, shine) = (d.between(0.0, 1.57), d.log(1.0, 30.0));
                    lobe_row(d, delta, shine)
                },
            },
        ],
        outputs: &[Output {
            name: "lobe",
            bound: "(8 + 6 |ln f|) ulp",
            allowed: |c| c.ulps(8.0 - 6.0 * c.x().max(f64::MIN_POSITIVE).ln()) + f64::from(f32::MIN_POSITIVE),
        }],
        axis: Axis { name: "shine", log: true, of: |x| x[4], column: 0, relative: true },
        extreme: -1.0,
    },
    Equation {
        name: "reciprocal_lobe",
        twin: |x| vec![reciprocal_lobe(x[3], x[4])],
        regions: &[Region {
            name: "any angle",
            share: 1,
            draw: |d| {
                let sum2 = if d.below(8) == 0 { 0.0 } else { d.log(1e-12, 4.0) };
                vec![d.unit() as f32, d.unit() as f32, (0.5 * sum2.sqrt()) as f32, sum2 as f32, d.unit() as f32]
            },
        }],
        outputs: &[Output { name: "fr", bound: "1 ulp", allowed: |c| c.ulps(1.0) }],
        axis: Axis { name: "(L + V)²", log: true, of: |x| x[3], column: 0, relative: true },
        extreme: -1.0,
    },
    Equation {
        name: "ggx_distribution",
        twin: |x| vec![ggx_distribution(x[0], x[1], x[2])],
        regions: &[Region {
            name: "in the lobe and its tail",
            share: 1,
            draw: |d| {
                let alpha = alpha(d);
                let sin2 = (alpha * d.log(1e-3, 1e3)).atan().sin().powi(2);
                vec![(1.0 - sin2).sqrt() as f32, sin2 as f32, alpha as f32]
            },
        }],
        outputs: &[Output { name: "D", bound: "10 ulp", allowed: |c| c.ulps(10.0) }],
        axis: Axis { name: "α", log: true, of: |x| x[2], column: 0, relative: true },
        extreme: -1.0,
    },
    Equation {
        name: "ggx_visibility",
        twin: |x| vec![ggx_visibility(x[0], x[1], x[2])],
        regions: &[
            Region {
                name: "any cosines",
                share: 2,
                draw: |d| vec![cosine_in(d).max(1e-8) as f32, cosine_in(d).max(1e-4) as f32, alpha(d) as f32],
            },
            Region {
                name: "both grazing",
                share: 1,
                draw: |d| vec![d.log(1e-30, 1e-4) as f32, d.log(1e-30, 1e-4) as f32, alpha(d) as f32],
            },
        ],
        outputs: &[Output { name: "Vis", bound: "5 ulp", allowed: |c| c.ulps(5.0) }],
        axis: Axis { name: "N·L", log: true, of: |x| x[0], column: 0, relative: true },
        extreme: -1.0,
    },
    Equation {
        name: "smith_g2_over_g1",
        twin: |x| vec![smith_g2_over_g1(x[0], x[1], x[2])],
        regions: &[Region {
            name: "any cosines",
            share: 1,
            draw: |d| vec![cosine_in(d) as f32, cosine_in(d) as f32, alpha(d) as f32],
        }],
        outputs: &[Output { name: "share", bound: "12 ulp", allowed: |c| c.ulps(12.0) }],
        axis: Axis { name: "N·L", log: true, of: |x| x[1], column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "lambert",
        twin: |x| lambert(vector(x, 0), vector(x, 3), x[6], x[7]).to_vec(),
        regions: &[
            Region {
                name: "any cosine",
                share: 1,
                draw: |d| {
                    let (n, c) = (normal(d), cosine_in(d) * d.sign());
                    let mut row = columns(&[n, at_cosine(d, n, c)]);
                    row.extend([d.log(1e-3, 1e6) as f32, d.unit() as f32]);
                    row
                },
            },
            Region {
                name: "grazing",
                share: 1,
                draw: |d| {
                    let (n, c) = (normal(d), d.sign() * d.log(1e-8, 1e-3));
                    let mut row = columns(&[n, at_cosine(d, n, c)]);
                    row.extend([d.log(1e-3, 1e6) as f32, d.unit() as f32]);
                    row
                },
            },
        ],
        outputs: &[
            Output { name: "cos_plus", bound: "8 ulp + 1e-14", allowed: |c| grazing_allowed(c.x()) },
            Output {
                name: "Lref",
                bound: "L_in k_d times that + 2 ulp",
                allowed: |c| c.inputs[6] * c.inputs[7] * grazing_allowed(c.exact[0]) + c.ulps(2.0),
            },
        ],
        axis: Axis { name: "cosθ", log: true, of: |x| cosine(vector(x, 0), vector(x, 3)), column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "blinn_phong",
        twin: |x| blinn_phong(vector(x, 0), vector(x, 3), vector(x, 6), [x[9], x[10], x[11], x[12]]).to_vec(),
        regions: PHONG,
        outputs: &[
            Output { name: "cos_in", bound: "8 ulp + 1e-14", allowed: |c| grazing_allowed(c.x()) },
            Output {
                name: "cos_delta",
                bound: "1.2e-7 + 1.6e-7 |cos| + a turn of 2e-7 rad; compensated 8 ulp + 1e-14",
                // Not clamped to 1, unlike the laboratory functions.
                allowed: |c| half_cosine_allowed(c, c.x()) + c.tiered(2e-8, 0.0),
            },
            Output {
                name: "sin2_delta",
                bound: "8 ulp + a turn of 2e-7 rad, compensated 1e-13 rad",
                allowed: |c| sin2_allowed(c, c.x(), 8.0),
            },
            Output {
                name: "spec",
                bound: "shine tanδ 2e-7 + 1e-5 (beyond 45° that of cosδ); compensated (8 + 6 |ln f|) ulp",
                allowed: |c| if at_terminator(c.exact[0]) { f64::INFINITY } else { lobe_allowed(c) },
            },
            Output {
                name: "Lref",
                bound: "those of its parts + 3 ulp; all of it where the sign of cosθ is rounding's",
                allowed: |c| {
                    let [lin, kd, ks] = [c.inputs[9], c.inputs[10], c.inputs[11]];
                    let (cos_in, cos_delta, ..) = phong_vectors(c.inputs);
                    let jump = if at_terminator(cos_in) { lin * ks * lobe(cos_delta, c.inputs[12]) } else { 0.0 };
                    let lit = if cos_in < 0.0 && jump == 0.0 { 0.0 } else { ks * lobe_allowed(c) };
                    lin * (kd * grazing_allowed(cos_in) + lit) + jump + c.ulps(3.0)
                },
            },
        ],
        axis: Axis { name: "shine", log: true, of: |x| x[12], column: 3, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "reciprocal_phong",
        twin: |x| reciprocal_phong(vector(x, 0), vector(x, 3), vector(x, 6), [x[9], x[10], x[11], x[12]]).to_vec(),
        regions: PHONG,
        outputs: &[
            Output { name: "LV2", bound: LV2_BOUND, allowed: lv2_allowed },
            Output {
                name: "fr_spec",
                bound: "k_s/(L + V)² times blinn_phong's spec + the part of LV2 + 2 ulp",
                allowed: |c| {
                    let s2 = c.exact[0].max(f64::MIN_POSITIVE);
                    let lobe = c.inputs[11] * lobe_allowed(c) / s2;
                    let (cos_in, ..) = phong_vectors(c.inputs);
                    if at_terminator(cos_in) { f64::INFINITY } else { lobe + c.ulps(2.0) + c.rel(lv2_part(c, s2)) }
                },
            },
            Output {
                name: "Lref",
                bound: "those of its parts + 3 ulp",
                allowed: |c| {
                    let [lin, kd, ks] = [c.inputs[9], c.inputs[10], c.inputs[11]];
                    let (cos_in, cos_delta, _, s2) = phong_vectors(c.inputs);
                    let s2 = s2.max(f64::MIN_POSITIVE);
                    let fr_spec = ks * lobe(cos_delta, c.inputs[12]) / s2;
                    let part = ks * lobe_allowed(c) / s2 + fr_spec * lv2_part(c, s2);
                    lin * (cos_in.max(0.0) * part + (kd + fr_spec + part) * grazing_allowed(cos_in)) + c.ulps(3.0)
                },
            },
        ],
        axis: Axis { name: "|L + V|", log: true, of: |x| phong_vectors(x).3.sqrt(), column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "ggx_d",
        twin: |x| {
            let [cos_h, sin2_h, d] = ggx_d(vector(x, 0), vector(x, 3), x[6]);
            vec![cos_h, sin2_h, if cos_h.abs() > 2e-7 { d } else { f64::NAN }]
        },
        regions: &[
            Region {
                name: "at the peak",
                share: 3,
                draw: |d| {
                    let (n, alpha) = (normal(d), alpha(d));
                    let angle = (alpha * d.log(1e-3, 1e3)).atan();
                    ggx_d_row(d, n, angle, alpha)
                },
            },
            Region {
                name: "small angles",
                share: 1,
                draw: |d| {
                    let (n, alpha, angle) = (normal(d), alpha(d), d.log(1e-7, 1.5));
                    ggx_d_row(d, n, angle, alpha)
                },
            },
            Region {
                name: "every angle",
                share: 1,
                draw: |d| {
                    let (n, alpha, angle) = (normal(d), alpha(d), d.between(0.0, PI));
                    ggx_d_row(d, n, angle, alpha)
                },
            },
        ],
        outputs: &[
            Output {
                name: "cos_h",
                bound: "1e-7 + 1.04e-7 |cos|; compensated 8 ulp + 1e-14",
                allowed: |c| cosine_allowed(c, c.x()),
            },
            Output { name: "sin2_h", bound: "8 ulp", allowed: |c| c.ulps(8.0) },
            // In the stable tier both lengths to the fourth power cost 7 ulp, and sin² twice 9.
            Output { name: "D", bound: "18 ulp; compensated 12 ulp", allowed: |c| c.ulps(c.tiered(18.0, 12.0)) },
        ],
        axis: Axis { name: "α", log: true, of: |x| x[6], column: 2, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "ggx_lambda",
        twin: |x| vec![ggx_lambda(x[0], x[1])],
        regions: &[
            Region { name: "any cosine", share: 1, draw: |d| vec![cosine_in(d).max(1e-8) as f32, alpha(d) as f32] },
            Region {
                name: "tan θ ≈ 1/α",
                share: 1,
                draw: |d| {
                    let alpha = alpha(d);
                    vec![(alpha * d.log(1e-2, 1e2)).min(1.0) as f32, alpha as f32]
                },
            },
        ],
        outputs: &[Output { name: "lambda", bound: "6 ulp", allowed: |c| c.ulps(6.0) }],
        axis: Axis { name: "cosθ", log: true, of: |x| x[0], column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "ggx_g",
        twin: |x| ggx_g(x[0], x[1], x[2]).to_vec(),
        regions: &[
            Region {
                name: "any cosines",
                share: 3,
                draw: |d| vec![cosine_in(d) as f32, cosine_in(d) as f32, alpha(d) as f32],
            },
            Region {
                name: "both grazing",
                share: 1,
                draw: |d| vec![d.log(1e-30, 1e-4) as f32, d.log(1e-30, 1e-4) as f32, alpha(d) as f32],
            },
            Region {
                name: "tan θ ≈ 1/α",
                share: 1,
                draw: |d| {
                    let alpha = alpha(d);
                    let c = (alpha * d.log(1e-2, 1e2)).min(1.0);
                    vec![c as f32, cosine_in(d) as f32, alpha as f32]
                },
            },
        ],
        outputs: &[
            Output { name: "G1_L", bound: "4 ulp", allowed: |c| c.ulps(4.0) },
            Output { name: "G1_V", bound: "4 ulp", allowed: |c| c.ulps(4.0) },
            // Two roots of 2 ulp each, their quotients or products, the sum, the division; 4.1 in a million cases.
            Output { name: "G2", bound: "5 ulp", allowed: |c| c.ulps(5.0) },
            Output { name: "Vis", bound: "5 ulp", allowed: |c| c.ulps(5.0) },
        ],
        axis: Axis { name: "N·L", log: true, of: |x| x[0], column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "ggx_f",
        twin: |x| vec![ggx_f(x[0], x[1])],
        regions: &[
            Region { name: "any cosine", share: 2, draw: |d| vec![d.unit() as f32, cosine_in(d) as f32] },
            Region {
                name: "small F0",
                share: 1,
                draw: |d| vec![d.log(1e-8, 1.0) as f32, (1.0 - d.log(1e-7, 1.0)) as f32],
            },
            Region {
                name: "special",
                share: 1,
                draw: |d| vec![[0.0, 0.04, 1.0][d.below(3)], d.near(&[0.5, 1.0, 1.0])],
            },
        ],
        outputs: &[Output { name: "F", bound: "8 ulp", allowed: |c| c.ulps(8.0) }],
        axis: Axis { name: "1 − V·H", log: true, of: |x| 1.0 - x[1], column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "ggx",
        twin: |x| ggx(vector(x, 0), vector(x, 3), vector(x, 6), x[9], x[10]).to_vec(),
        regions: GGX,
        outputs: &[
            Output {
                name: "D",
                bound: "16 ulp + a turn of 2e-7 rad, compensated 1e-13 rad",
                allowed: |c| c.ulps(16.0) + c.rel(d_part(c, c.inputs[9])),
            },
            Output { name: "G2", bound: "5 ulp + δcos/cos of L and V", allowed: |c| c.ulps(5.0) + c.rel(grazing(c)) },
            Output {
                name: "F", bound: "8 ulp + 5 (1 − F0) (1 − V·H)⁴ 2e-7", allowed: |c| c.ulps(8.0) + f_error(c)
            },
            Output {
                name: "fr",
                bound: "those of its factors + 28 ulp",
                allowed: |c| c.ulps(28.0) + c.rel(factors(c)),
            },
            Output {
                name: "fr_cos",
                bound: "twice those of its factors + 30 ulp",
                allowed: |c| c.ulps(30.0) + c.rel(2.0 * factors(c)),
            },
        ],
        axis: Axis { name: "α", log: true, of: |x| x[9], column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "ggx_compensation",
        twin: |x| vec![ggx_compensation(x[0], x[1])],
        regions: &[
            Region { name: "any albedo", share: 1, draw: |d| vec![d.unit() as f32, d.between(0.25, 1.0) as f32] },
            Region { name: "almost 1", share: 1, draw: |d| vec![d.unit() as f32, (1.0 - d.log(1e-7, 0.1)) as f32] },
        ],
        outputs: &[Output { name: "factor", bound: "2 ulp", allowed: |c| c.ulps(2.0) }],
        axis: Axis { name: "E", log: false, of: |x| x[1], column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "ggx_sample",
        twin: |x| ggx_sample(x[0], x[1]).to_vec(),
        regions: &[
            Region { name: "anywhere", share: 2, draw: |d| vec![d.unit() as f32, alpha(d) as f32] },
            Region { name: "peak", share: 1, draw: |d| vec![d.log(1e-12, 1.0) as f32, alpha(d) as f32] },
            Region { name: "tail", share: 1, draw: |d| vec![(1.0 - d.log(1e-7, 0.1)) as f32, alpha(d) as f32] },
        ],
        outputs: &[
            Output { name: "sin_h", bound: "4 ulp", allowed: |c| c.ulps(4.0) },
            Output { name: "cos_h", bound: "4 ulp", allowed: |c| c.ulps(4.0) },
        ],
        axis: Axis { name: "sinθ_h", log: true, of: |x| ggx_sample(x[0], x[1])[0], column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "mirrored_pdf",
        twin: |x| vec![mirrored_pdf(x[0], x[1], x[2], x[5])],
        regions: &[Region {
            name: "in the lobe",
            share: 1,
            draw: |d| {
                let alpha = alpha(d);
                let sin2 = (alpha * d.log(1e-3, 1e2)).atan().sin().powi(2);
                let cos_v = cosine_in(d).max(1e-4);
                vec![cos_v as f32, (1.0 - sin2).sqrt() as f32, sin2 as f32, d.unit() as f32, 1.0, alpha as f32]
            },
        }],
        outputs: &[Output { name: "pdf", bound: "16 ulp", allowed: |c| c.ulps(16.0) }],
        axis: Axis { name: "α", log: true, of: |x| x[5], column: 0, relative: true },
        extreme: -1.0,
    },
    Equation {
        name: "visible_half_vector",
        twin: |x| visible_half_vector(vector(x, 0), [x[3], x[4]], [x[5], x[6]]).to_array().to_vec(),
        regions: &[Region {
            name: "viewers to the horizon",
            share: 1,
            draw: |d| {
                let angle = if d.below(2) == 0 { d.between(1e-3, 1.57) } else { d.log(1e-4, 1.5) };
                let v = d.at_angle(DVec3::Z, angle);
                let along = alpha(d);
                let across = if d.below(2) == 0 { along } else { alpha(d) };
                let rest = vec![along as f32, across as f32, below_one(d.unit()), below_one(d.unit())];
                [columns(&[v]), rest].concat()
            },
        }],
        outputs: &[
            Output { name: "hx", bound: VISIBLE_BOUND, allowed: visible_allowed },
            Output { name: "hy", bound: "as hx", allowed: visible_allowed },
            Output { name: "hz", bound: "as hx", allowed: visible_allowed },
        ],
        axis: Axis { name: "u_x", log: false, of: |x| x[5], column: 0, relative: false },
        extreme: -1.0,
    },
    Equation {
        name: "cosine_sample",
        twin: |x| cosine_sample(x[0], x[1]).to_vec(),
        regions: &[
            Region { name: "anywhere", share: 2, draw: |d| vec![below_one(d.unit()), below_one(d.unit())] },
            Region {
                name: "grazing",
                share: 1,
                draw: |d| vec![below_one(1.0 - d.log(6e-8, 0.1)), below_one(d.unit())],
            },
            Region { name: "normal", share: 1, draw: |d| vec![d.log(1e-30, 1e-3) as f32, below_one(d.unit())] },
        ],
        outputs: &[
            Output { name: "Lx", bound: "2.4e-7 √u₁", allowed: |c| 2.4e-7 * c.inputs[0].sqrt() },
            Output { name: "Ly", bound: "2.4e-7 √u₁", allowed: |c| 2.4e-7 * c.inputs[0].sqrt() },
            Output { name: "Lz", bound: "1.5 ulp", allowed: |c| c.ulps(1.5) },
            Output { name: "pdf", bound: "3 ulp", allowed: |c| c.ulps(3.0) },
        ],
        axis: Axis { name: "1 − u₁", log: true, of: |x| 1.0 - x[0], column: 2, relative: false },
        extreme: 1e38,
    },
    Equation {
        name: "mis_weight",
        twin: |x| vec![mis_weight(x[0], x[1])],
        regions: &[
            Region {
                name: "alike",
                share: 1,
                draw: |d| {
                    let p = d.log(1e-6, 1e6);
                    vec![p as f32, (p * d.log(0.1, 10.0)) as f32]
                },
            },
            Region { name: "1e±30", share: 1, draw: |d| vec![d.log(1e-30, 1e30) as f32, d.log(1e-30, 1e30) as f32] },
            Region {
                name: "zero",
                share: 1,
                draw: |d| {
                    let p = if d.below(2) == 0 { 0.0 } else { d.log(1e-30, 1e30) };
                    vec![p as f32, if d.below(2) == 0 { 0.0 } else { d.log(1e-30, 1e30) as f32 }]
                },
            },
        ],
        outputs: &[Output {
            name: "w",
            bound: "1e-7 and 5 ulp, exact for 0",
            allowed: |c| if c.inputs[0] == 0.0 { EXACT(c) } else { c.ulps(5.0).min(1e-7) },
        }],
        axis: Axis { name: "q/p", log: true, of: |x| x[1] / x[0], column: 0, relative: true },
        extreme: 1e38,
    },
];

const LV2_BOUND: &str = "5 ulp + 4.8e-7 |L + V| times the difference of |L| and |V|; compensated 4 ulp";

/// Relative error of (L + V)². Stable: two rounded lengths (1.7 ulp), their sum twice, and its square; when only the
/// lengths differ, removing that difference leaves 2^-24 of it.
fn lv2_part(case: &Case<'_>, s2: f64) -> f64 {
    let (l, v) = (vector(case.inputs, 3).length(), vector(case.inputs, 6).length());
    case.tiered(5.0, 4.0) * ulp(s2) / s2 + case.tiered(4.8e-7 * (l - v).abs() / s2.sqrt(), 0.0)
}

fn lv2_allowed(case: &Case<'_>) -> f64 {
    let s2 = case.x();
    if s2 == 0.0 { 0.0 } else { s2 * lv2_part(case, s2) }
}

fn ggx_d_row(d: &mut SplitMix64, n: DVec3, angle: f64, alpha: f64) -> Vec<f32> {
    let n = rounded(n);
    let mut row = columns(&[n, d.at_angle(n.normalize(), angle)]);
    row.push(alpha as f32);
    row
}

/// Error of Schlick's approximation that results from V·H.
fn f_error(case: &Case<'_>) -> f64 {
    let (_, _, _, s2) = phong_vectors(case.inputs);
    (1.0 - case.inputs[10]) * 5.0 * (1.0 - 0.5 * s2.sqrt()).max(0.0).powi(4) * 2e-7
}

/// Relative error of f_r without the rounding of its factors.
fn factors(case: &Case<'_>) -> f64 {
    d_part(case, case.inputs[9]) + grazing(case) + f_error(case) / case.exact[2]
}

/// cosδ, sin²δ, two values that the lobe ignores, and the shininess.
fn lobe_row(d: &mut SplitMix64, delta: f64, shine: f64) -> Vec<f32> {
    vec![delta.cos() as f32, delta.sin().powi(2) as f32, d.unit() as f32, d.unit() as f32, shine as f32]
}

const VISIBLE_BOUND: &str = "1e-6 + (2e-7/w, at most 5e-4)/|h before normalising|, w = √(1 − |p|²) at the disk's edge";

/// Bound: the point on the disk is off by 2e-7, and the height w above it by 2e-7 over w; the half vector made from
/// both may be as short as α.
fn visible_allowed(case: &Case<'_>) -> f64 {
    let x = case.inputs;
    let v = vector(x, 0);
    let vh = DVec3::new(x[3] * v.x, x[4] * v.y, v.z).normalize();
    let (r, phi) = (x[5].sqrt(), TAU * x[6]);
    let (p1, s) = (r * phi.cos(), 0.5 * (1.0 + vh.z));
    let p2 = (1.0 - s) * (1.0 - p1 * p1).max(0.0).sqrt() + s * r * phi.sin();
    let w = (1.0 - p1 * p1 - p2 * p2).max(0.0).sqrt();
    let t1 = if vh.x == 0.0 && vh.y == 0.0 { DVec3::X } else { DVec3::new(-vh.y, vh.x, 0.0).normalize() };
    let h = p1 * t1 + p2 * vh.cross(t1) + w * vh;
    1e-6 + (2e-7 / w).min(5e-4) / DVec3::new(x[3] * h.x, x[4] * h.y, h.z).length()
}

/// Rounds to f32 below 1, like random numbers.
fn below_one(u: f64) -> f32 {
    (u as f32).min(1.0_f32.next_down())
}
