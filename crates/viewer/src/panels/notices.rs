//! Messages over the picture: the current long operation, finished actions, failures.

use egui::{Color32, Stroke, Ui};

use super::{Action, PanelState, style};
use crate::shared::RenderState;

/// Seconds for which a message about a finished action is shown.
const SHOWN: f64 = 4.0;
/// Number of messages that are shown at once.
const MOST: usize = 3;

/// Messages about finished actions. Failures stay until they are closed.
#[derive(Debug, Default)]
pub struct Notices {
    all: Vec<Notice>,
}

#[derive(Debug, Clone, PartialEq)]
struct Notice {
    text: String,
    failed: bool,
    /// Time of the user interface when it was first shown.
    since: Option<f64>,
}

impl Notices {
    /// Says that something is done; the message fades.
    pub fn say(&mut self, text: String) {
        self.add(text, false);
    }

    /// Says that something failed; the message stays until it is closed.
    pub fn fail(&mut self, text: String) {
        self.add(text, true);
    }

    fn add(&mut self, text: String, failed: bool) {
        // The last message of an action that is repeated replaces those before.
        self.all.retain(|notice| notice.failed && notice.text != text);
        self.all.push(Notice { text, failed, since: None });
        if self.all.len() > MOST {
            self.all.remove(0);
        }
    }

    /// Closes all messages.
    pub fn clear(&mut self) {
        self.all.clear();
    }
}

/// Shows the messages.
pub(super) fn show(ui: &mut Ui, state: &mut PanelState, seen: &RenderState, actions: &mut Vec<Action>) {
    let now = ui.input(|input| input.time);
    let [left, _, right, bottom] = state.place.map(|side| side as f32 / ui.ctx().pixels_per_point());
    state.notices.all.retain(|notice| notice.failed || notice.since.is_none_or(|since| now - since < SHOWN));
    for notice in &mut state.notices.all {
        let since = *notice.since.get_or_insert(now);
        if !notice.failed {
            ui.ctx().request_repaint_after_secs((SHOWN - (now - since)).max(0.01) as f32);
        }
    }
    let busy = seen.busy.as_ref().filter(|_| seen.shown().is_some()).map(|busy| format!("{busy} …"));
    if state.notices.all.is_empty() && seen.error.is_none() && busy.is_none() {
        return;
    }
    let width = (right - left - 32.0).clamp(160.0, 640.0);
    // The figures of a comparison stand at the bottom.
    let above = if state.other.is_some() { 110.0 } else { 12.0 };
    let place = egui::pos2(0.5 * (left + right), bottom - above);
    let area = egui::Area::new(egui::Id::new("notices")).pivot(egui::Align2::CENTER_BOTTOM).fixed_pos(place);
    area.order(egui::Order::Foreground).show(ui.ctx(), |ui| {
        ui.set_max_width(width);
        if let Some(busy) = busy {
            frame(ui, false, width, |ui| {
                ui.add(egui::Label::new(busy).wrap());
            });
        }
        if let Some(error) = &seen.error
            && closable(ui, error, width)
        {
            actions.push(Action::Dismiss);
        }
        let mut closed = None;
        for (index, notice) in state.notices.all.iter().enumerate() {
            if notice.failed {
                closed = closable(ui, &notice.text, width).then_some(index).or(closed);
            } else {
                frame(ui, false, width, |ui| {
                    ui.add(egui::Label::new(&notice.text).wrap());
                });
            }
        }
        if let Some(index) = closed {
            state.notices.all.remove(index);
        }
    });
}

fn frame(ui: &mut Ui, failed: bool, width: f32, content: impl FnOnce(&mut Ui)) {
    let mut frame = egui::Frame::popup(ui.style());
    if failed {
        frame = frame.stroke(Stroke::new(2.0, style::failure(ui.visuals()))).fill(if ui.visuals().dark_mode {
            Color32::from_rgb(60, 20, 20)
        } else {
            Color32::from_rgb(255, 232, 230)
        });
    }
    frame.show(ui, |ui| {
        ui.set_width(width - 24.0);
        content(ui);
    });
}

/// A failure with a button that closes it; returns whether it was pressed.
fn closable(ui: &mut Ui, text: &str, width: f32) -> bool {
    let mut closed = false;
    frame(ui, true, width, |ui| {
        ui.horizontal_top(|ui| {
            closed = ui.button("×").on_hover_text("Close (Escape)").clicked();
            ui.add(egui::Label::new(text).wrap());
        });
    });
    closed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failures_stay_and_the_rest_is_replaced() {
        let mut notices = Notices::default();
        notices.say("one".to_owned());
        notices.say("two".to_owned());
        notices.fail("no".to_owned());
        notices.say("three".to_owned());
        let texts: Vec<&str> = notices.all.iter().map(|notice| notice.text.as_str()).collect();
        assert_eq!(texts, ["no", "three"]);
        (0..9).for_each(|i| notices.fail(i.to_string()));
        assert_eq!(notices.all.len(), MOST);
    }
}
