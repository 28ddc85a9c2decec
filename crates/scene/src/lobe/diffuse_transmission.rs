//! Diffuse transmission (KHR_materials_diffuse_transmission): part of the light that enters leaves on the other side,
//! in all directions: leaves, paper, lampshades.
//!
//! Read the extension. The formula is `evaluate_diffuse_transmission` of shaders/lib/layers.glsl.

use super::{Factor, Lobe};
use crate::Meaning::{Color, Data};

/// The row of KHR_materials_diffuse_transmission.
pub static DIFFUSE_TRANSMISSION: Lobe = Lobe {
    name: "diffuse transmission",
    extension: "KHR_materials_diffuse_transmission",
    row: ["a diffuse transmission factor above 0", "code"],
    factors: &[
        Factor::unit("diffuseTransmissionFactor", 1, 0.0),
        Factor::unit("diffuseTransmissionColorFactor", 3, 1.0),
    ],
    textures: &[
        ("diffuseTransmissionTexture", "diffuse_transmission", Data),
        ("diffuseTransmissionColorTexture", "diffuse_transmission_color", Color),
    ],
    scatters: true,
    has_direction: false,
    by_wavelength: false,
    albedo: None,
    texel: |factors| factors,
};
