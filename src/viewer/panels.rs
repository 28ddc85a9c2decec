//! The panels: egui over what the worker has seen. They change [`State`] and ask for the rest by [`Action`].

use std::collections::VecDeque;
use std::path::PathBuf;

use egui::{Color32, Key, Modifiers, PointerButton, RichText, Sense, Ui};
use egui_file_dialog::{DialogState, FileDialog};
use glam::{DVec2, DVec3};

use super::layer::{LAYERS, Layer};
use super::navigation::Navigation;
use super::worker::{Seen, Surfaces};
use crate::frame::Settings;
use crate::gpu::{DeviceInfo, PassTime};
use crate::image::tone::ToneMap;
use crate::optics::fresnel::fresnel_dielectric;
use crate::plan::{KNOBS, Knobs, Model};

/// Pictures whose pass times are remembered.
const HISTORY: usize = 120;
/// Sizes of the scene that flying covers in a second.
const PACE: f64 = 0.5;
/// Colours of passes, told apart by those who see few of them (Okabe and Ito 2008).
const COLOURS: [Color32; 8] = [
    Color32::from_rgb(230, 159, 0),
    Color32::from_rgb(86, 180, 233),
    Color32::from_rgb(0, 158, 115),
    Color32::from_rgb(240, 228, 66),
    Color32::from_rgb(0, 114, 178),
    Color32::from_rgb(213, 94, 0),
    Color32::from_rgb(204, 121, 167),
    Color32::from_rgb(150, 150, 150),
];

/// What the panels ask for.
#[derive(Debug, Clone, PartialEq)]
pub enum Action {
    /// Read another file.
    Open(PathBuf),
    /// Write the picture.
    Screenshot,
    /// Write the radiance.
    Exr,
    /// Put the command that draws this on the clipboard.
    CopyCommand,
    /// Take the last error off the screen.
    Dismiss,
    /// Close the window.
    Quit,
}

/// What is looked at, and how.
pub struct State {
    /// Where from; `None` until there is a scene.
    pub navigation: Option<Navigation>,
    /// How it is drawn; the size is the picture's.
    pub settings: Settings,
    /// What is shown of it.
    pub layer: Layer,
    /// Whether panels lie beside it.
    pub panels: bool,
    /// Whether the keys are told.
    pub help: bool,
    /// A pixel that was asked about.
    pub picked: Option<[u32; 2]>,
    /// Something that was done.
    pub message: Option<String>,
    /// The view moved in this frame.
    pub moved: bool,
    /// Left, top, right, bottom of the picture in pixels of the window.
    pub place: [i32; 4],
    /// Files that were opened, the last first.
    pub recent: Vec<PathBuf>,
    /// What draws.
    pub device: DeviceInfo,
    /// To choose a file with.
    pub dialog: FileDialog,
    /// Pass times of the last pictures.
    pub history: VecDeque<Vec<PassTime>>,
    history_version: u64,
}

impl State {
    /// Begins with settings.
    #[must_use]
    pub fn new(settings: Settings, device: DeviceInfo) -> Self {
        Self {
            navigation: None,
            settings,
            layer: Layer::Radiance,
            panels: true,
            help: false,
            picked: None,
            message: None,
            moved: false,
            place: [0; 4],
            recent: Vec::new(),
            device,
            dialog: FileDialog::new()
                .add_file_filter_extensions("scenes", vec!["glb", "gltf", "obj"])
                .default_file_filter("scenes"),
            history: VecDeque::new(),
            history_version: 0,
        }
    }

    /// Whether surfaces at the pixels have to be known.
    #[must_use]
    pub fn wants_surfaces(&self) -> bool {
        self.layer != Layer::Radiance || self.picked.is_some()
    }

    /// Whether a file is being chosen: keys are words then.
    fn is_asking(&self) -> bool {
        *self.dialog.state() == DialogState::Open
    }

    fn aspect(&self) -> f64 {
        f64::from(self.settings.size[0]) / f64::from(self.settings.size[1].max(1))
    }
}

/// One frame of the interface.
pub fn show(root: &mut Ui, state: &mut State, seen: &Seen) -> Vec<Action> {
    let mut actions = Vec::new();
    state.moved = false;
    if let Some(shown) = seen.shown.as_ref().filter(|shown| shown.version != state.history_version && !shown.moving) {
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
            egui::ScrollArea::vertical().show(ui, |ui| how(ui, state, seen));
        });
        egui::Panel::right("what").default_size(300.0).show(root, |ui| {
            egui::ScrollArea::vertical().show(ui, |ui| what(ui, state, seen));
        });
    }
    picture(root, state);
    state.dialog.update(root.ctx());
    actions.extend(state.dialog.take_picked().map(Action::Open));
    notices(root, state, seen);
    if state.help {
        help(root, state);
    }
    actions
}

/// The file, the device and the picture's state, in a line.
fn bar(ui: &mut Ui, state: &mut State, seen: &Seen, actions: &mut Vec<Action>) {
    ui.horizontal_wrapped(|ui| {
        ui.menu_button("Open", |ui| {
            if ui.button("File … (O)").clicked() {
                state.dialog.pick_file();
                ui.close();
            }
            for path in &state.recent {
                if ui.button(path.display().to_string()).clicked() {
                    actions.push(Action::Open(path.clone()));
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
        let device = &state.device;
        if device.kind == "cpu" {
            ui.colored_label(ui.visuals().warn_fg_color, "software device, no GPU").on_hover_text(format!(
                "{} ({}): every pixel is computed by the processor",
                device.name, device.driver
            ));
        } else {
            ui.weak(&device.name).on_hover_text(&device.driver);
        }
        ui.separator();
        if let Some(shown) = &seen.shown {
            let [done, of] = shown.samples;
            let ms: f64 = shown.passes.iter().map(|pass| pass.ms).sum();
            let moving = if shown.moving { ", moving" } else { "" };
            ui.label(format!("{}×{}{moving}: {done} of {of} samples, {ms:.1} ms each", shown.size[0], shown.size[1]));
        }
        let wrong = seen.shown.as_ref().map_or(0, |shown| shown.counts.nan + shown.counts.inf);
        if wrong > 0 {
            ui.colored_label(ui.visuals().error_fg_color, format!("{wrong} pixels are no numbers"))
                .on_hover_text("shows: NaN and infinity");
        }
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            egui::widgets::global_theme_preference_switch(ui);
            if ui.button("Help").on_hover_text("H").clicked() {
                state.help = !state.help;
            }
            for (name, key, action) in [
                ("Copy command", "C", Action::CopyCommand),
                ("EXR", "E", Action::Exr),
                ("PNG", "S", Action::Screenshot),
            ] {
                if ui.button(name).on_hover_text(key).clicked() {
                    actions.push(action);
                }
            }
        });
    });
}

/// How it is drawn: model, knobs, display, cameras.
fn how(ui: &mut Ui, state: &mut State, seen: &Seen) {
    ui.heading("Display");
    egui::Grid::new("display").num_columns(2).show(ui, |ui| {
        ui.label("exposure");
        ui.add(egui::Slider::new(&mut state.settings.exposure, -10.0..=10.0).suffix(" EV"));
        ui.end_row();
        ui.label("tone curve");
        egui::ComboBox::from_id_salt("tone").selected_text(tone_name(state.settings.tonemap)).show_ui(ui, |ui| {
            for curve in TONES {
                ui.selectable_value(&mut state.settings.tonemap, curve, tone_name(curve));
            }
        });
        ui.end_row();
        ui.label("environment");
        ui.add(egui::Slider::new(&mut state.settings.environment_rotation, -180.0..=180.0).suffix("°"));
        ui.end_row();
        ui.label("shows");
        let name = LAYERS.iter().find(|(layer, _)| *layer == state.layer).map_or("", |(_, name)| name);
        egui::ComboBox::from_id_salt("layer").selected_text(name).show_ui(ui, |ui| {
            for (layer, name) in LAYERS {
                ui.selectable_value(&mut state.layer, layer, name);
            }
        });
        ui.end_row();
    });
    if let Some(facts) = seen.facts.as_ref().filter(|facts| !facts.cameras.is_empty()) {
        ui.horizontal_wrapped(|ui| {
            ui.label("cameras");
            for (index, camera) in facts.cameras.iter().enumerate() {
                if ui.button(&camera.name).clicked() {
                    go_to(state, seen, index);
                }
            }
        });
    }
    ui.separator();
    ui.heading("Model");
    ui.horizontal(|ui| {
        for (model, name) in [(Model::Local, "local"), (Model::Recursive, "recursive"), (Model::Global, "global")] {
            let chosen = state.settings.knobs == Knobs::of(model);
            if ui.selectable_label(chosen, name).clicked() {
                state.settings.knobs = Knobs::of(model);
            }
        }
    });
    egui::Grid::new("knobs").num_columns(3).striped(true).show(ui, |ui| {
        for knob in KNOBS {
            let reason = called_for(seen, knob.effects);
            let label = if reason.is_some() { RichText::new(knob.name).weak() } else { RichText::new(knob.name) };
            let about = reason
                .map_or_else(|| knob.about.to_owned(), |reason| format!("{}; not called for: {reason}", knob.about));
            ui.label(label).on_hover_text(about);
            let now = state.settings.knobs.rung(knob.name);
            egui::ComboBox::from_id_salt(knob.name).width(96.0).selected_text(now).show_ui(ui, |ui| {
                for rung in knob.rungs {
                    let changed = state.settings.knobs.with(knob.name, rung);
                    let text = format!("{rung}{}", price(seen, knob.name, rung));
                    let button = egui::Button::selectable(*rung == now, text);
                    if ui.add_enabled(changed.is_some() || *rung == now, button).clicked()
                        && let Some(changed) = changed
                    {
                        state.settings.knobs = changed;
                    }
                }
            });
            ui.weak(price(seen, knob.name, now));
            ui.end_row();
        }
    });
}

/// Why none of the effects that a knob shapes is planned; `None` where one is, or it shapes every surface.
fn called_for(seen: &Seen, effects: &[&str]) -> Option<String> {
    let found = |name: &&str| seen.effects.iter().find(|effect| effect.name == *name);
    let all: Vec<_> = effects.iter().filter_map(found).collect();
    let none = !all.is_empty() && all.iter().all(|effect| effect.state == "not called for");
    none.then(|| all[0].reason.clone())
}

/// What a rung was measured to cost and to be wrong by, from `local` or the reference's rungs.
fn price(seen: &Seen, knob: &str, rung: &str) -> String {
    let Some(table) = seen.facts.as_ref().and_then(|facts| facts.prices.as_ref()) else { return String::new() };
    let found = table.prices.iter().find(|price| price.knob == knob && price.to == rung);
    found.map_or_else(String::new, |price| {
        format!("  {:+.1} ms, FLIP {:.3}", price.gpu_ms_delta.median, price.flip_between)
    })
}

/// What is seen: a picked pixel, times, the plan.
fn what(ui: &mut Ui, state: &mut State, seen: &Seen) {
    ui.heading("Pixel");
    match (state.picked, seen.now()) {
        (None, _) => {
            ui.weak("Ctrl+click a pixel to ask about it.");
        }
        (Some(_), None) => {
            ui.weak("once the picture is finished …");
        }
        (Some(pixel), Some(surfaces)) => pixel_facts(ui, pixel, surfaces, seen),
    }
    ui.separator();
    ui.heading("Time of the passes");
    times(ui, state);
    ui.separator();
    ui.heading("Plan");
    for effect in &seen.effects {
        let color = match effect.state {
            "kept" => ui.visuals().strong_text_color(),
            "dropped" => ui.visuals().warn_fg_color,
            _ => ui.visuals().weak_text_color(),
        };
        ui.colored_label(color, format!("{}: {}", effect.name, effect.state)).on_hover_text(&effect.reason);
        if effect.state != "not called for" {
            ui.weak(format!("    {}", effect.reason));
        }
    }
    let read = seen.facts.iter().flat_map(|facts| &facts.warnings);
    for warning in read.chain(&seen.warnings) {
        ui.colored_label(ui.visuals().warn_fg_color, warning);
    }
}

/// Everything about one pixel.
fn pixel_facts(ui: &mut Ui, [x, y]: [u32; 2], surfaces: &Surfaces, seen: &Seen) {
    let [width, height] = surfaces.size;
    if x >= width || y >= height {
        ui.weak("outside of the picture");
        return;
    }
    let at = (y * width + x) as usize;
    let (p, radiance) = (&surfaces.pixels[at], surfaces.radiance[at]);
    egui::Grid::new("pixel").num_columns(2).striped(true).show(ui, |ui| {
        let mut row = |name: &str, value: String| {
            ui.label(name);
            ui.monospace(value);
            ui.end_row();
        };
        let three = |v: [f32; 3]| format!("{:.5} {:.5} {:.5}", v[0], v[1], v[2]);
        row("pixel", format!("{x}, {y}"));
        row("radiance", three([radiance[0], radiance[1], radiance[2]]));
        if p.material == 0 {
            row("surface", "none".to_owned());
            return;
        }
        let facts = seen.facts.as_ref();
        let material = facts.and_then(|facts| facts.materials.get(p.material as usize - 1));
        let instance = facts.and_then(|facts| facts.instances.get(p.instance as usize - 1));
        row("material", material.map_or_else(String::new, |m| m.name.clone()));
        row("instance", instance.cloned().unwrap_or_default());
        let position = surfaces.eye + DVec3::from(p.p_rel.map(f64::from));
        row("position, m", format!("{:.4} {:.4} {:.4}", position.x, position.y, position.z));
        row("distance, m", format!("{:.5}", p.distance));
        row("normal", three(p.normal));
        row("triangle's", three(p.geometric_normal));
        row("albedo", three(p.albedo));
        row("roughness", format!("{:.4}", p.roughness));
        row("metallic", format!("{:.4}", p.metallic));
        let [normal, way] = [p.normal, p.p_rel].map(|v| DVec3::from(v.map(f64::from)));
        let cos = (-way.normalize_or_zero().dot(normal)).clamp(-1.0, 1.0);
        row("incidence", format!("{:.2}°", cos.acos().to_degrees()));
        if let Some(m) = material {
            match &m.conductor {
                Some(_) => row("n, kappa", "by wavelength or channel".to_owned()),
                None => {
                    row("n", format!("{:.4}", m.ior));
                    let [share, ..] = fresnel_dielectric(cos.max(0.0), f64::from(m.ior));
                    row("Fresnel (F2)", format!("{:.3} % reflected", 100.0 * share));
                }
            }
        }
    });
}

/// Pass times of the last pictures, one upon the other.
fn times(ui: &mut Ui, state: &State) {
    let Some(last) = state.history.back() else { return };
    let total = |passes: &Vec<PassTime>| passes.iter().map(|pass| pass.ms).sum::<f64>();
    let most = state.history.iter().map(total).fold(1e-6, f64::max);
    // The dearest passes have a colour, all others the last.
    let mut order: Vec<(&str, f64)> = last.iter().map(|pass| (pass.name.as_str(), pass.ms)).collect();
    order.sort_by(|a, b| b.1.total_cmp(&a.1));
    let place =
        |name: &str| order.iter().position(|(known, _)| *known == name).unwrap_or(usize::MAX).min(COLOURS.len() - 1);
    let (rect, _) = ui.allocate_exact_size(egui::vec2(ui.available_width(), 72.0), Sense::hover());
    ui.painter().rect_filled(rect, 2.0, ui.visuals().extreme_bg_color);
    let width = rect.width() / HISTORY as f32;
    for (i, passes) in state.history.iter().enumerate() {
        let left = rect.left() + width * i as f32;
        let mut parts = [0.0; COLOURS.len()];
        passes.iter().for_each(|pass| parts[place(&pass.name)] += pass.ms);
        let mut bottom = rect.bottom();
        for (part, color) in parts.into_iter().zip(COLOURS) {
            let top = bottom - (part / most) as f32 * rect.height();
            let bar = egui::Rect::from_min_max(egui::pos2(left, top), egui::pos2(left + width.max(1.0), bottom));
            ui.painter().rect_filled(bar, 0.0, color);
            bottom = top;
        }
    }
    ui.weak(format!("{:.1} ms of GPU time for a sample, at most {most:.1} here", total(last)));
    egui::Grid::new("passes").num_columns(3).min_col_width(10.0).show(ui, |ui| {
        for (name, ms) in &order {
            let (dot, _) = ui.allocate_exact_size(egui::vec2(10.0, 10.0), Sense::hover());
            ui.painter().rect_filled(dot, 2.0, COLOURS[place(name)]);
            ui.label(*name);
            ui.monospace(format!("{ms:8.2} ms"));
            ui.end_row();
        }
    });
}

/// The picture itself: what is left of the window, and what the pointer does there.
fn picture(ui: &mut Ui, state: &mut State) {
    let rect = ui.available_rect_before_wrap();
    let scale = ui.ctx().pixels_per_point();
    let corner = |p: egui::Pos2| [(p.x * scale).round() as i32, (p.y * scale).round() as i32];
    let ([left, top], [right, bottom]) = (corner(rect.min), corner(rect.max));
    state.place = [left, top, right, bottom];
    state.settings.size = [(right - left).max(1) as u32, (bottom - top).max(1) as u32];
    let response = ui.interact(rect, ui.id().with("picture"), Sense::click_and_drag());
    let (modifiers, scroll, pinch, pointer, seconds) = ui.input(|input| {
        let zoom = input.zoom_delta();
        (input.modifiers, input.smooth_scroll_delta(), zoom, input.pointer.latest_pos(), input.stable_dt.min(0.1))
    });
    let asking = state.is_asking();
    let Some(navigation) = &mut state.navigation else { return };
    if response.drag_started() {
        navigation.keep();
    }
    let by = response.drag_delta() / rect.height().max(1.0);
    let by = DVec2::new(f64::from(by.x), f64::from(by.y));
    if by != DVec2::ZERO {
        let pans = response.dragged_by(PointerButton::Middle) || modifiers.shift;
        match (pans, response.dragged_by(PointerButton::Secondary)) {
            (true, _) => navigation.pan(by),
            (_, true) => navigation.look(by),
            _ => navigation.orbit(by),
        }
        state.moved = true;
    }
    if response.hovered() && (scroll.y != 0.0 || pinch != 1.0) {
        // A notch of a wheel is some 50 points; fingers spread by e are 1/0.15 notches.
        navigation.zoom(f64::from(scroll.y) / 50.0 + f64::from(pinch.ln()) / 0.1625);
        state.moved = true;
    }
    let pressed = |key: Key| ui.input(|input| input.key_down(key) && input.modifiers.is_none());
    let axis = |more: Key, less: Key| f64::from(u8::from(pressed(more))) - f64::from(u8::from(pressed(less)));
    let way = DVec3::new(axis(Key::D, Key::A), axis(Key::Q, Key::Z), axis(Key::W, Key::X));
    if way != DVec3::ZERO && !ui.ctx().text_edit_focused() && !asking {
        navigation.fly(way * (PACE * f64::from(seconds)));
        state.moved = true;
        ui.ctx().request_repaint();
    }
    if response.clicked() && modifiers.command {
        state.picked = pointer.map(|p| {
            let [x, y] = corner(p);
            [(x - left).max(0) as u32, (y - top).max(0) as u32]
        });
    }
    if let Some([x, y]) = state.picked.filter(|_| state.panels) {
        let at = egui::pos2((left as f32 + x as f32 + 0.5) / scale, (top as f32 + y as f32 + 0.5) / scale);
        ui.painter().circle_stroke(at, 6.0, egui::Stroke::new(2.0, Color32::BLACK));
        ui.painter().circle_stroke(at, 6.0, egui::Stroke::new(1.0, Color32::WHITE));
    }
}

/// What went wrong, what takes long, what was done.
fn notices(ui: &mut Ui, state: &mut State, seen: &Seen) {
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
            egui::Frame::popup(ui.style()).show(ui, |ui| ui.label(said));
        });
    }
}

const KEYS: &[(&str, &str)] = &[
    ("drag", "orbit"),
    ("Shift+drag, middle drag", "pan"),
    ("right drag", "look around"),
    ("wheel, pinch", "zoom"),
    ("W X A D Q Z", "fly forwards, back, left, right, up, down"),
    ("F", "fit the scene"),
    ("R, Home", "back to the first view"),
    ("Ctrl+Z", "take the last movement back"),
    ("1 to 9", "cameras of the file"),
    ("Ctrl+click", "ask about a pixel"),
    ("O", "open a file"),
    ("P", "panels"),
    ("S, E, C", "write PNG, write EXR, copy the command"),
    ("Escape", "away with messages and help"),
    ("Ctrl+Q", "close"),
    ("H, ?", "this"),
];

fn help(ui: &mut Ui, state: &mut State) {
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

fn go_to(state: &mut State, seen: &Seen, index: usize) {
    let camera = seen.facts.as_ref().and_then(|facts| facts.cameras.get(index));
    if let (Some(navigation), Some(camera)) = (&mut state.navigation, camera) {
        navigation.go_to(camera.clone(), Some(camera.name.clone()));
        state.moved = true;
    }
}

fn keys(ui: &mut Ui, state: &mut State, seen: &Seen, actions: &mut Vec<Action>) {
    for file in ui.input(|input| input.raw.dropped_files.clone()) {
        actions.push(Action::Open(file.path().to_owned()));
    }
    if ui.ctx().text_edit_focused() || state.is_asking() {
        return;
    }
    let pressed = |key: Key| ui.input_mut(|input| input.consume_key(Modifiers::NONE, key));
    for (key, action) in [(Key::S, Action::Screenshot), (Key::E, Action::Exr), (Key::C, Action::CopyCommand)] {
        if pressed(key) {
            actions.push(action);
        }
    }
    if pressed(Key::O) {
        state.dialog.pick_file();
        // The letter is no word to search for.
        ui.input_mut(|input| input.events.retain(|event| !matches!(event, egui::Event::Text(_))));
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

const TONES: [ToneMap; 5] = [ToneMap::Linear, ToneMap::Reinhard, ToneMap::Aces, ToneMap::Agx, ToneMap::KhronosNeutral];

fn tone_name(curve: ToneMap) -> String {
    clap::ValueEnum::to_possible_value(&curve).map_or_else(String::new, |value| value.get_name().to_owned())
}
