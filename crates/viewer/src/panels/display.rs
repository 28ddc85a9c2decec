//! How the picture is shown: exposure, tone curve, layers, overlays, views and animation.

use egui::{Slider, Ui};

use super::commands::MenuCommand;
use super::style::UNTOUCHED;
use super::{PanelState, go_to, perform};
use crate::layer::LAYERS;
use crate::navigation::ViewSide;
use crate::shared::RenderState;
use etalon::image::tone::ToneMap;
use etalon::scene::outline::FilePart;

/// Fraction of clipped pixels from which it is said.
const CLIPPED: f32 = 0.02;

/// Shows the panel.
pub(super) fn show(ui: &mut Ui, state: &mut PanelState, seen: &RenderState) {
    ui.strong("Exposure");
    ui.horizontal(|ui| {
        let exposure = Slider::new(&mut state.settings.exposure, -20.0..=20.0).suffix(" EV").max_decimals(2);
        let exposure = exposure.clamping(UNTOUCHED);
        ui.add(exposure.drag_value_speed(0.05)).on_hover_text("Stops: each doubles the brightness");
        if ui.button("Auto").on_hover_text("From the picture's own luminance").clicked() {
            state.meter += 1;
        }
        if ui.button("0").on_hover_text("No correction").clicked() {
            state.settings.exposure = 0.0;
        }
    });
    // The sentence is of the exposure that the scene began with.
    let began = seen.facts.as_ref().filter(|facts| facts.exposure == state.settings.exposure);
    if let Some(why) = began.and_then(|facts| facts.exposure_from.as_ref()) {
        ui.weak(why);
    }
    if let Some(shown) = seen.shown().filter(|shown| shown.clipped > CLIPPED) {
        let text = format!("⚠ {:.0} % of the pixels are clipped", 100.0 * shown.clipped);
        ui.colored_label(ui.visuals().warn_fg_color, text)
            .on_hover_text("A channel has the largest value that can be shown");
    }
    egui::Grid::new("display").num_columns(2).show(ui, |ui| {
        ui.label("tone curve");
        egui::ComboBox::from_id_salt("tone").selected_text(state.settings.tonemap.name()).show_ui(ui, |ui| {
            for &curve in ToneMap::ALL {
                ui.selectable_value(&mut state.settings.tonemap, curve, curve.name());
            }
        });
        ui.end_row();
        ui.label("layer");
        let name = LAYERS.iter().find(|(layer, _)| *layer == state.layer).map_or("", |(_, name)| name);
        egui::ComboBox::from_id_salt("layer").selected_text(name).show_ui(ui, |ui| {
            for (layer, name) in LAYERS {
                ui.selectable_value(&mut state.layer, layer, name);
            }
        });
        ui.end_row();
    });
    ui.separator();
    ui.strong("Over the picture");
    let overlays = &mut state.preferences.overlays;
    ui.horizontal_wrapped(|ui| {
        ui.checkbox(&mut overlays.grid, "grid");
        ui.checkbox(&mut overlays.gizmo, "axes");
        ui.checkbox(&mut overlays.boxes, "bounding boxes");
        ui.checkbox(&mut overlays.lights, "lights and cameras");
    });
    ui.separator();
    ui.strong("View");
    let aspect = state.aspect();
    ui.horizontal_wrapped(|ui| {
        for (side, name) in ViewSide::ALL {
            if ui.button(name).clicked()
                && let Some(navigation) = &mut state.navigation
            {
                navigation.look_from(side, aspect);
                state.moved = true;
            }
        }
        for (command, name) in [(MenuCommand::Frame, "Frame"), (MenuCommand::Reset, "Initial")] {
            if ui.button(name).clicked() {
                perform(ui, state, seen, command, &mut Vec::new());
            }
        }
    });
    if let Some(facts) = seen.facts.as_ref().filter(|facts| !facts.cameras.is_empty()) {
        ui.horizontal_wrapped(|ui| {
            ui.label("cameras");
            for (index, camera) in facts.cameras.iter().enumerate().take(30) {
                if ui.add(egui::Button::new(&camera.name).truncate()).clicked() {
                    go_to(state, seen, index);
                }
            }
        });
    }
    animation(ui, state, seen);
}

/// Controls of the animation; nothing for a scene without one.
fn animation(ui: &mut Ui, state: &mut PanelState, seen: &RenderState) {
    let Some(facts) = seen.facts.as_ref().filter(|facts| !facts.outline.animations.is_empty()) else { return };
    ui.separator();
    ui.strong("Animation");
    let animations = &facts.outline.animations;
    if animations.len() > 1 {
        let playing: Vec<&str> = animations.iter().filter(|one| one.plays).map(|one| one.named.name.as_str()).collect();
        let all = state.choice.animation.as_deref() == Some("all");
        let text = if all { "all together".to_owned() } else { playing.join(", ") };
        egui::ComboBox::from_id_salt("animation")
            .width(ui.available_width() - 8.0)
            .truncate()
            .selected_text(text)
            .show_ui(ui, |ui| {
                for animation in animations {
                    let FilePart { name, key } = &animation.named;
                    let text = format!("{name}, {:.2} s", animation.seconds);
                    ui.selectable_value(&mut state.choice.animation, Some(key.clone()), text);
                }
                ui.selectable_value(&mut state.choice.animation, Some("all".to_owned()), "all together");
            });
    }
    let Some(duration) = facts.duration else { return };
    ui.horizontal(|ui| {
        let name = if state.clock.playing { "⏸" } else { "▶" };
        if ui.button(name).on_hover_text("Play or pause (Space)").clicked() {
            state.clock.toggle(duration);
        }
        let mut seconds = state.clock.seconds();
        let slider = Slider::new(&mut seconds, 0.0..=duration).suffix(" s").max_decimals(3).clamping(UNTOUCHED);
        if ui.add(slider).changed() {
            state.clock.set(seconds, duration);
            state.moved = true;
        }
    });
    ui.horizontal(|ui| {
        let speed = egui::DragValue::new(&mut state.clock.speed).range(0.05..=10.0).speed(0.01).suffix("×");
        ui.add(speed).on_hover_text("Speed");
        ui.checkbox(&mut state.clock.repeats, "loop");
        let at_rest = ui.add_enabled(state.clock.time.is_some(), egui::Button::new("Reset time"));
        if at_rest.on_hover_text("Back to the time of the command line, or to the rest pose").clicked() {
            state.clock.stop();
        }
    });
}
