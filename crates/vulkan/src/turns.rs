//! A frame beside a window: no submission is long, so that whoever moves the view waits for a piece of a pass and not for all of it.
//!
//! Each pass is submitted and waited for by itself, and a dispatch that takes long in pieces: groups of invocations one after the
//! other, as many at a time as took [`PIECE_MS`] by the pace of the piece before. What the host must know for that, how many
//! groups a dispatch has whose number the device wrote, is read back first.

use std::sync::atomic::Ordering;

use anyhow::{Context as _, Result};
use ash::vk;

use super::device::{Device, lock};
use super::memory::{Buffer, Place};
use super::recording::{
    ALL, Dispatch, Groups, Pass, Piece, Recording, Work, begin, label, record_barriers, submit, wait,
    write_first_timestamp,
};
use super::sync::Barrier;

/// Milliseconds that one submission aims at.
const PIECE_MS: f64 = 10.0;
/// Of a dispatch whose pace nobody knows yet, the first piece is this part.
const FIRST: u64 = 32;
/// A piece has at most so many times the groups of the one before: that one may have been quick by chance.
const GROWTH: f64 = 4.0;

impl Device {
    /// Gives up what is drawn within [`Device::interruptible`], now or the next time, until [`Device::resume`].
    pub fn interrupt(&self) {
        self.turns.interrupted.store(true, Ordering::Relaxed);
    }

    /// Takes [`Device::interrupt`] back.
    pub fn resume(&self) {
        self.turns.interrupted.store(false, Ordering::Relaxed);
    }

    /// Draws frames that may be given up between two pieces, where the device takes turns: they end with [`crate::Interrupted`].
    pub fn interruptible<T>(&self, draw: impl FnOnce() -> T) -> T {
        self.turns.interruptible.store(true, Ordering::Relaxed);
        let drawn = draw();
        self.turns.interruptible.store(false, Ordering::Relaxed);
        drawn
    }

    /// Dispatches so far that were drawn in more than one piece.
    #[must_use]
    pub fn cut(&self) -> u64 {
        self.turns.cut.load(Ordering::Relaxed)
    }
}

/// The piece of at most `most` groups, and at least one, that comes after `done` of them: whole rows, or part of one.
fn piece(groups: [u32; 3], done: u64, most: u64) -> Piece {
    let [across, down, _] = groups.map(u64::from);
    let (x, y, z) = (done % across, done / across % down, done / across / down);
    let rows = (most / across).min(down - y);
    let count = if x == 0 && rows > 0 { [across, rows, 1] } else { [most.clamp(1, across - x), 1, 1] };
    Piece { base: [x, y, z].map(|at| at as u32), count: count.map(|n| n as u32) }
}

impl Recording<'_> {
    /// Draws passes one after the other; the milliseconds of each.
    ///
    /// # Safety
    /// Every handle of the passes is alive, and nothing else is recorded with the pool.
    pub(super) unsafe fn in_turns(&self, passes: Vec<Pass<'_>>, barriers: &[Vec<Barrier>]) -> Result<Vec<f64>> {
        let groups = Buffer::new(self.device, "groups", 12, Place::Readback)?;
        // SAFETY: as the caller says.
        passes.into_iter().zip(barriers).map(|(pass, barriers)| unsafe { self.draw(pass, barriers, &groups) }).collect()
    }

    /// Draws a pass; its GPU milliseconds.
    unsafe fn draw(&self, pass: Pass<'_>, barriers: &[Barrier], room: &Buffer) -> Result<f64> {
        let made = self.pipelines.wait_for(&pass.pipelines)?;
        // SAFETY: as the caller says.
        unsafe {
            let first = |commands| {
                self.begun.set(self.begun.get() + 1);
                record_barriers(self.device, commands, barriers, self.targets, false);
            };
            let work = match pass.work {
                Work::Record(record) => {
                    return self.turn(&pass.name, first, |commands| record(self.device, commands, &made));
                }
                Work::Dispatch(work) => work,
            };
            let known = lock(&self.device.turns.paces).get(&pass.name).copied();
            let groups = match work.groups {
                Groups::Count(groups) => groups,
                Groups::At(sizes, offset) => self.read_groups(sizes, offset, room)?,
            };
            self.pieces(&pass.name, &work, made[0], groups, known, first)
        }
    }

    /// A dispatch in as many pieces as it takes.
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
        // Barriers count, too, where there is nothing to do.
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
                    // SAFETY: as the caller says.
                    unsafe { work.record(self.device, commands, pipeline, Some(part)) };
                }
            };
            // SAFETY: as the caller says.
            let ms = unsafe { self.turn(name, before, record)? };
            total += ms;
            if count == 0 {
                break;
            }
            self.device.turns.cut.fetch_add(u64::from(done == 0 && count < all), Ordering::Relaxed);
            done += count;
            most = (PIECE_MS * count as f64 / ms.max(1e-9)).min(GROWTH * count as f64);
        }
        // The mean: some part is always cheap, and the next frame may begin with one that is not.
        lock(&self.device.turns.paces).insert(name.to_owned(), total / all.max(1) as f64);
        Ok(total)
    }

    /// One submission, waited for; its GPU milliseconds.
    unsafe fn turn(
        &self,
        name: &str,
        before: impl FnOnce(vk::CommandBuffer),
        record: impl FnOnce(vk::CommandBuffer),
    ) -> Result<f64> {
        let (device, raw, timed) = (self.device, &self.device.raw, self.queries != vk::QueryPool::null());
        device.turns.go_on()?;
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

    /// The number of groups that the device wrote.
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
        // SAFETY: as the caller says.
        unsafe { self.turn("how many groups", |commands| after_all(self.device, commands), copy)? };
        let words: Vec<u32> = room.read(|bytes| bytemuck::pod_collect_to_vec(&bytes[..12]));
        Ok([words[0], words[1], words[2]])
    }
}

/// What was written before is seen by what comes.
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
                    let Piece { base, count } = piece(groups, done, most);
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
