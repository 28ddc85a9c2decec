//! The right panel: the inspected pixel, GPU time per pass, and the plan with its reasons.

use egui::{Color32, Sense, Ui};

use super::{HISTORY, PanelState, pixel};
use crate::shared::RenderState;
use etalon::gpu::PassTime;
use etalon::plan::EffectState;

/// Colours of passes, from a palette for colour-blind readers (Okabe and Ito 2008).
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

/// Shows the panel.
pub(super) fn show(ui: &mut Ui, state: &mut PanelState, seen: &RenderState) {
    ui.heading("Pixel");
    pixel::show(ui, state, seen);
    ui.separator();
    ui.heading("GPU time per pass");
    times(ui, state);
    ui.separator();
    ui.heading("Plan");
    let side = &seen.sides[state.side];
    for effect in side.effects.iter() {
        let color = match effect.state {
            EffectState::Kept => ui.visuals().strong_text_color(),
            EffectState::DroppedBy(_) => ui.visuals().warn_fg_color,
            EffectState::NotCalledFor => ui.visuals().weak_text_color(),
        };
        ui.colored_label(color, format!("{}: {}", effect.id, effect.state)).on_hover_text(effect.reason());
        if effect.state != EffectState::NotCalledFor {
            ui.weak(format!("    {}", effect.reason()));
        }
    }
    let read = seen.facts.iter().flat_map(|facts| &facts.warnings);
    for warning in read.chain(side.warnings.iter()) {
        ui.colored_label(ui.visuals().warn_fg_color, warning);
    }
}

/// Stacked bar chart of the pass times of the last pictures, and a list of the passes.
fn times(ui: &mut Ui, state: &PanelState) {
    let Some(last) = state.history.back() else { return };
    let total = |passes: &Vec<PassTime>| passes.iter().map(|pass| pass.ms).sum::<f64>();
    let most = state.history.iter().map(total).fold(1e-6, f64::max);
    // The slowest passes have their own colours; all others share the last colour.
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
    ui.weak(format!("{:.1} ms per sample (chart maximum {most:.1} ms)", total(last)));
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
