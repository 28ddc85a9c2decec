//! Heterogeneous medium: a grid of absorption coefficients σ in object space (lecture A2).
//!
//! Read pbrt 11.4 (GridMedium) and docs/scene-input.md. The medium absorbs and does not scatter.

use std::collections::HashSet;

use anyhow::{Result, ensure};
use glam::{DAffine3, DVec3, Vec3};

use super::{Mesh, Scene};

/// Largest number of values in one grid, points times channels: 2^24.
const MOST_VALUES: u64 = 1 << 24;

/// σ at the points of a grid, trilinear between them; outside the grid's box the value at the nearest point of the box
/// holds.
#[derive(Debug, Clone, PartialEq)]
pub struct SigmaGrid {
    size: [usize; 3],
    values: Vec<f32>,
    bounds: Option<[DVec3; 2]>,
}

impl SigmaGrid {
    /// A grid of `size` points along x, y and z; the first and last points of an axis lie on opposite sides of the box.
    /// With one point along an axis, σ is constant along it. `values` are in 1/m of world space (as attenuation
    /// distances are in metres of world space): one per point, or red, green and blue; x varies fastest, then y.
    /// `bounds` is the box in object space;
    /// `None` is the bounding box of the mesh.
    ///
    /// # Errors
    /// One sentence when a size, the number of values, a value or the box is invalid.
    pub fn new(size: [u64; 3], values: Vec<f32>, bounds: Option<[DVec3; 2]>) -> Result<Self> {
        let [x, y, z] = size;
        ensure!(x > 0 && y > 0 && z > 0, "a grid of {x} x {y} x {z} points has none");
        let points = x.checked_mul(y).and_then(|xy| xy.checked_mul(z)).filter(|&points| points <= MOST_VALUES);
        let Some(points) = points else { anyhow::bail!("{x} x {y} x {z} points are more than {MOST_VALUES}") };
        let count = values.len() as u64;
        ensure!(
            count == points || count == 3 * points,
            "{x} x {y} x {z} points have {points} values, or {} of three channels, not {count}",
            3 * points
        );
        ensure!(count <= MOST_VALUES, "{count} values are more than {MOST_VALUES}");
        if let Some(i) = values.iter().position(|v| !v.is_finite()) {
            anyhow::bail!("value {i} is not a finite number of 32 bits");
        }
        if let Some(i) = values.iter().position(|&v| v < 0.0) {
            anyhow::bail!("value {i}, {}, is negative: a medium does not give light", values[i]);
        }
        if let Some([min, max]) = bounds {
            ensure!(min.is_finite() && max.is_finite(), "the box {min} to {max} is not finite");
            for (axis, &points) in size.iter().enumerate() {
                ensure!(
                    min[axis] < max[axis] || (points == 1 && min[axis] == max[axis]),
                    "the box {min} to {max} has no extent along {}",
                    ["x", "y", "z"][axis]
                );
            }
        }
        Ok(Self { size: size.map(|n| n as usize), values, bounds })
    }

    /// Number of points along x, y and z.
    #[must_use]
    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// Number of channels: 1, or 3 for red, green and blue.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.values.len() / self.size.iter().product::<usize>()
    }

    /// σ at a grid point, in 1/m.
    #[must_use]
    pub fn at(&self, [x, y, z]: [usize; 3], channel: usize) -> f32 {
        let point = (z * self.size[1] + y) * self.size[0] + x;
        let channels = self.channels();
        self.values[point * channels + channel.min(channels - 1)]
    }

    /// Whether σ is 0 everywhere.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        self.values.iter().all(|&v| v == 0.0)
    }

    /// Multiplies all values.
    pub fn scale(&mut self, factor: f32) {
        self.values.iter_mut().for_each(|v| *v *= factor);
    }

    /// Mean of σ over the grid's box, in 1/m. A point on a side of the box counts for half a cell along that axis.
    #[must_use]
    pub fn mean(&self) -> [f64; 3] {
        let [nx, ny, nz] = self.size;
        let weight = |i: usize, n: usize| if n > 1 && (i == 0 || i == n - 1) { 0.5 } else { 1.0 };
        let (mut sum, mut weights) = ([0.0; 3], 0.0);
        for z in 0..nz {
            for y in 0..ny {
                for x in 0..nx {
                    let w = weight(x, nx) * weight(y, ny) * weight(z, nz);
                    weights += w;
                    for (c, sum) in sum.iter_mut().enumerate() {
                        *sum += w * f64::from(self.at([x, y, z], c));
                    }
                }
            }
        }
        sum.map(|s| s / weights)
    }

    /// Transform from the object space of `mesh` to grid coordinates: 0 at the first point of an axis, 1 at
    /// the second.
    #[must_use]
    pub fn grid_from_object(&self, mesh: &Mesh) -> DAffine3 {
        let [min, max] = self.bounds.unwrap_or_else(|| {
            let all = || mesh.positions.iter().map(|&p| Vec3::from(p).as_dvec3());
            [all().fold(DVec3::INFINITY, DVec3::min), all().fold(DVec3::NEG_INFINITY, DVec3::max)]
        });
        let cells = DVec3::from(self.size.map(|n| (n - 1) as f64));
        // An axis of one point has no cells, and a flat box has no extent.
        let scale = DVec3::from([0, 1, 2].map(|i| if max[i] > min[i] { cells[i] / (max[i] - min[i]) } else { 0.0 }));
        let scale = if scale.is_finite() { scale } else { DVec3::ZERO };
        let shift = if min.is_finite() { -min * scale } else { DVec3::ZERO };
        DAffine3::from_translation(shift) * DAffine3::from_scale(scale)
    }
}

/// Gives each instance with a grid its own material and its own mesh that refers to it, because the grid has a
/// different world transform in each. Does nothing when each instance has its own already.
pub fn one_medium_each(scene: &mut Scene) {
    if scene.materials.iter().all(|m| m.sigma.is_none()) {
        return;
    }
    let mut users = vec![0_usize; scene.meshes.len()];
    scene.instances.iter().for_each(|instance| users[instance.mesh] += 1);
    let mut taken = HashSet::new();
    for i in 0..scene.instances.len() {
        let mesh = scene.instances[i].mesh;
        let material = scene.meshes[mesh].material;
        if scene.materials[material].sigma.is_none() || taken.insert(material) {
            continue;
        }
        let own = scene.materials.len();
        taken.insert(own);
        scene.materials.push(scene.materials[material].clone());
        if users[mesh] > 1 {
            users[mesh] -= 1;
            users.push(1);
            scene.instances[i].mesh = scene.meshes.len();
            scene.meshes.push(scene.meshes[mesh].clone());
        }
        scene.meshes[scene.instances[i].mesh].material = own;
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{Instance, Material};

    #[test]
    fn the_mean_is_that_of_the_field_and_not_of_the_points() {
        // x² linear between four points of a line: the trapezoid rule, by hand.
        let grid = SigmaGrid::new([4, 1, 1], vec![0.0, 1.0, 4.0, 9.0], None).expect("a grid");
        assert!((grid.mean()[1] - (0.5 + 2.5 + 6.5) / 3.0).abs() < 1e-12);
        let grid = SigmaGrid::new([2, 2, 2], vec![3.0; 24], None).expect("three channels");
        assert_eq!((grid.channels(), grid.mean()), (3, [3.0; 3]));
    }

    #[test]
    fn places_count_points_from_one_side_of_the_box_to_the_other() {
        let mesh = Mesh { positions: vec![[-1.0, 0.0, 2.0], [3.0, 0.5, 2.0]].into(), ..Mesh::default() };
        let grid = SigmaGrid::new([5, 2, 3], vec![0.0; 30], None).expect("a grid");
        let place = grid.grid_from_object(&mesh);
        let at = |p| place.transform_point3(DVec3::from(p)).to_array();
        assert_eq!(at([-1.0, 0.0, 7.0]), [0.0; 3], "a flat box is constant across");
        assert_eq!(at([1.0, 0.5, 2.0]), [2.0, 1.0, 0.0]);
        assert_eq!(at([3.0, 0.25, 2.0]), [4.0, 0.5, 0.0]);
        assert_eq!(grid.grid_from_object(&Mesh::default()), DAffine3::from_scale(DVec3::ZERO));
    }

    #[test]
    fn instances_of_one_grid_are_media_of_their_own() {
        let grid = Arc::new(SigmaGrid::new([1, 1, 1], vec![1.0], None).expect("a grid"));
        let smoke = Material { sigma: Some(grid), ..Material::default() };
        let place = |mesh| Instance { name: String::new(), mesh, world_from_object: DAffine3::IDENTITY };
        let mut scene = Scene {
            meshes: [1, 0, 1].map(|material| Mesh { material, ..Mesh::default() }).to_vec(),
            instances: [0, 0, 1, 1, 2].map(place).to_vec(),
            materials: vec![Material::default(), smoke],
            ..Scene::default()
        };
        one_medium_each(&mut scene);
        let material = |i: &Instance| scene.meshes[i.mesh].material;
        assert_eq!(scene.instances.iter().map(material).collect::<Vec<_>>(), [1, 2, 0, 0, 3]);
        // The last instance is the only one of its mesh, so the mesh is not copied.
        assert_eq!((scene.meshes.len(), scene.materials.len(), scene.instances[4].mesh), (4, 4, 2));
        one_medium_each(&mut scene);
        assert_eq!((scene.meshes.len(), scene.materials.len()), (4, 4));
    }
}
