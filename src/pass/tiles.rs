//! Tiled light culling: the point and spot lights that reach each 16x16 tile (shaders/pass/tile_depth.comp,
//! tiles.comp).
//!
//! Read Real-Time Rendering (4th ed.), section 20.3 (tiled shading), and docs/decisions/light-lists.md.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;

use super::gbuffer::GBuffer;
use super::rows::rows_of;
use crate::gpu::{Buffer, Device, Frame, Place};
use crate::plan::Plan;
use crate::shader::{Library, lib, tile_depth, tiles};

const TILE: u32 = lib::light_tile::TILE;

/// Depth bounds and light masks of the tiles of a picture.
pub struct Tiles {
    depths: Buffer,
    /// One bit per light, `words` words per tile.
    masks: Buffer,
    words: u32,
    across: u32,
    down: u32,
}

impl Tiles {
    /// Buffers for a picture of `size` pixels; dummies without tiled light culling.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, plan: &Plan, size: [u32; 2]) -> Result<Self> {
        let words = if plan.tiles { plan.local_lights.div_ceil(32) } else { 0 };
        let (across, down) = (size[0].div_ceil(TILE), size[1].div_ceil(TILE));
        let count = if plan.tiles { u64::from(across) * u64::from(down) } else { 0 };
        Ok(Self {
            depths: Buffer::texels(device, "tile depths", 8 * count, Place::Device, vk::Format::R32G32_SFLOAT)?,
            masks: Buffer::new(device, "tile light masks", 4 * count * u64::from(words), Place::Device)?,
            words,
            across,
            down,
        })
    }

    /// Bindings of the passes that light surfaces.
    #[must_use]
    pub fn bind(&self) -> lib::lighting::Bind<'_> {
        lib::lighting::Bind { tile_lights: &self.masks }
    }

    /// Words of a tile's mask; 0 without tiled light culling.
    #[must_use]
    pub fn words(&self) -> u32 {
        self.words
    }
}

/// Computes depth bounds and light masks from the G-buffer.
///
/// # Errors
/// When the driver refuses a descriptor or a layout.
pub fn tiles<'a>(
    frame: &mut Frame<'a>,
    plan: &Plan,
    library: Library,
    gbuffer: &'a GBuffer,
    target: &'a Tiles,
) -> Result<()> {
    let bind = tile_depth::Bind { gbuffer: gbuffer.bind(), tile_depths: &target.depths };
    let constants = tile_depth::Constants { library, from_camera: plan.transparency };
    frame.compute_over("tile depths", &bind, &constants, &(), [target.across, target.down])?;

    let bind = tiles::Bind { tile_depths: &target.depths, tile_lights: &target.masks };
    let count = target.across * target.down;
    let push = tiles::Push {
        first: plan.directional_lights,
        count: plan.local_lights,
        words: target.words,
        tiles_across: target.across,
        tiles: count,
    };
    let groups = rows_of((count * target.words).div_ceil(tiles::PROGRAM.local_size[0]));
    frame.compute("tiled light culling", &bind, &tiles::Constants {}, &push, groups)
}
