//! The guiding distribution of path guiding as tables on the device (shaders/lib/path_guiding.glsl).
//!
//! [`crate::transport::photon_guiding`] computes it.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;
use glam::DVec3;
use half::f16;

use super::table::{pack_half_2x16, upload};
use crate::gpu::{Buffer, Device, NOTHING, Place};
use crate::share::{GUIDING_GRID_TEXELS, GuidingGrid, GuidingSphere};
use crate::transport::photon_guiding::{GuidingBall, PhotonGuiding};

const _: () = assert!(size_of::<GuidingGrid>() == 16 * GUIDING_GRID_TEXELS as usize, "spheres begin behind the grid");

/// A grid of cells, each with its bounding spheres.
pub struct GuidingOnDevice {
    /// One word per cell: index of its first sphere and their number.
    pub cells: Buffer,
    /// A header [`GuidingGrid`], then one [`GuidingSphere`] per sphere.
    pub spheres: Buffer,
}

impl GuidingOnDevice {
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, guiding: &PhotonGuiding) -> Result<Self> {
        let in_f32 = |p: DVec3| p.as_vec3().to_array();
        let sphere = |sphere: &GuidingBall| GuidingSphere {
            middle: in_f32(sphere.middle),
            radius_share: pack_half_2x16([sphere.radius / guiding.cell, sphere.share].map(f16::from_f64)),
        };
        let spheres: Vec<GuidingSphere> = guiding.spheres.iter().map(sphere).collect();
        let grid = GuidingGrid {
            corner: in_f32(guiding.corner),
            cells_per_metre: guiding.cell.recip() as f32,
            cells: guiding.cells,
            last_ball: spheres.len().saturating_sub(1) as u32,
        };
        let table = [bytemuck::bytes_of(&grid), bytemuck::cast_slice(&spheres)].concat();
        Ok(Self {
            cells: upload(device, "guiding cells", &guiding.firsts, Some(vk::Format::R32_UINT))?,
            spheres: upload(device, "guiding spheres", &table, Some(vk::Format::R32G32B32A32_UINT))?,
        })
    }

    /// Dummy tables for plans without path guiding.
    ///
    /// # Errors
    /// When memory is short.
    pub fn none(device: &Arc<Device>) -> Result<Self> {
        let nothing = |format| Buffer::texels(device, NOTHING, 0, Place::Device, format);
        Ok(Self { cells: nothing(vk::Format::R32_UINT)?, spheres: nothing(vk::Format::R32G32B32A32_UINT)? })
    }
}
