//! What the file contains: statistics, scenes and variants, the tree of nodes, materials, textures, lights, cameras.

use egui::{RichText, Ui};

use super::commands::MenuCommand;
use super::{Action, PanelState, go_to, perform};
use crate::shared::{RenderState, SceneFacts};
use etalon::scene::outline::{FilePart, OutlineNode};

/// Number of nodes up to which the whole tree is unfolded at first.
const UNFOLDED: usize = 60;
/// Largest number of rows of a list.
const MOST_ROWS: usize = 500;

/// Shows the panel.
pub(super) fn show(ui: &mut Ui, state: &mut PanelState, seen: &RenderState, actions: &mut Vec<Action>) {
    let Some(facts) = seen.facts.clone() else {
        ui.weak("no scene is loaded");
        return;
    };
    choices(ui, state, &facts);
    ui.horizontal_wrapped(|ui| {
        for (command, name) in [
            (MenuCommand::Hide, "Hide"),
            (MenuCommand::Isolate, "Show only"),
            (MenuCommand::Frame, "Frame"),
            (MenuCommand::ShowAll, "Show all"),
        ] {
            let hides = !state.choice.hide.is_empty() || !state.choice.only.is_empty();
            let enabled = if command == MenuCommand::ShowAll { hides } else { state.selected.is_some() };
            if ui.add_enabled(enabled, egui::Button::new(name)).clicked() {
                perform(ui, state, seen, command, actions);
            }
        }
    });
    ui.add(egui::TextEdit::singleline(&mut state.filter).hint_text("find a node").desired_width(f32::INFINITY));
    tree(ui, state, &facts);
    ui.separator();
    lists(ui, state, seen, &facts);
}

/// Scenes and variants of the file.
fn choices(ui: &mut Ui, state: &mut PanelState, facts: &SceneFacts) {
    let outline = &facts.outline;
    let mut choose = |name: &str, list: &[FilePart], none: Option<&str>, chosen: &mut Option<String>, now: usize| {
        if list.len() < 2 && none.is_none() || list.is_empty() {
            return;
        }
        let at = chosen.as_ref().and_then(|word| FilePart::position(list, word));
        let text = match (at, none) {
            (Some(at), _) => &list[at].name,
            (None, Some(none)) => none,
            (None, None) => &list[now].name,
        };
        ui.horizontal(|ui| {
            ui.label(name);
            egui::ComboBox::from_id_salt(name)
                .width(ui.available_width() - 8.0)
                .truncate()
                .selected_text(text)
                .show_ui(ui, |ui| {
                    if let Some(none) = none {
                        ui.selectable_value(chosen, None, none);
                    }
                    for (index, one) in list.iter().enumerate() {
                        if ui.selectable_label(at == Some(index), &one.name).clicked() {
                            *chosen = Some(one.key.clone());
                        }
                    }
                });
        });
    };
    choose("scene", &outline.scenes, None, &mut state.choice.scene, outline.scene);
    choose("variant", &outline.variants, Some("as the file says"), &mut state.choice.variant, 0);
}

/// What a node carries: a sign and its name.
fn content(node: &OutlineNode) -> (&'static str, &'static str) {
    match (node.instances.is_empty(), node.lights.is_empty(), node.cameras.is_empty()) {
        (false, _, _) => ("◼", "mesh"),
        (_, false, _) => ("☀", "light"),
        (_, _, false) => ("📷", "camera"),
        _ => ("", "node"),
    }
}

/// The tree of nodes.
fn tree(ui: &mut Ui, state: &mut PanelState, facts: &SceneFacts) {
    let nodes = &facts.outline.nodes;
    let has_children: Vec<bool> = {
        let mut has = vec![false; nodes.len()];
        nodes.iter().filter_map(|node| node.parent).for_each(|parent| has[parent] = true);
        has
    };
    let unfolds = nodes.len() <= UNFOLDED;
    // For small trees the set holds the nodes that are folded, for large ones those that are unfolded.
    let is_unfolded = |set: &std::collections::BTreeSet<usize>, node: usize| set.contains(&node) != unfolds;
    let filter = state.filter.to_lowercase();
    let mut rows: Vec<(usize, usize)> = Vec::new();
    let mut depth = vec![Some(0_usize); nodes.len()];
    for (index, node) in nodes.iter().enumerate() {
        if let Some(parent) = node.parent {
            depth[index] = depth[parent].filter(|_| is_unfolded(&state.expanded, parent)).map(|above| above + 1);
        }
        if filter.is_empty() {
            rows.extend(depth[index].map(|depth| (index, depth)));
        } else if node.name.to_lowercase().contains(&filter) {
            rows.push((index, 0));
        }
    }
    let more = rows.len().saturating_sub(MOST_ROWS);
    for (index, depth) in rows.into_iter().take(MOST_ROWS) {
        let node = &nodes[index];
        ui.horizontal(|ui| {
            ui.add_space(12.0 * depth.min(8) as f32);
            if has_children[index] && filter.is_empty() {
                let unfolded = is_unfolded(&state.expanded, index);
                let fold = ui.small_button(if unfolded { "⏷" } else { "⏵" });
                if fold.on_hover_text("Fold or unfold").clicked() && !state.expanded.remove(&index) {
                    state.expanded.insert(index);
                }
            }
            let mut shown = !node.hidden;
            if ui.checkbox(&mut shown, "").on_hover_text("Show or hide the node with what is below it").changed() {
                match shown {
                    true => state.choice.show(&facts.outline, index),
                    false => state.choice.hide(&facts.outline, index),
                }
            }
            let name = if node.name.is_empty() { "(no name)" } else { &node.name };
            let (sign, kind) = content(node);
            let about = format!("{name}: {kind}");
            let name = format!("{sign} {name}");
            let name = name.trim_start();
            let name = if node.hidden { RichText::new(name).weak() } else { RichText::new(name) };
            let is_selected = state.selected == Some(index);
            let label = egui::Button::selectable(is_selected, name).truncate();
            let response = ui.add(label).on_hover_text(about);
            if response.clicked() {
                state.selected = (!is_selected).then_some(index);
            }
            if response.double_clicked()
                && let (Some(bounds), aspect, Some(navigation)) =
                    (facts.bounds_of(index), state.aspect(), &mut state.navigation)
            {
                navigation.fit_box(bounds, aspect);
                (state.moved, state.selected) = (true, Some(index));
            }
        });
    }
    if more > 0 {
        ui.weak(format!("{more} more: find them by name, or fold branches"));
    }
}

/// Statistics, materials, textures, lights and cameras.
fn lists(ui: &mut Ui, state: &mut PanelState, seen: &RenderState, facts: &SceneFacts) {
    let [triangles, instances, lights] = facts.counts;
    egui::CollapsingHeader::new("Statistics").default_open(true).show(ui, |ui| {
        egui::Grid::new("statistics").num_columns(2).striped(true).show(ui, |ui| {
            let mut row = |name: &str, value: String| {
                ui.label(name);
                ui.monospace(value);
                ui.end_row();
            };
            row("triangles", triangles.to_string());
            row("vertices", facts.vertices.to_string());
            row("instances", instances.to_string());
            row("materials", facts.materials.len().to_string());
            let texels: u64 = facts.images.iter().map(|(_, [w, h])| u64::from(*w) * u64::from(*h)).sum();
            row("textures", format!("{}, {:.1} MB", facts.images.len(), texels as f64 * 4e-6));
            row("lights", lights.to_string());
            let size = facts.bounds.max - facts.bounds.min;
            row("size, m", format!("{:.3} {:.3} {:.3}", size.x, size.y, size.z));
        });
    });
    let list = |name: &str, count: usize| egui::CollapsingHeader::new(format!("{name} ({count})")).id_salt(name);
    list("Materials", facts.materials.len()).show(ui, |ui| {
        for (index, material) in facts.materials.iter().enumerate().take(MOST_ROWS) {
            let name = if material.name.is_empty() { format!("material {index}") } else { material.name.clone() };
            egui::CollapsingHeader::new(name).id_salt(("material", index)).show(ui, |ui| {
                let [r, g, b, a] = material.base_color;
                ui.label(format!("base colour {r:.3} {g:.3} {b:.3}, alpha {a:.3}"));
                ui.label(format!("metallic {:.3}, roughness {:.3}", material.metallic, material.roughness));
                ui.label(format!("index of refraction {:.3}, transmission {:.3}", material.ior, material.transmission));
                if material.emissive != [0.0; 3] {
                    let [r, g, b] = material.emissive;
                    ui.label(format!("emits {r:.3} {g:.3} {b:.3}"));
                }
            });
        }
    });
    list("Textures", facts.images.len()).show(ui, |ui| {
        for (index, (name, [width, height])) in facts.images.iter().enumerate().take(MOST_ROWS) {
            let name = if name.is_empty() { format!("image {index}") } else { name.clone() };
            ui.add(egui::Label::new(format!("{name}, {width}×{height}")).truncate());
        }
    });
    list("Lights", lights).show(ui, |ui| {
        for light in facts.lights.iter().take(MOST_ROWS) {
            let [r, g, b] = light.color;
            let unit = if matches!(light.kind, etalon::scene::LightKind::Directional { .. }) { "lx" } else { "cd" };
            ui.add(egui::Label::new(format!("{}: {r:.3} {g:.3} {b:.3} {unit}", light.name)).truncate());
        }
    });
    list("Cameras", facts.cameras.len()).show(ui, |ui| {
        for (index, camera) in facts.cameras.iter().enumerate().take(MOST_ROWS) {
            if ui.add(egui::Button::new(&camera.name).truncate()).clicked() {
                go_to(state, seen, index);
            }
        }
    });
}
