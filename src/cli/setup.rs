//! What every command that knows a scene begins with.

use std::sync::Arc;

use anyhow::{Result, anyhow};

use super::options::{DeviceOptions, SceneOptions};
use crate::cost::explain::{Price, Subject};
use crate::cost::sitting::Bench;
use crate::frame::{Renderer, Settings};
use crate::gpu::Device;
use crate::plan::Effect;
use crate::prepare::Prepared;
use crate::scene::environment::Environment;
use crate::scene::{Camera, Reads, Scene};

/// A scene, what lies around it, and what it will be drawn on.
#[derive(Clone)]
pub struct Setup {
    /// The device.
    pub device: Arc<Device>,
    /// What was read.
    pub opened: Opened,
}

/// A scene and what lies around it, without anything to draw it on.
#[derive(Clone)]
pub struct Opened {
    /// The scene.
    pub scene: Scene,
    /// The environment that was asked for, or would be used if the scene has no lights.
    environment: Option<Environment>,
    /// What was read around, in the scene's file and in the environment's.
    pub warnings: Vec<String>,
}

impl Opened {
    /// Opens the device and reads the environment while the scene loads: three things that do not wait for each other. A
    /// missing device is a result of its own.
    ///
    /// # Errors
    /// One sentence with file, place and cause; that of the scene first.
    pub fn load(scene: &SceneOptions, reads: Reads, device: &DeviceOptions) -> Result<(Self, Result<Arc<Device>>)> {
        let (device, loaded, environment) = std::thread::scope(|scope| {
            let device = scope.spawn(|| Device::open(&device.choice(), device.validate));
            let environment = scope.spawn(|| scene.load_environment());
            let loaded = scene.load(reads);
            let join = |_| anyhow!("a loading thread failed");
            (device.join().map_err(join), loaded, environment.join().map_err(join))
        });
        let scene = loaded?;
        let (environment, environment_warnings) = environment??;
        let warnings = scene.warnings.iter().cloned().chain(environment_warnings).collect();
        Ok((Self { scene, environment, warnings }, device?))
    }

    /// The environment that lights the scene, if one does, with its share in the settings.
    fn lit(&self, options: &SceneOptions, settings: &mut Settings) -> Option<&Environment> {
        let share = options.environment_share(&self.scene);
        settings.environment_intensity *= share.unwrap_or(1.0);
        self.environment.as_ref().filter(|_| share.is_some())
    }

    /// Plans the scene and builds what rays go through.
    ///
    /// # Errors
    /// When the scene has nothing to draw.
    pub fn prepared(self, options: &SceneOptions, mut settings: Settings) -> Result<Prepared> {
        let is_lit = self.lit(options, &mut settings).is_some();
        let Self { scene, environment, .. } = self;
        Prepared::new(scene, &settings.conditions(environment.as_ref().filter(|_| is_lit))?)
    }
}

impl Setup {
    /// Opens a device and a scene.
    ///
    /// # Errors
    /// One sentence with file, place and cause; that of the scene first.
    pub fn load(scene: &SceneOptions, reads: Reads, device: &DeviceOptions) -> Result<Self> {
        let (opened, device) = Opened::load(scene, reads, device)?;
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
        mut settings: Settings,
        effects: &[Effect],
        progress: &mut dyn FnMut(&str),
    ) -> Result<Vec<Price>> {
        let environment = self.opened.lit(options, &mut settings);
        let camera = options.choose_camera(&self.opened.scene, settings.size)?;
        let subject =
            Subject { device: &device.choice(), scene: &self.opened.scene, environment, settings, camera: &camera };
        subject.prices(effects, progress)
    }

    /// Hash of all that is drawn, whatever files it came from.
    pub fn contents(&self) -> String {
        contents(&self.opened.scene, self.opened.environment.as_ref())
    }

    /// Lends everything to something that draws many pictures.
    ///
    /// # Errors
    /// When there is no such camera, and whatever goes wrong there.
    pub fn bench<T>(
        &self,
        options: &SceneOptions,
        mut settings: Settings,
        draw: impl FnOnce(Bench<'_>) -> Result<T>,
    ) -> Result<T> {
        let environment = self.opened.lit(options, &mut settings);
        let camera = options.choose_camera(&self.opened.scene, settings.size)?;
        draw(Bench { device: &self.device, scene: &self.opened.scene, environment, settings, camera: &camera })
    }

    /// Plans and uploads; the renderer, and the camera to draw from.
    ///
    /// # Errors
    /// When there is no such camera, the scene has nothing to draw, or it does not fit the device.
    pub fn renderer(self, options: &SceneOptions, mut settings: Settings) -> Result<(Renderer, Camera)> {
        let Self { device, opened } = self;
        let is_lit = opened.lit(options, &mut settings).is_some();
        let camera = options.choose_camera(&opened.scene, settings.size)?;
        let environment = opened.environment.as_ref().filter(|_| is_lit);
        Ok((Renderer::new(&device, opened.scene, environment, settings)?, camera))
    }
}

/// Hash of all that is drawn, whatever files it came from.
#[must_use]
pub fn contents(scene: &Scene, environment: Option<&Environment>) -> String {
    let mut all = xxhash_rust::xxh3::Xxh3::new();
    for mesh in &scene.meshes {
        all.update(bytemuck::cast_slice(&mesh.positions));
        all.update(bytemuck::cast_slice(&mesh.normals));
        all.update(bytemuck::cast_slice(&mesh.tangents));
        all.update(bytemuck::cast_slice(&mesh.colors));
        all.update(bytemuck::cast_slice(&mesh.indices));
        mesh.uvs.iter().for_each(|set| all.update(bytemuck::cast_slice(set)));
        all.update(&mesh.material.to_le_bytes());
    }
    for image in &scene.images {
        all.update(&image.width.to_le_bytes());
        all.update(&image.rgba);
    }
    let Scene { instances, materials, lights, cameras, studio, .. } = scene;
    all.update(format!("{instances:?}{materials:?}{lights:?}{cameras:?}{studio:?}").as_bytes());
    if let Some(environment) = environment {
        all.update(bytemuck::cast_slice(&environment.radiance));
    }
    format!("{:032x}", all.digest128())
}
