//! Caches of a device for samplers, layouts and pipelines: one object per distinct description.
//!
//! Read the Vulkan specification, chapters Pipelines, Samplers and Resource Descriptors.

use std::collections::HashMap;

use ash::vk;

use super::shader::{Program, SetLayout};

/// Sampler state: address modes and filters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct SamplerDesc {
    /// Address modes along u and v.
    pub wrap: [vk::SamplerAddressMode; 2],
    /// Magnification filter.
    pub mag: vk::Filter,
    /// Minification filter within a mip level.
    pub min: vk::Filter,
    /// Filter between mip levels; `None` samples only the base level.
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

/// The description that identifies a pipeline: program, specialization constants, and raster state.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct PipelineKey {
    pub(super) program: &'static Program,
    pub(super) constants: Vec<(u32, u32)>,
    pub(super) raster: Option<RasterKey>,
}

/// The state of a graphics pipeline that is not dynamic: attachment formats.
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
    pub(super) layouts: HashMap<&'static Program, Layout>,
    pub(super) set_layouts: HashMap<&'static SetLayout, vk::DescriptorSetLayout>,
    pub(super) pipelines: HashMap<PipelineKey, vk::Pipeline>,
    pub(super) samplers: HashMap<SamplerDesc, vk::Sampler>,
    /// SPIR-V that replaces the built code, by program name and stage index.
    pub(super) replaced: HashMap<(&'static str, usize), Vec<u32>>,
    pub(super) making_ms: f64,
}

impl Caches {
    /// # Safety
    /// No command buffer in flight uses any of the objects.
    pub(super) unsafe fn destroy(&mut self, raw: &ash::Device) {
        // SAFETY: the caller guarantees that nothing uses the objects.
        unsafe {
            for pipeline in self.pipelines.drain().map(|(_, p)| p) {
                raw.destroy_pipeline(pipeline, None);
            }
            for layout in self.layouts.drain().map(|(_, l)| l) {
                raw.destroy_pipeline_layout(layout.pipeline, None);
                raw.destroy_descriptor_set_layout(layout.set, None);
            }
            for layout in self.set_layouts.drain().map(|(_, l)| l) {
                raw.destroy_descriptor_set_layout(layout, None);
            }
            for sampler in self.samplers.drain().map(|(_, s)| s) {
                raw.destroy_sampler(sampler, None);
            }
        }
    }
}
