//! What paths aim at, as tables on the device (shaders/lib/aims.glsl).

use std::sync::Arc;

use anyhow::Result;
use glam::DVec3;
use half::f16;

use super::upload::upload;
use crate::gpu::{Buffer, Device, NOTHING, Place};
use crate::scene::caustics::{Aims, Ball};

/// A grid of cells, and the balls of each.
pub struct AimsOnDevice {
    /// A word each.
    pub cells: Buffer,
    /// Two texels of the grid, and one of each ball.
    pub balls: Buffer,
}

impl AimsOnDevice {
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, aims: &Aims) -> Result<Self> {
        let texel = |p: DVec3, w: u32| {
            let [x, y, z] = p.to_array().map(|x| (x as f32).to_bits());
            [x, y, z, w]
        };
        let [across, up, deep] = aims.cells;
        let ball = |ball: &Ball| {
            let [radius, share] = [ball.radius / aims.cell, ball.share].map(|x| u32::from(f16::from_f64(x).to_bits()));
            texel(ball.middle, radius | share << 16)
        };
        let grid = [texel(aims.corner, (aims.cell.recip() as f32).to_bits()), [across, up, deep, 0]];
        let texels: Vec<[u32; 4]> = grid.into_iter().chain(aims.aims.iter().map(ball)).collect();
        Ok(Self {
            cells: upload(device, "cells of aims", &aims.firsts, None)?,
            balls: upload(device, "aims", &texels, None)?,
        })
    }

    /// Where nothing is aimed at.
    ///
    /// # Errors
    /// When memory is short.
    pub fn none(device: &Arc<Device>) -> Result<Self> {
        let nothing = || Buffer::new(device, NOTHING, 0, Place::Device);
        Ok(Self { cells: nothing()?, balls: nothing()? })
    }
}
