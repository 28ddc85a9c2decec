//! Study scene of the material model (lecture B4–B8): rows of balls with roughness increasing to the right.
//!
//! Dielectrics have a coloured diffuse base and a white specular lobe, metals a coloured specular lobe, and a clear
//! coat reflects white over either.

use glam::DVec3;

use super::build::{StudyBuilder, at, conductor, dielectric, emitter};
use super::shape::Shape;
use crate::substance::GOLD;
use crate::{LightKind, Material, Scene};

/// Balls per row.
const COLUMNS: u32 = 7;

pub(super) fn scene() -> Scene {
    let mut b = StudyBuilder::new("materials");
    let checker = b.checker("wall checker", [0.22, 0.22, 0.23], [0.32, 0.32, 0.31]);
    let wall = b.material(Material { base_color_texture: Some(checker), ..dielectric("wall", [1.0; 3], 1.0) });
    b.add("wall", Shape::panel(9.0, 5.5).repeat_uv(4.5, 2.75), wall, at(0.0, 0.0, -0.6, 0.0));

    for column in 0..COLUMNS {
        let step = column as f32 / (COLUMNS - 1) as f32;
        // A quarter of white at the left, eight times white at the right.
        let glow = 0.25 * 2.0_f32.powf(5.0 * step);
        let rows = [
            dielectric(&format!("dielectric {column}"), [0.72, 0.10, 0.08], step),
            conductor(&format!("metal {column}"), GOLD, step),
            Material {
                clearcoat: 1.0,
                clearcoat_roughness: step,
                ..dielectric(&format!("clearcoat {column}"), [0.04, 0.16, 0.52], 0.7)
            },
            emitter(&format!("emissive {column}"), [glow, 0.7 * glow, 0.4 * glow]),
        ];
        for (row, material) in rows.into_iter().enumerate() {
            let name = material.name.clone();
            let material = b.material(material);
            let (x, y) = ((f64::from(column) - 3.0) * 0.62, (1.5 - row as f64) * 0.62);
            b.add(&name, Shape::sphere(0.26, 40), material, at(x, y, 0.0, 0.0));
        }
    }
    let direction = DVec3::new(-0.35, -0.6, -1.0).normalize();
    b.light("sun", [2.2; 3], LightKind::Directional { direction });
    let position = DVec3::new(-2.4, 2.2, 2.6);
    b.light("lamp", [9.0, 8.6, 8.0], LightKind::Point { position, range: None });
    b.camera("front", DVec3::new(0.0, 0.0, 6.4), DVec3::ZERO, 24.5);
    b.studio(0.6);
    b.finish()
}
