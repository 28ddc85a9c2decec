//! The knobs as types: each one's approximation, its rungs from cheap to exact, and its rungs in the three models.
//!
//! Read docs/plan.md; the ids under `lecture` are statements of docs/lecture.md. Knobs, models and effects have their
//! names only here: a renamed variant is a compile error wherever it is used. Users type the text beside a variant, and
//! reports and the generated tables of the documentation print it.

use std::fmt::{self, Display, Formatter};

use strum::{EnumMessage, IntoStaticStr, VariantArray};

use crate::plan::choice::Choice;
use crate::scene::lobe::LOBES;

effects! {
    EmissiveTextures = "emissive textures":
        "an emissive texture below a factor other than 0" => "a G-buffer target; code",
    ClearCoat = "clear coat":
        "a clear coat above 0" => "the G-buffer target of layers; code",
    Layers = "material layers":
        "a clear coat, or textures of coat, specular, transmission or thickness" => "a G-buffer target; code",
    LobeTexels = "textures of lobes":
        "an anisotropic material, or textures of the specular colour, of anisotropy, iridescence or diffuse transmission" => "a G-buffer target; code",
    Conductors = "conductors with n and kappa":
        "a metal given by n and kappa" => "code",
    Refraction = "refraction":
        "transmission above 0 on a surface that is not alpha-blended" => "by rays: the BVH, tile lists, the ray tree; in screen space: the passes of transparent surfaces and a copy of the picture",
    Transparency = "order-independent transparency":
        "alpha blending; transmission where no rays refract" => "per-pixel linked lists of fragments (A-buffer) and their passes",
    HeterogeneousMedia = "heterogeneous media":
        "a grid of absorption coefficients that is not 0, in a closed mesh" => "the grids; code",
    Quadrature = "quadrature":
        "a medium through which rays march" => "code",
    Environment = "environment":
        "an environment map" => "the map",
    EnvironmentReflection = "environment reflection":
        "a metal, a specular reflectance above 0 with an index other than 1, or a clear coat" => "the prefiltered map; code",
    PrefilteredEnvironment = "prefiltered environment":
        "an environment that is not the same everywhere" => "prefiltered levels in place of one texel",
    Reflection = "reflection":
        "a surface or clear coat that is smooth enough for the rung of `lobes`" => "by rays: the BVH, tile lists, the ray tree; in screen space: a copy of the picture, passes",
    AmbientLight = "ambient light":
        "an environment, or rays of ambient occlusion and surfaces that send light; and a surface with a diffuse part" => "code",
    AmbientOcclusion = "ambient occlusion":
        "light from all around, of an environment or of surfaces, with `indirect=occlusion:N`" => "the BVH, a pass",
    PunctualLights = "punctual lights":
        "a light that shines and reaches a surface that it lights" => "the light table; code",
    Shadows = "shadows":
        "the same lights, and light samples" => "by rays: the BVH, code; by maps: depth images, passes",
    TiledLightCulling = "tiled light culling":
        "16 point and spot lights, one of them with a range" => "two passes and a bit mask for each 16x16 tile",
    PathTracing = "path tracing":
        "`indirect=path`: paths take the place of the G-buffer, of lighting and of single rays" => "the BVH, queues, states of paths",
    EmissiveLights = "emissive surfaces as lights":
        "an emissive surface, with `lights=area:N`" => "the BVH, a table of triangles; code",
    AreaLights = "analytic area lights":
        "a sphere, disk or rectangle light, with `lights=area:N`" => "the BVH; code",
    LightHierarchy = "light hierarchy":
        "3 emissive triangles or area lights, in path tracing also point and spot lights, unless `light-sampler=power`" => "a table of nodes; code",
    PathGuiding = "path guiding":
        "a smooth surface that light reaches and that sends it to a diffuse one, with `guiding=photons` and path tracing" => "photons, a grid of cells with bounding spheres; code",
    Caustics = "caustics of punctual lights":
        "a smooth surface in the light of a punctual light, with `caustics=photons:N` and path tracing" => "photons, a photon map; code",
    SpectralRendering = "spectral rendering":
        "something coloured, with `colour=spectral:N`" => "a frame for each band of wavelengths, a table of the band; code where colours are read",
    Dispersion = "dispersion":
        "a refracting solid whose index depends on wavelength, with `colour=spectral:N`" => "parts of the bands, one for each sample",
    AlphaTest = "alpha test in rays":
        "an alpha mask on a surface that rays may meet" => "code",
    TransparentShadows = "transparent shadows":
        "a transparent or transmissive surface that shadow rays may meet" => "code",
    TransmissiveHits = "transmissive hits":
        "a transmissive surface that rays may meet" => "code",
    GlossyReflection = "glossy reflection":
        "a rough surface within the rung of `lobes`" => "code",
    RoughTransmission = "rough transmission":
        "a rough transmissive surface, with path tracing; a rough thin-walled one with punctual or area lights" => "code",
    Absorption = "absorption":
        "a solid that absorbs" => "code",
    Denoising = "denoising":
        "path tracing with at least 2 samples per pixel, with `denoise=nl-means`" => "three passes at the end, four images",
    CoincidentInterfaces = "coincident interfaces":
        "a solid whose surface touches another one, which only the BVH shows" => "code",
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
    light_sampler: LightSampler,
    guiding: Guiding,
    caustics: Caustics,
    samples: Samples,
    denoise: Denoise,
    colour: Colour,
    upsampling: Upsampling,
    arithmetic: Arithmetic,
    normals: Normals,
    position: Position,
}

/// A knob: an approximation with its rungs, as data.
#[derive(Debug)]
pub struct Knob {
    /// Name on the command line.
    pub name: &'static str,
    /// Names of the rungs, from cheap to exact.
    pub rungs: &'static [&'static str],
    /// A sentence for each rung: what it does, and what it loses or approximates.
    pub rung_about: &'static [&'static str],
    /// The rungs of the presets `local`, `recursive` and `global`.
    pub presets: [&'static str; 3],
    /// The rung with the least approximation.
    pub exact: &'static str,
    /// Ids of the lecture's statements about the approximation.
    pub lecture: &'static [&'static str],
    /// The plan's effects that the knob decides on; empty when it concerns every surface of every scene.
    pub effects: &'static [EffectId],
    /// The approximation, in words.
    pub about: &'static str,
    pub(super) chosen: fn(&Knobs) -> usize,
    pub(super) choose: fn(&mut Knobs, usize),
}

/// The lecture's three models (R6): presets of all knobs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, EnumMessage, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "lowercase")]
pub enum Model {
    /// Direct light with shadow maps; the environment as ambient light and reflection.
    Local,
    /// Adds ray-traced shadows, emissive surfaces as lights, ambient occlusion, reflections and refraction.
    #[default]
    Recursive,
    /// Path tracing: full indirect light.
    Global,
}

impl Model {
    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// One sentence of what it simulates.
    #[must_use]
    pub fn about(self) -> &'static str {
        self.get_documentation().unwrap_or_default()
    }
}

/// The number after a prefix in a rung's name; `None` for rungs without the prefix.
fn number(rung: &str, prefix: &str) -> Option<u32> {
    rung.strip_prefix(prefix)?.parse().ok()
}

knob! {
    Shadows = "shadows" {
        /// No shadows: every light reaches every surface that faces it.
        Off = "off",
        /// Shadow maps: edges are off by up to two texels, and transparent surfaces cast no shadow.
        Map = "map",
        /// A ray to each light: exact shadows, also of glass, which light crosses without bending.
        Ray = "ray",
    }
    presets: [Map, Ray, Ray],
    exact: Ray,
    lecture: ["R5"],
    effects: [Shadows],
    about: "visibility of lights: none, shadow maps, shadow rays",
}

knob! {
    Fresnel = "fresnel" {
        /// Schlick's polynomial: the error is largest near grazing angles, and for metals.
        Schlick = "schlick",
        /// The Fresnel equations of dielectrics, and of conductors with n and κ.
        Exact = "exact",
    }
    presets: [Schlick, Exact, Exact],
    exact: Exact,
    lecture: ["F2", "F3"],
    effects: [],
    about: "Fresnel reflectance: Schlick's approximation or the exact equations",
}

knob! {
    Brdf = "brdf" {
        /// The empirical lobe of Blinn and Phong: neither reciprocal nor energy conserving.
        BlinnPhong = "blinn-phong",
        /// Blinn-Phong divided by (L + V)², which makes it reciprocal; it is empirical as well.
        BlinnPhongReciprocal = "blinn-phong-reciprocal",
        /// Microfacets of the GGX distribution: light between facets is lost, so rough surfaces are too dark.
        Ggx = "ggx",
        /// GGX with compensation for the light that facets reflect several times; it is not reciprocal.
        GgxMulti = "ggx-multi",
    }
    presets: [GgxMulti, GgxMulti, GgxMulti],
    exact: GgxMulti,
    lecture: ["B1", "B5", "B6"],
    effects: [],
    about: "specular lobe of rough surfaces; ggx-multi adds energy compensation for multiple scattering",
}

knob! {
    Reflection = "reflection" {
        /// Smooth surfaces reflect nothing but the highlights of lights.
        Off = "off",
        /// Smooth surfaces reflect the environment alone, and no other surface.
        Environment = "environment",
        /// Reflections are looked up in the picture; what is hidden or outside of it is missing.
        Screen = "screen",
        /// Rays find what smooth surfaces reflect, again and again up to the rung of interfaces.
        Ray = "ray",
    }
    presets: [Environment, Ray, Ray],
    exact: Ray,
    lecture: ["F4"],
    effects: [Reflection, EnvironmentReflection],
    about: "specular reflection of smooth surfaces: none, of the environment, in screen space, by rays; rougher surfaces reflect the environment",
}

macro_rules! lobes_about {
    ($roughness:literal) => {
        concat!(
            "Rays sample specular lobes up to roughness ",
            $roughness,
            "; rougher surfaces reflect the environment."
        )
    };
}

knob! {
    Lobes = "lobes" {
        #[doc = lobes_about!("0.2")]
        Narrow = "0.2",
        #[doc = lobes_about!("0.5")]
        Half = "0.5",
        /// Rays sample the specular lobe of every roughness, with more noise for rougher surfaces.
        All = "1",
    }
    presets: [Narrow, Narrow, All],
    exact: All,
    lecture: ["B1", "R6"],
    effects: [GlossyReflection],
    about: "roughness up to which rays sample the specular lobe, one direction for each sample",
}

impl Lobes {
    /// Perceptual roughness up to which reflection rays sample the specular lobe.
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
    Refraction = "refraction" {
        /// Light passes transmissive surfaces straight, without bending.
        Off = "off",
        /// One bend by the nominal thickness, looked up in the picture: no second surface, no total reflection.
        Screen = "screen",
        /// Rays bend at every interface by Snell's law, with total reflection and nested media.
        Ray = "ray",
    }
    presets: [Off, Ray, Ray],
    exact: Ray,
    lecture: ["F5"],
    effects: [Refraction],
    about: "refraction: none, one interface in screen space, every interface by rays",
}

macro_rules! interfaces_about {
    ($surfaces:literal) => {
        concat!("A path ends after ", $surfaces, "; the report gives the light that this cuts off.")
    };
}

knob! {
    Interfaces = "interfaces" {
        #[doc = interfaces_about!("1 surface")]
        One = "1",
        #[doc = interfaces_about!("2 surfaces")]
        Two = "2",
        #[doc = interfaces_about!("4 surfaces")]
        Four = "4",
        #[doc = interfaces_about!("8 surfaces")]
        Eight = "8",
        #[doc = interfaces_about!("16 surfaces")]
        Sixteen = "16",
        #[doc = interfaces_about!("32 surfaces")]
        ThirtyTwo = "32",
    }
    presets: [Eight, Eight, ThirtyTwo],
    exact: ThirtyTwo,
    lecture: ["R6"],
    effects: [Refraction, Reflection, PathTracing],
    about: "surfaces that a path may meet; the report gives the light that this cuts off",
}

impl Interfaces {
    /// Number of surfaces.
    #[must_use]
    pub const fn count(self) -> u32 {
        1 << self as u32
    }
}

macro_rules! march_about {
    ($steps:literal) => {
        concat!("As path, and a grid of absorption coefficients is summed in ", $steps, " steps on each segment.")
    };
}

knob! {
    Absorption = "absorption" {
        /// Media absorb nothing: coloured glass and water are clear.
        Off = "off",
        /// Absorption over the material's nominal thickness, whatever the way of the light.
        Thickness = "thickness",
        /// Absorption over the length of each path in the medium; a grid counts as its mean.
        Path = "path",
        #[doc = march_about!(4)]
        March4 = "march:4",
        #[doc = march_about!(8)]
        March8 = "march:8",
        #[doc = march_about!(16)]
        March16 = "march:16",
        #[doc = march_about!(32)]
        March32 = "march:32",
        #[doc = march_about!(64)]
        March64 = "march:64",
    }
    presets: [Thickness, March8, March32],
    exact: March64,
    lecture: ["A1", "A2"],
    effects: [Absorption, HeterogeneousMedia],
    about: "absorption in media: none, by nominal thickness, by path length, or by marching grids of sigma in N steps for each segment",
}

impl Absorption {
    /// Steps per segment through a heterogeneous medium; 0 when none is marched.
    #[must_use]
    pub fn steps(self) -> u32 {
        number(self.name(), "march:").unwrap_or(0)
    }
}

knob! {
    Quadrature = "quadrature" {
        /// The value at the beginning of each step: order 1, the largest error.
        Left = "left",
        /// The value in the middle of each step: order 2, for the same number of values.
        Midpoint = "midpoint",
        /// Beginning, middle and end of each step with weights 1, 4 and 1: order 4, for twice the values.
        Simpson = "simpson",
    }
    presets: [Midpoint, Midpoint, Midpoint],
    exact: Simpson,
    lecture: ["A2"],
    effects: [Quadrature],
    about: "quadrature rule of the marching steps, of order 1, 2 and 4",
}

macro_rules! occlusion_about {
    ($rays:literal) => {
        concat!(
            "Light of the environment where ",
            $rays,
            " rays find no surface in its way, and of surfaces where they do: a mean."
        )
    };
}

knob! {
    Indirect = "indirect" {
        /// No ambient and no indirect light: what no light reaches is black.
        Off = "off",
        /// Light of the environment from all around, as if no surface were in its way; surfaces light no others.
        Ambient = "ambient",
        #[doc = occlusion_about!(4)]
        Occlusion4 = "occlusion:4",
        #[doc = occlusion_about!(16)]
        Occlusion16 = "occlusion:16",
        #[doc = occlusion_about!(64)]
        Occlusion64 = "occlusion:64",
        /// Paths carry light from surface to surface; their noise falls with the number of samples.
        Path = "path",
    }
    presets: [Ambient, Occlusion16, Path],
    exact: Path,
    lecture: ["R6"],
    effects: [PathTracing, AmbientLight, AmbientOcclusion],
    about: "indirect light: none, ambient light without visibility, ambient light with N rays of ambient occlusion and the mean light of what they meet, path tracing",
}

impl Indirect {
    /// Rays of ambient occlusion; 0 for rungs without it.
    #[must_use]
    pub fn occlusion_rays(self) -> u32 {
        number(self.name(), "occlusion:").unwrap_or(0)
    }
}

macro_rules! area_about {
    ($samples:literal) => {
        concat!(
            "Lights and emissive surfaces have their extent, by ",
            $samples,
            " at each surface, fewer where single rays meet it."
        )
    };
}

knob! {
    Lights = "lights" {
        /// Lights shine from points, without the penumbras of their areas; emissive surfaces are not sampled.
        Points = "points",
        #[doc = area_about!("1 sample")]
        Area1 = "area:1",
        #[doc = area_about!("4 samples")]
        Area4 = "area:4",
        #[doc = area_about!("16 samples")]
        Area16 = "area:16",
    }
    presets: [Points, Area4, Area1],
    exact: Area1,
    lecture: ["R2"],
    effects: [EmissiveLights, AreaLights],
    about: "lights as points, or as area lights with N light samples at each surface that they light",
}

impl Lights {
    /// Light samples at each surface.
    #[must_use]
    pub fn samples(self) -> u32 {
        number(self.name(), "area:").unwrap_or(1)
    }
}

macro_rules! resampled_about {
    ($candidates:literal) => {
        concat!(
            "As hierarchy, but one of ",
            $candidates,
            " light samples is chosen by the light that it sends to the surface. Paths draw a single one."
        )
    };
}

knob! {
    LightSampler = "light-sampler" {
        /// Lights are chosen by their power, whatever the surface: noisy where many lights are far apart.
        Power = "power",
        /// Lights are chosen by their importance at each surface, from a light hierarchy: less noise with many lights.
        Hierarchy = "hierarchy",
        #[doc = resampled_about!(2)]
        Resampled2 = "resampled:2",
        #[doc = resampled_about!(4)]
        Resampled4 = "resampled:4",
    }
    presets: [Power, Resampled4, Hierarchy],
    exact: Hierarchy,
    lecture: ["R4", "R6"],
    effects: [LightHierarchy],
    about: "choice of a light to sample at a surface: by power alone, by a light hierarchy with distance and orientation, or by choosing one of N samples from it (resampled importance sampling); the same mean",
}

impl LightSampler {
    /// Samples from which one is chosen.
    #[must_use]
    pub fn candidates(self) -> u32 {
        number(self.name(), "resampled:").unwrap_or(1)
    }
}

knob! {
    Guiding = "guiding" {
        /// Directions are sampled by the BSDF alone: caustics are noisy.
        Off = "off",
        /// A quarter of the directions of diffuse surfaces leads where photons came from: less noise in caustics.
        Photons = "photons",
    }
    presets: [Off, Off, Photons],
    exact: Photons,
    lecture: ["R6"],
    effects: [PathGuiding],
    about: "path guiding: BSDF sampling alone, or mixed with directions from which photons came by specular surfaces; the same mean",
}

macro_rules! caustics_about {
    ($photons:literal) => {
        concat!($photons, " photons in each sample; their light is blurred over the gaps between them.")
    };
}

knob! {
    Caustics = "caustics" {
        /// Light of a point that a smooth surface bends or mirrors does not arrive: shadows behind glass are dark.
        Off = "off",
        #[doc = caustics_about!(4096)]
        Photons4096 = "photons:4096",
        #[doc = caustics_about!(16384)]
        Photons16384 = "photons:16384",
        #[doc = caustics_about!(65536)]
        Photons65536 = "photons:65536",
    }
    presets: [Off, Off, Photons16384],
    exact: Photons65536,
    lecture: ["R6"],
    effects: [Caustics],
    about: "light of punctual lights by way of smooth surfaces: none, or from a photon map of N photons in each sample",
}

impl Caustics {
    /// Photons of each sample that are traced from punctual lights; 0 without a photon map.
    #[must_use]
    pub fn photons(self) -> u32 {
        number(self.name(), "photons:").unwrap_or(0)
    }
}

macro_rules! samples_about {
    ($samples:literal) => {
        concat!($samples, " samples per pixel: the noise falls with the square root of their number.")
    };
}

knob! {
    Samples = "samples" {
        /// 1 sample per pixel: jagged edges, and the most noise.
        One = "1",
        #[doc = samples_about!(4)]
        Four = "4",
        #[doc = samples_about!(16)]
        Sixteen = "16",
        #[doc = samples_about!(64)]
        SixtyFour = "64",
        #[doc = samples_about!(256)]
        TwoHundredFiftySix = "256",
        #[doc = samples_about!(1024)]
        Thousand = "1024",
        #[doc = samples_about!(4096)]
        FourThousand = "4096",
    }
    presets: [Four, Four, SixtyFour],
    exact: SixtyFour,
    lecture: [],
    effects: [],
    about: "samples per pixel",
}

impl Samples {
    /// Samples per pixel.
    #[must_use]
    pub const fn count(self) -> u32 {
        4_u32.pow(self as u32)
    }
}

knob! {
    Denoise = "denoise" {
        /// A mean with those pixels nearby that differ by no more than noise: faint detail may be lost.
        NlMeans = "nl-means",
        /// The mean of the pixel's own samples, with all of their noise.
        Off = "off",
    }
    presets: [Off, Off, Off],
    exact: Off,
    lecture: [],
    effects: [Denoising],
    about: "denoising: pixels are averaged with those around them that differ by no more than noise (non-local means)",
}

macro_rules! spectral_about {
    ($bands:literal) => {
        concat!($bands, " bands of wavelengths, with dispersion, for ", $bands, " times the time.")
    };
}

knob! {
    Colour = "colour" {
        /// Red, green and blue: no dispersion, and other hues under light with a structured spectrum.
        Rgb = "rgb",
        #[doc = spectral_about!(8)]
        Spectral8 = "spectral:8",
        #[doc = spectral_about!(16)]
        Spectral16 = "spectral:16",
        #[doc = spectral_about!(32)]
        Spectral32 = "spectral:32",
    }
    presets: [Rgb, Rgb, Rgb],
    exact: Spectral32,
    lecture: ["C1", "C2", "C3"],
    effects: [SpectralRendering],
    about: "RGB rendering, or spectral rendering in N bands of 380 to 780 nm, each as long as a picture",
}

impl Colour {
    /// Number of bands of wavelengths; 0 for RGB.
    #[must_use]
    pub fn bands(self) -> u32 {
        number(self.name(), "spectral:").unwrap_or(0)
    }
}

knob! {
    Upsampling = "upsampling" {
        /// A sum of three fixed curves (Mallett and Yuksel 2019), with the larger colour differences.
        MallettYuksel = "mallett-yuksel",
        /// A sigmoid fitted to each colour (Jakob and Hanika 2019), with the smaller colour differences.
        JakobHanika = "jakob-hanika",
    }
    presets: [JakobHanika, JakobHanika, JakobHanika],
    exact: JakobHanika,
    lecture: ["C3"],
    effects: [SpectralRendering],
    about: "spectral upsampling of RGB reflectances: a sum of three curves (Mallett and Yuksel), or a fitted sigmoid (Jakob and Hanika)",
}

knob! {
    Arithmetic = "arithmetic" {
        /// Textbook formulas: cancellation loses digits, most of all at grazing angles and in sharp highlights.
        Fast = "fast",
        /// Formulas without cancellation, for about the same time.
        Stable = "stable",
        /// Pairs of floats where stable still loses digits, for 5 to 20 times the operations.
        Compensated = "compensated",
    }
    presets: [Stable, Stable, Stable],
    exact: Compensated,
    lecture: [],
    effects: [],
    about: "floating-point form of the formulas of lighting and background",
}

macro_rules! octahedral_about {
    ($bits:literal, $degrees:literal) => {
        concat!($bits, " bits in octahedral encoding: a normal is off by at most ", $degrees, "°.")
    };
}

knob! {
    Normals = "normals" {
        #[doc = octahedral_about!(16, "0.95")]
        Oct16 = "oct16",
        #[doc = octahedral_about!(24, "0.059")]
        Oct24 = "oct24",
        #[doc = octahedral_about!(32, "0.0037")]
        Oct32 = "oct32",
        /// Three floats: no error of encoding, for twice the memory of oct32.
        F32 = "f32",
    }
    presets: [Oct32, Oct32, Oct32],
    exact: F32,
    lecture: [],
    effects: [],
    about: "normals in the G-buffer: octahedral encoding in N bits for each, or floats",
}

impl Normals {
    /// Tolerance for |n − stored n|² of the encoding, at least twice the largest error (numerics 16: 0.95°, 0.059°,
    /// 0.0037°). A smaller bend of a normal texture is lost.
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
    Position = "position" {
        /// Computed from the depth of the pixel: the smaller error, and no memory of its own.
        Depth = "depth",
        /// Stored in a target of floats: more memory, and rounded once more.
        Stored = "stored",
    }
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
        assert_eq!(Lights::RUNGS.iter().map(|rung| rung.samples()).collect::<Vec<_>>(), [1, 1, 4, 16]);
        assert_eq!(Colour::RUNGS.iter().map(|rung| rung.bands()).collect::<Vec<_>>(), [0, 8, 16, 32]);
        assert_eq!(Guiding::Photons.to_string(), "guiding=photons");
        assert_eq!(Caustics::RUNGS.iter().map(|rung| rung.photons()).collect::<Vec<_>>(), [0, 4096, 16384, 65536]);
    }

    #[test]
    fn every_rung_has_a_sentence_of_its_own() {
        for knob in KNOBS {
            assert_eq!(knob.rung_about.len(), knob.rungs.len(), "{}", knob.name);
            for (place, (rung, about)) in knob.rungs.iter().zip(knob.rung_about).enumerate() {
                let told = format!("{}={rung}: {about}", knob.name);
                assert!(
                    about.ends_with('.') && !about[..about.len() - 1].ends_with(['.', ' ', ',', ':', ';']),
                    "{told}"
                );
                assert!(about.starts_with(|first: char| first.is_uppercase() || first.is_numeric()), "{told}");
                assert!((20..=120).contains(&about.chars().count()), "{told}");
                assert!(!knob.rung_about[..place].contains(about), "{told}");
                // A sentence that is the same for several numbers says which one it is about.
                let number = rung.rsplit(':').next().filter(|number| number.parse::<u32>().is_ok_and(|n| n > 1));
                assert!(number.is_none_or(|number| about.split(' ').any(|word| word == number)), "{told}");
            }
        }
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
