//! The inspected pixel: the surfaces of its line of sight with their materials at that point, the events along its ray,
//! and their equations.

use egui::{Align, Color32, Label, Layout, Pos2, Rect, RichText, Sense, Stroke, Ui, Vec2};
use glam::DVec3;

use super::PanelState;
use crate::equations::used;
use crate::shared::{PixelSurfaces, RenderState, SceneFacts, Trace};
use etalon::lecture;
use etalon::optics::fresnel::{fresnel_conductor, fresnel_dielectric};
use etalon::scene::{AlphaMode, Material};
use etalon::shader::Probe;
use etalon::share::AovPixel;
use etalon::spectra::VISIBLE;
use etalon::transport::events::{Event, GREEN, Interaction, Way};

/// Surface and radiance of a pixel at the time of the inspection.
#[derive(Clone)]
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
    let Some(number) = state.picked.as_ref().map(|picked| picked.number) else {
        ui.weak("Ctrl+click a pixel to inspect it.");
        return;
    };
    let trace = seen.trace.as_ref().filter(|trace| trace.number == number);
    scroll_here(ui, (number, trace.is_some()));
    let (Some(trace), Some(scene)) = (trace, &seen.facts) else {
        ui.weak("available when the picture is finished");
        return;
    };
    let is_there = look(state, trace, seen);
    row(ui, "pixel", &format!("{}, {}", trace.pixel[0], trace.pixel[1]));
    match &state.pixel {
        Some(facts) => {
            for (name, radiance) in ["radiance", "radiance, right"].into_iter().zip(&facts.radiance) {
                row(ui, name, &three([radiance[0], radiance[1], radiance[2]]));
            }
        }
        None if is_there => drop(ui.weak("available when the picture is finished")),
        None => drop(ui.weak("the view moved before the picture was finished; Ctrl+Z undoes the move")),
    }
    surfaces(ui, &trace.events, state.pixel.as_ref(), scene);
    ui.separator();
    ui.strong("Ray of the pixel").on_hover_text(
        "traced in f64 with textbook formulas for green light, with the texels and the normal at each point; orbit to \
         see the rays from another side",
    );
    for index in 0..trace.events.len() {
        if told(ui, &trace.events, index, scene) {
            state.pointed = Some(index);
        }
    }
    ui.separator();
    ui.strong("Equations").on_hover_text("lines of shaders/lib with these formulas");
    for probe in used(&trace.events, &scene.lights, &state.settings.knobs) {
        equation(ui, probe);
    }
}

/// Scrolls to this place once for each new value of `what`.
fn scroll_here(ui: &mut Ui, what: (u64, bool)) {
    let id = ui.id().with("scrolled to");
    if ui.data(|data| data.get_temp(id)) != Some(what) {
        ui.data_mut(|data| data.insert_temp(id, what));
        ui.scroll_to_rect(Rect::from_min_size(ui.cursor().min, Vec2::ZERO), Some(Align::TOP));
    }
}

/// An equation: the lecture's statements, its name, its line, and the formula.
fn equation(ui: &mut Ui, probe: &Probe) {
    ui.horizontal_wrapped(|ui| {
        for id in probe.ids {
            ui.monospace(*id).on_hover_ui(|ui| drop(ui.monospace(stated(id))));
        }
        ui.strong(probe.name);
        let line = format!("shaders/lib/{}.glsl:{}", probe.subject, probe.line);
        if ui.link(format!("{}.glsl:{}", probe.subject, probe.line)).on_hover_text(format!("copy {line}")).clicked() {
            ui.copy_text(line);
        }
    });
    ui.add(Label::new(RichText::new(in_font(probe.formula)).monospace().weak()).wrap());
}

/// A formula without the characters that the panel's monospaced font does not have.
fn in_font(formula: &str) -> String {
    formula.replace('ḡ', "g\u{304}").replace('⊥', "perp")
}

/// What the lecture or docs/numerics.md says under an id. Asterisks and backquotes of Markdown are left out.
fn stated(id: &str) -> String {
    match lecture::statement(id) {
        Some(statement) => format!("{id}: {}", in_font(&statement.replace(['*', '`'], ""))),
        None => format!("{id}: a row of the tables in docs/numerics.md"),
    }
}

/// Width of the column of names. It is fixed, and values are wrapped, so that no pixel changes the panel's width.
const NAMES: f32 = 92.0;

/// A row of a table: name and value.
fn row(ui: &mut Ui, name: &str, value: &str) {
    ui.horizontal_top(|ui| {
        ui.allocate_ui_with_layout(Vec2::new(NAMES, 0.0), Layout::top_down(Align::LEFT), |ui| {
            ui.set_width(NAMES);
            ui.add(Label::new(name).wrap());
        });
        ui.add(Label::new(RichText::new(value).monospace()).wrap());
    });
}

fn three(v: [f32; 3]) -> String {
    format!("{:.5} {:.5} {:.5}", v[0], v[1], v[2])
}

/// Whether an event is a ray of light from a surface, and no shadow ray.
fn is_light(event: &Event) -> bool {
    !matches!(event.way, Way::ToLight(_))
}

/// Number of the surface that an event ends at, from 1, by which tables and rays name it.
fn number(events: &[Event], index: usize) -> usize {
    events[..=index].iter().filter(|event| is_light(event) && event.interaction.is_some()).count()
}

/// Events of the straight line of sight: the eye ray, and what passes straight through the surfaces that it meets.
fn line_of_sight(events: &[Event]) -> Vec<usize> {
    let mut line: Vec<usize> = Vec::new();
    for (index, event) in events.iter().enumerate() {
        let goes_on = event.way == Way::Straight && event.after == line.last().copied();
        if event.way == Way::Seen || goes_on {
            line.push(index);
        }
    }
    line
}

/// The event of the line of sight that ends at the G-buffer's surface: the same instance at the same distance.
fn rasterised(events: &[Event], line: &[usize], p: &AovPixel) -> Option<usize> {
    line.iter().copied().find(|&index| {
        let distance = events[0].from.distance(events[index].to);
        let is_same = |hit: &Interaction| hit.instance + 1 == p.instance as usize;
        events[index].interaction.as_ref().is_some_and(is_same)
            && (distance - f64::from(p.distance)).abs() <= SAME_DISTANCE * distance
    })
}

/// Relative difference of two distances that are of the same surface.
const SAME_DISTANCE: f64 = 1e-3;

/// Name of a surface: that of its material, or of its instance.
fn name(interaction: &Interaction, scene: &SceneFacts) -> String {
    let instance = scene.instances.get(interaction.instance).map_or("", |name| name.as_str());
    if interaction.at.name.is_empty() { instance.to_owned() } else { interaction.at.name.clone() }
}

/// The surfaces of the line of sight from the eye on, each with its table.
fn surfaces(ui: &mut Ui, events: &[Event], facts: Option<&PixelFacts>, scene: &SceneFacts) {
    let line = line_of_sight(events);
    let p = facts.map(|facts| &facts.surface).filter(|p| p.material != 0);
    let drawn = p.and_then(|p| rasterised(events, &line, p));
    for &index in &line {
        let Some(interaction) = &events[index].interaction else { continue };
        let m = &interaction.at;
        let alpha = (m.alpha_mode == AlphaMode::Blend).then(|| format!("alpha {:.2}", interaction.opacity));
        let transmits = (m.transmission > 0.0).then(|| format!("transmission {:.2}", m.transmission));
        let lets_through: Vec<String> = alpha.into_iter().chain(transmits).collect();
        let mut title = format!("{}. {}", number(events, index), name(interaction, scene));
        if !lets_through.is_empty() {
            title += &format!(" ({})", lets_through.join(", "));
        }
        ui.strong(title);
        table(ui, &events[index], interaction, facts.filter(|_| drawn == Some(index)), scene);
    }
    if let (Some(facts), Some(p), None) = (facts, p, drawn) {
        let material = scene.materials.get(p.material as usize - 1).map_or("", |m| &m.name);
        ui.strong(format!("{material}: straight behind, where the rays do not go"));
        place(ui, facts);
        row(ui, "base colour", &three(p.albedo));
        row(ui, "roughness", &format!("{:.4}", p.roughness));
        row(ui, "metallic", &format!("{:.4}", p.metallic));
        row(ui, "incidence", &format!("{:.2}°", incidence(p).acos().to_degrees()));
    }
    if line.iter().all(|&index| events[index].interaction.is_none()) && p.is_none() {
        row(ui, "surface", "none");
    }
}

/// Rows with the place and the normals that the G-buffer holds.
fn place(ui: &mut Ui, facts: &PixelFacts) {
    let p = &facts.surface;
    let position = facts.eye + DVec3::from(p.p_rel.map(f64::from));
    row(ui, "position, m", &format!("{:.4} {:.4} {:.4}", position.x, position.y, position.z));
    row(ui, "distance, m", &format!("{:.5}", p.distance));
    row(ui, "normal", &three(p.normal));
    row(ui, "face normal", &three(p.geometric_normal));
}

/// Difference of a value from the mean over the pixel above which both are shown: twice the step of a texture's byte.
const SEEN_DIFFERENCE: f32 = 2.0 / 255.0;

/// Table of a surface at the point that a ray meets. `drawn`: the pixel, where its G-buffer has this surface.
fn table(ui: &mut Ui, event: &Event, interaction: &Interaction, drawn: Option<&PixelFacts>, scene: &SceneFacts) {
    let m = &interaction.at;
    row(ui, "material", &m.name);
    row(ui, "instance", scene.instances.get(interaction.instance).map_or("", |name| name));
    match drawn {
        Some(facts) => {
            row(ui, "layers", "show this surface, the nearest opaque one");
            place(ui, facts);
        }
        None => {
            row(ui, "position, m", &format!("{:.4} {:.4} {:.4}", event.to.x, event.to.y, event.to.z));
            row(ui, "normal", &three(interaction.normal.as_vec3().to_array()));
        }
    }
    if scene.materials.get(interaction.material).is_some_and(|m| m.normal_texture.is_some()) {
        row(ui, "", "bent by the normal map");
    }
    let [r, g, b, alpha] = m.base_color;
    row(ui, "base colour", &three([r, g, b]));
    if m.alpha_mode != AlphaMode::Opaque {
        row(ui, "alpha", &format!("{alpha:.4}"));
    }
    row(ui, "roughness", &format!("{:.4}", m.roughness));
    row(ui, "metallic", &format!("{:.4}", m.metallic));
    if m.transmission > 0.0 {
        row(ui, "transmission", &format!("{:.4}", m.transmission));
    }
    if m.clearcoat > 0.0 {
        row(ui, "clear coat", &format!("{:.4}, roughness {:.4}", m.clearcoat, m.clearcoat_roughness));
    }
    if m.specular != 1.0 || m.specular_color != [1.0; 3] {
        row(ui, "specular", &format!("{:.4}, colour {}", m.specular, three(m.specular_color)));
    }
    if m.emissive != [0.0; 3] {
        row(ui, "emission", &three(m.emissive));
    }
    for (lobe, of) in m.lobes().filter(|(lobe, of)| lobe.is_on(of)) {
        row(ui, lobe.name, &lobe.says(of));
    }
    if let Some(p) = drawn.map(|facts| &facts.surface) {
        let values = [r, g, b, m.roughness, m.metallic];
        let means = [p.albedo[0], p.albedo[1], p.albedo[2], p.roughness, p.metallic];
        if values.into_iter().zip(means).any(|(value, mean)| (value - mean).abs() > SEEN_DIFFERENCE) {
            let means = format!("{}, roughness {:.4}, metallic {:.4}", three(p.albedo), p.roughness, p.metallic);
            row(ui, "over the pixel", &means);
        }
    }
    row(ui, "incidence", &format!("{:.2}°", interaction.cos.acos().to_degrees()));
    if m.unlit {
        row(ui, "Fresnel", "none: the material is unlit");
        return;
    }
    fresnel(ui, interaction);
    if (m.metallic > 0.0 && m.conductor_spectra.is_some()) || (m.metallic < 1.0 && varies(m)) {
        curves(ui, m);
    }
}

/// Whether the refractive index of a dielectric depends on the wavelength.
fn varies(m: &Material) -> bool {
    m.conductor.is_none() && m.dispersion.disperses(f64::from(m.ior))
}

/// Rows with the Fresnel reflectance of green light at a point: of the dielectric and of the metallic part, and of
/// their mixture. n and κ are given at three wavelengths where they differ, with the reflectance that they alone give.
fn fresnel(ui: &mut Ui, interaction: &Interaction) {
    let m = &interaction.at;
    let percent = |share: f64| format!("{:.2} %", 100.0 * share);
    let [dielectric, metal] = interaction.parts;
    let bands = [650.0, GREEN, 450.0];
    if m.metallic < 1.0 {
        let index = |nm| m.dispersion.index(f64::from(m.ior), nm);
        let green = index(GREEN);
        if m.dispersion.disperses(f64::from(m.ior)) {
            for nm in bands {
                let n = index(nm);
                // The ratio depends on the wavelength where the medium on one side disperses.
                let ratio =
                    if interaction.ratio < 1.0 { interaction.ratio * green / n } else { interaction.ratio * n / green };
                let share = fresnel_dielectric(interaction.cos, ratio)[0];
                row(ui, &format!("n at {nm} nm"), &format!("{n:.4}, F {}", percent(share)));
            }
        } else {
            row(ui, "n", &format!("{green:.4}"));
        }
        row(ui, "Fresnel", &format!("{} of the dielectric", percent(dielectric)));
    }
    if m.metallic > 0.0 {
        match m.conductor {
            None => row(ui, "n, κ", "of the metal not given: F0 is the base colour"),
            Some(_) => {
                for nm in bands {
                    let [n, kappa] = m.complex_index(nm);
                    let share = fresnel_conductor(interaction.cos, n, kappa)[0];
                    row(ui, &format!("n, κ at {nm} nm"), &format!("{n:.4} {kappa:.4}, F {}", percent(share)));
                }
            }
        }
        row(ui, "Fresnel", &format!("{} of the metal", percent(metal)));
    }
    if m.metallic > 0.0 && m.metallic < 1.0 {
        let share = f64::from(m.metallic);
        let mixed = dielectric + (metal - dielectric) * share;
        row(ui, "mixture", &format!("{:.1} % metal: F {}", 100.0 * share, percent(mixed)));
    }
    if m.clearcoat > 0.0 {
        row(ui, "with its coat", &format!("F {}, by the normal of the base", percent(interaction.reflected)));
    }
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
    match (event.way, &event.interaction) {
        (Way::Seen, _) => Color32::WHITE,
        (Way::Mirrored, _) => Color32::from_rgb(230, 159, 0),
        (Way::Bent, _) => Color32::from_rgb(86, 180, 233),
        (Way::Straight, _) => Color32::from_rgb(170, 170, 170),
        (Way::ToLight(_), None) => Color32::from_rgb(240, 228, 66),
        (Way::ToLight(_), Some(_)) => Color32::from_rgb(213, 94, 0),
    }
}

/// Shows one event as text; returns whether the pointer is on it. Pointing at a surface shows its table.
fn told(ui: &mut Ui, events: &[Event], index: usize, scene: &SceneFacts) -> bool {
    let event = &events[index];
    let share = format!("{:.1} %", 100.0 * event.share);
    let length = event.from.distance(event.to);
    let text = match (event.way, &event.interaction) {
        (Way::ToLight(index), interaction) => {
            let light = scene.lights.get(index).map_or("", |light| &light.name);
            match interaction {
                None => format!("to light {index} {light}: {length:.3} m, not blocked"),
                Some(interaction) => {
                    let lets_through = interaction.at.transmission > 0.0 || interaction.opacity < 1.0;
                    let how = if lets_through { "partly blocked" } else { "blocked" };
                    format!("to light {index} {light}: {how} by {}", name(interaction, scene))
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
                        "{way} {share}: {}. {} after {length:.4} m, {:.2}°, n₂/n₁ {:.4}, reflects {:.2} %{thrown}",
                        number(events, index),
                        name(interaction, scene),
                        interaction.cos.acos().to_degrees(),
                        interaction.ratio,
                        100.0 * interaction.reflected
                    )
                }
            }
        }
    };
    ui.horizontal_top(|ui| {
        ui.add_space(8.0 * depth(events, index) as f32);
        let (dot, _) = ui.allocate_exact_size(egui::vec2(8.0, 14.0), Sense::hover());
        ui.painter().circle(dot.center(), 3.5, colour(event), Stroke::new(1.0, Color32::from_gray(90)));
        let label = ui.add(Label::new(text).wrap());
        match event.interaction.as_ref().filter(|_| is_light(event)) {
            Some(interaction) => label.on_hover_ui(|ui| table(ui, event, interaction, None, scene)).hovered(),
            None => label.hovered(),
        }
    })
    .inner
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use std::sync::Arc;

    use egui::FontId;
    use etalon::frame::Settings;
    use etalon::prepare::Original;
    use etalon::scene::{Camera, Image, Instance, Mesh, Sampler, Scene, TextureRef};
    use etalon::shader::PROBES;
    use etalon::transport::events::{EventTracer, Limits};
    use glam::{Affine2, DAffine3};

    use crate::shared::{Loaded, RenderRequest};

    /// Shows what `add` adds in a column of 260 points; returns its texts and its width.
    fn shown(context: &egui::Context, mut add: impl FnMut(&mut Ui)) -> (Vec<String>, f32) {
        let mut width = 0.0;
        let mut output = context.run_ui(egui::RawInput::default(), |ui| {
            ui.set_max_width(260.0);
            add(ui);
            width = ui.min_rect().width();
        });
        output.textures_delta.clear();
        let texts = output.shapes.iter().filter_map(|shape| match &shape.shape {
            egui::Shape::Text(text) => Some(text.galley.text().to_owned()),
            _ => None,
        });
        (texts.collect(), width)
    }

    #[test]
    fn the_fonts_have_every_character_that_is_shown() {
        let equations = PROBES.iter().flat_map(|probe| {
            let ids = probe.ids.iter().map(|id| stated(id));
            [in_font(probe.formula)].into_iter().chain(ids)
        });
        let texts: [BTreeSet<char>; 2] =
            [equations.flat_map(|text| text.chars().collect::<Vec<_>>()).collect(), "n, κ n₂/n₁ °".chars().collect()];
        let mut missing: Vec<char> = Vec::new();
        shown(&egui::Context::default(), |ui| {
            for (font, characters) in [FontId::monospace(12.0), FontId::proportional(12.0)].into_iter().zip(&texts) {
                // A character that no font has is drawn as the white square.
                let drawn = |c: char| {
                    let galley =
                        ui.fonts_mut(|fonts| fonts.layout_no_wrap(c.to_string(), font.clone(), Color32::WHITE));
                    galley.rows[0].glyphs[0].uv_rect
                };
                missing.extend(characters.iter().filter(|&&c| drawn(c) == drawn('◻')));
            }
        });
        assert!(missing.is_empty(), "{missing:?}");
    }

    /// Alpha-blended glass before leather, whose metallic factor is 1 and whose texture says 0.4.
    fn glass_before_leather() -> (Arc<SceneFacts>, Vec<Event>) {
        let texel = TextureRef { image: 0, uv_set: 0, uv_transform: Affine2::IDENTITY, sampler: Sampler::default() };
        let leather = Material {
            name: "leather".to_owned(),
            metallic_roughness_texture: Some(texel),
            base_color: [0.4, 0.3, 0.2, 1.0],
            ..Material::default()
        };
        let glass = Material {
            name: "lens glass".to_owned(),
            alpha_mode: AlphaMode::Blend,
            metallic: 0.0,
            base_color: [1.0, 1.0, 1.0, 0.3],
            ..Material::default()
        };
        let sheet = |material| Mesh {
            positions: vec![[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 2.0, 0.0]].into(),
            normals: vec![[0.0, 0.0, 1.0]; 3].into(),
            indices: vec![0, 1, 2].into(),
            material,
            ..Mesh::default()
        };
        let placed = |mesh: usize, z| Instance {
            name: "an instance with a name of more characters than one line of the panel has".to_owned(),
            mesh,
            world_from_object: DAffine3::from_translation(DVec3::new(0.0, 0.0, z)),
        };
        let scene = Scene {
            meshes: vec![sheet(0), sheet(1)],
            instances: vec![placed(0, 1.0), placed(1, 0.0)],
            materials: vec![glass, leather],
            images: vec![Image { name: String::new(), width: 1, height: 1, rgba: vec![0, 128, 102, 255].into() }],
            ..Scene::default()
        };
        let camera = Camera::looking_at(DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, 0.5).expect("a camera");
        let original = Original::from(scene);
        let tracer = EventTracer::new(original.scene(), original.bvh().expect("a tree"));
        let limits = Limits { surfaces: 1, roughest: 0.2, least_share: 0.01, proxies: true };
        let events = tracer.follow(original.scene(), &camera, [3, 3], [1, 1], &limits);
        let loaded = Loaded::new(original, camera);
        let facts = SceneFacts::of(&RenderRequest::new(Settings::default()), &loaded).expect("a scene");
        (Arc::new(facts), events)
    }

    #[test]
    fn every_surface_in_sight_has_a_table_of_its_own_texels() {
        let (scene, events) = glass_before_leather();
        let surface = AovPixel {
            p_rel: [0.0, 0.0, -5.0],
            normal: [0.0, 0.0, 1.0],
            geometric_normal: [0.0, 0.0, 1.0],
            albedo: [0.4, 0.3, 0.2],
            distance: 5.0,
            roughness: 128.0 / 255.0,
            metallic: 0.4,
            emissive: [0.0; 3],
            material: 2,
            instance: 2,
        };
        let facts = PixelFacts { surface, radiance: Vec::new(), eye: DVec3::Z * 5.0 };
        let context = egui::Context::default();
        let (texts, width) = shown(&context, |ui| {
            surfaces(ui, &events, Some(&facts), &scene);
            for index in 0..events.len() {
                told(ui, &events, index, &scene);
            }
        });
        let place = |start: &str| {
            texts.iter().position(|text| text.starts_with(start)).unwrap_or_else(|| panic!("{start}: {texts:#?}"))
        };
        let rows = ["1. lens glass (alpha 0.30)", "2. leather", "show this surface", "40.0 % metal", "eye ray"];
        assert!(rows.map(place).is_sorted(), "{texts:#?}");
        place("transmitted straight 70.0 %: 2. leather");
        // At normal incidence: (0.5/2.5)², and the base colour of green.
        place("4.00 % of the dielectric");
        place("30.00 % of the metal");
        place("40.0 % metal: F 14.40 %");
        assert!(!texts.iter().any(|text| text.starts_with("over the pixel")), "{texts:#?}");
        assert!(width <= 260.0, "{width}");

        // What the picture filters over the pixel is told where it differs.
        let filtered = AovPixel { metallic: 0.5, ..surface };
        let (texts, _) = shown(&context, |ui| {
            surfaces(ui, &events, Some(&PixelFacts { surface: filtered, ..facts.clone() }), &scene);
        });
        assert!(texts.iter().any(|text| text.ends_with("metallic 0.5000")), "{texts:#?}");
        // A surface that no ray reaches is no surface of the list.
        let elsewhere = AovPixel { distance: 4.5, ..surface };
        let (texts, _) = shown(&context, |ui| {
            surfaces(ui, &events, Some(&PixelFacts { surface: elsewhere, ..facts.clone() }), &scene);
        });
        assert!(texts.iter().any(|text| text == "leather: straight behind, where the rays do not go"), "{texts:#?}");
    }
}
