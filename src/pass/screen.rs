//! The picture as input of screen-space reflection and refraction, with a per-tile depth bound
//! (shaders/lib/screen.glsl).
//!
//! Read docs/decisions/screen-space.md.

use std::sync::Arc;

use anyhow::Result;

use super::classify::TILE;
use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use super::rows::rows_of;
use crate::gpu::{Buffer, Device, Frame, Place};
use crate::plan::{Plan, Screen};
use crate::shader::{lib, screen_tiles as tiles_program};

/// The picture for screen-space lookups; dummies where the plan has none.
pub struct OnScreen {
    /// A copy of the radiance in row order, which passes read while they write the original.
    pub seen: Buffer,
    /// Largest reversed depth (nearest surface) of each 8x8 tile.
    pub nearest_pieces: Buffer,
}

impl OnScreen {
    /// Buffers for a picture of `size` pixels.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, plan: &Plan, size: [u32; 2]) -> Result<Self> {
        let called_for = u64::from(plan.screen != Screen::default());
        let pixels = u64::from(size[0]) * u64::from(size[1]) * called_for;
        let tiles = u64::from(size[0].div_ceil(TILE)) * u64::from(size[1].div_ceil(TILE)) * called_for;
        let buffer = |name, bytes| Buffer::new(device, name, bytes, Place::Device);
        Ok(Self {
            seen: buffer("radiance on the screen", 16 * pixels)?,
            nearest_pieces: buffer("nearest depth of tiles", 4 * tiles)?,
        })
    }

    /// Bindings of screen-space lookups, with `seen` as the radiance.
    #[must_use]
    pub fn bind<'a>(&'a self, seen: &'a Buffer) -> lib::screen::Bind<'a> {
        lib::screen::Bind { seen, nearest_pieces: &self.nearest_pieces }
    }
}

/// Computes the nearest depth of each tile (shaders/pass/screen_tiles.comp).
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn screen_tiles<'a>(
    frame: &mut Frame<'a>,
    lighting: &Lighting<'a>,
    gbuffer: &'a GBuffer,
    screen: &'a OnScreen,
) -> Result<()> {
    let bind = tiles_program::Bind { gbuffer: gbuffer.bind(), nearest_pieces: &screen.nearest_pieces };
    let [width, height] = lighting.size;
    let tiles = width.div_ceil(TILE) * height.div_ceil(TILE);
    let groups = rows_of(tiles.div_ceil(tiles_program::PROGRAM.local_size[0]));
    let constants = tiles_program::Constants { library: lighting.library };
    frame.compute("nearest depth of tiles", &bind, &constants, &(), groups)
}
