//! Study scene of conductors (lecture F8): four polished balls of real metals, whose colour is their Fresnel curve over
//! wavelength.

use glam::DVec3;

use super::build::{StudyBuilder, at, conductor, dielectric, emitter, facing};
use super::shape::Shape;
use crate::substance::{ALUMINIUM, COPPER, GOLD, SILVER};
use crate::{LightKind, Material, Scene};

pub(super) fn scene() -> Scene {
    let mut b = StudyBuilder::new("metals");
    let checker = b.checker("floor checker", [0.10, 0.10, 0.11], [0.45, 0.45, 0.44]);
    let floor = b.material(Material { base_color_texture: Some(checker), ..dielectric("floor", [1.0; 3], 0.8) });
    b.add("floor", Shape::plane(8.0, 4.0, 1).repeat_uv(8.0, 4.0), floor, at(0.0, 0.0, 0.5, 0.0));
    let paper = b.material(dielectric("backdrop", [0.5; 3], 0.9));
    b.add("backdrop", Shape::backdrop(8.0, -1.5, 0.6, 3.0), paper, at(0.0, 0.0, 0.0, 0.0));

    for (i, (name, index)) in
        [("gold", GOLD), ("silver", SILVER), ("copper", COPPER), ("aluminium", ALUMINIUM)].into_iter().enumerate()
    {
        let polished = b.material(conductor(name, index, 0.02));
        let x = (i as f64 - 1.5) * 0.46;
        b.add(&format!("{name} ball"), Shape::sphere(0.2, 64), polished, at(x, 0.2001, 0.0, 0.0));
    }

    let white = b.material(emitter("soft box", [4.0; 3]));
    let middle = DVec3::new(0.0, 0.2, 0.0);
    for (i, position) in [DVec3::new(-2.2, 2.0, 1.4), DVec3::new(2.2, 1.4, 1.4)].into_iter().enumerate() {
        b.add(&format!("soft box {i}"), Shape::panel(1.0, 0.8), white, facing(position, middle - position));
        let front = position + (middle - position).normalize() * 0.05;
        b.light(&format!("soft box {i}"), [9.0; 3], LightKind::Point { position: front, range: None });
    }
    b.camera("front", DVec3::new(0.0, 0.5, 2.6), DVec3::new(0.0, 0.2, 0.0), 25.0);
    b.studio(0.6);
    b.finish()
}
