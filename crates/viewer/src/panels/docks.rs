//! Panels around the picture: they can be resized, moved, stacked as tabs, and closed (egui_tiles).

use egui::{Ui, WidgetText};
use egui_tiles::{Behavior, SimplificationOptions, Tile, TileId, Tiles, UiResponse};

use super::{Action, PanelState, display, light, options, picture, pixel, plan, scene, timing};
use crate::layout::{Docks, Pane};
use crate::shared::RenderState;

/// Shows every pane.
pub(super) fn show(
    docks: &mut Docks,
    ui: &mut Ui,
    state: &mut PanelState,
    seen: &RenderState,
    actions: &mut Vec<Action>,
) {
    docks.tree.ui(&mut PaneShower { state, seen, actions }, ui);
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
