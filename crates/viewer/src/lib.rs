//! The desktop viewer: a winit window, egui panels, and a render thread. See docs/view.md.
//!
//! The render thread ([`worker`]) loads the scene and draws samples progressively; before each sample it reads the
//! current request. The window shows the latest picture. It redraws only after an event, at most once in 16 ms.

pub mod clock;
pub mod equations;
pub mod layer;
pub mod navigation;
pub mod panels;
#[cfg(feature = "reload")]
pub mod reload;
pub mod shared;
pub mod worker;

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, anyhow, bail};
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::window::{Window, WindowId};

use etalon::frame::Settings;
use etalon::gpu::{DeviceChoice, Message, Overlay, PlacedPicture, Presented, Presenter, Replacement};
use etalon::image::{Picture, exr, file, png};
use layer::SurfaceLayer;
use navigation::Navigation;
use panels::{Action, PanelState};
use shared::{RenderRequest, RenderState, SceneSource, SharedState, Viewpoint, lock};
use worker::Worker;

/// Least time between two frames of the window: a driver's FIFO present mode does not always wait for a screen.
const FRAME: Duration = Duration::from_millis(16);
/// Number of window frames whose times are kept for the statistics at the end.
const REMEMBERED: usize = 100_000;
/// Time without movement before the picture is drawn at full quality.
const STILL: Duration = Duration::from_millis(150);

/// A view, to be written as a command line.
pub struct View<'a> {
    /// Scene file; `None`: that of the command line.
    pub file: Option<&'a Path>,
    /// Options for eye, target and field of view.
    pub camera: Option<String>,
    /// Name of a camera of the file.
    pub named: Option<&'a str>,
    /// Animation time in seconds; `None`: that of the command line.
    pub time: Option<f64>,
    /// Settings of the renderer.
    pub settings: &'a Settings,
}

/// Stores the list of recent files.
pub type Keep = Box<dyn Fn(&[PathBuf])>;

/// Initial state of the viewer.
pub struct Start {
    /// Size of the window in pixels.
    pub size: [u32; 2],
    /// Settings of the renderer.
    pub settings: Settings,
    /// Device that draws.
    pub device: DeviceChoice,
    /// Whether to enable core and synchronization validation.
    pub validate: bool,
    /// Whether to show the panels.
    pub panels: bool,
    /// Loader of scenes.
    pub source: Box<dyn SceneSource>,
    /// Returns the command that draws a view.
    pub command: Box<dyn Fn(&View<'_>) -> String>,
    /// File of the scene, which is read again when it changes; `None` for a built-in scene.
    pub file: Option<PathBuf>,
    /// Recently opened files, the latest first.
    pub recent: Vec<PathBuf>,
    /// Stores the recent files.
    pub keep: Keep,
    /// Called with each copied command.
    pub said: Box<dyn Fn(&str)>,
}

/// Events that other threads send to the window.
enum Woken {
    /// The render thread has something to show.
    RenderState,
    /// The scene file, or a file beside it, has changed.
    Changed,
    /// Shaders were recompiled.
    #[cfg(feature = "reload")]
    Compiled(reload::Compiled),
}

/// File name extensions of scene files, buffers and textures.
const PARTS: [&str; 12] = ["glb", "gltf", "bin", "obj", "mtl", "stl", "ply", "png", "jpg", "jpeg", "webp", "ktx2"];
/// Time without another change before a file is read again.
const SETTLED: Duration = Duration::from_millis(300);

/// Shows a window until it is closed; returns the messages of validation.
///
/// # Errors
/// When there is no display, when no device can present on it, or when the device is lost.
pub fn run(start: Start) -> Result<Vec<Message>> {
    let named = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    let instead = "`etalon render SCENE -o FILE.png` draws the same picture without a display";
    if cfg!(all(unix, not(target_os = "macos")))
        && !["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"].into_iter().any(named)
    {
        bail!("opening a window: neither DISPLAY nor WAYLAND_DISPLAY is set; {instead}");
    }
    let events = EventLoop::<Woken>::with_user_event()
        .build()
        .map_err(|error| anyhow!("opening a window: {error}; {instead}"))?;
    let proxy = events.create_proxy();
    let mut viewer = Viewer { start: Some(start), proxy, window: None, failure: None, messages: Vec::new() };
    events.run_app(&mut viewer).context("running the window")?;
    match viewer.failure {
        Some(error) => Err(error),
        None => Ok(viewer.messages),
    }
}

struct Viewer {
    start: Option<Start>,
    proxy: EventLoopProxy<Woken>,
    window: Option<OpenWindow>,
    failure: Option<anyhow::Error>,
    messages: Vec<Message>,
}

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

/// The window, its panels and the connection to the render thread.
struct OpenWindow {
    window: Arc<Window>,
    presenter: Presenter,
    device: Arc<etalon::gpu::Device>,
    shared: Arc<SharedState>,
    worker: Option<JoinHandle<()>>,
    egui: egui_winit::State,
    state: PanelState,
    command: Box<dyn Fn(&View<'_>) -> String>,
    said: Box<dyn Fn(&str)>,
    keep: Keep,
    /// File of each opened scene, by scene number; `None`: that of the command line.
    files: Vec<Option<PathBuf>>,
    scene: u64,
    /// Number of the scene that the navigation belongs to; `None` until one is loaded.
    navigated: Option<u64>,
    moment: Option<f64>,
    sent: Option<RenderRequest>,
    moving_until: Option<Instant>,
    drawn: Instant,
    dirty: bool,
    wait_until: Option<Instant>,
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
    /// When the scene file is read again.
    reads_at: Option<Instant>,
    /// Number of a scene that is read again; its camera stays.
    again: Option<u64>,
    writes_exr: bool,
    /// Shader code that replaces built code.
    code: Arc<Vec<Replacement>>,
    /// Watches the shader files.
    #[cfg(feature = "reload")]
    _shaders: notify::RecommendedWatcher,
    quits: bool,
}

impl ApplicationHandler<Woken> for Viewer {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        let Some(start) = self.start.take() else { return };
        match OpenWindow::new(events, start, self.proxy.clone()) {
            Ok(window) => self.window = Some(window),
            Err(error) => {
                self.failure = Some(error);
                events.exit();
            }
        }
    }

    fn user_event(&mut self, _: &ActiveEventLoop, woken: Woken) {
        let Some(window) = &mut self.window else { return };
        match woken {
            Woken::RenderState => window.dirty = true,
            Woken::Changed => {
                window.reads_at = Some(Instant::now() + SETTLED);
                window.dirty = true;
            }
            #[cfg(feature = "reload")]
            Woken::Compiled(compiled) => {
                window.dirty = true;
                window.state.message = Some(match compiled {
                    Ok(code) => {
                        window.code = code;
                        "shaders recompiled".to_owned()
                    }
                    Err(message) => message,
                });
            }
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(window) = &mut self.window else { return };
        // egui answers a redraw request with another redraw request: the window would never rest.
        if event != WindowEvent::RedrawRequested {
            window.dirty |= window.egui.on_window_event(&window.window, &event).repaint;
        }
        match event {
            WindowEvent::CloseRequested => window.quits = true,
            WindowEvent::Resized(_) | WindowEvent::ScaleFactorChanged { .. } => {
                window.presenter.resized();
                window.dirty = true;
            }
            WindowEvent::RedrawRequested => {
                if let Err(error) = window.draw() {
                    self.failure = Some(window.last_picture(error));
                    window.quits = true;
                }
            }
            _ => {}
        }
        if window.quits {
            events.exit();
        }
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        let Some(window) = &mut self.window else { return };
        let now = Instant::now();
        window.dirty |= window.wait_until.is_some_and(|until| until <= now);
        let next = window.drawn + FRAME;
        if window.dirty && next <= now {
            window.dirty = false;
            window.wait_until = None;
            window.window.request_redraw();
        }
        let until = if window.dirty { Some(next) } else { window.wait_until };
        events.set_control_flow(until.map_or(ControlFlow::Wait, ControlFlow::WaitUntil));
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        if let Some(mut window) = self.window.take() {
            window.account();
            window.shared.want(|wanted| {
                wanted.quit = true;
                window.device.interrupt();
            });
            if window.worker.take().is_some_and(|worker| worker.join().is_err()) && self.failure.is_none() {
                self.failure = Some(anyhow!("the render thread has failed"));
            }
            let device = window.device.clone();
            // Validation reports objects that still exist while the window is dropped.
            drop(window);
            self.messages = device.messages();
        }
    }
}

impl OpenWindow {
    fn new(events: &ActiveEventLoop, start: Start, proxy: EventLoopProxy<Woken>) -> Result<Self> {
        let Start { size, settings, device: choice, validate, panels, source, command, said, file, recent, keep } =
            start;
        let attributes = Window::default_attributes()
            .with_title("Etalon")
            .with_inner_size(PhysicalSize::new(size[0], size[1]))
            .with_min_inner_size(PhysicalSize::new(160, 120));
        let window = Arc::new(events.create_window(attributes).context("opening a window")?);
        let (device, presenter) = Presenter::open(window.clone(), &choice, validate)?;
        let mut state = PanelState::new(settings.clone(), device.info().clone(), recent);
        state.panels = panels;
        let wanted = RenderRequest::new(settings);
        let context = egui::Context::default();
        let native = Some(window.scale_factor() as f32);
        let side = device.max_image_size() as usize;
        let egui =
            egui_winit::State::new(context, egui::ViewportId::ROOT, &*window, native, window.theme(), Some(side));
        let (code, sent) = (wanted.code.clone(), Some(wanted.clone()));
        let shared = Arc::new(SharedState::new(wanted));
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
            reload::watch(root, move |compiled| drop(proxy.send_event(Woken::Compiled(compiled))))?
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
            keep,
            files: vec![None],
            scene: 0,
            navigated: None,
            moment: None,
            sent,
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
            reads_at: None,
            again: None,
            writes_exr: false,
            code,
            #[cfg(feature = "reload")]
            _shaders: shaders,
            quits: false,
        };
        new.watch();
        Ok(new)
    }

    /// Draws one frame of the window.
    fn draw(&mut self) -> Result<()> {
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
        if let Some(at) = self.reads_at {
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
        let place = self.state.place;
        let [left, _, right, _] = place;
        let pictures: Vec<PlacedPicture<'_>> = match &layer {
            Some(DrawnLayer { rgba, size, version, .. }) => {
                vec![PlacedPicture { rgba, size: *size, version: *version, place, columns: [left, right] }]
            }
            None => {
                let wipe = seen.sides[1].shown.as_ref().map_or(right, |_| self.state.wipe_column());
                let columns = [[left, wipe], [wipe, right]];
                let shown = seen.sides.iter().filter_map(|side| side.shown.as_ref());
                let placed = shown.zip(columns).map(|(shown, columns)| PlacedPicture {
                    rgba: &shown.rgba,
                    size: shown.size,
                    version: 2 * shown.version,
                    place,
                    columns,
                });
                placed.collect()
            }
        };
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

    /// Moves the current file to the front of the recent files.
    fn remember(&mut self) {
        let Some(path) = self.file().or(self.first.as_deref()) else { return };
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let recent = &mut self.state.recent;
        recent.retain(|known| *known != path);
        recent.insert(0, path);
        recent.truncate(10);
        (self.keep)(recent);
    }

    /// Watches the current file and the buffers and textures beside it for changes.
    fn watch(&mut self) {
        self.watcher = None;
        let Some(path) = self.file().or(self.first.as_deref()) else { return };
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
        let same = self.files.get(self.scene as usize).cloned().flatten();
        self.scene = self.files.len() as u64;
        self.again = Some(self.scene);
        self.files.push(same);
    }

    /// Pixels of the chosen layer; `None` for the shaded picture.
    fn drawn_layer(&mut self, seen: &RenderState) -> Option<DrawnLayer> {
        let layer = self.state.layer;
        let surfaces = seen.now().filter(|_| layer != SurfaceLayer::Radiance)?;
        let is_drawn = |known: &DrawnLayer| known.layer == layer && known.of == surfaces.versions;
        if !self.layer.as_ref().is_some_and(is_drawn) {
            self.layers += 1;
            // Layers have odd versions, pictures have even ones.
            let version = 2 * self.layers + 1;
            let rgba = Arc::new(layer.draw(surfaces));
            self.layer = Some(DrawnLayer { layer, of: surfaces.versions, rgba, size: surfaces.size, version });
        }
        self.layer.clone()
    }

    /// Takes over the state of the render thread.
    fn follow(&mut self, seen: &RenderState) {
        if let Some(facts) = seen.facts.as_ref().filter(|facts| Some(facts.scene) != self.navigated) {
            self.navigated = Some(facts.scene);
            match (&mut self.state.navigation, self.again == Some(facts.scene)) {
                (Some(navigation), true) => navigation.stay(facts.home.clone(), facts.bounds),
                _ => {
                    self.state.navigation = Some(Navigation::new(facts.home.clone(), facts.bounds, facts.framed));
                    self.state.settings.knobs = facts.knobs.clone().unwrap_or(self.state.settings.knobs.clone());
                    self.state.settings.exposure = facts.exposure;
                }
            }
            self.state.picked = None;
            self.remember();
            self.watch();
            self.window.set_title(&format!("{} – Etalon", facts.name));
        } else if let (Some(facts), Some(navigation)) = (&seen.facts, &mut self.state.navigation)
            && facts.time != self.moment
        {
            navigation.moment(facts.home.clone(), &facts.cameras);
        }
        self.moment = seen.facts.as_ref().and_then(|facts| facts.time);
        if seen.failed == Some(self.scene) {
            self.scene = self.navigated.unwrap_or(self.scene);
        }
        if self.objects.is_none() && seen.shown().is_some_and(shared::Shown::is_done) {
            self.objects = Some(self.device.objects());
        }
        if self.writes_exr && seen.now().is_some() && seen.shown().is_some_and(shared::Shown::is_done) {
            self.writes_exr = false;
            self.state.message = Some(told(self.write_exr(seen)));
        }
    }

    fn act(&mut self, action: Action, seen: &RenderState) {
        match action {
            Action::Open(path) => {
                self.scene = self.files.len() as u64;
                self.files.push(Some(path));
                self.state.clock.stop();
            }
            Action::Screenshot => self.state.message = Some(told(self.write_png(seen))),
            Action::Exr => self.writes_exr = true,
            Action::CopyCommand => {
                let Some(command) = self.words() else {
                    self.state.message = Some(
                        "no command draws this view: --eye and --target cannot describe an orthographic camera or a view straight up or down"
                            .to_owned(),
                    );
                    return;
                };
                self.egui.egui_ctx().copy_text(command.clone());
                (self.said)(&command);
                self.state.message = Some(command);
            }
            Action::Dismiss => self.shared.dismiss(),
            Action::Quit => self.quits = true,
        }
        self.dirty = true;
    }

    /// File of the current scene; `None`: that of the command line.
    fn file(&self) -> Option<&Path> {
        self.files.get(self.navigated? as usize)?.as_deref()
    }

    /// The command that draws this view; `None` where no command can.
    fn words(&self) -> Option<String> {
        let navigation = self.state.navigation.as_ref();
        let moved = navigation.is_some_and(Navigation::moved);
        let camera = navigation.and_then(Navigation::words).map(|(_, words)| words);
        let view = View {
            file: self.file(),
            named: navigation.and_then(Navigation::named).filter(|_| !moved),
            settings: &self.state.settings,
            time: self.moment,
            camera,
        };
        (view.camera.is_some() || !moved).then(|| (self.command)(&view))
    }

    /// Sends the render request to the render thread if it has changed.
    fn want(&mut self) {
        let now = Instant::now();
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
            file: self.files.get(self.scene as usize).cloned().flatten(),
            time: self.state.clock.time,
            from: self.state.navigation.as_ref().filter(|_| belongs).map_or(Viewpoint::Own, from),
            settings: self.state.settings.clone(),
            other: self.state.other.clone(),
            moving: self.moving_until.is_some(),
            surfaces: self.state.wants_surfaces() || self.writes_exr,
            picked: self.state.picked,
            code: self.code.clone(),
            quit: false,
        };
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

    /// A file name that does not exist yet, in the current folder.
    fn free_name(&self, seen: &RenderState, ending: &str) -> PathBuf {
        let name = seen.facts.as_ref().map_or("scene", |facts| &facts.name);
        let plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
        let mut all = (1..).map(|i| PathBuf::from(format!("{plain}-{i}.{ending}")));
        let free = all.find(|path| !path.exists()).unwrap_or_default();
        lock(&self.written).extend(free.file_name().map(OsString::from));
        free
    }

    fn write_png(&self, seen: &RenderState) -> Result<PathBuf> {
        let shown = seen.shown().context("there is no picture yet")?;
        let path = self.free_name(seen, "png");
        file::write(&path, &png::encode_png(shown.size[0], shown.size[1], &shown.rgba, false)?)?;
        Ok(path)
    }

    fn write_exr(&self, seen: &RenderState) -> Result<PathBuf> {
        let surfaces = seen.surfaces.as_ref().context("there is no picture yet")?;
        let path = self.free_name(seen, "exr");
        let [width, height] = surfaces.size;
        let picture = Picture { width, height, rgba: surfaces.radiance[0].to_vec() };
        file::write(&path, &exr::encode_exr(&picture, &[], &[])?)?;
        Ok(path)
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

    /// Saves the last picture after the device was lost, and adds the file name to the error.
    fn last_picture(&self, error: anyhow::Error) -> anyhow::Error {
        match self.write_png(&self.shared.seen()) {
            Ok(path) => error.context(format!("the last picture is saved as {}", path.display())),
            Err(_) => error,
        }
    }
}

fn told(written: Result<PathBuf>) -> String {
    match written {
        Ok(path) => format!("saved {}", path.display()),
        Err(error) => format!("{error:#}"),
    }
}
