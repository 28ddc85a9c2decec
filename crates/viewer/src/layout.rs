//! Places of the panels around the picture, as data that is stored (egui_tiles).

use egui_tiles::{Linear, LinearDir, Tile, TileId, Tiles, Tree};
use serde::{Deserialize, Serialize};

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

    /// Title of its tab.
    #[must_use]
    pub fn title(self) -> &'static str {
        Self::PANELS.iter().find(|(pane, _)| *pane == self).map_or("Picture", |(_, title)| title)
    }
}

/// Places of all panes.
#[derive(Clone, PartialEq, Serialize, Deserialize)]
pub struct Docks {
    pub(super) tree: Tree<Pane>,
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
