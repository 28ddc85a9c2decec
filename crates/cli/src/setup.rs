//! What every command that knows a scene begins with.

use std::sync::Arc;

use anyhow::{Result, anyhow};

use super::options::{DeviceOptions, SceneOptions};
use etalon::frame::{Renderer, Settings};
use etalon::gpu::Device;
use etalon::open::Opened;
use etalon::plan::Effect;
use etalon::scene::environment::Environment;
use etalon::scene::{Camera, Reads, Scene, Source};
use etalon_cost::explain::{Price, Subject};
use etalon_cost::sitting::Bench;
use etalon_farm::identity::contents;

/// A scene, what lies around it, and what it will be drawn on.
#[derive(Clone)]
pub struct Setup {
    /// The device.
    pub device: Arc<Device>,
    /// What was read.
    pub opened: Opened,
}

/// Opens the device and reads the environment while the scene loads: three things that do not wait for each other. A missing
/// device is a result of its own.
///
/// # Errors
/// One sentence with file, place and cause; that of the scene first.
pub fn open(scene: &SceneOptions, reads: Reads, device: &DeviceOptions) -> Result<(Opened, Result<Arc<Device>>)> {
    let (device, loaded, environment) = std::thread::scope(|scope| {
        let device = scope.spawn(|| Device::open(&device.choice(), device.validate));
        let environment = scope.spawn(|| scene.load_environment());
        let loaded = scene.load(reads);
        let join = |_| anyhow!("a loading thread failed");
        (device.join().map_err(join), loaded, environment.join().map_err(join))
    });
    let loaded = loaded?;
    let (environment, warnings) = environment??;
    let mut opened = Opened::new(loaded, environment, scene.asks_for_environment());
    opened.warnings.extend(warnings);
    Ok((opened, device?))
}

/// The same for a scene of which many moments are looked at: its file, and the scene at the asked time.
///
/// # Errors
/// As [`open`].
pub fn open_source(
    options: &SceneOptions,
    reads: Reads,
    device: &DeviceOptions,
) -> Result<(Source, Scene, Option<Environment>, Arc<Device>)> {
    let time = options.time()?;
    let (device, loaded, environment) = std::thread::scope(|scope| {
        let device = scope.spawn(|| Device::open(&device.choice(), device.validate));
        let environment = scope.spawn(|| options.load_environment());
        let loaded = etalon::open::source(&options.scene, reads).and_then(|mut source| {
            let scene = source.at(time)?;
            Ok((source, scene))
        });
        let join = |_| anyhow!("a loading thread failed");
        (device.join().map_err(join), loaded, environment.join().map_err(join))
    });
    let (source, mut scene) = loaded?;
    let (environment, warnings) = environment??;
    scene.warnings.extend(warnings);
    Ok((source, scene, environment, device??))
}

impl Setup {
    /// Opens a device and a scene.
    ///
    /// # Errors
    /// One sentence with file, place and cause; that of the scene first.
    pub fn load(scene: &SceneOptions, reads: Reads, device: &DeviceOptions) -> Result<Self> {
        let (opened, device) = open(scene, reads, device)?;
        Ok(Self { device: device?, opened })
    }

    /// What the effects that a plan leaves out would cost.
    ///
    /// # Errors
    /// When something cannot be drawn.
    pub fn prices(
        &self,
        options: &SceneOptions,
        device: &DeviceOptions,
        settings: Settings,
        effects: &[Effect],
        progress: &mut dyn FnMut(&str),
    ) -> Result<Vec<Price>> {
        let (environment, settings) = self.opened.lit(settings);
        let camera = options.choose_camera(self.opened.scene(), settings.size)?;
        let subject = Subject {
            device: &device.choice(),
            original: &self.opened.original,
            environment,
            settings,
            camera: &camera,
        };
        subject.prices(effects, progress)
    }

    /// Hash of all that is drawn, whatever files it came from.
    pub fn contents(&self) -> String {
        contents(self.opened.scene(), self.opened.environment())
    }

    /// Lends everything to something that draws many pictures.
    ///
    /// # Errors
    /// When there is no such camera, and whatever goes wrong there.
    pub fn bench<T>(
        &self,
        options: &SceneOptions,
        settings: Settings,
        draw: impl FnOnce(Bench<'_>) -> Result<T>,
    ) -> Result<T> {
        let (environment, settings) = self.opened.lit(settings);
        let camera = options.choose_camera(self.opened.scene(), settings.size)?;
        draw(Bench { device: &self.device, original: &self.opened.original, environment, settings, camera: &camera })
    }

    /// Plans and uploads; the renderer, and the camera to draw from.
    ///
    /// # Errors
    /// When there is no such camera, the scene has nothing to draw, or it does not fit the device.
    pub fn renderer(self, options: &SceneOptions, settings: Settings) -> Result<(Renderer, Camera)> {
        let camera = options.choose_camera(self.opened.scene(), settings.size)?;
        Ok((self.opened.renderer(&self.device, settings)?, camera))
    }
}
