//! State shared by the window and the render thread: the window's request ([`RenderRequest`]) and the render thread's
//! results ([`RenderState`]).

use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use anyhow::{Context as _, Result};
use glam::DVec3;

use etalon::frame::Settings;
use etalon::gpu::{Device, PassTime, Replacement};
use etalon::open::Opened;
use etalon::pass::tonemap::Counts;
use etalon::plan::rungs::Colour;
use etalon::plan::{Effect, Knobs};
use etalon::prepare::Original;
use etalon::scene::{Bounds, Camera, Instance, Light, Material, Outline, Scene};
use etalon::share::AovPixel;
use etalon::transport::events::Event;
use etalon_cost::table::Table;

pub use super::choice::FileChoice;
use super::lookup::PixelTriangles;

/// A loaded scene. Clones share the large data.
#[derive(Clone)]
pub struct Loaded {
    /// Name of the scene.
    pub name: String,
    /// The scene.
    pub original: Original,
    /// Its light: the environment, and the rule by which it lights a picture.
    pub light: Arc<Opened>,
    /// Initial camera.
    pub camera: Camera,
    /// Warnings of the loader.
    pub warnings: Vec<String>,
    /// Costs of rungs, if `etalon cost` has measured this picture on this device.
    pub prices: Option<Arc<Table>>,
    /// Whether the camera was computed to frame the scene: it then depends on the size of the picture.
    pub framed: bool,
    /// Colour to start with, where the scene chooses it.
    pub colour: Option<Colour>,
    /// Exposure to start with, in stops.
    pub exposure: f32,
    /// Where that exposure comes from; one sentence. `None` where it was chosen by the user.
    pub exposure_from: Option<String>,
}

impl Loaded {
    /// A scene without environment, prices and warnings, as it is seen by a camera of its own.
    #[must_use]
    pub fn new(original: impl Into<Original>, camera: Camera) -> Self {
        let original = original.into();
        Self {
            name: original.scene().name.clone(),
            light: Arc::new(Opened::new(original.scene().clone(), None, false)),
            original,
            camera,
            warnings: Vec::new(),
            prices: None,
            framed: false,
            colour: None,
            exposure: 0.0,
            exposure_from: None,
        }
    }
}

/// Request for a scene: file, animation time and size of the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OpenRequest<'a> {
    /// Scene file; `None`: that of the command line.
    pub file: Option<&'a Path>,
    /// What of the file is shown, and what lights it.
    pub choice: &'a FileChoice,
    /// Animation time in seconds; `None`: that of the command line, or the rest pose.
    pub time: Option<f64>,
    /// Size of the picture in pixels.
    pub size: [u32; 2],
}

/// Loader of scenes.
pub trait SceneSource: Send {
    /// Reads a scene with its environment, and the costs measured on this device.
    ///
    /// # Errors
    /// One sentence with the file and the cause.
    fn open(&mut self, asked: OpenRequest<'_>, device: &Arc<Device>) -> Result<Loaded>;

    /// Reads only the scene at another animation time, with its initial camera.
    ///
    /// # Errors
    /// The errors of [`SceneSource::open`].
    fn moment(&mut self, asked: OpenRequest<'_>) -> Result<(Scene, Camera)>;
}

/// Viewpoint of the picture.
#[derive(Debug, Clone, PartialEq)]
pub enum Viewpoint {
    /// The initial camera of the scene, at the current animation time.
    Own,
    /// A camera of the file by its key, at the current animation time.
    Named(String),
    /// Any other camera.
    Free(Camera),
}

impl Viewpoint {
    /// The camera of this viewpoint.
    ///
    /// # Errors
    /// When the file no longer has a camera of that name.
    pub fn camera<'a>(&'a self, loaded: &'a Loaded) -> Result<&'a Camera> {
        match self {
            Self::Own => Ok(&loaded.camera),
            Self::Free(camera) => Ok(camera),
            Self::Named(name) => loaded
                .original
                .scene()
                .camera(name)
                .with_context(|| format!("{}: the scene has no camera \"{name}\"", loaded.name)),
        }
    }
}

/// A pixel to inspect.
#[derive(Debug, Clone, PartialEq)]
pub struct Pick {
    /// Number of the inspection; a new number inspects again.
    pub number: u64,
    /// Column and row.
    pub pixel: [u32; 2],
    /// Size of the picture in pixels.
    pub size: [u32; 2],
    /// Camera of the picture.
    pub seen_from: Camera,
}

/// What the window asks the render thread to draw.
#[derive(Clone)]
pub struct RenderRequest {
    /// Number of the scene; a new number loads a scene.
    pub scene: u64,
    /// Scene file; `None`: that of the command line.
    pub file: Option<PathBuf>,
    /// What of the file is shown, and what lights it; a change counts with a new number of the scene.
    pub choice: FileChoice,
    /// Animation time in seconds; `None`: that of the command line, or the rest pose.
    pub time: Option<f64>,
    /// Viewpoint.
    pub from: Viewpoint,
    /// Settings of the renderer.
    pub settings: Settings,
    /// Knobs of a second picture for comparison.
    pub other: Option<Knobs>,
    /// Whether the view moves: the picture is then drawn small, with one sample.
    pub moving: bool,
    /// Whether to read the surfaces at the pixels.
    pub surfaces: bool,
    /// Pixel whose ray is traced.
    pub picked: Option<Pick>,
    /// Number of a metering of the picture; a new number meters again.
    pub meter: u64,
    /// Whether to look up the triangles at the pixels.
    pub triangles: bool,
    /// Shader code that replaces built code.
    pub code: Arc<Vec<Replacement>>,
    /// Ends the render thread.
    pub quit: bool,
}

impl RenderRequest {
    /// Request for the scene of the command line from its initial camera.
    #[must_use]
    pub fn new(settings: Settings) -> Self {
        Self {
            scene: 0,
            file: None,
            choice: FileChoice::default(),
            time: None,
            from: Viewpoint::Own,
            settings,
            other: None,
            moving: false,
            surfaces: false,
            picked: None,
            meter: 0,
            triangles: false,
            code: Arc::default(),
            quit: false,
        }
    }

    pub(super) fn asked(&self) -> OpenRequest<'_> {
        OpenRequest { file: self.file.as_deref(), choice: &self.choice, time: self.time, size: self.settings.size }
    }

    /// The request for one side alone.
    #[must_use]
    pub fn of_side(&self, index: usize) -> Self {
        let mut alone = self.clone();
        if let (Some(knobs), 1) = (alone.other.take(), index) {
            alone.settings.knobs = knobs;
        }
        alone
    }

    /// Whether both requests draw the same picture; display settings may differ.
    #[must_use]
    pub fn is_same_picture(&self, other: &Self) -> bool {
        (self.moving, self.quit) == (other.moving, other.quit) && self.is_same_view(other)
    }

    /// Whether both requests draw the same picture once nothing moves; display settings may differ.
    #[must_use]
    pub fn is_same_view(&self, other: &Self) -> bool {
        let marks = |w: &Self| (w.scene, w.time);
        let settings = |w: &Self| {
            let Settings { size, environment_rotation, environment_intensity, background, background_blur, .. } =
                w.settings;
            (size, environment_rotation, environment_intensity, background, background_blur)
        };
        (marks(self), settings(self)) == (marks(other), settings(other))
            && self.from == other.from
            && self.settings.knobs == other.settings.knobs
            && self.other == other.other
            && Arc::ptr_eq(&self.code, &other.code)
    }

    /// Whether both requests draw and show the same.
    #[must_use]
    pub fn is_as(&self, other: &Self) -> bool {
        let marks = |w: &Self| {
            let picked = w.picked.as_ref().map(|picked| picked.number);
            (w.surfaces, w.triangles, picked, w.meter, w.settings.tonemap, w.settings.exposure)
        };
        self.is_same_picture(other) && marks(self) == marks(other)
    }
}

/// Facts of a scene for the panels.
#[derive(Clone)]
pub struct SceneFacts {
    /// Number of the scene.
    pub scene: u64,
    /// Requested animation time.
    pub time: Option<f64>,
    /// Duration of the animation in seconds; `None` where nothing moves.
    pub duration: Option<f64>,
    /// Name of the scene.
    pub name: String,
    /// Bounding box.
    pub bounds: Bounds,
    /// Initial camera.
    pub home: Camera,
    /// Aspect ratio that the initial camera was computed for, to frame the scene; a command must then give it by eye
    /// and target. `None` for other cameras.
    pub framed: Option<f64>,
    /// Colour to start with, where the scene chooses it.
    pub colour: Option<Colour>,
    /// Exposure to start with, in stops.
    pub exposure: f32,
    /// Where that exposure comes from; one sentence.
    pub exposure_from: Option<String>,
    /// What was chosen of the file.
    pub choice: FileChoice,
    /// Cameras of the file.
    pub cameras: Vec<Camera>,
    /// The word that chooses each camera.
    pub camera_keys: Vec<String>,
    /// Numbers of triangles, instances and lights.
    pub counts: [usize; 3],
    /// Materials.
    pub materials: Vec<Material>,
    /// Names of instances.
    pub instances: Vec<String>,
    /// Lights.
    pub lights: Vec<Light>,
    /// Warnings of the loader.
    pub warnings: Vec<String>,
    /// Costs of rungs, if they were measured.
    pub prices: Option<Arc<Table>>,
    /// What the file contains.
    pub outline: Outline,
    /// Box of each instance in world space.
    pub boxes: Vec<Bounds>,
    /// Name, and width and height in pixels, of each image.
    pub images: Vec<(String, [u32; 2])>,
    /// Number of vertices over all meshes.
    pub vertices: usize,
    /// Its light.
    pub light: Arc<Opened>,
}

impl SceneFacts {
    /// Settings without a blur of what is not shown.
    #[must_use]
    pub fn without_idle_blur(&self, settings: Settings) -> Settings {
        let is_lit = self.light.lit(settings.clone()).0.is_some();
        settings.without_idle_blur(is_lit)
    }

    /// The camera of the file with a key.
    #[must_use]
    pub fn camera(&self, key: &str) -> Option<&Camera> {
        self.camera_keys.iter().position(|known| known == key).map(|index| &self.cameras[index])
    }

    /// Box of a node with everything below it; `None` where nothing of it is drawn.
    #[must_use]
    pub fn bounds_of(&self, node: usize) -> Option<Bounds> {
        self.outline.nodes.get(node)?;
        let boxes = self.outline.instances_within(node).into_iter().filter_map(|index| self.boxes.get(index).copied());
        let all = boxes.reduce(|a, b| Bounds { min: a.min.min(b.min), max: a.max.max(b.max) });
        all.filter(|bounds| bounds.min.is_finite() && bounds.max.is_finite())
    }

    /// Facts of a loaded scene.
    ///
    /// # Errors
    /// When the scene has nothing to draw.
    pub fn of(wanted: &RenderRequest, loaded: &Loaded) -> Result<Self> {
        let scene = loaded.original.scene();
        let bounds = scene.bounds().with_context(|| format!("{}: the scene has nothing to draw", loaded.name))?;
        let [width, height] = wanted.settings.size;
        Ok(Self {
            scene: wanted.scene,
            time: wanted.time,
            // What takes no time cannot be played.
            duration: scene.duration.filter(|duration| *duration > 0.0),
            name: loaded.name.clone(),
            bounds,
            home: loaded.camera.clone(),
            framed: loaded.framed.then(|| f64::from(width) / f64::from(height)),
            colour: loaded.colour,
            exposure: loaded.exposure,
            exposure_from: loaded.exposure_from.clone(),
            choice: wanted.choice.clone(),
            cameras: scene.cameras.clone(),
            camera_keys: scene.camera_keys(),
            counts: [scene.triangles(), scene.instances.len(), scene.lights.len()],
            materials: scene.materials.clone(),
            instances: scene.instances.iter().map(|instance| instance.name.clone()).collect(),
            lights: scene.lights.clone(),
            warnings: loaded.warnings.clone(),
            prices: loaded.prices.clone(),
            outline: scene.outline.clone(),
            boxes: scene.instances.iter().map(|instance| box_of(scene, instance)).collect(),
            images: scene.images.iter().map(|image| (image.name.clone(), [image.width, image.height])).collect(),
            vertices: scene.meshes.iter().map(|mesh| mesh.positions.len()).sum(),
            light: loaded.light.clone(),
        })
    }
}

/// Box of an instance in world space: that of the corners of its mesh's box.
fn box_of(scene: &Scene, instance: &Instance) -> Bounds {
    let empty = Bounds { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };
    let add = |b: Bounds, p: DVec3| Bounds { min: b.min.min(p), max: b.max.max(p) };
    let positions = scene.meshes[instance.mesh].positions.iter().map(|p| glam::Vec3::from(*p).as_dvec3());
    let local = positions.filter(|p| p.is_finite()).fold(empty, add);
    let corners = local.corners().map(|corner| instance.world_from_object.transform_point3(corner));
    corners.into_iter().filter(|p| p.is_finite()).fold(empty, add)
}

/// A picture, finished or in progress.
#[derive(Clone)]
pub struct Shown {
    /// Version, which counts up over both sides.
    pub version: u64,
    /// Display values, RGBA8 with straight alpha.
    pub rgba: Arc<Vec<u8>>,
    /// The same over squares of grey where pixels are transparent.
    pub opaque: Arc<Vec<u8>>,
    /// Whether pixels may be transparent.
    pub has_alpha: bool,
    /// Size in pixels.
    pub size: [u32; 2],
    /// The request that it answers; `None` for a picture with rungs of before, where those that are asked for cannot be
    /// drawn.
    pub of: Option<RenderRequest>,
    /// Samples drawn, and samples in total.
    pub samples: [u32; 2],
    /// Whether it was drawn while the view moved.
    pub moving: bool,
    /// Requested animation time.
    pub time: Option<f64>,
    /// Knobs of the picture.
    pub knobs: Knobs,
    /// GPU time of each pass, per sample.
    pub passes: Vec<PassTime>,
    /// Rays per sample.
    pub rays: u64,
    /// Counts of NaN, infinite and negative pixels.
    pub counts: Counts,
    /// Estimated relative error (root of the relative mean squared error); only of path tracing.
    pub error: Option<f64>,
    /// Seconds until the last sample, at the pace so far.
    pub seconds_left: f64,
    /// Fraction of the pixels with a channel at its largest value.
    pub clipped: f32,
}

impl Shown {
    /// Whether all samples are drawn and the view does not move.
    #[must_use]
    pub fn is_done(&self) -> bool {
        !self.moving && self.samples[0] == self.samples[1]
    }

    /// GPU milliseconds per sample.
    #[must_use]
    pub fn ms(&self) -> f64 {
        self.passes.iter().map(|pass| pass.ms).sum()
    }
}

/// Surfaces at the pixel centres of a picture.
#[derive(Clone)]
pub struct PixelSurfaces {
    /// Surfaces, row by row.
    pub pixels: Arc<Vec<AovPixel>>,
    /// Radiance of the same pixels, for each side.
    pub radiance: Vec<Arc<Vec<[f32; 4]>>>,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Eye position, which positions are relative to.
    pub eye: glam::DVec3,
    /// Camera of the picture.
    pub seen_from: Camera,
    /// Versions of the pictures that they were read with.
    pub versions: [Option<u64>; 2],
}

/// One side of the window: the whole picture, or the part left or right of the wipe line.
#[derive(Clone, Default)]
pub struct Side {
    /// The picture.
    pub shown: Option<Shown>,
    /// Every effect with its reason.
    pub effects: Arc<[Effect]>,
    /// What lights the picture; one sentence.
    pub lit_by: Option<String>,
    /// Warnings of the plan.
    pub warnings: Arc<[String]>,
    /// Why it is not drawn as it is asked for, or not to its end; `None` where it is.
    pub refused: Option<String>,
}

/// Difference between both sides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// Versions of the compared pictures.
    pub versions: [u64; 2],
    /// Mean FLIP error of the display values.
    pub flip: f64,
}

/// Events along the ray of an inspected pixel.
#[derive(Clone)]
pub struct Trace {
    /// Number of the inspection.
    pub number: u64,
    /// Inspected pixel.
    pub pixel: [u32; 2],
    /// Events in the order in which they were found; an event comes after the event that it follows from.
    pub events: Vec<Event>,
    /// Camera at the time of the inspection.
    pub seen_from: Camera,
    /// Size of the picture in pixels.
    pub size: [u32; 2],
}

/// Results of the render thread.
#[derive(Clone, Default)]
pub struct RenderState {
    /// The scene.
    pub facts: Option<Arc<SceneFacts>>,
    /// The picture, and the picture it is compared with.
    pub sides: [Side; 2],
    /// Difference between both sides.
    pub difference: Option<Difference>,
    /// Surfaces, if requested.
    pub surfaces: Option<PixelSurfaces>,
    /// Triangles at the pixels, if requested.
    pub triangles: Option<PixelTriangles>,
    /// Number of the last metering, and the exposure in stops that it found; `None` where the picture is black.
    pub metered: Option<(u64, Option<f32>)>,
    /// Ray of the inspected pixel, if requested.
    pub trace: Option<Arc<Trace>>,
    /// Current long operation.
    pub busy: Option<String>,
    /// Last error.
    pub error: Option<String>,
    /// Number of a scene that could not be read; the previous scene stays.
    pub failed: Option<u64>,
    /// Whether the device was lost; nothing more will be drawn.
    pub lost: bool,
}

impl RenderState {
    /// The picture.
    #[must_use]
    pub fn shown(&self) -> Option<&Shown> {
        self.sides[0].shown.as_ref()
    }

    /// Versions of the shown pictures.
    #[must_use]
    pub fn versions(&self) -> [Option<u64>; 2] {
        self.sides.each_ref().map(|side| side.shown.as_ref().map(|shown| shown.version))
    }

    /// Surfaces of the shown pictures; `None` until they are read.
    #[must_use]
    pub fn now(&self) -> Option<&PixelSurfaces> {
        self.surfaces.as_ref().filter(|surfaces| surfaces.versions == self.versions())
    }

    /// Difference between the shown pictures; `None` until they are compared.
    #[must_use]
    pub fn difference(&self) -> Option<Difference> {
        self.difference.filter(|known| known.versions.map(Some) == self.versions())
    }
}

/// Request and results, shared by two threads.
pub struct SharedState {
    pub(super) wanted: Mutex<(RenderRequest, u64)>,
    pub(super) changed: Condvar,
    pub(super) seen: Mutex<RenderState>,
}

/// Locks a mutex and ignores poisoning: request and results are consistent at any time.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl SharedState {
    /// Starts with a request.
    #[must_use]
    pub fn new(wanted: RenderRequest) -> Self {
        let shared = Self::waiting(wanted);
        shared.want(|_| {});
        shared
    }

    /// Holds a request; the render thread waits until it is changed.
    #[must_use]
    pub fn waiting(wanted: RenderRequest) -> Self {
        Self { wanted: Mutex::new((wanted, 0)), changed: Condvar::new(), seen: Mutex::default() }
    }

    /// Changes the request and wakes the render thread.
    pub fn want(&self, change: impl FnOnce(&mut RenderRequest)) {
        let mut wanted = lock(&self.wanted);
        change(&mut wanted.0);
        wanted.1 += 1;
        self.changed.notify_one();
    }

    /// A copy of the results.
    #[must_use]
    pub fn seen(&self) -> RenderState {
        lock(&self.seen).clone()
    }

    /// Clears the last error.
    pub fn dismiss(&self) {
        lock(&self.seen).error = None;
    }
}

#[cfg(test)]
mod tests {
    use etalon::plan::Model;

    use super::*;

    #[test]
    fn a_side_is_asked_for_by_its_own_knobs() {
        let alone = RenderRequest::new(Settings::default());
        let both = RenderRequest { other: Some(Knobs::exact()), ..alone.clone() };
        assert!(!both.is_same_view(&alone));
        assert!(both.of_side(0).is_same_view(&alone), "the left side is drawn already");
        assert!(!both.of_side(1).is_same_view(&alone));
        let mut turned = both.clone();
        turned.settings.knobs = Knobs::of(Model::Local);
        assert!(turned.of_side(1).is_same_view(&both.of_side(1)), "the right side is drawn already");
        assert!(!turned.of_side(0).is_same_view(&both.of_side(0)));
    }
}
