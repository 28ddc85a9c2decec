//! Sheen (KHR_materials_sheen): the grazing-angle lobe of cloth, whose fibres stand off the surface.
//!
//! Read Estevez and Kulla, "Production Friendly Microfacet Sheen BRDF", 2017. This file is the twin of
//! shaders/lib/sheen.glsl, and computes the table of directional albedo for it.

use std::f64::consts::{PI, TAU};

use super::{Factor, Lobe};
use crate::Meaning::{Color, Data};

/// Lower bound of the perceptual roughness: `LEAST_SHEEN_ROUGHNESS` of the shaders.
pub const LEAST_ROUGHNESS: f32 = 0.07;

/// The row of KHR_materials_sheen.
pub static SHEEN: Lobe = Lobe {
    name: "sheen",
    extension: "KHR_materials_sheen",
    row: ["a sheen colour above 0", "code, part of the table of directional albedo"],
    factors: &[Factor::unit("sheenColorFactor", 3, 0.0), Factor::unit("sheenRoughnessFactor", 1, 0.0)],
    textures: &[("sheenColorTexture", "sheen_color", Color), ("sheenRoughnessTexture", "sheen_roughness", Data)],
    scatters: true,
    has_direction: false,
    by_wavelength: false,
    albedo: Some(table_row),
    texel: |factors| factors,
};

/// D V of white sheen, in 1/sr, from the cosines of both directions and of the half vector with the normal.
#[must_use]
pub fn sheen(cos_l: f64, cos_v: f64, cos_h: f64, roughness: f64) -> f64 {
    let alpha = alpha_of(roughness);
    distribution(cos_h, alpha) / masking(cos_l, lambda(cos_l, alpha), cos_v, lambda(cos_v, alpha))
}

fn alpha_of(roughness: f64) -> f64 {
    roughness.max(f64::from(LEAST_ROUGHNESS)).powi(2)
}

/// D of inverted Gaussians, in 1/sr.
fn distribution(cos_h: f64, alpha: f64) -> f64 {
    let sin_h = (1.0 - cos_h * cos_h).max(0.0).sqrt();
    (2.0 + alpha.recip()) * sin_h.powf(alpha.recip()) / TAU
}

/// 1 / V, from the cosine and the Λ of both directions.
fn masking(cos_l: f64, lambda_l: f64, cos_v: f64, lambda_v: f64) -> f64 {
    (1.0 + lambda_l + lambda_v) * 4.0 * cos_l * cos_v
}

fn lambda(cos: f64, alpha: f64) -> f64 {
    let t = (1.0 - alpha).powi(2);
    let between = |soft: f64, sharp: f64| t * sharp + (1.0 - t) * soft;
    let (a, b) = (between(21.5473, 25.3245), between(3.82987, 3.32435));
    let (c, d, e) = (between(0.19823, 0.16801), between(-1.97760, -1.27393), between(-4.32054, -4.85967));
    let l = |x: f64| a / (1.0 + b * x.powf(c)) + d * x + e;
    if cos < 0.5 { l(cos).exp() } else { (2.0 * l(0.5) - l(1.0 - cos)).exp() }
}

/// E, the directional albedo of white sheen, with a relative error of at most 5e-4.
#[must_use]
pub fn albedo(cos_v: f64, roughness: f64) -> f64 {
    const ELEVATIONS: u32 = 128;
    const AZIMUTHS: u32 = 32;
    let alpha = alpha_of(roughness);
    let (sin_v, lambda_v) = ((1.0 - cos_v * cos_v).max(0.0).sqrt(), lambda(cos_v, alpha));
    // The lobe is symmetric: half a turn suffices.
    let cosines: [f64; AZIMUTHS as usize] =
        std::array::from_fn(|k| ((k as f64 + 0.5) / f64::from(AZIMUTHS) * PI).cos());
    let mut sum = 0.0;
    for i in 0..ELEVATIONS {
        // Quadratic steps: they are small at the horizon, where most of the lobe lies.
        let x = (f64::from(i) + 0.5) / f64::from(ELEVATIONS);
        let cos_l = x * x;
        let sin_l = (1.0 - cos_l * cos_l).sqrt();
        let masking = masking(cos_l, lambda(cos_l, alpha), cos_v, lambda_v);
        for cos_azimuth in cosines {
            let cos_between = cos_l * cos_v + sin_l * sin_v * cos_azimuth;
            let cos_h = ((cos_l + cos_v) / (2.0 + 2.0 * cos_between).sqrt()).min(1.0);
            sum += distribution(cos_h, alpha) / masking * cos_l * 2.0 * x;
        }
    }
    sum * TAU / f64::from(ELEVATIONS * AZIMUTHS)
}

/// One row of the table: for each cosθ, E and the albedo for uniform light below the angle, ∫ 2x min(E(x), 1) dx from 0
/// to cosθ. The steps are even in u = √cosθ: x = u², 2x dx = 4u³ du.
fn table_row(roughness: f64, side: usize) -> Vec<[f64; 2]> {
    let step = 1.0 / (side - 1) as f64;
    let of_all = |u: f64, e: f64| 4.0 * u.powi(3) * e.min(1.0);
    let (mut below, mut before) = (0.0, 0.0);
    let mut row = Vec::with_capacity(side);
    for i in 0..side {
        let u = i as f64 * step;
        let e = albedo((u * u).max(1e-8), roughness);
        let here = of_all(u, e);
        // Trapezoid rule; in the first interval the integrand is of third order and counts as 0.
        below += 0.5 * (before + here) * if i == 0 { 0.0 } else { step };
        before = here;
        row.push([e, below]);
    }
    row
}

#[cfg(test)]
mod tests {
    use super::*;

    /// E is the integral of the lobe over directions, here by another quadrature with ten times as many directions.
    #[test]
    fn the_albedo_is_that_of_the_lobe() {
        for (cos_v, roughness) in [(0.02, 0.3), (0.3, 0.5), (0.7, 0.8), (1.0, 1.0), (0.1, 0.15)] {
            let (rows, columns) = (400, 400);
            let sin_v = f64::sqrt(1.0 - cos_v * cos_v);
            let mut sum = 0.0;
            for i in 0..rows {
                let theta = (f64::from(i) + 0.5) / f64::from(rows) * 0.5 * PI;
                for k in 0..columns {
                    let azimuth = (f64::from(k) + 0.5) / f64::from(columns) * TAU;
                    let (sin_l, cos_l) = theta.sin_cos();
                    let cos_between = cos_l * cos_v + sin_l * sin_v * azimuth.cos();
                    let cos_h = ((cos_l + cos_v) / (2.0 + 2.0 * cos_between).sqrt()).min(1.0);
                    sum += sheen(cos_l, cos_v, cos_h, roughness) * cos_l * sin_l;
                }
            }
            let mean = sum * 0.5 * PI / f64::from(rows) * TAU / f64::from(columns);
            let error = albedo(cos_v, roughness) / mean - 1.0;
            assert!(error.abs() < 1e-3, "{cos_v}, {roughness}: {error}");
        }
    }

    #[test]
    fn the_moment_of_the_table_is_that_of_finer_steps() {
        for roughness in [0.1, 0.4, 1.0] {
            let (coarse, fine) = (table_row(roughness, 32), table_row(roughness, 311));
            for i in 0..32 {
                let error = coarse[i][1] - fine[10 * i][1];
                assert!(error.abs() < 1e-3, "{roughness}, {i}: {error}");
            }
        }
    }
}
