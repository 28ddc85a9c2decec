//! The menu bar with the state of the picture, and the help.

use egui::{RichText, Ui};

use super::commands::{COMMANDS, inputs};
use super::{Action, PanelState, perform};
use crate::layout::Pane;
use crate::preferences::small;
use crate::shared::RenderState;
use etalon::study;

/// Room of the device's name in points.
const DEVICE: f32 = 190.0;

/// Shows the bar. In a narrow window names are cut; menus and progress are not.
pub(super) fn show(ui: &mut Ui, state: &mut PanelState, seen: &RenderState, actions: &mut Vec<Action>) {
    egui::MenuBar::new().ui(ui, |ui| {
        for title in ["File", "Edit", "View", "Help"] {
            ui.menu_button(title, |ui| menu(ui, title, state, seen, actions));
        }
        ui.separator();
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            progress(ui, seen);
            warnings(ui, state, seen);
            ui.with_layout(egui::Layout::left_to_right(egui::Align::Center), |ui| title(ui, state, seen));
        });
    });
}

fn menu(ui: &mut Ui, title: &str, state: &mut PanelState, seen: &RenderState, actions: &mut Vec<Action>) {
    for entry in COMMANDS.iter().filter(|entry| entry.menu == title) {
        let keys = entry.keys.first().map_or_else(String::new, |shortcut| ui.ctx().format_shortcut(shortcut));
        if ui.add(egui::Button::new(entry.name).shortcut_text(keys)).clicked() {
            perform(ui, state, seen, entry.command, actions);
            ui.close();
        }
    }
    match title {
        "File" => {
            ui.separator();
            ui.menu_button("Recent", |ui| recent(ui, state, actions));
            ui.menu_button("Study scenes", |ui| {
                egui::ScrollArea::vertical().show(ui, |ui| {
                    for (name, about) in study::SCENES {
                        if ui.button(name).on_hover_text(about).clicked() {
                            actions.push(Action::Open(format!("study:{name}").into()));
                            ui.close();
                        }
                    }
                });
            });
        }
        "View" => {
            ui.separator();
            ui.menu_button("Show panel", |ui| {
                for (pane, name) in Pane::PANELS {
                    let docks = state.docks(1280.0);
                    let mut open = docks.is_open(pane);
                    if ui.checkbox(&mut open, name).changed() {
                        docks.set_open(pane, open);
                    }
                }
                ui.separator();
                if ui.button("Default places").clicked() {
                    state.preferences.docks = None;
                    ui.close();
                }
            });
            ui.menu_button("Colours", |ui| {
                for (theme, name) in [
                    (egui::ThemePreference::Dark, "Dark"),
                    (egui::ThemePreference::Light, "Light"),
                    (egui::ThemePreference::System, "As the desktop"),
                ] {
                    ui.radio_value(&mut state.preferences.theme, theme, name);
                }
            });
        }
        _ => {}
    }
}

fn recent(ui: &mut Ui, state: &mut PanelState, actions: &mut Vec<Action>) {
    if state.recent.is_empty() {
        ui.weak("no file was opened yet");
    }
    for path in state.recent.clone() {
        let picture = state.small.entry(path.clone()).or_insert_with(|| {
            let name = path.display().to_string();
            small(&path).map(|image| ui.ctx().load_texture(name, image, egui::TextureOptions::LINEAR))
        });
        let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let button = match picture {
            Some(texture) => {
                let image = egui::Image::from_texture(&*texture).fit_to_exact_size(egui::vec2(64.0, 40.0));
                egui::Button::image_and_text(image, name)
            }
            None => egui::Button::new(name),
        };
        if ui.add(button).on_hover_text(path.display().to_string()).clicked() {
            actions.push(Action::Open(path));
            ui.close();
        }
    }
}

/// Name of the scene and the device.
fn title(ui: &mut Ui, state: &PanelState, seen: &RenderState) {
    let name = seen.facts.as_ref().map_or("no scene", |facts| &facts.name);
    let file = std::path::Path::new(name).file_name().map_or(name, |file| file.to_str().unwrap_or(name));
    // What is said of the device needs its room; the name has the rest.
    let room = ui.available_width();
    let device_room = if room > 2.0 * DEVICE { DEVICE } else { 0.0 };
    ui.scope(|ui| {
        ui.set_max_width((room - device_room).max(24.0));
        ui.add(egui::Label::new(RichText::new(file).strong()).truncate()).on_hover_text(name);
    });
    if device_room == 0.0 {
        return;
    }
    let device = &state.device;
    if device.kind == "cpu" {
        let text = RichText::new("Software rendering (no GPU)").color(ui.visuals().warn_fg_color);
        ui.add(egui::Label::new(text).truncate())
            .on_hover_text(format!("{} ({}): the CPU computes every pixel", device.name, device.driver));
    } else {
        let text = RichText::new(&device.name).weak();
        ui.add(egui::Label::new(text).truncate()).on_hover_text(&device.driver);
    }
}

/// Seconds in words.
fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 1.0 => "<1 s".to_owned(),
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.0} h", s / 3600.0),
    }
}

/// A sign that stays while there are warnings; a click shows them.
fn warnings(ui: &mut Ui, state: &mut PanelState, seen: &RenderState) {
    let read = seen.facts.as_ref().map_or(0, |facts| facts.warnings.len());
    let count = read + seen.sides[state.side].warnings.len();
    if count == 0 {
        return;
    }
    let text = RichText::new(format!("⚠ {count}")).color(ui.visuals().warn_fg_color);
    if ui.button(text).on_hover_text("Warnings of the file and of the plan").clicked() {
        state.forward = Some(Pane::Plan);
    }
}

/// Samples of the picture and the time that is left; from right to left.
fn progress(ui: &mut Ui, seen: &RenderState) {
    let Some(shown) = seen.shown() else {
        let idle = if seen.error.is_some() { "no picture" } else { "reading the scene" };
        ui.label(seen.busy.as_deref().unwrap_or(idle));
        return;
    };
    let [done, of] = shown.samples;
    let what = match (shown.moving, shown.is_done()) {
        // The whole picture follows when the view rests.
        (true, _) => "preview".to_owned(),
        (_, true) => format!("{of} sample{}, done", if of == 1 { "" } else { "s" }),
        // It may have ended before its last sample.
        _ if seen.sides[0].refused.is_some() => format!("{done}/{of} samples"),
        _ => format!("{done}/{of} samples, {} left", duration(shown.seconds_left)),
    };
    ui.label(what).on_hover_text(format!(
        "{}×{} pixels, {:.1} ms of GPU time per sample",
        shown.size[0],
        shown.size[1],
        shown.ms()
    ));
    let wrong = shown.counts.nan + shown.counts.inf;
    if wrong > 0 {
        ui.colored_label(ui.visuals().error_fg_color, format!("⚠ {wrong} NaN"))
            .on_hover_text("Pixels that are NaN or infinite: the layer \"NaN and infinity\" of Display shows them");
    }
    if !shown.is_done() {
        let part = done as f32 / of.max(1) as f32;
        let (rect, _) = ui.allocate_exact_size(egui::vec2(60.0, 6.0), egui::Sense::hover());
        ui.painter().rect_filled(rect, 3.0, ui.visuals().widgets.inactive.bg_fill);
        let done = egui::Rect::from_min_size(rect.min, egui::vec2(60.0 * part, 6.0));
        ui.painter().rect_filled(done, 3.0, ui.visuals().selection.bg_fill);
    }
}

/// The list of all keys.
pub(super) fn help(ui: &mut Ui, state: &mut PanelState) {
    let mut open = true;
    let content = ui.ctx().content_rect();
    let window = egui::Window::new("Keys").pivot(egui::Align2::CENTER_CENTER).default_pos(content.center());
    let window = window.open(&mut open).resizable(false).collapsible(false).max_height(content.height() - 80.0);
    window.vscroll(true).show(ui.ctx(), |ui| {
        egui::Grid::new("keys").num_columns(2).striped(true).show(ui, |ui| {
            for (how, does) in inputs() {
                ui.strong(how);
                ui.label(does);
                ui.end_row();
            }
        });
        ui.label("Drop a file on the window to open it.");
    });
    state.help &= open;
}
