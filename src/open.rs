//! A scene with its environment and a default camera: the entry point of programs that use the library.
//!
//! Read examples/render.rs, and docs/scene-input.md for the formats.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Result, anyhow, bail};

use crate::frame::{Renderer, Settings};
use crate::gpu::Device;
use crate::plan::Plan;
use crate::prepare::{Original, Prepared};
use crate::scene::camera::DEFAULT_FOV_Y;
use crate::scene::environment::Environment;
use crate::scene::{Camera, LoadOptions, Scene, Source};
use crate::study;

/// A scene, its environment, and a default camera. Clones share the large data.
///
/// ```no_run
/// use etalon::frame::Settings;
/// use etalon::gpu::{Device, DeviceChoice};
/// use etalon::open::Opened;
///
/// # fn main() -> anyhow::Result<()> {
/// let settings = Settings { size: [640, 360], ..Settings::default() };
/// let opened = Opened::load("model.glb")?;
/// let device = Device::open(&DeviceChoice::Best, false)?;
/// let camera = opened.camera(settings.size)?;
/// let picture = opened.renderer(&device, settings)?.render(&camera, &mut |_| ())?;
/// assert_eq!(picture.display.len(), 640 * 360 * 4);
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone)]
pub struct Opened {
    /// The scene.
    pub original: Original,
    environment: Option<Environment>,
    is_asked_for: bool,
    /// Warnings of the readers about skipped parts of the scene's file and of the environment's, one sentence each.
    pub warnings: Vec<String>,
}

/// Loads a scene by name: a path, or `study:` and the name of a study scene.
///
/// # Errors
/// One sentence with file, place and cause.
pub fn scene(name: &str, options: &LoadOptions) -> Result<Scene> {
    match name.strip_prefix("study:") {
        Some(_) if options.time.is_some() => bail!("{name} has no animation: there is no time to draw it at"),
        Some(_) if options.scene.is_some() => bail!("{name} is one scene: there is none to choose"),
        Some(_) if options.variant.is_some() => bail!("{name} has no variants of its materials"),
        Some(study) => study::load(study),
        None => crate::scene::load(Path::new(name), options),
    }
}

/// Opens a scene for all frames of its animation: the file is read once.
///
/// # Errors
/// As [`scene()`].
pub fn source(name: &str, options: LoadOptions) -> Result<Source> {
    match name.strip_prefix("study:") {
        Some(_) => scene(name, &LoadOptions { time: None, ..options }).map(Source::still),
        None => Source::open(Path::new(name), options),
    }
}

/// A camera that sees the whole scene.
///
/// # Errors
/// When the scene has nothing to draw.
pub fn framing(scene: &Scene, size: [u32; 2], fov_y: f64) -> Result<Camera> {
    let bounds = scene.bounds().ok_or_else(|| anyhow!("{}: there is nothing to draw", scene.name))?;
    Ok(Camera::framing(bounds, f64::from(size[0]) / f64::from(size[1]), fov_y))
}

impl Opened {
    /// Loads a scene by name in its rest pose, as [`scene()`] does; the built-in studio lights a scene without lights.
    ///
    /// # Errors
    /// One sentence with file, place and cause.
    pub fn load(name: &str) -> Result<Self> {
        Ok(Self::new(scene(name, &LoadOptions::default())?, Some(Environment::studio()), false))
    }

    /// A scene in an environment. The environment lights the scene if it `is_asked_for`, if the scene has no lights, or
    /// if the scene requests it.
    #[must_use]
    pub fn new(scene: Scene, environment: Option<Environment>, is_asked_for: bool) -> Self {
        let warnings = scene.warnings.clone();
        Self { original: scene.into(), environment, is_asked_for, warnings }
    }

    /// Replaces the scene by another frame of its animation, in the same environment.
    pub fn pose(&mut self, scene: Scene) {
        self.original = scene.into();
    }

    /// The scene as it was read.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        self.original.scene()
    }

    /// The environment, whether or not it lights the scene.
    #[must_use]
    pub fn environment(&self) -> Option<&Environment> {
        self.environment.as_ref()
    }

    /// The environment that lights the scene, and settings with the scene's environment intensity.
    #[must_use]
    pub fn lit(&self, mut settings: Settings) -> (Option<&Environment>, Settings) {
        let scene = self.scene();
        let of_scene = || scene.studio.or(scene.lights.is_empty().then_some(1.0));
        let share = if self.is_asked_for { Some(1.0) } else { of_scene() };
        settings.environment_intensity *= share.unwrap_or(1.0);
        (self.environment.as_ref().filter(|_| share.is_some()), settings)
    }

    /// The first camera of the scene, or one that frames it.
    ///
    /// # Errors
    /// When the scene has nothing to draw.
    pub fn camera(&self, size: [u32; 2]) -> Result<Camera> {
        let framing = || framing(self.scene(), size, DEFAULT_FOV_Y);
        self.scene().cameras.first().cloned().map_or_else(framing, Ok)
    }

    /// The plan for these settings, with reasons; it needs no device.
    ///
    /// # Errors
    /// When the scene has nothing to draw.
    pub fn plan(&self, settings: Settings) -> Result<Plan> {
        let (environment, settings) = self.lit(settings);
        self.original.plan(&settings.conditions(environment)?)
    }

    /// Plans the scene and builds its BVH.
    ///
    /// # Errors
    /// When the scene has nothing to draw, or more triangles than a BVH holds.
    pub fn prepared(&self, settings: Settings) -> Result<Prepared> {
        let (environment, settings) = self.lit(settings);
        Prepared::new(&self.original, &settings.conditions(environment)?)
    }

    /// Plans the scene and uploads it.
    ///
    /// # Errors
    /// When the scene has nothing to draw, or it does not fit the device.
    pub fn renderer(self, device: &Arc<Device>, settings: Settings) -> Result<Renderer> {
        let (lit, settings) = self.lit(settings);
        let is_lit = lit.is_some();
        // The last clone owns the scene alone, so texels are freed while they are uploaded.
        let Self { original, environment, .. } = self;
        Renderer::new(device, original, environment.as_ref().filter(|_| is_lit), settings)
    }
}
