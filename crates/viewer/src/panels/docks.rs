//! Panels around the picture: they can be resized, moved, stacked as tabs, and closed (egui_tiles).

use egui::{Ui, WidgetText};
use egui_tiles::{Behavior, Linear, LinearDir, SimplificationOptions, Tile, TileId, Tiles, Tree, UiResponse};
use serde::{Deserialize, Serialize};

use super::{Action, PanelState, display, light, options, picture, pixel, plan, scene, timing};
use crate::shared::RenderState;

/// Width of the panels in points, in a window of normal size.
const WIDTH: f32 = 340.0;
/// Largest part of the window that the panels take at first.
const LARGEST_PART: f32 = 0.36;

/// A part of the window.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Pane {
    /// The picture.
    Picture,
    /// Nodes, materials, textures, lights and cameras of the file; statistics.
    Scene,
    /// Environment and key light.
    Light,
    /// Model and knobs.
    Options,
    /// Exposure, tone curve, layers, overlays, views and animation.
    Display,
    /// The inspected pixel.
    Pixel,
    /// GPU time of the passes.
    Timing,
    /// Effects with their reasons.
    Plan,
}

impl Pane {
    /// Every panel with its title: those of the upper stack, then those of the lower one.
    pub const PANELS: [(Self, &str); 7] = [
        (Self::Scene, "Scene"),
        (Self::Display, "Display"),
        (Self::Light, "Light"),
        (Self::Options, "Options"),
        (Self::Pixel, "Pixel"),
        (Self::Timing, "Time"),
        (Self::Plan, "Plan"),
    ];
    /// Number of panels in the upper stack.
    const UPPER: usize = 4;

    fn title(self) -> &'static str {
        Self::PANELS.iter().find(|(pane, _)| *pane == self).map_or("Picture", |(_, title)| title)
    }
}

/// Places of all panes.
#[derive(Clone, PartialEq, Serialize, Deserialize)]
pub struct Docks {
    tree: Tree<Pane>,
}

impl Docks {
    /// The default for a window of some width in points: the picture, and two stacks of panels right of it.
    #[must_use]
    pub fn new(width: f32) -> Self {
        let mut tiles = Tiles::default();
        let picture = tiles.insert_pane(Pane::Picture);
        let panels = Pane::PANELS.map(|(pane, _)| tiles.insert_pane(pane));
        let (upper, lower) = panels.split_at(Pane::UPPER);
        let stacks = [upper, lower].map(|stack| tiles.insert_tab_tile(stack.to_vec()));
        let beside = tiles.insert_vertical_tile(stacks.to_vec());
        let mut row = Linear::new(LinearDir::Horizontal, vec![picture, beside]);
        let part = (WIDTH / width.max(1.0)).min(LARGEST_PART);
        row.shares.set_share(picture, 1.0 - part);
        row.shares.set_share(beside, part);
        let root = tiles.insert_container(row);
        Self { tree: Tree::new("docks", root, tiles) }
    }

    fn tile(&self, pane: Pane) -> Option<TileId> {
        self.tree.tiles.iter().find(|(_, tile)| matches!(tile, Tile::Pane(found) if *found == pane)).map(|(id, _)| *id)
    }

    /// Whether every pane is there once: docks that another version wrote may lack some.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        let is_there = |pane: Pane| self.tile(pane).is_some_and(|id| self.tree.tiles.parent_of(id).is_some());
        let count = self.tree.tiles.tiles().filter(|tile| matches!(tile, Tile::Pane(_))).count();
        count == Pane::PANELS.len() + 1
            && is_there(Pane::Picture)
            && Pane::PANELS.iter().all(|(pane, _)| is_there(*pane))
    }

    /// Whether a panel is open.
    #[must_use]
    pub fn is_open(&self, pane: Pane) -> bool {
        self.tile(pane).is_some_and(|id| self.tree.tiles.is_visible(id))
    }

    /// Opens or closes a panel.
    pub fn set_open(&mut self, pane: Pane, open: bool) {
        if let Some(id) = self.tile(pane) {
            self.tree.tiles.set_visible(id, open);
        }
        if open {
            self.bring_forward(pane);
        }
    }

    /// Shows an open panel before those that share its place.
    pub fn bring_forward(&mut self, pane: Pane) {
        let id = self.tile(pane);
        self.tree.make_active(|found, _| Some(found) == id);
    }

    /// Shows every pane.
    pub(super) fn show(&mut self, ui: &mut Ui, state: &mut PanelState, seen: &RenderState, actions: &mut Vec<Action>) {
        self.tree.ui(&mut PaneShower { state, seen, actions }, ui);
    }
}

/// Scrolls to a control that the keyboard has reached.
fn scroll_to_focus(ui: &Ui, state: &PanelState) {
    let focused = state.focused.filter(|_| state.focus_is_new).and_then(|id| ui.ctx().read_response(id));
    if let Some(rect) = focused.map(|response| response.rect).filter(|rect| ui.min_rect().contains_rect(*rect)) {
        ui.scroll_to_rect(rect, None);
    }
}

struct PaneShower<'a> {
    state: &'a mut PanelState,
    seen: &'a RenderState,
    actions: &'a mut Vec<Action>,
}

impl Behavior<Pane> for PaneShower<'_> {
    fn pane_ui(&mut self, ui: &mut Ui, _: TileId, pane: &mut Pane) -> UiResponse {
        let Self { state, seen, actions } = self;
        if *pane == Pane::Picture {
            picture::show(ui, state, seen, actions);
            return UiResponse::None;
        }
        ui.painter().rect_filled(ui.max_rect(), 0.0, ui.visuals().panel_fill);
        egui::Frame::new().inner_margin(8).show(ui, |ui| {
            // Long names are cut or wrapped, so that nothing lies outside.
            egui::ScrollArea::vertical().id_salt(pane.title()).auto_shrink(false).show(ui, |ui| {
                match pane {
                    Pane::Picture => {}
                    Pane::Scene => scene::show(ui, state, seen, actions),
                    Pane::Light => light::show(ui, state, seen),
                    Pane::Options => options::show(ui, state, seen),
                    Pane::Display => display::show(ui, state, seen),
                    Pane::Pixel => pixel::show(ui, state, seen),
                    Pane::Timing => timing::show(ui, state, seen),
                    Pane::Plan => plan::show(ui, state, seen),
                }
                scroll_to_focus(ui, state);
            });
        });
        UiResponse::None
    }

    fn tab_title_for_pane(&mut self, pane: &Pane) -> WidgetText {
        pane.title().into()
    }

    fn is_tab_closable(&self, tiles: &Tiles<Pane>, id: TileId) -> bool {
        !matches!(tiles.get(id), Some(Tile::Pane(Pane::Picture)))
    }

    fn on_tab_close(&mut self, tiles: &mut Tiles<Pane>, id: TileId) -> bool {
        // A closed panel keeps its place.
        tiles.set_visible(id, false);
        false
    }

    fn simplification_options(&self) -> SimplificationOptions {
        SimplificationOptions { all_panes_must_have_tabs: false, prune_single_child_tabs: false, ..Default::default() }
    }

    fn gap_width(&self, _: &egui::Style) -> f32 {
        3.0
    }

    fn min_size(&self) -> f32 {
        120.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn docks_survive_the_file_of_preferences() {
        let mut docks = Docks::new(900.0);
        assert!(docks.is_complete());
        docks.set_open(Pane::Plan, false);
        let text = serde_json::to_string(&docks).expect("JSON");
        let read: Docks = serde_json::from_str(&text).expect("docks");
        assert!(read == docks && read.is_complete() && !read.is_open(Pane::Plan) && read.is_open(Pane::Scene));
        docks.set_open(Pane::Plan, true);
        assert!(docks.is_open(Pane::Plan));
        let id = docks.tile(Pane::Light).expect("a panel");
        docks.tree.tiles.remove(id);
        assert!(!docks.is_complete());
    }
}
