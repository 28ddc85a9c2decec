//! Study scene of grazing specular lobes (lecture B7): the lamps of a bridge over rippled water at night.
//!
//! Read RTR 9.8. Each reflection is a streak towards the eye, long vertically and narrow across, because near grazing
//! angles the half vector hardly changes along the streak. The Blinn-Phong lobe of the lecture (`brdf=blinn-phong`) is
//! not reciprocal and has no such streak; with a denominator it has one, as do microfacets.

use glam::DVec3;

use super::build::{StudyBuilder, at, dielectric, emitter};
use super::shape::Shape;
use crate::{LightKind, Material, Scene};

pub(super) fn scene() -> Scene {
    let mut b = StudyBuilder::new("golden-bridge");
    let water = b.material(Material { ior: 1.333, ..dielectric("water", [0.004, 0.007, 0.010], 0.3) });
    b.add("water", Shape::plane(400.0, 260.0, 1), water, at(0.0, 0.0, -80.0, 0.0));
    let dusk = b.material(emitter("dusk", [0.008, 0.013, 0.028]));
    b.add("sky", Shape::panel(600.0, 200.0), dusk, at(0.0, 99.0, -205.0, 0.0));
    let iron = b.material(dielectric("iron", [0.35, 0.10, 0.06], 0.7));
    b.add("deck", Shape::cuboid(DVec3::new(160.0, 0.8, 4.0)), iron, at(0.0, 5.0, -92.0, 0.0));
    let pier = b.mesh("pier", Shape::cuboid(DVec3::new(2.0, 26.0, 3.0)), iron);
    let glow = b.material(emitter("lamp", [90.0, 55.0, 22.0]));
    let lamp = b.mesh("lamp", Shape::sphere(0.3, 12), glow);
    let post = b.mesh("post", Shape::cuboid(DVec3::new(0.15, 3.4, 0.15)), iron);
    for i in 0..2 {
        b.place(&format!("pier {i}"), pier, at(if i == 0 { -26.0 } else { 26.0 }, 8.0, -92.0, 0.0));
    }
    for i in 0..11 {
        let x = (f64::from(i) - 5.0) * 8.0;
        b.place(&format!("post {i}"), post, at(x, 7.1, -89.8, 0.0));
        b.place(&format!("lamp {i}"), lamp, at(x, 9.1, -89.8, 0.0));
        // Intensity of the proxy light, in front of the ball: radiance times the ball's disk of π 0.09 m².
        let color = [90.0, 55.0, 22.0].map(|radiance| radiance * std::f32::consts::PI * 0.09);
        b.proxy(&format!("lamp {i}"), color, LightKind::Point { position: DVec3::new(x, 9.1, -89.4), range: None });
    }
    b.camera("shore", DVec3::new(0.0, 4.0, 12.0), DVec3::new(0.0, 2.0, -90.0), 30.0);
    b.finish()
}
