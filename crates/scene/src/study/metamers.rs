//! Study scene of metamers (lecture C1–C3): a colour chart in three booths of different illuminants.
//!
//! Read Wyszecki and Stiles, Color Science, 1982. Two reflectances may have one colour under one light and two under
//! another, because light and reflectance are multiplied at each wavelength. The left half of each patch has the
//! measured reflectance, the right half a reflectance upsampled from its colour in daylight.

use glam::DVec3;

use super::build::{StudyBuilder, at, dielectric};
use super::shape::Shape;
use crate::{Light, LightKind, Material, Scene};
use etalon_optics::spectra::{Emission, chart, illuminant};

/// Patches across, and their spacing in metres.
const COLUMNS: usize = 6;
const PITCH: f64 = 0.1;
/// Illuminants of the booths: daylight, incandescent light, and a fluorescent lamp of three narrow bands.
const LIGHTS: [&str; 3] = ["d65", "a", "f11"];

pub(super) fn scene() -> Scene {
    let mut b = StudyBuilder::new("metamers");
    // Without a specular lobe: the picture shows the reflectance alone.
    let matt = |name: &str, color: [f32; 3]| Material { specular: 0.0, ..dielectric(name, color, 1.0) };
    let grey = b.material(matt("booth", [0.18; 3]));
    let back = b.mesh("booth back", Shape::panel(0.72, 0.72), grey);
    let side = b.mesh("booth side", Shape::panel(0.3, 0.72), grey);
    let halves: Vec<[usize; 2]> = chart()
        .into_iter()
        .map(|(name, reflectance)| {
            let color = reflectance.reflectance_rgb().map(|x| x.clamp(0.0, 1.0) as f32);
            let measured =
                b.material(Material { reflectance: Some(reflectance), ..matt(&format!("{name}, measured"), color) });
            let matched = b.material(matt(&format!("{name}, matched"), color));
            [("measured", measured), ("matched", matched)]
                .map(|(how, material)| b.mesh(&format!("{name}, {how}"), Shape::panel(0.04, 0.08), material))
        })
        .collect();
    for (booth, name) in LIGHTS.into_iter().enumerate() {
        let x = (booth as f64 - 1.0) * 0.72;
        b.place(&format!("{name} back"), back, at(x, 0.0, -0.01, 0.0));
        for hand in [-1.0, 1.0] {
            // A wall on each side separates the illuminants.
            b.place(&format!("{name} side {hand}"), side, at(x + hand * 0.355, 0.0, 0.14, -90.0 * hand));
        }
        for (i, patch) in halves.iter().enumerate() {
            let (column, row) = (i % COLUMNS, i / COLUMNS);
            let y = (1.5 - row as f64) * PITCH;
            for (j, mesh) in patch.iter().enumerate() {
                let x = x + (column as f64 - 2.5) * PITCH + (j as f64 - 0.5) * 0.04;
                b.place(&format!("{name} patch {i}.{j}"), *mesh, at(x, y, 0.0, 0.0));
            }
        }
        let emission = illuminant(name).map(|spectrum| Emission::of_luminance(spectrum, 3.0));
        let position = DVec3::new(x, 0.0, 0.9);
        b.shine(Light {
            name: name.to_owned(),
            color: emission.as_ref().map_or([1.0; 3], Emission::rgb),
            spectrum: emission,
            kind: LightKind::Spot { position, direction: DVec3::NEG_Z, range: None, inner: 0.44, outer: 0.47 },
            proxy: false,
            extent: None,
        });
    }
    b.camera("front", DVec3::new(0.0, 0.0, 8.0), DVec3::ZERO, 8.8);
    b.finish()
}
