//! Identity of a picture: two files with equal identity hold the same picture, bit for bit.

use std::collections::BTreeMap;

use anyhow::{Result, bail};
use etalon::frame::{Background, Settings};
use etalon::gpu::DeviceInfo;
use etalon::scene::environment::Environment;
use etalon::scene::{Camera, Scene};
use serde::{Deserialize, Serialize};

/// Everything that determines the bits of a picture, as text.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    /// Version of the program with a hash of its shaders.
    pub version: String,
    /// Name of the scene as given by the user; it does not enter the comparison.
    pub name: String,
    /// Hash of the scene and the environment; file names do not enter it.
    pub scene: String,
    /// Camera.
    pub camera: String,
    /// Size in pixels.
    pub size: [u32; 2],
    /// Rungs by knob.
    pub knobs: BTreeMap<String, String>,
    /// All other settings by name.
    pub settings: BTreeMap<String, String>,
    /// Device, driver and driver version: other devices may round differently.
    pub device: [String; 3],
}

fn version() -> String {
    let stages = etalon::shader::PROGRAMS.iter().flat_map(|program| program.stages);
    let mut all = xxhash_rust::xxh3::Xxh3::new();
    stages.for_each(|stage| all.update(bytemuck::cast_slice(stage.words)));
    format!("{}+{:016x}", env!("CARGO_PKG_VERSION"), all.digest())
}

/// Device, driver and driver version.
#[must_use]
pub fn device_name(info: &DeviceInfo) -> [String; 3] {
    [&info.name, &info.driver, &info.version].map(Clone::clone)
}

/// Hash of a scene and its environment in memory, as 32 hexadecimal digits; file names do not enter it.
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

impl Identity {
    /// The identity of a picture; `scene` is the hash of [`contents`].
    #[must_use]
    pub fn of(name: &str, scene: String, camera: &Camera, settings: &Settings, device: &DeviceInfo) -> Self {
        let knobs = settings.knobs.list().into_iter().map(|(knob, rung)| (knob.to_owned(), rung.to_owned()));
        let behind = match settings.background {
            Background::Default => "default".to_owned(),
            Background::Environment => "env".to_owned(),
            Background::Transparent => "transparent".to_owned(),
            Background::Color([r, g, b]) => format!("#{r:02x}{g:02x}{b:02x}"),
        };
        // Debug formats a float as the shortest text that parses to the same bits.
        let numbers = [
            ("background", behind),
            ("background-blur", format!("{:?}", settings.background_blur)),
            ("forced", format!("{:?}", settings.forced)),
            ("env-intensity", format!("{:?}", settings.environment_intensity)),
            ("env-rotation", format!("{:?}", settings.environment_rotation)),
            ("exposure", format!("{:?}", settings.exposure)),
            ("max-error", format!("{:?}", settings.max_error)),
            ("seed", settings.seed.to_string()),
            ("tonemap", settings.tonemap.name().to_owned()),
            ("traversal", format!("{:?}", settings.traversal)),
        ];
        Self {
            version: version(),
            name: name.to_owned(),
            scene,
            camera: format!("{:?} {:?}", camera.world_from_camera, camera.projection),
            size: settings.size,
            knobs: knobs.collect(),
            settings: numbers.map(|(name, value)| (name.to_owned(), value)).into(),
            device: device_name(device),
        }
    }

    /// Hash of the identity as 32 hexadecimal digits.
    #[must_use]
    pub fn fingerprint(&self) -> String {
        let decides = Self { name: String::new(), ..self.clone() };
        etalon::image::file::hash(serde_json::to_string(&decides).unwrap_or_default().as_bytes())
    }

    /// Checks that both identities are of the same picture.
    ///
    /// # Errors
    /// The first difference in words.
    pub fn same_as(&self, other: &Self) -> Result<()> {
        let version = (&self.version, &other.version);
        if version.0 != version.1 {
            bail!("they were drawn by etalon {} and {}", version.0, version.1);
        }
        if self.scene != other.scene {
            bail!("they show two scenes, \"{}\" ({}) and \"{}\" ({})", self.name, self.scene, other.name, other.scene);
        }
        if self.size != other.size {
            let [a, b] = [self.size, other.size].map(|[w, h]| format!("{w}x{h}"));
            bail!("they have two sizes, {a} and {b}");
        }
        if self.camera != other.camera {
            bail!("they were drawn from two cameras");
        }
        for (what, mine, others) in [("knob", &self.knobs, &other.knobs), ("setting", &self.settings, &other.settings)]
        {
            if let Some((name, value)) = mine.iter().find(|(name, value)| others.get(*name) != Some(value)) {
                let other = others.get(name).map_or("none", String::as_str);
                bail!("they were drawn with two values of the {what} {name}, {value} and {other}");
            }
        }
        if self.device != other.device {
            bail!(
                "they were drawn on two devices, \"{}\" and \"{}\", whose rounding may differ",
                self.device.join(", "),
                other.device.join(", ")
            );
        }
        Ok(())
    }
}
