//! Generated scenes with parameters, for tests and measurements.

use glam::{DAffine3, DVec3};

use super::build::{StudyBuilder, at, dielectric, emitter};
use super::shape::Shape;
use crate::{LightKind, Material, Projection, Scene};

/// PCG-XSH-RR 64/32 (O'Neill 2014): a random number generator with the same sequence on every machine.
struct Pcg(u64);

impl Pcg {
    fn next(&mut self) -> u32 {
        let state = self.0;
        self.0 = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let shifted = (((state >> 18) ^ state) >> 27) as u32;
        shifted.rotate_right((state >> 59) as u32)
    }

    /// A uniform random number in [0, 1).
    fn unit(&mut self) -> f64 {
        f64::from(self.next()) / 4_294_967_296.0
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
}

/// 1024 boxes on a plane of 64 m, with `count` coloured point lights of range 5 m among them. A larger count keeps the
/// positions of the first lights.
#[must_use]
pub fn lights(count: usize) -> Scene {
    let mut b = StudyBuilder::new(&format!("lights({count})"));
    let floor = b.material(dielectric("floor", [0.5; 3], 0.8));
    b.add("floor", Shape::plane(64.0, 64.0, 1), floor, DAffine3::IDENTITY);
    let clay = b.material(dielectric("clay", [0.7, 0.68, 0.65], 0.5));
    let cube = b.mesh("box", Shape::cuboid(DVec3::ONE), clay);
    let mut random = Pcg(1);
    for i in 0..1024 {
        let (column, row) = (f64::from(i % 32), f64::from(i / 32));
        let (x, z) = (2.0 * column - 31.0 + random.between(-0.4, 0.4), 2.0 * row - 31.0 + random.between(-0.4, 0.4));
        let height = random.between(0.3, 1.8);
        let turn = random.between(0.0, 90.0);
        let frame = at(x, height * 0.5 + 0.001, z, turn);
        b.place(&format!("box {i}"), cube, frame * DAffine3::from_scale(DVec3::new(0.7, height, 0.7)));
    }
    let mut random = Pcg(2);
    for i in 0..count {
        let position = DVec3::new(random.between(-32.0, 32.0), random.between(0.5, 3.0), random.between(-32.0, 32.0));
        let hue = random.between(0.0, std::f64::consts::TAU);
        let color = [0.0, 2.094, 4.189].map(|shift| (2.0 + 1.5 * (hue + shift).cos()) as f32);
        b.light(&format!("light {i}"), color, LightKind::Point { position, range: Some(5.0) });
    }
    b.camera("front", DVec3::new(0.0, 14.0, 36.0), DVec3::new(0.0, 0.0, 4.0), 45.0);
    b.finish()
}

/// A bumpy sphere of about `triangles` triangles, 2 m across.
#[must_use]
pub fn sphere_field(triangles: usize) -> Scene {
    let mut b = StudyBuilder::new(&format!("sphere_field({triangles})"));
    let clay = b.material(dielectric("clay", [0.7, 0.55, 0.42], 0.6));
    b.add("ball", Shape::displaced_sphere(1.0, triangles), clay, DAffine3::IDENTITY);
    let direction = DVec3::new(-0.5, -0.8, -0.6).normalize();
    b.light("sun", [3.0; 3], LightKind::Directional { direction });
    b.camera("front", DVec3::new(0.0, 0.0, 4.2), DVec3::ZERO, 32.0);
    b.finish()
}

/// One square per distance, facing a camera at the origin that looks along −Z, side by side and of equal size in the
/// picture. Square `i` emits radiance (i + 1, 1, 1) and is thereby identified.
#[must_use]
pub fn quads_at(distances: &[f64]) -> Scene {
    let mut b = StudyBuilder::new(&format!("quads_at({})", distances.len()));
    let count = distances.len().max(1) as f64;
    // Tangents of angles: the row spans ±0.6 across, inside a 16:9 picture of 40° (±0.647).
    let pitch = 1.2 / count;
    for (i, &distance) in distances.iter().enumerate() {
        let glow = b.material(emitter(&format!("emitter {i}"), [i as f32 + 1.0, 1.0, 1.0]));
        let side = (pitch * 0.8).min(0.6);
        let x = (i as f64 + 0.5) * pitch - 0.6;
        // The scale is in the transform, so that the mesh is exact in f32 at any distance.
        let frame = at(x * distance, 0.0, -distance, 0.0) * DAffine3::from_scale(DVec3::splat(side * distance));
        b.add(&format!("quad {i}"), Shape::panel(1.0, 1.0), glow, frame);
    }
    b.camera("front", DVec3::ZERO, DVec3::NEG_Z, 40.0);
    b.finish()
}

/// A textured plane of `size` by `size` metres with `repeats` repeats of an 8 by 8 checkerboard, from eye height to the
/// horizon: the hardest case for texture filtering.
#[must_use]
pub fn checker_plane(size: f64, repeats: f64) -> Scene {
    let mut b = StudyBuilder::new("checker_plane");
    let checker = b.checker("checker", [0.02; 3], [0.9; 3]);
    let matt = b.material(Material { base_color_texture: Some(checker), ..dielectric("floor", [1.0; 3], 1.0) });
    b.add("floor", Shape::plane(size, size, 1).repeat_uv(repeats, repeats), matt, DAffine3::IDENTITY);
    b.light("sun", [std::f32::consts::PI; 3], LightKind::Directional { direction: DVec3::NEG_Y });
    let eye = DVec3::new(0.0, size * 0.05, size * 0.5);
    b.camera("front", eye, DVec3::new(0.0, 0.0, size * 0.1), 40.0);
    b.finish()
}

/// The scene scaled by `factor` around the origin and then moved by `offset`. The picture stays the same, because
/// intensities scale with the square of lengths, and attenuation distances with lengths.
#[must_use]
pub fn at_scale(mut scene: Scene, factor: f64, offset: DVec3) -> Scene {
    let moved = |p: DVec3| p * factor + offset;
    let grow = DAffine3::from_translation(offset) * DAffine3::from_scale(DVec3::splat(factor));
    for instance in &mut scene.instances {
        instance.world_from_object = grow * instance.world_from_object;
    }
    for material in &mut scene.materials {
        // Thickness is in object space and scales with the transform; the attenuation distance is in world space.
        material.attenuation_distance *= factor as f32;
        if let Some(grid) = &mut material.sigma {
            std::sync::Arc::make_mut(grid).scale(1.0 / factor as f32);
        }
    }
    for light in &mut scene.lights {
        match &mut light.kind {
            // A directional light gives irradiance, which does not depend on lengths.
            LightKind::Directional { .. } => continue,
            LightKind::Point { position, range } | LightKind::Spot { position, range, .. } => {
                *position = moved(*position);
                *range = range.map(|r| r * factor);
            }
        }
        light.color = light.color.map(|c| (f64::from(c) * factor * factor) as f32);
        if let Some(emission) = &mut light.spectrum {
            emission.luminance *= factor * factor;
        }
    }
    for camera in &mut scene.cameras {
        camera.world_from_camera.translation = moved(camera.world_from_camera.translation);
        match &mut camera.projection {
            Projection::Perspective { near, .. } => *near = near.map(|n| n * factor),
            Projection::Orthographic { half_height, near, far } => {
                for length in [half_height, near, far] {
                    *length *= factor;
                }
            }
        }
    }
    scene.name = format!("{} times {factor} at {offset}", scene.name);
    scene
}
