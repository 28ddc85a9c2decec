//! A plan as data: what is done, and how.

use super::effect::{Demand, Effect, EffectState, Evidence};
use super::knobs::Knobs;
use super::knobs::rungs::{EffectId, Normals, Position, Quadrature};

/// Which passes and which code a scene needs under the chosen knobs.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// A G-buffer target for emissive texels: some material has an emissive texture.
    pub emissive: bool,
    /// A G-buffer target for clear-coat and specular texels and the coat's normal.
    pub layers: bool,
    /// Code for the clear coat.
    pub clearcoat: bool,
    /// Code for metals given by n and κ.
    pub conductors: bool,
    /// And for such as hardly absorb, where the differences of their reflectance cancel.
    pub faint_conductors: bool,
    /// Code for lobes of extensions, a bit each in the order of [`LOBES`](crate::scene::lobe::LOBES).
    pub lobes: u32,
    /// What was asked for beside what the scene calls for.
    pub demand: Demand,
    /// There is an environment: rays that leave the scene see it, whatever surfaces do.
    pub environment: bool,
    /// The environment is seen in surfaces.
    pub reflection: bool,
    /// It is not the same everywhere: its averages over lobes are made beforehand.
    pub prefilter: bool,
    /// The environment's irradiance lights diffuse surfaces.
    pub ambient: bool,
    /// The environment is seen behind it.
    pub sky: bool,
    /// Passes for alpha-blended and transmissive surfaces.
    pub see_through: bool,
    /// Which lights of the scene there are.
    pub lights: Vec<bool>,
    /// Directional ones among them.
    pub directional_lights: u32,
    /// Point and spot lights.
    pub local_lights: u32,
    /// Lists of lights per tile.
    pub tiles: bool,
    /// The table of directional reflectance: for an environment, or to make up for single scattering.
    pub reflectance: bool,
    /// Lights are looked for in depth maps drawn from where they are.
    pub shadow_maps: bool,
    /// Rays, and the hierarchy of the scene's triangles that they go through; `None` where nothing sends any.
    pub rays: Option<Rays>,
    /// Paths of light, which take the place of all other passes that light surfaces; `None`: light comes straight from lights,
    /// and by rays from what is smooth.
    pub paths: Option<Paths>,
    /// What is looked up in the picture itself.
    pub screen: Screen,
    /// Perceptual roughness up to which surfaces are mirrored by rays or on the screen, and not by the prefiltered
    /// environment.
    pub roughest_mirror: f32,
    /// Bands of wavelengths that the picture is drawn in, one after the other; 0: red, green and blue at once.
    pub bands: u32,
    /// Rays of different wavelengths go different ways: the samples go through parts of each band.
    pub disperses: bool,
    /// How the G-buffer keeps what is lit out of it; paths light nothing out of it.
    pub stored: Stored,
    /// Samples per pixel.
    pub samples: u32,
    /// Every effect with its reason.
    pub effects: Vec<Effect>,
    /// Textures and texture coordinates of the scene that are neither decoded nor uploaded, and why, a sentence each.
    pub unread: Vec<String>,
    /// What the chosen rungs leave out of this scene, a sentence each.
    pub warnings: Vec<String>,
}

/// What sends rays and what they may meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Rays {
    /// Lights are looked for by rays.
    pub shadows: bool,
    /// Surfaces up to [`Plan::roughest_mirror`] mirror the scene.
    pub mirrors: bool,
    /// Transmissive surfaces refract; they are in the G-buffer.
    pub refraction: bool,
    /// Transmissive surfaces may be hit.
    pub transmissive: bool,
    /// Surfaces with holes may be hit.
    pub masked: bool,
    /// Masked, blended or transmissive surfaces may lie before a light.
    pub filters: bool,
    /// Some surface that sends rays is rough: they are drawn from its lobe.
    pub rough: bool,
    /// Some surface that paths go through is rough.
    pub frosted: bool,
    /// How media absorb.
    pub attenuation: Attenuation,
    /// How media that vary are gone through.
    pub march: March,
    /// Surfaces that a path may meet.
    pub interfaces: u32,
    /// Textures, coordinates and colours are kept for what rays meet, whether or not there are any.
    pub textures: bool,
}

/// How the G-buffer keeps normals and positions (knobs `normals` and `position`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Stored {
    /// As octahedra of so many bits, or in floats.
    pub normals: Normals,
    /// Positions themselves, and not their depth alone.
    pub positions: bool,
}

impl Stored {
    pub(super) fn of(knobs: &Knobs) -> Self {
        Self { normals: knobs.normals, positions: knobs.position == Position::Stored }
    }
}

/// How media absorb on the way through them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Attenuation {
    /// Not at all.
    #[default]
    Off,
    /// By the nominal thickness of a surface.
    Nominal,
    /// Along the path.
    Path,
}

/// How paths of light go on (knob `indirect`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Paths {
    /// What emits lights the scene (knob `lights`); else it is only seen.
    pub emitting: bool,
    /// Some light has a shape.
    pub shaped: bool,
    /// They aim at what light left last before it came to where they are.
    pub aimed: bool,
    /// All bounces in one dispatch: the same film, for comparison.
    pub at_once: bool,
}

/// How segments of paths go through grids of σ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct March {
    /// Steps of each segment, a multiple of 4; 0: no grid is marched.
    pub steps: u32,
    /// By which the steps are summed.
    pub rule: Quadrature,
    /// Some grid has values for red, green and blue.
    pub colours: bool,
}

/// What is looked up in the picture of the opaque surfaces: the rungs `screen` of `reflection` and `refraction`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Screen {
    /// Smooth opaque surfaces mirror what is on it …
    pub mirrors: bool,
    /// … and so do the nearest see-through ones.
    pub see_through_mirrors: bool,
    /// Transmissive bodies show what lies on it where a bent ray leaves them; they are see-through surfaces.
    pub refraction: bool,
}

impl Plan {
    /// How segments go through grids of σ.
    #[must_use]
    pub fn march(&self) -> March {
        self.rays.map_or_else(March::default, |rays| rays.march)
    }

    /// The effects that are drawn.
    pub fn kept(&self) -> impl Iterator<Item = EffectId> {
        self.effects.iter().filter(|effect| effect.state == EffectState::Kept).map(|effect| effect.id)
    }

    /// Whether an effect is drawn. What a constant of the shaders turns on needs no member of its own here.
    #[must_use]
    pub fn keeps(&self, id: EffectId) -> bool {
        self.kept().any(|kept| kept == id)
    }

    /// Whether the same is done for both, whatever their reasons.
    #[must_use]
    pub fn draws_as(&self, other: &Self) -> bool {
        let work = |plan: &Self| Self {
            demand: Demand::Scene,
            lights: Vec::new(),
            effects: Vec::new(),
            warnings: Vec::new(),
            ..plan.clone()
        };
        work(self) == work(other)
    }

    /// Enters into the account what only the hierarchy of triangles tells: whether transparent bodies lie against other
    /// surfaces. No demand includes that: what touches is another picture.
    pub fn found_touching(&mut self, touching: bool) {
        self.effects.push(Effect {
            id: EffectId::TouchingBodies,
            state: if touching { EffectState::Kept } else { EffectState::NotCalledFor },
            choice: None,
            cause: match touching {
                true => "some transparent body lies against another surface",
                false => "no transparent body lies against another surface",
            }
            .to_owned(),
            evidence: Evidence::new(),
            materials: Vec::new(),
        });
    }
}
