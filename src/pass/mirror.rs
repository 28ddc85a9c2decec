//! Mirror images of what is on the screen, over the tiles that call for them (shaders/pass/mirror.comp).

use std::sync::Arc;

use anyhow::Result;

use super::classify::{Calls, RayTiles, TILE, classify_rays};
use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use super::rows::rows_of;
use crate::gpu::{Buffer, Device, Frame, Image, Place};
use crate::plan::{Plan, Screen};
use crate::shader::{lib, mirror, screen_tiles as tiles_program};

/// The picture as something to be looked up; next to nothing where the plan does not.
pub struct OnScreen {
    /// A copy of the radiance, row by row, to be read while that is written.
    pub seen: Buffer,
    /// How near the surfaces of each 8x8 tile come, as reversed depth.
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
            nearest_pieces: buffer("nearest pieces of tiles", 4 * tiles)?,
        })
    }
}

/// Finds how near the surfaces of each tile come (shaders/pass/screen_tiles.comp).
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
    frame.compute("nearest pieces of tiles", &bind, &constants, &(), groups)
}

/// Puts the radiance on the screen in the place of the environment's where a mirrored ray meets it.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn mirror<'a>(
    frame: &mut Frame<'a>,
    lighting: &Lighting<'a>,
    gbuffer: &'a GBuffer,
    tiles: &'a RayTiles,
    screen: &'a OnScreen,
    radiance: &'a Image,
) -> Result<()> {
    classify_rays(frame, lighting, Calls { mirrors: true, transmissive: false }, gbuffer, tiles)?;
    // The surfaces are those of the lighting, to the last bit: what it has added is taken away.
    let mut library = lighting.library;
    library.surface.mirror_rays = false;
    library.gbuffer.stored_triangles = false;
    let bind = mirror::Bind {
        gbuffer: gbuffer.bind(),
        screen: lib::screen::Bind { seen: &screen.seen, nearest_pieces: &screen.nearest_pieces },
        radiance,
        mirror_tiles: &tiles.tiles,
        work: &tiles.sizes,
    };
    let constants = mirror::Constants { library };
    frame.compute_indirect("mirror images on the screen", &bind, &constants, &(), &tiles.sizes, 0)
}
