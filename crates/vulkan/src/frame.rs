//! A frame: passes in reading order, with derived pipeline barriers and a timestamp pair around each pass.
//!
//! Read the Vulkan specification, chapters Render Pass (Dynamic Rendering), Dispatching Commands, Drawing Commands and
//! Queries. Passes are plain data (`Vec<Pass>`) until [`Frame::finish`] records them in order, submits them, and waits.
//! Labels, object names, timestamps and barriers are automatic. New pipelines are created on other threads, and while
//! a pass waits for its pipeline, the device already executes the earlier passes.

use std::cell::Cell;
use std::collections::HashMap;
use std::sync::Arc;

use anyhow::{Context as _, Result};
use ash::vk;

use super::access::Access;
use super::bind::{Bindings, Descriptor, Resource, Sampled};
use super::cache::{PipelineKey, RasterKey};
use super::device::{Device, is_lost, lock};
use super::memory::{Buffer, Image};
use super::recording::{
    Dispatch, Groups, IndirectGroups, Own, Pass, RecordedWork, Recording, Repeat, Target, bind_own, bind_sets,
    push_constants,
};
use super::set::{BoundSet, Pooled};
use super::shader::{Program, SharedSet, Specialization as _};
use super::sync::{self, ResourceId, ResourceState, Use};

/// GPU time of one pass.
#[derive(Debug, Clone, PartialEq)]
pub struct PassTime {
    /// Name of the pass.
    pub name: String,
    /// Milliseconds between its timestamps.
    pub ms: f64,
}

/// A colour attachment of a raster pass.
#[derive(Clone, Copy)]
pub struct ColorTarget<'a> {
    /// The attachment's image.
    pub image: &'a Image,
    /// Clear value as raw words of the format's numeric type; `None` keeps the contents.
    pub clear: Option<[u32; 4]>,
}

/// The depth attachment of a raster pass, with reversed depth: 0 is infinitely far.
#[derive(Clone, Copy)]
pub struct DepthTarget<'a> {
    /// The attachment's image.
    pub image: &'a Image,
    /// Whether the attachment is cleared to 0 first.
    pub clear: bool,
    /// Whether fragments write depth.
    pub write: bool,
}

/// One attribute stream of a draw.
#[derive(Clone, Copy)]
pub struct VertexStream<'a> {
    /// Tightly packed f32 components.
    pub buffer: &'a Buffer,
    /// Offset of the first vertex in bytes.
    pub offset: u64,
    /// Bytes between vertices; 0 gives every vertex the first element.
    pub stride: u32,
}

/// One indexed draw.
pub struct Draw<'a> {
    /// Index into the pass's list of texture sets (`pages`).
    pub pages: usize,
    /// Specialization constants.
    pub constants: Vec<(u32, u32)>,
    /// One stream per vertex input of the program.
    pub streams: Vec<VertexStream<'a>>,
    /// 32-bit indices.
    pub indices: &'a Buffer,
    /// First index.
    pub first_index: u32,
    /// Number of indices.
    pub index_count: u32,
    /// Instance index, `gl_InstanceIndex` in the shader.
    pub instance: u32,
    /// Whether back faces are culled.
    pub cull_back: bool,
    /// Whether clockwise triangles are front faces, as under a mirroring transform.
    pub clockwise: bool,
}

/// A raster pass without its draws.
pub struct Raster<'a> {
    /// Name in labels and timings.
    pub name: &'a str,
    /// Colour attachments in location order; outputs to `None` are discarded.
    pub colors: Vec<Option<ColorTarget<'a>>>,
    /// Depth attachment.
    pub depth: Option<DepthTarget<'a>>,
    /// First pixel of the viewport; several views may share one image.
    pub origin: [u32; 2],
    /// Size of the viewport in pixels.
    pub size: [u32; 2],
    /// Rows of the viewport that are cleared and drawn: first, and one past the last.
    pub rows: [u32; 2],
}

/// The description of a pass, before its pipelines exist.
#[derive(Debug, Clone)]
pub struct PassPlan {
    /// Name of the pass.
    pub name: String,
    /// Pipelines of the pass: programs with their specialization constants.
    pub pipelines: Vec<(&'static Program, Vec<(u32, u32)>)>,
}

/// A frame being described.
pub struct Frame<'a> {
    device: Arc<Device>,
    passes: Vec<Pass<'a>>,
    targets: HashMap<ResourceId, Target<'a>>,
    sets: Vec<BoundSet<'a>>,
    /// Descriptor sets of single passes, on devices without push descriptors.
    own: Vec<Pooled>,
    without_barriers: bool,
}

impl<'a> Frame<'a> {
    /// An empty frame.
    #[must_use]
    pub fn new(device: &Arc<Device>) -> Self {
        Self {
            device: device.clone(),
            passes: Vec::new(),
            targets: HashMap::new(),
            sets: Vec::new(),
            own: Vec::new(),
            without_barriers: false,
        }
    }

    /// An empty frame whose programs all read the same shared sets.
    #[must_use]
    pub fn of(device: &Arc<Device>, sets: Vec<BoundSet<'a>>) -> Self {
        Self { sets, ..Self::new(device) }
    }

    /// Omits every buffer barrier, for the test that validation detects the omission.
    #[doc(hidden)]
    pub fn forget_barriers(&mut self) {
        self.without_barriers = true;
    }

    fn use_buffer(&mut self, uses: &mut Vec<Use>, buffer: &'a Buffer, access: Access, shaders: vk::ShaderStageFlags) {
        self.targets.insert(buffer.id, Target::Buffer(buffer));
        uses.push(Use { resource: buffer.id, is_image: false, access, shaders });
    }

    fn use_image(&mut self, uses: &mut Vec<Use>, image: &'a Image, access: Access, shaders: vk::ShaderStageFlags) {
        self.targets.insert(image.id, Target::Image(image));
        uses.push(Use { resource: image.id, is_image: true, access, shaders });
    }

    /// Adds the uses of a program's bindings and prepares set 0: push descriptors, or a descriptor set for this pass.
    fn bind(
        &mut self,
        uses: &mut Vec<Use>,
        program: &'static Program,
        resources: &[Resource<'a>],
        depth: Option<ResourceId>,
    ) -> Result<Own> {
        let mut descriptors = Vec::with_capacity(resources.len());
        for (binding, &resource) in program.bindings.iter().zip(resources) {
            let mut layout = binding.access.masks(binding.stages).layout;
            match resource {
                Resource::Buffer(buffer) => self.use_buffer(uses, buffer, binding.access, binding.stages),
                Resource::Image(image) => self.use_image(uses, image, binding.access, binding.stages),
                Resource::Sampled(sampled) => {
                    if depth == Some(sampled.image.id) {
                        layout = vk::ImageLayout::DEPTH_READ_ONLY_OPTIMAL;
                    }
                    self.use_image(uses, sampled.image, binding.access, binding.stages);
                }
            }
            descriptors.push(Descriptor::new(&self.device, binding.kind, resource, layout)?);
        }
        if self.device.push.is_some() || descriptors.is_empty() {
            return Ok(Own::Pushed(descriptors));
        }
        let layout = self.device.layout(program)?.set;
        let creating = || format!("creating descriptors of \"{}\"", program.name);
        let own = Pooled::new(&self.device, program.bindings, layout, creating)?;
        for (binding, descriptor) in program.bindings.iter().zip(&descriptors) {
            // SAFETY: the set is new, and its resources live as long as the frame.
            unsafe { own.write(binding, descriptor) };
        }
        let raw = own.raw;
        self.own.push(own);
        Ok(Own::Set(raw))
    }

    /// Adds the uses of the bindings that a program reads in the shared sets 1 and 2.
    ///
    /// # Panics
    /// When a set is missing, a bug of the caller.
    fn shared(
        &mut self,
        uses: &mut Vec<Use>,
        program: &'static Program,
        pages: Option<&BoundSet<'a>>,
    ) -> Vec<vk::DescriptorSet> {
        let mut sets = Vec::with_capacity(program.sets.len());
        for SharedSet { layout, used } in program.sets {
            let known = self.sets.iter().chain(pages).find(|set| set.is_of(layout)).cloned();
            let known =
                known.unwrap_or_else(|| panic!("\"{}\" reads the {}, and there is none", program.name, layout.name));
            for binding in *used {
                match known.resource(binding.slot, binding.name) {
                    Resource::Buffer(buffer) => self.use_buffer(uses, buffer, binding.access, binding.stages),
                    Resource::Image(image) | Resource::Sampled(Sampled { image, .. }) => {
                        self.use_image(uses, image, binding.access, binding.stages);
                    }
                }
            }
            sets.push(known.set.pooled.raw);
        }
        sets
    }

    /// One dispatch of `groups` workgroups.
    ///
    /// # Errors
    /// When the driver refuses a descriptor or a layout.
    pub fn compute<B: Bindings<'a>>(
        &mut self,
        name: &str,
        bindings: &B,
        constants: &B::Constants,
        push: &B::Push,
        groups: [u32; 3],
    ) -> Result<()> {
        self.dispatch(name, bindings, constants, push, Groups::Count(groups))
    }

    /// One indirect dispatch of these workgroups.
    ///
    /// # Errors
    /// As [`Frame::compute`].
    pub fn compute_indirect<B: Bindings<'a>>(
        &mut self,
        name: &str,
        bindings: &B,
        constants: &B::Constants,
        push: &B::Push,
        groups: IndirectGroups<'a>,
    ) -> Result<()> {
        self.dispatch(name, bindings, constants, push, Groups::Indirect(groups))
    }

    fn dispatch<B: Bindings<'a>>(
        &mut self,
        name: &str,
        bindings: &B,
        constants: &B::Constants,
        push: &B::Push,
        groups: Groups<'a>,
    ) -> Result<()> {
        let program = bindings.program();
        let mut uses = Vec::new();
        let own = self.bind(&mut uses, program, &bindings.resources(), None)?;
        let sets = self.shared(&mut uses, program, None);
        if let Groups::Indirect(IndirectGroups { sizes, .. }) = groups {
            self.use_buffer(&mut uses, sizes, Access::IndirectRead, vk::ShaderStageFlags::empty());
        }
        let layout = self.device.layout(program)?;
        self.passes.push(Pass {
            name: name.to_owned(),
            uses,
            pipelines: vec![PipelineKey { program, constants: constants.words(), raster: None }],
            work: RecordedWork::Dispatch(Dispatch {
                program,
                own,
                sets,
                layout,
                push: bytemuck::bytes_of(push).to_vec(),
                groups,
            }),
        });
        Ok(())
    }

    /// Dispatches that are repeated, in the order in which `record` adds them, until neither of `left` has a workgroup
    /// after the last of them; no dispatch may have more workgroups than both had together the time before. Between any
    /// two of them all writes are visible. A frame with such a pass is several submissions.
    ///
    /// # Errors
    /// What `record` returns.
    ///
    /// # Panics
    /// When `record` adds nothing, or anything but dispatches, a bug of the caller.
    pub fn repeat(
        &mut self,
        name: &str,
        left: [IndirectGroups<'a>; 2],
        record: impl FnOnce(&mut Self) -> Result<()>,
    ) -> Result<()> {
        let before = self.passes.len();
        record(self)?;
        let (mut uses, mut pipelines, mut body) = (Vec::new(), Vec::new(), Vec::new());
        for pass in self.passes.drain(before..) {
            let RecordedWork::Dispatch(dispatch) = pass.work else {
                panic!("{name} repeats {}, no dispatch", pass.name)
            };
            uses.extend(pass.uses);
            pipelines.extend(pass.pipelines);
            body.push(dispatch);
        }
        assert!(!body.is_empty(), "{name} repeats nothing");
        for groups in left {
            self.use_buffer(&mut uses, groups.sizes, Access::TransferSrc, vk::ShaderStageFlags::empty());
        }
        let work = RecordedWork::Repeat(Repeat { body, left });
        self.passes.push(Pass { name: name.to_owned(), uses, pipelines, work });
        Ok(())
    }

    /// One dispatch with an invocation per pixel of `size` (rounded up to workgroups).
    ///
    /// # Errors
    /// As [`Frame::compute`].
    pub fn compute_over<B: Bindings<'a>>(
        &mut self,
        name: &str,
        bindings: &B,
        constants: &B::Constants,
        push: &B::Push,
        size: [u32; 2],
    ) -> Result<()> {
        let [x, y, _] = bindings.program().local_size;
        self.compute(name, bindings, constants, push, [size[0].div_ceil(x), size[1].div_ceil(y), 1])
    }

    /// A raster pass: `draws` in order, each with one of the texture sets `pages`.
    ///
    /// # Errors
    /// When the driver refuses a descriptor or a layout.
    pub fn raster<B: Bindings<'a>>(
        &mut self,
        raster: &Raster<'a>,
        bindings: &B,
        pages: &[BoundSet<'a>],
        push: &B::Push,
        draws: Vec<Draw<'a>>,
    ) -> Result<()> {
        let program = bindings.program();
        let mut uses = Vec::new();
        let none = vk::ShaderStageFlags::empty();
        for color in raster.colors.iter().flatten() {
            self.use_image(&mut uses, color.image, Access::ColorTarget, none);
        }
        if let Some(depth) = raster.depth {
            let access = if depth.write || depth.clear { Access::DepthTarget } else { Access::DepthRead };
            self.use_image(&mut uses, depth.image, access, none);
        }
        let depth = raster.depth.map(|d| d.image.id);
        // A pass without draws only clears its attachments: no program binds anything.
        let resources = if draws.is_empty() { Vec::new() } else { bindings.resources() };
        let own = self.bind(&mut uses, program, &resources, depth)?;
        let sets: Vec<_> = pages.iter().map(|pages| self.shared(&mut uses, program, Some(pages))).collect();
        let layout = self.device.layout(program)?;
        let key = RasterKey {
            colors: raster.colors.iter().map(|c| c.map_or(vk::Format::UNDEFINED, |c| c.image.desc().format)).collect(),
            depth: raster.depth.map(|d| (d.image.desc().format, d.write)),
        };
        let mut pipelines = Vec::with_capacity(draws.len());
        for draw in &draws {
            for stream in &draw.streams {
                self.use_buffer(&mut uses, stream.buffer, Access::VertexRead, none);
            }
            self.use_buffer(&mut uses, draw.indices, Access::IndexRead, none);
            let constants = draw.constants.clone();
            pipelines.push(PipelineKey { program, constants, raster: Some(key.clone()) });
        }
        uses.sort_by_key(|u| (u.resource, u.access as u32));
        uses.dedup();

        let colors: Vec<_> = raster
            .colors
            .iter()
            .map(|c| c.map_or((vk::ImageView::null(), None), |c| (c.image.view, c.clear)))
            .collect();
        let depth = raster.depth.map(|d| {
            let layout = if d.write || d.clear {
                vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL
            } else {
                vk::ImageLayout::DEPTH_READ_ONLY_OPTIMAL
            };
            (d.image.view, d.clear, layout)
        });
        let ([left, top], [width, height], [from, to]) = (raster.origin, raster.size, raster.rows);
        let push = bytemuck::bytes_of(push).to_vec();
        let record = move |device: &Device, commands: vk::CommandBuffer, pipelines: &[vk::Pipeline]| {
            let color_infos: Vec<_> = colors
                .iter()
                .map(|&(view, clear)| {
                    attachment(view, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL, clear.is_some()).clear_value(
                        vk::ClearValue { color: vk::ClearColorValue { uint32: clear.unwrap_or_default() } },
                    )
                })
                .collect();
            let depth_info = depth.map(|(view, clear, layout)| {
                let read_only = layout == vk::ImageLayout::DEPTH_READ_ONLY_OPTIMAL;
                let info = attachment(view, layout, clear);
                // STORE counts as a write, which a pass that only tests depth does not declare.
                if read_only { info.store_op(vk::AttachmentStoreOp::NONE) } else { info }
            });
            let area = vk::Rect2D {
                offset: vk::Offset2D { x: left as i32, y: (top + from) as i32 },
                extent: vk::Extent2D { width, height: to - from },
            };
            let mut info =
                vk::RenderingInfo::default().render_area(area).layer_count(1).color_attachments(&color_infos);
            if let Some(depth) = &depth_info {
                info = info.depth_attachment(depth);
            }
            let viewport = vk::Viewport {
                x: left as f32,
                y: top as f32,
                width: width as f32,
                height: height as f32,
                min_depth: 0.0,
                max_depth: 1.0,
            };
            // SAFETY: the command buffer is recording; handles are alive until the frame has finished.
            unsafe {
                device.raw.cmd_begin_rendering(commands, &info);
                device.raw.cmd_set_viewport(commands, 0, &[viewport]);
                device.raw.cmd_set_scissor(commands, 0, &[area]);
                push_constants(device, commands, layout, program, &push);
                let point = vk::PipelineBindPoint::GRAPHICS;
                bind_own(device, commands, point, layout, program, &own);
                let mut bound = (vk::Pipeline::null(), usize::MAX);
                for (draw, &pipeline) in draws.iter().zip(pipelines) {
                    if bound.0 != pipeline {
                        device.raw.cmd_bind_pipeline(commands, vk::PipelineBindPoint::GRAPHICS, pipeline);
                        bound.0 = pipeline;
                    }
                    if bound.1 != draw.pages {
                        bind_sets(device, commands, point, layout, &sets[draw.pages]);
                        bound.1 = draw.pages;
                    }
                    record_draw(device, commands, draw);
                }
                device.raw.cmd_end_rendering(commands);
            }
        };
        self.passes.push(Pass {
            name: raster.name.to_owned(),
            uses,
            pipelines,
            work: RecordedWork::Record(Box::new(record)),
        });
        Ok(())
    }

    /// A pass without a pipeline: copies, fills and clears.
    fn transfer(&mut self, name: &str, uses: Vec<Use>, record: impl FnOnce(&Device, vk::CommandBuffer) + 'a) {
        self.passes.push(Pass {
            name: name.to_owned(),
            uses,
            pipelines: Vec::new(),
            work: RecordedWork::Record(Box::new(move |device, commands, _| record(device, commands))),
        });
    }

    /// Copies a buffer to the start of another.
    pub fn copy_buffer(&mut self, name: &str, from: &'a Buffer, to: &'a Buffer, bytes: u64) {
        let mut uses = Vec::new();
        let none = vk::ShaderStageFlags::empty();
        self.use_buffer(&mut uses, from, Access::TransferSrc, none);
        self.use_buffer(&mut uses, to, Access::TransferDst, none);
        let region = vk::BufferCopy { src_offset: 0, dst_offset: 0, size: bytes };
        let (from, to) = (from.raw, to.raw);
        // SAFETY: the command buffer is recording; handles are alive until the frame has finished.
        self.transfer(name, uses, move |device, commands| unsafe {
            device.raw.cmd_copy_buffer(commands, from, to, &[region]);
        });
    }

    /// Sets every word of a buffer.
    pub fn fill(&mut self, name: &str, buffer: &'a Buffer, word: u32) {
        let mut uses = Vec::new();
        self.use_buffer(&mut uses, buffer, Access::TransferDst, vk::ShaderStageFlags::empty());
        let raw = buffer.raw;
        // SAFETY: as in `copy_buffer`.
        self.transfer(name, uses, move |device, commands| unsafe {
            device.raw.cmd_fill_buffer(commands, raw, 0, vk::WHOLE_SIZE, word);
        });
    }

    /// Sets every component of a colour image to 0.
    pub fn clear(&mut self, name: &str, image: &'a Image) {
        let mut uses = Vec::new();
        self.use_image(&mut uses, image, Access::TransferDst, vk::ShaderStageFlags::empty());
        let (raw, range) = (image.raw, image.range());
        self.transfer(name, uses, move |device, commands| {
            let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
            // SAFETY: as in `copy_buffer`.
            unsafe {
                let black = vk::ClearColorValue::default();
                device.raw.cmd_clear_color_image(commands, raw, layout, &black, &[range]);
            }
        });
    }

    /// Copies tightly packed texels to one layer: `levels` holds the byte offset of each mip level.
    pub fn upload(&mut self, name: &str, from: &'a Buffer, to: &'a Image, layer: u32, levels: &[u64]) {
        let mut uses = Vec::new();
        let none = vk::ShaderStageFlags::empty();
        self.use_buffer(&mut uses, from, Access::TransferSrc, none);
        self.use_image(&mut uses, to, Access::TransferDst, none);
        let desc = to.desc();
        let regions: Vec<_> = levels
            .iter()
            .enumerate()
            .map(|(level, &offset)| {
                let level = level as u32;
                region(offset, to.aspect(), level, layer, [(desc.width >> level).max(1), (desc.height >> level).max(1)])
            })
            .collect();
        let (from, to) = (from.raw, to.raw);
        self.transfer(name, uses, move |device, commands| {
            let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
            // SAFETY: as in `copy_buffer`.
            unsafe { device.raw.cmd_copy_buffer_to_image(commands, from, to, layout, &regions) };
        });
    }

    /// Copies the base level of an image to a buffer, tightly packed.
    pub fn download(&mut self, name: &str, from: &'a Image, to: &'a Buffer) {
        let mut uses = Vec::new();
        let none = vk::ShaderStageFlags::empty();
        self.use_image(&mut uses, from, Access::TransferSrc, none);
        self.use_buffer(&mut uses, to, Access::TransferDst, none);
        let desc = from.desc();
        let region = region(0, from.aspect(), 0, 0, [desc.width, desc.height]);
        let (from, to) = (from.raw, to.raw);
        self.transfer(name, uses, move |device, commands| {
            let layout = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
            // SAFETY: as in `copy_buffer`.
            unsafe { device.raw.cmd_copy_image_to_buffer(commands, from, layout, to, &[region]) };
        });
    }

    /// Makes the device's writes to a buffer visible to [`Buffer::read`].
    pub fn read_back(&mut self, buffer: &'a Buffer) {
        let read = match &buffer.host_copy {
            Some(copy) => {
                self.copy_buffer("read back", buffer, copy, buffer.bytes());
                copy
            }
            None => buffer,
        };
        let mut uses = Vec::new();
        self.use_buffer(&mut uses, read, Access::HostRead, vk::ShaderStageFlags::empty());
        self.transfer("read back", uses, |_, _| ());
    }

    /// The descriptions of the passes so far, in order.
    #[must_use]
    pub fn plan(&self) -> Vec<PassPlan> {
        let of = |key: &PipelineKey| (key.program, key.constants.clone());
        let plan =
            |pass: &Pass<'_>| PassPlan { name: pass.name.clone(), pipelines: pass.pipelines.iter().map(of).collect() };
        self.passes.iter().map(plan).collect()
    }

    /// Creates the pipelines of the passes so far, on drivers that report statistics of them ([`Device::compiled`]).
    ///
    /// # Errors
    /// When the driver refuses a pipeline.
    pub fn compile_where_told(&self) -> Result<()> {
        if !self.device.offers().tells_compiled {
            return Ok(());
        }
        let all: Vec<PipelineKey> = self.passes.iter().flat_map(|pass| pass.pipelines.clone()).collect();
        let keys: Vec<&PipelineKey> = all.iter().collect();
        self.device.with_pipelines(&keys, |pipelines| pipelines.wait_for(&all).map(|_| ()))
    }

    /// Records, submits and waits; GPU times of the passes, in order.
    ///
    /// # Errors
    /// When the driver refuses a pipeline or fails: out of memory, or a lost device.
    pub fn finish(self) -> Result<Vec<PassTime>> {
        let Self { device, passes, targets, without_barriers, own, .. } = self;
        let uses: Vec<Vec<Use>> = passes.iter().map(|pass| pass.uses.clone()).collect();
        let before: HashMap<ResourceId, ResourceState> = targets
            .iter()
            .map(|(&id, target)| {
                let state = match target {
                    Target::Buffer(buffer) => *lock(&buffer.state),
                    Target::Image(image) => *lock(&image.state),
                };
                (id, state)
            })
            .collect();
        let mut states = before.clone();
        let barriers = sync::barriers(&uses, &mut states);
        let begun = Cell::new(0);
        let timed = device.has_timestamps() && !passes.is_empty();
        let names: Vec<String> = passes.iter().map(|pass| pass.name.clone()).collect();
        let wanted: Vec<PipelineKey> = passes.iter().flat_map(|pass| pass.pipelines.clone()).collect();
        let keys: Vec<&PipelineKey> = wanted.iter().collect();
        let count = 2 * passes.len() as u32;
        let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(count.max(1));
        let repeats = passes.iter().any(|pass| matches!(pass.work, RecordedWork::Repeat(_)));
        // SAFETY: command buffers are recorded here, submitted once, and waited for before anything is freed. Every
        // handle in them is borrowed for `'a`, which ends after this function.
        let outcome = unsafe {
            let made = if timed { device.raw.create_query_pool(&info, None) } else { Ok(vk::QueryPool::null()) };
            let queries = made.context("creating timestamps")?;
            // The frame holds the command pool until it has finished: one thread draws at a time.
            let from = lock(&device.commands);
            let outcome = device.with_pipelines(&keys, |pipelines| {
                let (device, from, targets) = (&device, *from, &targets);
                let begun = &begun;
                let recording = Recording { device, from, targets, pipelines, queries, without_barriers, begun };
                if device.time_slices.slice_ms.is_some() || repeats {
                    recording.in_turns(passes, &barriers)
                } else {
                    recording.at_once(passes, &barriers)
                }
            });
            device.raw.destroy_query_pool(queries, None);
            outcome
        };
        drop(own);
        let lost = outcome.as_ref().is_err_and(is_lost);
        if outcome.is_err() {
            states = before;
            sync::barriers(&uses[..begun.get()], &mut states);
        }
        for (id, target) in &targets {
            // Nothing is known of the resources of a lost device.
            let state = if lost { None } else { states.get(id).copied() }.unwrap_or_default();
            match target {
                Target::Buffer(buffer) => *lock(&buffer.state) = state,
                Target::Image(image) => *lock(&image.state) = state,
            }
        }
        Ok(names.into_iter().zip(outcome?).map(|(name, ms)| PassTime { name, ms }).collect())
    }
}

fn attachment<'x>(view: vk::ImageView, layout: vk::ImageLayout, clear: bool) -> vk::RenderingAttachmentInfo<'x> {
    vk::RenderingAttachmentInfo::default()
        .image_view(view)
        .image_layout(layout)
        .load_op(if clear { vk::AttachmentLoadOp::CLEAR } else { vk::AttachmentLoadOp::LOAD })
        .store_op(vk::AttachmentStoreOp::STORE)
}

fn region(
    offset: u64,
    aspect: vk::ImageAspectFlags,
    level: u32,
    layer: u32,
    [width, height]: [u32; 2],
) -> vk::BufferImageCopy {
    vk::BufferImageCopy::default()
        .buffer_offset(offset)
        .image_subresource(vk::ImageSubresourceLayers {
            aspect_mask: aspect,
            mip_level: level,
            base_array_layer: layer,
            layer_count: 1,
        })
        .image_extent(vk::Extent3D { width, height, depth: 1 })
}

unsafe fn record_draw(device: &Device, commands: vk::CommandBuffer, draw: &Draw<'_>) {
    let buffers: Vec<_> = draw.streams.iter().map(|s| s.buffer.raw).collect();
    let offsets: Vec<_> = draw.streams.iter().map(|s| s.offset).collect();
    let strides: Vec<_> = draw.streams.iter().map(|s| u64::from(s.stride)).collect();
    let cull = if draw.cull_back { vk::CullModeFlags::BACK } else { vk::CullModeFlags::NONE };
    let front = if draw.clockwise { vk::FrontFace::CLOCKWISE } else { vk::FrontFace::COUNTER_CLOCKWISE };
    // SAFETY: the command buffer is recording inside a render pass; the ranges were checked on import.
    unsafe {
        let raw = &device.raw;
        raw.cmd_set_cull_mode(commands, cull);
        raw.cmd_set_front_face(commands, front);
        if !buffers.is_empty() {
            raw.cmd_bind_vertex_buffers2(commands, 0, &buffers, &offsets, None, Some(&strides));
        }
        raw.cmd_bind_index_buffer(commands, draw.indices.raw, 0, vk::IndexType::UINT32);
        raw.cmd_draw_indexed(commands, draw.index_count, 1, draw.first_index, 0, draw.instance);
    }
}
