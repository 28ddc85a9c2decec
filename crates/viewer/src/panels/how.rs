//! The left panel: display settings, animation time, cameras, comparison, model and knobs.

use egui::{RichText, Ui};

use super::{PanelState, go_to};
use crate::layer::LAYERS;
use crate::shared::RenderState;
use etalon::image::tone::ToneMap;
use etalon::plan::{Effect, EffectId, EffectState, KNOBS, Knobs, Model};

/// Shows the panel.
pub(super) fn show(ui: &mut Ui, state: &mut PanelState, seen: &RenderState) {
    ui.heading("Display");
    egui::Grid::new("display").num_columns(2).show(ui, |ui| {
        ui.label("exposure");
        ui.add(egui::Slider::new(&mut state.settings.exposure, -10.0..=10.0).suffix(" EV"));
        ui.end_row();
        ui.label("tone curve");
        egui::ComboBox::from_id_salt("tone").selected_text(state.settings.tonemap.name()).show_ui(ui, |ui| {
            for &curve in ToneMap::ALL {
                ui.selectable_value(&mut state.settings.tonemap, curve, curve.name());
            }
        });
        ui.end_row();
        ui.label("environment");
        let turned = egui::Slider::new(&mut state.settings.environment_rotation, -180.0..=180.0).suffix("°");
        state.moved |= ui.add(turned).changed();
        ui.end_row();
        ui.label("view");
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
    time(ui, state, seen);
    ui.separator();
    ui.heading("Model");
    sides(ui, state);
    ui.horizontal(|ui| {
        for (model, name) in [(Model::Local, "local"), (Model::Recursive, "recursive"), (Model::Global, "global")] {
            let knobs = Knobs::of(model);
            if ui.selectable_label(*state.knobs() == knobs, name).clicked() {
                state.set_knobs(knobs);
            }
        }
    });
    let effects = seen.sides[state.side].effects.clone();
    egui::Grid::new("knobs").num_columns(3).striped(true).show(ui, |ui| {
        for (index, knob) in KNOBS.iter().enumerate() {
            let reason = called_for(&effects, knob.effects);
            let label = if reason.is_some() { RichText::new(knob.name).weak() } else { RichText::new(knob.name) };
            let label = if state.knob == Some(index) { label.underline() } else { label };
            let about =
                reason.map_or_else(|| knob.about.to_owned(), |reason| format!("{}; not needed: {reason}", knob.about));
            ui.label(label).on_hover_text(about);
            let now = knob.rung(state.knobs());
            egui::ComboBox::from_id_salt(knob.name).width(96.0).selected_text(now).show_ui(ui, |ui| {
                for rung in knob.rungs {
                    let changed = state.knobs().with(knob.name, rung);
                    let text = format!("{rung}{}", price(seen, knob.name, rung));
                    let button = egui::Button::selectable(*rung == now, text);
                    if ui.add_enabled(changed.is_some() || *rung == now, button).clicked()
                        && let Some(changed) = changed
                    {
                        state.set_knobs(changed);
                    }
                }
            });
            ui.weak(price(seen, knob.name, now));
            ui.end_row();
        }
    });
}

/// Controls of the animation time; nothing for a scene without animation.
fn time(ui: &mut Ui, state: &mut PanelState, seen: &RenderState) {
    let Some(duration) = seen.facts.as_ref().and_then(|facts| facts.duration) else { return };
    ui.separator();
    ui.heading("Time");
    ui.horizontal(|ui| {
        let (name, key) = if state.clock.playing { ("Pause", "Space") } else { ("Play", "Space") };
        if ui.button(name).on_hover_text(key).clicked() {
            state.clock.playing = !state.clock.playing;
        }
        let mut seconds = state.clock.time.unwrap_or_default();
        if ui.add(egui::Slider::new(&mut seconds, 0.0..=duration).suffix(" s").max_decimals(3)).changed() {
            state.clock.set(seconds, duration);
            state.moved = true;
        }
        let at_rest = ui.add_enabled(state.clock.time.is_some(), egui::Button::new("Reset time"));
        if at_rest.on_hover_text("back to the time of the command line, or to the rest pose").clicked() {
            state.clock.stop();
        }
    });
}

/// Controls of the comparison: on or off, and the edited side.
fn sides(ui: &mut Ui, state: &mut PanelState) {
    let mut compares = state.other.is_some();
    if ui.checkbox(&mut compares, "compare two settings (V)").changed() {
        state.compare(compares);
    }
    if state.other.is_none() {
        return;
    }
    ui.horizontal(|ui| {
        ui.selectable_value(&mut state.side, 0, "left");
        ui.selectable_value(&mut state.side, 1, "right");
        ui.separator();
        if ui.button("reference").on_hover_text("set every knob to its most exact rung").clicked() {
            state.set_knobs(Knobs::exact());
        }
        if ui.button("swap").clicked()
            && let Some(other) = &mut state.other
        {
            std::mem::swap(other, &mut state.settings.knobs);
        }
    });
}

/// The reason why no effect of a knob is planned; `None` where one is planned, or where the knob affects every surface.
fn called_for(known: &[Effect], effects: &[EffectId]) -> Option<String> {
    let found = |id: &EffectId| known.iter().find(|effect| effect.id == *id);
    let all: Vec<_> = effects.iter().filter_map(found).collect();
    let none = !all.is_empty() && all.iter().all(|effect| effect.state == EffectState::NotCalledFor);
    none.then(|| all[0].reason())
}

/// Measured time and FLIP difference of a rung, relative to the preset `local` or to the reference's rungs; empty if
/// not measured.
fn price(seen: &RenderState, knob: &str, rung: &str) -> String {
    let Some(table) = seen.facts.as_ref().and_then(|facts| facts.prices.as_ref()) else { return String::new() };
    let found = table.prices.iter().find(|price| price.knob == knob && price.to == rung);
    found.map_or_else(String::new, |price| {
        format!("  {:+.1} ms, FLIP {:.3}", price.gpu_ms_delta.median, price.flip_between)
    })
}
