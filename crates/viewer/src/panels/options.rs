//! Model and knobs: each with its settings, what they do, what they cost where that was measured, and what the user
//! changed.

use egui::{RichText, Ui};

use super::{PanelState, nearest_model, style};
use crate::shared::RenderState;
use etalon::plan::{Effect, EffectId, EffectState, KNOBS, Knob, Knobs, Model};

/// Shows the panel.
pub(super) fn show(ui: &mut Ui, state: &mut PanelState, seen: &RenderState) {
    sides(ui, state);
    let (model, changed) = nearest_model(state.knobs());
    ui.horizontal_wrapped(|ui| {
        ui.label("model");
        for one in [Model::Local, Model::Recursive, Model::Global] {
            if ui.selectable_label(model == one, one.name()).on_hover_text(one.about()).clicked() {
                state.set_knobs(Knobs::of(one));
            }
        }
    });
    ui.horizontal(|ui| {
        let text = match changed {
            0 => "as the preset".to_owned(),
            1 => "1 option differs from the preset".to_owned(),
            n => format!("{n} options differ from the preset"),
        };
        ui.weak(text);
        if changed > 0 && ui.button("Reset all").clicked() {
            state.set_knobs(Knobs::of(model));
        }
    });
    ui.separator();
    let effects = seen.sides[state.side].effects.clone();
    let reason = |knob: &Knob| not_needed(&effects, knob.effects);
    let (unneeded, needed): (Vec<_>, Vec<_>) = KNOBS.iter().enumerate().partition(|(_, knob)| reason(knob).is_some());
    grid(ui, "needed", &needed, state, seen, &|_| None);
    if !unneeded.is_empty() {
        // An option that the user changed stays in sight.
        let is_changed = unneeded.iter().any(|(index, _)| state.knob == Some(*index));
        egui::CollapsingHeader::new(format!("{} options change nothing here", unneeded.len()))
            .id_salt("unneeded options")
            .open(is_changed.then_some(true))
            .show(ui, |ui| grid(ui, "unneeded", &unneeded, state, seen, &reason));
    }
}

/// Rows of options.
fn grid(
    ui: &mut Ui,
    id: &str,
    knobs: &[(usize, &Knob)],
    state: &mut PanelState,
    seen: &RenderState,
    reason: &dyn Fn(&Knob) -> Option<String>,
) {
    let preset = Knobs::of(nearest_model(state.knobs()).0);
    egui::Grid::new(id).num_columns(3).striped(true).show(ui, |ui| {
        for &(index, knob) in knobs {
            let differs = knob.place(state.knobs()) != knob.place(&preset);
            let name = RichText::new(knob.name);
            let name = if differs { name.color(style::changed(ui.visuals())).strong() } else { name };
            let name = if state.knob == Some(index) { name.underline() } else { name };
            let about = reason(knob)
                .map_or_else(|| knob.about.to_owned(), |reason| format!("{}; not needed: {reason}", knob.about));
            let label = ui.label(name).on_hover_text(about);
            if state.knob == Some(index) && ui.input(|input| input.key_pressed(egui::Key::ArrowDown)) {
                label.scroll_to_me(None);
            }
            let now = knob.rung(state.knobs());
            egui::ComboBox::from_id_salt(knob.name).width(110.0).truncate().selected_text(now).show_ui(ui, |ui| {
                for (rung, about) in knob.rungs.iter().zip(knob.rung_about) {
                    let changed = state.knobs().with(knob.name, rung);
                    let text = format!("{rung}{}", price(seen, knob.name, rung));
                    let is_now = *rung == now;
                    let button = ui.add_enabled(changed.is_some() || is_now, egui::Button::selectable(is_now, text));
                    let button = button.on_hover_text(*about).on_disabled_hover_text("Other options exclude it");
                    if let Some(changed) = changed.filter(|_| button.clicked()) {
                        state.set_knobs(changed);
                    }
                }
            });
            if differs {
                let back = preset_rung(state.knobs(), knob, &preset);
                let button = ui.add_enabled(back.is_some(), egui::Button::new("⟲").small());
                let to = format!("Back to {}", knob.rung(&preset));
                if let Some(back) = back.filter(|_| button.on_hover_text(to).clicked()) {
                    state.set_knobs(back);
                }
            } else {
                ui.label("");
            }
            ui.end_row();
            let price = price(seen, knob.name, now);
            if !price.is_empty() {
                ui.label("");
                ui.weak(price);
                ui.end_row();
            }
        }
    });
}

/// The knobs with one of them at its preset; `None` where the others exclude it.
fn preset_rung(knobs: &Knobs, knob: &Knob, preset: &Knobs) -> Option<Knobs> {
    knobs.with(knob.name, knob.rung(preset))
}

/// Controls of the comparison: on or off, and the edited side.
fn sides(ui: &mut Ui, state: &mut PanelState) {
    let mut compares = state.other.is_some();
    if ui.checkbox(&mut compares, "compare two settings").on_hover_text("V").changed() {
        state.compare(compares);
    }
    if state.other.is_none() {
        return;
    }
    ui.weak("Drag the line in the picture. Changes apply to one side:");
    ui.horizontal_wrapped(|ui| {
        ui.selectable_value(&mut state.side, 0, "left");
        ui.selectable_value(&mut state.side, 1, "right");
        if ui.button("Most exact").on_hover_text("Set every option of this side to its most exact setting").clicked() {
            state.set_knobs(Knobs::exact());
        }
        if ui.button("Swap").clicked()
            && let Some(other) = &mut state.other
        {
            std::mem::swap(other, &mut state.settings.knobs);
        }
    });
}

/// The reason why no effect of a knob is planned; `None` where one is planned, or where the knob affects every surface.
fn not_needed(known: &[Effect], effects: &[EffectId]) -> Option<String> {
    let found = |id: &EffectId| known.iter().find(|effect| effect.id == *id);
    let all: Vec<_> = effects.iter().filter_map(found).collect();
    let none = !all.is_empty() && all.iter().all(|effect| effect.state == EffectState::NotCalledFor);
    none.then(|| all[0].reason())
}

/// Measured time and FLIP difference of a rung from the preset `local` or the reference's rungs; empty if not measured.
fn price(seen: &RenderState, knob: &str, rung: &str) -> String {
    let Some(table) = seen.facts.as_ref().and_then(|facts| facts.prices.as_ref()) else { return String::new() };
    let found = table.prices.iter().find(|price| price.knob == knob && price.to == rung);
    found.map_or_else(String::new, |price| {
        let (ms, flip, from) = (price.gpu_ms_delta.median, price.flip_between, &price.from);
        format!("  {ms:+.1} ms, differs from {from} by FLIP {flip:.3}")
    })
}
