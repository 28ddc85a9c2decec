//! Grids of σ on the device: heterogeneous media as voxels of the absorption coefficient (shaders/lib/sigma_grid.glsl).
//!
//! Read pbrt (4th ed.), section 11.4 (grid media), and docs/decisions/absorption.md.

use std::sync::Arc;

use anyhow::{Result, ensure};
use ash::vk;
use glam::{DAffine3, DVec3};

use super::table::upload;
use crate::gpu::{Buffer, Device};
use crate::plan::Plan;
use crate::scene::{self, Scene};
use crate::share::{SigmaCell, SigmaGrid};

/// Largest number of texels of all grids: indices into them are stored as f32, which is exact up to 2^24.
const MOST_TEXELS: usize = 1 << 24;

/// The grids of heterogeneous media; a dummy where the plan marches none.
pub struct SigmaGrids {
    /// For each grid a header [`SigmaGrid`], then its [`SigmaCell`]s.
    pub texels: Buffer,
    /// Per material, index of the first texel of its grid plus 1, or 0 without a grid.
    pub places: Vec<u32>,
}

impl SigmaGrids {
    /// Uploads the grids. Every instance must have a medium of its own; `anchor` is the origin of bvh space.
    ///
    /// # Errors
    /// When the grids do not fit the device.
    pub fn new(device: &Arc<Device>, plan: &Plan, scene: &Scene, anchor: DVec3) -> Result<Self> {
        let mut texels: Vec<[f32; 4]> = Vec::new();
        let mut places = vec![0; scene.materials.len()];
        for instance in scene.instances.iter().filter(|_| plan.march().steps > 0) {
            let mesh = &scene.meshes[instance.mesh];
            let material = &scene.materials[mesh.material];
            let Some(grid) = material.marched_sigma() else { continue };
            places[mesh.material] = texels.len() as u32 + 1;
            let object_from_bvh = instance.world_from_object.inverse() * DAffine3::from_translation(anchor);
            append(&mut texels, grid, grid.grid_from_object(mesh) * object_from_bvh);
            ensure!(
                texels.len() <= MOST_TEXELS,
                "uploading the sigma of material \"{}\": all grids together need more than {MOST_TEXELS} texels",
                material.name
            );
        }
        let texels = upload(device, "grids of sigma", &texels, Some(vk::Format::R32G32B32A32_SFLOAT))?;
        Ok(Self { texels, places })
    }
}

fn append(texels: &mut Vec<[f32; 4]>, grid: &scene::SigmaGrid, grid_from_bvh: DAffine3) {
    // A mesh with a singular transform has no interior and no inverse.
    let place = if grid_from_bvh.is_finite() { grid_from_bvh } else { DAffine3::ZERO };
    let (m, t) = (place.matrix3.transpose(), place.translation);
    let row = |row: DVec3, shift: f64| row.extend(shift).as_vec4().to_array();
    let [nx, ny, nz] = grid.size();
    let cells = [nx, ny].map(|n| (n - 1).max(1));
    let colours = grid.channels() > 1;
    let header = SigmaGrid {
        x_row: row(m.x_axis, t.x),
        y_row: row(m.y_axis, t.y),
        z_row: row(m.z_axis, t.z),
        last: [nx - 1, ny - 1, nz - 1].map(|n| n as f32),
        first: (texels.len() + size_of::<SigmaGrid>() / 16) as f32,
        channel: if colours { cells[0] * cells[1] * nz } else { 0 } as f32,
        pad: [0.0; 3],
    };
    texels.extend_from_slice(bytemuck::cast_slice(&[header]));
    for channel in 0..grid.channels() {
        for z in 0..nz {
            for y in 0..cells[1] {
                for x in 0..cells[0] {
                    let at = |dx: usize, dy: usize| grid.at([(x + dx).min(nx - 1), (y + dy).min(ny - 1), z], channel);
                    let cell = SigmaCell { first_y: [at(0, 0), at(1, 0)], second_y: [at(0, 1), at(1, 1)] };
                    texels.push(bytemuck::cast(cell));
                }
            }
        }
    }
}
