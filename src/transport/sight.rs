//! Number of transparent surfaces along straight lines of sight: a lower bound for the surfaces that a path must cross
//! to reach what is behind them. Refracted and internally reflected paths cross more.
//!
//! Read docs/decisions/interfaces.md. `etalon plan` prints the light that each rung of `interfaces` loses along these
//! lines.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::bvh::Bvh;
use super::line::{self, Crossing};
use crate::scene::{AlphaMode, Camera, Projection, Scene};

/// Columns of the grid of lines; the number of rows follows from the aspect ratio.
const LINES: u32 = 160;

/// Transparent surfaces along a camera's lines of sight.
#[derive(Debug, Clone, PartialEq)]
pub struct Sight {
    /// Largest number of transparent surfaces on one line, before the first opaque one.
    pub most: u32,
    /// For each number of surfaces from 0 up to `most`: the largest share of light behind that many surfaces, over all
    /// lines with more surfaces. A path that ends there loses this share.
    pub left: Vec<f64>,
}

impl Sight {
    /// The largest share of a pixel's light that paths of at most `interfaces` surfaces lose.
    #[must_use]
    pub fn lost(&self, interfaces: u32) -> f64 {
        if interfaces >= self.most { 0.0 } else { self.left[interfaces as usize] }
    }
}

/// Casts a grid of lines through the picture of `size` pixels seen by `camera`; `bvh` is the scene's BVH.
#[must_use]
pub fn along_lines(scene: &Scene, bvh: &Bvh, camera: &Camera, size: [u32; 2]) -> Sight {
    let aspect = f64::from(size[0]) / f64::from(size[1]);
    let down = ((f64::from(LINES) / aspect).ceil() as u32).clamp(1, 4 * LINES);
    let lines: Vec<Vec<f64>> = (0..LINES * down)
        .into_par_iter()
        .map(|i| {
            let at =
                [(i % LINES, LINES), (i / LINES, down)].map(|(i, of)| (f64::from(i) + 0.5) / f64::from(of) * 2.0 - 1.0);
            let (origin, direction) = line_through(camera, aspect, DVec2::new(at[0], -at[1]));
            shares(scene, bvh, origin - bvh.anchor, direction)
        })
        .collect();
    let most = lines.iter().map(Vec::len).max().unwrap_or_default();
    // Entry k of a line is the light left behind its first k + 1 surfaces.
    let left = (0..most).map(|k| {
        let longer = lines.iter().filter(|line| line.len() > k);
        longer.map(|line| if k == 0 { 1.0 } else { line[k - 1] }).fold(0.0, f64::max)
    });
    Sight { most: most as u32, left: left.collect() }
}

/// The line of sight through a point of the picture (−1 … 1 to the right and up): origin and unit direction in world
/// space.
pub(super) fn line_through(camera: &Camera, aspect: f64, at: DVec2) -> (DVec3, DVec3) {
    let m = camera.world_from_camera.matrix3;
    let eye = camera.world_from_camera.translation;
    let (right, up, forward) = (m.x_axis.normalize(), m.y_axis.normalize(), -m.z_axis.normalize());
    match camera.projection {
        Projection::Perspective { fov_y, .. } => {
            let half = (0.5 * fov_y).tan();
            (eye, (forward + right * (at.x * half * aspect) + up * (at.y * half)).normalize())
        }
        Projection::Orthographic { half_height, .. } => {
            (eye + right * (at.x * half_height * aspect) + up * (at.y * half_height), forward)
        }
    }
}

/// The share of light left behind each transparent surface along a line, before the first opaque one. `origin` is in
/// bvh space.
fn shares(scene: &Scene, bvh: &Bvh, origin: DVec3, direction: DVec3) -> Vec<f64> {
    let mut found: Vec<(f64, u32, f64)> = Vec::new();
    let mut opaque = f64::INFINITY;
    line::traverse(bvh, origin, direction, 0.0, |Crossing { triangle, t, .. }| {
        let material = &scene.materials[scene.meshes[scene.instances[triangle.instance as usize].mesh].material];
        if material.transmission > 0.0 {
            // Along a straight line a surface reflects at least as much as at normal incidence.
            let f0 = ((f64::from(material.ior) - 1.0) / (f64::from(material.ior) + 1.0)).powi(2);
            found.push((t, triangle.instance, f64::from(material.transmission) * (1.0 - f0)));
        } else if material.alpha_mode == AlphaMode::Blend {
            found.push((t, triangle.instance, 1.0 - f64::from(material.base_color[3])));
        } else {
            opaque = opaque.min(t);
        }
        opaque
    });
    found.retain(|(t, ..)| *t < opaque);
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    // A line through an edge meets both triangles of one surface.
    found.dedup_by(|b, a| a.1 == b.1 && b.0 - a.0 <= 1e-9 * b.0);
    found
        .iter()
        .scan(1.0, |left, (.., share)| {
            *left *= share;
            Some(*left)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::scene::{Instance, Material, Mesh};

    /// Parallel glass panes, the first nearest to the camera, with an opaque pane after `glass` of them.
    fn panes(glass: usize, behind: usize) -> Scene {
        let pane = |material| Mesh {
            positions: vec![[-9.0, -9.0, 0.0], [9.0, -9.0, 0.0], [9.0, 9.0, 0.0], [-9.0, 9.0, 0.0]].into(),
            normals: vec![[0.0, 0.0, 1.0]; 4].into(),
            indices: vec![0, 1, 2, 0, 2, 3].into(),
            material,
            ..Mesh::default()
        };
        let instance = |(i, mesh): (usize, usize)| Instance {
            name: String::new(),
            mesh,
            world_from_object: DAffine3::from_translation(DVec3::new(0.0, 0.0, -(i as f64))),
        };
        let order = std::iter::repeat_n(0, glass).chain([1]).chain(std::iter::repeat_n(0, behind));
        Scene {
            meshes: vec![pane(0), pane(1)],
            materials: vec![Material { transmission: 0.5, ior: 1.5, ..Material::default() }, Material::default()],
            instances: order.enumerate().map(instance).collect(),
            ..Scene::default()
        }
    }

    #[test]
    fn panes_are_counted_up_to_the_first_opaque_one() {
        let camera = Camera::looking_at(DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, 0.5).expect("a camera");
        for (glass, behind) in [(0, 3), (1, 0), (5, 2)] {
            let sight = {
                let scene = panes(glass, behind);
                along_lines(&scene, &Bvh::build(&scene).expect("a tree"), &camera, [160, 90])
            };
            assert_eq!(sight.most, glass as u32);
            let each: f64 = 0.5 * 0.96;
            for interfaces in 0..8 {
                let lost = if interfaces < sight.most { each.powi(interfaces as i32) } else { 0.0 };
                assert!((sight.lost(interfaces) - lost).abs() < 1e-12, "{interfaces}: {}", sight.lost(interfaces));
            }
        }
    }
}
