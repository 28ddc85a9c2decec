//! Lecture F8: the Fresnel curve over wavelength tells gold from copper. Four polished balls of real metals.

use glam::DVec3;

use super::build::{Builder, at, dielectric, emitter, facing, metal};
use super::shape::Shape;
use crate::scene::{LightKind, Material, Scene};

/// Complex index (n, κ) of a metal at 645.16, 526.32 and 444.44 nm: the three lamps of lecture C1, red first.
pub(super) type ComplexIndex = [(f64, f64); 3];

/// Johnson & Christy, "Optical constants of the noble metals", Phys. Rev. B 6, 4370 (1972), as tabulated by
/// refractiveindex.info (CC0 1.0), linear between its wavelengths. The other two noble metals are from there too.
pub(super) const GOLD: ComplexIndex = [(0.1635, 3.5543), (0.5828, 2.1542), (1.4022, 1.9248)];
const SILVER: ComplexIndex = [(0.0534, 4.3718), (0.0520, 3.3753), (0.0400, 2.5953)];
const COPPER: ComplexIndex = [(0.2469, 3.5650), (1.1487, 2.6019), (1.2432, 2.3679)];
/// Rakić, "Algorithm for the determination of intrinsic optical constants of metal films: application to aluminum",
/// Appl. Opt. 34, 4755 (1995), by the same route.
const ALUMINIUM: ComplexIndex = [(1.5271, 7.6630), (0.9147, 6.3540), (0.6137, 5.3874)];

/// Reflectance at normal incidence, lecture F2: ((n − 1)² + κ²) / ((n + 1)² + κ²).
pub(super) fn f0(index: ComplexIndex) -> [f32; 3] {
    index.map(|(n, k)| (((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k)) as f32)
}

pub(super) fn scene() -> Scene {
    let mut b = Builder::new("metals");
    let checker = b.checker("floor checker", [0.10, 0.10, 0.11], [0.45, 0.45, 0.44]);
    let floor = b.material(Material { base_color_texture: Some(checker), ..dielectric("floor", [1.0; 3], 0.8) });
    b.add("floor", Shape::plane(8.0, 4.0, 1).repeat_uv(8.0, 4.0), floor, at(0.0, 0.0, 0.5, 0.0));
    let paper = b.material(dielectric("backdrop", [0.5; 3], 0.9));
    b.add("backdrop", Shape::backdrop(8.0, -1.5, 0.6, 3.0), paper, at(0.0, 0.0, 0.0, 0.0));

    for (i, (name, index)) in
        [("gold", GOLD), ("silver", SILVER), ("copper", COPPER), ("aluminium", ALUMINIUM)].into_iter().enumerate()
    {
        let polished = b.material(metal(name, f0(index), 0.02));
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
