//! The panels (egui), drawn from the results of the render thread. They change [`PanelState`] and request everything
//! else by [`Action`].

pub mod commands;
mod display;
mod docks;
mod light;
mod menu;
mod notices;
mod options;
mod overlay;
mod picture;
mod pixel;
mod plan;
mod scene;
mod style;
mod timing;

use std::collections::{BTreeSet, HashMap, VecDeque};
use std::path::PathBuf;

use egui::text_selection::LabelSelectionState;
use egui::util::undoer::Undoer;
use egui::{Key, Modifiers, TextureHandle, Ui};
use egui_file_dialog::{DialogState, FileDialog};
use glam::DVec3;

use super::clock::Clock;
use super::layer::SurfaceLayer;
use super::layout::{Docks, Pane};
use super::navigation::{Navigation, View};
use super::preferences::Preferences;
use super::shared::{FileChoice, Pick, RenderState};
use commands::{COMMANDS, MenuCommand};
use etalon::frame::Settings;
use etalon::gpu::{DeviceInfo, PassTime};
use etalon::plan::{KNOBS, Knobs, Model};
use etalon::scene::Camera;
pub use notices::Notices;

/// Number of pictures whose pass times the chart shows.
const HISTORY: usize = 120;
/// Animation step of one frame in seconds.
const FILM_STEP: f64 = 1.0 / 24.0;
/// Time without a change in seconds after which the state can be returned to.
const SETTLED: f32 = 0.5;

/// Requests of the panels to the window.
#[derive(Debug, Clone, PartialEq)]
pub enum Action {
    /// Open a file, or a study scene by `study:NAME`.
    Open(PathBuf),
    /// Save what is shown as PNG, or the radiance as EXR, by the ending of the name.
    Save(PathBuf),
    /// Copy what is shown to the clipboard.
    CopyPicture,
    /// Copy the command that draws this view to the clipboard.
    CopyCommand,
    /// Clear the last error.
    Dismiss,
    /// Change between a window and the full screen.
    FullScreen,
    /// Close the window.
    Quit,
}

/// What a click on the picture waits for: the surfaces at the pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Click {
    Select,
    Focus,
    Measure,
}

/// A click that waits, with the view that it was made in.
#[derive(Debug, Clone, PartialEq)]
struct Clicked {
    click: Click,
    pixel: [u32; 2],
    size: [u32; 2],
    seen_from: Camera,
}

/// What the file dialog was opened for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Asked {
    Scene,
    Environment,
    Save,
}

/// What undo returns to.
#[derive(Clone, PartialEq)]
struct Undoable {
    settings: Settings,
    other: Option<Knobs>,
    side: usize,
    choice: FileChoice,
    layer: SurfaceLayer,
    view: Option<View>,
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
    /// What of the file is shown, and what lights it.
    pub choice: FileChoice,
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
    /// Selected node of the outline.
    pub selected: Option<usize>,
    /// Measured points in world space.
    pub measured: Vec<DVec3>,
    /// Number of the last metering that was asked for.
    pub meter: u64,
    /// Messages about finished actions.
    pub notices: Notices,
    /// Whether the view moved in this frame.
    pub moved: bool,
    /// Left, top, right and bottom of the picture in pixels of the window.
    pub place: [i32; 4],
    /// Width and height in pixels of the area that the picture may fill.
    room: [u32; 2],
    /// Recently opened files, the latest first.
    pub recent: Vec<PathBuf>,
    /// Device that draws.
    pub device: DeviceInfo,
    /// What is remembered.
    pub preferences: Preferences,
    /// File dialog.
    pub dialog: FileDialog,
    /// Pass times of the last pictures.
    pub history: VecDeque<Vec<PassTime>>,
    asked: Asked,
    /// Control that has the focus.
    focused: Option<egui::Id>,
    /// Whether it has it since the last frame alone.
    focus_is_new: bool,
    /// Panel that comes before those that share its place.
    forward: Option<Pane>,
    history_version: u64,
    /// Passes in the order in which they were first seen: their colours.
    passes: Vec<String>,
    /// Number of inspections so far.
    picks: u64,
    /// Facts of the inspected pixel.
    pixel: Option<pixel::PixelFacts>,
    /// Index of the event under the pointer.
    pointed: Option<usize>,
    /// Keys that were pressed alone and are held.
    held: BTreeSet<Key>,
    /// Whether clicks set points of a measurement.
    measures: bool,
    /// A click that waits for the surfaces at the pixels.
    clicked: Option<Clicked>,
    /// Nodes of the tree whose children are listed.
    expanded: BTreeSet<usize>,
    /// Text that names of the tree contain.
    filter: String,
    /// Metering that is already applied.
    metered: u64,
    undoer: Undoer<Undoable>,
    /// Small pictures of recent files.
    pub(crate) small: HashMap<PathBuf, Option<TextureHandle>>,
    /// Time of the user interface in seconds when the animation last advanced.
    played_at: f64,
}

impl PanelState {
    /// Initial state.
    #[must_use]
    pub fn new(
        settings: Settings,
        choice: FileChoice,
        device: DeviceInfo,
        recent: Vec<PathBuf>,
        preferences: Preferences,
    ) -> Self {
        Self {
            navigation: None,
            room: settings.size,
            settings,
            other: None,
            side: 0,
            knob: None,
            wipe: 0.5,
            choice,
            clock: Clock::default(),
            layer: SurfaceLayer::Radiance,
            panels: true,
            help: false,
            picked: None,
            selected: None,
            measured: Vec::new(),
            meter: 0,
            notices: Notices::default(),
            moved: false,
            place: [0; 4],
            recent,
            device,
            preferences,
            dialog: FileDialog::new(),
            history: VecDeque::new(),
            asked: Asked::Scene,
            focused: None,
            focus_is_new: false,
            forward: None,
            history_version: 0,
            passes: Vec::new(),
            picks: 0,
            pixel: None,
            pointed: None,
            held: BTreeSet::new(),
            measures: false,
            clicked: None,
            expanded: BTreeSet::new(),
            filter: String::new(),
            metered: 0,
            undoer: Undoer::with_settings(egui::util::undoer::Settings {
                stable_time: SETTLED,
                ..egui::util::undoer::Settings::default()
            }),
            small: HashMap::new(),
            played_at: 0.0,
        }
    }

    /// Whether the surfaces at the pixels are needed.
    #[must_use]
    pub fn wants_surfaces(&self) -> bool {
        self.layer.reads_surfaces() || self.picked.is_some() || self.other.is_some() || self.clicked.is_some()
    }

    /// First column of the window right of the wipe line.
    #[must_use]
    pub fn wipe_column(&self) -> i32 {
        let [left, _, right, _] = self.place;
        left + (self.wipe * (right - left) as f32).round() as i32
    }

    /// Forgets what belongs to the scene before.
    pub fn begin_scene(&mut self) {
        (self.picked, self.selected, self.clicked) = (None, None, None);
        self.measured.clear();
        self.expanded.clear();
        self.undoer = Undoer::with_settings(egui::util::undoer::Settings {
            stable_time: SETTLED,
            ..egui::util::undoer::Settings::default()
        });
    }

    /// Starts a comparison with a copy of the knobs, or ends it.
    fn compare(&mut self, compares: bool) {
        (self.other, self.side) = (compares.then(|| self.settings.knobs.clone()), usize::from(compares));
    }

    /// Knobs of the edited side.
    #[must_use]
    pub fn knobs(&self) -> &Knobs {
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
        let place = knob.place(self.knobs());
        self.notices.say(format!("{}={}: {}", knob.name, knob.rungs[place], knob.rung_about[place]));
    }

    /// Whether the file dialog is open: keys then type text.
    #[must_use]
    pub fn is_asking(&self) -> bool {
        *self.dialog.state() == DialogState::Open
    }

    /// Aspect ratio of a picture that fills its area.
    fn aspect(&self) -> f64 {
        f64::from(self.room[0]) / f64::from(self.room[1].max(1))
    }

    /// Places of the panels; the default for a window of this width in points at the first call.
    fn docks(&mut self, width: f32) -> &mut Docks {
        self.preferences.docks.get_or_insert_with(|| Docks::new(width))
    }

    /// Opens the file dialog.
    fn ask(&mut self, asked: Asked, name: &str, folder: Option<PathBuf>) {
        // The search field of egui_file_dialog 0.15 is dark on black in a light theme.
        let mut dialog = FileDialog::new()
            .show_search(false)
            .anchor(egui::Align2::CENTER_CENTER, [0.0, 0.0])
            .default_size([640.0, 400.0]);
        if let Some(folder) = folder.filter(|folder| folder.is_dir()) {
            dialog = dialog.initial_directory(folder);
        }
        self.dialog = match asked {
            Asked::Scene => dialog
                .title("Open a scene")
                .add_file_filter_extensions("scenes", etalon::scene::EXTENSIONS.to_vec())
                .default_file_filter("scenes"),
            Asked::Environment => dialog
                .title("Open an environment map")
                .add_file_filter_extensions("environment maps", vec!["hdr", "exr"])
                .default_file_filter("environment maps"),
            Asked::Save => dialog
                .title("Save the picture")
                .add_save_extension("PNG: what is shown", "png")
                .add_save_extension("EXR: radiance", "exr")
                .default_save_extension("PNG: what is shown")
                .default_file_name(name),
        };
        match asked {
            Asked::Scene | Asked::Environment => self.dialog.pick_file(),
            Asked::Save => self.dialog.save_file(),
        }
        self.asked = asked;
    }

    fn undoable(&self) -> Undoable {
        // A view that follows the animation is the same view.
        let view = self.navigation.as_ref().map(Navigation::view).filter(|_| !self.clock.playing);
        let settings = Settings { size: [1, 1], ..self.settings.clone() };
        let (other, side, choice, layer) = (self.other.clone(), self.side, self.choice.clone(), self.layer);
        Undoable { settings, other, side, choice, layer, view }
    }

    fn return_to(&mut self, to: Undoable) {
        self.settings = Settings { size: self.settings.size, ..to.settings };
        (self.other, self.side, self.choice, self.layer) = (to.other, to.side, to.choice, to.layer);
        if let (Some(navigation), Some(view)) = (&mut self.navigation, to.view) {
            navigation.return_to(view);
        }
        self.moved = true;
    }
}

/// The model whose preset differs least from some knobs, and the number of knobs that differ.
#[must_use]
pub fn nearest_model(knobs: &Knobs) -> (Model, usize) {
    let differing = |model: &Model| {
        let preset = Knobs::of(*model);
        KNOBS.iter().filter(|knob| knob.place(&preset) != knob.place(knobs)).count()
    };
    let models = [Model::Recursive, Model::Global, Model::Local];
    let nearest = models.into_iter().min_by_key(differing).unwrap_or_default();
    (nearest, differing(&nearest))
}

/// Shows one frame of the user interface; returns the requested actions.
pub fn show(root: &mut Ui, state: &mut PanelState, seen: &RenderState) -> Vec<Action> {
    let mut actions = Vec::new();
    state.moved = false;
    state.pointed = None;
    if let Some(shown) = seen.shown().filter(|shown| shown.version != state.history_version && !shown.moving) {
        state.history_version = shown.version;
        for pass in &shown.passes {
            if !state.passes.contains(&pass.name) {
                state.passes.push(pass.name.clone());
            }
        }
        state.history.push_back(shown.passes.clone());
        if state.history.len() > HISTORY {
            state.history.pop_front();
        }
    }
    if let Some((number, stops)) = seen.metered.filter(|(number, _)| *number > state.metered) {
        state.metered = number;
        match stops {
            Some(stops) => state.settings.exposure = stops,
            None => state.notices.fail("the picture is black: no exposure shows it".to_owned()),
        }
    }
    style::apply(root.ctx());
    let focused = root.memory(egui::Memory::focused);
    state.focus_is_new = focused.is_some() && focused != state.focused;
    state.focused = focused;
    keys(root, state, seen, &mut actions);
    if state.panels {
        egui::Panel::top("bar").show(root, |ui| menu::show(ui, state, seen, &mut actions));
    }
    play(root, state, seen);
    if state.panels {
        let width = root.available_width();
        state.docks(width);
        if let Some(mut docks) = state.preferences.docks.take() {
            docks::show(&mut docks, root, state, seen, &mut actions);
            if let Some(pane) = state.forward.take() {
                docks.set_open(pane, true);
            }
            state.preferences.docks = Some(docks);
        }
    } else {
        picture::show(root, state, seen, &mut actions);
    }
    dialogs(root, state, &mut actions);
    notices::show(root, state, seen, &mut actions);
    if state.help {
        menu::help(root, state);
    }
    remember_change(root, state, seen);
    actions
}

/// The file dialog, and what was picked in it.
fn dialogs(ui: &Ui, state: &mut PanelState, actions: &mut Vec<Action>) {
    state.dialog.update(ui.ctx());
    let Some(path) = state.dialog.take_picked() else { return };
    match state.asked {
        Asked::Scene => actions.push(Action::Open(path)),
        Asked::Environment => state.choice.environment = Some(path.display().to_string()),
        Asked::Save => {
            state.preferences.saved_in = path.parent().map(PathBuf::from);
            actions.push(Action::Save(path));
        }
    }
}

/// Keeps a state that has settled, to return to; one whose choice cannot be read is none.
fn remember_change(ui: &Ui, state: &mut PanelState, seen: &RenderState) {
    let is_read = seen.facts.as_ref().is_some_and(|facts| facts.choice == state.choice);
    if state.navigation.is_none() || !is_read {
        return;
    }
    let now = state.undoable();
    state.undoer.feed_state(ui.input(|input| input.time), &now);
    if state.undoer.is_in_flux() {
        ui.ctx().request_repaint_after_secs(SETTLED);
    }
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

fn go_to(state: &mut PanelState, seen: &RenderState, index: usize) {
    let Some(facts) = &seen.facts else { return };
    let camera = facts.cameras.get(index).zip(facts.camera_keys.get(index));
    if let (Some(navigation), Some((camera, key))) = (&mut state.navigation, camera) {
        navigation.go_to(camera.clone(), Some(key.clone()));
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
    let open_menu = egui::Popup::is_any_open(ui.ctx());
    if ui.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Escape)) {
        if open_menu {
            egui::Popup::close_all(ui.ctx());
        } else {
            close(state, actions);
            ui.memory_mut(egui::Memory::stop_text_input);
        }
    }
    // egui gives the clipboard's keys as events of their own. Ctrl+C is of selected text, if there is some.
    let (copies, shift) = ui.input(|input| (input.events.contains(&egui::Event::Copy), input.modifiers.shift));
    if copies && (shift || !ui.ctx().plugin::<LabelSelectionState>().lock().has_selection()) {
        actions.push(Action::CopyPicture);
    }
    // A focused control has the keys that move within it: arrows, space, enter.
    let focused = ui.memory(|memory| memory.focused().is_some());
    let moves = [Key::ArrowUp, Key::ArrowDown, Key::ArrowLeft, Key::ArrowRight, Key::Space];
    // egui takes Shift+H for H with something more: keys with more modifiers come first.
    let mut shortcuts: Vec<_> =
        COMMANDS.iter().flat_map(|entry| entry.keys.iter().map(move |key| (entry, key))).collect();
    let count =
        |modifiers: Modifiers| u8::from(modifiers.shift) + u8::from(modifiers.alt) + u8::from(modifiers.command);
    shortcuts.sort_by_key(|(_, shortcut)| std::cmp::Reverse(count(shortcut.modifiers)));
    for (entry, shortcut) in shortcuts {
        if (focused || open_menu) && moves.contains(&shortcut.logical_key) {
            continue;
        }
        // Each press counts: a slow frame may receive several at once. A held key repeats only where that helps.
        let mut count = 0;
        ui.input_mut(|input| {
            input.events.retain(|event| {
                let egui::Event::Key { key, pressed: true, repeat, modifiers, .. } = event else { return true };
                let is_other = *key != shortcut.logical_key || !modifiers.matches_logically(shortcut.modifiers);
                count += usize::from(!is_other && (entry.repeats || !repeat));
                is_other
            });
        });
        (0..count).for_each(|_| perform(ui, state, seen, entry.command, actions));
    }
    let numbers = [Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5, Key::Num6, Key::Num7, Key::Num8, Key::Num9];
    let pressed = |key: Key| ui.input_mut(|input| input.consume_key(Modifiers::NONE, key));
    if let Some(index) = numbers.into_iter().position(pressed) {
        go_to(state, seen, index);
    }
}

/// Closes what is open, the uppermost first.
fn close(state: &mut PanelState, actions: &mut Vec<Action>) {
    if state.help {
        state.help = false;
        return;
    }
    state.notices.clear();
    actions.push(Action::Dismiss);
    if state.measures || !state.measured.is_empty() {
        state.measures = false;
        state.measured.clear();
    } else if state.picked.is_some() {
        state.picked = None;
    } else {
        state.selected = None;
    }
}

/// Performs a command of the menus or keys.
fn perform(ui: &Ui, state: &mut PanelState, seen: &RenderState, command: MenuCommand, actions: &mut Vec<Action>) {
    let aspect = state.aspect();
    let duration = seen.facts.as_ref().and_then(|facts| facts.duration);
    match command {
        MenuCommand::Open => {
            state.ask(Asked::Scene, "", state.recent.first().and_then(|path| Some(path.parent()?.into())))
        }
        MenuCommand::Save => {
            let name = seen.facts.as_ref().map_or("scene", |facts| &facts.name);
            let name = picture_name(name);
            state.ask(Asked::Save, &name, state.preferences.saved_in.clone());
        }
        MenuCommand::CopyPicture => actions.push(Action::CopyPicture),
        MenuCommand::CopyCommand => actions.push(Action::CopyCommand),
        MenuCommand::Quit => actions.push(Action::Quit),
        MenuCommand::Undo | MenuCommand::Redo => {
            let now = state.undoable();
            let to = match command {
                MenuCommand::Undo => state.undoer.undo(&now),
                _ => state.undoer.redo(&now),
            };
            if let Some(to) = to.cloned() {
                state.return_to(to);
            }
        }
        MenuCommand::Hide | MenuCommand::Isolate => {
            let outline = seen.facts.as_ref().map(|facts| &facts.outline);
            let node = outline.zip(state.selected).filter(|(outline, node)| *node < outline.nodes.len());
            match (node, command) {
                (None, _) => state.notices.say("select something first: click it in the picture or in the tree".into()),
                (Some((outline, node)), MenuCommand::Hide) => state.choice.hide(outline, node),
                (Some((outline, node)), _) => state.choice.isolate(outline, node),
            }
        }
        MenuCommand::ShowAll => (state.choice.hide, state.choice.only) = Default::default(),
        MenuCommand::Frame | MenuCommand::Reset | MenuCommand::Look(_) => {
            let bounds = seen.facts.as_ref().and_then(|facts| facts.bounds_of(state.selected?));
            let Some(navigation) = &mut state.navigation else { return };
            match command {
                MenuCommand::Look(side) => navigation.look_from(side, aspect),
                MenuCommand::Reset => navigation.reset(),
                _ => match bounds {
                    Some(bounds) => navigation.fit_box(bounds, aspect),
                    None => navigation.fit(aspect),
                },
            }
            state.moved = true;
        }
        MenuCommand::Panels => state.panels = !state.panels,
        MenuCommand::FullScreen => actions.push(Action::FullScreen),
        MenuCommand::Larger => state.preferences.zoom = (state.preferences.zoom * 1.1).min(4.0),
        MenuCommand::Smaller => state.preferences.zoom = (state.preferences.zoom / 1.1).max(0.5),
        MenuCommand::Normal => state.preferences.zoom = 1.0,
        MenuCommand::Compare => state.compare(state.other.is_none()),
        MenuCommand::Measure => {
            state.measures = !state.measures;
            state.measured.clear();
            if state.measures {
                state.notices.say("click points in the picture; Escape ends".to_owned());
            }
        }
        MenuCommand::Grid => state.preferences.overlays.grid = !state.preferences.overlays.grid,
        MenuCommand::Play => duration.into_iter().for_each(|duration| state.clock.toggle(duration)),
        MenuCommand::Forward | MenuCommand::Back => {
            let Some(duration) = duration else { return };
            state.clock.playing = false;
            let at = (state.clock.seconds() / FILM_STEP).round();
            let step = if command == MenuCommand::Forward { 1.0 } else { -1.0 };
            state.clock.set((at + step) * FILM_STEP, duration);
        }
        MenuCommand::PreviousKnob => state.choose_knob(-1),
        MenuCommand::NextKnob => state.choose_knob(1),
        MenuCommand::PreviousRung => state.turn_knob(false),
        MenuCommand::NextRung => state.turn_knob(true),
        MenuCommand::Help => state.help = !state.help,
    }
    ui.ctx().request_repaint();
}

/// File name for a picture of a scene: the stem of the file's name, or the name of the study scene.
fn picture_name(scene: &str) -> String {
    let stem = match scene.strip_prefix("study:") {
        Some(study) => study.to_owned(),
        None => PathBuf::from(scene).file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned()),
    };
    format!("{}.png", if stem.is_empty() { "picture" } else { &stem })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_named_after_their_scene_alone() {
        assert_eq!(picture_name("study:pool"), "pool.png");
        assert_eq!(picture_name("/home/me/my models/Fox.v2.glb"), "Fox.v2.png");
        assert_eq!(picture_name("/"), "picture.png");
    }

    #[test]
    fn keys_do_one_thing() {
        let mut seen = Vec::new();
        for entry in &COMMANDS {
            assert!(!entry.keys.is_empty(), "{} has no key", entry.name);
            for shortcut in entry.keys {
                assert!(!seen.contains(shortcut), "{}: {shortcut:?} has another command", entry.name);
                seen.push(*shortcut);
            }
        }
        // Keys that move, held: none of them writes a file, alone or beside one that does.
        let moving = [Key::W, Key::S, Key::A, Key::D, Key::Q, Key::E];
        assert!(seen.iter().all(|key| key.modifiers != Modifiers::NONE || !moving.contains(&key.logical_key)));
    }

    #[test]
    fn presets_are_their_own_nearest_models() {
        for model in [Model::Local, Model::Recursive, Model::Global] {
            assert_eq!(nearest_model(&Knobs::of(model)), (model, 0));
        }
        let changed = Knobs::of(Model::Global).with("samples", "4").expect("a rung");
        assert_eq!(nearest_model(&changed), (Model::Global, 1));
    }
}
