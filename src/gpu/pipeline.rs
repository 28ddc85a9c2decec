//! Pipelines, layouts and samplers, made once per distinct description; and what a descriptor can point at.

use std::collections::HashMap;

use anyhow::{Context as _, Result};
use ash::vk;

use super::device::{Device, lock};
use super::memory::{Buffer, Image};
use super::shader::{BindingKind, Program};

/// An image with the sampler it is read through.
#[derive(Clone, Copy)]
pub struct Sampled<'a> {
    /// The image.
    pub image: &'a Image,
    /// How it is read.
    pub sampler: SamplerDesc,
}

/// How an image is sampled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct SamplerDesc {
    /// Along u and v.
    pub wrap: [vk::SamplerAddressMode; 2],
    /// Magnification.
    pub mag: vk::Filter,
    /// Minification within a level.
    pub min: vk::Filter,
    /// Between levels; `None` stays on the base level.
    pub mip: Option<vk::SamplerMipmapMode>,
}

impl SamplerDesc {
    /// Bilinear, clamped, no mips.
    pub const LINEAR: Self = Self {
        wrap: [vk::SamplerAddressMode::CLAMP_TO_EDGE; 2],
        mag: vk::Filter::LINEAR,
        min: vk::Filter::LINEAR,
        mip: None,
    };
    /// Nearest, clamped, no mips: for fetches.
    pub const NEAREST: Self = Self { mag: vk::Filter::NEAREST, min: vk::Filter::NEAREST, ..Self::LINEAR };
    /// Trilinear equirectangular map: wraps in u only.
    pub const EQUIRECTANGULAR: Self = Self {
        wrap: [vk::SamplerAddressMode::REPEAT, vk::SamplerAddressMode::CLAMP_TO_EDGE],
        mip: Some(vk::SamplerMipmapMode::LINEAR),
        ..Self::LINEAR
    };
}

/// What one binding points at.
#[derive(Clone, Copy)]
pub enum Resource<'a> {
    /// Any kind of buffer.
    Buffer(&'a Buffer),
    /// A storage image.
    Image(&'a Image),
    /// An image with a sampler.
    Sampled(Sampled<'a>),
}

impl<'a> From<&'a Buffer> for Resource<'a> {
    fn from(buffer: &'a Buffer) -> Self {
        Self::Buffer(buffer)
    }
}

impl<'a> From<&'a Image> for Resource<'a> {
    fn from(image: &'a Image) -> Self {
        Self::Image(image)
    }
}

impl<'a> From<Sampled<'a>> for Resource<'a> {
    fn from(sampled: Sampled<'a>) -> Self {
        Self::Sampled(sampled)
    }
}

/// Everything that decides which pipeline a draw or dispatch needs.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct PipelineKey {
    pub(super) program: &'static str,
    pub(super) constants: Vec<(u32, u32)>,
    pub(super) raster: Option<RasterKey>,
}

/// The part of a raster pipeline that is not dynamic.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct RasterKey {
    pub(super) colors: Vec<vk::Format>,
    pub(super) depth: Option<(vk::Format, bool)>,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    pub(super) set: vk::DescriptorSetLayout,
    pub(super) pipeline: vk::PipelineLayout,
}

#[derive(Default)]
pub(super) struct Caches {
    layouts: HashMap<&'static str, Layout>,
    pipelines: HashMap<PipelineKey, vk::Pipeline>,
    samplers: HashMap<SamplerDesc, vk::Sampler>,
    spirv_bytes: usize,
}

impl Caches {
    /// # Safety
    /// Nothing that was handed out may be in use.
    pub(super) unsafe fn destroy(&mut self, raw: &ash::Device) {
        // SAFETY: by the caller's promise.
        unsafe {
            for pipeline in self.pipelines.drain().map(|(_, p)| p) {
                raw.destroy_pipeline(pipeline, None);
            }
            for layout in self.layouts.drain().map(|(_, l)| l) {
                raw.destroy_pipeline_layout(layout.pipeline, None);
                raw.destroy_descriptor_set_layout(layout.set, None);
            }
            for sampler in self.samplers.drain().map(|(_, s)| s) {
                raw.destroy_sampler(sampler, None);
            }
        }
    }
}

impl Device {
    /// (pipelines made, bytes of SPIR-V in them).
    #[must_use]
    pub fn pipelines(&self) -> (usize, usize) {
        let caches = lock(&self.caches);
        (caches.pipelines.len(), caches.spirv_bytes)
    }

    /// Every pipeline by program name and specialization constants, sorted.
    #[must_use]
    pub fn pipeline_list(&self) -> Vec<(&'static str, Vec<(u32, u32)>)> {
        let mut list: Vec<_> =
            lock(&self.caches).pipelines.keys().map(|key| (key.program, key.constants.clone())).collect();
        list.sort();
        list
    }

    pub(super) fn sampler(&self, desc: SamplerDesc) -> Result<vk::Sampler> {
        if let Some(&sampler) = lock(&self.caches).samplers.get(&desc) {
            return Ok(sampler);
        }
        let info = vk::SamplerCreateInfo::default()
            .mag_filter(desc.mag)
            .min_filter(desc.min)
            .mipmap_mode(desc.mip.unwrap_or(vk::SamplerMipmapMode::NEAREST))
            .address_mode_u(desc.wrap[0])
            .address_mode_v(desc.wrap[1])
            .address_mode_w(vk::SamplerAddressMode::CLAMP_TO_EDGE)
            .max_lod(if desc.mip.is_some() { vk::LOD_CLAMP_NONE } else { 0.0 });
        // SAFETY: a valid create info.
        let sampler = unsafe { self.raw.create_sampler(&info, None) }.context("creating a sampler")?;
        self.note("sampler", "sampler", 0);
        lock(&self.caches).samplers.insert(desc, sampler);
        Ok(sampler)
    }

    pub(super) fn layout(&self, program: &'static Program) -> Result<Layout> {
        if let Some(&layout) = lock(&self.caches).layouts.get(program.name) {
            return Ok(layout);
        }
        let creating = || format!("creating the layout of \"{}\"", program.name);
        let slots: Vec<_> = program
            .bindings
            .iter()
            .map(|binding| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding.slot)
                    .descriptor_type(binding.kind.descriptor_type())
                    .descriptor_count(1)
                    .stage_flags(binding.stages)
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default()
            .flags(vk::DescriptorSetLayoutCreateFlags::PUSH_DESCRIPTOR_KHR)
            .bindings(&slots);
        // SAFETY: valid create infos, taken from reflection.
        let layout = unsafe {
            let set = self.raw.create_descriptor_set_layout(&info, None).with_context(creating)?;
            let sets = [set];
            let stages = program.stages.iter().fold(vk::ShaderStageFlags::empty(), |all, s| all | s.flag);
            let ranges = [vk::PushConstantRange { stage_flags: stages, offset: 0, size: program.push_bytes }];
            let mut info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
            if program.push_bytes > 0 {
                info = info.push_constant_ranges(&ranges);
            }
            Layout { set, pipeline: self.raw.create_pipeline_layout(&info, None).with_context(creating)? }
        };
        lock(&self.caches).layouts.insert(program.name, layout);
        Ok(layout)
    }

    pub(super) fn pipeline(&self, program: &'static Program, key: PipelineKey) -> Result<vk::Pipeline> {
        if let Some(&pipeline) = lock(&self.caches).pipelines.get(&key) {
            return Ok(pipeline);
        }
        let layout = self.layout(program)?;
        let entries: Vec<_> = key
            .constants
            .iter()
            .enumerate()
            .map(|(i, &(id, _))| vk::SpecializationMapEntry { constant_id: id, offset: 4 * i as u32, size: 4 })
            .collect();
        let values: Vec<u32> = key.constants.iter().map(|&(_, value)| value).collect();
        let special = vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(&values));
        let mut modules = Vec::new();
        let pipeline = self.build(program, &key, layout, &special, &mut modules);
        for module in modules {
            // SAFETY: modules are only needed while pipelines are created.
            unsafe { self.raw.destroy_shader_module(module, None) };
        }
        let pipeline = pipeline.with_context(|| format!("creating pipeline \"{}\"", program.name))?;
        self.note("pipeline", program.name, 0);
        self.name(pipeline, program.name);
        let mut caches = lock(&self.caches);
        caches.spirv_bytes += program.spirv_bytes();
        caches.pipelines.insert(key, pipeline);
        Ok(pipeline)
    }

    fn build(
        &self,
        program: &'static Program,
        key: &PipelineKey,
        layout: Layout,
        special: &vk::SpecializationInfo<'_>,
        modules: &mut Vec<vk::ShaderModule>,
    ) -> Result<vk::Pipeline> {
        let mut stages = Vec::new();
        for stage in program.stages {
            let info = vk::ShaderModuleCreateInfo::default().code(stage.words);
            // SAFETY: the words come from glslang.
            let module = unsafe { self.raw.create_shader_module(&info, None) }?;
            modules.push(module);
            stages.push(
                vk::PipelineShaderStageCreateInfo::default()
                    .stage(stage.flag)
                    .module(module)
                    .name(c"main")
                    .specialization_info(special),
            );
        }
        let Some(raster) = &key.raster else {
            let info = vk::ComputePipelineCreateInfo::default().stage(stages[0]).layout(layout.pipeline);
            // SAFETY: a valid create info whose pointees outlive the call.
            let made = unsafe { self.raw.create_compute_pipelines(vk::PipelineCache::null(), &[info], None) };
            return made.map(|p| p[0]).map_err(|(_, error)| error.into());
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
        // Reversed depth: nearer is greater. Equal passes, so that the later of two coplanar draws wins on every machine.
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
        // A fragment-only program without streams still has the dynamic stride state, which then sets nothing.
        let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(if program.inputs.is_empty() {
            &dynamic[..4]
        } else {
            &dynamic
        });
        let mut rendering = vk::PipelineRenderingCreateInfo::default().color_attachment_formats(&raster.colors);
        if let Some((format, _)) = raster.depth {
            rendering = rendering.depth_attachment_format(format);
        }
        let info = vk::GraphicsPipelineCreateInfo::default()
            .stages(&stages)
            .vertex_input_state(&vertex)
            .input_assembly_state(&assembly)
            .viewport_state(&viewport)
            .rasterization_state(&raster_state)
            .multisample_state(&multisample)
            .depth_stencil_state(&depth)
            .color_blend_state(&blend)
            .dynamic_state(&dynamic)
            .layout(layout.pipeline)
            .push_next(&mut rendering);
        // SAFETY: a valid create info whose pointees outlive the call.
        let made = unsafe { self.raw.create_graphics_pipelines(vk::PipelineCache::null(), &[info], None) };
        made.map(|p| p[0]).map_err(|(_, error)| error.into())
    }
}

/// A descriptor ready to be pushed.
#[derive(Clone, Copy)]
pub(super) enum Descriptor {
    Buffer(vk::DescriptorBufferInfo),
    Texels(vk::BufferView),
    Image(vk::DescriptorImageInfo),
}

impl Descriptor {
    pub(super) fn new(
        device: &Device,
        kind: BindingKind,
        resource: Resource<'_>,
        layout: vk::ImageLayout,
    ) -> Result<Self> {
        Ok(match (kind, resource) {
            (BindingKind::UniformTexelBuffer | BindingKind::StorageTexelBuffer, Resource::Buffer(buffer)) => {
                assert!(buffer.view != vk::BufferView::null(), "a texel buffer needs `Buffer::texels`");
                Self::Texels(buffer.view)
            }
            (BindingKind::UniformBuffer | BindingKind::StorageBuffer, Resource::Buffer(buffer)) => {
                Self::Buffer(vk::DescriptorBufferInfo { buffer: buffer.raw, offset: 0, range: vk::WHOLE_SIZE })
            }
            (BindingKind::StorageImage, Resource::Image(image)) => Self::Image(vk::DescriptorImageInfo {
                sampler: vk::Sampler::null(),
                image_view: image.view,
                image_layout: layout,
            }),
            (BindingKind::SampledImage, Resource::Sampled(sampled)) => Self::Image(vk::DescriptorImageInfo {
                sampler: device.sampler(sampled.sampler)?,
                image_view: sampled.image.view,
                image_layout: layout,
            }),
            _ => unreachable!("build.rs gives each kind of binding its type"),
        })
    }
}
