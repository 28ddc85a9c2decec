//! What a picture is made of: two files with one identity are the same picture to the last bit.

use std::collections::BTreeMap;

use anyhow::{Result, bail};
use etalon::frame::{Background, Settings};
use etalon::gpu::DeviceInfo;
use etalon::scene::environment::Environment;
use etalon::scene::{Camera, Scene};
use serde::{Deserialize, Serialize};

/// Everything that decides the bits of a picture, in words that can be compared and told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    /// Of the program, and a hash of its shaders: what was built of other sources is another one.
    pub version: String,
    /// What the user called the scene; it decides nothing.
    pub name: String,
    /// Hash of all that is drawn, whatever files it came from.
    pub scene: String,
    /// From where.
    pub camera: String,
    /// Pixels.
    pub size: [u32; 2],
    /// Rung of every knob.
    pub knobs: BTreeMap<String, String>,
    /// Whatever else is set, by name.
    pub settings: BTreeMap<String, String>,
    /// Device, driver and its version: other ones round otherwise.
    pub device: [String; 3],
}

fn version() -> String {
    let stages = etalon::shader::PROGRAMS.iter().flat_map(|program| program.stages);
    let mut all = xxhash_rust::xxh3::Xxh3::new();
    stages.for_each(|stage| all.update(bytemuck::cast_slice(stage.words)));
    format!("{}+{:016x}", env!("CARGO_PKG_VERSION"), all.digest())
}

/// Device, driver and its version: other ones round otherwise.
#[must_use]
pub fn device_name(info: &DeviceInfo) -> [String; 3] {
    [&info.name, &info.driver, &info.version].map(Clone::clone)
}

/// Hash of all that is drawn of a scene in an environment, whatever files it came from: 32 hexadecimal digits.
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
    /// Of a picture; `scene` is what [`contents`] says.
    #[must_use]
    pub fn of(name: &str, scene: String, camera: &Camera, settings: &Settings, device: &DeviceInfo) -> Self {
        let knobs = settings.knobs.list().into_iter().map(|(knob, rung)| (knob.to_owned(), rung.to_owned()));
        let behind = match settings.background {
            Background::Default => "default".to_owned(),
            Background::Environment => "env".to_owned(),
            Background::Transparent => "transparent".to_owned(),
            Background::Color([r, g, b]) => format!("#{r:02x}{g:02x}{b:02x}"),
        };
        // Debug of a float is the shortest text that is read back as the same bits.
        let numbers = [
            ("background", behind),
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

    /// A hash of it: 32 hexadecimal digits.
    #[must_use]
    pub fn fingerprint(&self) -> String {
        let decides = Self { name: String::new(), ..self.clone() };
        etalon::image::file::hash(serde_json::to_string(&decides).unwrap_or_default().as_bytes())
    }

    /// Nothing, where both are the same picture.
    ///
    /// # Errors
    /// What differs first, in words.
    pub fn same_as(&self, other: &Self) -> Result<()> {
        let version = (&self.version, &other.version);
        if version.0 != version.1 {
            bail!("drawn by etalon {} and {}", version.0, version.1);
        }
        if self.scene != other.scene {
            bail!("of two scenes, \"{}\" ({}) and \"{}\" ({})", self.name, self.scene, other.name, other.scene);
        }
        if self.size != other.size {
            let [a, b] = [self.size, other.size].map(|[w, h]| format!("{w}x{h}"));
            bail!("of two sizes, {a} and {b}");
        }
        if self.camera != other.camera {
            bail!("seen by two cameras");
        }
        for (what, mine, others) in [("knob", &self.knobs, &other.knobs), ("setting", &self.settings, &other.settings)]
        {
            if let Some((name, value)) = mine.iter().find(|(name, value)| others.get(*name) != Some(value)) {
                let other = others.get(name).map_or("none", String::as_str);
                bail!("drawn with two values of the {what} {name}, {value} and {other}");
            }
        }
        if self.device != other.device {
            bail!(
                "drawn on two devices, \"{}\" and \"{}\": they round otherwise",
                self.device.join(", "),
                other.device.join(", ")
            );
        }
        Ok(())
    }
}
