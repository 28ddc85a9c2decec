//! The built-in study scenes, generated; no files needed.
//!
//! One file per scene, put together by one builder from the shapes of [`shape`]; scenes that take parameters, for
//! tests and measurements, are in [`generate`].

mod absorber;
mod blend;
mod build;
mod cornell;
mod etalon;
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

/// Study scenes that can be loaded, the default one first.
pub const NAMES: &[&str] = &[
    "etalon",
    "materials",
    "lamps",
    "radiance",
    "cornell",
    "metals",
    "blend",
    "pool",
    "nested",
    "haze",
    "prism",
    "metamers",
    "absorber",
    "golden-bridge",
    "torture",
];

/// Generates the study scene `name`, as in `study:NAME` without the prefix.
pub fn load(name: &str) -> Result<Scene> {
    Ok(match name {
        "etalon" => etalon::scene(),
        "materials" => materials::scene(),
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
