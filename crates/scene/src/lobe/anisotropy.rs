//! Anisotropy (KHR_materials_anisotropy): the base's lobe is wider along one direction of the surface than across it:
//! brushed metal, hair, records.
//!
//! Read the extension; Burley 2012, "Physically Based Shading at Disney"; pbrt 4, section 9.6. The formulas are
//! shaders/lib/anisotropy.glsl.

use std::f32::consts::TAU;

use super::{Factor, Lobe};
use crate::Meaning::Data;

/// The row of KHR_materials_anisotropy.
pub static ANISOTROPY: Lobe = Lobe {
    name: "anisotropy",
    extension: "KHR_materials_anisotropy",
    row: ["an anisotropy strength above 0", "a G-buffer target; tangents; code"],
    factors: &[
        Factor::unit("anisotropyStrength", 1, 0.0),
        Factor { name: "anisotropyRotation", count: 1, default: 0.0, range: [-1e3 * TAU, 1e3 * TAU] },
    ],
    textures: &[("anisotropyTexture", "anisotropy", Data)],
    scatters: false,
    has_direction: true,
    by_wavelength: false,
    albedo: None,
    // The rotation, in radians and counter-clockwise from the tangent, as cosine and sine.
    texel: |[strength, rotation, ..]| [strength, rotation.cos(), rotation.sin(), 0.0],
};
