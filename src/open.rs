//! A scene with its environment and a default camera: the entry point of programs that use the library.
//!
//! Read examples/render.rs, and docs/scene-input.md for the formats.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use anyhow::{Result, anyhow, bail};
use serde::Serialize;

use crate::frame::{Background, Renderer, Settings, TileShare};
use crate::gpu::Device;
use crate::image::meter::Meter;
use crate::plan::rungs::Lights;
use crate::plan::{EffectId, EffectState, Knobs, Plan};
use crate::prepare::{Original, Prepared};
use crate::scene::camera::DEFAULT_FOV_Y;
use crate::scene::environment::Environment;
use crate::scene::{Camera, LoadOptions, Scene, Source, completed};
use crate::study;
use crate::transport::emitters::emitted;

/// Intensity of the studio as fill light beside the lights of a file: one stop below the studio that lights a file
/// without lights, so that the file's lights stay the key light. At a quarter, the bronze of LightsPunctualLamp is
/// black where its lamps do not reach; at 1, the lamps are lost in the daylight.
const FILL: f32 = 0.5;

/// Emissive surfaces light a scene, and no studio is added, if the light that they send through the scene's bounding
/// sphere is at least this fraction of what the studio sends in. CornellBox has 1.13, EmissiveStrengthTest 0.09.
const EMISSIVE: f64 = 0.02;
/// Mean radiance of the studio.
const STUDIO: f64 = 0.83;

/// Lights that are named before the others are counted.
const NAMED: usize = 3;

/// Pixels of the longer side of a metered picture.
const METERED_SIDE: u32 = 160;
/// Samples of a metered picture, at most.
const METERED_SAMPLES: u32 = 4;

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
    /// Whether the scene is a file, for which the built-in studio is chosen by what the file contains.
    is_file: bool,
    /// Light of the emissive surfaces as a fraction of the studio's, of the first frame: a sequence is lit alike.
    emission: OnceLock<f64>,
    /// Whether the light is chosen for models that follow the light of surfaces; `None`: by the knobs of each picture.
    follows: Option<bool>,
    /// Warnings of the readers about skipped parts of the scene's file and of the environment's, one sentence each.
    pub warnings: Vec<String>,
}

/// What may light a picture ([`Opened::sources`]): names alone, so that the scene's texels can be freed while they are
/// uploaded.
#[derive(Debug, Clone)]
pub struct Sources {
    lights: Vec<String>,
    /// Whether some material emits.
    emits: bool,
    environment: Option<String>,
    factor: f32,
    why: &'static str,
}

/// What lights a picture, and why.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LitBy {
    /// Name of the environment map that lights the scene.
    pub environment: Option<String>,
    /// Factor of its radiance from the rule of [`Opened::lit`]; `--env-intensity` multiplies it.
    pub factor: f32,
    /// Number of punctual and area lights that light the scene.
    pub lights: usize,
    /// Whether the light of emissive surfaces is followed to others.
    pub emissive_surfaces: bool,
    /// One sentence.
    pub sentence: String,
}

impl Sources {
    /// What lights the picture of a plan: lights by name, surfaces that emit, the environment.
    #[must_use]
    pub fn lit_by(self, plan: &Plan) -> LitBy {
        let has = |id: EffectId| plan.effects.iter().any(|effect| effect.id == id && effect.state == EffectState::Kept);
        let shine = has(EffectId::PunctualLights) || has(EffectId::AreaLights);
        let kept = self.lights.iter().zip(&plan.lights).filter(|(_, is_kept)| shine && **is_kept);
        let names: Vec<String> = kept.map(|(name, _)| format!("\"{name}\"")).collect();
        let emissive_surfaces = self.emits && has(EffectId::EmissiveLights);
        let environment = self.environment.filter(|_| has(EffectId::Environment));
        let factor = if environment.is_some() { self.factor } else { 0.0 };
        let mut by = Vec::new();
        match &names[..] {
            [] => {}
            [one] => by.push(format!("the light {one}")),
            all if all.len() <= NAMED => by.push(format!("the lights {}", all.join(", "))),
            all => by.push(format!("the lights {} and {} more", all[..NAMED].join(", "), all.len() - NAMED)),
        }
        if emissive_surfaces {
            by.push("emissive surfaces".to_owned());
        }
        by.extend(environment.as_deref().map(|name| {
            let name =
                if name == "studio" { "the built-in studio".to_owned() } else { format!("the environment {name}") };
            if factor == 1.0 { name } else { format!("{name} at intensity {factor}") }
        }));
        let by = if by.is_empty() { "nothing".to_owned() } else { by.join(" and ") };
        let sentence = format!("lit by {by}{}", self.why);
        LitBy { environment, factor, lights: names.len(), emissive_surfaces, sentence }
    }
}

/// Whether these knobs follow the light of emissive surfaces to others.
fn follows_emission(knobs: &Knobs) -> bool {
    knobs.lights != Lights::Points
}

/// Whether `scene` is the name of a file and not of a study scene.
#[must_use]
pub fn is_file(scene: &str) -> bool {
    !scene.starts_with("study:")
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
        Some(study) => completed(study::load(study)?, options),
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

/// A camera that frames the whole scene ([`Scene::framing`]).
///
/// # Errors
/// When the scene has nothing to draw.
pub fn framing(scene: &Scene, size: [u32; 2], fov_y: f64) -> Result<Camera> {
    let aspect = f64::from(size[0]) / f64::from(size[1]);
    scene.framing(aspect, fov_y).ok_or_else(|| anyhow!("{}: there is nothing to draw", scene.name))
}

impl Opened {
    /// Loads a scene by name in its rest pose, as [`scene()`] does; the built-in studio lights a scene without lights.
    ///
    /// # Errors
    /// One sentence with file, place and cause.
    pub fn load(name: &str) -> Result<Self> {
        let scene = scene(name, &LoadOptions::default())?;
        Ok(Self { is_file: is_file(name), ..Self::new(scene, Some(Environment::studio()), false) })
    }

    /// A scene in an environment. The environment lights the scene if it `is_asked_for`, if the scene has no lights, or
    /// if the scene requests it.
    #[must_use]
    pub fn new(scene: Scene, environment: Option<Environment>, is_asked_for: bool) -> Self {
        let warnings = scene.warnings.clone();
        Self {
            original: scene.into(),
            environment,
            is_asked_for,
            is_file: false,
            emission: OnceLock::new(),
            follows: None,
            warnings,
        }
    }

    /// A scene that was read by `name` in an environment. If it is a file and the environment is not asked for, what
    /// the file contains decides how the environment lights it ([`Opened::lit`]).
    #[must_use]
    pub fn named(name: &str, scene: Scene, environment: Option<Environment>, is_asked_for: bool) -> Self {
        Self { is_file: is_file(name), ..Self::new(scene, environment, is_asked_for) }
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
        let (share, _) = self.share(&settings);
        settings.environment_intensity *= share.unwrap_or(1.0);
        (self.environment.as_ref().filter(|_| share.is_some()), settings)
    }

    /// Factor of the environment, `None` where it does not light the scene, and the reason at the end of a sentence.
    ///
    /// Asked for, by itself or as the background, it lights as it is; a scene built by code says itself. For a file:
    /// - where the light of emissive surfaces is followed and there is enough of it, the author lit the scene with
    ///   them, and a studio would drown them;
    /// - beside lights it is a fill light ([`FILL`]), as in the glTF Sample Viewer: without it, what the lights do not
    ///   reach is black;
    /// - without lights it is all the light there is. That includes emissive surfaces in models that do not follow
    ///   their light: they would hang in a black picture.
    fn share(&self, settings: &Settings) -> (Option<f32>, &'static str) {
        let scene = self.scene();
        let is_followed = self.follows.unwrap_or(follows_emission(&settings.knobs));
        match (self.is_asked_for || settings.background == Background::Environment, scene.studio) {
            (true, _) => (Some(1.0), ""),
            (_, Some(studio)) => (Some(studio), ""),
            _ if self.is_file && is_followed && self.is_lit_by_emission() => {
                (None, ", without the built-in studio, which --background env adds")
            }
            _ if scene.lights.is_empty() && !is_followed && self.is_lit_by_emission() => {
                (Some(1.0), ", because lights=points does not follow the light of its emissive surfaces")
            }
            _ if scene.lights.is_empty() => (Some(1.0), ""),
            _ if self.is_file => (Some(FILL), " as fill light, which --env none removes"),
            _ => (None, ""),
        }
    }

    /// Keeps the light that these knobs choose for all other knobs, too: for pictures that are compared.
    pub fn keep_light(&mut self, knobs: &Knobs) {
        self.follows = Some(follows_emission(knobs));
    }

    /// Whether the environment depends on the knobs of a picture.
    #[must_use]
    pub fn has_light_by_knobs(&self) -> bool {
        self.is_file && !self.is_asked_for && self.scene().studio.is_none() && self.is_lit_by_emission()
    }

    /// Whether the scene's emissive surfaces send a considerable amount of light ([`EMISSIVE`]).
    fn is_lit_by_emission(&self) -> bool {
        self.emission() >= EMISSIVE
    }

    /// Light that emissive surfaces send out through the scene's bounding sphere, over what the studio sends in.
    fn emission(&self) -> f64 {
        *self.emission.get_or_init(|| {
            let radius = self.scene().bounds().map_or(0.0, |bounds| bounds.radius());
            let sphere = 4.0 * std::f64::consts::PI * radius * radius;
            if sphere > 0.0 { emitted(self.scene()) / (STUDIO * sphere) } else { 0.0 }
        })
    }

    /// What may light a picture with these settings.
    #[must_use]
    pub fn sources(&self, settings: &Settings) -> Sources {
        let (share, why) = self.share(settings);
        let scene = self.scene();
        Sources {
            lights: scene.lights.iter().map(|light| light.name.clone()).collect(),
            emits: scene.materials.iter().any(|material| material.emissive != [0.0; 3]),
            environment: self.environment.as_ref().filter(|_| share.is_some()).map(|map| map.name.clone()),
            factor: share.unwrap_or(0.0),
            why: if self.environment.is_some() { why } else { "" },
        }
    }

    /// Whether the default exposure may show this scene white or black: lights of any unit, environments of any
    /// radiance, strong emission, or no light. A file in the studio, whose mean radiance is 0.8, is right at 0 stops,
    /// and scenes that are built in are made for 0.
    #[must_use]
    pub fn is_of_unknown_brightness(&self, settings: &Settings) -> bool {
        let scene = self.scene();
        let is_bright = |c: &f32| *c > 1.0;
        self.is_file
            && (!scene.lights.is_empty()
                || self.lit(settings.clone()).0.is_none_or(|map| map.name != "studio")
                || settings.environment_intensity != 1.0
                || scene.materials.iter().any(|material| material.emissive.iter().any(is_bright)))
    }

    /// Meters the surfaces that a camera sees, in a picture of few pixels drawn with these settings. `None` where it
    /// sees no surface.
    ///
    /// # Errors
    /// When the scene does not fit the device, or the driver fails.
    pub fn meter(&self, device: &Arc<Device>, settings: &Settings, camera: &Camera) -> Result<Option<Meter>> {
        let [width, height] = settings.size.map(u64::from);
        let longer = width.max(height).max(1);
        let side = |side: u64| ((side * u64::from(METERED_SIDE)).div_ceil(longer) as u32).max(1);
        let settings = Settings {
            // Where no surface is, alpha is 0.
            background: Background::Transparent,
            background_blur: 0.0,
            size: if longer > u64::from(METERED_SIDE) { [side(width), side(height)] } else { settings.size },
            max_error: None,
            parts: Vec::new(),
            share: TileShare::ALL,
            ..settings.clone()
        };
        let view = settings.view_transform();
        let mut renderer = self.clone().renderer(device, settings)?;
        renderer.render_samples(camera, METERED_SAMPLES, &mut |_| ())?;
        Ok(Meter::of(renderer.film_alone()?.rgba.into_iter(), &view))
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
