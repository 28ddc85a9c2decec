//! Time-sliced submission: a frame is as few submissions as are short, so that a window's queue is never blocked for
//! long and no operating system resets a GPU.
//!
//! Read the Vulkan specification, chapters Dispatching Commands (`vkCmdDispatchBase`) and Command Buffers. Passes whose
//! time is known are recorded into one submission as long as they take no longer than a slice together, by their times
//! in the frame before, and no longer than [`LONGEST_MS`] if every indirect dispatch had the most workgroups that it
//! can have. A pass that is unknown or longer is submitted and waited for by itself; a long dispatch in pieces of
//! workgroups: each piece has as many groups as would take a slice at the measured time per group of the piece before.
//! The host must know the number of groups of such a dispatch, so the arguments of an indirect one are read back first.

use std::collections::HashMap;
use std::sync::atomic::Ordering;
use std::time::Instant;

use anyhow::{Context as _, Result, bail};
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

/// How many of a body's `all` repeated dispatches are submitted together from the `at`th on: one while its time is not known,
/// 0 where one alone is longer than a slice, otherwise as many whole bodies as are probably left and fit a slice. `paces`
/// are the dispatches' times, and `often` is how often the body was repeated last.
fn together(paces: &[f64], all: usize, at: usize, often: usize, slice_ms: f64) -> usize {
    let (next, done) = (at % all, at / all);
    if paces.len() < all {
        return 1;
    }
    if paces[next] > slice_ms {
        return 0;
    }
    let mut sum = 0.0;
    let fit = paces[next..].iter().take_while(|ms| {
        sum += **ms;
        sum <= slice_ms
    });
    let fit = fit.count();
    if fit < all - next {
        return fit;
    }
    let left = if often > done { often - done } else { done.div_ceil(4).max(1) };
    let more = ((slice_ms - sum) / paces.iter().sum::<f64>().max(1e-3)) as usize;
    fit + more.min(left - 1) * all
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
        let room = Buffer::new(self.device, OF_FRAME, GROUPS_BYTES * passes.len().max(2) as u64, Place::Readback)?;
        let mut seen: HashMap<String, usize> = HashMap::new();
        let mut batch: Option<Batch> = None;
        for (index, (pass, barriers)) in passes.into_iter().zip(barriers).enumerate() {
            let occurrence = seen.entry(pass.name.clone()).or_default();
            let expected = PassEstimate::of(&pass, *occurrence, lock(&self.device.time_slices.paces).get(&pass.name));
            *occurrence += 1;
            drawn.names.push((pass.name.clone(), *occurrence - 1));
            drawn.groups.push(None);
            // Without timestamps only a pass by itself has a time.
            let whole = expected.filter(|expected| self.queries != vk::QueryPool::null() && expected.fits(slice_ms));
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
        let query = 2 * index as u32;
        // SAFETY: the command buffer is recording; the caller of `in_turns` keeps all handles alive.
        unsafe {
            self.device.raw.cmd_reset_query_pool(commands, self.queries, query, 2);
            record_barriers(self.device, commands, barriers, self.targets, false);
            if let RecordedWork::Dispatch(Dispatch { groups, .. }) = &pass.work {
                drawn.groups[index] = match groups {
                    Groups::Count(groups) => Some(Known::Now(groups.iter().map(|&n| u64::from(n)).product())),
                    Groups::Indirect(groups) => {
                        self.copy_groups(commands, *groups, room, GROUPS_BYTES * index as u64);
                        Some(Known::InRoom)
                    }
                };
            }
            label(self.device, commands, Some(&pass.name));
            write_first_timestamp(self.device, commands, self.queries, query);
            match pass.work {
                RecordedWork::Record(record) => record(self.device, commands, &made),
                RecordedWork::Dispatch(work) => work.record(self.device, commands, made[0], None),
                RecordedWork::Repeat(_) => unreachable!("{REPEATED}"),
            }
            self.device.raw.cmd_write_timestamp2(commands, ALL, self.queries, query + 1);
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
            let waited = wait(device).with_context(|| {
                let names: Vec<&str> = passes.iter().map(|&index| drawn.names[index].0.as_str()).collect();
                format!("waiting for the passes {}", names.join(", "))
            });
            raw.free_command_buffers(self.from, &[commands]);
            submitted.and(waited)?;
        }
        device.time_slices.turns.fetch_add(1, Ordering::Relaxed);
        self.begun.set(self.begun.get() + passes.len());
        let whole_ms = start.elapsed().as_secs_f64() * 1e3;
        let times = passes.iter().map(|&index| self.ms_between(2 * index as u32)).collect::<Result<Vec<f64>>>()?;
        let took = Took { ms: times.iter().sum(), whole_ms };
        let missing = (took.believed_ms() - took.ms) / passes.len() as f64;
        for (index, ms) in passes.into_iter().zip(times) {
            drawn.ms[index] = Some(ms + missing);
            if let Some(known @ Known::InRoom) = &mut drawn.groups[index] {
                let at = GROUPS_BYTES as usize * index;
                let words: Vec<u32> = room.read(|bytes| bytemuck::pod_collect_to_vec(&bytes[at..at + 12]));
                *known = Known::Now(words.into_iter().map(u64::from).product());
            }
        }
        Ok(())
    }

    /// Milliseconds between two timestamps that have been written.
    fn ms_between(&self, query: u32) -> Result<f64> {
        let mut ticks = [0_u64; 2];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: the pool has both queries, whose commands have executed.
        unsafe { self.device.raw.get_query_pool_results(self.queries, query, &mut ticks, flags) }
            .context("reading timestamps")?;
        let period = f64::from(self.device.limits.timestamp_period) * 1e-6;
        Ok(ticks[1].saturating_sub(ticks[0]) as f64 * period)
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
            // Pipelines of devices that nothing resets take whole dispatches alone.
            if self.device.time_slices.slice_ms.is_none() {
                let record = |commands| work.record(self.device, commands, made[0], None);
                return Ok(self.turn(&pass.name, first, record)?.ms);
            }
            let known = lock(&self.device.time_slices.paces).get(&pass.name).map(|pace| pace.per_group_ms);
            let groups = match work.groups {
                Groups::Count(groups) => groups,
                Groups::Indirect(groups) => self.read_groups(groups, room)?,
            };
            drawn.groups[index] = Some(Known::Now(groups.into_iter().map(u64::from).product()));
            self.pieces(&pass.name, &work, made[0], groups, known, first)
        }
    }

    /// Submits repeated dispatches, as many together as take about a slice, until there is no more work; their GPU time in
    /// milliseconds.
    unsafe fn repeated(
        &self,
        name: &str,
        work: &Repeat<'_>,
        pipelines: &[vk::Pipeline],
        room: &Buffer,
        first: impl Fn(vk::CommandBuffer),
    ) -> Result<f64> {
        let Repeat { body, left } = work;
        let slice_ms = self.device.time_slices.slice_ms.unwrap_or(f64::INFINITY);
        let known = lock(&self.device.time_slices.paces).get(name).map(|pace| pace.repeated.clone());
        let (mut paces, often) = known.unwrap_or_default();
        let is_left = |commands| {
            for (groups, place) in left.iter().zip([0, GROUPS_BYTES]) {
                // SAFETY: the caller of `in_turns` keeps all handles alive.
                unsafe { self.copy_groups(commands, *groups, room, place) };
            }
            // SAFETY: the command buffer is recording.
            unsafe { to_host(self.device, commands) };
        };
        let (mut at, mut total) = (0, 0.0);
        loop {
            let next = at % body.len();
            let before = |commands| match at {
                0 => first(commands),
                // SAFETY: the command buffer is recording.
                _ => unsafe { after_all(self.device, commands) },
            };
            let count = together(&paces, body.len(), at, often, slice_ms);
            if count == 0 {
                let Groups::Indirect(groups) = body[next].groups else {
                    bail!("{name} has a dispatch that takes too long")
                };
                // SAFETY: the caller of `in_turns` keeps all handles alive.
                unsafe {
                    let groups = self.read_groups(groups, room)?;
                    total += self.pieces(name, &body[next], pipelines[next], groups, None, before)?;
                    self.turn(name, |_| (), is_left)?;
                }
            } else {
                let record = |commands| {
                    for i in (at..at + count).map(|i| i % body.len()) {
                        // SAFETY: as above.
                        unsafe {
                            body[i].record(self.device, commands, pipelines[i], None);
                            between_dispatches(self.device, commands);
                        }
                    }
                    is_left(commands);
                };
                // SAFETY: as above.
                let took = unsafe { self.turn(name, before, record)? };
                total += took.ms;
                if next == paces.len() {
                    paces.push(took.believed_ms());
                }
            }
            at += count.max(1);
            let groups: Vec<u32> = room.read(|bytes| bytemuck::pod_collect_to_vec(&bytes[..2 * GROUPS_BYTES as usize]));
            if at % body.len() == 0 && groups[0] == 0 && groups[3] == 0 {
                break;
            }
        }
        lock(&self.device.time_slices.paces).entry(name.to_owned()).or_default().repeated = (paces, at / body.len());
        Ok(total)
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
        let body = [1.0, 4.0, 2.0, 3.0];
        // At first one by one.
        assert_eq!((0..4).map(|known| together(&body[..known], 4, known, 0, 100.0)).sum::<usize>(), 4);
        // Then a quarter more each time, to the end of a body.
        assert_eq!([4, 16, 40].map(|at| together(&body, 4, at, 0, 1e3)), [4, 4, 12]);
        // What was needed before, if it fits.
        assert_eq!([0, 4].map(|at| together(&body, 4, at, 7, 1e3)), [28, 24]);
        assert_eq!(together(&body, 4, 0, 7, 35.0), 12);
        // Less than a body, from within it, and none where one is too long.
        assert_eq!([0, 2, 3].map(|at| together(&body, 4, at, 7, 7.0)), [3, 2, 1]);
        assert_eq!([0, 1, 2].map(|at| together(&body, 4, at, 7, 3.5)), [1, 0, 1]);
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
