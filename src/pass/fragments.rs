//! Order-independent transparency, first pass: transparent surfaces into per-pixel linked lists of fragments (A-buffer,
//! shaders/pass/fragments.*).
//!
//! Read Carpenter 1984, "The A-buffer, an Antialiased Hidden Surface Method"; Yang et al. 2010, "Real-Time Concurrent
//! Linked List Construction on the GPU"; Real-Time Rendering (4th ed.), section 5.5; docs/decisions/transparency.md.

use std::sync::Arc;

use anyhow::{Result, bail};
use ash::vk;

use super::classify::{FragmentTiles, TILE};
use super::gbuffer::GBuffer;
use crate::gpu::{Buffer, ColorTarget, DepthTarget, Device, Frame, Image, ImageDesc, Place, Raster};
use crate::plan::Plan;
use crate::shader::{fragments, lib};
use crate::upload::scene::SceneOnDevice;

/// Bytes of one fragment.
fn node_bytes(plan: &Plan) -> u64 {
    use lib::fragment_list::{LEAST_NODE_WORDS, LOBE_WORDS};
    4 * u64::from(LEAST_NODE_WORDS + if plan.lobe_texels { LOBE_WORDS } else { 0 })
}

/// Per-pixel linked lists of fragments (A-buffer), built in horizontal strips so that any number of fragments fits
/// memory.
pub struct FragmentLists {
    /// First fragment of each pixel's list.
    pub heads: Image,
    /// The fragments of a strip.
    pub nodes: Buffer,
    /// Number of fragments per strip; more than `nodes` holds means that the frame has to be drawn again.
    pub counters: Buffer,
    /// Number of pixels whose list was too long for one invocation.
    pub dropped: Buffer,
    /// Tiles with fragments.
    pub work: FragmentTiles,
    strips: u32,
    size: [u32; 2],
    node_bytes: u64,
    device: Arc<Device>,
}

/// Rows of the picture whose fragments are in memory together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Strip {
    /// Index of the strip, from the top.
    pub index: u32,
    /// First row, and one past the last.
    pub rows: [u32; 2],
}

impl FragmentLists {
    /// Lists with space for one fragment per pixel at first.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, plan: &Plan, size: [u32; 2]) -> Result<Self> {
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let node_bytes = node_bytes(plan);
        let limit = device.max_storage_bytes() / node_bytes;
        Ok(Self {
            heads: Image::new(
                device,
                "fragment list heads",
                ImageDesc::flat(
                    vk::Format::R32_UINT,
                    size[0],
                    size[1],
                    vk::ImageUsageFlags::STORAGE | vk::ImageUsageFlags::COLOR_ATTACHMENT,
                ),
            )?,
            nodes: Buffer::new(device, "fragment list nodes", pixels.min(limit) * node_bytes, Place::Device)?,
            counters: Buffer::new(device, "fragment counters", 4, Place::Counters)?,
            dropped: Buffer::new(device, "dropped fragments", 4, Place::Counters)?,
            work: FragmentTiles::new(device, size)?,
            strips: 1,
            size,
            node_bytes,
            device: device.clone(),
        })
    }

    /// The strips from top to bottom.
    #[must_use]
    pub fn strips(&self) -> Vec<Strip> {
        let rows = self.size[1].div_ceil(self.strips);
        // A strip boundary never divides a tile of the picture, unless strips are smaller than a tile.
        let rows = if rows < TILE { rows.next_power_of_two() } else { rows.next_multiple_of(TILE) };
        (0..self.strips)
            .map(|index| Strip { index, rows: [index, index + 1].map(|i| (i * rows).min(self.size[1])) })
            .filter(|strip| strip.rows[0] < strip.rows[1])
            .collect()
    }

    /// Whether the fragments of the last frame fitted. If not, the buffer has grown (or the strips have shrunk): draw
    /// again.
    ///
    /// # Errors
    /// When memory is short.
    pub fn fitted(&mut self) -> Result<bool> {
        let strips = self.strips as usize;
        let most = self
            .counters
            .read(|bytes| bytemuck::cast_slice::<u8, u32>(bytes)[..strips].iter().copied().max().unwrap_or_default());
        let most = u64::from(most);
        if most * self.node_bytes <= self.nodes.bytes() {
            return Ok(true);
        }
        let limit = self.device.max_storage_bytes() / self.node_bytes;
        // Space for the next samples, whose edges fall a little differently.
        let wanted = most + most / 16 + 1024;
        if wanted > limit {
            if self.strips == self.size[1] {
                bail!("one row of the picture has {most} transparent fragments, this device holds {limit}");
            }
            self.strips = (self.strips * 2).min(self.size[1]);
            self.counters =
                Buffer::new(&self.device, "fragment counters", 4 * u64::from(self.strips), Place::Counters)?;
        }
        if self.nodes.bytes() < wanted.min(limit) * self.node_bytes {
            let bytes = wanted.min(limit) * self.node_bytes;
            self.nodes = Buffer::new(&self.device, "fragment list nodes", bytes, Place::Device)?;
        }
        Ok(false)
    }

    /// Number of pixels in the last sample whose farthest fragments were dropped.
    #[must_use]
    pub fn dropped(&self) -> u32 {
        self.dropped.read(|bytes| u32::from_ne_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    }
}

/// Draws every transparent surface in front of the opaque ones into the lists of one strip.
///
/// # Errors
/// When the driver refuses a descriptor or a layout.
pub fn fragments<'a>(
    frame: &mut Frame<'a>,
    scene: &'a SceneOnDevice,
    gbuffer: &'a GBuffer,
    lists: &'a FragmentLists,
    strip: Strip,
    lod_bias: f32,
) -> Result<()> {
    // An empty raster pass clears the heads; a pass with draws exchanges them atomically and cannot clear them.
    let clear = Raster {
        name: "clear fragment lists",
        colors: vec![Some(ColorTarget { image: &lists.heads, clear: Some([u32::MAX; 4]) })],
        depth: None,
        origin: [0, 0],
        size: lists.size,
        rows: strip.rows,
    };
    let bind = fragments::Bind { heads: &lists.heads, counters: &lists.counters, nodes: &lists.nodes };
    let push = fragments::Push { lod_bias, strip: strip.index };
    frame.raster(&clear, &bind, &[], &push, Vec::new())?;
    let raster = Raster {
        name: "transparent fragments",
        colors: Vec::new(),
        depth: Some(DepthTarget { image: &gbuffer.depth, clear: false, write: false }),
        origin: [0, 0],
        size: lists.size,
        rows: strip.rows,
    };
    frame.raster(&raster, &bind, &scene.pages(), &push, scene.draws(true, false))
}
