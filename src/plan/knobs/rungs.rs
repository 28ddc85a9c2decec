//! The knobs, a type each: what each approximates, its rungs from cheap to exact, what the models choose, what it is about.
//!
//! Beside them the list of knobs, the models that choose rungs, and the list of effects. A rung is named once, here. Renaming a variant is an error of the compiler wherever it is used; what users type is the text beside it.

use std::fmt::{self, Display, Formatter};

use strum::{EnumMessage, IntoStaticStr, VariantArray};

use crate::plan::choice::Choice;
use crate::scene::lobe::LOBES;

effects! {
    EmissiveTextures = "emissive textures",
    ClearCoat = "clear coat",
    Layers = "layers",
    Conductors = "metals by n and kappa",
    Refraction = "refraction",
    SeeThrough = "see-through surfaces",
    VaryingMedia = "media that vary",
    Quadrature = "quadrature",
    Environment = "environment",
    MirroredEnvironment = "mirrored environment",
    PrefilteredEnvironment = "prefiltered environment",
    Mirrors = "mirrors",
    AmbientLight = "ambient light",
    PunctualLights = "punctual lights",
    Shadows = "shadows",
    LightLists = "light lists per tile",
    Paths = "paths",
    EmittingSurfaces = "surfaces that light",
    ShapedLights = "lights with a shape",
    Aims = "aims",
    Wavelengths = "bands of wavelengths",
    Dispersion = "dispersion",
    Holes = "holes before rays",
    Filters = "light through surfaces",
    Transmission = "transmission before rays",
    RoughRays = "rays by lobes",
    Frosted = "frosted surfaces",
    Absorption = "absorption",
    TouchingBodies = "bodies that touch",
}

impl Display for EffectId {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

knobs! {
    shadows: Shadows,
    fresnel: Fresnel,
    brdf: Brdf,
    reflection: Reflection,
    lobes: Lobes,
    refraction: Refraction,
    interfaces: Interfaces,
    absorption: Absorption,
    quadrature: Quadrature,
    indirect: Indirect,
    lights: Lights,
    guiding: Guiding,
    samples: Samples,
    colour: Colour,
    upsampling: Upsampling,
    arithmetic: Arithmetic,
    normals: Normals,
    position: Position,
}

/// One knob.
#[derive(Debug)]
pub struct Knob {
    /// Name on the command line.
    pub name: &'static str,
    /// Rungs that can be chosen, cheap to exact.
    pub rungs: &'static [&'static str],
    /// What the presets `local`, `recursive` and `global` choose.
    pub presets: [&'static str; 3],
    /// The rung that approximates least.
    pub exact: &'static str,
    /// The lecture's statements that it is about.
    pub lecture: &'static [&'static str],
    /// The plan's effects that it shapes; none: every surface of every scene.
    pub effects: &'static [EffectId],
    /// What it approximates.
    pub about: &'static str,
    pub(super) chosen: fn(&Knobs) -> usize,
    pub(super) choose: fn(&mut Knobs, usize),
}

/// The lecture's three models (R6): presets of all knobs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, EnumMessage, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "lowercase")]
pub enum Model {
    /// Direct light with shadow maps, and the environment as ambient and mirrored light.
    Local,
    /// Plus rays for shadows, mirrors and what lets light through.
    #[default]
    Recursive,
    /// Paths from surface to surface: rough ones, too, light others.
    Global,
}

/// What follows a prefix in a rung's name, as a number; `None` for rungs that are called otherwise.
fn number(rung: &str, prefix: &str) -> Option<u32> {
    rung.strip_prefix(prefix)?.parse().ok()
}

knob! {
    Shadows = "shadows" { Off = "off", Map = "map", Ray = "ray" }
    presets: [Map, Ray, Ray],
    exact: Ray,
    lecture: ["R5"],
    effects: [Shadows],
    about: "visibility of lights",
}

knob! {
    Fresnel = "fresnel" { Schlick = "schlick", Exact = "exact" }
    presets: [Schlick, Exact, Exact],
    exact: Exact,
    lecture: ["F2", "F3"],
    effects: [],
    about: "Fresnel curve",
}

knob! {
    Brdf = "brdf" {
        BlinnPhong = "blinn-phong",
        BlinnPhongReciprocal = "blinn-phong-reciprocal",
        Ggx = "ggx",
        GgxMulti = "ggx-multi",
    }
    presets: [Ggx, Ggx, GgxMulti],
    exact: GgxMulti,
    lecture: ["B1", "B5", "B6"],
    effects: [],
    about: "rough reflection",
}

knob! {
    Reflection = "reflection" { Off = "off", Environment = "environment", Screen = "screen", Ray = "ray" }
    presets: [Environment, Ray, Ray],
    exact: Ray,
    lecture: ["F4"],
    effects: [Mirrors, MirroredEnvironment],
    about: "what a surface mirrors: nothing, what is infinitely far, what is on the screen, the scene",
}

knob! {
    Lobes = "lobes" { Narrow = "0.2", Half = "0.5", All = "1" }
    presets: [Narrow, Narrow, All],
    exact: All,
    lecture: ["B6"],
    effects: [RoughRays],
    about: "roughness up to which rays sample what a surface mirrors, one direction of its lobe for each of the samples",
}

impl Lobes {
    /// Perceptual roughness up to which rays sample what a surface mirrors.
    #[must_use]
    pub const fn roughest(self) -> f32 {
        match self {
            Self::Narrow => 0.2,
            Self::Half => 0.5,
            Self::All => 1.0,
        }
    }
}

knob! {
    Refraction = "refraction" { Off = "off", Screen = "screen", Ray = "ray" }
    presets: [Off, Ray, Ray],
    exact: Ray,
    lecture: ["F5"],
    effects: [Refraction],
    about: "bent transmission: none, one bend and a look at the screen, every bend",
}

knob! {
    Interfaces = "interfaces" { One = "1", Two = "2", Four = "4", Eight = "8", Sixteen = "16", ThirtyTwo = "32" }
    presets: [Eight, Eight, ThirtyTwo],
    exact: ThirtyTwo,
    lecture: ["R6"],
    effects: [Refraction, Mirrors, Paths],
    about: "surfaces that a path of rays may meet",
}

impl Interfaces {
    /// How many.
    #[must_use]
    pub const fn count(self) -> u32 {
        1 << self as u32
    }
}

knob! {
    Absorption = "absorption" {
        Off = "off",
        Thickness = "thickness",
        Path = "path",
        March4 = "march:4",
        March8 = "march:8",
        March16 = "march:16",
        March32 = "march:32",
        March64 = "march:64",
    }
    presets: [Thickness, Path, March32],
    exact: March64,
    lecture: ["A1", "A2"],
    effects: [Absorption, VaryingMedia],
    about: "light lost inside media; march:N goes through grids of sigma in N steps of each segment",
}

impl Absorption {
    /// Steps of each segment through a medium that varies; 0: none is marched.
    #[must_use]
    pub fn steps(self) -> u32 {
        number(self.name(), "march:").unwrap_or(0)
    }
}

knob! {
    Quadrature = "quadrature" { Left = "left", Midpoint = "midpoint", Simpson = "simpson" }
    presets: [Midpoint, Midpoint, Midpoint],
    exact: Simpson,
    lecture: ["A2"],
    effects: [Quadrature],
    about: "rule of the sum over those steps, of order 1, 2 and 4",
}

knob! {
    Indirect = "indirect" { Off = "off", Ambient = "ambient", Path = "path" }
    presets: [Ambient, Ambient, Path],
    exact: Path,
    lecture: ["R6"],
    effects: [Paths, AmbientLight],
    about: "light from all around: none, the environment as if nothing stood before it, paths from surface to surface",
}

knob! {
    Lights = "lights" { Points = "points", Area1 = "area:1", Area4 = "area:4", Area16 = "area:16" }
    presets: [Points, Points, Area1],
    exact: Area1,
    lecture: ["R2"],
    effects: [EmittingSurfaces, ShapedLights],
    about: "extent of lights: with area:N surfaces that emit light others, by N places on them at each surface of a path",
}

impl Lights {
    /// Places on lights that are looked for at each surface of a path.
    #[must_use]
    pub fn places(self) -> u32 {
        number(self.name(), "area:").unwrap_or(1)
    }
}

knob! {
    Guiding = "guiding" { Off = "off", Aims = "aims" }
    presets: [Off, Off, Aims],
    exact: Aims,
    lecture: ["R6"],
    effects: [Aims],
    about: "where paths go: as surfaces scatter, or also where photons came from by way of mirrors and lenses; the same mean",
}

knob! {
    Samples = "samples" {
        One = "1",
        Four = "4",
        Sixteen = "16",
        SixtyFour = "64",
        TwoHundredFiftySix = "256",
        Thousand = "1024",
        FourThousand = "4096",
    }
    presets: [Four, Four, SixtyFour],
    exact: SixtyFour,
    lecture: [],
    effects: [],
    about: "samples per pixel",
}

impl Samples {
    /// How many.
    #[must_use]
    pub const fn count(self) -> u32 {
        4_u32.pow(self as u32)
    }
}

knob! {
    Colour = "colour" { Rgb = "rgb", Spectral8 = "spectral:8", Spectral16 = "spectral:16", Spectral32 = "spectral:32" }
    presets: [Rgb, Rgb, Rgb],
    exact: Spectral32,
    lecture: ["C1", "C2", "C3"],
    effects: [Wavelengths],
    about: "wavelengths: three colours, or so many bands of 380 to 780 nm, each a picture of its own",
}

impl Colour {
    /// Bands of wavelengths; 0: three colours.
    #[must_use]
    pub fn bands(self) -> u32 {
        number(self.name(), "spectral:").unwrap_or(0)
    }
}

knob! {
    Upsampling = "upsampling" { MallettYuksel = "mallett-yuksel", JakobHanika = "jakob-hanika" }
    presets: [JakobHanika, JakobHanika, JakobHanika],
    exact: JakobHanika,
    lecture: ["C3"],
    effects: [Wavelengths],
    about: "reflectance by wavelength of what is given as a colour: a sum of three curves, a fitted sigmoid",
}

knob! {
    Arithmetic = "arithmetic" { Fast = "fast", Stable = "stable", Compensated = "compensated" }
    presets: [Stable, Stable, Stable],
    exact: Compensated,
    lecture: [],
    effects: [],
    about: "form of the formulas (docs/numerics.md)",
}

knob! {
    Normals = "normals" { Oct16 = "oct16", Oct24 = "oct24", Oct32 = "oct32", F32 = "f32" }
    presets: [Oct32, Oct32, Oct32],
    exact: F32,
    lecture: [],
    effects: [],
    about: "normals in the G-buffer: as octahedra in so many bits each, or in floats",
}

impl Normals {
    /// |n − stored n|² that storing accounts for, at least twice the largest (numerics 16: 0.95°, 0.059°, 0.0037°): what a normal
    /// texture bends less than that is lost.
    #[must_use]
    pub fn error2(self) -> f32 {
        match self {
            Self::Oct16 => 1e-3,
            Self::Oct24 => 4e-6,
            Self::Oct32 | Self::F32 => 1e-7,
        }
    }
}

knob! {
    Position = "position" { Depth = "depth", Stored = "stored" }
    presets: [Depth, Depth, Depth],
    exact: Depth,
    lecture: [],
    effects: [],
    about: "positions of the G-buffer's surfaces: from their depth, or stored themselves",
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_as_named() {
        for rung in Interfaces::RUNGS {
            assert_eq!(rung.count().to_string(), rung.name());
        }
        for rung in Samples::RUNGS {
            assert_eq!(rung.count().to_string(), rung.name());
        }
        for rung in Lobes::RUNGS {
            assert_eq!(rung.roughest().to_string(), rung.name());
        }
        assert_eq!(Absorption::RUNGS.iter().map(|rung| rung.steps()).collect::<Vec<_>>(), [0, 0, 0, 4, 8, 16, 32, 64]);
        assert_eq!(Lights::RUNGS.iter().map(|rung| rung.places()).collect::<Vec<_>>(), [1, 1, 4, 16]);
        assert_eq!(Colour::RUNGS.iter().map(|rung| rung.bands()).collect::<Vec<_>>(), [0, 8, 16, 32]);
        assert_eq!(Guiding::Aims.to_string(), "guiding=aims");
    }

    #[test]
    fn names_lead_back_to_effects() {
        for knob in KNOBS {
            for effect in knob.effects {
                assert_eq!(EffectId::named(effect.name()), Some(*effect), "{}", knob.name);
            }
        }
        assert_eq!(EffectId::named("sheen"), Some(EffectId::Lobe(0)));
        assert_eq!(EffectId::named("haze"), None);
    }
}
