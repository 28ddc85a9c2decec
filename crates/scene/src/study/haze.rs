//! Study scene of a heterogeneous medium (lecture A2): absorbing smoke that attenuates every ray differently.
//!
//! Read pbrt 11.2. Blue is absorbed more than red, so the shadow is soft and warm.

use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::build::{StudyBuilder, at, dielectric, glass};
use super::shape::Shape;
use crate::{LightKind, Material, Scene, SigmaGrid};

/// Edges in metres of the invisible closed mesh that bounds the smoke.
const BODY: DVec3 = DVec3::new(1.6, 2.0, 1.6);
/// Points of the grid of σ.
const POINTS: [usize; 3] = [32, 40, 32];

pub(super) fn scene() -> Scene {
    let mut b = StudyBuilder::new("haze");
    let checker = b.checker("floor checker", [0.30; 3], [0.62; 3]);
    let floor = b.material(Material { base_color_texture: Some(checker), ..dielectric("floor", [1.0; 3], 0.9) });
    b.add("floor", Shape::plane(9.0, 9.0, 1).repeat_uv(3.0, 3.0), floor, DAffine3::IDENTITY);
    let paint = b.material(dielectric("wall", [0.55, 0.58, 0.62], 0.9));
    b.add("wall", Shape::panel(9.0, 3.6), paint, at(0.0, 1.8, -2.4, 0.0));
    let grid = SigmaGrid::new(POINTS.map(|n| n as u64), plume(), None).expect("as many values as points and channels");
    let smoke = b.material(Material { sigma: Some(Arc::new(grid)), ..glass("smoke", 1.0, 1.6) });
    b.add("smoke", Shape::cuboid(BODY), smoke, at(0.0, 0.5 * BODY.y + 0.001, 0.0, 0.0));
    // One ball inside the smoke, one beside it.
    let clay = b.material(dielectric("clay", [0.80, 0.42, 0.26], 0.6));
    let ball = b.mesh("ball", Shape::sphere(0.22, 48), clay);
    b.place("veiled ball", ball, at(-0.12, 0.62, -0.30, 0.0));
    b.place("clear ball", ball, at(1.25, 0.22, 0.55, 0.0));
    b.light("sun", [3.0; 3], LightKind::Directional { direction: DVec3::new(-0.75, -0.8, -0.35).normalize() });
    b.camera("front", DVec3::new(1.4, 1.5, 4.6), DVec3::new(-0.2, 0.8, 0.0), 38.0);
    b.studio(0.25);
    b.finish()
}

/// σ of a rising, winding and widening plume: the integral over each level is the same. σ is 0 at the sides of the
/// mesh.
fn plume() -> Vec<f32> {
    let mut values = Vec::new();
    for z in 0..POINTS[2] {
        for y in 0..POINTS[1] {
            for x in 0..POINTS[0] {
                let share = |i: usize, n: usize| i as f64 / (n - 1) as f64;
                let (u, height, w) = (share(x, POINTS[0]), share(y, POINTS[1]), share(z, POINTS[2]));
                let turn = 7.0 * height;
                let middle = 0.5 + 0.12 * height * DVec3::new(turn.cos(), 0.0, turn.sin());
                let width = 0.05 + 0.11 * height;
                let r2 = ((u - middle.x).powi(2) + (w - middle.z).powi(2)) / (2.0 * width * width);
                let inside = [u, height, w].map(|s| (8.0 * s.min(1.0 - s)).min(1.0)).iter().product::<f64>();
                let sigma = 8.0 * (0.08 / width).powi(2) * (-r2).exp() * inside;
                values.extend([0.7, 1.0, 1.5].map(|share| (share * sigma) as f32));
            }
        }
    }
    values
}
