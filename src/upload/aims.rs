//! What paths aim at, as tables on the device (shaders/lib/aims.glsl).

use std::sync::Arc;

use anyhow::Result;
use ash::vk;
use glam::DVec3;
use half::f16;

use super::table::{pack_half_2x16, upload};
use crate::gpu::{Buffer, Device, NOTHING, Place};
use crate::share::{AIM_GRID_TEXELS, AimBall, AimGrid};
use crate::transport::caustics::{Aims, Ball};

const _: () = assert!(size_of::<AimGrid>() == 16 * AIM_GRID_TEXELS as usize, "balls begin behind the grid");

/// A grid of cells, and the balls of each.
pub struct AimsOnDevice {
    /// A word each.
    pub cells: Buffer,
    /// An [`AimGrid`], then an [`AimBall`] each.
    pub balls: Buffer,
}

impl AimsOnDevice {
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, aims: &Aims) -> Result<Self> {
        let in_f32 = |p: DVec3| p.as_vec3().to_array();
        let ball = |ball: &Ball| AimBall {
            middle: in_f32(ball.middle),
            radius_share: pack_half_2x16([ball.radius / aims.cell, ball.share].map(f16::from_f64)),
        };
        let balls: Vec<AimBall> = aims.aims.iter().map(ball).collect();
        let grid = AimGrid {
            corner: in_f32(aims.corner),
            cells_per_metre: aims.cell.recip() as f32,
            cells: aims.cells,
            last_ball: balls.len().saturating_sub(1) as u32,
        };
        let table = [bytemuck::bytes_of(&grid), bytemuck::cast_slice(&balls)].concat();
        Ok(Self {
            cells: upload(device, "cells of aims", &aims.firsts, Some(vk::Format::R32_UINT))?,
            balls: upload(device, "aims", &table, Some(vk::Format::R32G32B32A32_UINT))?,
        })
    }

    /// Where nothing is aimed at.
    ///
    /// # Errors
    /// When memory is short.
    pub fn none(device: &Arc<Device>) -> Result<Self> {
        let nothing = |format| Buffer::texels(device, NOTHING, 0, Place::Device, format);
        Ok(Self { cells: nothing(vk::Format::R32_UINT)?, balls: nothing(vk::Format::R32G32B32A32_UINT)? })
    }
}
