//! The inspected pixel: its surface, its refractive index by wavelength, the events along its ray, and their equations.

use egui::{Color32, Pos2, Sense, Stroke, Ui};
use glam::DVec3;

use super::PanelState;
use crate::equations::used;
use crate::shared::{PixelSurfaces, RenderState, SceneFacts, Trace};
use etalon::optics::fresnel::{fresnel_conductor, fresnel_dielectric};
use etalon::scene::Material;
use etalon::share::AovPixel;
use etalon::spectra::VISIBLE;
use etalon::transport::events::{Event, GREEN, Interaction, Way};

/// Surface and radiance of a pixel at the time of the inspection.
pub(super) struct PixelFacts {
    surface: AovPixel,
    /// Radiance of each side.
    radiance: Vec<[f32; 4]>,
    eye: DVec3,
}

/// Cosine of the angle between the normal and the direction to the eye.
pub(super) fn incidence(p: &AovPixel) -> f64 {
    let [normal, way] = [p.normal, p.p_rel].map(|v| DVec3::from(v.map(f64::from)));
    (-way.normalize_or_zero().dot(normal)).clamp(-1.0, 1.0)
}

/// Stores the facts of the pixel while the camera is still that of the inspection; returns whether it is.
fn look(state: &mut PanelState, trace: &Trace, seen: &RenderState) -> bool {
    if state.navigation.as_ref().is_none_or(|navigation| navigation.camera() != trace.seen_from) {
        return false;
    }
    let is_of = |surfaces: &&PixelSurfaces| surfaces.size == trace.size && surfaces.seen_from == trace.seen_from;
    let Some(surfaces) = seen.now().filter(is_of) else { return true };
    let ([x, y], [width, height]) = (trace.pixel, surfaces.size);
    if x < width && y < height {
        let at = (y * width + x) as usize;
        let radiance = surfaces.radiance.iter().map(|side| side[at]).collect();
        state.pixel = Some(PixelFacts { surface: surfaces.pixels[at], radiance, eye: surfaces.eye });
    }
    true
}

pub(super) fn show(ui: &mut Ui, state: &mut PanelState, seen: &RenderState) {
    let Some(picked) = state.picked else {
        ui.weak("Ctrl+click a pixel to inspect it.");
        return;
    };
    let (Some(trace), Some(scene)) = (seen.trace.as_ref().filter(|trace| trace.number == picked.number), &seen.facts)
    else {
        ui.weak("available when the picture is finished");
        return;
    };
    let is_there = look(state, trace, seen);
    match &state.pixel {
        Some(facts) => {
            let interaction = trace.events.first().and_then(|event| event.interaction);
            surface(ui, trace.pixel, facts, scene, interaction);
        }
        None if is_there => drop(ui.weak("available when the picture is finished")),
        None => drop(ui.weak("the view moved before the picture was finished; Ctrl+Z undoes the move")),
    }
    ui.separator();
    ui.strong("Ray of the pixel").on_hover_text(
        "traced in f64 with textbook formulas for green light, without normal maps; orbit to see the rays from another side",
    );
    for (index, event) in trace.events.iter().enumerate() {
        if told(ui, event, depth(&trace.events, index), scene) {
            state.pointed = Some(index);
        }
    }
    ui.separator();
    ui.strong("Equations").on_hover_text("lines of shaders/lib with these formulas; hover a line to see its formula");
    for probe in used(&trace.events, &scene.materials, &scene.lights, &state.settings.knobs) {
        let ids = probe.ids.join(" ");
        let text = format!("{ids}  {}  {}.glsl:{}", probe.name, probe.subject, probe.line);
        ui.monospace(text).on_hover_text(probe.formula);
    }
}

/// Table of the surface at the pixel.
fn surface(ui: &mut Ui, [x, y]: [u32; 2], facts: &PixelFacts, scene: &SceneFacts, interaction: Option<Interaction>) {
    let p = &facts.surface;
    let material = (p.material as usize).checked_sub(1).and_then(|index| scene.materials.get(index));
    egui::Grid::new("pixel").num_columns(2).striped(true).show(ui, |ui| {
        let mut row = |name: &str, value: String| {
            ui.label(name);
            ui.monospace(value);
            ui.end_row();
        };
        let three = |v: [f32; 3]| format!("{:.5} {:.5} {:.5}", v[0], v[1], v[2]);
        row("pixel", format!("{x}, {y}"));
        for (name, radiance) in ["radiance", "radiance, right"].into_iter().zip(&facts.radiance) {
            row(name, three([radiance[0], radiance[1], radiance[2]]));
        }
        if p.material == 0 {
            row("surface", "none".to_owned());
            return;
        }
        let instance = scene.instances.get(p.instance as usize - 1);
        row("material", material.map_or_else(String::new, |m| m.name.clone()));
        row("instance", instance.cloned().unwrap_or_default());
        let position = facts.eye + DVec3::from(p.p_rel.map(f64::from));
        row("position, m", format!("{:.4} {:.4} {:.4}", position.x, position.y, position.z));
        row("distance, m", format!("{:.5}", p.distance));
        row("normal", three(p.normal));
        row("face normal", three(p.geometric_normal));
        row("albedo", three(p.albedo));
        row("roughness", format!("{:.4}", p.roughness));
        row("metallic", format!("{:.4}", p.metallic));
        row("incidence", format!("{:.2}°", incidence(p).acos().to_degrees()));
        if let (Some(m), Some(interaction)) = (material, interaction) {
            indices(&mut row, m, interaction);
        }
    });
    if let Some(m) = material.filter(|m| m.conductor_spectra.is_some() || varies(m)) {
        curves(ui, m);
    }
}

/// Whether the refractive index of a dielectric depends on the wavelength.
fn varies(m: &Material) -> bool {
    m.conductor.is_none() && m.dispersion.disperses(f64::from(m.ior))
}

/// Rows with n and κ, at three wavelengths where they differ, and the Fresnel reflectance of green light. Where only
/// the index decides, the other wavelengths have their reflectance too.
fn indices(row: &mut impl FnMut(&str, String), m: &Material, interaction: Interaction) {
    let [green, _] = m.complex_index(GREEN);
    if m.metallic >= 1.0 && m.conductor.is_none() {
        row("n, κ", "not given (F0 = base colour)".to_owned());
    } else if m.conductor.is_none() && !varies(m) {
        row("n", format!("{green:.4}"));
    } else {
        for nm in [650.0, GREEN, 450.0] {
            let [n, kappa] = m.complex_index(nm);
            // The ratio depends on the wavelength where the medium on one side disperses.
            let ratio =
                if interaction.ratio < 1.0 { interaction.ratio * green / n } else { interaction.ratio * n / green };
            let share = if kappa > 0.0 {
                fresnel_conductor(interaction.cos, n, kappa)[0]
            } else {
                fresnel_dielectric(interaction.cos, ratio)[0]
            };
            row(&format!("n, κ at {nm} nm"), format!("{n:.4} {kappa:.4}, F {:.2} %", 100.0 * share));
        }
    }
    row("Fresnel", format!("{:.3} % reflected", 100.0 * interaction.reflected));
}

/// Plot of n and κ over the visible wavelengths.
fn curves(ui: &mut Ui, m: &Material) {
    let (rect, _) = ui.allocate_exact_size(egui::vec2(ui.available_width(), 64.0), Sense::hover());
    ui.painter().rect_filled(rect, 2.0, ui.visuals().extreme_bg_color);
    let step = |i: u32| VISIBLE.from + (VISIBLE.to - VISIBLE.from) * f64::from(i) / 64.0;
    let values: Vec<[f64; 2]> = (0..=64).map(|i| m.complex_index(step(i))).collect();
    let is_metal = values.iter().any(|[_, kappa]| *kappa > 0.0);
    for (which, (name, colour)) in [("n", Color32::from_rgb(86, 180, 233)), ("κ", Color32::from_rgb(230, 159, 0))]
        .into_iter()
        .enumerate()
        .take(1 + usize::from(is_metal))
    {
        let ends =
            values.iter().map(|v| v[which]).fold([f64::INFINITY, 0.0], |[low, high], v| [low.min(v), high.max(v)]);
        let [low, high] = ends;
        let place = |(i, v): (usize, &[f64; 2])| {
            let up = ((v[which] - low) / (high - low).max(1e-9)) as f32;
            Pos2::new(rect.left() + rect.width() * i as f32 / 64.0, rect.bottom() - 6.0 - up * (rect.height() - 12.0))
        };
        ui.painter().add(egui::Shape::line(values.iter().enumerate().map(place).collect(), Stroke::new(2.0, colour)));
        ui.colored_label(colour, format!("{name} {low:.4} to {high:.4}, {:.0} to {:.0} nm", VISIBLE.from, VISIBLE.to));
    }
}

/// Number of events before an event on its path.
fn depth(events: &[Event], index: usize) -> usize {
    std::iter::successors(events[index].after, |&before| events[before].after).count()
}

/// Colour in which a ray is drawn.
pub(super) fn colour(event: &Event) -> Color32 {
    match (event.way, event.interaction) {
        (Way::Seen, _) => Color32::WHITE,
        (Way::Mirrored, _) => Color32::from_rgb(230, 159, 0),
        (Way::Bent, _) => Color32::from_rgb(86, 180, 233),
        (Way::Straight, _) => Color32::from_rgb(170, 170, 170),
        (Way::ToLight(_), None) => Color32::from_rgb(240, 228, 66),
        (Way::ToLight(_), Some(_)) => Color32::from_rgb(213, 94, 0),
    }
}

/// Shows one event as text; returns whether the pointer is on it.
fn told(ui: &mut Ui, event: &Event, depth: usize, scene: &SceneFacts) -> bool {
    let name = |interaction: &Interaction| {
        let material = scene.materials.get(interaction.material).map_or("", |m| &m.name);
        let instance = scene.instances.get(interaction.instance).map_or("", |name| name.as_str());
        if instance.is_empty() { material.to_owned() } else { instance.to_owned() }
    };
    let share = format!("{:.1} %", 100.0 * event.share);
    let length = event.from.distance(event.to);
    let text = match (event.way, &event.interaction) {
        (Way::ToLight(index), interaction) => {
            let light = scene.lights.get(index).map_or("", |light| &light.name);
            match interaction {
                None => format!("to light {index} {light}: {length:.3} m, not blocked"),
                Some(interaction) => {
                    let lets_through = scene.materials.get(interaction.material).is_some_and(|m| m.transmission > 0.0);
                    let how = if lets_through { "partly blocked" } else { "blocked" };
                    format!("to light {index} {light}: {how} by {}", name(interaction))
                }
            }
        }
        (way, interaction) => {
            let way = match way {
                Way::Seen => "eye ray",
                Way::Mirrored => "reflected",
                Way::Bent => "refracted",
                _ => "transmitted straight",
            };
            match interaction {
                None => format!("{way} {share}: leaves the scene"),
                Some(interaction) => {
                    let thrown = if interaction.total { ", total internal reflection (F6)" } else { "" };
                    format!(
                        "{way} {share}: {} after {length:.4} m, {:.2}°, n₂/n₁ {:.4}, reflects {:.2} %{thrown}",
                        name(interaction),
                        interaction.cos.acos().to_degrees(),
                        interaction.ratio,
                        100.0 * interaction.reflected
                    )
                }
            }
        }
    };
    ui.horizontal_top(|ui| {
        ui.add_space(8.0 * depth as f32);
        let (dot, _) = ui.allocate_exact_size(egui::vec2(8.0, 14.0), Sense::hover());
        ui.painter().circle(dot.center(), 3.5, colour(event), Stroke::new(1.0, Color32::from_gray(90)));
        ui.add(egui::Label::new(text).wrap()).hovered()
    })
    .inner
}
