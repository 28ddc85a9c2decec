//! Iridescence (KHR_materials_iridescence): interference in a thin film over the base: soap bubbles, oil on water,
//! anodised metal.
//!
//! Read Belcour and Barla 2017, "A Practical Extension to Microfacet Theory for the Modeling of Varying Iridescence";
//! the extension. The formulas are shaders/lib/thin_film.glsl.

use super::{Factor, Lobe};
use crate::Meaning::Data;

/// The row of KHR_materials_iridescence.
pub static IRIDESCENCE: Lobe = Lobe {
    name: "iridescence",
    extension: "KHR_materials_iridescence",
    row: ["an iridescence factor above 0", "code"],
    factors: &[
        Factor::unit("iridescenceFactor", 1, 0.0),
        Factor { name: "iridescenceIor", count: 1, default: 1.3, range: [1.0, 10.0] },
        Factor { name: "iridescenceThicknessMinimum", count: 1, default: 100.0, range: [0.0, 1e5] },
        Factor { name: "iridescenceThicknessMaximum", count: 1, default: 400.0, range: [0.0, 1e5] },
    ],
    textures: &[
        ("iridescenceTexture", "iridescence", Data),
        ("iridescenceThicknessTexture", "iridescence_thickness", Data),
    ],
    scatters: false,
    has_direction: false,
    by_wavelength: true,
    albedo: None,
    texel: |factors| factors,
};
