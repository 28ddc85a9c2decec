//! The desktop viewer: a winit window, egui panels, and a render thread. See docs/view.md.
//!
//! The render thread ([`worker`]) loads the scene and draws samples progressively; before each sample it reads the
//! current request. The window shows the latest picture. It redraws only after an event, at most once in 16 ms.

pub mod choice;
pub mod clock;
pub mod equations;
pub mod layer;
pub mod layout;
pub mod lookup;
pub mod navigation;
pub mod panels;
pub mod preferences;
#[cfg(feature = "reload")]
pub mod reload;
pub mod shared;
mod window;
pub mod worker;

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context as _, Result, anyhow, bail};
use winit::application::ApplicationHandler;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::window::WindowId;

use etalon::frame::Settings;
use etalon::gpu::{DeviceChoice, Message};
use shared::{FileChoice, SceneSource};
use window::{FRAME, OpenWindow};

/// A view, to be written as a command line.
pub struct View<'a> {
    /// Scene file; `None`: that of the command line.
    pub file: Option<&'a Path>,
    /// Options for eye, target and field of view.
    pub camera: Option<String>,
    /// Key of a camera of the file.
    pub named: Option<&'a str>,
    /// Animation time in seconds; `None`: that of the command line.
    pub time: Option<f64>,
    /// Settings of the renderer.
    pub settings: &'a Settings,
    /// What of the file is shown, and what lights it.
    pub choice: &'a FileChoice,
}

/// Initial state of the viewer.
pub struct Start {
    /// Size of the window in pixels; `None`: that of the last run, or the default.
    pub size: Option<[u32; 2]>,
    /// Application id (Wayland) and class (X11) of the window: the name of its desktop entry.
    pub id: &'static str,
    /// Icon: side in pixels, and RGBA8.
    pub icon: (u32, Vec<u8>),
    /// Settings of the renderer.
    pub settings: Settings,
    /// Device that draws.
    pub device: DeviceChoice,
    /// Whether to enable core and synchronization validation.
    pub validate: bool,
    /// Whether to show the panels.
    pub panels: bool,
    /// What of the file is shown, and what lights it.
    pub choice: FileChoice,
    /// Loader of scenes.
    pub source: Box<dyn SceneSource>,
    /// Returns the command that draws a view.
    pub command: Box<dyn Fn(&View<'_>) -> String>,
    /// File of the scene, which is read again when it changes; `None` for a built-in scene.
    pub file: Option<PathBuf>,
    /// Animation time of the scene in seconds; `None` is the rest pose.
    pub time: Option<f64>,
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
                window.changed();
            }
            #[cfg(feature = "reload")]
            Woken::Compiled(compiled) => {
                window.compiled(compiled);
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
            let device = window.close();
            if window.render_thread_failed() && self.failure.is_none() {
                self.failure = Some(anyhow!("the render thread has failed"));
            }
            // Validation reports objects that still exist while the window is dropped.
            drop(window);
            self.messages = device.messages();
        }
    }
}
