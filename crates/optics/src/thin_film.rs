//! Thin-film interference (KHR_materials_iridescence).
//!
//! Read Born and Wolf, Principles of Optics, section 7.6.1.

use super::catalogue::{Axis, Equation, Output, Region};

/// @eq F3: reflectance of a thin film for one wavelength (Airy; Born and Wolf, section 7.6.1): amplitudes a and ρ of
/// its outer and its inner face, phase φ of a crossing there and back.
#[must_use]
pub fn film_reflectance(a: f64, rho: f64, cos_phi: f64) -> f64 {
    let interference = 2.0 * a * rho * cos_phi;
    (a * a + rho * rho + interference) / (1.0 + a * a * rho * rho + interference)
}

/// The equations of this file.
pub(super) const EQUATIONS: &[Equation] = &[Equation {
    name: "film_reflectance",
    twin: |x| vec![film_reflectance(x[0], x[1], x[2])],
    regions: &[
        Region {
            name: "any faces",
            share: 2,
            draw: |d| {
                vec![
                    (d.sign() * d.between(0.0, 0.95)) as f32,
                    (d.sign() * d.unit()) as f32,
                    d.between(-1.0, 1.0) as f32,
                ]
            },
        },
        Region {
            name: "nearly extinguished",
            share: 1,
            draw: |d| {
                let a = (d.sign() * d.log(1e-3, 0.9)) as f32;
                vec![a, a * (1.0 + d.log(1e-6, 0.1) as f32), (d.log(1e-7, 0.1) - 1.0) as f32]
            },
        },
    ],
    outputs: &[Output {
        name: "F",
        bound: "8 ulp + 4e-6 |aρ|/(1 + a²ρ² + 2aρ cosφ)",
        allowed: |c| {
            let [a, rho, cos] = [0, 1, 2].map(|i| c.inputs[i]);
            let product = a * rho;
            c.ulps(8.0) + 4e-6 * product.abs() / (1.0 + product * product + 2.0 * product * cos)
        },
    }],
    axis: Axis { name: "cosφ", log: false, of: |x| x[2], column: 0, relative: false },
    extreme: -1.0,
}];
