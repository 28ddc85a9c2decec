//! Lobes of glTF extensions, over and below the base layer: one row of a table for each. File import, planning,
//! spectral rendering and material upload loop over the rows without naming a lobe. The formulas of a lobe are in
//! shaders/lib/: a file of its own, or shaders/lib/layers.glsl.
//!
//! Read the KHR_materials_* extension of each lobe, and pbrt 9 for BRDFs.

pub mod anisotropy;
pub mod diffuse_transmission;
pub mod iridescence;
pub mod sheen;

use std::ops::Range;

use super::{Meaning, TextureRef};

/// A row of a directional-albedo table for a perceptual roughness: values at the given number of steps, from the
/// horizon up. The lobe defines the two values of a step.
pub type TableRow = fn(f64, usize) -> Vec<[f64; 2]>;

/// A factor of a lobe.
pub struct Factor {
    /// Name in JSON.
    pub name: &'static str,
    /// Number of components: 3 for a colour.
    pub count: usize,
    /// Value of each component where the file gives none.
    pub default: f32,
    /// Least and greatest value; values outside are clamped with a warning.
    pub range: [f32; 2],
}

impl Factor {
    /// A factor in 0 … 1.
    const fn unit(name: &'static str, count: usize, default: f32) -> Self {
        Self { name, count, default, range: [0.0, 1.0] }
    }
}

/// A lobe: its extension, parameters and properties.
pub struct Lobe {
    /// Name of the lobe's effect in plans.
    pub name: &'static str,
    /// Name of the glTF extension.
    pub extension: &'static str,
    /// What in a scene calls for the effect, and what the effect adds to a plan: a row of docs/plan.md.
    pub row: [&'static str; 2],
    /// Factors, at most four components together. The lobe is off when the first factor is 0.
    pub factors: &'static [Factor],
    /// Textures, which multiply the factors: name in JSON, name in shaders/lib/texels.glsl, meaning of the texels.
    pub textures: &'static [(&'static str, &'static str, Meaning)],
    /// The lobe is non-specular: it scatters into all directions.
    pub scatters: bool,
    /// The lobe has a direction in the surface, so that meshes need tangents.
    pub has_direction: bool,
    /// The lobe depends on wavelength although it has no colour.
    pub by_wavelength: bool,
    /// The lobe's part of the table of directional albedo.
    pub albedo: Option<TableRow>,
    /// The texel of the material table, from the factors.
    pub texel: fn([f32; 4]) -> [f32; 4],
}

/// All lobes, in the order of `LOBE_…` in shaders/lib/.
pub static LOBES: [&Lobe; COUNT] =
    [&sheen::SHEEN, &anisotropy::ANISOTROPY, &iridescence::IRIDESCENCE, &diffuse_transmission::DIFFUSE_TRANSMISSION];

// The table of directional albedo has room for one lobe (src/upload/split_sum.rs).
const _: () = {
    let (mut place, mut with_albedo) = (0, 0);
    while place < COUNT {
        with_albedo += LOBES[place].albedo.is_some() as u32;
        place += 1;
    }
    assert!(with_albedo <= 1, "a second lobe with an albedo needs a table of its own");
};

/// Number of lobes.
pub const COUNT: usize = 4;

/// Index of [`sheen`] in [`LOBES`].
pub const SHEEN: usize = 0;
/// Index of [`anisotropy`].
pub const ANISOTROPY: usize = 1;
/// Index of [`iridescence`].
pub const IRIDESCENCE: usize = 2;
/// Index of [`diffuse_transmission`].
pub const DIFFUSE_TRANSMISSION: usize = 3;

/// Parameters of a lobe in one material.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LobeOf {
    /// Factors in the order of [`Lobe::factors`].
    pub factors: [f32; 4],
    /// Textures in the order of [`Lobe::textures`].
    pub textures: [Option<TextureRef>; 2],
}

impl Lobe {
    /// The components of the colour factor, if the lobe has one.
    #[must_use]
    pub fn colour_components(&self) -> Option<Range<usize>> {
        let place = self.factors.iter().position(|factor| factor.count == 3)?;
        let first = self.factors[..place].iter().map(|factor| factor.count).sum();
        Some(first..first + 3)
    }

    /// The colour factor, if the lobe has one.
    #[must_use]
    pub fn colour(&self, of: &LobeOf) -> Option<[f32; 3]> {
        self.colour_components().map(|at| [of.factors[at.start], of.factors[at.start + 1], of.factors[at.start + 2]])
    }

    /// Whether the lobe's first factor is above 0.
    #[must_use]
    pub fn is_on(&self, of: &LobeOf) -> bool {
        of.factors[..self.factors[0].count].iter().any(|&factor| factor > 0.0)
    }

    /// The factors as text, for the reason in a plan.
    #[must_use]
    pub fn says(&self, of: &LobeOf) -> String {
        let mut factors = of.factors.iter();
        let each = self.factors.iter().map(|factor| {
            let numbers: Vec<String> = factors.by_ref().take(factor.count).map(ToString::to_string).collect();
            format!("{} {}", factor.name, numbers.join(" "))
        });
        format!("has {}", each.collect::<Vec<_>>().join(", "))
    }
}
