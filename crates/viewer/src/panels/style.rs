//! Colours of text, with a contrast of at least 4.5 : 1 (WCAG 2.2, success criterion 1.4.3).

use egui::{Color32, Context, SliderClamping, Theme, Visuals};

/// Of a slider: a value of the command line beyond its range or with more decimals stays until it is edited.
pub(super) const UNTOUCHED: SliderClamping = SliderClamping::Edits;

/// Colour of secondary text.
fn weak(dark: bool) -> Color32 {
    if dark { Color32::from_gray(172) } else { Color32::from_gray(90) }
}

/// Colour of ordinary text.
fn ordinary(dark: bool) -> Color32 {
    if dark { Color32::from_gray(205) } else { Color32::from_gray(40) }
}

/// Colour of warnings.
pub(super) fn warning(visuals: &Visuals) -> Color32 {
    if visuals.dark_mode { Color32::from_rgb(255, 170, 60) } else { Color32::from_rgb(150, 75, 0) }
}

/// Colour of failures.
pub(super) fn failure(visuals: &Visuals) -> Color32 {
    if visuals.dark_mode { Color32::from_rgb(255, 130, 120) } else { Color32::from_rgb(170, 20, 20) }
}

/// Colour of what the user changed.
pub(super) fn changed(visuals: &Visuals) -> Color32 {
    if visuals.dark_mode { Color32::from_rgb(110, 185, 255) } else { Color32::from_rgb(0, 85, 160) }
}

/// Sets the colours of both themes, once.
pub(super) fn apply(context: &Context) {
    let done = egui::Id::new("colours are set");
    if context.data(|data| data.get_temp::<bool>(done)).is_some() {
        return;
    }
    context.data_mut(|data| data.insert_temp(done, true));
    for theme in [Theme::Dark, Theme::Light] {
        context.style_mut_of(theme, |style| {
            set(&mut style.visuals);
            // Bars beside what they scroll, not over it.
            style.spacing.scroll = egui::style::ScrollStyle::solid();
        });
    }
}

fn set(visuals: &mut Visuals) {
    let dark = visuals.dark_mode;
    visuals.weak_text_color = Some(weak(dark));
    visuals.widgets.noninteractive.fg_stroke.color = ordinary(dark);
    visuals.widgets.inactive.fg_stroke.color = ordinary(dark);
    visuals.warn_fg_color = warning(visuals);
    visuals.error_fg_color = failure(visuals);
    visuals.hyperlink_color = changed(visuals);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance (WCAG 2.2).
    fn luminance(colour: Color32) -> f64 {
        let [r, g, b] = [colour.r(), colour.g(), colour.b()].map(|byte| {
            let c = f64::from(byte) / 255.0;
            if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
        });
        0.2126 * r + 0.7152 * g + 0.0722 * b
    }

    fn contrast(a: Color32, b: Color32) -> f64 {
        let [a, b] = [a, b].map(luminance);
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    #[test]
    fn text_can_be_read() {
        for mut visuals in [Visuals::dark(), Visuals::light()] {
            set(&mut visuals);
            let grounds = [
                visuals.panel_fill,
                visuals.window_fill,
                visuals.faint_bg_color.blend(visuals.panel_fill),
                visuals.extreme_bg_color,
                visuals.widgets.inactive.weak_bg_fill,
            ];
            let texts = [
                visuals.weak_text_color(),
                visuals.text_color(),
                visuals.strong_text_color(),
                visuals.widgets.inactive.fg_stroke.color,
                visuals.warn_fg_color,
                visuals.error_fg_color,
                changed(&visuals),
            ];
            for (i, text) in texts.into_iter().enumerate() {
                for ground in grounds {
                    let found = contrast(text, ground);
                    // A strong text of a light theme is black; on the ground of a button all of them are read, too.
                    assert!(
                        found >= 4.5,
                        "text {i} {text:?} on {ground:?}: {found:.2} : 1, dark: {}",
                        visuals.dark_mode
                    );
                }
            }
        }
    }
}
