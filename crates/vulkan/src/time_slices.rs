//! Time-sliced submission: a frame is as few submissions as are short, so that a window's queue is never blocked for
//! long and no operating system resets a GPU.
//!
//! Read the Vulkan specification, chapters Dispatching Commands (`vkCmdDispatchBase`) and Command Buffers. Passes whose
//! time is known are recorded into one submission as long as they take no longer than a slice together, by their times
//! in the frame before, and no longer than [`LONGEST_MS`] if every indirect dispatch had the most workgroups that it
//! can have. A pass that is unknown or longer is submitted and waited for by itself; a long dispatch in pieces of
//! workgroups: each piece has as many groups as would take a slice at the measured time per group of the piece before.
//! The host must know the number of groups of such a dispatch, so the arguments of an indirect one are read back first.
//! Dispatches that the host repeats ([`super::Frame::repeat`]) are submissions of their own on every device.

use std::collections::HashMap;
use std::sync::atomic::Ordering;
use std::time::Instant;

use anyhow::{Context as _, Result};
use ash::vk;

use super::device::{Device, lock};
use super::memory::{Buffer, Place};
use super::pace::{OF_FRAME, PassPace};
use super::recording::{
    ALL, Dispatch, DispatchPiece, Groups, IndirectGroups, Pass, REPEATED, RecordedWork, Recording, Repeat, begin,
    label, record_barriers, submit, wait, write_first_timestamp,
};
use super::sync::Barrier;

/// Most milliseconds that a submission of whole passes may take.
const LONGEST_MS: f64 = 200.0;
/// The first piece of a dispatch with unknown time per group is 1/32 of it, and at most 64 groups, each of which then
/// has 3 ms before the piece takes longer than [`LONGEST_MS`].
const FIRST: u64 = 32;
const FIRST_MOST: u64 = 64;
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

    /// Number of submissions so far that the host waited for, under time-sliced submission.
    #[must_use]
    pub fn turns(&self) -> u64 {
        self.time_slices.turns.load(Ordering::Relaxed)
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

/// Whole passes in one command buffer that is being recorded.
struct Batch {
    commands: vk::CommandBuffer,
    /// Passes in it, by index in the frame.
    passes: Vec<usize>,
    expected: PassEstimate,
}

/// How long a pass will take, in milliseconds.
#[derive(Clone, Copy, Default)]
struct PassEstimate {
    /// As its times in the frame before say.
    ms: f64,
    /// If it has the most workgroups, each [`GROWTH`] times as expensive.
    most_ms: f64,
}

impl std::ops::Add for PassEstimate {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { ms: self.ms + other.ms, most_ms: self.most_ms + other.most_ms }
    }
}

impl PassEstimate {
    /// The `occurrence`th pass of a name in a frame, by what passes of this name took; `None` where that is unknown.
    fn of(pass: &Pass<'_>, occurrence: usize, pace: Option<&PassPace>) -> Option<Self> {
        let pace = pace?;
        let ms = *pace.last_ms.get(occurrence)?;
        let most = match &pass.work {
            RecordedWork::Dispatch(Dispatch { groups: Groups::Indirect(groups), .. }) if pace.per_group_ms > 0.0 => {
                pace.per_group_ms * groups.most as f64
            }
            RecordedWork::Dispatch(Dispatch { groups: Groups::Indirect(_), .. }) | RecordedWork::Repeat(_) => {
                return None;
            }
            _ => ms,
        };
        Some(Self { ms, most_ms: GROWTH * most.max(ms) })
    }

    fn fits(self, slice_ms: f64) -> bool {
        self.ms <= slice_ms && self.most_ms <= LONGEST_MS
    }
}

/// Milliseconds of repeated dispatches, once each, if every one has as many workgroups as it can have, at most
/// `most`; `None` where that is not known or where one takes longer than a slice. A dispatch whose groups the host
/// counts is one of few groups.
fn longest_ms(body: &[Dispatch<'_>], per_group_ms: &[Option<f64>], most: u64, slice_ms: f64) -> Option<f64> {
    let mut sum = 0.0;
    for (i, dispatch) in body.iter().enumerate() {
        if let Groups::Indirect(groups) = dispatch.groups {
            let ms = per_group_ms.get(i).copied().flatten()? * groups.most.min(most) as f64;
            if ms > slice_ms {
                return None;
            }
            sum += ms;
        }
    }
    Some(sum)
}

/// How often repeated dispatches are recorded into one submission. `slice`: milliseconds that it may take, and of the
/// dispatches if each has the most workgroups; `None` where no submission is too long. `last`: how often they were in
/// the submission before, and milliseconds of one time. `left`: how often they are still needed if it is as in the
/// frame before.
fn together(slice: Option<(f64, f64)>, last: Option<(usize, f64)>, left: usize) -> usize {
    let guess = if left > 0 { left } else { last.map_or(1, |(count, _)| 2 * count) };
    let Some((slice_ms, longest_ms)) = slice else { return guess };
    let grown = last.map_or(f64::INFINITY, |(count, _)| GROWTH * count as f64);
    let fit = slice_ms / last.map_or(longest_ms, |(_, ms)| ms.min(longest_ms)).max(1e-3);
    guess.min(fit.min(grown).min(LONGEST_MS / longest_ms.max(1e-3)) as usize).max(1)
}

/// Time of a submission in milliseconds.
struct Took {
    /// Between timestamps, or by the host's clock where the device has none.
    ms: f64,
    /// By the host's clock, with the way to the device and back.
    whole_ms: f64,
}

impl Took {
    /// The host's clock where that is too long for timestamps to be believed: some drivers report 0.
    fn believed_ms(&self) -> f64 {
        if self.whole_ms > LONGEST_MS && self.ms < 0.5 * self.whole_ms { self.whole_ms } else { self.ms }
    }
}

/// The counts of an indirect dispatch, copied beside the passes of a batch: three words each.
const GROUPS_BYTES: u64 = 12;
/// Where those of [`Repeat::left`] are copied, when no batch is open.
const LEFT_AT: [u64; 2] = [0, GROUPS_BYTES];

impl Recording<'_> {
    /// Draws passes one after the other, in submissions of about a slice; milliseconds of each pass.
    ///
    /// # Safety
    /// Every handle of the passes is alive, and nothing else is recorded with the pool.
    pub(super) unsafe fn in_turns(&self, passes: Vec<Pass<'_>>, barriers: &[Vec<Barrier>]) -> Result<Vec<f64>> {
        let mut drawn = Drawn { ms: vec![None; passes.len()], names: Vec::new(), groups: Vec::new() };
        // SAFETY: the caller guarantees both conditions.
        let outcome = unsafe { self.draw_all(passes, barriers, &mut drawn) };
        // What an abandoned frame has drawn is known, too.
        drawn.remember(&mut lock(&self.device.time_slices.paces));
        outcome?;
        Ok(drawn.ms.into_iter().map(Option::unwrap_or_default).collect())
    }

    unsafe fn draw_all(&self, passes: Vec<Pass<'_>>, barriers: &[Vec<Barrier>], drawn: &mut Drawn) -> Result<()> {
        let slice_ms = self.device.time_slices.slice_ms.unwrap_or(LONGEST_MS);
        let room =
            Buffer::new(self.device, OF_FRAME, GROUPS_BYTES * passes.len().max(LEFT_AT.len()) as u64, Place::Readback)?;
        let mut seen: HashMap<String, usize> = HashMap::new();
        let mut batch: Option<Batch> = None;
        for (index, (pass, barriers)) in passes.into_iter().zip(barriers).enumerate() {
            let occurrence = seen.entry(pass.name.clone()).or_default();
            let expected = PassEstimate::of(&pass, *occurrence, lock(&self.device.time_slices.paces).get(&pass.name));
            *occurrence += 1;
            drawn.names.push((pass.name.clone(), *occurrence - 1));
            drawn.groups.push(None);
            let whole = match (&pass.work, self.device.time_slices.slice_ms) {
                (RecordedWork::Repeat(_), _) => None,
                // Validation finds hazards only within one command buffer: all that can be is in one.
                (_, None) => Some(PassEstimate::default()),
                // Without timestamps only a pass by itself has a time.
                (_, Some(_)) => expected.filter(|it| self.queries != vk::QueryPool::null() && it.fits(slice_ms)),
            };
            // SAFETY: the caller guarantees both conditions; a batch is submitted before this function returns, or
            // freed.
            unsafe {
                let fits = |batch: &Batch| whole.is_some_and(|whole| (batch.expected + whole).fits(slice_ms));
                if batch.as_ref().is_some_and(|batch| !fits(batch)) {
                    self.finish_batch(batch.take(), &room, drawn)?;
                }
                match whole {
                    Some(whole) => {
                        let mut open = match batch.take() {
                            Some(open) => open,
                            None => self.begin_batch()?,
                        };
                        if let Err(error) = self.record_whole(pass, barriers, index, open.commands, &room, drawn) {
                            self.device.raw.free_command_buffers(self.from, &[open.commands]);
                            return Err(error);
                        }
                        open.expected = open.expected + whole;
                        open.passes.push(index);
                        batch = Some(open);
                    }
                    None => {
                        let ms = self.draw(pass, barriers, &room, drawn, index)?;
                        drawn.ms[index] = Some(ms);
                    }
                }
            }
        }
        // SAFETY: as above.
        unsafe { self.finish_batch(batch, &room, drawn) }
    }

    unsafe fn begin_batch(&self) -> Result<Batch> {
        self.device.time_slices.go_on()?;
        // SAFETY: the caller submits or frees the command buffer.
        unsafe {
            let commands = begin(self.device, self.from)?;
            Ok(Batch { commands, passes: Vec::new(), expected: PassEstimate::default() })
        }
    }

    /// Records a whole pass into the command buffer of a batch.
    unsafe fn record_whole(
        &self,
        pass: Pass<'_>,
        barriers: &[Barrier],
        index: usize,
        commands: vk::CommandBuffer,
        room: &Buffer,
        drawn: &mut Drawn,
    ) -> Result<()> {
        let made = self.pipelines.wait_for(&pass.pipelines)?;
        let (query, timed) = (2 * index as u32, self.queries != vk::QueryPool::null());
        // SAFETY: the command buffer is recording; the caller of `in_turns` keeps all handles alive.
        unsafe {
            if timed {
                self.device.raw.cmd_reset_query_pool(commands, self.queries, query, 2);
            }
            record_barriers(self.device, commands, barriers, self.targets, self.without_barriers);
            if let RecordedWork::Dispatch(Dispatch { groups, .. }) = &pass.work {
                drawn.groups[index] = match groups {
                    Groups::Count(groups) => Some(Known::Now(groups.iter().map(|&n| u64::from(n)).product())),
                    // The barriers of the copy would hide missing ones from validation.
                    Groups::Indirect(_) if self.device.time_slices.slice_ms.is_none() => None,
                    Groups::Indirect(groups) => {
                        self.copy_groups(commands, *groups, room, GROUPS_BYTES * index as u64);
                        Some(Known::InRoom)
                    }
                };
            }
            label(self.device, commands, Some(&pass.name));
            if timed {
                write_first_timestamp(self.device, commands, self.queries, query);
            }
            match pass.work {
                RecordedWork::Record(record) => record(self.device, commands, &made),
                RecordedWork::Dispatch(work) => work.record(self.device, commands, made[0], None),
                RecordedWork::Repeat(_) => unreachable!("{REPEATED}"),
            }
            if timed {
                self.device.raw.cmd_write_timestamp2(commands, ALL, self.queries, query + 1);
            }
            label(self.device, commands, None);
        }
        Ok(())
    }

    /// Submits a batch and waits for it.
    unsafe fn finish_batch(&self, batch: Option<Batch>, room: &Buffer, drawn: &mut Drawn) -> Result<()> {
        let Some(Batch { commands, passes, .. }) = batch else { return Ok(()) };
        let (device, raw) = (self.device, &self.device.raw);
        let start = Instant::now();
        // SAFETY: the command buffer is waited for before it is freed.
        unsafe {
            to_host(device, commands);
            let submitted = submit(device, commands);
            if submitted.is_ok() {
                self.begun.set(self.begun.get() + passes.len());
            }
            let waited = wait(device).with_context(|| {
                let names: Vec<&str> = passes.iter().map(|&index| drawn.names[index].0.as_str()).collect();
                format!("waiting for the passes {}", names.join(", "))
            });
            raw.free_command_buffers(self.from, &[commands]);
            submitted.and(waited)?;
        }
        device.time_slices.turns.fetch_add(1, Ordering::Relaxed);
        let whole_ms = start.elapsed().as_secs_f64() * 1e3;
        let times = passes.iter().map(|&index| self.ms_between(2 * index as u32)).collect::<Result<Vec<f64>>>()?;
        let took = Took { ms: times.iter().sum(), whole_ms };
        let missing = (took.believed_ms() - took.ms) / passes.len() as f64;
        for (index, ms) in passes.into_iter().zip(times) {
            drawn.ms[index] = Some(ms + missing);
            if let Some(known @ Known::InRoom) = &mut drawn.groups[index] {
                *known = Known::Now(read_product(room, GROUPS_BYTES * index as u64));
            }
        }
        Ok(())
    }

    /// Milliseconds between two timestamps that have been written; 0 on a device without timestamps.
    fn ms_between(&self, query: u32) -> Result<f64> {
        if self.queries == vk::QueryPool::null() {
            return Ok(0.0);
        }
        let mut ticks = [0_u64; 2];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: the pool has both queries, whose commands have executed.
        unsafe { self.device.raw.get_query_pool_results(self.queries, query, &mut ticks, flags) }
            .context("reading timestamps")?;
        Ok(self.device.ms_between(ticks[0], ticks[1]))
    }

    /// Draws a pass by itself; its time in milliseconds.
    unsafe fn draw(
        &self,
        pass: Pass<'_>,
        barriers: &[Barrier],
        room: &Buffer,
        drawn: &mut Drawn,
        index: usize,
    ) -> Result<f64> {
        let made = self.pipelines.wait_for(&pass.pipelines)?;
        // SAFETY: as for `in_turns`.
        unsafe {
            let first = |commands| {
                self.begun.set(self.begun.get() + 1);
                record_barriers(self.device, commands, barriers, self.targets, self.without_barriers);
            };
            let work = match pass.work {
                RecordedWork::Record(record) => {
                    let took = self.turn(&pass.name, first, |commands| record(self.device, commands, &made))?;
                    return Ok(took.ms);
                }
                RecordedWork::Repeat(work) => return self.repeated(&pass.name, &work, &made, room, first),
                RecordedWork::Dispatch(work) => work,
            };
            let known = lock(&self.device.time_slices.paces).get(&pass.name).map(|pace| pace.per_group_ms);
            let groups = match work.groups {
                Groups::Count(groups) => groups,
                Groups::Indirect(groups) => self.read_groups(groups, room)?,
            };
            drawn.groups[index] = Some(Known::Now(groups.into_iter().map(u64::from).product()));
            self.pieces(&pass.name, &work, made[0], groups, known, first)
        }
    }

    /// Submits repeated dispatches until there is no more work for them; their GPU time in milliseconds. As long as
    /// the time per group of one is unknown, or one is longer than a slice, each is submitted by itself, in pieces;
    /// otherwise all together, as often as fits a slice.
    unsafe fn repeated(
        &self,
        name: &str,
        work: &Repeat<'_>,
        pipelines: &[vk::Pipeline],
        room: &Buffer,
        first: impl Fn(vk::CommandBuffer),
    ) -> Result<f64> {
        let Repeat { body, left } = work;
        let slices = &self.device.time_slices;
        let is_left = |commands| {
            for (groups, place) in left.iter().zip(LEFT_AT) {
                // SAFETY: the caller of `in_turns` keeps all handles alive.
                unsafe { self.copy_groups(commands, *groups, room, place) };
            }
            // SAFETY: the command buffer is recording.
            unsafe { to_host(self.device, commands) };
        };
        let often = lock(&slices.paces).get(name).map_or(0, |pace| pace.repeated.often);
        let (mut begun, mut total, mut last, mut done) = (false, 0.0, None, 0);
        // Workgroups that are left: no dispatch has more.
        let mut most = u64::MAX;
        loop {
            let before = |commands, begun: bool| match begun {
                false => first(commands),
                // SAFETY: the command buffer is recording.
                true => unsafe { after_all(self.device, commands) },
            };
            let paces =
                lock(&slices.paces).get(name).map(|pace| pace.repeated.per_group_ms.clone()).unwrap_or_default();
            let bound = slices.slice_ms.map(|slice_ms| (slice_ms, longest_ms(body, &paces, most, slice_ms)));
            if let Some((_, None)) = bound {
                for (i, dispatch) in body.iter().enumerate() {
                    let groups = match dispatch.groups {
                        Groups::Count(groups) => groups,
                        // SAFETY: as above.
                        Groups::Indirect(groups) => unsafe { self.read_groups(groups, room)? },
                    };
                    let pace = paces.get(i).copied().flatten();
                    // SAFETY: as above.
                    let ms = unsafe {
                        self.pieces(name, dispatch, pipelines[i], groups, pace, |commands| before(commands, begun))?
                    };
                    begun = true;
                    total += ms;
                    let count: u64 = groups.into_iter().map(u64::from).product();
                    if count > 0 {
                        lock(&slices.paces).entry(name.to_owned()).or_default().repeated.set(i, ms / count as f64);
                    }
                }
                // SAFETY: as above.
                unsafe { self.turn(name, |_| (), is_left)? };
                done += 1;
            } else {
                let slice = bound.and_then(|(slice_ms, longest)| Some((slice_ms, longest?)));
                let count = together(slice, last, often.saturating_sub(done));
                let record = |commands| {
                    for (dispatch, pipeline) in (0..count).flat_map(|_| body.iter().zip(pipelines)) {
                        // SAFETY: as above.
                        unsafe {
                            dispatch.record(self.device, commands, *pipeline, None);
                            between_dispatches(self.device, commands);
                        }
                    }
                    is_left(commands);
                };
                // SAFETY: as above.
                let took = unsafe { self.turn(name, |commands| before(commands, begun), record)? };
                begun = true;
                total += took.ms;
                let ms = took.believed_ms() / count as f64;
                if let Some((_, longest)) = slice.filter(|(_, longest)| ms > *longest) {
                    lock(&slices.paces).entry(name.to_owned()).or_default().repeated.slow_down(ms / longest);
                }
                last = Some((count, ms));
                done += count;
            }
            lock(&slices.paces).entry(name.to_owned()).or_default().repeated.often = done;
            most = LEFT_AT.into_iter().map(|place| read_product(room, place)).sum();
            if most == 0 {
                return Ok(total);
            }
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
        let slice_ms = self.device.time_slices.slice_ms.unwrap_or(LONGEST_MS);
        let unknown = all.div_ceil(FIRST).min(FIRST_MOST) as f64;
        let mut most = known.filter(|ms| *ms > 0.0).map_or(unknown, |ms| slice_ms / ms);
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
            let took = unsafe { self.turn(name, before, record)? };
            total += took.ms;
            if count == 0 {
                break;
            }
            self.device.time_slices.cut.fetch_add(u64::from(done == 0 && count < all), Ordering::Relaxed);
            done += count;
            most = (slice_ms * count as f64 / took.believed_ms().max(1e-9)).min(GROWTH * count as f64);
        }
        Ok(total)
    }

    /// Submits commands once and waits for them; their time in milliseconds, between timestamps and by the host's
    /// clock.
    unsafe fn turn(
        &self,
        name: &str,
        before: impl FnOnce(vk::CommandBuffer),
        record: impl FnOnce(vk::CommandBuffer),
    ) -> Result<Took> {
        let (device, raw, timed) = (self.device, &self.device.raw, self.queries != vk::QueryPool::null());
        device.time_slices.go_on()?;
        let begun = self.begun.get();
        // SAFETY: the command buffer is recorded here and waited for before it is freed.
        let whole_ms = unsafe {
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
            let start = Instant::now();
            let submitted = submit(device, commands);
            if submitted.is_err() {
                self.begun.set(begun);
            }
            let waited = wait(device).with_context(|| format!("waiting for the pass {name}"));
            let whole_ms = start.elapsed().as_secs_f64() * 1e3;
            raw.free_command_buffers(self.from, &[commands]);
            submitted.and(waited)?;
            whole_ms
        };
        device.time_slices.turns.fetch_add(1, Ordering::Relaxed);
        Ok(Took { ms: if timed { self.ms_between(0)? } else { whole_ms }, whole_ms })
    }

    /// Reads back the workgroup count of an indirect dispatch.
    unsafe fn read_groups(&self, groups: IndirectGroups<'_>, room: &Buffer) -> Result<[u32; 3]> {
        // SAFETY: the caller of `in_turns` keeps all handles alive.
        unsafe {
            let copy = |commands| {
                self.copy_groups(commands, groups, room, 0);
                to_host(self.device, commands);
            };
            self.turn("how many groups", |_| (), copy)?;
        }
        let words: Vec<u32> = room.read(|bytes| bytemuck::pod_collect_to_vec(&bytes[..12]));
        Ok([words[0], words[1], words[2]])
    }

    /// Copies the workgroup counts of an indirect dispatch to a place that the host reads.
    unsafe fn copy_groups(&self, commands: vk::CommandBuffer, groups: IndirectGroups<'_>, room: &Buffer, at: u64) {
        let region = vk::BufferCopy { src_offset: groups.offset, dst_offset: at, size: GROUPS_BYTES };
        // The frame's own barriers do not know of this copy: it waits for everything, and everything for it.
        // SAFETY: the command buffer is recording; both buffers are alive.
        unsafe {
            after_all(self.device, commands);
            self.device.raw.cmd_copy_buffer(commands, groups.sizes.raw, room.raw, &[region]);
            after_all(self.device, commands);
        }
    }
}

/// What a frame's passes took, and of how many workgroups.
struct Drawn {
    /// Milliseconds of each pass that was drawn.
    ms: Vec<Option<f64>>,
    /// Name of each pass and its occurrence among those of the name.
    names: Vec<(String, usize)>,
    groups: Vec<Option<Known>>,
}

/// Workgroups of a dispatch: known, or where the device copies them.
enum Known {
    Now(u64),
    InRoom,
}

impl Drawn {
    /// Updates the times by name.
    fn remember(&self, paces: &mut HashMap<String, PassPace>) {
        let mut sums: HashMap<&str, (f64, u64)> = HashMap::new();
        for (((name, occurrence), ms), groups) in self.names.iter().zip(&self.ms).zip(&self.groups) {
            let &Some(ms) = ms else { continue };
            let pace = paces.entry(name.clone()).or_default();
            pace.last_ms.resize(pace.last_ms.len().max(occurrence + 1), ms);
            pace.last_ms[*occurrence] = ms;
            if let Some(Known::Now(groups)) = groups {
                let sum = sums.entry(name).or_default();
                *sum = (sum.0 + ms, sum.1 + groups);
            }
        }
        // The mean: some part is always cheap, and the next frame may begin with an expensive one.
        for (name, (ms, groups)) in sums.into_iter().filter(|(_, (_, groups))| *groups > 0) {
            paces.entry(name.to_owned()).or_default().per_group_ms = ms / groups as f64;
        }
    }
}

/// Number of workgroups that were copied to a place of `room`.
fn read_product(room: &Buffer, place: u64) -> u64 {
    let at = place as usize;
    let words: Vec<u32> = room.read(|bytes| bytemuck::pod_collect_to_vec(&bytes[at..at + GROUPS_BYTES as usize]));
    words.into_iter().map(u64::from).product()
}

/// Makes the writes of a dispatch available to the next one, and to the sizes of an indirect one.
unsafe fn between_dispatches(device: &Device, commands: vk::CommandBuffer) {
    let barrier = [vk::MemoryBarrier2::default()
        .src_stage_mask(vk::PipelineStageFlags2::COMPUTE_SHADER)
        .src_access_mask(vk::AccessFlags2::SHADER_WRITE)
        .dst_stage_mask(vk::PipelineStageFlags2::COMPUTE_SHADER | vk::PipelineStageFlags2::DRAW_INDIRECT)
        .dst_access_mask(
            vk::AccessFlags2::SHADER_READ | vk::AccessFlags2::SHADER_WRITE | vk::AccessFlags2::INDIRECT_COMMAND_READ,
        )];
    // SAFETY: the command buffer is recording.
    unsafe { device.raw.cmd_pipeline_barrier2(commands, &vk::DependencyInfo::default().memory_barriers(&barrier)) };
}

/// Makes copies available to the host.
unsafe fn to_host(device: &Device, commands: vk::CommandBuffer) {
    let barrier = [vk::MemoryBarrier2::default()
        .src_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER)
        .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
        .dst_stage_mask(vk::PipelineStageFlags2::HOST)
        .dst_access_mask(vk::AccessFlags2::HOST_READ)];
    // SAFETY: the command buffer is recording.
    unsafe { device.raw.cmd_pipeline_barrier2(commands, &vk::DependencyInfo::default().memory_barriers(&barrier)) };
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
    fn repeated_dispatches_are_together_as_far_as_a_slice_goes() {
        // Where nothing limits them: as often as the frame before, then twice as often each time.
        assert_eq!([7, 0].map(|left| together(None, None, left)), [7, 1]);
        assert_eq!(together(None, Some((7, 1.0)), 0), 14);
        // A slice of 10 ms. At first by what they take with the most workgroups, then by what they took.
        assert_eq!(together(Some((10.0, 3.0)), None, 50), 3);
        assert_eq!(together(Some((10.0, 3.0)), Some((3, 1.0)), 47), 10);
        // At most four times as often, never longer than 200 ms with the most workgroups, and once at least.
        assert_eq!(together(Some((10.0, 3.0)), Some((3, 0.1)), 47), 12);
        assert_eq!(together(Some((100.0, 20.0)), Some((9, 1.0)), 47), 10);
        assert_eq!(together(Some((10.0, 30.0)), None, 50), 1);
    }

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
