//! Work lists: which 8x8 tiles hold surfaces, which hold background or see-through fragments
//! (shaders/pass/classify.comp, classify_fragments.comp).

use std::sync::Arc;

use anyhow::Result;

use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use super::rows::{TileShare, rows_of, stride};
use crate::gpu::{Buffer, Device, Frame, Image, NOTHING, Place};
use crate::plan::Plan;
use crate::shader::{Library, classify, classify_fragments, classify_rays as ray_program, lib};
use crate::share::WorkSize;

/// Pixels a side.
pub const TILE: u32 = lib::work_tile::WORK_TILE;

/// Bytes of one [`WorkSize`].
pub const WORK_BYTES: u64 = size_of::<WorkSize>() as u64;

/// A dispatch of nothing.
const EMPTY: WorkSize = WorkSize { x: 0, y: 1, z: 1, count: 0 };

/// The tiles of a strip that hold see-through fragments.
pub struct FragmentTiles {
    /// One `WorkSize`.
    pub sizes: Buffer,
    empty: Buffer,
    /// The tiles.
    pub tiles: Buffer,
    width: u32,
}

impl FragmentTiles {
    /// A list for a picture of `size` pixels.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, size: [u32; 2]) -> Result<Self> {
        let bytes = 4 * u64::from(size[0].div_ceil(TILE)) * u64::from(size[1].div_ceil(TILE));
        Ok(Self {
            sizes: Buffer::new(device, "fragment work size", WORK_BYTES, Place::Device)?,
            empty: Buffer::with_data(device, "empty fragment work size", &[EMPTY])?,
            tiles: Buffer::new(device, "fragment tiles", bytes, Place::Device)?,
            width: size[0],
        })
    }
}

/// Lists the tiles of rows `rows[0]` up to `rows[1]` that hold see-through fragments.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn classify_fragments<'a>(
    frame: &mut Frame<'a>,
    library: Library,
    heads: &'a Image,
    list: &'a FragmentTiles,
    rows: [u32; 2],
) -> Result<()> {
    frame.copy_buffer("reset fragment work size", &list.empty, &list.sizes, WORK_BYTES);
    let bind = classify_fragments::Bind { heads, sizes: &list.sizes, tiles: &list.tiles };
    let tiles = list.width.div_ceil(TILE) * (rows[1] - rows[0]).div_ceil(TILE);
    let groups = tiles.div_ceil(classify_fragments::PROGRAM.local_size[0]);
    let push =
        classify_fragments::Push { width: list.width, first_row: rows[0], end_row: rows[1], stride: stride(groups) };
    frame.compute("classify fragment tiles", &bind, &classify_fragments::Constants { library }, &push, rows_of(groups))
}

/// Lists of tiles and the sizes of the dispatches over them.
pub struct WorkLists {
    /// Two `WorkSize`: surfaces, background.
    pub sizes: Buffer,
    empty: Buffer,
    /// Tiles with surfaces.
    pub surface: Buffer,
    /// Tiles with background.
    pub background: Buffer,
    tiles: u32,
}

impl WorkLists {
    /// Lists for a share of a picture of `size` pixels.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, size: [u32; 2], share: TileShare) -> Result<Self> {
        let tiles = share.tiles(size);
        let bytes = 4 * u64::from(tiles);
        Ok(Self {
            sizes: Buffer::new(device, "work sizes", 2 * WORK_BYTES, Place::Device)?,
            empty: Buffer::with_data(device, "empty work sizes", &[EMPTY, EMPTY])?,
            surface: Buffer::new(device, "surface tiles", bytes, Place::Device)?,
            background: Buffer::new(device, "background tiles", bytes, Place::Device)?,
            tiles,
        })
    }
}

/// Sorts the tiles of the G-buffer into the lists.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn classify<'a>(frame: &mut Frame<'a>, library: Library, gbuffer: &'a GBuffer, lists: &'a WorkLists) -> Result<()> {
    frame.copy_buffer("reset work sizes", &lists.empty, &lists.sizes, 2 * WORK_BYTES);
    let bind = classify::Bind {
        gbuffer: gbuffer.bind(),
        sizes: &lists.sizes,
        surface_tiles: &lists.surface,
        background_tiles: &lists.background,
    };
    let groups = lists.tiles.div_ceil(classify::PROGRAM.local_size[0]);
    let push = classify::Push { stride: stride(groups) };
    frame.compute("classify tiles", &bind, &classify::Constants { library }, &push, rows_of(groups))
}

/// Which surfaces are looked for.
#[derive(Debug, Clone, Copy)]
pub struct Calls {
    /// Those smooth enough for a mirror image.
    pub mirrors: bool,
    /// Those that transmit light.
    pub transmissive: bool,
}

/// The tiles that hold surfaces which send rays, or march them over the screen.
pub struct RayTiles {
    /// One `WorkSize`.
    pub sizes: Buffer,
    empty: Buffer,
    /// The tiles.
    pub tiles: Buffer,
}

impl RayTiles {
    /// A list for a picture of `size` pixels, where the plan has something that is done in those tiles.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, plan: &Plan, size: [u32; 2]) -> Result<Self> {
        if !(plan.screen.mirrors || plan.rays.is_some_and(|rays| rays.mirrors || rays.refraction)) {
            let nothing = || Buffer::new(device, NOTHING, 0, Place::Device);
            return Ok(Self { sizes: nothing()?, empty: nothing()?, tiles: nothing()? });
        }
        let bytes = 4 * u64::from(size[0].div_ceil(TILE)) * u64::from(size[1].div_ceil(TILE));
        Ok(Self {
            sizes: Buffer::new(device, "ray work size", WORK_BYTES, Place::Device)?,
            empty: Buffer::with_data(device, "empty ray work size", &[EMPTY])?,
            tiles: Buffer::new(device, "ray tiles", bytes, Place::Device)?,
        })
    }
}

/// Lists the tiles of the G-buffer whose surfaces send rays (shaders/pass/classify_rays.comp).
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn classify_rays<'a>(
    frame: &mut Frame<'a>,
    lighting: &Lighting<'a>,
    calls: Calls,
    gbuffer: &'a GBuffer,
    list: &'a RayTiles,
) -> Result<()> {
    frame.copy_buffer("reset ray work size", &list.empty, &list.sizes, WORK_BYTES);
    let bind = ray_program::Bind { gbuffer: gbuffer.bind(), sizes: &list.sizes, ray_tiles: &list.tiles };
    let groups = lighting.share.tiles(lighting.size).div_ceil(ray_program::PROGRAM.local_size[0]);
    let constants = ray_program::Constants {
        library: lighting.library,
        find_mirrors: calls.mirrors,
        find_transmissive: calls.transmissive,
    };
    let push = ray_program::Push { stride: stride(groups) };
    frame.compute("classify ray tiles", &bind, &constants, &push, rows_of(groups))
}
