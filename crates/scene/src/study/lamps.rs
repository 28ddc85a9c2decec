//! Study scene of punctual lights (lecture R3, R4): point lights of several ranges, a spot light and a directional
//! light over a plane.

use glam::{DAffine3, DVec3};

use super::build::{StudyBuilder, at, dielectric};
use super::shape::Shape;
use crate::{LightKind, Material, Scene};

pub(super) fn scene() -> Scene {
    let mut b = StudyBuilder::new("lamps");
    let checker = b.checker("floor checker", [0.36; 3], [0.48; 3]);
    let floor = b.material(Material { base_color_texture: Some(checker), ..dielectric("floor", [1.0; 3], 0.9) });
    b.add("floor", Shape::plane(16.0, 12.0, 1).repeat_uv(4.0, 3.0), floor, DAffine3::IDENTITY);

    let clay = b.material(dielectric("clay", [0.62, 0.58, 0.54], 0.8));
    let gloss = b.material(dielectric("gloss", [0.16, 0.34, 0.20], 0.2));
    b.add("box", Shape::cuboid(DVec3::new(0.7, 1.1, 0.7)), clay, at(-3.1, 0.5501, -0.9, 25.0));
    b.add("ball", Shape::sphere(0.5, 48), gloss, at(-1.1, 0.5001, -0.5, 0.0));
    b.add("column", Shape::cylinder(0.35, 1.6, 48), clay, at(1.0, 0.0001, -1.1, 0.0));
    b.add("ring", Shape::torus(0.5, 0.18, 64), gloss, at(2.9, 0.1801, -0.2, 0.0));

    // Equal intensity at equal height, with increasing range; the last light has no range.
    for (i, (range, color)) in [
        (Some(1.0), [2.2, 0.8, 0.6]),
        (Some(2.0), [0.7, 2.0, 0.8]),
        (Some(4.0), [0.7, 0.9, 2.4]),
        (None, [1.5, 1.4, 1.2]),
    ]
    .into_iter()
    .enumerate()
    {
        let position = DVec3::new(-3.0 + 2.0 * i as f64, 0.7, 0.9);
        b.light(&format!("point {i}"), color, LightKind::Point { position, range });
    }
    let position = DVec3::new(0.0, 4.0, -0.5);
    let kind = LightKind::Spot {
        position,
        direction: (DVec3::new(0.3, 0.0, -2.6) - position).normalize(),
        range: None,
        inner: 14.0_f64.to_radians(),
        outer: 20.0_f64.to_radians(),
    };
    b.light("spot", [60.0, 52.0, 38.0], kind);
    let direction = DVec3::new(0.6, -1.0, -0.5).normalize();
    b.light("moon", [0.25, 0.30, 0.42], LightKind::Directional { direction });
    b.camera("front", DVec3::new(0.0, 3.6, 8.2), DVec3::new(0.0, 0.35, -0.4), 30.0);
    b.finish()
}
