//! What is drawn over the picture from the host's description of the scene: grid, axes, boxes, lights, the selection,
//! measured distances.

use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Stroke};
use glam::DVec3;

use super::PanelState;
use crate::lookup::on_picture_of;
use crate::shared::SceneFacts;
use etalon::scene::{Bounds, Camera, LightKind};

/// Lines of the grid on either side of the middle.
const LINES: i32 = 10;
/// Largest number of boxes that are drawn.
const MOST_BOXES: usize = 2000;
const SELECTED: Color32 = Color32::from_rgb(255, 160, 40);
const BOX: Color32 = Color32::from_rgb(120, 200, 120);
const LIGHT: Color32 = Color32::from_rgb(240, 228, 66);
const GRID: Color32 = Color32::from_rgba_premultiplied(70, 70, 70, 90);
/// Colours of the axes.
pub(super) const AXES: [Color32; 3] =
    [Color32::from_rgb(230, 80, 70), Color32::from_rgb(110, 190, 60), Color32::from_rgb(90, 150, 250)];

/// The picture on the screen, as a painter of lines in the scene.
pub(super) struct Canvas<'a> {
    pub(super) painter: &'a Painter,
    pub(super) rect: Rect,
    pub(super) camera: Camera,
    /// Size of the picture in pixels.
    pub(super) size: [u32; 2],
}

impl Canvas<'_> {
    /// Ends of a line in world space on the screen; `None` where it is behind the eye.
    pub(super) fn line(&self, ends: [DVec3; 2]) -> Option<[Pos2; 2]> {
        let scale = egui::vec2(self.rect.width() / self.size[0] as f32, self.rect.height() / self.size[1] as f32);
        let ends = on_picture_of(&self.camera, self.size, ends)?;
        Some(ends.map(|p| self.rect.min + egui::vec2(p.x as f32, p.y as f32) * scale))
    }

    fn stroke(&self, ends: [DVec3; 2], stroke: Stroke) {
        if let Some(ends) = self.line(ends) {
            self.painter.line_segment(ends, stroke);
        }
    }

    fn frame(&self, bounds: &Bounds, stroke: Stroke) {
        let corners = bounds.corners();
        for (a, b) in (0..8).flat_map(|i| [1, 2, 4].map(|bit| (i, i | bit))).filter(|(a, b)| a != b) {
            self.stroke([corners[a], corners[b]], stroke);
        }
    }
}

/// Draws the overlays that are on.
pub(super) fn show(canvas: &Canvas<'_>, state: &PanelState, facts: &SceneFacts) {
    let on = &state.preferences.overlays;
    if on.grid {
        grid(canvas, facts.bounds);
    }
    if on.boxes {
        facts.boxes.iter().take(MOST_BOXES).for_each(|bounds| canvas.frame(bounds, Stroke::new(1.0, BOX)));
    }
    if let Some(node) = state.selected.filter(|node| *node < facts.outline.nodes.len()) {
        let boxes = facts.outline.instances_within(node);
        let boxes = boxes.iter().filter_map(|index| facts.boxes.get(*index));
        boxes.take(MOST_BOXES).for_each(|bounds| canvas.frame(bounds, Stroke::new(1.5, SELECTED)));
    }
    if on.lights {
        lights(canvas, facts);
    }
    measured(canvas, &state.measured);
}

/// The step of a grid that has about [`LINES`] lines over a length: 1, 2 or 5 times a power of ten.
fn step(length: f64) -> f64 {
    let wanted = (length / f64::from(LINES)).max(1e-9);
    let power = 10_f64.powf(wanted.log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|times| times * power).into_iter().find(|step| *step >= wanted).unwrap_or(power)
}

fn grid(canvas: &Canvas<'_>, bounds: Bounds) {
    let step = step(bounds.radius());
    let center = bounds.center();
    let middle = DVec3::new((center.x / step).round() * step, bounds.min.y, (center.z / step).round() * step);
    let far = f64::from(LINES) * step;
    for i in -LINES..=LINES {
        let at = f64::from(i) * step;
        // In pieces, for what is behind the eye is cut off by piece.
        for piece in -LINES..LINES {
            let [from, to] = [piece, piece + 1].map(|piece| f64::from(piece) * step);
            canvas
                .stroke([middle + DVec3::new(at, 0.0, from), middle + DVec3::new(at, 0.0, to)], Stroke::new(1.0, GRID));
            canvas
                .stroke([middle + DVec3::new(from, 0.0, at), middle + DVec3::new(to, 0.0, at)], Stroke::new(1.0, GRID));
        }
    }
    for (axis, colour) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().zip(AXES) {
        canvas.stroke([DVec3::ZERO, axis * 0.5 * far], Stroke::new(2.0, colour));
    }
    if let Some([at, _]) = canvas.line([middle, middle + DVec3::X * 1e-6]) {
        text(canvas.painter, at + egui::vec2(4.0, 4.0), Align2::LEFT_TOP, &format!("grid {step} m"));
    }
}

fn lights(canvas: &Canvas<'_>, facts: &SceneFacts) {
    let reach = 0.15 * facts.bounds.radius();
    for light in &facts.lights {
        let (at, towards) = match light.kind {
            LightKind::Point { position, .. } => (position, None),
            LightKind::Spot { position, direction, .. } => (position, Some(direction)),
            LightKind::Directional { direction } => {
                (facts.bounds.center() - direction * facts.bounds.radius(), Some(direction))
            }
        };
        mark(canvas, at, towards, reach, LIGHT, &light.name);
    }
    for camera in &facts.cameras {
        let frame = camera.world_from_camera;
        mark(canvas, frame.translation, Some(-frame.matrix3.z_axis), reach, Color32::LIGHT_BLUE, &camera.name);
    }
}

fn mark(canvas: &Canvas<'_>, at: DVec3, towards: Option<DVec3>, reach: f64, colour: Color32, name: &str) {
    let Some([place, end]) = canvas.line([at, at + towards.unwrap_or(DVec3::Y) * reach]) else { return };
    if towards.is_some() {
        canvas.painter.line_segment([place, end], Stroke::new(1.5, colour));
    }
    canvas.painter.circle(place, 5.0, colour, Stroke::new(1.0, Color32::BLACK));
    text(canvas.painter, place + egui::vec2(8.0, 0.0), Align2::LEFT_CENTER, name);
}

fn measured(canvas: &Canvas<'_>, points: &[DVec3]) {
    for pair in points.windows(2) {
        let Some([a, b]) = canvas.line([pair[0], pair[1]]) else { continue };
        canvas.painter.line_segment([a, b], Stroke::new(3.0, Color32::BLACK));
        canvas.painter.line_segment([a, b], Stroke::new(1.5, SELECTED));
        let distance = format!("{:.4} m", pair[0].distance(pair[1]));
        text(canvas.painter, a.lerp(b, 0.5), Align2::CENTER_CENTER, &distance);
    }
    for point in points {
        if let Some([at, _]) = canvas.line([*point, *point + DVec3::X * 1e-9]) {
            canvas.painter.circle(at, 3.5, SELECTED, Stroke::new(1.0, Color32::BLACK));
        }
    }
}

/// Text on a dark ground.
pub(super) fn text(painter: &Painter, at: Pos2, align: Align2, text: &str) {
    elided(painter, at, align, text, f32::INFINITY);
}

/// Text on a dark ground; lines longer than `width` points end in an ellipsis.
pub(super) fn elided(painter: &Painter, at: Pos2, align: Align2, text: &str, width: f32) {
    let laid = |text: String| painter.layout_no_wrap(text, FontId::monospace(12.0), Color32::WHITE);
    let most = (width / laid("0".to_owned()).size().x) as usize;
    let lines: Vec<String> = text.lines().map(|line| shortened(line, most)).collect();
    let galley = laid(lines.join("\n"));
    let rect = align.anchor_size(at, galley.size());
    painter.rect_filled(rect.expand(4.0), 3.0, Color32::from_black_alpha(190));
    painter.galley(rect.min, galley, Color32::WHITE);
}

/// A line of at most `most` characters.
fn shortened(line: &str, most: usize) -> String {
    match line.char_indices().nth(most) {
        None => line.to_owned(),
        Some(_) => line.chars().take(most.saturating_sub(1)).chain(['…']).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lines_end_in_an_ellipsis() {
        let texts = ["left", "left ×4", "left ×40"].map(|line| shortened(line, 7));
        assert_eq!(texts, ["left", "left ×4", "left ×…"]);
    }

    #[test]
    fn grids_have_round_steps() {
        assert_eq!([0.9, 10.0, 13.0, 49.0].map(step), [0.1, 1.0, 2.0, 5.0]);
    }
}
