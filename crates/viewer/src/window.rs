//! The open window: what it asks of the render thread, shows of its results, and writes.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, anyhow, bail, ensure};
use winit::dpi::PhysicalSize;
use winit::event_loop::{ActiveEventLoop, EventLoopProxy};
#[cfg(all(unix, not(target_os = "macos")))]
use winit::platform::x11::WindowAttributesExtX11;
use winit::window::{Icon, Window, WindowAttributes};

use super::layer::SurfaceLayer;
use super::navigation::Navigation;
use super::panels::{self, Action, PanelState};
use super::preferences::{self, Preferences};
use super::shared::{self, FileChoice, RenderRequest, RenderState, SharedState, Viewpoint, lock};
use super::worker::Worker;
use super::{Start, View, Woken};
use etalon::frame::Settings;
use etalon::gpu::{Overlay, PlacedPicture, Presented, Presenter, Replacement};
use etalon::image::{Picture, exr, file, png};
use etalon::open::is_file;

/// Least time between two frames of the window: a driver's FIFO present mode does not always wait for a screen.
pub(crate) const FRAME: Duration = Duration::from_millis(16);
/// Number of window frames whose times are kept for the statistics at the end.
const REMEMBERED: usize = 100_000;
/// Time without movement before the picture is drawn at full quality.
const STILL: Duration = Duration::from_millis(150);
/// Time without another change before a file is read again.
const SETTLED: Duration = Duration::from_millis(300);
/// Seconds that saving waits for a picture to be finished.
const PATIENCE: f64 = 5.0;
/// Size of the first window.
const DEFAULT_SIZE: [u32; 2] = [1280, 720];

/// File name extensions of scene files, buffers and textures.
const PARTS: [&str; 12] = ["glb", "gltf", "bin", "obj", "mtl", "stl", "ply", "png", "jpg", "jpeg", "webp", "ktx2"];

/// A false-colour layer as pixels.
#[derive(Clone)]
struct DrawnLayer {
    layer: SurfaceLayer,
    /// Versions of the pictures that it belongs to.
    of: [Option<u64>; 2],
    rgba: Arc<Vec<u8>>,
    size: [u32; 2],
    version: u64,
}

/// A picture that is written when it is drawn.
struct PendingSave {
    path: PathBuf,
    /// Layer and position of the wipe line.
    layer: SurfaceLayer,
    wipe: f32,
    /// The request whose picture it is; `None` until the scene is there.
    of: Option<RenderRequest>,
    /// Whether the wait is announced.
    is_told: bool,
}

impl PendingSave {
    fn is_exr(&self) -> bool {
        self.path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("exr"))
    }
}

/// A scene that was asked for.
#[derive(Clone)]
struct AskedScene {
    /// Its file; `None`: that of the command line.
    file: Option<PathBuf>,
    choice: FileChoice,
}

/// The window, its panels and the connection to the render thread.
pub(crate) struct OpenWindow {
    pub(crate) window: Arc<Window>,
    pub(crate) presenter: Presenter,
    device: Arc<etalon::gpu::Device>,
    shared: Arc<SharedState>,
    worker: Option<JoinHandle<()>>,
    pub(crate) egui: egui_winit::State,
    pub(crate) state: PanelState,
    command: Box<dyn Fn(&View<'_>) -> String>,
    said: Box<dyn Fn(&str)>,
    /// Each scene that was asked for, by its number.
    scenes: Vec<AskedScene>,
    scene: u64,
    /// Number of the scene that the navigation belongs to; `None` until one is loaded.
    navigated: Option<u64>,
    moment: Option<f64>,
    sent: Option<RenderRequest>,
    moving_until: Option<Instant>,
    pub(crate) drawn: Instant,
    pub(crate) dirty: bool,
    pub(crate) wait_until: Option<Instant>,
    /// Number of window frames, and milliseconds of the first [`REMEMBERED`] ones.
    pictures: u64,
    took: Vec<f32>,
    /// Number of buffers, images and pipelines when the first picture was done.
    objects: Option<u64>,
    layer: Option<DrawnLayer>,
    layers: u64,
    /// Watches the folder of the scene file.
    watcher: Option<notify::RecommendedWatcher>,
    /// Names of files that this window wrote.
    written: Arc<Mutex<Vec<OsString>>>,
    proxy: EventLoopProxy<Woken>,
    /// Scene file of the command line.
    first: Option<PathBuf>,
    /// Animation time of the command line in seconds; `None` is the rest pose.
    time: Option<f64>,
    /// When the scene file is read again.
    reads_at: Option<Instant>,
    /// Number of a scene that is read again; its camera stays.
    again: Option<u64>,
    saves: Vec<PendingSave>,
    /// What is chosen, as of the last frame.
    chosen: FileChoice,
    /// FileChoice whose request waits until it no longer changes.
    chooses_at: Option<Instant>,
    /// Number of the scene whose small picture is kept.
    small: Option<u64>,
    /// Number of the last scene that could not be read.
    failed: Option<u64>,
    /// Whether the render thread ended by a panic.
    panicked: bool,
    /// Shader code that replaces built code.
    code: Arc<Vec<Replacement>>,
    /// Watches the shader files.
    #[cfg(feature = "reload")]
    _shaders: notify::RecommendedWatcher,
    pub(crate) quits: bool,
}

impl OpenWindow {
    pub(crate) fn new(events: &ActiveEventLoop, start: Start, proxy: EventLoopProxy<Woken>) -> Result<Self> {
        let Start {
            size,
            id,
            icon,
            settings,
            device: which,
            validate,
            panels,
            choice,
            source,
            command,
            said,
            file,
            time,
        } = start;
        let preferences = Preferences::load();
        let window = Arc::new(
            events.create_window(attributes(events, size, &preferences, id, icon)).context("opening a window")?,
        );
        let (device, presenter) = Presenter::open(window.clone(), &which, validate)?;
        let recent = preferences::recent();
        let mut state = PanelState::new(settings.clone(), choice.clone(), device.info().clone(), recent, preferences);
        state.panels = panels;
        let context = egui::Context::default();
        // Zoom and theme are those of the preferences.
        context.options_mut(|options| options.zoom_with_keyboard = false);
        let native = Some(window.scale_factor() as f32);
        let side = device.max_image_size() as usize;
        let egui =
            egui_winit::State::new(context, egui::ViewportId::ROOT, &*window, native, window.theme(), Some(side));
        let wanted = RenderRequest::new(settings);
        let code = wanted.code.clone();
        // The first frame finds the size of the picture, which a camera that frames the scene depends on.
        let shared = Arc::new(SharedState::waiting(wanted));
        let worker = {
            let (device, shared) = (device.clone(), shared.clone());
            let proxy = proxy.clone();
            let wake = Arc::new(move || drop(proxy.send_event(Woken::RenderState)));
            std::thread::Builder::new()
                .name("drawing".to_owned())
                .spawn(move || Worker::run(device, shared, source, wake))
                .context("starting the render thread")?
        };
        #[cfg(feature = "reload")]
        let shaders = {
            let proxy = proxy.clone();
            let root = Path::new(etalon::shader::SOURCES);
            crate::reload::watch(root, move |compiled| drop(proxy.send_event(Woken::Compiled(compiled))))?
        };
        let mut new = Self {
            window,
            presenter,
            device,
            shared,
            worker: Some(worker),
            egui,
            state,
            command,
            said,
            scenes: vec![AskedScene { file: None, choice: choice.clone() }],
            scene: 0,
            navigated: None,
            moment: None,
            sent: None,
            moving_until: None,
            drawn: Instant::now() - FRAME,
            dirty: true,
            wait_until: None,
            pictures: 0,
            took: Vec::new(),
            objects: None,
            layer: None,
            layers: 0,
            watcher: None,
            written: Arc::default(),
            proxy,
            first: file,
            time,
            reads_at: None,
            again: None,
            saves: Vec::new(),
            chosen: choice,
            chooses_at: None,
            small: None,
            failed: None,
            panicked: false,
            code,
            #[cfg(feature = "reload")]
            _shaders: shaders,
            quits: false,
        };
        new.watch();
        Ok(new)
    }

    /// Draws one frame of the window.
    pub(crate) fn draw(&mut self) -> Result<()> {
        self.drawn = Instant::now();
        let seen = self.shared.seen();
        if self.worker.as_ref().is_some_and(JoinHandle::is_finished) && !seen.lost {
            bail!("the render thread has failed");
        }
        if seen.lost {
            return Err(anyhow!(seen.error.unwrap_or_default()));
        }
        self.follow(&seen);
        if self.reads_at.is_some_and(|at| at <= self.drawn) {
            self.reads_at = None;
            self.read_again();
        }
        let input = self.egui.take_egui_input(&self.window);
        let mut actions = Vec::new();
        let context = self.egui.egui_ctx().clone();
        context.set_zoom_factor(self.state.preferences.zoom);
        context.set_theme(self.state.preferences.theme);
        let output = context.run_ui(input, |root| actions.extend(panels::show(root, &mut self.state, &seen)));
        self.egui.handle_platform_output(&self.window, output.platform_output);
        for action in actions {
            self.act(action, &seen);
        }
        self.want();
        let mut delay =
            output.viewport_output.values().map(|viewport| viewport.repaint_delay).min().unwrap_or(Duration::MAX);
        if let Some(until) = self.moving_until {
            delay = delay.min(until.saturating_duration_since(self.drawn));
        }
        for at in [self.reads_at, self.chooses_at].into_iter().flatten() {
            delay = delay.min(at.saturating_duration_since(self.drawn));
        }
        self.wait_until = self.drawn.checked_add(delay).filter(|_| delay < Duration::from_secs(3600));
        let overlay = Overlay {
            textures: output.textures_delta,
            primitives: context.tessellate(output.shapes, output.pixels_per_point),
            pixels_per_point: output.pixels_per_point,
        };
        let size = self.window.inner_size();
        let layer = self.drawn_layer(&seen);
        self.save(&seen);
        let pictures = self.placed(&seen, layer.as_ref());
        self.window.pre_present_notify();
        if self.presenter.present([size.width, size.height], &pictures, overlay)? == Presented::Changed {
            self.dirty = true;
        }
        self.pictures += 1;
        if self.took.len() < REMEMBERED {
            self.took.push(self.drawn.elapsed().as_secs_f32() * 1e3);
        }
        Ok(())
    }

    /// The pictures in the window: a layer, or both sides of the wipe line.
    fn placed<'a>(&self, seen: &'a RenderState, layer: Option<&'a DrawnLayer>) -> Vec<PlacedPicture<'a>> {
        let place = self.state.place;
        let [left, _, right, _] = place;
        if let Some(DrawnLayer { rgba, size, version, .. }) = layer {
            return vec![PlacedPicture { rgba, size: *size, version: *version, place, columns: [left, right] }];
        }
        let wipe = seen.sides[1].shown.as_ref().map_or(right, |_| self.state.wipe_column());
        let shown = seen.sides.iter().filter_map(|side| side.shown.as_ref());
        let placed = shown.zip([[left, wipe], [wipe, right]]).map(|(shown, columns)| PlacedPicture {
            rgba: &shown.opaque,
            size: shown.size,
            version: 2 * shown.version,
            place,
            columns,
        });
        placed.collect()
    }

    /// Moves the current file to the front of the recent files.
    fn remember(&mut self) {
        if let Some(path) = self.scene_file() {
            preferences::remember(&mut self.state.recent, &path);
        }
    }

    /// File of the current scene; `None` for a study scene.
    fn scene_file(&self) -> Option<PathBuf> {
        let path = self.file().or(self.first.as_deref())?;
        is_file(path.to_str().unwrap_or_default()).then(|| path.to_owned())
    }

    /// A file of the scene has changed: it is read again when it has settled.
    pub(crate) fn changed(&mut self) {
        self.reads_at = Some(Instant::now() + SETTLED);
        self.dirty = true;
    }

    /// Takes over shaders that were compiled again.
    #[cfg(feature = "reload")]
    pub(crate) fn compiled(&mut self, compiled: crate::reload::Compiled) {
        self.dirty = true;
        match compiled {
            Ok(code) => {
                self.code = code;
                self.state.notices.say("shaders recompiled".to_owned());
            }
            Err(message) => self.state.notices.fail(message),
        }
    }

    /// Ends the render thread and stores the preferences; returns the device, which outlives the window.
    pub(crate) fn close(&mut self) -> Arc<etalon::gpu::Device> {
        self.account();
        let size = self.window.inner_size();
        if self.window.fullscreen().is_none() && size.width > 0 && self.state.panels {
            self.state.preferences.size = Some([size.width, size.height]);
        }
        self.state.preferences.save();
        for save in &self.saves {
            tracing::warn!("{} is not written: the window was closed", save.path.display());
        }
        // The render thread reads a scene to its end before it ends.
        self.window.set_visible(false);
        self.shared.want(|wanted| {
            wanted.quit = true;
            self.device.interrupt();
        });
        self.panicked = self.worker.take().is_some_and(|worker| worker.join().is_err());
        self.device.clone()
    }

    /// Whether the render thread ended by a panic.
    pub(crate) fn render_thread_failed(&self) -> bool {
        self.panicked
    }

    /// Watches the current file and the buffers and textures beside it for changes.
    fn watch(&mut self) {
        self.watcher = None;
        let Some(path) = self.scene_file() else { return };
        let (proxy, folder) = (self.proxy.clone(), path.parent().filter(|folder| !folder.as_os_str().is_empty()));
        let written = self.written.clone();
        let told = move |event: notify::Result<notify::Event>| {
            // Files that this window wrote do not belong to the scene.
            let ours = |path: &PathBuf| lock(&written).iter().any(|name| path.file_name() == Some(name));
            let part = |path: &PathBuf| {
                let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_lowercase();
                PARTS.contains(&ending.as_str()) && !ours(path)
            };
            let changes = |event: notify::Event| {
                (event.kind.is_modify() || event.kind.is_create()) && event.paths.iter().any(part)
            };
            if event.is_ok_and(changes) {
                drop(proxy.send_event(Woken::Changed));
            }
        };
        let watching = notify::recommended_watcher(told).and_then(|mut watcher| {
            notify::Watcher::watch(
                &mut watcher,
                folder.unwrap_or(Path::new(".")),
                notify::RecursiveMode::NonRecursive,
            )?;
            Ok(watcher)
        });
        match watching {
            Ok(watcher) => self.watcher = Some(watcher),
            Err(error) => tracing::info!("{} cannot be watched for changes: {error}", path.display()),
        }
    }

    /// Reads the file again.
    fn read_again(&mut self) {
        // Another file is being opened, or the first one failed and is tried again.
        if self.navigated.is_some_and(|navigated| navigated != self.scene) {
            // Try again when that file has been read.
            self.reads_at = Some(Instant::now() + SETTLED);
            return;
        }
        self.ask(self.asked().clone(), true);
    }

    /// Asks for a scene. `again`: it is the same one, and its camera stays.
    fn ask(&mut self, asked: AskedScene, again: bool) {
        self.scene = self.scenes.len() as u64;
        self.again = again.then_some(self.scene).or(self.again);
        self.scenes.push(asked);
    }

    /// The scene that was asked for last, and has not failed.
    fn asked(&self) -> &AskedScene {
        &self.scenes[self.scene as usize]
    }

    /// Pixels of the chosen layer; `None` for the shaded picture.
    fn drawn_layer(&mut self, seen: &RenderState) -> Option<DrawnLayer> {
        let layer = self.state.layer;
        let versions = seen.versions();
        let is_drawn = |known: &DrawnLayer| known.layer == layer && known.of == versions;
        if !self.layer.as_ref().is_some_and(is_drawn) {
            let (size, rgba) = if layer.reads_triangles() {
                let triangles = seen.triangles.as_ref().filter(|triangles| triangles.versions == versions)?;
                let shown = seen.shown().filter(|shown| shown.size == triangles.size)?;
                (triangles.size, layer.draw_triangles(&triangles.pixels, &shown.opaque))
            } else {
                let surfaces = seen.now().filter(|_| layer.reads_surfaces())?;
                (surfaces.size, layer.draw(surfaces))
            };
            self.layers += 1;
            // Layers have odd versions, pictures have even ones.
            let version = 2 * self.layers + 1;
            self.layer = Some(DrawnLayer { layer, of: versions, rgba: Arc::new(rgba), size, version });
        }
        self.layer.clone()
    }

    /// Takes over the state of the render thread.
    fn follow(&mut self, seen: &RenderState) {
        if let Some(facts) = seen.facts.as_ref().filter(|facts| Some(facts.scene) != self.navigated) {
            self.navigated = Some(facts.scene);
            match (&mut self.state.navigation, self.again == Some(facts.scene)) {
                (Some(navigation), true) => {
                    let named = navigation.named().and_then(|key| facts.camera(key));
                    navigation.stay(facts.home.clone(), named, facts.bounds, facts.framed);
                }
                _ => {
                    self.state.navigation = Some(Navigation::new(facts.home.clone(), facts.bounds, facts.framed));
                    if let Some(colour) = facts.colour {
                        self.state.settings.knobs.colour = colour;
                    }
                    self.state.settings.exposure = facts.exposure;
                    facts.exposure_from.iter().for_each(|why| self.state.notices.say(why.clone()));
                }
            }
            if self.again == Some(facts.scene) {
                self.state.picked = None;
            } else {
                self.state.begin_scene();
            }
            self.state.clock.rest = self.time.filter(|_| self.file().is_none());
            self.remember();
            self.watch();
            self.window.set_title(&format!("{} – Etalon", facts.name));
        } else if let (Some(facts), Some(navigation)) = (&seen.facts, &mut self.state.navigation)
            && facts.time != self.moment
        {
            let named = navigation.named().and_then(|key| facts.camera(key));
            navigation.moment(facts.home.clone(), named);
        }
        self.moment = seen.facts.as_ref().and_then(|facts| facts.time);
        if seen.failed == Some(self.scene) && self.failed != Some(self.scene) {
            self.failed = Some(self.scene);
            // The scene before stays, with what was chosen there.
            if let Some(before) = self.navigated {
                self.scene = before;
                self.state.choice = self.asked().choice.clone();
                self.chosen = self.state.choice.clone();
            }
        }
        if self.objects.is_none() && seen.shown().is_some_and(shared::Shown::is_done) {
            self.objects = Some(self.device.objects());
        }
        if let (Some(scene), Some(shown)) = (self.navigated, seen.shown().filter(|shown| shown.is_done()))
            && self.small != Some(scene)
        {
            self.small = Some(scene);
            if let Some(path) = self.scene_file() {
                if let Err(error) = preferences::keep_small(&path, &shown.opaque, shown.size) {
                    tracing::info!("the small picture of {} cannot be written: {error:#}", path.display());
                }
                // The menu reads it again.
                self.state.small.remove(&std::path::absolute(&path).unwrap_or(path));
            }
        }
    }

    /// Writes the pictures that were asked for once they are drawn. A picture that is soon finished is saved then,
    /// others as they are; radiance is that of all samples.
    fn save(&mut self, seen: &RenderState) {
        let Some(sent) = self.sent.clone().filter(|_| !self.saves.is_empty()) else { return };
        let display = |request: &RenderRequest| (request.settings.tonemap, request.settings.exposure);
        let is_same = |of: &RenderRequest| of.is_same_view(&sent) && display(of) == display(&sent);
        let sides = &seen.sides[..1 + usize::from(sent.other.is_some())];
        let answers = |index: usize, shown: &shared::Shown| {
            // A finished side is not drawn again when the knobs of the other one change.
            let is_this = |of: &RenderRequest| {
                of.of_side(index).is_same_view(&sent.of_side(index)) && display(of) == display(&sent)
            };
            !shown.moving && shown.of.as_ref().is_some_and(is_this)
        };
        let shown = sides.iter().enumerate().filter_map(|(index, side)| Some((index, side.shown.as_ref()?)));
        let drawn: Vec<_> = shown.filter(|(index, shown)| answers(*index, shown)).map(|(_, shown)| shown).collect();
        let refused = sides.iter().find_map(|side| side.refused.as_ref()).filter(|_| seen.busy.is_none());
        let are_drawn = drawn.len() == sides.len();
        for mut save in std::mem::take(&mut self.saves) {
            let name = save.path.display().to_string();
            let is_kept = (save.layer, save.wipe) == (self.state.layer, self.state.wipe);
            if !save.of.as_ref().is_none_or(is_same) || !is_kept {
                self.state.notices.fail(format!("{name} is not written: the view changed before it was drawn"));
                continue;
            }
            let is_ready = match save.is_exr() {
                true => drawn.iter().all(|shown| shown.is_done()) && seen.now().is_some(),
                false => {
                    let is_awaited = |shown: &&shared::Shown| !shown.is_done() && shown.seconds_left <= PATIENCE;
                    !drawn.iter().any(is_awaited) && self.picture(seen).is_some()
                }
            };
            if are_drawn && is_ready {
                let written =
                    if save.is_exr() { self.write_exr(seen, &save.path) } else { self.write_png(seen, &save.path) };
                self.tell(written);
                continue;
            }
            // What cannot be drawn is not awaited.
            if let Some(cause) = refused {
                self.state.notices.fail(format!("{name} is not written: {cause}"));
                continue;
            }
            if !std::mem::replace(&mut save.is_told, true) {
                let when = if save.is_exr() { "when all samples are drawn" } else { "when it is drawn" };
                self.state.notices.say(format!("{name} is written {when}"));
            }
            self.saves.push(save);
        }
    }

    fn act(&mut self, action: Action, seen: &RenderState) {
        match action {
            Action::Open(path) => {
                self.state.clock.stop();
                self.state.choice = self.state.choice.of_another_file();
                self.chosen = self.state.choice.clone();
                self.ask(AskedScene { file: Some(path), choice: self.chosen.clone() }, false);
            }
            Action::Save(path) => {
                // A picture of one time is saved.
                self.state.clock.playing = false;
                let (layer, wipe) = (self.state.layer, self.state.wipe);
                match saved_as(&path) {
                    Ok(path) => self.saves.push(PendingSave { path, layer, wipe, of: None, is_told: false }),
                    Err(error) => self.state.notices.fail(error.to_string()),
                }
            }
            Action::CopyPicture => match self.picture(seen) {
                Some(picture) => {
                    let ([width, height], rgba) = picture;
                    let size = [width as usize, height as usize];
                    let image = egui::ColorImage::from_rgba_unmultiplied(size, &rgba);
                    self.egui.egui_ctx().copy_image(image);
                    self.state.notices.say(format!("picture of {width}×{height} pixels copied"));
                }
                None => self.state.notices.fail("there is no picture yet".to_owned()),
            },
            Action::CopyCommand => {
                let Some(command) = self.words() else {
                    let text = "no command draws this view: --eye and --target cannot describe an orthographic camera";
                    self.state.notices.fail(text.to_owned());
                    return;
                };
                self.egui.egui_ctx().copy_text(command.clone());
                (self.said)(&command);
                self.state.notices.say(command);
            }
            Action::Dismiss => self.shared.dismiss(),
            Action::FullScreen => {
                let full = self.window.fullscreen().is_none().then_some(winit::window::Fullscreen::Borderless(None));
                self.window.set_fullscreen(full);
            }
            Action::Quit => self.quits = true,
        }
        self.dirty = true;
    }

    fn tell(&mut self, written: Result<String>) {
        self.dirty = true;
        match written {
            Ok(text) => self.state.notices.say(text),
            Err(error) => self.state.notices.fail(format!("{error:#}")),
        }
    }

    /// Asks for the scene again when something else of it was chosen. Sliders change often: it waits until they rest.
    fn follow_choice(&mut self) {
        let is_read = self.navigated == Some(self.scene) || self.failed == Some(self.scene);
        if !is_read && self.again != Some(self.scene) {
            // What is chosen now is of the scene before; only its light goes on.
            self.state.choice = self.asked().choice.lit_as(&self.state.choice);
        }
        if self.state.choice != self.chosen {
            self.chosen = self.state.choice.clone();
            self.chooses_at = Some(self.drawn + SETTLED);
        }
        if self.chosen == self.asked().choice {
            self.chooses_at = None;
        }
        if self.chooses_at.is_none_or(|at| at > self.drawn) || !is_read {
            return;
        }
        self.chooses_at = None;
        let before = self.asked().clone();
        // Other animations and scenes have times of their own, and other scenes are seen from elsewhere.
        let other_scene = before.choice.scene != self.chosen.scene;
        if other_scene || before.choice.animation != self.chosen.animation {
            self.state.clock.time = self.state.clock.time.map(|_| 0.0);
        }
        self.ask(AskedScene { choice: self.chosen.clone(), ..before }, !other_scene);
    }

    /// File of the current scene; `None`: that of the command line.
    fn file(&self) -> Option<&Path> {
        self.scenes[self.navigated? as usize].file.as_deref()
    }

    /// The command that draws this view; `None` where no command can.
    fn words(&self) -> Option<String> {
        let navigation = self.state.navigation.as_ref();
        let moved = navigation.is_some_and(Navigation::moved);
        let camera = navigation.and_then(Navigation::words).map(|(_, words)| words);
        // The command is that of the side that is edited.
        let settings = Settings { knobs: self.state.knobs().clone(), ..self.state.settings.clone() };
        let settings = match self.shared.seen().facts {
            Some(facts) => facts.without_idle_blur(settings),
            None => settings,
        };
        let view = View {
            file: self.file(),
            named: navigation.and_then(Navigation::named).filter(|_| !moved),
            settings: &settings,
            choice: &self.scenes[self.navigated.unwrap_or(self.scene) as usize].choice,
            time: self.moment,
            camera,
        };
        (view.camera.is_some() || !moved).then(|| (self.command)(&view))
    }

    /// Sends the render request to the render thread if it has changed.
    fn want(&mut self) {
        let now = Instant::now();
        self.follow_choice();
        if self.state.moved {
            self.moving_until = Some(now + STILL);
        }
        self.moving_until = self.moving_until.filter(|until| *until > now);
        // A scene that is read again keeps its viewpoint.
        let belongs = self.navigated == Some(self.scene) || self.again == Some(self.scene);
        let from = |navigation: &Navigation| match (navigation.moved(), navigation.named()) {
            (true, _) => Viewpoint::Free(navigation.camera()),
            (false, Some(name)) => Viewpoint::Named(name.to_owned()),
            (false, None) => Viewpoint::Own,
        };
        let wanted = RenderRequest {
            scene: self.scene,
            file: self.asked().file.clone(),
            choice: self.asked().choice.clone(),
            time: self.state.clock.time,
            from: self.state.navigation.as_ref().filter(|_| belongs).map_or(Viewpoint::Own, from),
            settings: self.state.settings.clone(),
            other: self.state.other.clone(),
            moving: self.moving_until.is_some(),
            surfaces: self.state.wants_surfaces() || self.saves.iter().any(PendingSave::is_exr),
            triangles: self.state.layer.reads_triangles(),
            meter: self.state.meter,
            picked: self.state.picked.clone(),
            code: self.code.clone(),
            quit: false,
        };
        if self.navigated == Some(self.scene) {
            for save in &mut self.saves {
                save.of.get_or_insert_with(|| wanted.clone());
            }
        }
        if self.sent.as_ref().is_none_or(|sent| !sent.is_as(&wanted)) {
            let is_over = self.sent.as_ref().is_some_and(|sent| !sent.is_same_picture(&wanted));
            self.sent = Some(wanted.clone());
            self.shared.want(|now| {
                *now = wanted;
                if is_over {
                    self.device.interrupt();
                }
            });
        }
    }

    /// What the window shows, without panels: size in pixels and RGBA8. `None` before the first picture.
    fn picture(&self, seen: &RenderState) -> Option<([u32; 2], Vec<u8>)> {
        if self.state.layer == SurfaceLayer::Radiance {
            return self.shaded(seen);
        }
        let is_this = |layer: &&DrawnLayer| layer.layer == self.state.layer && layer.of == seen.versions();
        self.layer.as_ref().filter(is_this).map(|layer| (layer.size, layer.rgba.to_vec()))
    }

    /// The shaded picture, or both sides of the wipe line.
    fn shaded(&self, seen: &RenderState) -> Option<([u32; 2], Vec<u8>)> {
        let left = seen.shown()?;
        let mut rgba = left.rgba.to_vec();
        if let Some(right) = seen.sides[1].shown.as_ref().filter(|right| right.size == left.size) {
            let wipe = (self.state.wipe * left.size[0] as f32).round() as usize * 4;
            let rows = rgba.chunks_exact_mut(left.size[0] as usize * 4);
            for (row, other) in rows.zip(right.rgba.chunks_exact(left.size[0] as usize * 4)) {
                row[wipe..].copy_from_slice(&other[wipe..]);
            }
        }
        Some((left.size, rgba))
    }

    /// Marks a file as written by this window: it does not belong to the scene.
    fn mark(&self, path: &Path) {
        lock(&self.written).extend(path.file_name().map(OsString::from));
    }

    fn write_png(&self, seen: &RenderState, path: &Path) -> Result<String> {
        // A layer that is not there yet is no reason to lose the last picture.
        let picture = self.picture(seen).or_else(|| self.shaded(seen));
        let ([width, height], rgba) = picture.context("there is no picture yet")?;
        self.mark(path);
        let has_alpha = self.state.layer == SurfaceLayer::Radiance && seen.shown().is_some_and(|shown| shown.has_alpha);
        file::write(path, &png::encode_png(width, height, &rgba, has_alpha)?)?;
        let unfinished = seen.shown().filter(|shown| !shown.is_done());
        let so_far = unfinished
            .map_or_else(String::new, |shown| format!(" ({} of {} samples)", shown.samples[0], shown.samples[1]));
        Ok(format!("saved {}{so_far}", path.display()))
    }

    fn write_exr(&self, seen: &RenderState, path: &Path) -> Result<String> {
        let surfaces = seen.surfaces.as_ref().context("there is no picture yet")?;
        self.mark(path);
        let [width, height] = surfaces.size;
        let picture = Picture { width, height, rgba: surfaces.radiance[0].to_vec() };
        file::write(path, &exr::encode_exr(&picture, &[], &[])?)?;
        Ok(format!("saved {}", path.display()))
    }

    /// Logs the frame times of the window and its number of Vulkan objects.
    fn account(&self) {
        let mut sorted = self.took.clone();
        sorted.sort_by(f32::total_cmp);
        let at = |share: f64| sorted.get((share * sorted.len() as f64) as usize).copied().unwrap_or_default();
        tracing::info!(
            "{} window frames: median {:.1} ms, 95th percentile {:.1} ms, 99th percentile {:.1} ms; {} buffers, images and pipelines, {} after the first picture",
            self.pictures,
            at(0.5),
            at(0.95),
            at(0.99),
            self.device.objects(),
            self.objects.unwrap_or_default()
        );
    }

    /// Saves the last picture in the current folder after the device was lost, and adds the file name to the error.
    pub(crate) fn last_picture(&self, error: anyhow::Error) -> anyhow::Error {
        let mut names = (1..).map(|i| PathBuf::from(format!("last-picture-{i}.png")));
        let free = names.find(|path| !path.exists()).unwrap_or_default();
        match self.write_png(&self.shared.seen(), &free) {
            Ok(_) => error.context(format!("the last picture is saved as {}", free.display())),
            Err(_) => error,
        }
    }
}

/// The file that a picture is saved as: PNG without an ending.
///
/// # Errors
/// Another format's ending, or a PNG that exists: the dialog asks before it replaces the file of a name, but does not
/// know of the ending that is added.
fn saved_as(path: &Path) -> Result<PathBuf> {
    let Some(ending) = path.extension() else {
        let png = path.with_extension("png");
        ensure!(!png.exists(), "{} exists and is not replaced: give its whole name to replace it", png.display());
        return Ok(png);
    };
    let is_known = ["png", "exr"].iter().any(|known| ending.eq_ignore_ascii_case(known));
    ensure!(is_known, "{} is not written: only .png and .exr are written", path.display());
    Ok(path.to_owned())
}

/// Title, size and name of the window: the size that is asked for, or that of the last run, if the screen has room.
fn attributes(
    events: &ActiveEventLoop,
    asked: Option<[u32; 2]>,
    preferences: &Preferences,
    id: &str,
    (side, rgba): (u32, Vec<u8>),
) -> WindowAttributes {
    let [mut width, mut height] = asked.or(preferences.size).unwrap_or(DEFAULT_SIZE);
    let screen = events.primary_monitor().or_else(|| events.available_monitors().next()).map(|monitor| monitor.size());
    if let (Some(screen), None) = (screen.filter(|screen| screen.width > 0), asked) {
        // Borders and bars of the desktop need some room.
        (width, height) = (width.min(screen.width * 19 / 20), height.min(screen.height * 9 / 10));
    }
    let named = Window::default_attributes().with_title("Etalon");
    // On Wayland, the desktop entry of this name has the icon.
    #[cfg(all(unix, not(target_os = "macos")))]
    let named = WindowAttributesExtX11::with_name(named, id, id);
    named
        .with_window_icon(Icon::from_rgba(rgba, side, side).ok())
        .with_inner_size(PhysicalSize::new(width, height))
        .with_min_inner_size(PhysicalSize::new(160, 120))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_have_the_format_of_their_ending() {
        let saved = |name: &str| saved_as(Path::new(name)).ok().map(|path| path.display().to_string());
        assert_eq!(saved("a folder.d/a"), Some("a folder.d/a.png".to_owned()));
        assert_eq!(["a.PNG", "b.exr"].map(saved), ["a.PNG", "b.exr"].map(|name| Some(name.to_owned())));
        assert_eq!(["a.jpg", "b.png.txt"].map(saved), [None, None]);
        let folder = tempfile::tempdir().expect("a folder");
        let asked = folder.path().join("a");
        assert_eq!(saved_as(&asked).expect("a new file"), folder.path().join("a.png"));
        std::fs::write(folder.path().join("a.png"), b"a picture").expect("a file");
        assert!(saved_as(&asked).expect_err("a file of before").to_string().contains("is not replaced"));
    }
}
