//! What the window wants and what the thread that draws has to show: all that goes between the two.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use anyhow::{Context as _, Result};

use etalon::frame::Settings;
use etalon::gpu::{DeviceInfo, PassTime, Replacement};
use etalon::pass::tonemap::Counts;
use etalon::plan::{Effect, Knobs};
use etalon::prepare::Original;
use etalon::scene::environment::Environment;
use etalon::scene::{Bounds, Camera, Light, Material, Scene};
use etalon::share::AovPixel;
use etalon::transport::events::Event;
use etalon_cost::table::Table;

/// A scene as it comes out of a file.
pub struct Loaded {
    /// Its name.
    pub name: String,
    /// The scene.
    pub original: Original,
    /// What lights it from all around, and how strongly.
    pub environment: Option<(Arc<Environment>, f32)>,
    /// The camera that it begins with.
    pub camera: Camera,
    /// What was read around.
    pub warnings: Vec<String>,
    /// Prices of rungs, where they were measured on this device.
    pub prices: Option<Arc<Table>>,
    /// The camera frames the scene for a size: for another it is another.
    pub framed: bool,
    /// Rungs that it is drawn with where nobody chose others.
    pub knobs: Option<Knobs>,
}

/// Which scene: the one of the command line, or another file, at its own time or another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OpenRequest<'a> {
    /// `None`: that of the command line.
    pub file: Option<&'a Path>,
    /// Seconds; `None`: as the command line says, or at rest.
    pub time: Option<f64>,
    /// Of the picture.
    pub size: [u32; 2],
}

/// Where scenes come from.
pub trait SceneSource: Send {
    /// Reads a scene, and all that belongs to it on this device.
    ///
    /// # Errors
    /// One sentence with file and cause.
    fn open(&self, asked: OpenRequest<'_>, device: &DeviceInfo) -> Result<Loaded>;

    /// The scene alone, at another moment, and the camera that it begins with.
    ///
    /// # Errors
    /// As [`SceneSource::open`].
    fn moment(&self, asked: OpenRequest<'_>) -> Result<(Scene, Camera)>;
}

/// From where a scene is seen.
#[derive(Debug, Clone, PartialEq)]
pub enum Viewpoint {
    /// The camera that it begins with, wherever that is at this time.
    Own,
    /// A camera of the file, likewise.
    Named(String),
    /// Any other.
    Free(Camera),
}

impl Viewpoint {
    /// The camera.
    ///
    /// # Errors
    /// When the file has no camera of that name any more.
    pub fn camera<'a>(&'a self, loaded: &'a Loaded) -> Result<&'a Camera> {
        match self {
            Self::Own => Ok(&loaded.camera),
            Self::Free(camera) => Ok(camera),
            Self::Named(name) => {
                let found = loaded.original.scene().cameras.iter().find(|camera| camera.name == *name);
                found.with_context(|| format!("{}: there is no camera \"{name}\"", loaded.name))
            }
        }
    }
}

/// A pixel that is asked about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pick {
    /// Another number: asked anew.
    pub number: u64,
    /// Across and down.
    pub pixel: [u32; 2],
}

/// What is to be seen.
#[derive(Clone)]
pub struct RenderRequest {
    /// Another number: another scene.
    pub scene: u64,
    /// Its file; `None`: that of the command line.
    pub file: Option<PathBuf>,
    /// At which time; `None`: that of the command line, or at rest.
    pub time: Option<f64>,
    /// From where.
    pub from: Viewpoint,
    /// How.
    pub settings: Settings,
    /// Rungs of a second picture to compare with.
    pub other: Option<Knobs>,
    /// The view moves: quickly, rather than well.
    pub moving: bool,
    /// Surfaces at the pixels are wanted, too.
    pub surfaces: bool,
    /// A pixel whose ray is to be followed.
    pub picked: Option<Pick>,
    /// Code of shaders in place of what was built.
    pub code: Arc<Vec<Replacement>>,
    /// Nothing more.
    pub quit: bool,
}

impl RenderRequest {
    /// A scene of the command line, seen as it is found.
    #[must_use]
    pub fn new(settings: Settings) -> Self {
        Self {
            scene: 0,
            file: None,
            time: None,
            from: Viewpoint::Own,
            settings,
            other: None,
            moving: false,
            surfaces: false,
            picked: None,
            code: Arc::default(),
            quit: false,
        }
    }

    pub(super) fn asked(&self) -> OpenRequest<'_> {
        OpenRequest { file: self.file.as_deref(), time: self.time, size: self.settings.size }
    }

    /// Whether the same is to be drawn, however it is shown.
    #[must_use]
    pub fn is_same_picture(&self, other: &Self) -> bool {
        let marks = |w: &Self| (w.scene, w.time, w.moving, w.quit);
        let settings = |w: &Self| (w.settings.size, w.settings.environment_rotation);
        (marks(self), settings(self)) == (marks(other), settings(other))
            && self.from == other.from
            && self.settings.knobs == other.settings.knobs
            && self.other == other.other
            && Arc::ptr_eq(&self.code, &other.code)
    }

    /// Whether the same is to be seen.
    #[must_use]
    pub fn is_as(&self, other: &Self) -> bool {
        let marks = |w: &Self| (w.surfaces, w.picked, w.settings.tonemap, w.settings.exposure);
        self.is_same_picture(other) && marks(self) == marks(other)
    }
}

/// What there is to be known of a scene.
#[derive(Clone)]
pub struct SceneFacts {
    /// Which scene.
    pub scene: u64,
    /// Its time, as it was wanted.
    pub time: Option<f64>,
    /// Seconds that it lasts.
    pub duration: Option<f64>,
    /// Name.
    pub name: String,
    /// Box around it.
    pub bounds: Bounds,
    /// Where it is seen from first.
    pub home: Camera,
    /// It frames the scene: no words but its own place name it.
    pub framed: bool,
    /// Rungs that the scene is drawn with at first.
    pub knobs: Option<Knobs>,
    /// Those of the file.
    pub cameras: Vec<Camera>,
    /// Triangles, instances, lights.
    pub counts: [usize; 3],
    /// Materials.
    pub materials: Vec<Material>,
    /// Names of instances.
    pub instances: Vec<String>,
    /// Lights.
    pub lights: Vec<Light>,
    /// What was read around.
    pub warnings: Vec<String>,
    /// Prices of rungs, where they were measured.
    pub prices: Option<Arc<Table>>,
}

impl SceneFacts {
    pub(super) fn of(wanted: &RenderRequest, loaded: &Loaded) -> Result<Self> {
        let scene = loaded.original.scene();
        let bounds = scene.bounds().with_context(|| format!("{}: there is nothing to draw", loaded.name))?;
        Ok(Self {
            scene: wanted.scene,
            time: wanted.time,
            duration: scene.duration,
            name: loaded.name.clone(),
            bounds,
            home: loaded.camera.clone(),
            framed: loaded.framed,
            knobs: loaded.knobs.clone(),
            cameras: scene.cameras.clone(),
            counts: [scene.triangles(), scene.instances.len(), scene.lights.len()],
            materials: scene.materials.clone(),
            instances: scene.instances.iter().map(|instance| instance.name.clone()).collect(),
            lights: scene.lights.clone(),
            warnings: loaded.warnings.clone(),
            prices: loaded.prices.clone(),
        })
    }
}

/// A picture, perhaps under way.
#[derive(Clone)]
pub struct Shown {
    /// Counts up, over both sides.
    pub version: u64,
    /// As a display shows it.
    pub rgba: Arc<Vec<u8>>,
    /// Pixels.
    pub size: [u32; 2],
    /// Samples of so many.
    pub samples: [u32; 2],
    /// Drawn while the view moved.
    pub moving: bool,
    /// Time of the scene, as it was wanted.
    pub time: Option<f64>,
    /// Rungs that it was drawn with.
    pub knobs: Knobs,
    /// GPU time of each pass, of a sample.
    pub passes: Vec<PassTime>,
    /// Rays of a sample.
    pub rays: u64,
    /// Values that are no radiances.
    pub counts: Counts,
    /// Root of the relative mean squared error that its own samples tell; of pictures by paths.
    pub error: Option<f64>,
}

impl Shown {
    /// Whether no sample is left to be drawn, of a picture that does not move.
    #[must_use]
    pub fn is_done(&self) -> bool {
        !self.moving && self.samples[0] == self.samples[1]
    }

    /// GPU milliseconds of a sample.
    #[must_use]
    pub fn ms(&self) -> f64 {
        self.passes.iter().map(|pass| pass.ms).sum()
    }
}

/// Surfaces at the pixel centres of a picture.
#[derive(Clone)]
pub struct PixelSurfaces {
    /// Row by row.
    pub pixels: Arc<Vec<AovPixel>>,
    /// Radiance of the same pixels, of each side.
    pub radiance: Vec<Arc<Vec<[f32; 4]>>>,
    /// Pixels across and down.
    pub size: [u32; 2],
    /// What positions are relative to.
    pub eye: glam::DVec3,
    /// From where they are seen.
    pub seen_from: Camera,
    /// The pictures that they were read with.
    pub versions: [Option<u64>; 2],
}

/// One side of the window: all of it, or what is left or right of the wipe.
#[derive(Clone, Default)]
pub struct Side {
    /// The picture.
    pub shown: Option<Shown>,
    /// Every effect with its reason.
    pub effects: Arc<[Effect]>,
    /// What the plan warns of.
    pub warnings: Arc<[String]>,
}

/// How far both sides are from each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// Of which pictures.
    pub versions: [u64; 2],
    /// Mean FLIP of what is seen.
    pub flip: f64,
}

/// What a pixel's ray meets.
#[derive(Clone)]
pub struct Trace {
    /// Of which question …
    pub number: u64,
    /// … and pixel.
    pub pixel: [u32; 2],
    /// In the order in which they were found: what follows from one comes after it.
    pub events: Vec<Event>,
    /// From where it was asked.
    pub seen_from: Camera,
    /// Pixels of the picture.
    pub size: [u32; 2],
}

/// What the worker has to say.
#[derive(Clone, Default)]
pub struct RenderState {
    /// The scene.
    pub facts: Option<Arc<SceneFacts>>,
    /// The picture, and the one it is compared with.
    pub sides: [Side; 2],
    /// How far both are from each other.
    pub difference: Option<Difference>,
    /// Surfaces, where they are wanted.
    pub surfaces: Option<PixelSurfaces>,
    /// A pixel's ray, where it is wanted.
    pub trace: Option<Arc<Trace>>,
    /// What it is doing, when that takes long.
    pub busy: Option<String>,
    /// What went wrong last.
    pub error: Option<String>,
    /// A scene that could not be read: the one before stays.
    pub failed: Option<u64>,
    /// The device is gone: nothing more will be drawn.
    pub lost: bool,
}

impl RenderState {
    /// The picture.
    #[must_use]
    pub fn shown(&self) -> Option<&Shown> {
        self.sides[0].shown.as_ref()
    }

    /// Numbers of the pictures that are seen.
    #[must_use]
    pub fn versions(&self) -> [Option<u64>; 2] {
        self.sides.each_ref().map(|side| side.shown.as_ref().map(|shown| shown.version))
    }

    /// Surfaces of the pictures that are seen; `None` until they are read.
    #[must_use]
    pub fn now(&self) -> Option<&PixelSurfaces> {
        self.surfaces.as_ref().filter(|surfaces| surfaces.versions == self.versions())
    }

    /// How far the pictures that are seen are from each other.
    #[must_use]
    pub fn difference(&self) -> Option<Difference> {
        self.difference.filter(|known| known.versions.map(Some) == self.versions())
    }
}

/// What is wanted and what is seen, between two threads.
pub struct SharedState {
    pub(super) wanted: Mutex<(RenderRequest, u64)>,
    pub(super) changed: Condvar,
    pub(super) seen: Mutex<RenderState>,
}

/// Locks without caring about a panic elsewhere: what is wanted and seen is whole at any time.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl SharedState {
    /// Begins with something wanted.
    #[must_use]
    pub fn new(wanted: RenderRequest) -> Self {
        Self { wanted: Mutex::new((wanted, 1)), changed: Condvar::new(), seen: Mutex::default() }
    }

    /// Wants something else.
    pub fn want(&self, change: impl FnOnce(&mut RenderRequest)) {
        let mut wanted = lock(&self.wanted);
        change(&mut wanted.0);
        wanted.1 += 1;
        self.changed.notify_one();
    }

    /// What there is to be seen.
    #[must_use]
    pub fn seen(&self) -> RenderState {
        lock(&self.seen).clone()
    }

    /// Takes an error off the screen.
    pub fn dismiss(&self) {
        lock(&self.seen).error = None;
    }
}
