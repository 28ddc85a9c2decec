//! Lobes that extensions of glTF lay over the base of a material: a row of a table each. What reads files, decides the plan, splits
//! wavelengths and fills the table of materials goes through the rows and knows none of them by name. How light leaves by a lobe is a
//! file of shaders/lib/, which shaders/lib/layers.glsl includes.

pub mod sheen;

use super::{Meaning, TextureRef};

/// For a perceptual roughness a row of so many steps from the horizon up, in the lobe's own measure.
pub type TableRow = fn(f64, usize) -> Vec<[f64; 2]>;

/// What an extension says of a lobe.
pub struct Lobe {
    /// As plans call its effect.
    pub name: &'static str,
    /// The extension.
    pub extension: &'static str,
    /// What in a scene calls for it, and what it brings into a plan: a row of docs/plan.md.
    pub row: [&'static str; 2],
    /// Its numbers by their names in JSON, each with how many it has: four at most together, of 0 … 1, absent ones 0. Without the first
    /// there is no lobe. One of three is a colour.
    pub factors: &'static [(&'static str, usize)],
    /// Its textures: name in JSON, name in shaders/lib/texels.glsl, how its bytes are meant. They multiply the numbers.
    pub textures: &'static [(&'static str, &'static str, Meaning)],
    /// It sends light in all directions.
    pub scatters: bool,
    /// Its part of the table of directional reflectance.
    pub albedo: Option<TableRow>,
}

/// All of them, in the order of `LOBE_…` in shaders/lib/.
pub static LOBES: [&Lobe; COUNT] = [&sheen::SHEEN];

// The table of directional reflectance has room for one (src/upload/environment.rs).
const _: () = {
    let (mut place, mut with_albedo) = (0, 0);
    while place < COUNT {
        with_albedo += LOBES[place].albedo.is_some() as u32;
        place += 1;
    }
    assert!(with_albedo <= 1, "a second lobe with an albedo needs a table of its own");
};

/// How many there are.
pub const COUNT: usize = 1;

/// A lobe of one material.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LobeOf {
    /// In the order of [`Lobe::factors`].
    pub factors: [f32; 4],
    /// In the order of [`Lobe::textures`].
    pub textures: [Option<TextureRef>; 2],
}

impl Lobe {
    /// Its colour, if it has one.
    #[must_use]
    pub fn colour(&self, of: &LobeOf) -> Option<[f32; 3]> {
        (self.factors[0].1 == 3).then(|| [of.factors[0], of.factors[1], of.factors[2]])
    }

    /// Whether the material has it at all.
    #[must_use]
    pub fn is_on(&self, of: &LobeOf) -> bool {
        of.factors[..self.factors[0].1].iter().any(|&factor| factor > 0.0)
    }

    /// For a plan's reason: what the material says of it.
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
