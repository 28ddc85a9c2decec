//! Work lists: which 8x8 tiles hold surfaces, which hold background or see-through fragments
//! (shaders/pass/classify.comp, classify_fragments.comp).

use std::sync::Arc;

use anyhow::Result;

use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use super::rows::{rows_of, stride};
use crate::gpu::{Buffer, Device, Frame, Image, NOTHING, Place};
use crate::plan::Plan;
use crate::shader::{classify, classify_fragments, classify_rays as ray_program};

/// Pixels a side.
pub const TILE: u32 = 8;

/// Bytes of one `WorkSize` of shaders/lib/work_tile.glsl: a VkDispatchIndirectCommand and a count.
pub const WORK_BYTES: u64 = 16;

/// A dispatch of nothing.
const EMPTY: [u32; 4] = [0, 1, 1, 0];

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
            empty: Buffer::with_data(device, "empty fragment work size", &EMPTY)?,
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
    heads: &'a Image,
    list: &'a FragmentTiles,
    rows: [u32; 2],
) -> Result<()> {
    frame.copy_buffer("reset fragment work size", &list.empty, &list.sizes, WORK_BYTES);
    let bind = classify_fragments::Bind { heads, sizes: &list.sizes, tiles: &list.tiles };
    let tiles = list.width.div_ceil(TILE) * (rows[1] - rows[0]).div_ceil(TILE);
    let groups = tiles.div_ceil(classify_fragments::PROGRAM.local_size[0]);
    let push = [list.width, rows[0], rows[1], stride(groups)];
    let constants = classify_fragments::Constants {}.words();
    frame.compute("classify fragment tiles", &bind, constants, bytemuck::cast_slice(&push), rows_of(groups))
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
    size: [u32; 2],
}

impl WorkLists {
    /// Lists for a picture of `size` pixels.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, size: [u32; 2]) -> Result<Self> {
        let bytes = 4 * u64::from(size[0].div_ceil(TILE)) * u64::from(size[1].div_ceil(TILE));
        Ok(Self {
            sizes: Buffer::new(device, "work sizes", 2 * WORK_BYTES, Place::Device)?,
            empty: Buffer::with_data(device, "empty work sizes", &[EMPTY, EMPTY])?,
            surface: Buffer::new(device, "surface tiles", bytes, Place::Device)?,
            background: Buffer::new(device, "background tiles", bytes, Place::Device)?,
            size,
        })
    }
}

/// Sorts the tiles of the G-buffer into the lists.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn classify<'a>(frame: &mut Frame<'a>, gbuffer: &'a GBuffer, lists: &'a WorkLists) -> Result<()> {
    frame.copy_buffer("reset work sizes", &lists.empty, &lists.sizes, 2 * WORK_BYTES);
    let bind = classify::Bind {
        depth: &gbuffer.depth_texels,
        sizes: &lists.sizes,
        surface_tiles: &lists.surface,
        background_tiles: &lists.background,
    };
    let tiles = lists.size[0].div_ceil(TILE) * lists.size[1].div_ceil(TILE);
    let groups = tiles.div_ceil(classify::PROGRAM.local_size[0]);
    let push = [lists.size[0], lists.size[1], stride(groups)];
    let constants = classify::Constants {}.words();
    frame.compute("classify tiles", &bind, constants, bytemuck::cast_slice(&push), rows_of(groups))
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
            empty: Buffer::with_data(device, "empty ray work size", &EMPTY)?,
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
    lighting: Lighting<'a>,
    calls: Calls,
    gbuffer: &'a GBuffer,
    list: &'a RayTiles,
) -> Result<()> {
    frame.copy_buffer("reset ray work size", &list.empty, &list.sizes, WORK_BYTES);
    let bind = ray_program::Bind {
        material_texels: &lighting.scene.materials,
        spectrum: &lighting.scene.spectrum.texels,
        depth: &gbuffer.depth_texels,
        ids: &gbuffer.ids,
        sizes: &list.sizes,
        ray_tiles: &list.tiles,
    };
    let size = lighting.size;
    let tiles = size[0].div_ceil(TILE) * size[1].div_ceil(TILE);
    let groups = tiles.div_ceil(ray_program::PROGRAM.local_size[0]);
    let constants = ray_program::Constants {
        clearcoat: lighting.plan.clearcoat,
        mirror_rays: calls.mirrors,
        roughest_mirror: lighting.plan.roughest_mirror,
        transmissive: calls.transmissive,
        ..Default::default()
    };
    let push = [size[0], size[1], stride(groups)];
    frame.compute("classify ray tiles", &bind, constants.words(), bytemuck::cast_slice(&push), rows_of(groups))
}
