//! Wavefront path tracing: one dispatch per bounce over a queue of pixels, with stream compaction in between
//! (shaders/pass/path.comp); or all bounces in one dispatch (path_at_once.comp), for comparison in tests.
//!
//! Read pbrt (4th ed.), chapter 15 (wavefront rendering) and sections 13.2 to 13.4; Laine, Karras and Aila 2013,
//! "Megakernels Considered Harmful"; docs/decisions/paths.md. Estimates use next event estimation with multiple
//! importance sampling.

use std::sync::Arc;

use anyhow::Result;

use super::lighting::Lighting;
use super::rows::{TileShare, rows_of, stride};
use crate::gpu::{Buffer, Device, Frame, Image, NOTHING, Place};
use crate::plan::{Paths, Plan};
use crate::shader::lib::queue::{CHUNK, PATHS_IN_GROUP};
use crate::shader::{lib, path, path_at_once, path_begin, queue_count, queue_next, queue_scan};
use crate::share::{QueueSize, WorkSize};

/// Pixels per tile; the first queue consists of whole tiles.
const TILE: u32 = lib::work_tile::WORK_TILE * lib::work_tile::WORK_TILE;
const SIZE_BYTES: u64 = size_of::<QueueSize>() as u64;
const CHUNKS_AT: u64 = std::mem::offset_of!(QueueSize, chunks) as u64;

/// Size of the picture, and the share of its tiles that is drawn.
type Pixels = ([u32; 2], TileShare);

/// State of all paths between two dispatches.
pub struct PathsOnDevice {
    /// Settings of path tracing.
    pub with: Paths,
    states: [Buffer; 6],
    queues: [Buffer; 2],
    sizes: [Buffer; 2],
    first_size: Buffer,
    chunks: Buffer,
    places: u32,
    width: u32,
}

impl PathsOnDevice {
    /// Buffers for a share of a picture of `size` pixels.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, with: Paths, plan: &Plan, touching: bool, pixels: Pixels) -> Result<Self> {
        let (size, share) = pixels;
        let rays = plan.rays.unwrap_or_default();
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        // All pixels of the tiles, including those outside of the picture.
        let places = share.tiles(size) * TILE;
        let words = |name, wanted: bool, words: u64| match wanted {
            true => Buffer::new(device, name, 4 * words, Place::Device),
            false => Buffer::new(device, NOTHING, 0, Place::Device),
        };
        let queue = || words("queue of paths", true, u64::from(places));
        let queue_size = || Buffer::new(device, "queue size", SIZE_BYTES, Place::Device);
        let [groups, rows, _] = rows_of(places.div_ceil(PATHS_IN_GROUP));
        let [chunk_groups, chunk_rows, _] =
            rows_of(places.div_ceil(CHUNK).div_ceil(queue_count::PROGRAM.local_size[0]));
        let first_size = QueueSize {
            paths: WorkSize { x: groups, y: rows, z: 1, count: places },
            chunks: WorkSize { x: chunk_groups, y: chunk_rows, z: 1, count: 0 },
        };
        Ok(Self {
            with,
            states: [
                words("origins of paths", true, 4 * pixels)?,
                words("directions of paths", true, 4 * pixels)?,
                words("throughputs of paths", true, 4 * pixels)?,
                words("light of paths", true, 4 * pixels)?,
                words("media of paths", rays.transmissive, 4 * pixels)?,
                words("what paths are after", touching, pixels)?,
            ],
            queues: [queue()?, queue()?],
            sizes: [queue_size()?, queue_size()?],
            first_size: Buffer::with_data(device, "first queue size", &[first_size])?,
            chunks: words("chunks of a queue", true, u64::from(places.div_ceil(CHUNK)))?,
            places,
            width: size[0],
        })
    }

    fn state(&self) -> lib::path_state::Bind<'_> {
        let [origins, directions, throughputs, sums, media, t_mins] = &self.states;
        lib::path_state::Bind { origins, directions, throughputs, sums, media, t_mins }
    }
}

/// Records one sample of every pixel into `radiance`.
///
/// # Errors
/// When the driver refuses what a pipeline binds.
pub fn paths<'a>(
    frame: &mut Frame<'a>,
    lighting: &Lighting<'a>,
    paths: &'a PathsOnDevice,
    radiance: &'a Image,
) -> Result<()> {
    let (library, interfaces) = (lighting.library, lighting.plan.rays.unwrap_or_default().interfaces);
    let (places, tiles, stride) = (paths.places, paths.places / TILE, stride(paths.places / TILE));
    if paths.with.at_once {
        let push = path_at_once::Push { places, stride };
        let groups = rows_of(places.div_ceil(PATHS_IN_GROUP));
        let bind = path_at_once::Bind { radiance };
        return frame.compute("paths at once", &bind, &path_at_once::Constants { library }, &push, groups);
    }
    frame.copy_buffer("reset queue size", &paths.first_size, &paths.sizes[0], SIZE_BYTES);
    let bind = path_begin::Bind { path_state: paths.state(), queue: &paths.queues[0] };
    let push = path_begin::Push { places, stride };
    frame.compute("camera rays", &bind, &path_begin::Constants { library }, &push, rows_of(tiles))?;
    for bounce in 0..interfaces + 1 {
        let [from, to] = if bounce % 2 == 0 { [0, 1] } else { [1, 0] };
        let sizes = &paths.sizes[from];
        let bind = path::Bind { path_state: paths.state(), radiance, queue: &paths.queues[from], sizes };
        let push = path::Push { width: paths.width };
        frame.compute_indirect("paths", &bind, &path::Constants { library }, &push, sizes, 0)?;
        if bounce < interfaces {
            compact(frame, paths, from, to)?;
        }
    }
    Ok(())
}

/// Stream compaction: the next queue holds the paths that are not terminated, in the same order. Three dispatches:
/// count per chunk, prefix sum (scan) over the chunks, scatter.
fn compact<'a>(frame: &mut Frame<'a>, paths: &'a PathsOnDevice, from: usize, to: usize) -> Result<()> {
    let (queue, sizes, chunks) = (&paths.queues[from], &paths.sizes[from], &paths.chunks);
    let bind = queue_count::Bind { queue, sizes, chunks };
    frame.compute_indirect("queue count", &bind, &queue_count::Constants {}, &(), sizes, CHUNKS_AT)?;
    let bind = queue_scan::Bind { sizes, chunks, next_sizes: &paths.sizes[to] };
    frame.compute("queue prefix sum", &bind, &queue_scan::Constants {}, &(), [1, 1, 1])?;
    let bind = queue_next::Bind { queue, sizes, chunks, next_queue: &paths.queues[to] };
    frame.compute_indirect("queue scatter", &bind, &queue_next::Constants {}, &(), sizes, CHUNKS_AT)
}
