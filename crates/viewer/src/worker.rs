//! The render thread: loads scenes and draws progressively. Before each sample it reads the request of the window;
//! after some samples it publishes the picture.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result};

use super::lookup::{PixelTriangles, triangles};
use super::shared::{
    Difference, Loaded, Pick, PixelSurfaces, RenderRequest, RenderState, SceneFacts, SceneSource, SharedState, Shown,
    Trace, lock,
};
use etalon::frame::{Drawing, Renderer, Settings};
use etalon::gpu::{Device, Interrupted, PassTime, Replacement, is_lost};
use etalon::image::meter::Meter;
use etalon::image::metric::{AnyPicture, Metric, compare};
use etalon::image::png::{Display, over};
use etalon::plan::Knobs;
use etalon::plan::rungs::{Indirect, Lights, Reflection, Refraction};
use etalon::scene::environment::Environment;
use etalon::transport::events::{EventTracer, Limits};

/// Time limit in milliseconds for a picture while the view moves; the resolution is reduced until the picture keeps it.
const MOVING_MS: f64 = 40.0;
/// Divisors of the width and height while the view moves.
const SMALLER: [u32; 6] = [1, 2, 3, 4, 6, 8];
/// Divisor while the time per pixel is unknown.
const UNKNOWN: u32 = 4;
/// Least time between two publications of a picture in progress.
const LOOK: Duration = Duration::from_millis(100);
/// Display values of the squares behind transparent pixels, and their side in pixels.
const GREYS: [u8; 2] = [102, 153];
const SQUARE: u32 = 8;
/// Fraction of a pixel's light below which its ray is not traced further.
const LEAST_SHARE: f64 = 0.002;

/// Renderer of one side of the window.
struct DrawnSide {
    renderer: Renderer,
    /// Settings of the renderer.
    settings: Settings,
    drawing: Option<Drawing>,
    /// Time spent on the current sample so far.
    spent: Duration,
    looked: Instant,
}

impl DrawnSide {
    fn new(device: &Arc<Device>, loaded: &Loaded, wanted: &RenderRequest, index: usize) -> Result<Self> {
        let (environment, settings) = lit(loaded, wanted, index);
        let renderer = Renderer::new(device, &loaded.original, environment, settings.clone())?;
        Ok(Self { renderer, settings, drawing: None, spent: Duration::ZERO, looked: Instant::now() })
    }

    fn is_done(&self) -> bool {
        self.drawing.as_ref().is_none_or(Drawing::is_done)
    }

    /// Fraction of the samples that are drawn.
    fn progress(&self) -> f64 {
        self.drawing.as_ref().map_or(0.0, |drawing| f64::from(drawing.samples()) / f64::from(drawing.of().max(1)))
    }
}

/// The loaded scene with its renderers.
struct LoadedRenderers {
    scene: u64,
    time: Option<f64>,
    loaded: Loaded,
    sides: Vec<DrawnSide>,
    /// Wall nanoseconds per pixel and sample for each side; 0 while unknown.
    ns_per_pixel: [f64; 2],
    /// Settings that could not be drawn and are not tried again.
    refused: [Option<Settings>; 2],
    /// Tracer for inspected pixels, made at the first inspection.
    tracer: Option<EventTracer>,
}

impl LoadedRenderers {
    /// Takes the tracer, or makes it.
    fn tracer(&mut self) -> Result<EventTracer> {
        if let Some(tracer) = self.tracer.take() {
            return Ok(tracer);
        }
        let bvh = self.loaded.original.bvh().context("tracing the ray of a pixel")?;
        Ok(EventTracer::new(self.loaded.original.scene(), bvh))
    }
}

/// The environment that lights a side, and its settings with the environment's intensity there.
fn lit<'a>(loaded: &'a Loaded, wanted: &RenderRequest, side: usize) -> (Option<&'a Environment>, Settings) {
    let settings = wanted.settings.clone();
    let knobs = wanted.other.clone().filter(|_| side == 1).unwrap_or(settings.knobs);
    let (environment, settings) = loaded.light.lit(Settings { knobs, ..settings });
    (environment, settings.without_idle_blur(environment.is_some()))
}

/// Whether a renderer made for `a` can draw `b`.
fn same_renderer(a: &Settings, b: &Settings) -> bool {
    a.knobs == b.knobs
        && a.background == b.background
        && a.background_blur == b.background_blur
        && a.environment_intensity == b.environment_intensity
        && a.environment_rotation == b.environment_rotation
        && a.seed == b.seed
        && a.forced == b.forced
}

/// Wakes the window because the results have changed.
pub type Wake = Arc<dyn Fn() + Send + Sync>;

/// State of the render thread.
pub struct Worker {
    device: Arc<Device>,
    shared: Arc<SharedState>,
    source: Box<dyn SceneSource>,
    wake: Wake,
    stage: Option<LoadedRenderers>,
    version: u64,
    /// Shader code that replaces built code.
    code: Arc<Vec<Replacement>>,
    /// Pictures that are being compared, or are compared next; `None` while no comparison runs.
    comparing: Arc<Mutex<Option<(Shown, Shown)>>>,
}

impl Worker {
    /// Loads and draws until the request has `quit`, or the device is lost.
    pub fn run(device: Arc<Device>, shared: Arc<SharedState>, source: Box<dyn SceneSource>, wake: Wake) {
        let (code, comparing) = (lock(&shared.wanted).0.code.clone(), Arc::default());
        let mut worker = Self { device, shared, source, wake, stage: None, version: 0, code, comparing };
        let mut known = 0;
        let mut last: Option<RenderRequest> = None;
        loop {
            let (wanted, number) = {
                let mut wanted = lock(&worker.shared.wanted);
                while wanted.1 == known && worker.is_idle() {
                    wanted = worker.shared.changed.wait(wanted).unwrap_or_else(PoisonError::into_inner);
                }
                // The window interrupts the device while it holds this lock and changes the request.
                worker.device.resume();
                wanted.clone()
            };
            if wanted.quit {
                return;
            }
            // A sample is drawn after each change, so that a scene in permanent motion is shown too.
            let begun = if number == known { Ok(()) } else { worker.begin(&wanted, last.as_ref()) };
            let result = begun.and_then(|()| worker.refine(&wanted));
            known = number;
            last = Some(wanted);
            if let Err(error) = result {
                if error.is::<Interrupted>() {
                    continue;
                }
                worker.stage.iter_mut().flat_map(|stage| &mut stage.sides).for_each(|side| side.drawing = None);
                let lost = is_lost(&error);
                worker.say(|seen| {
                    let cause = format!("{error:#}");
                    seen.sides.iter_mut().for_each(|side| side.refused = Some(cause.clone()));
                    seen.error = Some(cause);
                    seen.lost |= lost;
                });
                if lost {
                    return;
                }
            }
        }
    }

    fn is_idle(&self) -> bool {
        self.stage.as_ref().is_none_or(|stage| stage.sides.iter().all(DrawnSide::is_done))
    }

    fn say(&self, change: impl FnOnce(&mut RenderState)) {
        change(&mut lock(&self.shared.seen));
        (self.wake)();
    }

    /// Takes over a changed request.
    fn begin(&mut self, wanted: &RenderRequest, last: Option<&RenderRequest>) -> Result<()> {
        let renewed = !Arc::ptr_eq(&self.code, &wanted.code);
        if renewed {
            self.code = wanted.code.clone();
            self.device.replace(&wanted.code);
        }
        let here = self.stage.as_ref().map(|stage| (stage.scene, stage.time));
        let tried = last.map(|last| (last.scene, last.time));
        let at = (wanted.scene, wanted.time);
        if here != Some(at) && tried != Some(at) {
            let other_scene = here.map(|(scene, _)| scene) != Some(wanted.scene);
            if other_scene { self.load(wanted)? } else { self.go_to(wanted)? }
        }
        self.follow_knobs(wanted, renewed)?;
        let Some(stage) = &mut self.stage else { return Ok(()) };
        let camera = wanted.from.camera(&stage.loaded)?;
        let same_view = last.is_some_and(|last| {
            // A camera of the scene may have moved with the animation time.
            (&last.from, last.moving) == (&wanted.from, wanted.moving) && tried == Some(at)
        });
        let ns: f64 = stage.ns_per_pixel.iter().take(stage.sides.len()).sum();
        let mut developed = Vec::new();
        for (index, side) in stage.sides.iter_mut().enumerate() {
            let Settings { size, tonemap, exposure, .. } = wanted.settings;
            let size = if wanted.moving { smaller(size, ns) } else { size };
            let all = side.settings.knobs.samples.count();
            let samples = if wanted.moving { 1 } else { all };
            let same_display = (side.settings.tonemap, side.settings.exposure) == (tonemap, exposure);
            (side.settings.tonemap, side.settings.exposure) = (tonemap, exposure);
            side.renderer.set_display(tonemap, exposure);
            if side.settings.size != size {
                side.drawing = None;
                side.renderer.resize(size)?;
                side.settings.size = size;
            }
            if !same_view || side.drawing.as_ref().is_none_or(|drawing| drawing.of() != samples) {
                side.drawing = Some(side.renderer.begin(camera, samples));
                side.spent = Duration::ZERO;
                // Where what is asked for cannot be drawn, this draws the rungs of before.
                if stage.refused[index].is_none() {
                    lock(&self.shared.seen).sides[index].refused = None;
                }
            } else if !same_display && side.drawing.as_ref().is_some_and(Drawing::is_whole) {
                developed.push(index);
            }
        }
        for side in developed {
            self.show(wanted, side)?;
        }
        if self.is_idle() {
            self.finish(wanted)?;
        }
        self.trace(wanted, last)
    }

    /// Loads a scene and its renderer; if that fails, the previous scene stays.
    fn load(&mut self, wanted: &RenderRequest) -> Result<()> {
        let name = wanted.file.as_ref().map_or("the scene".to_owned(), |file| file.display().to_string());
        self.say(|seen| seen.busy = Some(format!("reading {name}")));
        let found = self.source.open(wanted.asked(), &self.device).and_then(|loaded| {
            self.say(|seen| seen.busy = Some("uploading and compiling".to_owned()));
            self.ready(wanted, loaded)
        });
        self.say(|seen| {
            seen.busy = None;
            seen.failed = found.is_err().then_some(wanted.scene);
        });
        self.take_over(found?);
        Ok(())
    }

    /// Goes to another animation time of the scene.
    fn go_to(&mut self, wanted: &RenderRequest) -> Result<()> {
        let Self { source, stage: Some(stage), .. } = self else { return Ok(()) };
        let (scene, camera) = source.moment(wanted.asked())?;
        let loaded = Loaded { original: scene.into(), camera, ..stage.loaded.clone() };
        // The time per sample changes little between animation times.
        let ns = stage.ns_per_pixel;
        let (mut stage, facts) = self.ready(wanted, loaded)?;
        stage.ns_per_pixel = ns;
        self.take_over((stage, facts));
        Ok(())
    }

    /// Makes the renderer and the facts of a loaded scene.
    fn ready(&self, wanted: &RenderRequest, loaded: Loaded) -> Result<(LoadedRenderers, SceneFacts)> {
        let facts = SceneFacts::of(wanted, &loaded)?;
        let side = DrawnSide::new(&self.device, &loaded, wanted, 0)?;
        let (scene, time) = (wanted.scene, wanted.time);
        let sides = vec![side];
        Ok((
            LoadedRenderers { scene, time, loaded, sides, ns_per_pixel: [0.0; 2], refused: [None, None], tracer: None },
            facts,
        ))
    }

    fn take_over(&mut self, (stage, facts): (LoadedRenderers, SceneFacts)) {
        self.stage = Some(stage);
        self.tell_plan(0);
        self.say(|seen| {
            if seen.facts.as_ref().is_some_and(|before| before.scene != facts.scene) {
                (seen.sides[1], seen.difference) = Default::default();
            }
            // The picture of another file does not stay under this one's name.
            if seen.facts.as_ref().is_some_and(|before| before.name != facts.name) {
                seen.sides[0].shown = None;
            }
            seen.facts = Some(Arc::new(facts));
            (seen.surfaces, seen.triangles, seen.error) = (None, None, None);
        });
    }

    /// Makes a renderer for each requested side with its knobs; a side that cannot be drawn keeps its picture.
    fn follow_knobs(&mut self, wanted: &RenderRequest, renewed: bool) -> Result<()> {
        let Some(stage) = &mut self.stage else { return Ok(()) };
        if wanted.other.is_none() {
            stage.sides.truncate(1);
            stage.refused[1] = None;
            let is_seen = lock(&self.shared.seen).sides[1].shown.is_some();
            if is_seen {
                self.say(|seen| (seen.sides[1], seen.difference) = Default::default());
            }
        }
        for index in 0..1 + usize::from(wanted.other.is_some()) {
            let Some(stage) = &mut self.stage else { return Ok(()) };
            let (_, settings) = lit(&stage.loaded, wanted, index);
            let ready = stage.sides.get(index).is_some_and(|side| same_renderer(&side.settings, &settings)) && !renewed;
            let refused =
                stage.refused[index].as_ref().is_some_and(|r| r.size == settings.size && same_renderer(r, &settings));
            if ready && stage.refused[index].take().is_some() {
                self.say(|seen| (seen.error, seen.sides[index].refused) = (None, None));
            } else if !ready && (!refused || renewed) {
                self.plan(wanted, settings, index)?;
            }
        }
        Ok(())
    }

    /// Plans and uploads one side with other knobs.
    fn plan(&mut self, wanted: &RenderRequest, settings: Settings, index: usize) -> Result<()> {
        self.say(|seen| {
            (seen.busy, seen.sides[index].refused) = (Some("uploading and compiling".to_owned()), None);
        });
        let Some(stage) = &mut self.stage else { return Ok(()) };
        let made = DrawnSide::new(&self.device, &stage.loaded, wanted, index);
        match made {
            Ok(side) => {
                stage.refused[index] = None;
                if index < stage.sides.len() {
                    // The time per pixel is unknown for other knobs until the next sample.
                    stage.ns_per_pixel[index] = 0.0;
                    stage.sides[index] = side;
                } else {
                    stage.sides.push(side);
                }
                self.say(|seen| (seen.busy, seen.error) = (None, None));
                self.tell_plan(index);
                Ok(())
            }
            Err(error) if is_lost(&error) => Err(error),
            // The sides that can be drawn go on.
            Err(error) => {
                stage.refused[index] = Some(settings);
                self.say(|seen| {
                    let cause = format!("{error:#}");
                    (seen.busy, seen.sides[index].refused, seen.error) = (None, Some(cause.clone()), Some(cause));
                });
                Ok(())
            }
        }
    }

    fn tell_plan(&self, index: usize) {
        let Some(side) = self.stage.as_ref().and_then(|stage| stage.sides.get(index)) else { return };
        let warnings = [side.renderer.plan().warnings.clone(), side.renderer.warnings.clone()].concat();
        let light = self.stage.as_ref().map(|stage| stage.loaded.light.clone());
        let lit_by = light.map(|light| light.sources(&side.settings).lit_by(side.renderer.plan()).sentence);
        self.say(|seen| {
            (seen.sides[index].effects, seen.sides[index].warnings) =
                (side.renderer.plan().effects.clone().into(), warnings.into());
            seen.sides[index].lit_by = lit_by;
        });
    }

    /// Draws one more sample, or a band of it, for the side with less progress; with equal progress, for the side
    /// published longer ago.
    fn refine(&mut self, wanted: &RenderRequest) -> Result<()> {
        let Some(stage) = &mut self.stage else { return Ok(()) };
        let unfinished = stage.sides.iter_mut().enumerate().filter(|(_, side)| !side.is_done());
        let order = |a: &DrawnSide, b: &DrawnSide| a.progress().total_cmp(&b.progress()).then(a.looked.cmp(&b.looked));
        let Some((index, side)) = unfinished.min_by(|a, b| order(a.1, b.1)) else { return Ok(()) };
        let Some(drawing) = &mut side.drawing else { return Ok(()) };
        // While the view moves, each picture is drawn to its end with all bands: the next one would not be better.
        drawing.interruptible = !wanted.moving;
        let (begun, before) = (Instant::now(), drawing.samples());
        side.renderer.step(drawing)?;
        while wanted.moving && drawing.samples() == before {
            side.renderer.step(drawing)?;
        }
        side.spent += begun.elapsed();
        if drawing.samples() == before {
            return Ok(());
        }
        // The first sample includes compilation, so a faster time replaces the estimate at once.
        let [width, height] = side.settings.size;
        let ns = std::mem::take(&mut side.spent).as_secs_f64() * 1e9 / f64::from(width) / f64::from(height);
        let known = stage.ns_per_pixel[index];
        stage.ns_per_pixel[index] = if known == 0.0 || ns < known { ns } else { known + 0.2 * (ns - known) };
        if drawing.is_done() || drawing.samples() == 1 || side.looked.elapsed() >= LOOK {
            side.looked = Instant::now();
            self.show(wanted, index)?;
        }
        if self.is_idle() { self.finish(wanted) } else { Ok(()) }
    }

    fn show(&mut self, wanted: &RenderRequest, index: usize) -> Result<()> {
        let Some(stage) = &mut self.stage else { return Ok(()) };
        let sharing = stage.sides.iter().filter(|side| !side.is_done()).count().max(1);
        let Some(side) = stage.sides.get_mut(index) else { return Ok(()) };
        let Some(drawing) = &side.drawing else { return Ok(()) };
        let rendered = side.renderer.picture(drawing)?;
        self.version += 1;
        let each = f64::from(rendered.samples.max(1));
        let work = rendered.work;
        let (ns, pixels) =
            (stage.ns_per_pixel[index], f64::from(side.settings.size[0]) * f64::from(side.settings.size[1]));
        let remaining = f64::from(drawing.of().saturating_sub(rendered.samples));
        let full = rendered.display.chunks_exact(4).filter(|p| p[..3].contains(&255)).count();
        let rgba = Arc::new(rendered.display);
        // Where what is asked for cannot be drawn, the renderer of before goes on.
        let is_asked = same_renderer(&side.settings, &lit(&stage.loaded, wanted, index).1);
        let shown = Shown {
            version: self.version,
            seconds_left: 1e-9 * ns * pixels * remaining * sharing as f64,
            clipped: full as f32 / pixels as f32,
            opaque: if rendered.has_alpha { Arc::new(over_squares(&rgba, side.settings.size)) } else { rgba.clone() },
            has_alpha: rendered.has_alpha,
            rgba,
            size: side.settings.size,
            of: is_asked.then(|| wanted.clone()),
            samples: [rendered.samples, drawing.of()],
            moving: wanted.moving,
            time: wanted.time,
            knobs: side.settings.knobs.clone(),
            passes: rendered.passes.into_iter().map(|pass| PassTime { ms: pass.ms / each, ..pass }).collect(),
            rays: (work.reflection + work.refraction + work.shadow + work.indirect)
                / u64::from(rendered.samples.max(1)),
            counts: rendered.counts,
            error: rendered.errors.last().map(|error| error.relmse.sqrt()),
        };
        self.say(|seen| seen.sides[index].shown = Some(shown));
        Ok(())
    }

    /// Reads surfaces and compares sides when the pictures are finished.
    fn finish(&mut self, wanted: &RenderRequest) -> Result<()> {
        if wanted.moving {
            return Ok(());
        }
        if wanted.surfaces {
            self.read_surfaces(wanted)?;
        }
        if wanted.triangles {
            self.look_up_triangles(wanted)?;
        }
        self.meter(wanted)?;
        let shown = lock(&self.shared.seen).sides.each_ref().map(|side| side.shown.clone());
        if let ([Some(left), Some(right)], true) = (shown, wanted.other.is_some())
            && left.is_done()
            && right.is_done()
            && left.size == right.size
        {
            let versions = [left.version, right.version];
            if lock(&self.shared.seen).difference.is_none_or(|known| known.versions != versions) {
                self.compare(left, right);
            }
        }
        Ok(())
    }

    /// Compares both sides on a separate thread, because FLIP takes longer than a time slice of a pass. Of the pictures
    /// that arrive meanwhile, only the latest are compared.
    fn compare(&self, left: Shown, right: Shown) {
        let runs = lock(&self.comparing).replace((left, right)).is_some();
        if runs {
            return;
        }
        let (shared, wake, comparing) = (self.shared.clone(), self.wake.clone(), self.comparing.clone());
        let work = move || {
            let picture = |shown: &Shown| {
                let rgba = shown.rgba.chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]]).collect();
                AnyPicture::Display(Display { width: shown.size[0], height: shown.size[1], rgba })
            };
            loop {
                let Some((left, right)) = lock(&comparing).clone() else { return };
                let versions = [left.version, right.version];
                match compare(Metric::Flip, &picture(&left), &picture(&right)) {
                    Ok(found) => lock(&shared.seen).difference = Some(Difference { versions, flip: found.value }),
                    Err(error) => lock(&shared.seen).error = Some(format!("comparing the two sides: {error:#}")),
                }
                wake();
                let mut next = lock(&comparing);
                if next.as_ref().is_some_and(|(a, b)| [a.version, b.version] == versions) {
                    *next = None;
                    return;
                }
            }
        };
        if let Err(error) = std::thread::Builder::new().name("comparing".to_owned()).spawn(work) {
            *lock(&self.comparing) = None;
            self.say(|seen| seen.error = Some(format!("comparing the two sides: {error}")));
        }
    }

    fn read_surfaces(&mut self, wanted: &RenderRequest) -> Result<()> {
        if lock(&self.shared.seen).now().is_some() {
            return Ok(());
        }
        let Some(stage) = &mut self.stage else { return Ok(()) };
        let camera = wanted.from.camera(&stage.loaded)?.clone();
        let mut radiance = Vec::new();
        for side in &stage.sides {
            radiance.push(Arc::new(side.renderer.film()?.rgba));
        }
        let Some(left) = stage.sides.first_mut() else { return Ok(()) };
        let (pixels, view) = left.renderer.aovs(&camera)?;
        let (pixels, size, eye) = (Arc::new(pixels), left.settings.size, view.eye);
        self.say(|seen| {
            let versions = seen.versions();
            seen.surfaces = Some(PixelSurfaces { pixels, radiance, size, eye, seen_from: camera, versions });
        });
        Ok(())
    }

    /// Looks up the triangles at the pixels of the picture.
    fn look_up_triangles(&mut self, wanted: &RenderRequest) -> Result<()> {
        let versions = lock(&self.shared.seen).versions();
        if lock(&self.shared.seen).triangles.as_ref().is_some_and(|known| known.versions == versions) {
            return Ok(());
        }
        self.say(|seen| seen.busy = Some("looking up triangles".to_owned()));
        let Some(stage) = &mut self.stage else { return Ok(()) };
        let (camera, size) = (wanted.from.camera(&stage.loaded)?.clone(), wanted.settings.size);
        let tracer = stage.tracer()?;
        let pixels = Arc::new(triangles(&tracer, stage.loaded.original.scene(), &camera, size));
        stage.tracer = Some(tracer);
        self.say(|seen| {
            seen.busy = None;
            seen.triangles = Some(PixelTriangles { pixels, size, versions });
        });
        Ok(())
    }

    /// Finds the exposure that shows the picture well, where the window asks for it.
    fn meter(&mut self, wanted: &RenderRequest) -> Result<()> {
        let known = lock(&self.shared.seen).metered.map_or(0, |(number, _)| number);
        if known == wanted.meter {
            return Ok(());
        }
        let Some(side) = self.stage.as_ref().and_then(|stage| stage.sides.first()) else { return Ok(()) };
        let view = side.settings.view_transform();
        let stops = Meter::of(side.renderer.film()?.rgba.into_iter(), &view).and_then(|meter| meter.stops());
        self.say(|seen| seen.metered = Some((wanted.meter, stops)));
        Ok(())
    }

    /// Traces the ray of the inspected pixel from the camera of the click; the user may have moved since.
    fn trace(&mut self, wanted: &RenderRequest, last: Option<&RenderRequest>) -> Result<()> {
        let Some(picked) = &wanted.picked else {
            let known = lock(&self.shared.seen).trace.is_some();
            if known {
                self.say(|seen| seen.trace = None);
            }
            return Ok(());
        };
        let is_known = lock(&self.shared.seen).trace.as_ref().is_some_and(|trace| trace.number == picked.number);
        let same = |last: &RenderRequest| last.settings.knobs == wanted.settings.knobs && last.time == wanted.time;
        if is_known && last.is_some_and(same) {
            return Ok(());
        }
        let Some(stage) = &mut self.stage else { return Ok(()) };
        let Pick { number, pixel, size, seen_from } = picked.clone();
        let tracer = stage.tracer()?;
        let limits = limits_of(&wanted.settings.knobs);
        let events = tracer.follow(stage.loaded.original.scene(), &seen_from, size, pixel, &limits);
        stage.tracer = Some(tracer);
        self.say(|seen| seen.trace = Some(Arc::new(Trace { number, pixel, events, seen_from, size })));
        Ok(())
    }
}

/// Limits for tracing a pixel's ray, as in a picture with these knobs.
fn limits_of(knobs: &Knobs) -> Limits {
    let rays = knobs.reflection == Reflection::Ray || knobs.refraction == Refraction::Ray;
    let paths = knobs.indirect == Indirect::Path;
    Limits {
        surfaces: if rays || paths { knobs.interfaces.count() } else { 1 },
        proxies: knobs.lights == Lights::Points,
        roughest: knobs.lobes.roughest(),
        least_share: LEAST_SHARE,
    }
}

/// A picture over squares of grey, RGBA8.
fn over_squares(rgba: &[u8], [width, _]: [u32; 2]) -> Vec<u8> {
    let pixels = rgba.chunks_exact(4).enumerate();
    let opaque = pixels.flat_map(|(i, p)| {
        let (x, y) = (i as u32 % width / SQUARE, i as u32 / width / SQUARE);
        let [r, g, b] = over([p[0], p[1], p[2], p[3]], GREYS[(x + y) as usize % 2]);
        [r, g, b, 255]
    });
    opaque.collect()
}

/// The largest size that keeps [`MOVING_MS`] while the view moves.
fn smaller(size: [u32; 2], ns_per_pixel: f64) -> [u32; 2] {
    if ns_per_pixel == 0.0 {
        return size.map(|side| side.div_ceil(UNKNOWN));
    }
    let pixels = f64::from(size[0]) * f64::from(size[1]);
    let takes = |by: u32| ns_per_pixel * 1e-6 * pixels / f64::from(by * by);
    let by = SMALLER.into_iter().find(|&by| takes(by) <= MOVING_MS).unwrap_or(SMALLER[SMALLER.len() - 1]);
    size.map(|side| side.div_ceil(by).max(1))
}

#[cfg(test)]
mod tests {
    use etalon::frame::Background;

    use super::*;

    #[test]
    fn pictures_get_smaller_until_they_are_quick() {
        assert_eq!(smaller([1280, 720], 0.0), [320, 180]);
        assert_eq!(smaller([1280, 720], 40.0), [1280, 720]);
        // 92 ms at full size, 23 ms at half the width and height.
        assert_eq!(smaller([1280, 720], 100.0), [640, 360]);
        assert_eq!(smaller([1281, 721], 1e6), [161, 91]);
        assert_eq!(smaller([3, 1], 1e9), [1, 1]);
    }

    #[test]
    fn light_follows_what_is_chosen_in_the_window() {
        let mut scene = etalon::study::load("lamps").expect("a scene");
        scene.studio = None;
        let camera = scene.cameras[0].clone();
        let studio = Some(Environment::studio());
        let opened = etalon::open::Opened::named("lamps.glb", scene.clone(), studio, false);
        let loaded = Loaded { light: Arc::new(opened), ..Loaded::new(scene, camera) };
        let of = |background| {
            let settings = Settings { background, background_blur: 0.5, ..Settings::default() };
            let (environment, settings) = lit(&loaded, &RenderRequest::new(settings), 0);
            (environment.is_some(), settings.environment_intensity, settings.background_blur)
        };
        let (_, fill, _) = of(Background::Default);
        assert!(fill > 0.0 && fill < 1.0, "{fill}");
        assert_eq!(of(Background::Default), (true, fill, 0.5));
        assert_eq!(of(Background::Environment), (true, 1.0, 0.5), "as `--background env` says");
        assert_eq!(of(Background::Color([9; 3])), (true, fill, 0.0), "what is not shown is not blurred");
    }

    #[test]
    fn what_is_transparent_lies_over_squares() {
        let clear: Vec<u8> = [9, 9, 9, 0].repeat(16 * 9);
        let drawn = over_squares(&clear, [16, 9]);
        let at = |x: usize, y: usize| drawn[(y * 16 + x) * 4..][..4].to_vec();
        assert_eq!(
            (at(0, 0), at(8, 0), at(7, 8)),
            (vec![102, 102, 102, 255], vec![153; 3].into_iter().chain([255]).collect(), vec![153, 153, 153, 255])
        );
        assert_eq!(over_squares(&[200, 100, 50, 255], [1, 1]), [200, 100, 50, 255]);
        assert_eq!(over_squares(&[200, 100, 0, 51], [1, 1]), [121, 101, 81, 255], "a fifth of it");
    }
}
