//! Pipelines, layouts and samplers, made once per distinct description.

use anyhow::{Context as _, Result};
use ash::vk;

use super::cache::{Layout, PipelineKey, SamplerDesc};
use super::device::{Device, lock};
use super::shader::Program;

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
        let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic);
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
