//! Command-line options that several subcommands share, and their conversion to cameras, environments and renderer
//! settings. clap prints the doc comments of options as help texts.

use std::path::PathBuf;

use anyhow::{Context as _, Result, anyhow, bail, ensure};
use clap::{Args, ValueEnum};
use glam::DVec3;

use super::choices::one_of;
use super::exposure::{Exposure, ExposureFacts};
use super::heading;
use super::usage;
use etalon::frame::{Background, Settings, TileShare};
use etalon::gpu::DeviceChoice;
use etalon::image::tone::ToneMap;
use etalon::open::Opened;
use etalon::plan::rungs::Indirect;
use etalon::plan::{ForcedEffects, Knobs, Model};
use etalon::scene::camera::{Camera, DEFAULT_FOV_Y};
use etalon::scene::environment::Environment;
use etalon::scene::{AmbientLight, KeyLight, LoadOptions, MissingImages, Prune, Scene};
use etalon::study;
use etalon_farm::job::word;

/// When to print colour or progress.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum When {
    /// Only on a terminal.
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

/// A time of a scene's animation, in seconds; `None` is the rest pose.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AnimationTime(pub Option<f64>);

/// Pixels of the longest side that an image may have on any Vulkan device; most have half of that.
const LONGEST_SIDE: u32 = 32768;

/// Which effects a plan contains.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PlanExtent {
    /// Effects that the scene calls for.
    Scene,
    /// Every effect that the knobs allow.
    Full,
    /// Effects that the scene calls for, and a measured table of what each other effect would cost.
    ExplainCost,
}

impl PlanExtent {
    fn forced(self) -> ForcedEffects {
        match self {
            Self::Scene | Self::ExplainCost => ForcedEffects::None,
            Self::Full => ForcedEffects::All,
        }
    }
}

/// What happens where an image of the scene is missing or broken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Missing {
    /// The scene is refused.
    Error,
    /// A checker stands in the image's place, with a warning.
    Checker,
}

/// Scene, camera, animation time and environment.
#[derive(Debug, Clone, Args)]
pub struct SceneOptions {
    /// A .glb, .gltf, .obj, .stl or .ply file, - for glTF on standard input, or a built-in scene as study:NAME
    #[arg(default_value = "study:etalon")]
    pub scene: String,
    /// Scene of the file, by name or index [default: the one that the file names]
    #[arg(id = "scene_of_file", long = "scene", value_name = "NAME|INDEX", help_heading = heading::SCENE)]
    pub scene_of_file: Option<String>,
    /// Variant of the file's materials, by name or index (KHR_materials_variants) [default: the materials of the
    /// primitives]
    #[arg(long, value_name = "NAME|INDEX", help_heading = heading::SCENE)]
    pub variant: Option<String>,
    /// What happens where an image of the file is missing or broken: an error, or a checker in its place with a warning
    /// [default: error; checker for `view`]
    #[arg(long, value_enum, value_name = "error|checker", hide_possible_values = true, help_heading = heading::SCENE)]
    pub missing: Option<Missing>,
    /// Camera of the file, by name or index [default: the first camera; if the file has none, a camera that frames the
    /// scene]
    #[arg(long, value_name = "NAME|INDEX", conflicts_with_all = ["eye", "target", "up"], help_heading = heading::CAMERA)]
    pub camera: Option<String>,
    /// Eye position in metres
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true, help_heading = heading::CAMERA)]
    pub eye: Option<DVec3>,
    /// Point to look at [default: the middle of the scene]
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true, requires = "eye", help_heading = heading::CAMERA)]
    pub target: Option<DVec3>,
    /// Direction that points up in the picture [default: 0,1,0]
    #[arg(long, value_name = "X,Y,Z", value_parser = direction, allow_hyphen_values = true, requires = "eye", help_heading = heading::CAMERA)]
    pub up: Option<DVec3>,
    /// Vertical field of view in degrees, for cameras that do not come from the file [default: 40]
    #[arg(long, value_name = "DEG", value_parser = field_of_view, allow_hyphen_values = true, conflicts_with = "camera", help_heading = heading::CAMERA)]
    pub fov: Option<f64>,
    /// Animation time in seconds, or none for the rest pose stored in the file
    #[arg(long, value_name = "SECONDS|none", value_parser = time, default_value = "none", allow_hyphen_values = true, help_heading = heading::SCENE)]
    pub time: AnimationTime,
    /// Animation of the file that plays, by name or index, or all [default: those that do not move the same nodes]
    #[arg(long, value_name = "NAME|INDEX|all", help_heading = heading::SCENE)]
    pub animation: Option<String>,
    /// Leave out a node with everything below it, by name or index (index:N where N is a name); repeatable. Its
    /// cameras stay
    #[arg(long, value_name = "NAME|INDEX", help_heading = heading::SCENE)]
    pub hide: Vec<String>,
    /// Show only this node with everything below it, by name or index; repeatable
    #[arg(long, value_name = "NAME|INDEX", help_heading = heading::SCENE)]
    pub only: Vec<String>,
    /// Environment map, studio or none [default: the built-in studio; as fill light if the file contains lights, and
    /// not if its emissive surfaces light it]
    #[arg(long, value_name = "FILE.hdr|FILE.exr|studio|none", help_heading = heading::LIGHT)]
    pub env: Option<String>,
    /// Add a directional light of LUX from AZIMUTH degrees about +Y (0: the front, +Z; 90: +X) and ELEVATION degrees
    /// above the horizon
    #[arg(long, value_name = "AZIMUTH,ELEVATION,LUX", value_parser = key_light, allow_hyphen_values = true, help_heading = heading::LIGHT)]
    pub key_light: Option<KeyLight>,
    /// Factor for the radiance of the environment
    #[arg(long, value_name = "K", value_parser = factor, default_value_t = 1.0, allow_hyphen_values = true, help_heading = heading::LIGHT)]
    pub env_intensity: f32,
    /// Rotation of the environment about +Y in degrees
    #[arg(long, value_name = "DEG", value_parser = finite, default_value_t = 0.0, allow_hyphen_values = true, help_heading = heading::LIGHT)]
    pub env_rotation: f32,
    /// Background behind the scene [default: the environment; without one, transparent in EXR and grey in PNG]
    #[arg(long, value_name = "env|transparent|#rrggbb", value_parser = background, help_heading = heading::LIGHT)]
    pub background: Option<Background>,
    /// Blur of an environment that is the background, 0 to 1: the perceptual roughness of a lobe that it is seen
    /// through. Light and reflections stay as they are
    #[arg(long, value_name = "K", value_parser = fraction, default_value_t = 0.0, allow_hyphen_values = true, help_heading = heading::LIGHT)]
    pub background_blur: f32,
}

/// Size, model, knobs and display of a picture.
#[derive(Debug, Clone, Args)]
pub struct PictureOptions {
    /// Width and height in pixels
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = size, help_heading = heading::PICTURE)]
    pub size: [u32; 2],
    /// How much light transport is simulated [default: recursive]
    #[arg(long, value_parser = one_of::<Model>(), help_heading = heading::QUALITY)]
    pub model: Option<Model>,
    /// Set a knob to a rung, for example samples=16; repeatable. `etalon knobs` lists them
    #[arg(long = "set", value_name = "KNOB=RUNG", help_heading = heading::QUALITY)]
    pub set: Vec<String>,
    /// Which effects to prepare: those that the scene calls for; or every effect that the knobs allow, for the same
    /// picture; or those that the scene calls for, with a table of what each other effect would cost here
    #[arg(long, value_enum, value_name = "scene|full|explain-cost", default_value_t = PlanExtent::Scene, help_heading = heading::QUALITY)]
    pub plan: PlanExtent,
    /// Random seed: another seed gives the picture other noise
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(..1 << 31), help_heading = heading::QUALITY)]
    pub seed: u32,
    /// Pick the fastest rungs whose error against the scene's reference is at most this, for example 0.02 or 2%
    /// (measures first if `cost` has not been run). With --model global: draw samples until the estimated relative
    /// error of the picture is at most this
    #[arg(long, value_name = "E", value_parser = error_limit, help_heading = heading::QUALITY)]
    pub max_error: Option<f64>,
    /// Exposure in stops, or auto: from the picture's own luminance. Changes display outputs only [default: 0; auto for
    /// files that would be shown plain white or nearly black]
    #[arg(long, value_name = "EV|auto", value_parser = exposure, allow_hyphen_values = true, help_heading = heading::PICTURE)]
    pub exposure: Option<Exposure>,
    /// Tone curve; changes display outputs only
    #[arg(
        long,
        value_parser = one_of::<ToneMap>(),
        default_value = ToneMap::default().name(),
        help_heading = heading::PICTURE
    )]
    pub tonemap: ToneMap,
}

/// Vulkan device and validation.
#[derive(Debug, Clone, Args)]
pub struct DeviceOptions {
    /// Device, by a part of its name, its index or its kind [default: the best device]
    #[arg(long, value_name = "NAME|INDEX|cpu|gpu", help_heading = heading::DEVICE)]
    pub device: Option<String>,
    /// Check Vulkan calls and synchronization hazards with the Khronos validation layer; any validation error fails the
    /// run
    #[arg(long, help_heading = heading::DEVICE)]
    pub validate: bool,
    /// The device was lost once: submissions are short. No option sets it.
    #[arg(skip)]
    pub short_submissions: bool,
}

fn vector(text: &str) -> Result<DVec3, String> {
    let numbers: Vec<f64> =
        text.split(',').map(|part| part.trim().parse::<f64>()).collect::<Result<_, _>>().map_err(|e| e.to_string())?;
    match numbers[..] {
        [x, y, z] if numbers.iter().all(|n| n.is_finite()) => Ok(DVec3::new(x, y, z)),
        _ => Err("expected three finite numbers, X,Y,Z".to_owned()),
    }
}

/// A vector with a length above 0.
fn direction(text: &str) -> Result<DVec3, String> {
    vector(text)
        .and_then(|v| if v == DVec3::ZERO { Err("expected a vector other than 0,0,0".to_owned()) } else { Ok(v) })
}

fn key_light(text: &str) -> Result<KeyLight, String> {
    let DVec3 { x: azimuth, y: elevation, z: lux } = vector(text).map_err(|_| "expected AZIMUTH,ELEVATION,LUX")?;
    if lux < 0.0 || lux > f64::from(f32::MAX) {
        return Err("expected at least 0 lux".to_owned());
    }
    Ok(KeyLight { azimuth, elevation, lux: lux as f32 })
}

/// A number that `accept` accepts, else the sentence that says what is expected.
fn number<T: std::str::FromStr>(text: &str, accept: impl Fn(&T) -> bool, expected: &str) -> Result<T, String> {
    text.trim().parse().ok().filter(accept).ok_or_else(|| format!("expected {expected}"))
}

fn finite(text: &str) -> Result<f32, String> {
    number(text, |x: &f32| x.is_finite(), "a finite number")
}

fn factor(text: &str) -> Result<f32, String> {
    number(text, |x: &f32| x.is_finite() && *x >= 0.0, "a finite number of at least 0")
}

fn fraction(text: &str) -> Result<f32, String> {
    number(text, |x: &f32| (0.0..=1.0).contains(x), "a number from 0 to 1")
}

fn field_of_view(text: &str) -> Result<f64, String> {
    number(text, |x: &f64| *x > 0.0 && *x < 180.0, "an angle between 0 and 180 degrees")
}

fn exposure(text: &str) -> Result<Exposure, String> {
    match text {
        "auto" => Ok(Exposure::Auto),
        text => number(text, |x: &f32| x.is_finite(), "a finite number of stops, or auto").map(Exposure::Stops),
    }
}

fn time(text: &str) -> Result<AnimationTime, String> {
    match text {
        "none" => Ok(AnimationTime(None)),
        text => number(text, |x: &f64| x.is_finite(), "seconds, or none").map(|seconds| AnimationTime(Some(seconds))),
    }
}

/// An error limit as a fraction: `2%` is 0.02.
fn error_limit(text: &str) -> Result<f64, String> {
    let (text, scale) = text.strip_suffix('%').map_or((text, 1.0), |number| (number, 0.01));
    let accept = |x: &f64| *x > 0.0 && x.is_finite();
    number(text, accept, "a fraction above 0, for example 0.02 or 2%").map(|fraction| fraction * scale)
}

/// GPU time in milliseconds.
pub(super) fn milliseconds(text: &str) -> Result<f64, String> {
    let text = text.strip_suffix("ms").unwrap_or(text);
    number(text, |x: &f64| *x > 0.0 && x.is_finite(), "milliseconds above 0, for example 8 or 8ms")
}

/// Parses a shard I/N, with I from 1 to N.
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
        Some((0, _) | (_, 0)) => Err("width and height must be at least one pixel".to_owned()),
        Some((w, h)) if w.max(h) > LONGEST_SIDE => {
            Err(format!("no device draws more than {LONGEST_SIDE} pixels a side"))
        }
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

/// A point in messages, with the digits of a number of 32 bits.
fn point(p: DVec3) -> String {
    let [x, y, z] = p.as_vec3().to_array();
    format!("{x},{y},{z}")
}

impl SceneOptions {
    /// These options as command-line words; options at their defaults are left out.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        let point = |p: DVec3| format!("{},{},{}", p.x, p.y, p.z);
        let mut all = vec![word(&self.scene)];
        let mut option = |name: &str, value: Option<String>| {
            // A value that begins like an option is joined to its option.
            let between = |value: &str| if value.starts_with('-') { '=' } else { ' ' };
            all.extend(value.map(|value| format!("--{name}{}{}", between(&value), word(&value))));
        };
        option("scene", self.scene_of_file.clone());
        option("variant", self.variant.clone());
        option("missing", (self.missing == Some(Missing::Checker)).then(|| "checker".to_owned()));
        option("camera", self.camera.clone());
        option("eye", self.eye.map(point));
        option("target", self.target.map(point));
        option("up", self.up.map(point));
        option("fov", self.fov.map(|fov| fov.to_string()));
        option("time", self.time.0.map(|time| time.to_string()));
        option("animation", self.animation.clone());
        self.hide.iter().for_each(|node| option("hide", Some(node.clone())));
        self.only.iter().for_each(|node| option("only", Some(node.clone())));
        option("env", self.env.clone());
        option("key-light", self.key_light.map(|light| format!("{},{},{}", light.azimuth, light.elevation, light.lux)));
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
        option("background-blur", (self.background_blur != 0.0).then(|| self.background_blur.to_string()));
        all
    }

    /// The scene in messages.
    #[must_use]
    pub fn label(&self) -> &str {
        if self.scene == "-" { "standard input" } else { &self.scene }
    }

    /// Checks what can be checked before the scene is loaded.
    ///
    /// # Errors
    /// One sentence: an unknown study scene, an option that study scenes do not have, or options that contradict.
    pub fn check(&self) -> Result<()> {
        if let Some(name) = self.scene.strip_prefix("study:") {
            let chosen = [&self.scene_of_file, &self.variant, &self.animation];
            let chooses = self.time.0.is_some() || chosen.into_iter().any(Option::is_some);
            if chooses || !study::NAMES.contains(&name) {
                // It fails without generating a scene.
                self.load(Prune::Nothing)?;
            }
        }
        let dark = self.env.as_deref() == Some("none");
        if dark && (self.env_intensity != 1.0 || self.env_rotation != 0.0) {
            bail!("--env none contradicts --env-intensity and --env-rotation: there is no environment");
        }
        if dark || matches!(self.background, Some(Background::Transparent | Background::Color(_))) {
            let (background, background_blur) = (self.background.unwrap_or_default(), self.background_blur);
            Settings { background, background_blur, ..Settings::default() }.conditions(None)?;
        }
        if let (Some(eye), Some(target)) = (self.eye, self.target) {
            self.looking(eye, target)?;
        }
        Ok(())
    }

    /// The camera of `--eye`, `--up` and `--fov`, towards `target`.
    fn looking(&self, eye: DVec3, target: DVec3) -> Result<Camera> {
        Camera::looking_at(eye, target, self.up.unwrap_or(DVec3::Y), self.fov_y())
            .with_context(|| format!("--eye {} --target {}", point(eye), point(target)))
    }

    /// The vertical field of view of cameras that do not come from the file, in radians.
    pub(super) fn fov_y(&self) -> f64 {
        self.fov.map_or(DEFAULT_FOV_Y, f64::to_radians)
    }

    /// Loads the scene at the animation time.
    ///
    /// # Errors
    /// One sentence with the file, the place in it and the cause.
    pub fn load(&self, prune: Prune) -> Result<Scene> {
        etalon::open::scene(&self.scene, &self.load_options(prune))
    }

    /// How the scene's file is read.
    #[must_use]
    pub fn load_options(&self, prune: Prune) -> LoadOptions {
        LoadOptions {
            time: self.time.0,
            prune,
            scene: self.scene_of_file.clone(),
            variant: self.variant.clone(),
            animation: self.animation.clone(),
            hide: self.hide.clone(),
            only: self.only.clone(),
            key_light: self.key_light,
            missing: match self.missing {
                None | Some(Missing::Error) => MissingImages::Error,
                Some(Missing::Checker) => MissingImages::Checker,
            },
        }
    }

    /// Loads the environment of `--env`, or the built-in studio. Returns it with warnings.
    ///
    /// # Errors
    /// One sentence with the file and the cause.
    pub fn load_environment(&self) -> Result<(Option<Environment>, Vec<String>)> {
        match self.env.as_deref() {
            Some("none") => Ok((None, Vec::new())),
            Some("studio") | None => Ok((Some(Environment::studio()), Vec::new())),
            Some(path) => Environment::load(&PathBuf::from(path)).map(|(map, warnings)| (Some(map), warnings)),
        }
    }

    /// These options with the light of a picture written out, where other knobs would choose another light.
    #[must_use]
    pub fn with_light_of(&self, opened: &Opened, knobs: &Knobs) -> Self {
        if !opened.has_light_by_knobs() {
            return self.clone();
        }
        let settings = Settings {
            knobs: knobs.clone(),
            background: self.background.unwrap_or_default(),
            environment_intensity: self.env_intensity,
            ..Settings::default()
        };
        match opened.lit(settings) {
            (Some(_), lit) => Self {
                background: self.background.or(Some(Background::Environment)),
                env_intensity: lit.environment_intensity,
                ..self.clone()
            },
            (None, _) => Self {
                env: Some("none".to_owned()),
                env_intensity: 1.0,
                env_rotation: 0.0,
                background_blur: 0.0,
                ..self.clone()
            },
        }
    }

    /// Whether the environment lights the scene even if the scene has lights.
    #[must_use]
    pub fn asks_for_environment(&self) -> bool {
        self.env.is_some() || self.background == Some(Background::Environment)
    }

    /// Whether the camera is computed to frame the scene at the size of the picture.
    #[must_use]
    pub fn frames(&self, scene: &Scene) -> bool {
        self.eye.is_none() && self.camera.is_none() && (scene.cameras.is_empty() || self.fov.is_some())
    }

    /// The camera that these options choose.
    ///
    /// # Errors
    /// Wrong usage when the file has no such camera, or when eye, target and up direction define none; one sentence
    /// when there is nothing to draw.
    pub fn choose_camera(&self, scene: &Scene, size: [u32; 2]) -> Result<Camera> {
        let bounds = scene.bounds().ok_or_else(|| anyhow!("{}: the scene has nothing to draw", scene.name))?;
        if let Some(eye) = self.eye {
            return usage(self.looking(eye, self.target.unwrap_or_else(|| bounds.center())));
        }
        if let Some(wanted) = &self.camera {
            let names = || scene.cameras.iter().map(|c| format!("\"{}\"", c.name)).collect::<Vec<_>>().join(", ");
            return usage(scene.camera(wanted).cloned().ok_or_else(|| match scene.cameras.len() {
                0 => anyhow!("--camera {wanted}: {} has no cameras", scene.name),
                _ => anyhow!("--camera {wanted}: no such camera; {} has the cameras {}", scene.name, names()),
            }));
        }
        match scene.cameras.first() {
            Some(camera) if self.fov.is_none() => Ok(camera.clone()),
            _ => etalon::open::framing(scene, size, self.fov_y()),
        }
    }
}

impl PictureOptions {
    /// Size and display options as command-line words, without model, knobs and seed.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        let mut all = vec![format!("--size {}x{}", self.size[0], self.size[1])];
        match self.exposure {
            None => {}
            Some(Exposure::Auto) => all.push("--exposure auto".to_owned()),
            Some(Exposure::Stops(stops)) => all.push(format!("--exposure {stops}")),
        }
        if self.tonemap != ToneMap::default() {
            let name = self.tonemap.name();
            all.push(format!("--tonemap {name}"));
        }
        all
    }

    /// These options with the exposure of a picture written out where it was metered.
    pub(super) fn with_exposure(&self, facts: &ExposureFacts) -> Self {
        let metered = (facts.from == "metered").then_some(Exposure::Stops(facts.stops));
        Self { exposure: metered.or(self.exposure), ..self.clone() }
    }

    /// Selects spectral rendering (`colour=spectral:16`) for scenes with dispersive glass under `--model global`,
    /// unless `--set colour` is given.
    ///
    /// # Errors
    /// Never: the rung exists.
    pub fn colour_of(&self, scene: &Scene, knobs: &mut Knobs) -> Result<()> {
        let disperses = || scene.meshes.iter().any(|mesh| scene.materials[mesh.material].disperses());
        if self.leaves_colour() && disperses() { knobs.set("colour=spectral:16") } else { Ok(()) }
    }

    /// Whether the scene chooses between RGB and spectral rendering: under `--model global` without `--set colour`.
    #[must_use]
    pub fn leaves_colour(&self) -> bool {
        self.model == Some(Model::Global) && !self.set.iter().any(|choice| choice.starts_with("colour="))
    }

    /// Knobs of `--model` with the changes of `--set`.
    ///
    /// # Errors
    /// One sentence for a model, knob or rung that does not exist.
    pub fn knobs(&self) -> Result<Knobs> {
        let mut knobs = Knobs::of(self.model.unwrap_or_default());
        knobs.set_all(&self.set)?;
        Ok(knobs)
    }

    /// Checks that `--max-error` can end the sampling.
    ///
    /// # Errors
    /// When the knobs follow no paths, and the errors of [`PictureOptions::knobs`].
    pub fn check_error_is_told(&self) -> Result<()> {
        let is_told = self.max_error.is_none() || self.knobs()?.indirect == Indirect::Path;
        ensure!(is_told, "--max-error: only paths tell their error; add --model global");
        Ok(())
    }

    /// Which textures and attributes loading may prune, as far as this is known before the scene is read.
    #[must_use]
    pub fn prune(&self, scene: &SceneOptions, knobs: &Knobs) -> Prune {
        match (self.plan, scene.env.as_deref()) {
            (PlanExtent::Full, _) => Prune::Nothing,
            _ if !knobs.show_occlusion(true) => Prune::Unused(AmbientLight::Absent),
            _ if knobs.show_occlusion(false) => Prune::Unused(AmbientLight::Present),
            (_, Some("none")) => Prune::Unused(AmbientLight::Absent),
            _ => Prune::Unused(AmbientLight::Present),
        }
    }

    /// Settings of the renderer. Nothing of the scene is read yet.
    ///
    /// # Errors
    /// Wrong usage: the errors of [`PictureOptions::knobs`] and [`SceneOptions::check`], and two ends of the sampling.
    pub fn settings(&self, scene: &SceneOptions) -> Result<Settings> {
        usage(self.checked(scene))
    }

    fn checked(&self, scene: &SceneOptions) -> Result<Settings> {
        scene.check()?;
        if self.max_error.is_some() && self.set.iter().any(|choice| choice.starts_with("samples=")) {
            bail!("--max-error contradicts --set samples: give only one of them to end the sampling");
        }
        let exposure = match self.exposure {
            Some(Exposure::Stops(stops)) => stops,
            Some(Exposure::Auto) | None => 0.0,
        };
        Ok(Settings {
            size: self.size,
            knobs: self.knobs()?,
            tonemap: self.tonemap,
            exposure,
            background: scene.background.unwrap_or_default(),
            background_blur: scene.background_blur,
            environment_intensity: scene.env_intensity,
            environment_rotation: scene.env_rotation,
            seed: self.seed,
            max_error: self.max_error,
            architecture: None,
            ray_trees: None,
            traversal: None,
            forced: self.plan.forced(),
            parts: Vec::new(),
            share: TileShare::ALL,
        })
    }
}

impl DeviceOptions {
    /// These options as command-line words.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        self.device.iter().map(|device| format!("--device {}", word(device))).collect()
    }

    /// The device that `--device` chooses.
    #[must_use]
    pub fn choice(&self) -> DeviceChoice {
        self.device.as_deref().map(|text| text.parse().unwrap_or_default()).unwrap_or_default()
    }
}
