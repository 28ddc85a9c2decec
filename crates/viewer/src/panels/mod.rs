//! The panels (egui), drawn from the results of the render thread. They change [`PanelState`] and request everything
//! else by [`Action`].

mod how;
mod picture;
mod pixel;
mod what;

use std::collections::VecDeque;
use std::path::PathBuf;

use egui::{Key, Modifiers, Ui};
use egui_file_dialog::{DialogState, FileDialog};

use super::clock::Clock;
use super::layer::SurfaceLayer;
use super::navigation::Navigation;
use super::shared::{Pick, RenderState};
use etalon::frame::Settings;
use etalon::gpu::{DeviceInfo, PassTime};
use etalon::plan::{KNOBS, Knobs};

/// Number of pictures whose pass times the chart shows.
const HISTORY: usize = 120;
/// Animation step of one frame in seconds.
const FILM_STEP: f64 = 1.0 / 24.0;

/// Requests of the panels to the window.
#[derive(Debug, Clone, PartialEq)]
pub enum Action {
    /// Open a file.
    Open(PathBuf),
    /// Save the picture as PNG.
    Screenshot,
    /// Save the radiance as EXR.
    Exr,
    /// Copy the command that draws this view to the clipboard.
    CopyCommand,
    /// Clear the last error.
    Dismiss,
    /// Close the window.
    Quit,
}

/// State of the user interface.
pub struct PanelState {
    /// Camera; `None` until a scene is loaded.
    pub navigation: Option<Navigation>,
    /// Settings of the renderer, with the size of the picture.
    pub settings: Settings,
    /// Knobs of a second picture, right of the wipe line.
    pub other: Option<Knobs>,
    /// Side whose knobs are edited: 0 left, 1 right.
    pub side: usize,
    /// Index of the knob that arrow keys change; `None` until one is selected.
    pub knob: Option<usize>,
    /// Position of the wipe line as a fraction of the picture's width.
    pub wipe: f32,
    /// Animation time.
    pub clock: Clock,
    /// Layer that is shown.
    pub layer: SurfaceLayer,
    /// Whether the panels are shown.
    pub panels: bool,
    /// Whether the help with all keys is shown.
    pub help: bool,
    /// Inspected pixel.
    pub picked: Option<Pick>,
    /// Message about a finished action.
    pub message: Option<String>,
    /// Whether the view moved in this frame.
    pub moved: bool,
    /// Left, top, right and bottom of the picture in pixels of the window.
    pub place: [i32; 4],
    /// Recently opened files, the latest first.
    pub recent: Vec<PathBuf>,
    /// Device that draws.
    pub device: DeviceInfo,
    /// File dialog.
    pub dialog: FileDialog,
    /// Pass times of the last pictures.
    pub history: VecDeque<Vec<PassTime>>,
    history_version: u64,
    /// Number of inspections so far.
    picks: u64,
    /// Facts of the inspected pixel.
    pixel: Option<pixel::PixelFacts>,
    /// Index of the event under the pointer.
    pointed: Option<usize>,
    /// Time of the user interface in seconds when the animation last advanced.
    played_at: f64,
}

impl PanelState {
    /// Initial state.
    #[must_use]
    pub fn new(settings: Settings, device: DeviceInfo, recent: Vec<PathBuf>) -> Self {
        Self {
            navigation: None,
            settings,
            other: None,
            side: 0,
            knob: None,
            wipe: 0.5,
            clock: Clock::default(),
            layer: SurfaceLayer::Radiance,
            panels: true,
            help: false,
            picked: None,
            message: None,
            moved: false,
            place: [0; 4],
            recent,
            device,
            // The search field of egui_file_dialog 0.15 is dark on black in a light theme.
            dialog: FileDialog::new()
                .show_search(false)
                .add_file_filter_extensions("scenes", vec!["glb", "gltf", "obj", "stl", "ply"])
                .default_file_filter("scenes"),
            history: VecDeque::new(),
            history_version: 0,
            picks: 0,
            pixel: None,
            pointed: None,
            played_at: 0.0,
        }
    }

    /// Whether the surfaces at the pixels are needed.
    #[must_use]
    pub fn wants_surfaces(&self) -> bool {
        self.layer != SurfaceLayer::Radiance || self.picked.is_some() || self.other.is_some()
    }

    /// First column of the window right of the wipe line.
    #[must_use]
    pub fn wipe_column(&self) -> i32 {
        let [left, _, right, _] = self.place;
        left + (self.wipe * (right - left) as f32).round() as i32
    }

    /// Starts a comparison with a copy of the knobs, or ends it.
    fn compare(&mut self, compares: bool) {
        (self.other, self.side) = (compares.then(|| self.settings.knobs.clone()), usize::from(compares));
    }

    /// Knobs of the edited side.
    fn knobs(&self) -> &Knobs {
        self.other.as_ref().filter(|_| self.side == 1).unwrap_or(&self.settings.knobs)
    }

    fn set_knobs(&mut self, knobs: Knobs) {
        match &mut self.other {
            Some(other) if self.side == 1 => *other = knobs,
            _ => self.settings.knobs = knobs,
        }
    }

    /// Selects the next (`by` = 1) or the previous (`by` = −1) knob.
    fn choose_knob(&mut self, by: isize) {
        let count = KNOBS.len() as isize;
        let at = self.knob.map_or(if by > 0 { 0 } else { count - 1 }, |at| (at as isize + by).rem_euclid(count));
        self.knob = Some(at as usize);
        self.tell_knob();
    }

    /// Sets the selected knob to the next or the previous rung that the other knobs allow, cyclically.
    fn turn_knob(&mut self, forth: bool) {
        let at = *self.knob.get_or_insert(0);
        let knob = &KNOBS[at];
        let now = knob.place(self.knobs());
        let count = knob.rungs.len();
        let steps = (1..count).map(|step| if forth { (now + step) % count } else { (now + count - step) % count });
        let turned = steps.filter_map(|rung| self.knobs().with(knob.name, knob.rungs[rung])).next();
        if let Some(knobs) = turned {
            self.set_knobs(knobs);
        }
        self.tell_knob();
    }

    fn tell_knob(&mut self) {
        let Some(knob) = self.knob.map(|at| &KNOBS[at]) else { return };
        self.message = Some(format!("{}={}: {}", knob.name, knob.rung(self.knobs()), knob.about));
    }

    /// Whether the file dialog is open: keys then type text.
    fn is_asking(&self) -> bool {
        *self.dialog.state() == DialogState::Open
    }

    fn aspect(&self) -> f64 {
        f64::from(self.settings.size[0]) / f64::from(self.settings.size[1].max(1))
    }
}

/// Shows one frame of the user interface; returns the requested actions.
pub fn show(root: &mut Ui, state: &mut PanelState, seen: &RenderState) -> Vec<Action> {
    let mut actions = Vec::new();
    state.moved = false;
    state.pointed = None;
    if let Some(shown) = seen.shown().filter(|shown| shown.version != state.history_version && !shown.moving) {
        state.history_version = shown.version;
        state.history.push_back(shown.passes.clone());
        if state.history.len() > HISTORY {
            state.history.pop_front();
        }
    }
    keys(root, state, seen, &mut actions);
    if state.panels {
        egui::Panel::top("bar").show(root, |ui| bar(ui, state, seen, &mut actions));
        egui::Panel::left("how").default_size(280.0).show(root, |ui| {
            egui::ScrollArea::vertical().show(ui, |ui| how::show(ui, state, seen));
        });
        egui::Panel::right("what").default_size(300.0).show(root, |ui| {
            egui::ScrollArea::vertical().show(ui, |ui| what::show(ui, state, seen));
        });
    }
    play(root, state, seen);
    picture::show(root, state, seen);
    state.dialog.update(root.ctx());
    actions.extend(state.dialog.take_picked().map(Action::Open));
    notices(root, state, seen);
    if state.help {
        help(root, state);
    }
    actions
}

/// Advances a playing animation once the picture of the last time is shown. A scene that is drawn slowly plays slowly,
/// without jumps.
fn play(ui: &Ui, state: &mut PanelState, seen: &RenderState) {
    let now = ui.input(|input| input.time);
    let since = now - std::mem::replace(&mut state.played_at, now);
    let Some(duration) = seen.facts.as_ref().and_then(|facts| facts.duration).filter(|_| state.clock.playing) else {
        return;
    };
    state.moved = true;
    ui.ctx().request_repaint();
    match seen.shown().is_some_and(|shown| shown.time == state.clock.time) {
        true => state.clock.advance(since.min(0.1), duration),
        // The elapsed time is counted from the last picture.
        false => state.played_at = now - since,
    }
}

/// The top bar: file, device, state of the picture, and buttons. In a narrow window the text is truncated, not the
/// buttons.
fn bar(ui: &mut Ui, state: &mut PanelState, seen: &RenderState, actions: &mut Vec<Action>) {
    let (mut opened, mut asked) = (None, Vec::new());
    let helps = &mut state.help;
    let dialog = &mut state.dialog;
    let (recent, device) = (&state.recent, &state.device);
    let facts = |ui: &mut Ui| {
        ui.menu_button("Open", |ui| {
            if ui.button("File … (O)").clicked() {
                dialog.pick_file();
                ui.close();
            }
            for path in recent {
                if ui.button(path.display().to_string()).clicked() {
                    opened = Some(Action::Open(path.clone()));
                    ui.close();
                }
            }
        });
        let name = seen.facts.as_ref().map_or("no scene", |facts| &facts.name);
        ui.strong(name);
        if let Some(facts) = &seen.facts {
            let [triangles, instances, lights] = facts.counts;
            ui.weak(format!("{triangles} triangles, {instances} instances, {lights} lights"));
        }
        ui.separator();
        if device.kind == "cpu" {
            ui.colored_label(ui.visuals().warn_fg_color, "Software rendering (no GPU)")
                .on_hover_text(format!("{} ({}): the CPU computes every pixel", device.name, device.driver));
        } else {
            ui.weak(&device.name).on_hover_text(&device.driver);
        }
        ui.separator();
        if let Some(shown) = seen.shown() {
            let [done, of] = shown.samples;
            let ms = shown.ms();
            let moving = if shown.moving { ", moving" } else { "" };
            ui.label(format!("{}×{}{moving}: {done} of {of} samples, {ms:.1} ms each", shown.size[0], shown.size[1]));
        }
        let wrong = seen.shown().map_or(0, |shown| shown.counts.nan + shown.counts.inf);
        if wrong > 0 {
            ui.colored_label(ui.visuals().error_fg_color, format!("{wrong} invalid pixels (NaN or infinite)"))
                .on_hover_text("view: NaN and infinity shows them");
        }
    };
    let buttons = |ui: &mut Ui| {
        egui::widgets::global_theme_preference_switch(ui);
        if ui.button("Help").on_hover_text("H").clicked() {
            *helps = !*helps;
        }
        for (name, key, action) in
            [("Copy command", "C", Action::CopyCommand), ("EXR", "E", Action::Exr), ("PNG", "S", Action::Screenshot)]
        {
            if ui.button(name).on_hover_text(key).clicked() {
                asked.push(action);
            }
        }
    };
    egui::Sides::new().shrink_left().truncate().show(ui, facts, buttons);
    actions.extend(opened.into_iter().chain(asked));
}

/// Messages over the picture: the last error, the current long operation, or a finished action.
fn notices(ui: &mut Ui, state: &mut PanelState, seen: &RenderState) {
    let area = |id: &str, offset: f32| {
        egui::Area::new(egui::Id::new(id.to_owned())).anchor(egui::Align2::CENTER_BOTTOM, egui::vec2(0.0, offset))
    };
    if let Some(error) = &seen.error {
        area("error", -16.0).show(ui.ctx(), |ui| {
            egui::Frame::popup(ui.style()).show(ui, |ui| {
                ui.set_max_width(640.0);
                ui.colored_label(ui.visuals().error_fg_color, error);
            });
        });
    }
    let said = seen.busy.as_ref().map(|busy| format!("{busy} …")).or_else(|| state.message.clone());
    if let Some(said) = said {
        area("said", -64.0).show(ui.ctx(), |ui| {
            egui::Frame::popup(ui.style()).show(ui, |ui| {
                // Without a minimum width, egui makes the area as narrow as the line breaks allow.
                ui.set_min_width((7.0 * said.len() as f32).min(640.0));
                ui.set_max_width(640.0);
                ui.label(said)
            });
        });
    }
}

const KEYS: &[(&str, &str)] = &[
    ("drag", "orbit"),
    ("Shift+drag, middle drag", "pan"),
    ("right drag", "look around"),
    ("wheel, pinch", "zoom"),
    ("W X A D Q Z", "fly forwards, back, left, right, up, down"),
    ("F", "frame the whole scene"),
    ("R, Home", "reset the view"),
    ("Ctrl+Z", "undo camera move"),
    ("1 to 9", "cameras of the file"),
    ("Space; comma, full stop", "play or pause; one frame back, forward"),
    ("V", "compare two settings"),
    ("up, down; left, right", "select a knob; change its rung"),
    ("Ctrl+click", "inspect a pixel and its rays"),
    ("O", "open a file"),
    ("P", "show or hide the panels"),
    ("S, E, C", "save a PNG, save an EXR, copy the command"),
    ("Escape", "close messages and help"),
    ("Ctrl+Q", "quit"),
    ("H, ?", "show or hide this help"),
];

fn help(ui: &mut Ui, state: &mut PanelState) {
    let mut open = true;
    let middle = ui.ctx().content_rect().center();
    let window = egui::Window::new("Keys").pivot(egui::Align2::CENTER_CENTER).default_pos(middle);
    window.open(&mut open).resizable(false).collapsible(false).show(ui.ctx(), |ui| {
        egui::Grid::new("keys").num_columns(2).striped(true).show(ui, |ui| {
            for (key, does) in KEYS {
                ui.strong(*key);
                ui.label(*does);
                ui.end_row();
            }
        });
        ui.label("Drop a file on the window to open it.");
    });
    state.help &= open;
}

fn go_to(state: &mut PanelState, seen: &RenderState, index: usize) {
    let camera = seen.facts.as_ref().and_then(|facts| facts.cameras.get(index));
    if let (Some(navigation), Some(camera)) = (&mut state.navigation, camera) {
        navigation.go_to(camera.clone(), Some(camera.name.clone()));
        state.moved = true;
    }
}

fn keys(ui: &mut Ui, state: &mut PanelState, seen: &RenderState, actions: &mut Vec<Action>) {
    for file in ui.input(|input| input.raw.dropped_files.clone()) {
        actions.push(Action::Open(file.path().to_owned()));
    }
    if ui.ctx().text_edit_focused() || state.is_asking() {
        return;
    }
    // A held key counts once here; for knobs and animation time (`count` below) it repeats.
    let pressed = |key: Key| {
        ui.input_mut(|input| {
            let again =
                |event: &egui::Event| matches!(event, egui::Event::Key { key: k, repeat: true, .. } if *k == key);
            let repeats = input.events.iter().any(again);
            input.consume_key(Modifiers::NONE, key) && !repeats
        })
    };
    for (key, action) in [(Key::S, Action::Screenshot), (Key::E, Action::Exr), (Key::C, Action::CopyCommand)] {
        if pressed(key) {
            actions.push(action);
        }
    }
    if pressed(Key::O) {
        state.dialog.pick_file();
    }
    if pressed(Key::P) {
        state.panels = !state.panels;
    }
    if pressed(Key::H) | pressed(Key::Questionmark) {
        state.help = !state.help;
    }
    if pressed(Key::Escape) {
        (state.help, state.message, state.picked) = (false, None, None);
        actions.push(Action::Dismiss);
    }
    // Each key press counts: a slow frame may receive several at once.
    let count = |key: Key| ui.input_mut(|input| input.count_and_consume_key(Modifiers::NONE, key));
    (0..count(Key::ArrowUp)).for_each(|_| state.choose_knob(-1));
    (0..count(Key::ArrowDown)).for_each(|_| state.choose_knob(1));
    (0..count(Key::ArrowLeft)).for_each(|_| state.turn_knob(false));
    (0..count(Key::ArrowRight)).for_each(|_| state.turn_knob(true));
    if pressed(Key::V) {
        state.compare(state.other.is_none());
    }
    if let Some(duration) = seen.facts.as_ref().and_then(|facts| facts.duration) {
        let steps = count(Key::Period) as f64 - count(Key::Comma) as f64;
        if steps != 0.0 {
            state.clock.playing = false;
            let at = (state.clock.time.unwrap_or_default() / FILM_STEP).round();
            state.clock.set((at + steps) * FILM_STEP, duration);
        }
        if pressed(Key::Space) {
            state.clock.playing = !state.clock.playing;
        }
    }
    let (fits, home) = (pressed(Key::F), pressed(Key::R) | pressed(Key::Home));
    let numbers = [Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5, Key::Num6, Key::Num7, Key::Num8, Key::Num9];
    let camera = numbers.into_iter().position(pressed);
    let (undone, quits) = ui.input_mut(|input| {
        (input.consume_key(Modifiers::COMMAND, Key::Z), input.consume_key(Modifiers::COMMAND, Key::Q))
    });
    if quits {
        actions.push(Action::Quit);
    }
    let aspect = state.aspect();
    if let Some(navigation) = &mut state.navigation {
        if fits {
            navigation.fit(aspect);
        }
        if home {
            navigation.reset();
        }
        state.moved |= fits || home || (undone && navigation.undo());
    }
    if let Some(index) = camera {
        go_to(state, seen, index);
    }
}
