//! Study scene of the lobes of extensions: rows of balls and leaves whose parameter grows to the right.
//!
//! From the top: brushed metal by strength of anisotropy, turned on a lathe; a film on black plastic and a film on a
//! metal, by thickness; cloth by roughness of its sheen; leaves by the part of the light that shines through them.

use glam::DVec3;

use super::build::{StudyBuilder, at, dielectric, metal};
use super::shape::Shape;
use crate::lobe::{ANISOTROPY, DIFFUSE_TRANSMISSION, IRIDESCENCE, SHEEN};
use crate::{LightKind, Material, Scene};

/// Samples per row.
const COLUMNS: u32 = 7;

pub(super) fn scene() -> Scene {
    let mut b = StudyBuilder::new("finishes");
    let wall = b.material(dielectric("wall", [0.2, 0.2, 0.21], 0.9));
    b.add("wall", Shape::panel(9.0, 6.0), wall, at(0.0, 0.0, -1.2, 0.0));
    for column in 0..COLUMNS {
        let step = column as f32 / (COLUMNS - 1) as f32;
        let thickness = 100.0 + 500.0 * step;
        let of = |name: &str, lobe: usize, factors: [f32; 4], below: Material| {
            let mut material = Material { name: format!("{name} {column}"), ..below };
            material.lobes[lobe].factors = factors;
            material
        };
        let film = [1.0, 1.4, 100.0, thickness];
        let rows = [
            of("brushed", ANISOTROPY, [step, 0.0, 0.0, 0.0], metal("", [0.91, 0.78, 0.62], 0.3)),
            of("film on plastic", IRIDESCENCE, film, dielectric("", [0.01; 3], 0.15)),
            of("film on metal", IRIDESCENCE, [1.0, 2.2, 100.0, thickness], metal("", [0.54, 0.5, 0.45], 0.25)),
            of("cloth", SHEEN, [0.7, 0.7, 0.9, 0.2 + 0.8 * step], dielectric("", [0.05, 0.03, 0.12], 0.9)),
        ];
        let x = (f64::from(column) - 3.0) * 0.62;
        for (row, material) in rows.into_iter().enumerate() {
            let (name, y) = (material.name.clone(), (2.0 - row as f64) * 0.62);
            let material = b.material(material);
            let mesh = b.mesh(&name, Shape::sphere(0.26, 40), material);
            if row == 0 {
                b.turned_on_a_lathe(mesh);
            }
            b.place(&name, mesh, at(x, y, 0.0, 0.0));
        }
        let below = Material { double_sided: true, ..dielectric("", [0.14, 0.3, 0.05], 0.6) };
        let leaf = of("leaf", DIFFUSE_TRANSMISSION, [step, 0.5, 0.75, 0.1], below);
        let (name, leaf) = (leaf.name.clone(), b.material(leaf));
        b.add(&name, Shape::panel(0.5, 0.5), leaf, at(x, -1.24, 0.0, 0.0));
    }
    let direction = DVec3::new(-0.35, -0.6, -1.0).normalize();
    b.light("sun", [1.8; 3], LightKind::Directional { direction });
    b.light(
        "lamp behind the leaves",
        [0.9; 3],
        LightKind::Point { position: DVec3::new(0.0, -1.6, -1.0), range: None },
    );
    b.camera("front", DVec3::new(0.0, 0.0, 7.4), DVec3::ZERO, 24.5);
    b.studio(0.6);
    b.finish()
}
