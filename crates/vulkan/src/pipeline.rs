//! Pipelines, pipeline layouts and samplers, created once per distinct description.
//!
//! Read the Vulkan specification, chapters Pipelines, Resource Descriptors and Samplers. New pipelines are created on
//! other threads while the frame is recorded.

use std::collections::HashMap;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use anyhow::{Context as _, Result};
use ash::vk;

use super::cache::{Layout, PipelineKey, SamplerDesc};
use super::device::{Device, lock};
use super::float_controls::with_float_controls;
use super::loops::with_loops_counted;
use super::primitive_ids::without_primitive_ids;
use super::shader::{Binding, Program, Replacement, SetLayout};
use super::specialize::specialized;
use super::tables::with_tables_in_storage;

/// A plan has some twenty pipelines, and few of them take most of the time.
const MOST_COMPILING_THREADS: usize = 8;

/// The pipelines of a frame, some of which other threads are still creating.
pub(super) struct Pipelines<'k> {
    slots: HashMap<&'k PipelineKey, OnceLock<Result<vk::Pipeline, vk::Result>>>,
}

/// On drop, completes every pending pipeline with an error: waiting threads return even when the creating thread
/// panics.
struct Settled<'p, 'k>(&'p Pipelines<'k>);

impl Drop for Settled<'_, '_> {
    fn drop(&mut self) {
        for slot in self.0.slots.values() {
            let _ = slot.set(Err(vk::Result::ERROR_UNKNOWN));
        }
    }
}

impl Pipelines<'_> {
    /// Whether the pipelines of all `keys` exist or have failed.
    pub(super) fn ready(&self, keys: &[PipelineKey]) -> bool {
        keys.iter().all(|key| self.slots[key].get().is_some())
    }

    /// The pipelines of `keys`; waits until they exist.
    ///
    /// # Errors
    /// When the driver refuses a pipeline.
    pub(super) fn wait_for(&self, keys: &[PipelineKey]) -> Result<Vec<vk::Pipeline>> {
        let one = |key: &PipelineKey| {
            self.slots[key].wait().with_context(|| format!("creating pipeline \"{}\"", key.program.name))
        };
        keys.iter().map(one).collect()
    }
}

/// Calls `make` once for each of `all`, in their order, from as many threads, of which the calling one is the first.
fn in_threads<T: Copy + Sync>(threads: usize, all: &[T], make: impl Fn(T) + Sync) {
    let next = AtomicUsize::new(0);
    let make_some = || {
        while let Some(&one) = all.get(next.fetch_add(1, Ordering::Relaxed)) {
            make(one);
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..threads.min(all.len()) {
            scope.spawn(make_some);
        }
        make_some();
    });
}

impl Device {
    /// Milliseconds spent in the creation of pipelines so far.
    #[must_use]
    pub fn pipelines_ms(&self) -> f64 {
        lock(&self.caches).making_ms
    }

    /// Every pipeline created so far: program and specialization constants, in no order.
    #[must_use]
    pub fn pipelines(&self) -> Vec<(&'static Program, Vec<(u32, u32)>)> {
        lock(&self.caches).pipelines.keys().map(|key| (key.program, key.constants.clone())).collect()
    }

    pub(super) fn sampler(&self, desc: SamplerDesc) -> Result<vk::Sampler> {
        let mut caches = lock(&self.caches);
        if let Some(&sampler) = caches.samplers.get(&desc) {
            return Ok(sampler);
        }
        let info = vk::SamplerCreateInfo::default()
            .mag_filter(desc.mag)
            .min_filter(desc.min)
            .mipmap_mode(desc.mip.unwrap_or(vk::SamplerMipmapMode::NEAREST))
            .address_mode_u(desc.wrap[0])
            .address_mode_v(desc.wrap[1])
            .address_mode_w(vk::SamplerAddressMode::CLAMP_TO_EDGE)
            // A quarter still rounds to level 0, and does not count as magnification (the specification's note on
            // VkSamplerCreateInfo).
            .max_lod(if desc.mip.is_some() { vk::LOD_CLAMP_NONE } else { 0.25 });
        // SAFETY: a valid create info.
        let sampler = unsafe { self.raw.create_sampler(&info, None) }.context("creating a sampler")?;
        self.note("sampler", "sampler", 0);
        caches.samplers.insert(desc, sampler);
        Ok(sampler)
    }

    /// The layout of a shared descriptor set (set 1 or 2).
    pub(super) fn set_layout(&self, layout: &'static SetLayout) -> Result<vk::DescriptorSetLayout> {
        let mut caches = lock(&self.caches);
        if let Some(&known) = caches.set_layouts.get(layout) {
            return Ok(known);
        }
        let slots = self.slots(layout.bindings);
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&slots);
        // SAFETY: a valid create info, taken from reflection.
        let made = unsafe { self.raw.create_descriptor_set_layout(&info, None) }
            .with_context(|| format!("creating the layout of the {}", layout.name))?;
        caches.set_layouts.insert(layout, made);
        Ok(made)
    }

    pub(super) fn layout(&self, program: &'static Program) -> Result<Layout> {
        let shared = program.sets.iter().map(|set| self.set_layout(set.layout)).collect::<Result<Vec<_>>>()?;
        let mut caches = lock(&self.caches);
        if let Some(&layout) = caches.layouts.get(program) {
            return Ok(layout);
        }
        let creating = || format!("creating the layout of \"{}\"", program.name);
        let slots = self.slots(program.bindings);
        let mut info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&slots);
        if self.offers().push_descriptors {
            info = info.flags(vk::DescriptorSetLayoutCreateFlags::PUSH_DESCRIPTOR_KHR);
        }
        // SAFETY: valid create infos, taken from reflection.
        let layout = unsafe {
            let set = self.raw.create_descriptor_set_layout(&info, None).with_context(creating)?;
            let sets = [&[set][..], &shared].concat();
            let stages = program.stages.iter().fold(vk::ShaderStageFlags::empty(), |all, s| all | s.flag);
            let ranges = [vk::PushConstantRange { stage_flags: stages, offset: 0, size: program.push_bytes }];
            let mut info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
            if program.push_bytes > 0 {
                info = info.push_constant_ranges(&ranges);
            }
            match self.raw.create_pipeline_layout(&info, None) {
                Ok(pipeline) => Layout { set, pipeline },
                Err(error) => {
                    self.raw.destroy_descriptor_set_layout(set, None);
                    return Err(error).with_context(creating);
                }
            }
        };
        caches.layouts.insert(program, layout);
        Ok(layout)
    }

    /// Runs `meanwhile` while other threads create those pipelines of `keys` that do not exist yet, in the order of
    /// `keys`: one thread on software devices, several on others, and under validation the calling thread
    /// (docs/decisions/specialization.md).
    ///
    /// # Errors
    /// Errors of `meanwhile`; it sees errors of pipeline creation when it waits for that pipeline.
    pub(super) fn with_pipelines<T>(
        &self,
        keys: &[&PipelineKey],
        meanwhile: impl FnOnce(&Pipelines<'_>) -> Result<T>,
    ) -> Result<T> {
        let mut pipelines = Pipelines { slots: HashMap::new() };
        let mut missing = Vec::new();
        for &key in keys {
            pipelines.slots.entry(key).or_insert_with(|| {
                let made = lock(&self.caches).pipelines.get(key).copied();
                if made.is_none() {
                    missing.push(key);
                }
                made.map_or_else(OnceLock::new, |pipeline| OnceLock::from(Ok(pipeline)))
            });
        }
        if missing.is_empty() {
            return meanwhile(&pipelines);
        }
        let make_all = || {
            let _end = Settled(&pipelines);
            let start = Instant::now();
            in_threads(self.compiling_threads(), &missing, |key| {
                let _ = pipelines.slots[key].set(self.make(key));
            });
            lock(&self.caches).making_ms += start.elapsed().as_secs_f64() * 1e3;
        };
        let result = if self.validates() {
            make_all();
            meanwhile(&pipelines)
        } else {
            std::thread::scope(|scope| {
                scope.spawn(make_all);
                meanwhile(&pipelines)
            })
        };
        let mut caches = lock(&self.caches);
        for key in missing {
            if let Some(&Ok(pipeline)) = pipelines.slots[key].get() {
                self.note("pipeline", key.program.name, 0);
                caches.pipelines.insert(key.clone(), pipeline);
            }
        }
        result
    }

    /// Replaces the SPIR-V of the given stages and restores the built code of all others. No frame may be in flight.
    pub fn replace(&self, replacements: &[Replacement]) {
        let mut caches = lock(&self.caches);
        let code: HashMap<(&'static str, usize), Vec<u32>> =
            replacements.iter().map(|r| ((r.program, r.stage), r.words.clone())).collect();
        let before = std::mem::replace(&mut caches.replaced, code);
        let stages = before.keys().chain(caches.replaced.keys());
        let changed: Vec<&str> =
            stages.filter(|stage| before.get(stage) != caches.replaced.get(stage)).map(|stage| stage.0).collect();
        let old = |key: &PipelineKey, _: &mut vk::Pipeline| changed.contains(&key.program.name);
        for (_, pipeline) in caches.pipelines.extract_if(old) {
            // SAFETY: every frame has been waited for.
            unsafe { self.raw.destroy_pipeline(pipeline, None) };
            self.gone();
        }
    }

    /// Threads that create pipelines at once. lavapipe creates them in the context of its queue, without a lock.
    fn compiling_threads(&self) -> usize {
        if self.is_software() || self.validates() {
            return 1;
        }
        std::thread::available_parallelism().map_or(1, |all| all.get().min(MOST_COMPILING_THREADS))
    }

    fn make(&self, key: &PipelineKey) -> Result<vk::Pipeline, vk::Result> {
        let mut modules = Vec::new();
        let pipeline = self.build(key, &mut modules);
        for module in modules {
            // SAFETY: modules are only needed while pipelines are created.
            unsafe { self.raw.destroy_shader_module(module, None) };
        }
        self.name(pipeline?, key.program.name);
        pipeline
    }

    /// Passes SPIR-V to the validation layer, for tests of its messages.
    ///
    /// # Errors
    /// When the driver refuses the module.
    ///
    /// # Panics
    /// Without validation.
    #[doc(hidden)]
    pub fn try_module(&self, words: &[u32]) -> Result<()> {
        assert!(self.validates(), "a driver trusts what it is given");
        let info = vk::ShaderModuleCreateInfo::default().code(words);
        // SAFETY: the layer refuses invalid code before the driver sees it; nobody else has the module.
        unsafe {
            let module = self.raw.create_shader_module(&info, None).context("creating a shader module")?;
            self.raw.destroy_shader_module(module, None);
        }
        Ok(())
    }

    fn slots(&self, bindings: &[Binding]) -> Vec<vk::DescriptorSetLayoutBinding<'static>> {
        let slot = |binding: &Binding| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(binding.slot)
                .descriptor_type(binding.kind.descriptor_type(self.offers().texel_buffers))
                .descriptor_count(1)
                .stage_flags(binding.stages)
        };
        bindings.iter().map(slot).collect()
    }

    fn build(&self, key: &PipelineKey, modules: &mut Vec<vk::ShaderModule>) -> Result<vk::Pipeline, vk::Result> {
        let program = key.program;
        // The layout was created when the pass was described.
        let layout = lock(&self.caches).layouts[program].pipeline;
        let mut stages = Vec::new();
        for (index, stage) in program.stages.iter().enumerate() {
            let replaced = lock(&self.caches).replaced.get(&(program.name, index)).cloned();
            let words = specialized(replaced.as_deref().unwrap_or(stage.words), &key.constants);
            let mut words = with_loops_counted(&words, self.limits_loops());
            // lavapipe keeps them without a request (tests of bits and of NaN hold there); the cost of a request was
            // not measured.
            if !self.is_lavapipe() {
                words = with_float_controls(&words, self.offers());
            }
            if !self.offers().primitive_ids {
                words = without_primitive_ids(&words);
            }
            if !self.offers().texel_buffers {
                words = with_tables_in_storage(&words);
            }
            let info = vk::ShaderModuleCreateInfo::default().code(&words);
            // SAFETY: the words come from glslang.
            let module = unsafe { self.raw.create_shader_module(&info, None) }?;
            modules.push(module);
            stages.push(vk::PipelineShaderStageCreateInfo::default().stage(stage.flag).module(module).name(c"main"));
        }
        let Some(raster) = &key.raster else {
            let mut flags = self.capture();
            if self.time_slices.slice_ms.is_some() {
                flags |= vk::PipelineCreateFlags::DISPATCH_BASE;
            }
            let mut told = vk::PipelineCreationFeedback::default();
            let mut feedback = vk::PipelineCreationFeedbackCreateInfo::default().pipeline_creation_feedback(&mut told);
            let info = vk::ComputePipelineCreateInfo::default()
                .flags(flags)
                .stage(stages[0])
                .layout(layout)
                .push_next(&mut feedback);
            // SAFETY: a valid create info whose pointees outlive the call.
            let made = unsafe { self.raw.create_compute_pipelines(self.kept_pipelines.raw, &[info], None) };
            self.kept_pipelines.note(told);
            return made.map(|p| p[0]).map_err(|(_, error)| error);
        };
        let formats = [
            vk::Format::UNDEFINED,
            vk::Format::R32_SFLOAT,
            vk::Format::R32G32_SFLOAT,
            vk::Format::R32G32B32_SFLOAT,
            vk::Format::R32G32B32A32_SFLOAT,
        ];
        let attributes: Vec<_> = program
            .inputs
            .iter()
            .map(|input| vk::VertexInputAttributeDescription {
                location: input.location,
                binding: input.location,
                format: formats[input.components as usize],
                offset: 0,
            })
            .collect();
        let streams: Vec<_> = program
            .inputs
            .iter()
            .map(|input| vk::VertexInputBindingDescription {
                binding: input.location,
                stride: 4 * input.components,
                input_rate: vk::VertexInputRate::VERTEX,
            })
            .collect();
        let vertex = vk::PipelineVertexInputStateCreateInfo::default()
            .vertex_binding_descriptions(&streams)
            .vertex_attribute_descriptions(&attributes);
        let assembly =
            vk::PipelineInputAssemblyStateCreateInfo::default().topology(vk::PrimitiveTopology::TRIANGLE_LIST);
        let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
        let raster_state = vk::PipelineRasterizationStateCreateInfo::default().line_width(1.0);
        let multisample =
            vk::PipelineMultisampleStateCreateInfo::default().rasterization_samples(vk::SampleCountFlags::TYPE_1);
        // Reversed depth: nearer is greater. Equal depth passes, so the later of two coplanar draws wins on every
        // device.
        let depth = vk::PipelineDepthStencilStateCreateInfo::default()
            .depth_test_enable(raster.depth.is_some())
            .depth_write_enable(raster.depth.is_some_and(|(_, write)| write))
            .depth_compare_op(vk::CompareOp::GREATER_OR_EQUAL);
        let attachments = vec![
            vk::PipelineColorBlendAttachmentState::default()
                .color_write_mask(vk::ColorComponentFlags::RGBA);
            raster.colors.len()
        ];
        let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&attachments);
        let dynamic = [
            vk::DynamicState::VIEWPORT,
            vk::DynamicState::SCISSOR,
            vk::DynamicState::CULL_MODE,
            vk::DynamicState::FRONT_FACE,
            vk::DynamicState::VERTEX_INPUT_BINDING_STRIDE,
        ];
        let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic);
        let mut rendering = vk::PipelineRenderingCreateInfo::default().color_attachment_formats(&raster.colors);
        if let Some((format, _)) = raster.depth {
            rendering = rendering.depth_attachment_format(format);
        }
        let mut told = vk::PipelineCreationFeedback::default();
        let mut feedback = vk::PipelineCreationFeedbackCreateInfo::default().pipeline_creation_feedback(&mut told);
        let info = vk::GraphicsPipelineCreateInfo::default()
            .flags(self.capture())
            .stages(&stages)
            .vertex_input_state(&vertex)
            .input_assembly_state(&assembly)
            .viewport_state(&viewport)
            .rasterization_state(&raster_state)
            .multisample_state(&multisample)
            .depth_stencil_state(&depth)
            .color_blend_state(&blend)
            .dynamic_state(&dynamic)
            .layout(layout)
            .push_next(&mut rendering)
            .push_next(&mut feedback);
        // SAFETY: a valid create info whose pointees outlive the call.
        let made = unsafe { self.raw.create_graphics_pipelines(self.kept_pipelines.raw, &[info], None) };
        self.kept_pipelines.note(told);
        made.map(|p| p[0]).map_err(|(_, error)| error)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;
    use std::thread::ThreadId;

    use super::*;

    #[test]
    fn each_is_made_once_by_as_many_threads() {
        for (threads, count) in [(1, 5), (3, 2), (4, 9), (8, 0)] {
            let all: Vec<usize> = (0..count).collect();
            let made: Mutex<Vec<(usize, ThreadId)>> = Mutex::default();
            let together = std::sync::Barrier::new(threads.min(count).max(1));
            in_threads(threads, &all, |one| {
                if one < threads {
                    // The first ones wait for each other: a thread has one of them each.
                    together.wait();
                }
                lock(&made).push((one, std::thread::current().id()));
            });
            let mut made = made.into_inner().expect("no panic");
            made.sort_by_key(|(one, _)| *one);
            assert!(made.iter().map(|(one, _)| *one).eq(0..count), "{threads} threads, {count}: {made:?}");
            let mut ids: Vec<_> = made.iter().map(|(_, id)| format!("{id:?}")).collect();
            ids.sort();
            ids.dedup();
            assert_eq!(ids.len(), threads.min(count), "{made:?}");
        }
    }
}
