//! Study scene of radiance (lecture R1): radiance does not depend on distance and tilt. All visible pixels of all
//! panels and balls have radiance 1, in all three channels.

use glam::DVec3;

use super::build::{StudyBuilder, at, dielectric, emitter};
use super::shape::Shape;
use crate::{Material, Scene};

pub(super) fn scene() -> Scene {
    let mut b = StudyBuilder::new("radiance");
    let emitting = b.material(Material { double_sided: true, ..emitter("emitter of radiance 1", [1.0; 3]) });
    // The same radiance by an unlit material.
    let unlit =
        b.material(Material { unlit: true, double_sided: true, ..dielectric("unlit of radiance 1", [1.0; 3], 1.0) });
    // Columns recede from the camera, and all panels have the same size in the picture before the tilt; rows are
    // tilted.
    let (near, across) = (3.0, 0.44);
    for (row, material) in [emitting, unlit].into_iter().enumerate() {
        let panel = b.mesh(&format!("panel {row}"), Shape::panel(1.0, 1.0), material);
        for column in 0..5 {
            let distance = near * 1.6_f64.powi(column);
            let size = 0.36 * distance / near;
            let x = (f64::from(column) - 2.0) * across * distance / near;
            let y = (0.345 - 0.69 * row as f64) * distance / near;
            let tilt = 17.5 * f64::from(column);
            let frame = at(x, y, -distance, tilt) * glam::DAffine3::from_scale(DVec3::splat(size));
            b.place(&format!("panel {row} at {distance:.1} m, turned {tilt} degrees"), panel, frame);
        }
    }
    // A ball has all tilts.
    for (i, (x, distance)) in [(-0.72, 3.0), (-0.24, 6.0), (0.24, 12.0), (0.72, 24.0)].into_iter().enumerate() {
        let scale = distance / near;
        b.add(&format!("ball {i}"), Shape::sphere(0.09 * scale, 48), emitting, at(x * scale, 0.0, -distance, 0.0));
    }
    b.camera("front", DVec3::ZERO, DVec3::NEG_Z, 24.0);
    b.finish()
}
