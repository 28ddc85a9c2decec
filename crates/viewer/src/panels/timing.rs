//! GPU time per pass: a chart of the last pictures, and the figures of the last one.

use egui::{Align2, Color32, FontId, Sense, Ui};

use super::{HISTORY, PanelState};
use crate::shared::RenderState;
use etalon::gpu::PassTime;

/// Colours of passes, from a palette for colour-blind readers (Okabe and Ito 2008). A pass keeps its colour.
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

fn colour(state: &PanelState, name: &str) -> Color32 {
    let place = state.passes.iter().position(|known| known == name).unwrap_or_default();
    COLOURS[place % COLOURS.len()]
}

/// Shows the panel.
pub(super) fn show(ui: &mut Ui, state: &mut PanelState, seen: &RenderState) {
    let Some(last) = state.history.back() else {
        ui.weak("available when a picture is drawn");
        return;
    };
    let total = |passes: &Vec<PassTime>| passes.iter().map(|pass| pass.ms).sum::<f64>();
    let most = state.history.iter().map(total).fold(1e-6, f64::max);
    ui.label(format!("{:.1} ms of GPU time per sample", total(last)));
    ui.weak(format!("Each column is one of the last {HISTORY} pictures; the height is {most:.1} ms."));
    let (rect, _) = ui.allocate_exact_size(egui::vec2(ui.available_width(), 80.0), Sense::hover());
    ui.painter().rect_filled(rect, 2.0, ui.visuals().extreme_bg_color);
    let width = rect.width() / HISTORY as f32;
    for (column, passes) in state.history.iter().rev().enumerate() {
        let right = rect.right() - column as f32 * width;
        let mut top = rect.bottom();
        for pass in passes {
            let height = (pass.ms / most) as f32 * rect.height();
            let bar = egui::Rect::from_min_max(egui::pos2(right - width, top - height), egui::pos2(right, top));
            ui.painter().rect_filled(bar, 0.0, colour(state, &pass.name));
            top -= height;
        }
    }
    let axis = |at: egui::Pos2, align: Align2, text: String| {
        ui.painter().text(at, align, text, FontId::proportional(11.0), ui.visuals().text_color());
    };
    axis(rect.left_top() + egui::vec2(3.0, 2.0), Align2::LEFT_TOP, format!("{most:.1} ms"));
    axis(rect.left_bottom() + egui::vec2(3.0, -2.0), Align2::LEFT_BOTTOM, "0 ms".to_owned());
    let mut sorted: Vec<&PassTime> = last.iter().collect();
    sorted.sort_by(|a, b| b.ms.total_cmp(&a.ms));
    egui::Grid::new("passes").num_columns(3).striped(true).show(ui, |ui| {
        for pass in sorted {
            let (mark, _) = ui.allocate_exact_size(egui::vec2(10.0, 10.0), Sense::hover());
            ui.painter().rect_filled(mark, 2.0, colour(state, &pass.name));
            ui.label(&pass.name);
            ui.monospace(format!("{:.2} ms", pass.ms));
            ui.end_row();
        }
    });
    if let Some(shown) = seen.shown() {
        ui.separator();
        ui.label(format!("{} rays per sample", shown.rays));
    }
}
