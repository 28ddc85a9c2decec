//! The picture area: mouse and keyboard navigation, the wipe line of a comparison, and rays drawn over the picture.

use egui::{Align2, Color32, CursorIcon, FontId, Key, PointerButton, Pos2, Rect, Sense, Stroke, Ui};
use glam::{DVec2, DVec3};

use super::PanelState;
use super::pixel::{colour, incidence};
use crate::layer::SurfaceLayer;
use crate::shared::{Pick, RenderState, Trace};
use etalon::plan::KNOBS;
use etalon::scene::{Camera, Projection};
use etalon::transport::events::Way;

/// Flying speed in sizes of the scene per second.
const PACE: f64 = 0.5;

/// Shows the picture in the part of the window that the panels leave free.
pub(super) fn show(ui: &mut Ui, state: &mut PanelState, seen: &RenderState) {
    let rect = ui.available_rect_before_wrap();
    let scale = ui.ctx().pixels_per_point();
    let corner = |p: egui::Pos2| [(p.x * scale).round() as i32, (p.y * scale).round() as i32];
    let ([left, top], [right, bottom]) = (corner(rect.min), corner(rect.max));
    state.place = [left, top, right, bottom];
    let size = [(right - left).max(1) as u32, (bottom - top).max(1) as u32];
    state.moved |= std::mem::replace(&mut state.settings.size, size) != size;
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
    // A touchpad scrolls in points and orbits; a wheel scrolls in lines and zooms.
    let fingers = touchpad(ui);
    if let Some(by) = fingers.filter(|_| response.hovered()) {
        let by = DVec2::new(f64::from(by.x), f64::from(by.y)) / f64::from(rect.height().max(1.0));
        if modifiers.shift {
            navigation.pan(by)
        } else {
            navigation.orbit(by)
        }
        state.moved = true;
    } else if response.hovered() && (scroll.y != 0.0 || pinch != 1.0) {
        // One notch of a wheel is about 50 points; fingers spread by e are 1/0.15 notches.
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
    let under = pointer.filter(|_| response.hovered()).map(|p| {
        let at = [(p.x * scale).floor() as i32 - left, (p.y * scale).floor() as i32 - top];
        at.map(|place| place.max(0) as u32)
    });
    if let Some(pixel) = under.filter(|_| response.clicked() && modifiers.command) {
        state.picks += 1;
        state.picked = Some(Pick { number: state.picks, pixel });
        state.pixel = None;
    }
    let painter = ui.painter_at(rect);
    if let (Some(trace), Some(navigation)) = (seen.trace.as_ref().filter(|_| state.picked.is_some()), &state.navigation)
    {
        rays(&painter, rect, &navigation.camera(), trace, state.pointed);
    }
    if state.other.is_some() && state.layer == SurfaceLayer::Radiance {
        wipe(ui, rect, state, seen);
        under_pointer(ui, rect, under, seen);
    }
}

/// Movement of a two-finger scroll on a touchpad; `None` with Ctrl, which zooms as pinching does.
fn touchpad(ui: &Ui) -> Option<egui::Vec2> {
    ui.input(|input| {
        let by = |event: &egui::Event| match event {
            egui::Event::MouseWheel { unit: egui::MouseWheelUnit::Point, delta, modifiers, .. } => {
                (!modifiers.command).then_some(*delta)
            }
            _ => None,
        };
        input.events.iter().filter_map(by).reduce(|a, b| a + b)
    })
}

/// The wipe line between both sides, and a label with the figures of each side.
fn wipe(ui: &mut Ui, rect: Rect, state: &mut PanelState, seen: &RenderState) {
    let scale = ui.ctx().pixels_per_point();
    let x = state.wipe_column() as f32 / scale;
    let handle = Rect::from_min_max(Pos2::new(x - 5.0, rect.top()), Pos2::new(x + 5.0, rect.bottom()));
    let response =
        ui.interact(handle, ui.id().with("wipe"), Sense::drag()).on_hover_cursor(CursorIcon::ResizeHorizontal);
    if response.dragged() {
        state.wipe = (state.wipe + response.drag_delta().x / rect.width().max(1.0)).clamp(0.0, 1.0);
    }
    let painter = ui.painter_at(rect);
    painter.vline(x, rect.y_range(), Stroke::new(3.0, Color32::BLACK));
    painter.vline(x, rect.y_range(), Stroke::new(1.0, Color32::WHITE));
    for side in 0..2 {
        let Some(text) = account(side, seen) else { continue };
        let (at, align) = match side {
            0 => (rect.left_bottom() + egui::vec2(8.0, -8.0), Align2::LEFT_BOTTOM),
            _ => (rect.right_bottom() + egui::vec2(-8.0, -8.0), Align2::RIGHT_BOTTOM),
        };
        label(&painter, at, align, &text);
    }
}

/// Label of one side: knobs that differ from the other side, time, samples and error.
fn account(side: usize, seen: &RenderState) -> Option<String> {
    let shown = seen.sides[side].shown.as_ref()?;
    let other = seen.sides[1 - side].shown.as_ref().map_or(&shown.knobs, |other| &other.knobs);
    let differs = KNOBS.iter().filter(|knob| knob.place(&shown.knobs) != knob.place(other));
    let own: Vec<String> = differs.map(|knob| format!("{}={}", knob.name, knob.rung(&shown.knobs))).collect();
    // A list of all differences would cover the picture.
    let few = if own.len() > 3 { format!("{} and {} more", own[..3].join(" "), own.len() - 3) } else { own.join(" ") };
    let [done, of] = shown.samples;
    let mut lines = vec![
        format!("{}  {few}", ["left", "right"][side]),
        format!("{:.1} ms and {} rays per sample, {done} of {of} samples", shown.ms(), shown.rays),
    ];
    lines.extend(shown.error.map(|error| format!("estimated relative error {:.1} %", 100.0 * error)));
    let table = seen.facts.as_ref().and_then(|facts| facts.prices.as_ref());
    let known = table.and_then(|table| {
        let is_this = |point: &&etalon_cost::table::Point| {
            shown.knobs.list().iter().all(|(name, rung)| point.knobs.get(*name).is_some_and(|known| known == rung))
        };
        table.points.iter().find(is_this)
    });
    lines.extend(known.map(|point| format!("error {:.2} %, measured by etalon cost", 100.0 * point.error())));
    if side == 1 {
        lines.push(match seen.difference() {
            Some(difference) => format!("FLIP {:.4} between the two sides", difference.flip),
            None => "FLIP: waiting for both sides".to_owned(),
        });
    }
    Some(lines.join("\n"))
}

fn label(painter: &egui::Painter, at: Pos2, align: Align2, text: &str) {
    let galley = painter.layout_no_wrap(text.to_owned(), FontId::monospace(12.0), Color32::WHITE);
    let rect = align.anchor_size(at, galley.size());
    painter.rect_filled(rect.expand(4.0), 3.0, Color32::from_black_alpha(190));
    painter.galley(rect.min, galley, Color32::WHITE);
}

/// Radiance of both sides at the pixel under the pointer, and the angle between the view direction and the normal.
fn under_pointer(ui: &Ui, rect: Rect, under: Option<[u32; 2]>, seen: &RenderState) {
    let (Some([x, y]), Some(surfaces)) = (under, seen.now()) else { return };
    let [width, height] = surfaces.size;
    if x >= width || y >= height {
        return;
    }
    let at = (y * width + x) as usize;
    let three = |v: &[f32; 4]| format!("{:.4} {:.4} {:.4}", v[0], v[1], v[2]);
    let mut text = format!("{x}, {y}");
    for (name, radiance) in ["left", "right"].into_iter().zip(&surfaces.radiance) {
        text += &format!("   {name} {}", three(&radiance[at]));
    }
    let p = &surfaces.pixels[at];
    if p.material != 0 {
        text += &format!("   {:.1}°", incidence(p).acos().to_degrees());
    }
    label(&ui.painter_at(rect), rect.center_top() + egui::vec2(0.0, 8.0), Align2::CENTER_TOP, &text);
}

/// Draws the rays of the inspected pixel as seen by the current camera.
fn rays(painter: &egui::Painter, rect: Rect, camera: &Camera, trace: &Trace, pointed: Option<usize>) {
    for (index, event) in trace.events.iter().enumerate() {
        // A ray that leaves the scene has no end: draw a quarter of it.
        let leaves = event.interaction.is_none() && !matches!(event.way, Way::ToLight(_));
        let to = if leaves { event.from.lerp(event.to, 0.25) } else { event.to };
        let Some([a, b]) = on_screen(camera, rect, [event.from, to]) else { continue };
        let width = if pointed == Some(index) { 4.0 } else { 1.5 };
        if matches!(event.way, Way::ToLight(_)) {
            painter.add(egui::Shape::dashed_line(&[a, b], Stroke::new(width, colour(event)), 6.0, 4.0));
        } else {
            painter.line_segment([a, b], Stroke::new(width + 2.0, Color32::from_black_alpha(150)));
            painter.line_segment([a, b], Stroke::new(width, colour(event)));
        }
        if event.interaction.is_some() {
            painter.circle(b, width + 1.5, colour(event), Stroke::new(1.0, Color32::BLACK));
        }
    }
}

/// Projects a world-space line to the screen, clipped at the near side; `None` where it is behind the eye.
fn on_screen(camera: &Camera, rect: Rect, ends: [DVec3; 2]) -> Option<[Pos2; 2]> {
    let aspect = f64::from(rect.width()) / f64::from(rect.height().max(1.0));
    let camera_from_world = camera.world_from_camera.inverse();
    let [mut a, mut b] = ends.map(|p| camera_from_world.transform_point3(p));
    let half = match camera.projection {
        Projection::Perspective { fov_y, .. } => {
            // Clip at a thousandth of the distance of the farther end.
            let near = -1e-3 * a.z.abs().max(b.z.abs());
            if a.z > near && b.z > near {
                return None;
            }
            let cut = |a: DVec3, b: DVec3| a.lerp(b, (near - a.z) / (b.z - a.z));
            (a, b) = (if a.z > near { cut(a, b) } else { a }, if b.z > near { cut(b, a) } else { b });
            [a, b].map(|p| (0.5 * fov_y).tan() * -p.z)
        }
        Projection::Orthographic { half_height, .. } => [half_height; 2],
    };
    let place = |p: DVec3, half: f64| {
        let at = DVec2::new(p.x / (half * aspect), -p.y / half) * 0.5 + 0.5;
        rect.min + egui::vec2(at.x as f32 * rect.width(), at.y as f32 * rect.height())
    };
    Some([place(a, half[0]), place(b, half[1])])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_meet_the_pixels_that_they_are_seen_in() {
        let camera = Camera::looking_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 90_f64.to_radians()).expect("a camera");
        let rect = Rect::from_min_max(Pos2::new(100.0, 50.0), Pos2::new(300.0, 150.0));
        // 45 degrees up, and twice as far to the right because of the 2:1 aspect ratio.
        let seen = on_screen(&camera, rect, [DVec3::new(0.0, 0.0, -5.0), DVec3::new(4.0, 2.0, -2.0)]);
        let [a, b] = seen.expect("before the eye");
        assert!(
            (a - Pos2::new(200.0, 100.0)).length() < 1e-3 && (b - Pos2::new(300.0, 50.0)).length() < 1e-3,
            "{a} {b}"
        );
        assert!(on_screen(&camera, rect, [DVec3::Z, DVec3::new(1.0, 1.0, 4.0)]).is_none());
        let [a, b] = on_screen(&camera, rect, [DVec3::new(0.0, 0.0, 3.0), DVec3::new(0.0, 0.0, -3.0)]).expect("cut");
        assert!((a - b).length() < 1e-3, "towards the eye it is one point: {a} {b}");
    }
}
