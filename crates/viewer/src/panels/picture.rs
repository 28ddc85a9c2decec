//! The picture: mouse and keyboard navigation, clicks, the wipe line of a comparison, and what is drawn over the
//! picture.

use egui::{Align2, Color32, CursorIcon, FontId, Key, PointerButton, Pos2, Rect, Sense, Stroke, Ui};
use glam::{DVec2, DVec3};

use super::overlay::{self, AXES, Canvas, elided, text};
use super::pixel::{colour, incidence};
use super::{Action, Click, Clicked, PanelState};
use crate::layer::SurfaceLayer;
use crate::layout::Pane;
use crate::navigation::{Navigation, ViewSide};
use crate::shared::{Pick, RenderState, Trace};
use etalon::plan::KNOBS;
use etalon::transport::events::Way;

/// Flying speed in sizes of the scene per second.
const PACE: f64 = 0.5;
/// Half the width of the axes in the corner, in points.
const GIZMO: f32 = 34.0;

/// Pixels of the window that a picture fills: all of the area, or less of its height if the sides of what a camera
/// shows would be cut off.
fn fitted([left, top, right, bottom]: [i32; 4], least_aspect: Option<f64>) -> [i32; 4] {
    let (width, height) = ((right - left).max(1), (bottom - top).max(1));
    let most = least_aspect.map_or(height, |aspect| ((f64::from(width) / aspect).round() as i32).max(1));
    let rows = most.min(height);
    let top = top + (height - rows) / 2;
    [left, top, left + width, top + rows]
}

/// Shows the picture in the part of the window that the panels leave free.
pub(super) fn show(ui: &mut Ui, state: &mut PanelState, seen: &RenderState, actions: &mut Vec<Action>) {
    let area = ui.available_rect_before_wrap();
    let scale = ui.ctx().pixels_per_point();
    let corner = |p: Pos2| [(p.x * scale).round() as i32, (p.y * scale).round() as i32];
    let ([left, top], [right, bottom]) = (corner(area.min), corner(area.max));
    let least_aspect = state.navigation.as_ref().map(Navigation::least_aspect);
    state.room = [right - left, bottom - top].map(|side| side.max(1) as u32);
    state.place = fitted([left, top, right, bottom], least_aspect);
    let [left, top, right, bottom] = state.place;
    let rect = Rect::from_min_max(
        Pos2::new(left as f32 / scale, top as f32 / scale),
        Pos2::new(right as f32 / scale, bottom as f32 / scale),
    );
    let size = [(right - left) as u32, (bottom - top) as u32];
    state.moved |= std::mem::replace(&mut state.settings.size, size) != size;
    let response = ui.interact(area, ui.id().with("picture"), Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Image, true, "Picture"));
    if seen.shown().is_none() {
        waiting(ui, area, seen);
    }
    if state.navigation.is_none() {
        return;
    }
    navigate(ui, rect, &response, state);
    let under = response.hover_pos().filter(|p| rect.contains(*p)).map(|p| {
        let at = [(p.x * scale).floor() as i32 - left, (p.y * scale).floor() as i32 - top];
        [at[0].clamp(0, right - left - 1) as u32, at[1].clamp(0, bottom - top - 1) as u32]
    });
    clicks(ui, &response, under, state);
    resolve(state, seen);
    let Some(navigation) = &state.navigation else { return };
    let painter = ui.painter_at(rect);
    let canvas = Canvas { painter: &painter, rect, camera: navigation.camera(), size };
    if let Some(facts) = &seen.facts {
        overlay::show(&canvas, state, facts);
    }
    if let Some(trace) = seen.trace.as_ref().filter(|_| state.picked.is_some()) {
        rays(&canvas, trace, state.pointed);
    }
    if state.other.is_some() && state.layer == SurfaceLayer::Radiance {
        wipe(ui, rect, state, seen);
        under_pointer(ui, rect, under, seen);
    }
    if state.panels && state.preferences.overlays.gizmo {
        gizmo(ui, area, state);
    }
    if response.secondary_clicked() {
        state.forward = Some(Pane::Display);
    }
    response.context_menu(|ui| {
        for entry in super::commands::COMMANDS.iter().filter(|entry| entry.menu == "Edit").take(6) {
            if ui.button(entry.name).clicked() {
                super::perform(ui, state, seen, entry.command, actions);
                ui.close();
            }
        }
    });
}

/// The sign of work before the first picture.
fn waiting(ui: &Ui, area: Rect, seen: &RenderState) {
    let seconds = ui.input(|input| input.time);
    let what = seen.busy.as_deref().unwrap_or("starting");
    let what = if seen.error.is_some() { String::new() } else { format!("{what} … {seconds:.0} s") };
    let colour = ui.visuals().text_color();
    ui.painter().text(area.center(), Align2::CENTER_CENTER, what, FontId::proportional(16.0), colour);
    let progress = Rect::from_center_size(area.center() + egui::vec2(0.0, 24.0), egui::vec2(160.0, 4.0));
    if seen.error.is_none() {
        let at = (seconds * 0.5).fract() as f32;
        let part = Rect::from_min_size(progress.left_top() + egui::vec2(at * 120.0, 0.0), egui::vec2(40.0, 4.0));
        ui.painter().rect_filled(progress, 2.0, ui.visuals().extreme_bg_color);
        ui.painter().rect_filled(part, 2.0, colour);
        ui.ctx().request_repaint_after_secs(0.1);
    }
}

/// Moves the camera by mouse, touchpad and held keys.
fn navigate(ui: &Ui, rect: Rect, response: &egui::Response, state: &mut PanelState) {
    let asking = state.is_asking();
    let Some(navigation) = &mut state.navigation else { return };
    let (modifiers, scroll, pinch, seconds) =
        ui.input(|input| (input.modifiers, input.smooth_scroll_delta(), input.zoom_delta(), input.stable_dt.min(0.1)));
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
            navigation.pan(by);
        } else {
            navigation.orbit(by);
        }
        state.moved = true;
    } else if response.hovered() && (scroll.y != 0.0 || pinch != 1.0) {
        // One notch of a wheel is about 50 points; fingers spread by e are 1/0.15 notches.
        navigation.zoom(f64::from(scroll.y) / 50.0 + f64::from(pinch.ln()) / 0.1625);
        state.moved = true;
    }
    // Ctrl+S is no S, whichever of the two is let go first.
    ui.input(|input| {
        for event in &input.events {
            if let egui::Event::Key { key, pressed: true, repeat: false, modifiers, .. } = event
                && modifiers.is_none()
            {
                state.held.insert(*key);
            }
        }
        state.held.retain(|key| input.key_down(*key) && input.modifiers.is_none());
    });
    let pressed = |key: Key| state.held.contains(&key);
    let axis = |more: Key, less: Key| f64::from(u8::from(pressed(more))) - f64::from(u8::from(pressed(less)));
    let way = DVec3::new(axis(Key::D, Key::A), axis(Key::E, Key::Q), axis(Key::W, Key::S));
    if way != DVec3::ZERO && !ui.ctx().text_edit_focused() && !asking {
        navigation.fly(way * (PACE * f64::from(seconds)));
        state.moved = true;
        ui.ctx().request_repaint();
    }
}

/// Notes what a click is for; most clicks wait for the surfaces at the pixels.
fn clicks(ui: &Ui, response: &egui::Response, under: Option<[u32; 2]>, state: &mut PanelState) {
    let (Some(pixel), Some(navigation)) = (under, &state.navigation) else { return };
    let clicked = |click| Some(Clicked { click, pixel, size: state.settings.size, seen_from: navigation.camera() });
    if response.clicked() && ui.input(|input| input.modifiers.command) {
        state.picks += 1;
        let (size, seen_from) = (state.settings.size, navigation.camera());
        state.picked = Some(Pick { number: state.picks, pixel, size, seen_from });
        (state.pixel, state.forward) = (None, Some(Pane::Pixel));
    } else if response.double_clicked() && !state.measures {
        state.clicked = clicked(Click::Focus);
    } else if response.clicked() {
        state.clicked = clicked(if state.measures { Click::Measure } else { Click::Select });
    }
}

/// Answers a click when the surfaces at the pixels are known. A click into another view or size is forgotten.
fn resolve(state: &mut PanelState, seen: &RenderState) {
    let Some(Clicked { click, pixel: [x, y], size, seen_from }) = &state.clicked else { return };
    let camera = state.navigation.as_ref().map(Navigation::camera);
    if *size != state.settings.size || camera.as_ref() != Some(seen_from) {
        state.clicked = None;
        return;
    }
    let (Some(surfaces), Some(facts)) = (seen.now(), &seen.facts) else { return };
    if surfaces.size != *size || surfaces.seen_from != *seen_from {
        return;
    }
    let (click, p) = (*click, &surfaces.pixels[(y * size[0] + x) as usize]);
    state.clicked = None;
    let at = surfaces.eye + DVec3::from(p.p_rel.map(f64::from));
    let instance = (p.instance as usize).checked_sub(1).filter(|_| p.material != 0);
    match (click, instance) {
        (Click::Select, instance) => {
            state.selected = instance.and_then(|instance| facts.outline.node_of(instance));
            if state.selected.is_some() {
                state.forward = Some(Pane::Scene);
            }
        }
        (_, None) => state.notices.say("there is no surface at this pixel".to_owned()),
        (Click::Measure, Some(_)) => state.measured.push(at),
        (Click::Focus, Some(_)) => {
            if let Some(navigation) = &mut state.navigation {
                navigation.focus(at);
                state.moved = true;
            }
        }
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

/// The axes of the world in the corner of the picture; a click on an end looks from there.
fn gizmo(ui: &mut Ui, area: Rect, state: &mut PanelState) {
    let aspect = state.aspect();
    let Some(navigation) = &mut state.navigation else { return };
    let middle = area.right_top() + egui::vec2(-GIZMO - 14.0, GIZMO + 14.0);
    if area.width() < 6.0 * GIZMO || area.height() < 6.0 * GIZMO {
        return;
    }
    let camera_from_world = navigation.camera().world_from_camera.matrix3.transpose();
    let mut ends: Vec<(ViewSide, &str, DVec3)> =
        ViewSide::ALL.iter().map(|(side, name)| (*side, *name, camera_from_world * side.direction())).collect();
    // The farthest is drawn first.
    ends.sort_by(|a, b| a.2.z.total_cmp(&b.2.z));
    for (side, name, at) in ends {
        let place = middle + egui::vec2(at.x as f32, -at.y as f32) * GIZMO;
        let direction = side.direction();
        let axis = usize::from(direction.y != 0.0) + 2 * usize::from(direction.z != 0.0);
        let positive = direction.element_sum() > 0.0;
        let radius = if positive { 8.0 } else { 5.0 };
        let hit = Rect::from_center_size(place, egui::Vec2::splat(2.0 * radius));
        let response = ui.interact(hit, ui.id().with(("gizmo", name)), Sense::click());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Button, true, name));
        let painter = ui.painter();
        if positive {
            painter.line_segment([middle, place], Stroke::new(2.0, AXES[axis]));
        }
        let focus = response.hovered() || response.has_focus();
        let ring = Stroke::new(1.5, if focus { Color32::WHITE } else { AXES[axis] });
        let fill = if positive { AXES[axis] } else { Color32::from_black_alpha(120) };
        painter.circle(place, radius, fill, ring);
        if positive {
            let name = ["X", "Y", "Z"][axis];
            painter.text(place, Align2::CENTER_CENTER, name, FontId::proportional(11.0), Color32::BLACK);
        }
        if response.on_hover_text(format!("Look from this side: {}", name.to_lowercase())).clicked() {
            navigation.look_from(side, aspect);
            state.moved = true;
        }
    }
}

/// The wipe line between both sides, and a label with the figures of each side.
fn wipe(ui: &mut Ui, rect: Rect, state: &mut PanelState, seen: &RenderState) {
    let scale = ui.ctx().pixels_per_point();
    let x = state.wipe_column() as f32 / scale;
    let handle = Rect::from_min_max(Pos2::new(x - 8.0, rect.top()), Pos2::new(x + 8.0, rect.bottom()));
    let response =
        ui.interact(handle, ui.id().with("wipe"), Sense::drag()).on_hover_cursor(CursorIcon::ResizeHorizontal);
    if response.dragged() {
        state.wipe = (state.wipe + response.drag_delta().x / rect.width().max(1.0)).clamp(0.0, 1.0);
    }
    let painter = ui.painter_at(rect);
    painter.vline(x, rect.y_range(), Stroke::new(3.0, Color32::BLACK));
    painter.vline(x, rect.y_range(), Stroke::new(1.0, Color32::WHITE));
    let knob = Pos2::new(x, rect.center().y);
    painter.circle(knob, 11.0, Color32::WHITE, Stroke::new(2.0, Color32::BLACK));
    painter.text(knob, Align2::CENTER_CENTER, "⬌", FontId::proportional(13.0), Color32::BLACK);
    for side in 0..2 {
        let Some(words) = account(side, seen) else { continue };
        let (at, align) = match side {
            0 => (rect.left_bottom() + egui::vec2(8.0, -8.0), Align2::LEFT_BOTTOM),
            _ => (rect.right_bottom() + egui::vec2(-8.0, -8.0), Align2::RIGHT_BOTTOM),
        };
        // Each label stays in its half of the picture.
        elided(&painter, at, align, &words, (0.5 * rect.width() - 20.0).max(40.0));
    }
}

/// Label of one side: knobs that differ from the other side, time, samples and error. `cost` measures one picture; that
/// of the window may differ from it by view, time and light.
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
        // Short lines: both labels stand side by side.
        format!("{done} of {of} samples"),
        format!("{:.1} ms per sample", shown.ms()),
        format!("{:.2} million rays per sample", shown.rays as f64 * 1e-6),
    ];
    lines.extend(shown.error.map(|error| format!("estimated relative error {:.1} %", 100.0 * error)));
    let table = seen.facts.as_ref().and_then(|facts| facts.prices.as_ref());
    let known = table.and_then(|table| {
        let is_this = |point: &&etalon_cost::table::Point| {
            shown.knobs.list().iter().all(|(name, rung)| point.knobs.get(*name).is_some_and(|known| known == rung))
        };
        table.points.iter().find(is_this)
    });
    let error = known.map(|point| 100.0 * point.error());
    lines.extend(error.map(|error| format!("error {error:.2} % in the picture that etalon cost measured")));
    if side == 1 {
        lines.push(match seen.difference() {
            Some(difference) => format!("FLIP {:.4} between the two sides", difference.flip),
            None => "FLIP: waiting for both sides".to_owned(),
        });
    }
    Some(lines.join("\n"))
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
    let mut words = format!("{x}, {y}");
    for (name, radiance) in ["left", "right"].into_iter().zip(&surfaces.radiance) {
        words += &format!("   {name} {}", three(&radiance[at]));
    }
    let p = &surfaces.pixels[at];
    if p.material != 0 {
        words += &format!("   {:.1}°", incidence(p).acos().to_degrees());
    }
    text(&ui.painter_at(rect), rect.center_top() + egui::vec2(0.0, 8.0), Align2::CENTER_TOP, &words);
}

/// Draws the rays of the inspected pixel as seen by the current camera.
fn rays(canvas: &Canvas<'_>, trace: &Trace, pointed: Option<usize>) {
    let painter = canvas.painter;
    for (index, event) in trace.events.iter().enumerate() {
        // A ray that leaves the scene has no end: draw a quarter of it.
        let leaves = event.interaction.is_none() && !matches!(event.way, Way::ToLight(_));
        let to = if leaves { event.from.lerp(event.to, 0.25) } else { event.to };
        let Some([a, b]) = canvas.line([event.from, to]) else { continue };
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_narrow_area_keeps_the_sides_of_the_picture() {
        assert_eq!(fitted([10, 20, 170, 120], None), [10, 20, 170, 120]);
        assert_eq!(fitted([0, 0, 160, 190], Some(16.0 / 9.0)), [0, 50, 160, 140]);
        assert_eq!(fitted([0, 0, 400, 90], Some(16.0 / 9.0)), [0, 0, 400, 90], "a wide one shows more");
        assert_eq!(fitted([5, 5, 5, 5], Some(2.0)), [5, 5, 6, 6]);
    }
}
