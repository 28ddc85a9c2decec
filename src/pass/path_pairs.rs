//! Path tracing on CPUs: one dispatch per bounce over a queue of pixels, two paths per invocation, with stream
//! compaction in between that keeps the order (shaders/pass/path.comp).
//!
//! Read Harris, Sengupta and Owens, GPU Gems 3, chapter 39 (2007), and docs/decisions/paths.md.

use std::sync::Arc;

use anyhow::Result;

use super::lighting::Lighting;
use super::path_states::{PathStates, words};
use super::rows::rows_of;
use crate::gpu::{Buffer, Device, Frame, Image, IndirectGroups, Place};
use crate::shader::lib::queue::{CHUNK, PATHS_IN_GROUP};
use crate::shader::{path, queue_count, queue_next, queue_scan};
use crate::share::{QueueSize, WorkSize};

const SIZE_BYTES: u64 = size_of::<QueueSize>() as u64;
const CHUNKS_AT: u64 = std::mem::offset_of!(QueueSize, chunks) as u64;

/// Queues of even and odd bounces, with the sizes of their dispatches.
pub struct PathPairs {
    queues: [Buffer; 2],
    sizes: [Buffer; 2],
    first_size: Buffer,
    chunks: Buffer,
}

impl PathPairs {
    /// Queues of up to `places` paths.
    pub(super) fn new(device: &Arc<Device>, places: u32) -> Result<Self> {
        let queue = || words(device, "queue of paths", true, u64::from(places));
        let queue_size = || Buffer::new(device, "queue size", SIZE_BYTES, Place::Device);
        let [groups, rows, _] = rows_of(places.div_ceil(PATHS_IN_GROUP));
        let [chunk_groups, chunk_rows, _] =
            rows_of(places.div_ceil(CHUNK).div_ceil(queue_count::PROGRAM.local_size[0]));
        let first_size = QueueSize {
            paths: WorkSize { x: groups, y: rows, z: 1, count: places },
            chunks: WorkSize { x: chunk_groups, y: chunk_rows, z: 1, count: 0 },
        };
        Ok(Self {
            queues: [queue()?, queue()?],
            sizes: [queue_size()?, queue_size()?],
            first_size: Buffer::with_data(device, "first queue size", &[first_size])?,
            chunks: words(device, "chunks of a queue", true, u64::from(places.div_ceil(CHUNK)))?,
        })
    }

    /// Resets the size of the first queue; returns the queue.
    pub(super) fn first<'a>(&'a self, frame: &mut Frame<'a>) -> &'a Buffer {
        frame.copy_buffer("reset queue size", &self.first_size, &self.sizes[0], SIZE_BYTES);
        &self.queues[0]
    }

    /// All bounces; a path that ends writes its light.
    pub(super) fn bounces<'a>(
        &'a self,
        frame: &mut Frame<'a>,
        lighting: &Lighting<'a>,
        states: &'a PathStates,
        radiance: &'a Image,
    ) -> Result<()> {
        let (library, interfaces) = (lighting.library, lighting.plan.rays.unwrap_or_default().interfaces);
        let width = states.width;
        for bounce in 0..interfaces + 1 {
            let [from, to] = if bounce % 2 == 0 { [0, 1] } else { [1, 0] };
            let (queue, sizes) = (&self.queues[from], &self.sizes[from]);
            let groups = IndirectGroups { sizes, offset: 0, most: u64::from(states.places.div_ceil(PATHS_IN_GROUP)) };
            let bind = path::Bind { path_state: states.bind(), radiance, queue, sizes };
            frame.compute_indirect("paths", &bind, &path::Constants { library }, &path::Push { width }, groups)?;
            if bounce < interfaces {
                self.compact(frame, states.places, from, to)?;
            }
        }
        Ok(())
    }

    /// Stream compaction: the next queue holds the paths that are not terminated, in the same order. Three dispatches:
    /// count per chunk, prefix sum (scan) over the chunks, scatter.
    fn compact<'a>(&'a self, frame: &mut Frame<'a>, places: u32, from: usize, to: usize) -> Result<()> {
        let (queue, sizes, chunks) = (&self.queues[from], &self.sizes[from], &self.chunks);
        let chunk_groups = places.div_ceil(CHUNK).div_ceil(queue_count::PROGRAM.local_size[0]);
        let groups = IndirectGroups { sizes, offset: CHUNKS_AT, most: u64::from(chunk_groups) };
        let bind = queue_count::Bind { queue, sizes, chunks };
        frame.compute_indirect("queue count", &bind, &queue_count::Constants {}, &(), groups)?;
        let bind = queue_scan::Bind { sizes, chunks, next_sizes: &self.sizes[to] };
        frame.compute("queue prefix sum", &bind, &queue_scan::Constants {}, &(), [1, 1, 1])?;
        let bind = queue_next::Bind { queue, sizes, chunks, next_queue: &self.queues[to] };
        frame.compute_indirect("queue scatter", &bind, &queue_next::Constants {}, &(), groups)
    }
}
