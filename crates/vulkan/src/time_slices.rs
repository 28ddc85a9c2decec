//! Time-sliced submission: long dispatches are split so that a frame beside a window never blocks the queue for long.
//!
//! Read the Vulkan specification, chapters Dispatching Commands (`vkCmdDispatchBase`) and Command Buffers. Each pass is
//! submitted and waited for by itself. A long dispatch is submitted in pieces of workgroups: each piece has as many
//! groups as would take [`PIECE_MS`] at the measured time per group of the piece before. The host must know the number
//! of groups, so the arguments of an indirect dispatch are read back first.

use std::sync::atomic::Ordering;

use anyhow::{Context as _, Result};
use ash::vk;

use super::device::{Device, lock};
use super::memory::{Buffer, Place};
use super::recording::{
    ALL, Dispatch, DispatchPiece, Groups, Pass, RecordedWork, Recording, begin, label, record_barriers, submit, wait,
    write_first_timestamp,
};
use super::sync::Barrier;

/// Target duration of one submission in milliseconds.
const PIECE_MS: f64 = 10.0;
/// The first piece of a dispatch with unknown time per group is 1/32 of it.
const FIRST: u64 = 32;
/// Largest ratio of the groups of a piece to those of the piece before, which may have been fast by chance.
const GROWTH: f64 = 4.0;

impl Device {
    /// Abandons the frame within [`Device::interruptible`], now or the next time, until [`Device::resume`].
    pub fn interrupt(&self) {
        self.time_slices.interrupted.store(true, Ordering::Relaxed);
    }

    /// Cancels [`Device::interrupt`].
    pub fn resume(&self) {
        self.time_slices.interrupted.store(false, Ordering::Relaxed);
    }

    /// Draws frames that [`Device::interrupt`] may abandon between two pieces, under time-sliced submission. An
    /// abandoned frame ends with [`crate::Interrupted`].
    pub fn interruptible<T>(&self, draw: impl FnOnce() -> T) -> T {
        self.time_slices.interruptible.store(true, Ordering::Relaxed);
        let drawn = draw();
        self.time_slices.interruptible.store(false, Ordering::Relaxed);
        drawn
    }

    /// Number of dispatches so far that were split into more than one piece.
    #[must_use]
    pub fn cut(&self) -> u64 {
        self.time_slices.cut.load(Ordering::Relaxed)
    }
}

/// The next piece after `done` workgroups, of at least 1 and at most `most` groups: whole rows, or part of one row.
fn piece(groups: [u32; 3], done: u64, most: u64) -> DispatchPiece {
    let [across, down, _] = groups.map(u64::from);
    let (x, y, z) = (done % across, done / across % down, done / across / down);
    let rows = (most / across).min(down - y);
    let count = if x == 0 && rows > 0 { [across, rows, 1] } else { [most.clamp(1, across - x), 1, 1] };
    DispatchPiece { base: [x, y, z].map(|at| at as u32), count: count.map(|n| n as u32) }
}

impl Recording<'_> {
    /// Draws passes one after the other, each in its own submissions; milliseconds of each pass.
    ///
    /// # Safety
    /// Every handle of the passes is alive, and nothing else is recorded with the pool.
    pub(super) unsafe fn in_turns(&self, passes: Vec<Pass<'_>>, barriers: &[Vec<Barrier>]) -> Result<Vec<f64>> {
        let groups = Buffer::new(self.device, "groups", 12, Place::Readback)?;
        // SAFETY: the caller guarantees both conditions.
        passes.into_iter().zip(barriers).map(|(pass, barriers)| unsafe { self.draw(pass, barriers, &groups) }).collect()
    }

    /// Draws a pass; its GPU time in milliseconds.
    unsafe fn draw(&self, pass: Pass<'_>, barriers: &[Barrier], room: &Buffer) -> Result<f64> {
        let made = self.pipelines.wait_for(&pass.pipelines)?;
        // SAFETY: as for `in_turns`.
        unsafe {
            let first = |commands| {
                self.begun.set(self.begun.get() + 1);
                record_barriers(self.device, commands, barriers, self.targets, false);
            };
            let work = match pass.work {
                RecordedWork::Record(record) => {
                    return self.turn(&pass.name, first, |commands| record(self.device, commands, &made));
                }
                RecordedWork::Dispatch(work) => work,
            };
            let known = lock(&self.device.time_slices.paces).get(&pass.name).copied();
            let groups = match work.groups {
                Groups::Count(groups) => groups,
                Groups::At(sizes, offset) => self.read_groups(sizes, offset, room)?,
            };
            self.pieces(&pass.name, &work, made[0], groups, known, first)
        }
    }

    /// Submits a dispatch in pieces; its GPU time in milliseconds.
    unsafe fn pieces(
        &self,
        name: &str,
        work: &Dispatch<'_>,
        pipeline: vk::Pipeline,
        groups: [u32; 3],
        known: Option<f64>,
        first: impl Fn(vk::CommandBuffer),
    ) -> Result<f64> {
        let all: u64 = groups.into_iter().map(u64::from).product();
        let mut most = known.filter(|ms| *ms > 0.0).map_or(all.div_ceil(FIRST) as f64, |ms| PIECE_MS / ms);
        let (mut done, mut total) = (0, 0.0);
        // A dispatch without groups is still submitted once, for its barriers.
        while done < all || done == 0 {
            let part = piece(groups.map(|n| n.max(1)), done, (most as u64).max(1));
            let count: u64 = if all == 0 { 0 } else { part.count.into_iter().map(u64::from).product() };
            let before = |commands| match done {
                0 => first(commands),
                // SAFETY: the command buffer is recording.
                _ => unsafe { after_all(self.device, commands) },
            };
            let record = |commands| {
                if count > 0 {
                    // SAFETY: the caller of `in_turns` keeps all handles alive.
                    unsafe { work.record(self.device, commands, pipeline, Some(part)) };
                }
            };
            // SAFETY: as above.
            let ms = unsafe { self.turn(name, before, record)? };
            total += ms;
            if count == 0 {
                break;
            }
            self.device.time_slices.cut.fetch_add(u64::from(done == 0 && count < all), Ordering::Relaxed);
            done += count;
            most = (PIECE_MS * count as f64 / ms.max(1e-9)).min(GROWTH * count as f64);
        }
        // The mean, not the last piece: some part is always cheap, and the next frame may begin with an expensive one.
        lock(&self.device.time_slices.paces).insert(name.to_owned(), total / all.max(1) as f64);
        Ok(total)
    }

    /// Submits commands once and waits for them; their GPU time in milliseconds.
    unsafe fn turn(
        &self,
        name: &str,
        before: impl FnOnce(vk::CommandBuffer),
        record: impl FnOnce(vk::CommandBuffer),
    ) -> Result<f64> {
        let (device, raw, timed) = (self.device, &self.device.raw, self.queries != vk::QueryPool::null());
        device.time_slices.go_on()?;
        // SAFETY: the command buffer is recorded here and waited for before it is freed.
        unsafe {
            let commands = begin(device, self.from)?;
            if timed {
                raw.cmd_reset_query_pool(commands, self.queries, 0, 2);
            }
            before(commands);
            label(device, commands, Some(name));
            if timed {
                write_first_timestamp(device, commands, self.queries, 0);
            }
            record(commands);
            if timed {
                raw.cmd_write_timestamp2(commands, ALL, self.queries, 1);
            }
            label(device, commands, None);
            let submitted = submit(device, commands);
            let waited = wait(device).with_context(|| format!("waiting for the pass {name}"));
            raw.free_command_buffers(self.from, &[commands]);
            submitted.and(waited)?;
            let mut ticks = [0_u64; 2];
            if timed {
                let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
                raw.get_query_pool_results(self.queries, 0, &mut ticks, flags).context("reading timestamps")?;
            }
            let period = f64::from(device.limits.timestamp_period) * 1e-6;
            Ok(ticks[1].saturating_sub(ticks[0]) as f64 * period)
        }
    }

    /// Reads back the workgroup count of an indirect dispatch.
    unsafe fn read_groups(&self, sizes: &Buffer, offset: u64, room: &Buffer) -> Result<[u32; 3]> {
        let copy = |commands| {
            let region = vk::BufferCopy { src_offset: offset, dst_offset: 0, size: 12 };
            let to_host = vk::MemoryBarrier2::default()
                .src_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER)
                .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
                .dst_stage_mask(vk::PipelineStageFlags2::HOST)
                .dst_access_mask(vk::AccessFlags2::HOST_READ);
            // SAFETY: the command buffer is recording; both buffers are alive.
            unsafe {
                self.device.raw.cmd_copy_buffer(commands, sizes.raw, room.raw, &[region]);
                let info = [to_host];
                let info = vk::DependencyInfo::default().memory_barriers(&info);
                self.device.raw.cmd_pipeline_barrier2(commands, &info);
            }
        };
        // SAFETY: the caller of `in_turns` keeps all handles alive.
        unsafe { self.turn("how many groups", |commands| after_all(self.device, commands), copy)? };
        let words: Vec<u32> = room.read(|bytes| bytemuck::pod_collect_to_vec(&bytes[..12]));
        Ok([words[0], words[1], words[2]])
    }
}

/// Makes all earlier writes available to all later commands.
unsafe fn after_all(device: &Device, commands: vk::CommandBuffer) {
    let all = [vk::MemoryBarrier2::default()
        .src_stage_mask(ALL)
        .src_access_mask(vk::AccessFlags2::MEMORY_WRITE)
        .dst_stage_mask(ALL)
        .dst_access_mask(vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE)];
    // SAFETY: the command buffer is recording.
    unsafe { device.raw.cmd_pipeline_barrier2(commands, &vk::DependencyInfo::default().memory_barriers(&all)) };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_every_group_once() {
        for groups in [[1, 1, 1], [7, 1, 1], [5, 4, 1], [3, 2, 5], [65_535, 3, 1]] {
            let all: u64 = groups.into_iter().map(u64::from).product();
            for most in [1, 2, 3, 5, 7, 20, 1 << 20] {
                if all / most > 10_000 {
                    continue;
                }
                let mut seen = vec![false; all as usize];
                let mut done = 0;
                while done < all {
                    let DispatchPiece { base, count } = piece(groups, done, most);
                    let size: u64 = count.into_iter().map(u64::from).product();
                    assert!((1..=most).contains(&size), "{groups:?} {done} {most}: {count:?}");
                    for z in base[2]..base[2] + count[2] {
                        for y in base[1]..base[1] + count[1] {
                            for x in base[0]..base[0] + count[0] {
                                assert!(x < groups[0] && y < groups[1] && z < groups[2], "{base:?} {count:?}");
                                let at =
                                    x as usize + groups[0] as usize * (y as usize + groups[1] as usize * z as usize);
                                assert!(!std::mem::replace(&mut seen[at], true), "twice");
                            }
                        }
                    }
                    done += size;
                }
                assert!(seen.into_iter().all(|seen| seen), "{groups:?} {most}");
            }
        }
    }
}
