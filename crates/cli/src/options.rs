//! Options that several commands share, and what they mean.

use std::path::PathBuf;

use anyhow::{Context as _, Result, anyhow, bail};
use clap::{Args, ValueEnum};
use glam::DVec3;

use super::choices::one_of;
use etalon::frame::{Background, Settings, TileShare};
use etalon::gpu::DeviceChoice;
use etalon::image::tone::ToneMap;
use etalon::plan::{Demand, Knobs, Model};
use etalon::scene::camera::{Camera, DEFAULT_FOV_Y};
use etalon::scene::environment::Environment;
use etalon::scene::{Ambience, LoadOptions, Reads, Scene};
use etalon_farm::job::word;

/// When to colour something.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum When {
    /// On a terminal.
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

/// How much is planned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Extent {
    /// What the scene calls for.
    Scene,
    /// Every effect that the knobs allow.
    Full,
    /// What the scene calls for, and what each of the others would have cost, measured.
    ExplainCost,
}

impl Extent {
    fn demand(self) -> Demand {
        match self {
            Self::Scene | Self::ExplainCost => Demand::Scene,
            Self::Full => Demand::Full,
        }
    }
}

/// What to draw, and from where.
#[derive(Debug, Clone, Args)]
pub struct SceneOptions {
    /// A .glb, .gltf or .obj file, or study:NAME
    #[arg(default_value = "study:etalon")]
    pub scene: String,
    /// A camera of the file, by name or index [default: the first; else one that frames the scene]
    #[arg(long, value_name = "NAME|INDEX", conflicts_with_all = ["eye", "target", "up"])]
    pub camera: Option<String>,
    /// Eye position in metres
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true)]
    pub eye: Option<DVec3>,
    /// Point to look at [default: the scene's middle]
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true, requires = "eye")]
    pub target: Option<DVec3>,
    /// Direction that is up in the picture [default: 0,1,0]
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true, requires = "eye")]
    pub up: Option<DVec3>,
    /// Vertical field of view in degrees, for cameras that are not the file's [default: 40]
    #[arg(long, value_name = "DEG", conflicts_with = "camera")]
    pub fov: Option<f64>,
    /// Animation time in seconds, or none for the rest pose stored in the file
    #[arg(long, value_name = "SECONDS|none", default_value = "none", allow_hyphen_values = true)]
    pub time: String,
    /// Environment map, or none [default: a built-in studio when the scene has no lights of its own]
    #[arg(long, value_name = "FILE.hdr|FILE.exr|none")]
    pub env: Option<String>,
    /// Multiplies the environment's radiance
    #[arg(long, value_name = "K", default_value_t = 1.0)]
    pub env_intensity: f32,
    /// Turns the environment about +Y
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_hyphen_values = true)]
    pub env_rotation: f32,
    /// What lies behind the scene [default: the environment; without one transparent in EXR, grey in PNG]
    #[arg(long, value_name = "env|transparent|#rrggbb", value_parser = background)]
    pub background: Option<Background>,
}

/// How to draw it.
#[derive(Debug, Clone, Args)]
pub struct PictureOptions {
    /// Pixels across and down
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = size)]
    pub size: [u32; 2],
    /// How much light transport is simulated [default: recursive]
    #[arg(long, value_parser = one_of::<Model>())]
    pub model: Option<Model>,
    /// Choose a knob's rung, for example samples=16; repeatable
    #[arg(long = "set", value_name = "KNOB=RUNG")]
    pub set: Vec<String>,
    /// What is planned: what the scene calls for; or every effect that the knobs allow, for the same picture; or what the
    /// scene calls for, with a table of what each other effect would have cost here
    #[arg(long, value_enum, value_name = "scene|full|explain-cost", default_value_t = Extent::Scene)]
    pub plan: Extent,
    /// Chooses the random numbers: another one, another noise
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(..1 << 31))]
    pub seed: u32,
    /// Choose the quickest rungs whose FLIP against the scene's own reference is no more than this, for example 0.02 or 2%, out
    /// of what `cost` measured or is measured first. With --model global: draw samples until the picture's relative error, which
    /// it estimates itself, is no more than this
    #[arg(long, value_name = "E")]
    pub max_error: Option<String>,
    /// Exposure in stops, display outputs only
    #[arg(long, value_name = "EV", default_value_t = 0.0, allow_hyphen_values = true)]
    pub exposure: f32,
    /// Tone curve, display outputs only
    #[arg(long, value_parser = one_of::<ToneMap>(), default_value = ToneMap::default().name())]
    pub tonemap: ToneMap,
}

/// Where to draw it.
#[derive(Debug, Clone, Args)]
pub struct DeviceOptions {
    /// Device by part of its name, index, or kind [default: the best there is]
    #[arg(long, value_name = "NAME|INDEX|cpu|gpu")]
    pub device: Option<String>,
    /// Check every Vulkan call and every hazard with the Khronos validation layer; any error fails the run
    #[arg(long)]
    pub validate: bool,
}

fn vector(text: &str) -> Result<DVec3, String> {
    let numbers: Vec<f64> =
        text.split(',').map(|part| part.trim().parse::<f64>()).collect::<Result<_, _>>().map_err(|e| e.to_string())?;
    match numbers[..] {
        [x, y, z] if numbers.iter().all(|n| n.is_finite()) => Ok(DVec3::new(x, y, z)),
        _ => Err("expected three finite numbers, X,Y,Z".to_owned()),
    }
}

/// I/N, I from 1 to N.
pub(super) fn shard(text: &str) -> Result<[u32; 2], String> {
    let parts = text.split_once('/').and_then(|(i, n)| Some([i.parse().ok()?, n.parse().ok()?]));
    match parts {
        Some([i, n]) if i >= 1 && i <= n => Ok([i, n]),
        _ => Err("expected I/N with I from 1 to N, for example 2/3".to_owned()),
    }
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let parts: Option<(u32, u32)> = text.split_once('x').and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    match parts {
        Some((w, h)) => Ok([w, h]),
        None => Err("expected WIDTHxHEIGHT, for example 1280x720".to_owned()),
    }
}

pub(super) fn background(text: &str) -> Result<Background, String> {
    match text {
        "env" => Ok(Background::Environment),
        "transparent" => Ok(Background::Transparent),
        _ => text
            .strip_prefix('#')
            .filter(|hex| hex.len() == 6)
            .and_then(|hex| u32::from_str_radix(hex, 16).ok())
            .map(|rgb| Background::Color([(rgb >> 16) as u8, (rgb >> 8) as u8, rgb as u8]))
            .ok_or_else(|| "expected env, transparent or #rrggbb".to_owned()),
    }
}

impl SceneOptions {
    /// What was chosen, as words of a command line.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        let point = |p: DVec3| format!("{},{},{}", p.x, p.y, p.z);
        let mut all = vec![word(&self.scene)];
        let mut option = |name: &str, value: Option<String>| {
            all.extend(value.map(|value| format!("--{name} {}", word(&value))));
        };
        option("camera", self.camera.clone());
        option("eye", self.eye.map(point));
        option("target", self.target.map(point));
        option("up", self.up.map(point));
        option("fov", self.fov.map(|fov| fov.to_string()));
        option("time", (self.time != "none").then(|| self.time.clone()));
        option("env", self.env.clone());
        option("env-intensity", (self.env_intensity != 1.0).then(|| self.env_intensity.to_string()));
        option("env-rotation", (self.env_rotation != 0.0).then(|| self.env_rotation.to_string()));
        option(
            "background",
            self.background.and_then(|background| match background {
                Background::Default => None,
                Background::Environment => Some("env".to_owned()),
                Background::Transparent => Some("transparent".to_owned()),
                Background::Color([r, g, b]) => Some(format!("#{r:02x}{g:02x}{b:02x}")),
            }),
        );
        all
    }

    /// The asked time of the animation; `None` is the rest pose.
    ///
    /// # Errors
    /// When it is no number of seconds.
    pub fn time(&self) -> Result<Option<f64>> {
        match self.time.as_str() {
            "none" => Ok(None),
            text => match text.parse::<f64>() {
                Ok(seconds) if seconds.is_finite() => Ok(Some(seconds)),
                _ => bail!("--time {text}: expected seconds, or none"),
            },
        }
    }

    /// Loads the scene at the asked time.
    ///
    /// # Errors
    /// One sentence with file, place and cause.
    pub fn load(&self, reads: Reads) -> Result<Scene> {
        etalon::open::scene(&self.scene, &LoadOptions { time: self.time()?, reads })
    }

    /// Loads the environment that is asked for, or would be used if the scene has no lights.
    ///
    /// # Errors
    /// One sentence with file and cause.
    pub fn load_environment(&self) -> Result<(Option<Environment>, Vec<String>)> {
        if !(self.env_intensity.is_finite() && self.env_intensity >= 0.0 && self.env_rotation.is_finite()) {
            bail!("--env-intensity and --env-rotation are finite numbers, the intensity not negative");
        }
        match self.env.as_deref() {
            Some("none") if self.env_intensity != 1.0 || self.env_rotation != 0.0 => {
                bail!("--env none: there is no environment for --env-intensity and --env-rotation to change")
            }
            Some("none") => Ok((None, Vec::new())),
            Some(path) => Environment::load(&PathBuf::from(path)).map(|(map, warnings)| (Some(map), warnings)),
            None => Ok((Some(Environment::studio()), Vec::new())),
        }
    }

    /// Whether the environment lights the scene whatever lights that has.
    #[must_use]
    pub fn asks_for_environment(&self) -> bool {
        self.env.is_some() || self.background == Some(Background::Environment)
    }

    /// Whether the camera is one that frames the scene, for the size that is asked for.
    #[must_use]
    pub fn frames(&self, scene: &Scene) -> bool {
        self.eye.is_none() && self.camera.is_none() && (scene.cameras.is_empty() || self.fov.is_some())
    }

    /// The camera to draw from.
    ///
    /// # Errors
    /// One sentence when there is no such camera or the directions do not give one.
    pub fn choose_camera(&self, scene: &Scene, size: [u32; 2]) -> Result<Camera> {
        let fov_y = match self.fov {
            None => DEFAULT_FOV_Y,
            Some(degrees) if degrees > 0.0 && degrees < 180.0 => degrees.to_radians(),
            Some(degrees) => bail!("--fov {degrees}: a field of view lies between 0 and 180 degrees"),
        };
        let bounds = scene.bounds().ok_or_else(|| anyhow!("{}: there is nothing to draw", scene.name))?;
        if let Some(eye) = self.eye {
            let target = self.target.unwrap_or_else(|| bounds.center());
            let up = self.up.unwrap_or(DVec3::Y);
            return Camera::looking_at(eye, target, up, fov_y)
                .with_context(|| format!("--eye {eye} --target {target}"));
        }
        if let Some(wanted) = &self.camera {
            let names = || scene.cameras.iter().map(|c| format!("\"{}\"", c.name)).collect::<Vec<_>>().join(", ");
            return scene
                .cameras
                .iter()
                .find(|camera| camera.name == *wanted)
                .or_else(|| wanted.parse::<usize>().ok().and_then(|index| scene.cameras.get(index)))
                .cloned()
                .ok_or_else(|| match scene.cameras.len() {
                    0 => anyhow!("--camera {wanted}: {} has no cameras", scene.name),
                    _ => anyhow!("--camera {wanted}: {} has the cameras {}", scene.name, names()),
                });
        }
        match scene.cameras.first() {
            Some(camera) if self.fov.is_none() => Ok(camera.clone()),
            _ => etalon::open::framing(scene, size, fov_y),
        }
    }
}

impl PictureOptions {
    /// What was chosen beside model, knobs and seed, as words of a command line.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        let mut all = vec![format!("--size {}x{}", self.size[0], self.size[1])];
        if self.exposure != 0.0 {
            all.push(format!("--exposure {}", self.exposure));
        }
        if self.tonemap != ToneMap::default() {
            let name = self.tonemap.name();
            all.push(format!("--tonemap {name}"));
        }
        all
    }

    /// Draws a scene by wavelengths whose glass sends them different ways, where the model is the one of paths and nobody chose.
    ///
    /// # Errors
    /// Never: the rung exists.
    pub fn colour_of(&self, scene: &Scene, knobs: &mut Knobs) -> Result<()> {
        let chosen = self.set.iter().any(|choice| choice.starts_with("colour="));
        let disperses = || scene.meshes.iter().any(|mesh| scene.materials[mesh.material].disperses());
        if self.model == Some(Model::Global) && !chosen && disperses() {
            knobs.set("colour=spectral:16")
        } else {
            Ok(())
        }
    }

    /// The knobs as set.
    ///
    /// # Errors
    /// One sentence for a model, knob or rung that does not exist.
    pub fn knobs(&self) -> Result<Knobs> {
        let mut knobs = Knobs::of(self.model.unwrap_or_default());
        knobs.set_all(&self.set)?;
        Ok(knobs)
    }

    /// The error that is the end of sampling, as a share.
    pub(super) fn max_error(&self) -> Result<Option<f64>> {
        let Some(text) = &self.max_error else { return Ok(None) };
        let (number, scale) = text.strip_suffix('%').map_or((text.as_str(), 1.0), |number| (number, 0.01));
        let error = number.trim().parse::<f64>().ok().map(|number| number * scale);
        let Some(error) = error.filter(|error| *error > 0.0 && error.is_finite()) else {
            bail!("--max-error {text}: expected a share above 0, for example 0.02 or 2%");
        };
        if self.set.iter().any(|choice| choice.starts_with("samples=")) {
            bail!("--max-error {text} contradicts --set samples: the one or the other ends the sampling");
        }
        Ok(Some(error))
    }

    /// What the picture may depend on, as far as that can be told before the scene is read.
    #[must_use]
    pub fn reads(&self, scene: &SceneOptions, knobs: &Knobs) -> Reads {
        let asked = scene.background == Some(Background::Environment);
        match (self.plan, scene.env.as_deref()) {
            (Extent::Full, _) => Reads::Everything,
            _ if !knobs.show_occlusion(true) => Reads::Visible(Ambience::Absent),
            _ if knobs.show_occlusion(false) => Reads::Visible(Ambience::Present),
            (_, Some("none")) => Reads::Visible(Ambience::Absent),
            (_, None) if !asked => Reads::Visible(Ambience::WithoutLights),
            _ => Reads::Visible(Ambience::Present),
        }
    }

    /// Everything the renderer needs to know.
    ///
    /// # Errors
    /// As [`PictureOptions::knobs`].
    pub fn settings(&self, scene: &SceneOptions) -> Result<Settings> {
        if self.size.contains(&0) {
            bail!("--size {}x{}: a picture has at least one pixel a side", self.size[0], self.size[1]);
        }
        if !self.exposure.is_finite() {
            bail!("--exposure {}: expected a finite number of stops", self.exposure);
        }
        Ok(Settings {
            size: self.size,
            knobs: self.knobs()?,
            tonemap: self.tonemap,
            exposure: self.exposure,
            background: scene.background.unwrap_or_default(),
            environment_intensity: scene.env_intensity,
            environment_rotation: scene.env_rotation,
            seed: self.seed,
            max_error: self.max_error()?,
            paths_at_once: false,
            traversal: None,
            demand: self.plan.demand(),
            parts: Vec::new(),
            share: TileShare::ALL,
        })
    }
}

impl DeviceOptions {
    /// What was chosen, as words of a command line.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        self.device.iter().map(|device| format!("--device {}", word(device))).collect()
    }

    /// Which device is meant.
    #[must_use]
    pub fn choice(&self) -> DeviceChoice {
        self.device.as_deref().map(|text| text.parse().unwrap_or_default()).unwrap_or_default()
    }
}
