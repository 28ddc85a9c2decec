//! Study scene of homogeneous and heterogeneous absorption (lecture A1, A2): transmittance e^(−σ d) before a white
//! emitter.
//!
//! Read pbrt 11.2. All media have n = 1 and do not refract. The scene has a row of blocks, each twice as thick as the
//! one before, a wedge, a block whose σ falls along its length, and one whose σ falls along the line of sight. In the
//! last block quadratures with few steps have errors, and the errors vary smoothly with the order of the rule.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::build::{StudyBuilder, at, emitter, glass};
use super::shape::Shape;
use crate::{Material, Scene, SigmaGrid};

/// Attenuation distance in metres.
const DISTANCE: f32 = 0.1;
const COLOR: [f32; 3] = [0.2, 0.55, 0.85];

pub(super) fn scene() -> Scene {
    let mut b = StudyBuilder::new("absorber");
    let white = b.material(emitter("light", [1.0; 3]));
    b.add("light", Shape::panel(2.0, 1.2), white, at(0.0, 0.0, -0.6, 0.0));
    let tea = |name: &str, thickness: f64| Material {
        attenuation_color: COLOR,
        attenuation_distance: DISTANCE,
        ..glass(name, 1.0, thickness as f32)
    };
    for (i, thickness) in [0.02, 0.04, 0.08, 0.16, 0.32].into_iter().enumerate() {
        let material = b.material(tea(&format!("{} mm", 1000.0 * thickness), thickness));
        let block = Shape::cuboid(DVec3::new(0.14, 0.16, thickness));
        b.add(&format!("block {i}"), block, material, at((i as f64 - 2.0) * 0.2, 0.0, 0.0, 0.0));
    }
    let wedge = b.material(tea("wedge", 0.3));
    let outline = [DVec2::new(-0.47, 0.0), DVec2::new(0.47, -0.15), DVec2::new(0.47, 0.15)];
    // Extruded upwards.
    let lying = at(0.0, 0.24, 0.0, 0.0) * glam::DAffine3::from_rotation_x(-std::f64::consts::FRAC_PI_2);
    b.add("wedge", Shape::prism(&outline, 0.16), wedge, lying);
    // σ of 30 e^(−8 x) per metre along its length, as grid points.
    let falling = |size: [u64; 3], values: Vec<f32>, name: &str, thickness: f32| {
        let grid = SigmaGrid::new(size, values, None).expect("a point a value");
        Material { sigma: Some(Arc::new(grid)), ..glass(name, 1.0, thickness) }
    };
    let along = (0..65).map(|i| (30.0 * (-8.0 * 0.56 * f64::from(i) / 64.0).exp()) as f32);
    let graded = b.material(falling([65, 1, 1], along.collect(), "graded", 0.1));
    b.add("graded block", Shape::cuboid(DVec3::new(0.56, 0.16, 0.1)), graded, at(-0.19, -0.24, 0.0, 0.0));
    // 27 e^(−18 z) from its front: more points than steps of any rule, so that the error is that of the rule.
    let into = (0..513).map(|i| (27.0 * (-18.0 * 0.4 * (1.0 - f64::from(i) / 512.0)).exp()) as f32);
    let deep = b.material(falling([1, 1, 513], into.collect(), "deep", 0.4));
    b.add("deep block", Shape::cuboid(DVec3::new(0.32, 0.16, 0.4)), deep, at(0.31, -0.24, 0.0, 0.0));
    b.camera("front", DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, 16.0);
    b.finish()
}
