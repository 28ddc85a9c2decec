//! Finds the equations of `shaders/lib/` that contribute to a pixel, from the events along its ray and the knobs of the
//! picture. docs/equations.md lists all equations.

use etalon::plan::Knobs;
use etalon::plan::rungs::{Absorption, Brdf, Fresnel, Lights};
use etalon::scene::{AlphaMode, Extent, Light, LightKind};
use etalon::shader::{PROBES, Probe};
use etalon::spectra::Dispersion;
use etalon::transport::events::{Event, Way};

/// Names of the equations in the order of the events: from the eye along the ray, and the display encoding last.
fn names(events: &[Event], lights: &[Light], knobs: &Knobs) -> Vec<&'static str> {
    let mut all = Vec::new();
    for event in events {
        match event.way {
            Way::Mirrored => all.push("reflect"),
            Way::Bent => all.push("refract"),
            Way::Seen | Way::Straight => {}
            Way::ToLight(index) => {
                if let Some(light) = lights.get(index) {
                    all.extend(of_light(light, knobs));
                }
                continue;
            }
        }
        let Some(interaction) = &event.interaction else { continue };
        // At that point: a texture may say that it is no metal, though the factor does.
        let m = &interaction.at;
        if m.unlit {
            continue;
        }
        if interaction.total {
            all.push("refract");
        }
        let exact = knobs.fresnel == Fresnel::Exact;
        if m.metallic < 1.0 {
            all.push(if exact { "fresnel_dielectric" } else { "schlick" });
        }
        if m.metallic > 0.0 {
            all.push(if exact && m.conductor.is_some() { "fresnel_conductor" } else { "schlick" });
        }
        if interaction.spreads {
            all.extend(match knobs.brdf {
                Brdf::BlinnPhong => &["half_angle", "diffuse_brdf", "phong_lobe"][..],
                Brdf::BlinnPhongReciprocal => &["half_angle", "diffuse_brdf", "phong_lobe", "reciprocal_lobe"],
                Brdf::GgxMulti => {
                    &["half_angle", "diffuse_brdf", "ggx_distribution", "ggx_visibility", "schlick", "ggx_compensation"]
                }
                Brdf::Ggx => &["half_angle", "diffuse_brdf", "ggx_distribution", "ggx_visibility"],
            });
        }
        let lets_through = m.transmission > 0.0 && m.alpha_mode == AlphaMode::Opaque;
        if lets_through && m.attenuation_distance.is_finite() && knobs.absorption != Absorption::Off {
            all.push("beer_lambert");
        }
        if lets_through && m.sigma.is_some() && knobs.absorption.steps() > 0 {
            all.push("quadrature_weights");
        }
        if lets_through && knobs.colour.bands() > 0 {
            all.extend(match m.dispersion {
                Dispersion::Sellmeier { .. } => Some("sellmeier"),
                Dispersion::Cauchy { .. } => Some("cauchy"),
                Dispersion::None | Dispersion::Abbe(_) => None,
            });
        }
    }
    if knobs.colour.bands() > 0 {
        all.extend(["cmf_integral", "xyz_to_srgb"]);
    }
    all.push("srgb_encode");
    all
}

fn of_light(light: &Light, knobs: &Knobs) -> Vec<&'static str> {
    let has_shape = knobs.lights != Lights::Points;
    let mut all = match light.kind {
        LightKind::Directional { .. } => vec!["arriving_light"],
        LightKind::Point { range, .. } => {
            let falloff = range.map(|_| "point_falloff");
            ["arriving_light"].into_iter().chain(falloff).collect()
        }
        LightKind::Spot { .. } => vec!["arriving_light", "point_falloff", "spot_share"],
    };
    if has_shape && matches!(light.extent, Some(Extent::Sphere { .. })) {
        all.push("sphere_cone");
    }
    all
}

/// The equations that contribute to a pixel, each once.
#[must_use]
pub fn used(events: &[Event], lights: &[Light], knobs: &Knobs) -> Vec<&'static Probe> {
    let mut found: Vec<&'static Probe> = Vec::new();
    for name in names(events, lights, knobs) {
        let probe = PROBES.iter().find(|probe| probe.name == name);
        found.extend(probe.filter(|probe| found.iter().all(|known| known.name != probe.name)));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    use etalon::plan::{KNOBS, Model};
    use etalon::scene::Material;
    use etalon::transport::events::Interaction;
    use glam::DVec3;

    /// One event of each kind on each of the materials.
    fn events(materials: &[Material]) -> Vec<Event> {
        let ways =
            [Way::Seen, Way::Mirrored, Way::Bent, Way::Straight, Way::ToLight(0), Way::ToLight(1), Way::ToLight(2)];
        let interaction = |at: &Material, total| Interaction {
            instance: 0,
            material: 0,
            at: Arc::new(at.clone()),
            opacity: 1.0,
            normal: DVec3::Y,
            cos: 1.0,
            ratio: 1.5,
            reflected: 0.04,
            parts: [0.04, 0.9],
            total,
            spreads: true,
        };
        let event =
            |way, interaction| Event { after: None, way, from: DVec3::ZERO, to: DVec3::Y, share: 1.0, interaction };
        let of = |way| {
            materials.iter().flat_map(move |m| [true, false].map(|total| event(way, Some(interaction(m, total)))))
        };
        ways.into_iter().flat_map(of).collect()
    }

    #[test]
    fn every_name_is_an_equation() {
        let metal = Material { metallic: 1.0, conductor: Some([[0.2, 3.0]; 3]), ..Material::default() };
        let glass = |dispersion| Material {
            transmission: 1.0,
            metallic: 0.0,
            attenuation_distance: 1.0,
            dispersion,
            ..Material::default()
        };
        let cauchy = Dispersion::Cauchy { a: 1.5, b: 0.004 };
        let sellmeier = Dispersion::Sellmeier { b: [0.5; 4], c: [0.01; 4] };
        let materials = [metal, glass(cauchy), glass(sellmeier)];
        let light =
            |kind, extent| Light { name: String::new(), color: [1.0; 3], spectrum: None, extent, kind, proxy: false };
        let ball = Some(Extent::Sphere { radius: 0.1 });
        let (position, direction, range) = (DVec3::Y, DVec3::NEG_Y, Some(2.0));
        let lights = [
            light(LightKind::Directional { direction }, None),
            light(LightKind::Point { position, range }, ball),
            light(LightKind::Spot { position, direction, range, inner: 0.1, outer: 0.2 }, None),
        ];
        let mut seen = 0;
        for knob in KNOBS {
            for (model, rung) in
                [Model::Local, Model::Global].into_iter().flat_map(|m| knob.rungs.iter().map(move |r| (m, r)))
            {
                let Some(knobs) = Knobs::of(model).with(knob.name, rung) else { continue };
                for name in names(&events(&materials), &lights, &knobs) {
                    let probe = PROBES.iter().find(|probe| probe.name == name).unwrap_or_else(|| panic!("{name}"));
                    assert!(probe.lab.is_none(), "{name} draws nothing");
                    seen += 1;
                }
            }
        }
        assert!(seen > 1000, "{seen}");
    }

    #[test]
    fn rungs_choose_the_curve() {
        let glass = [Material { transmission: 1.0, metallic: 0.0, ..Material::default() }];
        let list =
            |knobs: &Knobs| -> Vec<&str> { used(&events(&glass), &[], knobs).iter().map(|probe| probe.name).collect() };
        // The table of albedos for `ggx-multi` has Schlick's curve on every rung.
        let knobs = Knobs::of(Model::Recursive).with("brdf", "ggx").expect("a rung");
        let exact = list(&knobs);
        assert!(exact.contains(&"fresnel_dielectric") && !exact.contains(&"schlick"), "{exact:?}");
        let schlick = knobs.with("fresnel", "schlick").expect("a rung");
        assert!(list(&schlick).contains(&"schlick"));
        assert!(!exact.contains(&"fresnel_conductor") && !exact.contains(&"sellmeier"));
    }

    #[test]
    fn the_metal_of_the_point_chooses_the_curves() {
        let list = |metallic: f32| -> Vec<&str> {
            let point = Material { metallic, conductor: Some([[0.2, 3.0]; 3]), ..Material::default() };
            let knobs = Knobs::of(Model::Recursive);
            used(&events(&[point]), &[], &knobs).iter().map(|probe| probe.name).collect()
        };
        for (metallic, dielectric, metal) in [(0.0, true, false), (0.4, true, true), (1.0, false, true)] {
            let found = list(metallic);
            let has = |name: &str| found.contains(&name);
            assert_eq!([has("fresnel_dielectric"), has("fresnel_conductor")], [dielectric, metal], "{metallic}");
        }
    }
}
