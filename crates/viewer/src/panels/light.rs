//! What lights the scene: the environment, its background, and a key light.

use egui::{Slider, Ui};

use super::style::UNTOUCHED;
use super::{Asked, PanelState};
use crate::shared::RenderState;
use etalon::frame::Background;
use etalon::scene::KeyLight;

/// The key light that is put in at first: from the left and above, half as bright again as the studio.
const KEY: KeyLight = KeyLight { azimuth: -45.0, elevation: 45.0, lux: 3.0 };

/// Shows the panel.
pub(super) fn show(ui: &mut Ui, state: &mut PanelState, seen: &RenderState) {
    if let Some(lit_by) = &seen.sides[state.side].lit_by {
        ui.label(lit_by);
    }
    ui.separator();
    environment(ui, state);
    ui.separator();
    background(ui, state, seen);
    ui.separator();
    key_light(ui, state);
}

fn environment(ui: &mut Ui, state: &mut PanelState) {
    ui.strong("Environment");
    let name = |choice: &Option<String>| match choice.as_deref() {
        None => "default".to_owned(),
        Some("studio") => "built-in studio".to_owned(),
        Some("none") => "none".to_owned(),
        Some(file) => std::path::Path::new(file).file_name().map_or(file.into(), |name| name.to_string_lossy().into()),
    };
    let mut asks = false;
    egui::ComboBox::from_id_salt("environment")
        .width(ui.available_width() - 8.0)
        .truncate()
        .selected_text(name(&state.choice.environment))
        .show_ui(ui, |ui| {
            for choice in [None, Some("studio".to_owned()), Some("none".to_owned())] {
                let text = name(&choice);
                ui.selectable_value(&mut state.choice.environment, choice, text);
            }
            asks = ui.button("File …").clicked();
        })
        .response
        .on_hover_text("Default: the built-in studio, as fill light if the file contains lights");
    if asks {
        state.ask(Asked::Environment, "", None);
    }
    let dark = state.choice.environment.as_deref() == Some("none");
    let settings = &mut state.settings;
    ui.add_enabled_ui(!dark, |ui| {
        let intensity = Slider::new(&mut settings.environment_intensity, 0.0..=16.0).clamping(UNTOUCHED);
        let intensity = intensity.logarithmic(true).smallest_positive(0.01).text("intensity");
        state.moved |= ui.add(intensity).on_hover_text("Factor of the radiance of the environment").changed();
        let turned = Slider::new(&mut settings.environment_rotation, -180.0..=180.0).clamping(UNTOUCHED);
        state.moved |= ui.add(turned.suffix("°").text("rotation")).on_hover_text("Rotation about +Y").changed();
    });
}

fn background(ui: &mut Ui, state: &mut PanelState, seen: &RenderState) {
    ui.strong("Background");
    let now = state.settings.background;
    ui.horizontal_wrapped(|ui| {
        let mut option = |wanted: Background, name: &str, about: &str| {
            let selected = std::mem::discriminant(&now) == std::mem::discriminant(&wanted);
            if ui.selectable_label(selected, name).on_hover_text(about).clicked() && !selected {
                state.settings.background = wanted;
            }
        };
        option(Background::Default, "default", "The environment; grey where there is none");
        option(Background::Environment, "environment", "The environment, which then lights the scene in any case");
        option(Background::Transparent, "transparent", "Transparent in saved pictures, squares of grey here");
        option(Background::Color([128; 3]), "colour", "One colour");
    });
    if let Background::Color(mut colour) = now
        && ui.color_edit_button_srgb(&mut colour).changed()
    {
        state.settings.background = Background::Color(colour);
    }
    let lit = seen.facts.as_ref().is_some_and(|facts| facts.light.lit(state.settings.clone()).0.is_some());
    ui.add_enabled_ui(lit && state.settings.shows_environment(), |ui| {
        let blur = Slider::new(&mut state.settings.background_blur, 0.0..=1.0).text("blur").max_decimals(2);
        let blur = ui.add(blur.clamping(UNTOUCHED));
        state.moved |=
            blur.on_hover_text("Blur of the environment behind the scene; light and reflections stay").changed();
    });
}

fn key_light(ui: &mut Ui, state: &mut PanelState) {
    let mut on = state.choice.key_light.is_some();
    let checkbox = ui.checkbox(&mut on, "Key light");
    if checkbox.on_hover_text("A directional light beside those of the file").changed() {
        state.choice.key_light = on.then_some(KEY);
    }
    let Some(light) = &mut state.choice.key_light else { return };
    let azimuth = Slider::new(&mut light.azimuth, -180.0..=180.0).suffix("°").text("azimuth").max_decimals(0);
    ui.add(azimuth.clamping(UNTOUCHED)).on_hover_text("Where it comes from: 0° is the front (+Z), 90° is +X");
    let elevation = Slider::new(&mut light.elevation, -90.0..=90.0).suffix("°").text("elevation").max_decimals(0);
    ui.add(elevation.clamping(UNTOUCHED));
    let lux = Slider::new(&mut light.lux, 0.0..=1000.0).logarithmic(true).smallest_positive(0.1).suffix(" lx");
    ui.add(lux.text("strength").clamping(UNTOUCHED));
}
