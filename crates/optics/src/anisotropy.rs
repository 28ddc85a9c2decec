//! Anisotropic GGX microfacets: α along one direction of the surface and α across it. Directions are in the frame of
//! the lobe: x along, y across, z the normal.
//!
//! Read Heitz 2014, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", section 5.3; pbrt 9.6.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;

use super::brdf::alpha;
use super::catalogue::{Axis, Equation, Output, Region, SplitMix64, columns, vector};

/// @eq B1: the anisotropic GGX distribution (Heitz 2014, equation 72); `along2` is the share of sin²θ_h along the first
/// axis.
#[must_use]
pub fn anisotropic_distribution(cos_h: f64, sin2_h: f64, along2: f64, alphas: [f64; 2]) -> f64 {
    if cos_h <= 0.0 {
        return 0.0;
    }
    let [t, b] = alphas;
    let slopes = sin2_h * (along2 / (t * t) + (1.0 - along2) / (b * b)) + 1.0 - sin2_h;
    1.0 / (PI * t * b * slopes * slopes)
}

/// @eq B1 N22: cosθ (1 + 2Λ) of a direction in the frame of an anisotropic lobe.
#[must_use]
pub fn anisotropic_root(w: DVec3, alphas: [f64; 2]) -> f64 {
    DVec3::new(alphas[0] * w.x, alphas[1] * w.y, w.z).length()
}

fn anisotropic_lambda(w: DVec3, alphas: [f64; 2]) -> f64 {
    (anisotropic_root(w, alphas) / w.z - 1.0) / 2.0
}

/// @eq B1 N23: G₂/(4 cosθ_l cosθ_v) of an anisotropic lobe, height-correlated (Heitz 2014).
#[must_use]
pub fn anisotropic_visibility(l: DVec3, v: DVec3, alphas: [f64; 2]) -> f64 {
    let g2 = 1.0 / (1.0 + anisotropic_lambda(l, alphas) + anisotropic_lambda(v, alphas));
    g2 / (4.0 * l.z * v.z)
}

/// @eq B1 N22: (1 + Λ_v)/(1 + Λ_v + Λ_l) of an anisotropic lobe.
#[must_use]
pub fn anisotropic_g2_over_g1(v: DVec3, l: DVec3, alphas: [f64; 2]) -> f64 {
    let [v, l] = [v, l].map(|w| DVec3::new(w.x, w.y, w.z.abs().max(1e-4)));
    let [by_v, by_l] = [v, l].map(|w| anisotropic_lambda(w, alphas));
    (1.0 + by_v) / (1.0 + by_v + by_l)
}

/// A direction above the horizon, at least 1e-4 above it.
fn above(d: &mut SplitMix64) -> DVec3 {
    let angle = if d.below(2) == 0 { d.between(1e-3, FRAC_PI_2 - 1e-4) } else { d.log(1e-4, 1.5) };
    d.at_angle(DVec3::Z, angle)
}

/// The equations of this file.
pub(super) const EQUATIONS: &[Equation] = &[
    Equation {
        name: "anisotropic_distribution",
        twin: |x| vec![anisotropic_distribution(x[0], x[1], x[2], [x[3], x[4]])],
        regions: &[Region {
            name: "in the lobe and its tail",
            share: 1,
            draw: |d| {
                let alphas = [alpha(d), alpha(d)];
                let wide = alphas[0].max(alphas[1]);
                let sin2 = (wide * d.log(1e-3, 1e3)).atan().sin().powi(2);
                vec![(1.0 - sin2).sqrt() as f32, sin2 as f32, d.unit() as f32, alphas[0] as f32, alphas[1] as f32]
            },
        }],
        outputs: &[Output { name: "D", bound: "24 ulp", allowed: |c| c.ulps(24.0) }],
        axis: Axis { name: "α_t", log: true, of: |x| x[3], column: 0, relative: true },
        extreme: -1.0,
    },
    Equation {
        name: "anisotropic_root",
        twin: |x| vec![anisotropic_root(vector(x, 0), [x[3], x[4]])],
        regions: &[Region {
            name: "any direction above",
            share: 1,
            draw: |d| [columns(&[above(d)]), vec![alpha(d) as f32, alpha(d) as f32]].concat(),
        }],
        outputs: &[Output { name: "root", bound: "4 ulp", allowed: |c| c.ulps(4.0) }],
        axis: Axis { name: "z", log: true, of: |x| x[2], column: 0, relative: true },
        extreme: -1.0,
    },
    Equation {
        name: "anisotropic_visibility",
        twin: |x| vec![anisotropic_visibility(vector(x, 0), vector(x, 3), [x[6], x[7]])],
        regions: &[Region {
            name: "any directions above",
            share: 1,
            draw: |d| [columns(&[above(d), above(d)]), vec![alpha(d) as f32, alpha(d) as f32]].concat(),
        }],
        outputs: &[Output { name: "Vis", bound: "10 ulp", allowed: |c| c.ulps(10.0) }],
        axis: Axis { name: "N·L", log: true, of: |x| x[2], column: 0, relative: true },
        extreme: -1.0,
    },
    Equation {
        name: "anisotropic_g2_over_g1",
        twin: |x| vec![anisotropic_g2_over_g1(vector(x, 0), vector(x, 3), [x[6], x[7]])],
        regions: &[Region {
            name: "any directions above",
            share: 1,
            draw: |d| [columns(&[above(d), above(d)]), vec![alpha(d) as f32, alpha(d) as f32]].concat(),
        }],
        outputs: &[Output { name: "share", bound: "12 ulp", allowed: |c| c.ulps(12.0) }],
        axis: Axis { name: "N·L", log: true, of: |x| x[5], column: 0, relative: true },
        extreme: -1.0,
    },
];
