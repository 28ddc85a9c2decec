//! A plan as data: passes, shader code and resources that a scene needs under the chosen knobs.
//!
//! Read docs/plan.md. Every field turns passes, images or specialization constants on or off.

use super::architecture::Architecture;
use super::effect::{Effect, EffectState, Evidence, ForcedEffects};
use super::knobs::Knobs;
use super::knobs::rungs::{EffectId, Normals, Position, Quadrature};
use crate::scene::Light;

/// The passes and the shader code that a scene needs under the chosen knobs.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// A G-buffer target for emissive textures.
    pub emissive: bool,
    /// A G-buffer target for clear coat, specular and transmission texels and the coat's normal.
    pub layers: bool,
    /// A G-buffer target for texels of the specular colour and of lobes, and for the direction of anisotropy.
    pub lobe_texels: bool,
    /// Code for the clear coat.
    pub clearcoat: bool,
    /// Code for conductors with n and κ.
    pub conductors: bool,
    /// Code for conductors with small κ, where the differences of their reflectance cancel.
    pub faint_conductors: bool,
    /// Code for lobes of material extensions, one bit each in the order of [`LOBES`](crate::scene::lobe::LOBES).
    pub lobes: u32,
    /// Effects that are planned although the scene does not call for them.
    pub forced: ForcedEffects,
    /// There is an environment: rays that leave the scene return its radiance.
    pub environment: bool,
    /// Surfaces reflect the environment.
    pub reflection: bool,
    /// The environment varies, so a prefiltered environment map is made.
    pub prefilter: bool,
    /// The environment's irradiance lights diffuse surfaces.
    pub ambient: bool,
    /// The environment is the background.
    pub sky: bool,
    /// The background is blurred.
    pub blurred: bool,
    /// Passes for order-independent transparency: alpha-blended surfaces, and transmissive ones without refracting
    /// rays.
    pub transparency: bool,
    /// For each light of the scene, whether it is kept.
    pub lights: Vec<bool>,
    /// Number of kept directional lights.
    pub directional_lights: u32,
    /// Number of kept point and spot lights that are not sampled.
    pub local_lights: u32,
    /// Tiled light culling.
    pub tiles: bool,
    /// The tables of lobes: for the split sum of an environment, and for energy compensation of multiple
    /// scattering.
    pub reflectance: bool,
    /// Shadow maps for the lights.
    pub shadow_maps: bool,
    /// Ray tracing with the BVH; `None` when no pass sends rays.
    pub rays: Option<Rays>,
    /// Lobes of rough surfaces that transmit light are evaluated (rough BTDF).
    pub rough_transmission: bool,
    /// Lights that are sampled: those with an extent in every model, and all of them in path tracing.
    pub light_samples: LightSamples,
    /// Path tracing, which replaces all other passes that light surfaces. `None`: direct light from lights,
    /// and recursive rays from smooth surfaces.
    pub paths: Option<Paths>,
    /// Screen-space reflection and refraction.
    pub screen: Screen,
    /// Perceptual roughness up to which surfaces reflect by rays or in screen space instead of the prefiltered
    /// environment.
    pub roughest_mirror: f32,
    /// Number of bands of wavelengths, rendered one after the other; 0 for RGB.
    pub bands: u32,
    /// Dispersion: refraction depends on wavelength, so the samples take parts of each band.
    pub disperses: bool,
    /// Encoding of normals and positions in the G-buffer; path tracing does not light from the G-buffer.
    pub stored: Stored,
    /// The form of the passes, which the renderer chooses for its device.
    pub architecture: Architecture,
    /// Samples per pixel.
    pub samples: u32,
    /// The picture is denoised by non-local means, which needs two sums of samples.
    pub denoise: bool,
    /// Every effect with its state and reason.
    pub effects: Vec<Effect>,
    /// Textures and texture coordinates of the scene that are neither decoded nor uploaded, with reasons, one sentence
    /// each.
    pub unread: Vec<String>,
    /// Parts of this scene that the chosen rungs simplify or omit, one sentence each.
    pub warnings: Vec<String>,
}

/// The kinds of rays that passes send, and the kinds of surfaces that rays can hit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Rays {
    /// Shadow rays towards lights.
    pub shadows: bool,
    /// Reflection rays from surfaces up to [`Plan::roughest_mirror`].
    pub mirrors: bool,
    /// Rays of ambient occlusion over the hemisphere of each surface in the picture; 0 without it.
    pub occlusion: u32,
    /// Refraction rays at transmissive surfaces, which are then in the G-buffer.
    pub refraction: bool,
    /// Rays can hit transmissive surfaces.
    pub transmissive: bool,
    /// Rays can hit alpha-tested surfaces.
    pub masked: bool,
    /// Shadow rays can hit alpha-tested, blended or transmissive surfaces (transparent shadows).
    pub filters: bool,
    /// Some surface that sends rays is rough: rays sample its lobe (glossy reflection).
    pub rough: bool,
    /// Absorption of media.
    pub attenuation: Attenuation,
    /// Marching of heterogeneous media.
    pub march: March,
    /// Largest number of surfaces along a path.
    pub interfaces: u32,
    /// Textures, coordinates and colours are kept for ray hits even where no material uses them.
    pub textures: bool,
}

/// Encoding of normals and positions in the G-buffer (knobs `normals` and `position`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Stored {
    /// Octahedral encoding in a number of bits, or floats.
    pub normals: Normals,
    /// Positions are stored instead of reconstructed from depth.
    pub positions: bool,
}

impl Stored {
    pub(super) fn of(knobs: &Knobs) -> Self {
        Self { normals: knobs.normals, positions: knobs.position == Position::Stored }
    }
}

/// Model of absorption in media.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Attenuation {
    /// No absorption.
    #[default]
    Off,
    /// Absorption over the nominal thickness of a surface.
    Nominal,
    /// Absorption over the path length (Beer-Lambert law).
    Path,
}

/// Light sampling: next event estimation towards points on lights (knobs `lights` and `light-sampler`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LightSamples {
    /// Emissive surfaces light the scene; otherwise they are only visible.
    pub emitting: bool,
    /// Some light is an analytic area light.
    pub shaped: bool,
    /// Lights are sampled by a light hierarchy.
    pub hierarchy: bool,
    /// Light samples from the hierarchy of which one is chosen (resampled importance sampling); 0 without the
    /// hierarchy, and in path tracing, whose weights need the density of a sample.
    pub candidates: u32,
    /// Light samples of each surface, for each sample of a pixel; 0 where nothing is sampled.
    pub count: u32,
}

impl LightSamples {
    /// Whether some light has an extent.
    #[must_use]
    pub fn have_extent(&self) -> bool {
        self.emitting || self.shaped
    }

    /// Whether this light of the scene is sampled outside of path tracing, and not taken one by one.
    #[must_use]
    pub fn take(&self, light: &Light) -> bool {
        self.shaped && light.extent.is_some()
    }
}

/// Settings of path tracing (knob `indirect`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Paths {
    /// Path guiding with photons.
    pub guided: bool,
    /// Photons of each sample for the photon map of punctual lights; 0 without one.
    pub photons: u32,
}

/// Ray marching through grids of σ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct March {
    /// Steps of each segment, a multiple of 4; 0: no grid is marched.
    pub steps: u32,
    /// Quadrature rule over the steps.
    pub rule: Quadrature,
    /// Some grid has three channels.
    pub colours: bool,
}

/// Screen-space effects, from the picture of the opaque surfaces: rung `screen` of `reflection` and `refraction`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Screen {
    /// Screen-space reflection of smooth opaque surfaces.
    pub mirrors: bool,
    /// Screen-space reflection of the nearest transparent surfaces.
    pub transparent_mirrors: bool,
    /// Screen-space refraction: a transmissive surface shows the picture where the refracted ray leaves it.
    /// Transmissive surfaces are then drawn as transparent surfaces.
    pub refraction: bool,
}

/// Light samples and rays of ambient occlusion of a primary surface for each of a surface that a ray meets: many of
/// these share a pixel (docs/decisions/light-samples.md).
pub const FEWER_AT_HITS: u32 = 4;

impl Plan {
    /// Rays of ambient occlusion over the hemisphere of each surface in the picture; 0 without it.
    #[must_use]
    pub fn occlusion_rays(&self) -> u32 {
        self.rays.map_or(0, |rays| rays.occlusion)
    }

    /// Rays of ambient occlusion of each surface that reflected and refracted rays meet.
    #[must_use]
    pub fn occlusion_rays_at_hits(&self) -> u32 {
        self.occlusion_rays().div_ceil(FEWER_AT_HITS)
    }

    /// Side of the square of pixels that have different directions of ambient occlusion. With enough directions in a
    /// pixel none stands out, and the cut of many more takes its time.
    #[must_use]
    pub fn occlusion_pattern(&self) -> u32 {
        match self.occlusion_rays() * self.samples {
            1..=256 => 4,
            257..=1024 => 2,
            _ => 1,
        }
    }

    /// Directions of ambient occlusion for one sample of that square: at all primary surfaces, and at all that rays
    /// meet.
    #[must_use]
    pub fn occlusion_directions(&self) -> [u32; 2] {
        [self.occlusion_rays(), self.occlusion_rays_at_hits()].map(|rays| rays * self.occlusion_pattern().pow(2))
    }

    /// Ray marching through grids of σ.
    #[must_use]
    pub fn march(&self) -> March {
        self.rays.map_or_else(March::default, |rays| rays.march)
    }

    /// Effects in state `Kept`.
    pub fn kept(&self) -> impl Iterator<Item = EffectId> {
        self.effects.iter().filter(|effect| effect.state == EffectState::Kept).map(|effect| effect.id)
    }

    /// Whether an effect is kept. Effects that only set a specialization constant have no field of their own.
    #[must_use]
    pub fn keeps(&self, id: EffectId) -> bool {
        self.kept().any(|kept| kept == id)
    }

    /// Whether two plans draw the same work, whatever their reasons.
    #[must_use]
    pub fn draws_as(&self, other: &Self) -> bool {
        let work = |plan: &Self| Self {
            forced: ForcedEffects::None,
            lights: Vec::new(),
            effects: Vec::new(),
            warnings: Vec::new(),
            ..plan.clone()
        };
        work(self) == work(other)
    }

    /// Adds the effect `CoincidentInterfaces`, which only the BVH decides: whether closed dielectric meshes touch other
    /// surfaces. It cannot be forced, because it changes the picture.
    pub fn found_touching(&mut self, touching: bool) {
        self.effects.push(Effect {
            id: EffectId::CoincidentInterfaces,
            state: if touching { EffectState::Kept } else { EffectState::NotCalledFor },
            choice: None,
            cause: match touching {
                true => "a transparent mesh touches another surface",
                false => "no transparent mesh touches another surface",
            }
            .to_owned(),
            evidence: Evidence::new(),
            materials: Vec::new(),
        });
    }
}
