//! Recording of passes into command buffers: pipeline barriers, debug labels, and a timestamp pair around each pass.
//!
//! Read the Vulkan specification, chapters Command Buffers, Synchronization and Cache Control (Timeline Semaphores),
//! Queries (Timestamp Queries) and Resource Descriptors (Push Descriptor Updates). One timeline semaphore counts
//! submissions.

use std::cell::Cell;
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use anyhow::{Context as _, Result};
use ash::vk;

use super::bind::Descriptor;
use super::cache::{Layout, PipelineKey};
use super::device::{Device, lock};
use super::memory::{Buffer, Image};
use super::pipeline::Pipelines;
use super::shader::Program;
use super::sync::{Barrier, ResourceId, Use};

pub(super) type Record<'a> = Box<dyn FnOnce(&Device, vk::CommandBuffer, &[vk::Pipeline]) + 'a>;

pub(super) struct Pass<'a> {
    pub(super) name: String,
    pub(super) uses: Vec<Use>,
    /// Pipelines of the pass, passed to `work` in this order.
    pub(super) pipelines: Vec<PipelineKey>,
    pub(super) work: RecordedWork<'a>,
}

/// The commands of a pass.
pub(super) enum RecordedWork<'a> {
    /// A dispatch, which time-sliced submission may split.
    Dispatch(Dispatch<'a>),
    /// Dispatches that are repeated, in several submissions.
    Repeat(Repeat<'a>),
    /// Any other commands.
    Record(Record<'a>),
}

/// The descriptors of set 0, which belong to one use of a program.
pub(super) enum Own {
    /// Push descriptors.
    Pushed(Vec<Descriptor>),
    /// A descriptor set that the frame owns.
    Set(vk::DescriptorSet),
}

/// One dispatch with its descriptors, push constants and workgroup count.
pub(super) struct Dispatch<'a> {
    pub(super) program: &'static Program,
    pub(super) own: Own,
    pub(super) sets: Vec<vk::DescriptorSet>,
    pub(super) layout: Layout,
    pub(super) push: Vec<u8>,
    pub(super) groups: Groups<'a>,
}

/// Dispatches that are repeated in order until the device has no more work for them.
pub(super) struct Repeat<'a> {
    pub(super) body: Vec<Dispatch<'a>>,
    /// When both have no workgroups after the last dispatch of the body, it was repeated often enough.
    pub(super) left: [IndirectGroups<'a>; 2],
}

/// Why a repeated dispatch cannot be recorded with the other passes of a frame.
pub(super) const REPEATED: &str = "repeated dispatches need a check by the host";

impl Dispatch<'_> {
    /// Records the dispatch, or a piece of it.
    ///
    /// # Safety
    /// The command buffer is recording, and handles are alive until the frame has finished.
    pub(super) unsafe fn record(
        &self,
        device: &Device,
        commands: vk::CommandBuffer,
        pipeline: vk::Pipeline,
        piece: Option<DispatchPiece>,
    ) {
        let Self { program, own, sets, layout, push, groups } = self;
        // SAFETY: the caller guarantees both conditions.
        unsafe {
            device.raw.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, pipeline);
            bind_own(device, commands, vk::PipelineBindPoint::COMPUTE, *layout, program, own);
            bind_sets(device, commands, vk::PipelineBindPoint::COMPUTE, *layout, sets);
            push_constants(device, commands, *layout, program, push);
            match (piece, groups) {
                (Some(DispatchPiece { base: [x, y, z], count: [across, down, deep] }), _) => {
                    device.raw.cmd_dispatch_base(commands, x, y, z, across, down, deep);
                }
                (None, Groups::Count([x, y, z])) => device.raw.cmd_dispatch(commands, *x, *y, *z),
                (None, Groups::Indirect(IndirectGroups { sizes, offset, .. })) => {
                    device.raw.cmd_dispatch_indirect(commands, sizes.raw, *offset);
                }
            }
        }
    }
}

/// Number of workgroups: given by the host, or read by an indirect dispatch.
#[derive(Clone, Copy)]
pub(super) enum Groups<'a> {
    Count([u32; 3]),
    Indirect(IndirectGroups<'a>),
}

/// The workgroup counts of an indirect dispatch, which the device has computed.
#[derive(Clone, Copy)]
pub struct IndirectGroups<'a> {
    /// The buffer that holds the three counts.
    pub sizes: &'a Buffer,
    /// Their offset in bytes.
    pub offset: u64,
    /// The largest number of workgroups that they may ask for.
    pub most: u64,
}

/// The resource of a barrier.
#[derive(Clone, Copy)]
pub(super) enum Target<'a> {
    Buffer(&'a Buffer),
    Image(&'a Image),
}

/// A box of workgroups of a dispatch: from `base` on, `count` along each axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct DispatchPiece {
    pub(super) base: [u32; 3],
    pub(super) count: [u32; 3],
}

/// The state shared by all passes of a frame while they are recorded.
pub(super) struct Recording<'f> {
    pub(super) device: &'f Arc<Device>,
    pub(super) from: vk::CommandPool,
    pub(super) targets: &'f HashMap<ResourceId, Target<'f>>,
    pub(super) pipelines: &'f Pipelines<'f>,
    /// Null when the device has no timestamps.
    pub(super) queries: vk::QueryPool,
    pub(super) without_barriers: bool,
    /// Number of passes whose barriers have been submitted.
    pub(super) begun: &'f Cell<usize>,
}

impl Recording<'_> {
    /// Records passes into one command buffer, or several while pipelines are still being created; milliseconds of each
    /// pass.
    ///
    /// # Safety
    /// Every handle of the passes is alive, and nothing else is recorded with the pool.
    pub(super) unsafe fn at_once(&self, passes: Vec<Pass<'_>>, barriers: &[Vec<Barrier>]) -> Result<Vec<f64>> {
        let &Self { device, from, targets, pipelines, queries, without_barriers, begun } = self;
        let (raw, timed) = (&device.raw, queries != vk::QueryPool::null());
        let mut ticks = vec![0_u64; 2 * passes.len()];
        let names: Vec<String> = passes.iter().map(|pass| pass.name.clone()).collect();
        // SAFETY: the caller guarantees both conditions.
        unsafe {
            let mut used = vec![begin(device, from)?];
            if timed {
                raw.cmd_reset_query_pool(used[0], queries, 0, ticks.len() as u32);
            }
            let record_all = || {
                for (index, (pass, barriers)) in passes.into_iter().zip(barriers).enumerate() {
                    // Validation finds hazards only within one command buffer, so under validation all passes share
                    // one.
                    if index > 0 && !device.validates() && !pipelines.ready(&pass.pipelines) {
                        submit(device, used[used.len() - 1])?;
                        begun.set(index);
                        used.push(begin(device, from)?);
                    }
                    let made = pipelines.wait_for(&pass.pipelines)?;
                    let commands = used[used.len() - 1];
                    record_barriers(device, commands, barriers, targets, without_barriers);
                    label(device, commands, Some(&pass.name));
                    if timed {
                        write_first_timestamp(device, commands, queries, 2 * index as u32);
                    }
                    match pass.work {
                        RecordedWork::Record(record) => record(device, commands, &made),
                        RecordedWork::Dispatch(work) => work.record(device, commands, made[0], None),
                        RecordedWork::Repeat(_) => unreachable!("{REPEATED}"),
                    }
                    if timed {
                        raw.cmd_write_timestamp2(commands, ALL, queries, 2 * index as u32 + 1);
                    }
                    label(device, commands, None);
                }
                submit(device, used[used.len() - 1])?;
                begun.set(names.len());
                Ok(())
            };
            let recorded = record_all();
            // Submitted work is waited for even when the rest could not be submitted.
            let waited = wait(device).with_context(|| format!("waiting for a frame of passes {}", names.join(", ")));
            let outcome = recorded.and(waited).and_then(|()| {
                let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
                match timed {
                    true => raw.get_query_pool_results(queries, 0, &mut ticks, flags).context("reading timestamps"),
                    false => Ok(()),
                }
            });
            raw.free_command_buffers(from, &used);
            outcome?;
        }
        Ok(ticks.chunks_exact(2).map(|pair| device.ms_between(pair[0], pair[1])).collect())
    }
}

/// Writes the timestamp before a pass.
pub(super) unsafe fn write_first_timestamp(
    device: &Device,
    commands: vk::CommandBuffer,
    queries: vk::QueryPool,
    index: u32,
) {
    // lavapipe takes a timestamp only at its next flush, which would be after a dispatch that runs at once (measured:
    // 0.05 ms for a tone map of 7.5 ms). A barrier flushes. A barrier between no stages is no dependency: it hides no
    // hazard from validation and costs nothing on a GPU.
    let nothing = [vk::MemoryBarrier2::default()];
    // SAFETY: the command buffer is recording; the pool has the query.
    unsafe {
        device.raw.cmd_write_timestamp2(commands, ALL, queries, index);
        device.raw.cmd_pipeline_barrier2(commands, &vk::DependencyInfo::default().memory_barriers(&nothing));
    }
}

pub(super) const ALL: vk::PipelineStageFlags2 = vk::PipelineStageFlags2::ALL_COMMANDS;

/// Allocates a command buffer and begins its recording.
pub(super) unsafe fn begin(device: &Device, pool: vk::CommandPool) -> Result<vk::CommandBuffer> {
    let info = vk::CommandBufferAllocateInfo::default()
        .command_pool(pool)
        .level(vk::CommandBufferLevel::PRIMARY)
        .command_buffer_count(1);
    let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
    // SAFETY: valid infos.
    unsafe {
        let commands = device.raw.allocate_command_buffers(&info).context("allocating a command buffer")?[0];
        device.raw.begin_command_buffer(commands, &begin).context("recording a frame")?;
        Ok(commands)
    }
}

/// Ends and submits a command buffer; the timeline semaphore reaches `submitted` when it has executed.
pub(super) unsafe fn submit(device: &Device, commands: vk::CommandBuffer) -> Result<()> {
    let queue = lock(&device.queue);
    let done = device.submitted.load(Ordering::Relaxed) + 1;
    let buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(commands)];
    let signals = [vk::SemaphoreSubmitInfo::default().semaphore(device.timeline).value(done).stage_mask(ALL)];
    let info = vk::SubmitInfo2::default().command_buffer_infos(&buffers).signal_semaphore_infos(&signals);
    // SAFETY: the command buffer is recording; the caller waits for it before it frees any resource of it.
    unsafe {
        device.raw.end_command_buffer(commands).context("recording a frame")?;
        device.raw.queue_submit2(*queue, &[info], vk::Fence::null()).context("submitting a frame")?;
    }
    device.submitted.store(done, Ordering::Relaxed);
    Ok(())
}

/// Waits until all submitted work has executed.
pub(super) unsafe fn wait(device: &Device) -> Result<()> {
    let (semaphores, values) = ([device.timeline], [device.submitted.load(Ordering::Relaxed)]);
    let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
    // SAFETY: a semaphore of this device, signalled by the last submission.
    unsafe { device.raw.wait_semaphores(&info, u64::MAX) }.context("waiting for the device")
}

pub(super) unsafe fn label(device: &Device, commands: vk::CommandBuffer, name: Option<&str>) {
    let Some(debug) = &device.debug else { return };
    // SAFETY: the command buffer is recording.
    unsafe {
        match name {
            Some(name) => {
                let name = std::ffi::CString::new(name).unwrap_or_default();
                debug.cmd_begin_debug_utils_label(commands, &vk::DebugUtilsLabelEXT::default().label_name(&name));
            }
            None => debug.cmd_end_debug_utils_label(commands),
        }
    }
}

pub(super) unsafe fn record_barriers(
    device: &Device,
    commands: vk::CommandBuffer,
    barriers: &[Barrier],
    targets: &HashMap<ResourceId, Target<'_>>,
    without_buffers: bool,
) {
    let mut images = Vec::new();
    let mut buffers = Vec::new();
    for barrier in barriers {
        match targets[&barrier.resource] {
            Target::Image(image) => {
                let (old, new) = barrier.layouts.unwrap_or_default();
                images.push(
                    vk::ImageMemoryBarrier2::default()
                        .image(image.raw)
                        .subresource_range(image.range())
                        .src_stage_mask(barrier.src_stages)
                        .src_access_mask(barrier.src_access)
                        .dst_stage_mask(barrier.dst_stages)
                        .dst_access_mask(barrier.dst_access)
                        .old_layout(old)
                        .new_layout(new),
                );
            }
            Target::Buffer(buffer) if !without_buffers => buffers.push(
                vk::BufferMemoryBarrier2::default()
                    .buffer(buffer.raw)
                    .size(vk::WHOLE_SIZE)
                    .src_stage_mask(barrier.src_stages)
                    .src_access_mask(barrier.src_access)
                    .dst_stage_mask(barrier.dst_stages)
                    .dst_access_mask(barrier.dst_access),
            ),
            Target::Buffer(_) => {}
        }
    }
    if !images.is_empty() || !buffers.is_empty() {
        let info = vk::DependencyInfo::default().image_memory_barriers(&images).buffer_memory_barriers(&buffers);
        // SAFETY: the command buffer is recording; the targets are alive.
        unsafe { device.raw.cmd_pipeline_barrier2(commands, &info) };
    }
}

pub(super) unsafe fn push_constants(
    device: &Device,
    commands: vk::CommandBuffer,
    layout: Layout,
    program: &'static Program,
    push: &[u8],
) {
    if !push.is_empty() {
        let stages = program.stages.iter().fold(vk::ShaderStageFlags::empty(), |all, s| all | s.flag);
        // SAFETY: the command buffer is recording; the layout has a range of this size.
        unsafe { device.raw.cmd_push_constants(commands, layout.pipeline, stages, 0, push) };
    }
}

/// Binds the shared sets 1 and 2 of a program.
pub(super) unsafe fn bind_sets(
    device: &Device,
    commands: vk::CommandBuffer,
    point: vk::PipelineBindPoint,
    layout: Layout,
    sets: &[vk::DescriptorSet],
) {
    if !sets.is_empty() {
        // SAFETY: the command buffer is recording; the sets match the layout and are alive until the frame has
        // finished.
        unsafe { device.raw.cmd_bind_descriptor_sets(commands, point, layout.pipeline, 1, sets, &[]) };
    }
}

/// Binds or pushes set 0 of a program.
pub(super) unsafe fn bind_own(
    device: &Device,
    commands: vk::CommandBuffer,
    point: vk::PipelineBindPoint,
    layout: Layout,
    program: &'static Program,
    own: &Own,
) {
    match (own, &device.push) {
        (Own::Set(set), _) => {
            // SAFETY: the command buffer is recording; the set matches the layout and is alive until the frame has
            // finished.
            unsafe { device.raw.cmd_bind_descriptor_sets(commands, point, layout.pipeline, 0, &[*set], &[]) };
        }
        (Own::Pushed(descriptors), Some(push)) if !descriptors.is_empty() => {
            let writes: Vec<_> =
                program.bindings.iter().zip(descriptors).map(|(b, descriptor)| descriptor.write(device, b)).collect();
            // SAFETY: the command buffer is recording; the writes match the layout, both come from reflection.
            unsafe { push.cmd_push_descriptor_set(commands, point, layout.pipeline, 0, &writes) };
        }
        (Own::Pushed(_), _) => {}
    }
}
