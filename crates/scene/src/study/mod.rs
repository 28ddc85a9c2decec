//! Built-in study scenes, generated without files.
//!
//! One file per scene; all use one builder and the shapes of [`shape`]. Scenes with parameters, for tests and
//! measurements, are in [`generate`].

mod absorber;
mod blend;
mod build;
mod cornell;
mod etalon;
mod finishes;
pub mod generate;
mod golden_bridge;
mod haze;
mod lamps;
mod materials;
mod metals;
mod metamers;
mod nested;
mod pool;
mod prism;
mod radiance;
pub mod shape;
mod torture;

use anyhow::{Result, bail};

use crate::Scene;

/// Names of the study scenes, each with a description of one line; the default scene is first.
pub const SCENES: [(&str, &str); 16] = [
    ("etalon", "half-silvered plates that mirror each other, a prism, a gold and a glass ball, water in a basin"),
    ("materials", "plastic, metal, clear coat and emission, from smooth to rough"),
    ("finishes", "brushed metal, thin films, cloth and leaves"),
    ("lamps", "punctual lights: point, spot and directional"),
    ("radiance", "emitters of equal radiance at different distance and tilt"),
    ("cornell", "a box with a red and a green wall, lit by a panel"),
    ("metals", "metals with measured n and κ"),
    ("blend", "alpha-blended and alpha-tested surfaces"),
    ("pool", "Snell's window from below the water"),
    ("nested", "an air bubble in ice in water in glass: nested dielectrics"),
    ("haze", "a heterogeneous absorbing medium"),
    ("prism", "dispersion of a slit and a bar by dense flint"),
    ("metamers", "a colour chart under daylight, a filament and a fluorescent lamp, with metamers"),
    ("absorber", "slabs that absorb by path length"),
    ("golden-bridge", "a lamp over water: the streak by three specular lobes"),
    ("torture", "the hard cases in one scene"),
];

/// Names of the study scenes, in the order of [`SCENES`].
pub const NAMES: [&str; SCENES.len()] = {
    let mut names = [""; SCENES.len()];
    let mut i = 0;
    while i < names.len() {
        names[i] = SCENES[i].0;
        i += 1;
    }
    names
};

/// Generates the study scene `name`, as in `study:NAME` without the prefix.
pub fn load(name: &str) -> Result<Scene> {
    Ok(match name {
        "etalon" => etalon::scene(),
        "materials" => materials::scene(),
        "finishes" => finishes::scene(),
        "lamps" => lamps::scene(),
        "radiance" => radiance::scene(),
        "cornell" => cornell::scene(),
        "metals" => metals::scene(),
        "blend" => blend::scene(),
        "pool" => pool::scene(),
        "nested" => nested::scene(),
        "haze" => haze::scene(),
        "prism" => prism::scene(),
        "metamers" => metamers::scene(),
        "absorber" => absorber::scene(),
        "golden-bridge" => golden_bridge::scene(),
        "torture" => torture::scene(),
        _ => bail!("there is no study scene `{name}`; there are: {}", NAMES.join(", ")),
    })
}
