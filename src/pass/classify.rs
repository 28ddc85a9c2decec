//! Tile classification: lists of the 8x8 tiles with surfaces, background, transparent fragments or rays, and the
//! arguments of indirect dispatches over them (shaders/pass/classify.comp, classify_fragments.comp,
//! classify_rays.comp).
//!
//! Read Real-Time Rendering (4th ed.), chapter 20 (efficient shading), and docs/decisions/work-tiles.md.

use std::sync::Arc;

use anyhow::Result;

use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use super::rows::{TileShare, rows_of, stride};
use crate::gpu::{Buffer, Device, Frame, Image, IndirectGroups, NOTHING, Place};
use crate::plan::{Architecture, Plan};
use crate::shader::{Library, classify, classify_fragments, classify_rays as ray_program, lib};
use crate::share::WorkSize;

/// Side of a tile in pixels.
pub const TILE: u32 = lib::work_tile::WORK_TILE;

/// Bytes of a [`WorkSize`], the arguments of an indirect dispatch.
pub const WORK_BYTES: u64 = size_of::<WorkSize>() as u64;

/// Arguments of an empty indirect dispatch.
pub(super) const EMPTY: WorkSize = WorkSize { x: 0, y: 1, z: 1, count: 0 };

/// The tiles of a strip that hold transparent fragments.
pub struct FragmentTiles {
    /// One [`WorkSize`].
    pub sizes: Buffer,
    empty: Buffer,
    /// Indices of the tiles.
    pub tiles: Buffer,
    width: u32,
}

impl FragmentTiles {
    /// One workgroup for each listed tile.
    #[must_use]
    pub fn groups(&self) -> IndirectGroups<'_> {
        IndirectGroups { sizes: &self.sizes, offset: 0, most: self.tiles.bytes() / 4 }
    }

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

/// Lists the tiles of rows `rows[0]` to before `rows[1]` that hold transparent fragments.
///
/// # Errors
/// When the driver refuses a descriptor or a layout.
pub fn classify_fragments<'a>(
    frame: &mut Frame<'a>,
    lighting: &Lighting<'a>,
    heads: &'a Image,
    list: &'a FragmentTiles,
    rows: [u32; 2],
) -> Result<()> {
    frame.copy_buffer("reset fragment work size", &list.empty, &list.sizes, WORK_BYTES);
    let bind = classify_fragments::Bind { heads, sizes: &list.sizes, tiles: &list.tiles };
    let tiles = list.width.div_ceil(TILE) * (rows[1] - rows[0]).div_ceil(TILE);
    let groups = tiles.div_ceil(classify_fragments::PROGRAM.local_size[0]);
    let (library, stride) = (lighting.library, stride(lighting.plan.architecture, groups));
    let push = classify_fragments::Push { width: list.width, first_row: rows[0], end_row: rows[1], stride };
    frame.compute("classify fragment tiles", &bind, &classify_fragments::Constants { library }, &push, rows_of(groups))
}

/// Lists of surface and background tiles, and the arguments of the indirect dispatches over them.
pub struct WorkLists {
    /// Two [`WorkSize`]: surfaces, background.
    pub sizes: Buffer,
    empty: Buffer,
    /// Indices of the tiles with surfaces.
    pub surface: Buffer,
    /// Indices of the tiles with background.
    pub background: Buffer,
    tiles: u32,
}

impl WorkLists {
    /// One workgroup for each tile with surfaces.
    #[must_use]
    pub fn surface_groups(&self) -> IndirectGroups<'_> {
        IndirectGroups { sizes: &self.sizes, offset: 0, most: u64::from(self.tiles) }
    }

    /// One workgroup for each tile with background.
    #[must_use]
    pub fn background_groups(&self) -> IndirectGroups<'_> {
        IndirectGroups { sizes: &self.sizes, offset: WORK_BYTES, most: u64::from(self.tiles) }
    }

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

/// Classifies the tiles of the G-buffer: surfaces, background, or both.
///
/// # Errors
/// When the driver refuses a descriptor or a layout.
pub fn classify<'a>(
    frame: &mut Frame<'a>,
    library: Library,
    architecture: Architecture,
    gbuffer: &'a GBuffer,
    lists: &'a WorkLists,
) -> Result<()> {
    frame.copy_buffer("reset work sizes", &lists.empty, &lists.sizes, 2 * WORK_BYTES);
    let bind = classify::Bind {
        gbuffer: gbuffer.bind(),
        sizes: &lists.sizes,
        surface_tiles: &lists.surface,
        background_tiles: &lists.background,
    };
    let groups = lists.tiles.div_ceil(classify::PROGRAM.local_size[0]);
    let push = classify::Push { stride: stride(architecture, groups) };
    frame.compute("classify tiles", &bind, &classify::Constants { library }, &push, rows_of(groups))
}

/// The kinds of surfaces whose tiles are listed.
#[derive(Debug, Clone, Copy)]
pub struct Calls {
    /// Surfaces smooth enough for specular reflection.
    pub mirrors: bool,
    /// Transmissive surfaces.
    pub transmissive: bool,
}

/// The tiles with surfaces that send rays, in the BVH or in screen space.
pub struct RayTiles {
    /// One [`WorkSize`].
    pub sizes: Buffer,
    empty: Buffer,
    /// Indices of the tiles.
    pub tiles: Buffer,
}

impl RayTiles {
    /// One workgroup for each listed tile.
    #[must_use]
    pub fn groups(&self) -> IndirectGroups<'_> {
        IndirectGroups { sizes: &self.sizes, offset: 0, most: self.tiles.bytes() / 4 }
    }

    /// A list for a picture of `size` pixels; dummies where no pass of the plan uses it.
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
/// When the driver refuses a descriptor or a layout.
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
    let push = ray_program::Push { stride: stride(lighting.plan.architecture, groups) };
    frame.compute("classify ray tiles", &bind, &constants, &push, rows_of(groups))
}
