//! The plan: every effect with its reason, and the warnings of the loader and of the plan.

use egui::{RichText, Ui};

use super::PanelState;
use crate::shared::RenderState;
use etalon::plan::EffectState;

/// Shows the panel.
pub(super) fn show(ui: &mut Ui, state: &mut PanelState, seen: &RenderState) {
    let side = &seen.sides[state.side];
    let read = seen.facts.iter().flat_map(|facts| &facts.warnings);
    for warning in read.chain(side.warnings.iter()) {
        ui.colored_label(ui.visuals().warn_fg_color, warning);
    }
    let of = |wanted: fn(&EffectState) -> bool| side.effects.iter().filter(move |effect| wanted(&effect.state));
    for effect in of(|state| *state != EffectState::NotCalledFor) {
        let name = RichText::new(format!("{}: {}", effect.id, effect.state)).strong();
        let name = if effect.state == EffectState::Kept { name } else { name.color(ui.visuals().warn_fg_color) };
        ui.label(name);
        ui.weak(effect.reason());
    }
    let unneeded = of(|state| *state == EffectState::NotCalledFor).count();
    if unneeded > 0 {
        let header = egui::CollapsingHeader::new(format!("{unneeded} effects are not needed")).id_salt("not needed");
        header.show(ui, |ui| {
            for effect in of(|state| *state == EffectState::NotCalledFor) {
                ui.label(effect.id.to_string());
                ui.weak(effect.reason());
            }
        });
    }
}
