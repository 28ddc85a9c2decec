//! Opening of scene, environment and device, which all commands with a scene share.

use std::sync::Arc;

use anyhow::{Result, anyhow, bail};

use super::is_certain;
use super::options::{DeviceOptions, SceneOptions};
use etalon::frame::{Renderer, Settings};
use etalon::gpu::{Device, Severity};
use etalon::open::Opened;
use etalon::plan::Effect;
use etalon::scene::environment::Environment;
use etalon::scene::{Camera, Prune, Scene, Source};
use etalon_cost::explain::{Price, Subject};
use etalon_cost::warm::Bench;
use etalon_farm::identity::contents;

/// A scene with its environment, and the device that draws it.
#[derive(Clone)]
pub struct Setup {
    /// The device.
    pub device: Arc<Device>,
    /// The scene and its environment.
    pub opened: Opened,
}

/// Opens the device, reads the environment and loads the scene in parallel. A missing device is a separate result, so
/// that callers can go on without one.
///
/// # Errors
/// One sentence with the file, the place in it and the cause; an error of the scene comes first.
pub fn open(scene: &SceneOptions, prune: Prune, device: &DeviceOptions) -> Result<(Opened, Result<Arc<Device>>)> {
    let (device, loaded, environment) = open_beside(device, scene, || scene.load(prune))?;
    let loaded = loaded?;
    let (environment, warnings) = environment?;
    let mut opened = Opened::named(&scene.scene, loaded, environment, scene.asks_for_environment());
    opened.warnings.extend(warnings);
    Ok((opened, device))
}

/// Opens a scene that is drawn at several animation times: the file, the scene at `--time`, the environment and the
/// device.
///
/// # Errors
/// The errors of [`open`]; a missing device is one of them.
pub fn open_source(
    options: &SceneOptions,
    prune: Prune,
    device: &DeviceOptions,
) -> Result<(Source, Scene, Option<Environment>, Arc<Device>)> {
    let load = options.load_options(prune);
    let time = load.time;
    let (device, loaded, environment) = open_beside(device, options, || {
        let mut source = etalon::open::source(&options.scene, load)?;
        let scene = source.at(time)?;
        Ok((source, scene))
    })?;
    let (source, mut scene) = loaded?;
    let (environment, warnings) = environment?;
    scene.warnings.extend(warnings);
    Ok((source, scene, environment, device?))
}

/// The device, the scene, and the environment with the warnings of its reader.
type Beside<T> = (Result<Arc<Device>>, Result<T>, Result<(Option<Environment>, Vec<String>)>);

/// Opens the device and reads the environment while `load` reads the scene. A device that is asked for by name or index
/// is opened first, so that a wrong one is found before a large file is read.
fn open_beside<T>(device: &DeviceOptions, scene: &SceneOptions, load: impl FnOnce() -> Result<T>) -> Result<Beside<T>> {
    let choice = device.choice();
    let open = || match device.short_submissions {
        true => Device::open_time_sliced(&choice, device.validate),
        false => Device::open(&choice, device.validate),
    };
    let first = is_certain(&choice).then(open).transpose()?;
    std::thread::scope(|scope| {
        let device = scope.spawn(|| first.map_or_else(open, Ok));
        let environment = scope.spawn(|| scene.load_environment());
        let loaded = load();
        let join = |_| anyhow!("a loading thread failed");
        Ok((device.join().map_err(join)?, loaded, environment.join().map_err(join)?))
    })
}

/// Fails the command on an error of the validation layer.
pub(super) fn validated(device: &Device) -> Result<()> {
    match device.messages().into_iter().find(|message| message.severity == Severity::Error) {
        Some(message) => bail!("validation: {}", message.text),
        None => Ok(()),
    }
}

impl Setup {
    /// Opens a device and a scene.
    ///
    /// # Errors
    /// One sentence with the file, the place in it and the cause; an error of the scene comes first.
    pub fn load(scene: &SceneOptions, prune: Prune, device: &DeviceOptions) -> Result<Self> {
        let (opened, device) = open(scene, prune, device)?;
        Ok(Self { device: device?, opened })
    }

    /// Measures what the effects that a plan leaves out would cost.
    ///
    /// # Errors
    /// When the plan cannot be drawn.
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

    /// Hash of the scene and the environment in memory; file names do not enter it.
    pub fn contents(&self) -> String {
        contents(self.opened.scene(), self.opened.environment())
    }

    /// Calls `draw` with a bench, which draws and times many pictures.
    ///
    /// # Errors
    /// When the scene has no such camera, and the errors of `draw`.
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

    /// Plans the picture and uploads the scene; returns the renderer and the camera.
    ///
    /// # Errors
    /// When the scene has no such camera or nothing to draw, or when it does not fit the device.
    pub fn renderer(self, options: &SceneOptions, settings: Settings) -> Result<(Renderer, Camera)> {
        let camera = options.choose_camera(self.opened.scene(), settings.size)?;
        Ok((self.opened.renderer(&self.device, settings)?, camera))
    }
}
