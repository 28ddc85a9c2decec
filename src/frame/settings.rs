//! Settings of a picture, and what they ask of scene and device.

use anyhow::Result;

use super::{Part, TileShare};
use crate::gpu::Device;
use crate::image::tone::{ToneMap, ViewTransform};
use crate::image::{MAX_PIXELS, Picture};
use crate::plan::rungs::{Indirect, Reflection, Refraction};
use crate::plan::{Architecture, ForcedEffects, Knobs, Refused, Setting};
use crate::prepare::Conditions;
use crate::scene::environment::Environment;
use crate::transport::emitters::Sky;
use crate::upload::rays::Traversal;

/// Refuses a size that no image or buffer of the device can hold.
pub(super) fn check_size(device: &Device, knobs: &Knobs, size: [u32; 2]) -> Result<()> {
    let limit = device.max_image_size();
    if size.contains(&0) || size.iter().any(|&side| side > limit) {
        let why = format!("{}x{}: a picture has 1 to {limit} pixels a side on this device", size[0], size[1]);
        return Err(Refused::error(Setting::Size, why));
    }
    let pixels = u64::from(size[0]) * u64::from(size[1]);
    // Paths and screen-space rays store four words per pixel in one buffer, everything else one.
    let by_screen = knobs.reflection == Reflection::Screen || knobs.refraction == Refraction::Screen;
    let bytes = if knobs.indirect == Indirect::Path || by_screen { 16 } else { 4 };
    if pixels * bytes > device.max_storage_bytes() {
        let most = device.max_storage_bytes() / bytes;
        let why = format!("{}x{}: this device holds at most {most} pixels in one picture", size[0], size[1]);
        return Err(Refused::error(Setting::Size, why));
    }
    // No larger file can be read again.
    if pixels > MAX_PIXELS {
        let why = format!("{}x{}: a picture has at most {MAX_PIXELS} pixels", size[0], size[1]);
        return Err(Refused::error(Setting::Size, why));
    }
    Ok(())
}

/// The background behind the scene.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Background {
    /// The environment if there is one, otherwise nothing, which a PNG shows as [`NEUTRAL_GREY`].
    #[default]
    Default,
    /// The environment.
    Environment,
    /// Nothing: transparent in every output.
    Transparent,
    /// A display colour (sRGB bytes).
    Color([u8; 3]),
}

impl Background {
    /// Composites a background colour behind the picture's premultiplied alpha.
    pub fn lay_behind(self, picture: &mut Picture) {
        if let Self::Color(color) = self {
            let behind = color.map(|byte| crate::image::tone::srgb_decode(f64::from(byte) / 255.0) as f32);
            for pixel in &mut picture.rgba {
                let rest = 1.0 - pixel[3];
                for (value, behind) in pixel.iter_mut().zip(behind) {
                    *value += rest * behind;
                }
                pixel[3] = 1.0;
            }
        }
    }
}

/// Grey behind a scene without environment, as sRGB bytes.
pub const NEUTRAL_GREY: [u8; 3] = [119; 3];

/// Settings of a picture: everything that is constant over the frames of a sequence.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Rungs of all knobs.
    pub knobs: Knobs,
    /// Tone curve of the display output.
    pub tonemap: ToneMap,
    /// Exposure in stops.
    pub exposure: f32,
    /// Background behind the scene.
    pub background: Background,
    /// Blur of an environment that is the background, 0 … 1: it is seen through a GGX lobe of this perceptual
    /// roughness, directly and through what transmits light. Light and reflections come from the environment as it is.
    pub background_blur: f32,
    /// Factor on the environment's radiance.
    pub environment_intensity: f32,
    /// Rotation of the environment about +Y, in degrees.
    pub environment_rotation: f32,
    /// Seed of the random numbers.
    pub seed: u32,
    /// Target error: samples are drawn until the root of
    /// [`SampleError::relmse`](crate::image::halves::SampleError::relmse) is at most this, whatever the knob
    /// `samples`.
    pub max_error: Option<f64>,
    /// BVH traversal; `None` selects the one that suits the device and the scene.
    pub traversal: Option<Traversal>,
    /// Architecture of the passes; `None` selects the one that suits the device.
    pub architecture: Option<Architecture>,
    /// Most ray trees that grow at the same time in the form of reflection and refraction for GPUs, in steps of 64;
    /// `None`: as many as a share of the device's memory holds.
    pub ray_trees: Option<u32>,
    /// Effects that are planned although the scene does not call for them.
    pub forced: ForcedEffects,
    /// Parts of the picture that are stored as layers of their own; each costs one more pass of the recursive rays.
    pub parts: Vec<Part>,
    /// The share of the picture's tiles that is drawn; the rest is black.
    pub share: TileShare,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            size: [1280, 720],
            knobs: Knobs::default(),
            tonemap: ToneMap::default(),
            exposure: 0.0,
            background: Background::default(),
            background_blur: 0.0,
            environment_intensity: 1.0,
            environment_rotation: 0.0,
            seed: 0,
            max_error: None,
            traversal: None,
            architecture: None,
            ray_trees: None,
            forced: ForcedEffects::default(),
            parts: Vec::new(),
            share: TileShare::ALL,
        }
    }
}

impl Settings {
    /// The conditions under which a scene in this environment is prepared.
    ///
    /// # Errors
    /// When the background is an environment and there is none, or is blurred and is none.
    pub fn conditions<'a>(&'a self, environment: Option<&'a Environment>) -> Result<Conditions<'a>> {
        let background = environment.is_some() && self.shows_environment();
        if self.background == Background::Environment && environment.is_none() {
            let why = "env: there is no environment (none was asked for, or the scene has lights of its own)";
            return Err(Refused::error(Setting::Background, why.to_owned()));
        }
        if self.background_blur > 0.0 && !background {
            let why = format!("{}: the background is not an environment", self.background_blur);
            return Err(Refused::error(Setting::BackgroundBlur, why));
        }
        let sky = environment.map(|map| self.sky(map));
        let blurred = self.background_blur > 0.0;
        Ok(Conditions { knobs: &self.knobs, forced: self.forced, sky, background, blurred })
    }

    /// Whether the background is the environment, where there is one.
    #[must_use]
    pub fn shows_environment(&self) -> bool {
        matches!(self.background, Background::Default | Background::Environment)
    }

    /// These settings without a blur of what is not shown.
    #[must_use]
    pub fn without_idle_blur(self, there_is_environment: bool) -> Self {
        let blur = if there_is_environment && self.shows_environment() { self.background_blur } else { 0.0 };
        Self { background_blur: blur, ..self }
    }

    /// The environment as these settings turn and scale it.
    pub(super) fn sky<'a>(&self, map: &'a Environment) -> Sky<'a> {
        Sky { map, intensity: self.environment_intensity, rotation: self.environment_rotation }
    }

    /// Display-linear colour behind the scene in the display output; `None` for a transparent output.
    pub(super) fn behind(&self) -> Option<[f64; 3]> {
        match self.background {
            Background::Color(bytes) => Some(bytes),
            Background::Transparent => None,
            Background::Default | Background::Environment => Some(NEUTRAL_GREY),
        }
        .map(|bytes| bytes.map(|byte| crate::image::tone::srgb_decode(f64::from(byte) / 255.0)))
    }

    /// The view transform from a film of this picture to the display output.
    #[must_use]
    pub fn view_transform(&self) -> ViewTransform {
        ViewTransform { curve: self.tonemap, exposure: self.exposure, background: self.behind() }
    }
}

/// Display-linear colour behind the scene with alpha 1, or all 0; and whether the display output is transparent.
pub(super) fn display_background(settings: &Settings) -> ([f32; 4], bool) {
    match settings.behind() {
        Some(colour) => {
            let [r, g, b] = colour.map(|light| light as f32);
            ([r, g, b, 1.0], false)
        }
        None => ([0.0; 4], true),
    }
}
