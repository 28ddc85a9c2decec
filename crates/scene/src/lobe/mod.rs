//! Lobes over the base layer: one row of a table for each glTF extension. File import, planning, spectral rendering and
//! material upload loop over the rows without naming a lobe. The BRDF of a lobe is a file of shaders/lib/, included by
//! shaders/lib/layers.glsl.
//!
//! Read the KHR_materials_* extension of each lobe, and pbrt 9 for BRDFs.

pub mod sheen;

use super::{Meaning, TextureRef};

/// A row of a directional-albedo table for a perceptual roughness: values at the given number of steps, from the
/// horizon up. The lobe defines the two values of a step.
pub type TableRow = fn(f64, usize) -> Vec<[f64; 2]>;

/// A lobe: its extension, parameters and properties.
pub struct Lobe {
    /// Name of the lobe's effect in plans.
    pub name: &'static str,
    /// Name of the glTF extension.
    pub extension: &'static str,
    /// What in a scene calls for the effect, and what the effect adds to a plan: a row of docs/plan.md.
    pub row: [&'static str; 2],
    /// Factors: name in JSON and number of components. At most four components together, each in 0 … 1 with default 0.
    /// The lobe is off when the first factor is 0. A factor of three components is a colour.
    pub factors: &'static [(&'static str, usize)],
    /// Textures, which multiply the factors: name in JSON, name in shaders/lib/texels.glsl, meaning of the texels.
    pub textures: &'static [(&'static str, &'static str, Meaning)],
    /// The lobe is non-specular: it scatters into all directions.
    pub scatters: bool,
    /// The lobe's part of the table of directional albedo.
    pub albedo: Option<TableRow>,
}

/// All lobes, in the order of `LOBE_…` in shaders/lib/.
pub static LOBES: [&Lobe; COUNT] = [&sheen::SHEEN];

// The table of directional albedo has room for one lobe (src/upload/environment.rs).
const _: () = {
    let (mut place, mut with_albedo) = (0, 0);
    while place < COUNT {
        with_albedo += LOBES[place].albedo.is_some() as u32;
        place += 1;
    }
    assert!(with_albedo <= 1, "a second lobe with an albedo needs a table of its own");
};

/// Number of lobes.
pub const COUNT: usize = 1;

/// Parameters of a lobe in one material.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LobeOf {
    /// Factors in the order of [`Lobe::factors`].
    pub factors: [f32; 4],
    /// Textures in the order of [`Lobe::textures`].
    pub textures: [Option<TextureRef>; 2],
}

impl Lobe {
    /// The colour factor, if the lobe has one.
    #[must_use]
    pub fn colour(&self, of: &LobeOf) -> Option<[f32; 3]> {
        (self.factors[0].1 == 3).then(|| [of.factors[0], of.factors[1], of.factors[2]])
    }

    /// Whether the lobe's first factor is above 0.
    #[must_use]
    pub fn is_on(&self, of: &LobeOf) -> bool {
        of.factors[..self.factors[0].1].iter().any(|&factor| factor > 0.0)
    }

    /// The factors as text, for the reason in a plan.
    #[must_use]
    pub fn says(&self, of: &LobeOf) -> String {
        let mut factors = of.factors.iter();
        let each = self.factors.iter().map(|(name, count)| {
            let numbers: Vec<String> = factors.by_ref().take(*count).map(ToString::to_string).collect();
            format!("{name} {}", numbers.join(" "))
        });
        format!("has {}", each.collect::<Vec<_>>().join(", "))
    }
}
