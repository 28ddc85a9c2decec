//! The thread that loads and draws: it looks at what is wanted before each sample, and shows what it has after some.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result};

use crate::cost::table::Table;
use crate::frame::{Drawing, Renderer, Settings};
use crate::gpu::{Device, DeviceInfo, PassTime, is_lost};
use crate::pass::tonemap::Counts;
use crate::plan::{Effect, Knobs};
use crate::scene::environment::Environment;
use crate::scene::{Bounds, Camera, Material, Scene};
use crate::share::AovPixel;

/// Milliseconds that a picture may take while the view moves: it gets smaller until it does.
const MOVING_MS: f64 = 40.0;
/// Sides of pictures while the view moves: the window's over one of these.
const SMALLER: [u32; 6] = [1, 2, 3, 4, 6, 8];
/// Between two looks at a picture under way.
const LOOK: Duration = Duration::from_millis(100);

/// A scene as it comes out of a file.
pub struct Loaded {
    /// Its name.
    pub name: String,
    /// The scene.
    pub scene: Scene,
    /// What lights it from all around, and how strongly.
    pub environment: Option<(Environment, f32)>,
    /// The camera that it begins with, and those of the file.
    pub camera: Camera,
    /// What was read around.
    pub warnings: Vec<String>,
    /// Prices of rungs, where they were measured on this device.
    pub prices: Option<Table>,
    /// The camera frames the scene for a size: for another it is another.
    pub framed: bool,
    /// Rungs that it is drawn with where nobody chose others.
    pub knobs: Option<Knobs>,
}

/// Reads a scene for pictures of a size on a device: the one of the command line, or another file.
pub type Open = Box<dyn Fn(Option<&Path>, [u32; 2], &DeviceInfo) -> Result<Loaded> + Send>;

/// What is to be seen.
#[derive(Clone)]
pub struct Wanted {
    /// Another number: another scene.
    pub scene: u64,
    /// Its file; `None`: that of the command line.
    pub file: Option<PathBuf>,
    /// From where; `None`: the scene's own.
    pub camera: Option<Camera>,
    /// How.
    pub settings: Settings,
    /// The view moves: quickly, rather than well.
    pub moving: bool,
    /// Surfaces at the pixels are wanted, too.
    pub surfaces: bool,
    /// Nothing more.
    pub quit: bool,
}

/// What there is to be known of a scene.
#[derive(Clone)]
pub struct SceneFacts {
    /// Which scene.
    pub scene: u64,
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
    pub materials: Arc<Vec<Material>>,
    /// Names of instances.
    pub instances: Arc<Vec<String>>,
    /// What was read around.
    pub warnings: Vec<String>,
    /// Prices of rungs, where they were measured.
    pub prices: Option<Arc<Table>>,
}

/// A picture, perhaps under way.
#[derive(Clone)]
pub struct Shown {
    /// Counts up.
    pub version: u64,
    /// As a display shows it.
    pub rgba: Arc<Vec<u8>>,
    /// Pixels.
    pub size: [u32; 2],
    /// Samples of so many.
    pub samples: [u32; 2],
    /// Drawn while the view moved.
    pub moving: bool,
    /// GPU time of each pass, of a sample.
    pub passes: Vec<PassTime>,
    /// Values that are no radiances.
    pub counts: Counts,
}

/// Surfaces at the pixel centres of a picture.
#[derive(Clone)]
pub struct Surfaces {
    /// Row by row.
    pub pixels: Arc<Vec<AovPixel>>,
    /// Radiance of the same pixels.
    pub radiance: Arc<Vec<[f32; 4]>>,
    /// Pixels across and down.
    pub size: [u32; 2],
    /// What positions are relative to.
    pub eye: glam::DVec3,
    /// The picture that they were read with.
    pub version: u64,
}

/// What the worker has to say.
#[derive(Clone, Default)]
pub struct Seen {
    /// The scene.
    pub facts: Option<SceneFacts>,
    /// The picture.
    pub shown: Option<Shown>,
    /// Every effect with its reason.
    pub effects: Vec<Effect>,
    /// What the plan warns of.
    pub warnings: Vec<String>,
    /// Surfaces, where they are wanted.
    pub surfaces: Option<Surfaces>,
    /// What it is doing, when that takes long.
    pub busy: Option<String>,
    /// What went wrong last.
    pub error: Option<String>,
    /// A scene that could not be read: the one before stays.
    pub failed: Option<u64>,
    /// The device is gone: nothing more will be drawn.
    pub lost: bool,
}

impl Seen {
    /// Surfaces of the picture that is seen; `None` until they are read.
    #[must_use]
    pub fn now(&self) -> Option<&Surfaces> {
        let version = self.shown.as_ref().map(|shown| shown.version);
        self.surfaces.as_ref().filter(|surfaces| Some(surfaces.version) == version)
    }
}

/// What is wanted and what is seen, between two threads.
pub struct Shared {
    wanted: Mutex<(Wanted, u64)>,
    changed: Condvar,
    seen: Mutex<Seen>,
}

/// Locks without caring about a panic elsewhere: what is wanted and seen is whole at any time.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    /// Begins with something wanted.
    #[must_use]
    pub fn new(wanted: Wanted) -> Self {
        Self { wanted: Mutex::new((wanted, 1)), changed: Condvar::new(), seen: Mutex::default() }
    }

    /// Wants something else.
    pub fn want(&self, change: impl FnOnce(&mut Wanted)) {
        let mut wanted = lock(&self.wanted);
        change(&mut wanted.0);
        wanted.1 += 1;
        self.changed.notify_one();
    }

    /// What there is to be seen.
    #[must_use]
    pub fn seen(&self) -> Seen {
        lock(&self.seen).clone()
    }

    /// Takes an error off the screen.
    pub fn dismiss(&self) {
        lock(&self.seen).error = None;
    }
}

/// The scene and its renderer.
struct Stage {
    scene: u64,
    loaded: Loaded,
    renderer: Renderer,
    /// Of the renderer.
    settings: Settings,
    /// Those that could not be drawn: they are not tried again.
    refused: Option<Settings>,
}

impl Stage {
    fn lit(&self, settings: &Settings) -> Settings {
        lit(&self.loaded, settings)
    }
}

/// Settings with the environment as strong as the scene says.
fn lit(loaded: &Loaded, settings: &Settings) -> Settings {
    let share = loaded.environment.as_ref().map_or(1.0, |(_, share)| *share);
    Settings { environment_intensity: settings.environment_intensity * share, ..settings.clone() }
}

fn renderer(device: &Arc<Device>, loaded: &Loaded, settings: Settings) -> Result<Renderer> {
    let environment = loaded.environment.as_ref().map(|(environment, _)| environment);
    Renderer::new(device, loaded.scene.clone(), environment, settings)
}

/// Whether a renderer for the one draws the other as well.
fn same_renderer(a: &Settings, b: &Settings) -> bool {
    a.knobs == b.knobs
        && a.background == b.background
        && a.environment_intensity == b.environment_intensity
        && a.environment_rotation == b.environment_rotation
        && a.seed == b.seed
        && a.demand == b.demand
}

/// What a worker goes through.
pub struct Worker {
    device: Arc<Device>,
    shared: Arc<Shared>,
    open: Open,
    wake: Box<dyn Fn() + Send>,
    stage: Option<Stage>,
    version: u64,
    /// Wall nanoseconds of a pixel of a sample.
    ns_per_pixel: f64,
}

impl Worker {
    /// Loads and draws until nothing more is wanted.
    pub fn run(device: Arc<Device>, shared: Arc<Shared>, open: Open, wake: Box<dyn Fn() + Send>) {
        let mut worker = Self { device, shared, open, wake, stage: None, version: 0, ns_per_pixel: 0.0 };
        let mut drawing: Option<Drawing> = None;
        let (mut known, mut looked) = (0, Instant::now());
        let mut last: Option<Wanted> = None;
        loop {
            let (wanted, number) = {
                let mut wanted = lock(&worker.shared.wanted);
                let idle = |drawing: &Option<Drawing>| drawing.as_ref().is_none_or(Drawing::is_done);
                while wanted.1 == known && idle(&drawing) {
                    wanted = worker.shared.changed.wait(wanted).unwrap_or_else(PoisonError::into_inner);
                }
                wanted.clone()
            };
            if wanted.quit {
                return;
            }
            let result = if number == known {
                worker.refine(&wanted, &mut drawing, &mut looked)
            } else {
                known = number;
                looked = Instant::now();
                worker.begin(&wanted, last.as_ref(), &mut drawing)
            };
            last = Some(wanted);
            if let Err(error) = result {
                drawing = None;
                let lost = is_lost(&error);
                worker.say(|seen| {
                    seen.error = Some(format!("{error:#}"));
                    seen.lost |= lost;
                });
                if lost {
                    return;
                }
            }
        }
    }

    fn say(&self, change: impl FnOnce(&mut Seen)) {
        change(&mut lock(&self.shared.seen));
        (self.wake)();
    }

    /// Something else is wanted.
    fn begin(&mut self, wanted: &Wanted, last: Option<&Wanted>, drawing: &mut Option<Drawing>) -> Result<()> {
        let here = self.stage.as_ref().map(|stage| stage.scene);
        if here != Some(wanted.scene) && last.map(|last| last.scene) != Some(wanted.scene) {
            *drawing = None;
            self.load(wanted)?;
        }
        let Some(stage) = &mut self.stage else { return Ok(()) };
        let settings = stage.lit(&wanted.settings);
        let ready = same_renderer(&stage.settings, &settings);
        let refused = stage.refused.as_ref().is_some_and(|r| r.size == settings.size && same_renderer(r, &settings));
        if ready && stage.refused.take().is_some() {
            self.say(|seen| seen.error = None);
        } else if !ready && !refused {
            *drawing = None;
            self.plan(settings.clone())?;
        }
        let Some(stage) = &mut self.stage else { return Ok(()) };
        let renderer = &mut stage.renderer;
        let size = if wanted.moving { smaller(settings.size, self.ns_per_pixel) } else { settings.size };
        let all = stage.settings.knobs.samples();
        let samples = if wanted.moving { 1 } else { all };
        let developed = (stage.settings.tonemap, stage.settings.exposure) != (settings.tonemap, settings.exposure);
        (stage.settings.tonemap, stage.settings.exposure) = (settings.tonemap, settings.exposure);
        renderer.develop(settings.tonemap, settings.exposure);
        if stage.settings.size != size {
            *drawing = None;
            // There is room for the sum of all samples, however many are drawn.
            renderer.plan.samples = all;
            renderer.resize(size)?;
            stage.settings.size = size;
        }
        let camera = wanted.camera.as_ref().unwrap_or(&stage.loaded.camera);
        let seen_from =
            |wanted: &Wanted| wanted.camera.as_ref().map(|camera| (camera.world_from_camera, camera.projection));
        let same_view = last.is_some_and(|last| seen_from(last) == seen_from(wanted) && last.moving == wanted.moving);
        if !same_view || drawing.is_none() || renderer.plan.samples != samples {
            renderer.plan.samples = samples;
            *drawing = Some(renderer.begin(camera));
        } else if developed && drawing.as_ref().is_some_and(Drawing::is_whole) {
            self.show(wanted, drawing.as_ref())?;
        }
        if wanted.surfaces && !wanted.moving && drawing.as_ref().is_some_and(Drawing::is_done) {
            self.read_surfaces(wanted)?;
        }
        Ok(())
    }

    /// Reads a scene and makes ready to draw it; what cannot be read, or drawn, leaves the one before.
    fn load(&mut self, wanted: &Wanted) -> Result<()> {
        let name = wanted.file.as_ref().map_or("the scene".to_owned(), |file| file.display().to_string());
        self.say(|seen| seen.busy = Some(format!("reading {name}")));
        let loaded = (self.open)(wanted.file.as_deref(), wanted.settings.size, self.device.info());
        let found = loaded.and_then(|loaded| {
            self.say(|seen| seen.busy = Some("uploading and compiling".to_owned()));
            self.ready(wanted, loaded)
        });
        self.say(|seen| {
            seen.busy = None;
            seen.failed = found.is_err().then_some(wanted.scene);
        });
        let (stage, facts) = found?;
        self.tell_plan(&stage.renderer);
        self.ns_per_pixel = 0.0;
        self.stage = Some(stage);
        self.say(|seen| {
            seen.facts = Some(facts);
            seen.surfaces = None;
            seen.error = None;
        });
        Ok(())
    }

    /// A scene with its renderer, and what there is to be known of it.
    fn ready(&self, wanted: &Wanted, mut loaded: Loaded) -> Result<(Stage, SceneFacts)> {
        let scene = &loaded.scene;
        let bounds = scene.bounds().with_context(|| format!("{}: there is nothing to draw", loaded.name))?;
        let facts = SceneFacts {
            scene: wanted.scene,
            name: loaded.name.clone(),
            bounds,
            home: loaded.camera.clone(),
            framed: loaded.framed,
            knobs: loaded.knobs.clone(),
            cameras: scene.cameras.clone(),
            counts: [scene.triangles(), scene.instances.len(), scene.lights.len()],
            materials: Arc::new(scene.materials.clone()),
            instances: Arc::new(scene.instances.iter().map(|instance| instance.name.clone()).collect()),
            warnings: loaded.warnings.clone(),
            prices: loaded.prices.take().map(Arc::new),
        };
        let settings = lit(&loaded, &wanted.settings);
        let renderer = renderer(&self.device, &loaded, settings.clone())?;
        Ok((Stage { scene: wanted.scene, loaded, renderer, settings, refused: None }, facts))
    }

    /// Plans and uploads for other rungs; those that cannot be drawn leave what is there.
    fn plan(&mut self, settings: Settings) -> Result<()> {
        self.say(|seen| seen.busy = Some("uploading and compiling".to_owned()));
        let Some(stage) = &mut self.stage else { return Ok(()) };
        let made = renderer(&self.device, &stage.loaded, settings.clone());
        let made = match made {
            Ok(renderer) => {
                (stage.renderer, stage.settings, stage.refused) = (renderer, settings, None);
                Ok(())
            }
            Err(error) => {
                stage.refused = Some(settings);
                Err(error)
            }
        };
        // Other rungs take other times: the next sample tells.
        self.ns_per_pixel = 0.0;
        self.say(|seen| {
            seen.busy = None;
            seen.error = None;
        });
        made?;
        if let Some(stage) = &self.stage {
            self.tell_plan(&stage.renderer);
        }
        Ok(())
    }

    fn tell_plan(&self, renderer: &Renderer) {
        let warnings = [renderer.plan.warnings.clone(), renderer.warnings.clone()].concat();
        self.say(|seen| (seen.effects, seen.warnings) = (renderer.plan.effects.clone(), warnings));
    }

    /// One more sample.
    fn refine(&mut self, wanted: &Wanted, drawing: &mut Option<Drawing>, looked: &mut Instant) -> Result<()> {
        let (Some(stage), Some(under_way)) = (&mut self.stage, drawing.as_mut()) else { return Ok(()) };
        let renderer = &mut stage.renderer;
        let begun = Instant::now();
        let before = under_way.samples();
        renderer.step(under_way)?;
        let took = begun.elapsed();
        let [width, height] = stage.settings.size;
        if under_way.samples() == before {
            return Ok(());
        }
        // The first sample compiles; what is quicker is believed at once.
        let ns = took.as_secs_f64() * 1e9 / f64::from(width) / f64::from(height);
        let known = self.ns_per_pixel;
        self.ns_per_pixel = if known == 0.0 || ns < known { ns } else { known + 0.2 * (ns - known) };
        if under_way.is_done() || under_way.samples() == 1 || looked.elapsed() >= LOOK {
            *looked = Instant::now();
            let done = under_way.is_done();
            self.show(wanted, drawing.as_ref())?;
            if done && wanted.surfaces && !wanted.moving {
                self.read_surfaces(wanted)?;
            }
        }
        Ok(())
    }

    fn show(&mut self, wanted: &Wanted, drawing: Option<&Drawing>) -> Result<()> {
        let (Some(stage), Some(drawing)) = (&mut self.stage, drawing) else { return Ok(()) };
        let renderer = &mut stage.renderer;
        let rendered = renderer.picture(drawing)?;
        self.version += 1;
        let each = f64::from(rendered.samples.max(1));
        let shown = Shown {
            version: self.version,
            rgba: Arc::new(rendered.display),
            size: stage.settings.size,
            samples: [rendered.samples, renderer.plan.samples],
            moving: wanted.moving,
            passes: rendered.passes.into_iter().map(|pass| PassTime { ms: pass.ms / each, ..pass }).collect(),
            counts: rendered.counts,
        };
        self.say(|seen| seen.shown = Some(shown));
        Ok(())
    }

    fn read_surfaces(&mut self, wanted: &Wanted) -> Result<()> {
        let Some(stage) = &mut self.stage else { return Ok(()) };
        let renderer = &mut stage.renderer;
        let camera = wanted.camera.as_ref().unwrap_or(&stage.loaded.camera);
        let radiance = renderer.film()?.rgba;
        let (pixels, view) = renderer.aovs(camera)?;
        let surfaces = Surfaces {
            pixels: Arc::new(pixels),
            radiance: Arc::new(radiance),
            size: stage.settings.size,
            eye: view.eye,
            version: self.version,
        };
        self.say(|seen| seen.surfaces = Some(surfaces));
        Ok(())
    }
}

/// The largest of some sizes that takes no longer than a picture may while the view moves.
fn smaller(size: [u32; 2], ns_per_pixel: f64) -> [u32; 2] {
    let pixels = f64::from(size[0]) * f64::from(size[1]);
    let takes = |by: u32| ns_per_pixel * 1e-6 * pixels / f64::from(by * by);
    let by = SMALLER.into_iter().find(|&by| takes(by) <= MOVING_MS).unwrap_or(SMALLER[SMALLER.len() - 1]);
    size.map(|side| side.div_ceil(by).max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_get_smaller_until_they_are_quick() {
        assert_eq!(smaller([1280, 720], 0.0), [1280, 720]);
        assert_eq!(smaller([1280, 720], 40.0), [1280, 720]);
        // 92 ms whole, 23 at half the side.
        assert_eq!(smaller([1280, 720], 100.0), [640, 360]);
        assert_eq!(smaller([1281, 721], 1e6), [161, 91]);
        assert_eq!(smaller([3, 1], 1e9), [1, 1]);
    }
}
