//! Reflection and refraction on GPUs: ray trees that grow in steps of dispatches, which begin, extend, sample lights,
//! light and split, repeated until all are complete (shaders/lib/interact_steps.glsl).
//!
//! Read Laine, Karras and Aila 2013, "Megakernels Considered Harmful"; Novák, Havran and Dachsbacher 2010, "Path
//! Regeneration for Interactive Path Tracing"; docs/decisions/architectures.md.

use std::mem::offset_of;
use std::sync::Arc;

use anyhow::Result;

use super::classify::{EMPTY, RayTiles, TILE};
use super::gbuffer::GBuffer;
use super::lighting::Lighting;
use super::path_states::words;
use super::rows::rows_of;
use crate::gpu::{Buffer, Device, Frame, Image, IndirectGroups};
use crate::plan::{Architecture, Plan};
use crate::shader::lib::interact_steps::{BRANCH_WORDS, NO_TREE, STEPS, TREE_QUEUES, TREE_WORDS};
use crate::shader::{
    Library, interact_ambient, interact_begin, interact_extend, interact_light, interact_next, interact_sample,
    interact_split, lib,
};
use crate::share::{StepSizes, WorkSize};
use crate::upload::shared::pending_branches;

/// Invocations of a workgroup, in all kernels of a step.
const GROUP: u32 = interact_begin::PROGRAM.local_size[0];
/// Memory for the trees that grow at the same time: this share of the device's own, and at most so much. More trees
/// need fewer steps, and a dispatch waits less for its longest ray (docs/decisions/architectures.md).
const SHARE_OF_MEMORY: u64 = 32;
const MOST_BYTES: u64 = 1 << 30;
/// The counter of pixels before the sizes.
const SIZES_AT: u64 = 4;

/// The trees that grow at the same time: their stacks, and queues by what comes next for each.
pub struct RayTrees {
    branches: Buffer,
    trees: Buffer,
    queues: Buffer,
    /// Number of pixels taken so far, then the sizes of the queues of each step.
    steps: Buffer,
    first_steps: Buffer,
    /// Number of trees.
    count: u32,
}

impl RayTrees {
    /// Trees for a picture of `size` pixels, at most `most` at a time; `None` where the plan has another form of the
    /// pass, or none.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, plan: &Plan, size: [u32; 2], most: Option<u32>) -> Result<Option<Self>> {
        let traces = plan.rays.filter(|rays| rays.mirrors || rays.refraction);
        let Some(rays) = traces.filter(|_| plan.paths.is_none() && plan.architecture == Architecture::Gpu) else {
            return Ok(None);
        };
        // Words of a tree: its stack, which is one binding for all trees, and the rest.
        let stack = u64::from(4 * BRANCH_WORDS * pending_branches(rays));
        let rest = u64::from(4 * TREE_WORDS + TREE_QUEUES);
        let bytes = (device.local_bytes() / SHARE_OF_MEMORY).min(MOST_BYTES);
        let fit = (bytes / (4 * (stack + rest))).min(device.max_storage_bytes() / (4 * stack));
        let pixels = u64::from(size[0].div_ceil(TILE)) * u64::from(size[1].div_ceil(TILE)) * u64::from(TILE * TILE);
        let groups = fit.min(most.map_or(u64::MAX, u64::from)) / u64::from(GROUP);
        let count = pixels.min(groups.max(1) * u64::from(GROUP)) as u32;
        // Every tree begins, in the step after the last one.
        let mut sizes = vec![StepSizes { beginning: EMPTY, growing: EMPTY, met: EMPTY }; STEPS as usize + 1];
        let [x, y, z] = rows_of(count / GROUP);
        sizes[STEPS as usize].beginning = WorkSize { x, y, z, count };
        let first: Vec<u32> = std::iter::once(0).chain(bytemuck::cast_slice(&sizes).iter().copied()).collect();
        Ok(Some(Self {
            branches: words(device, "branches of ray trees", true, stack * u64::from(count))?,
            trees: words(device, "ray trees", true, u64::from(4 * TREE_WORDS) * u64::from(count))?,
            queues: words(device, "queues of ray trees", true, u64::from(TREE_QUEUES) * u64::from(count))?,
            steps: words(device, "steps of ray trees", true, first.len() as u64)?,
            first_steps: Buffer::with_data(device, "first steps of ray trees", &first)?,
            count,
        }))
    }

    /// The dispatch over a queue of a step.
    fn groups(&self, step: u32, queue: usize) -> IndirectGroups<'_> {
        let offset = SIZES_AT + u64::from(step) * size_of::<StepSizes>() as u64 + queue as u64;
        IndirectGroups { sizes: &self.steps, offset, most: u64::from(self.count / GROUP) }
    }

    fn bind(&self) -> lib::interact_steps::Bind<'_> {
        let Self { branches, trees, queues, steps, .. } = self;
        lib::interact_steps::Bind { branches, trees, queues, steps }
    }

    /// Records all steps of all trees of the listed tiles, whose light is added to `radiance`.
    ///
    /// # Errors
    /// When the driver refuses a descriptor or a layout.
    pub(super) fn grow<'a>(
        &'a self,
        frame: &mut Frame<'a>,
        name: &str,
        (lighting, mut library): (&Lighting<'a>, Library),
        gbuffer: &'a GBuffer,
        tiles: &'a RayTiles,
        radiance: &'a Image,
    ) -> Result<()> {
        frame.copy_buffer("reset ray trees", &self.first_steps, &self.steps, self.steps.bytes());
        frame.fill("reset ray trees", &self.queues, NO_TREE);
        let [beginning, growing, met] =
            [offset_of!(StepSizes, beginning), offset_of!(StepSizes, growing), offset_of!(StepSizes, met)];
        library.lighting.sampled_apart = library.emitters.light_samples > 0;
        let left = [beginning, growing].map(|queue| self.groups(STEPS, queue));
        frame.repeat(name, left, |frame| {
            let bind = interact_next::Bind { interact_steps: self.bind() };
            let push = interact_next::Push { trees_at_once: self.count, this_step: 0 };
            frame.compute(name, &bind, &interact_next::Constants {}, &push, [1, 1, 1])?;
            for this_step in 0..STEPS {
                let [beginning, growing, met] = [beginning, growing, met].map(|queue| self.groups(this_step, queue));
                let bind = interact_begin::Bind {
                    gbuffer: gbuffer.bind(),
                    interact_steps: self.bind(),
                    radiance,
                    ray_tiles: &tiles.tiles,
                    work: &tiles.sizes,
                };
                let push = interact_begin::Push { trees_at_once: self.count, this_step };
                frame.compute_indirect(name, &bind, &interact_begin::Constants { library }, &push, beginning)?;
                let bind = interact_extend::Bind { interact_steps: self.bind() };
                let push = interact_extend::Push { trees_at_once: self.count, this_step };
                frame.compute_indirect(name, &bind, &interact_extend::Constants { library }, &push, growing)?;
                if library.lighting.sampled_apart {
                    let bind = interact_sample::Bind { interact_steps: self.bind() };
                    let push = interact_sample::Push { trees_at_once: self.count, this_step };
                    frame.compute_indirect(name, &bind, &interact_sample::Constants { library }, &push, met)?;
                }
                let bind = interact_light::Bind { interact_steps: self.bind(), lighting: lighting.tiles.bind() };
                let push = interact_light::Push { trees_at_once: self.count, this_step };
                frame.compute_indirect(name, &bind, &interact_light::Constants { library }, &push, met)?;
                if library.lighting.environment_apart {
                    let bind = interact_ambient::Bind { interact_steps: self.bind() };
                    let push = interact_ambient::Push { trees_at_once: self.count, this_step };
                    frame.compute_indirect(name, &bind, &interact_ambient::Constants { library }, &push, met)?;
                }
                let bind = interact_split::Bind { interact_steps: self.bind() };
                let push = interact_split::Push { trees_at_once: self.count, this_step };
                frame.compute_indirect(name, &bind, &interact_split::Constants { library }, &push, met)?;
            }
            Ok(())
        })
    }
}
