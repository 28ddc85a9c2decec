//! Bindings of programs: the resources behind each descriptor.
//!
//! Read the Vulkan specification, chapter Resource Descriptors. The build generates one [`Bindings`] type per program.

use anyhow::Result;
use ash::vk;

use super::cache::SamplerDesc;
use super::device::Device;
use super::memory::{Buffer, Image};
use super::shader::{Binding, BindingKind, Program, Specialization};
use super::sync::ResourceId;

/// An image with its sampler (a combined image sampler).
#[derive(Clone, Copy)]
pub struct Sampled<'a> {
    /// The image.
    pub image: &'a Image,
    /// Sampler state.
    pub sampler: SamplerDesc,
}

/// The resource that one binding points at.
#[derive(Clone, Copy)]
pub enum Resource<'a> {
    /// Any kind of buffer.
    Buffer(&'a Buffer),
    /// A storage image.
    Image(&'a Image),
    /// An image with a sampler.
    Sampled(Sampled<'a>),
}

impl Resource<'_> {
    pub(super) fn id(&self) -> ResourceId {
        match self {
            Self::Buffer(buffer) => buffer.id,
            Self::Image(image) => image.id,
            Self::Sampled(sampled) => sampled.image.id,
        }
    }
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

/// A generated struct with one field per binding in a program's own descriptor set, set 0.
pub trait Bindings<'a> {
    /// The program's specialization constants.
    type Constants: Specialization;
    /// The program's push constants.
    type Push: bytemuck::NoUninit;
    /// The program the fields belong to.
    fn program(&self) -> &'static Program;
    /// The fields in slot order, parallel to [`Program::bindings`].
    fn resources(&self) -> Vec<Resource<'a>>;
}

/// A descriptor ready for a push or a write.
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
            (BindingKind::StorageTexelBuffer, Resource::Buffer(buffer)) if device.offers().texel_buffers => {
                assert!(buffer.view != vk::BufferView::null(), "a texel buffer needs `Buffer::texels`");
                Self::Texels(buffer.view)
            }
            (
                BindingKind::UniformBuffer | BindingKind::StorageBuffer | BindingKind::StorageTexelBuffer,
                Resource::Buffer(buffer),
            ) => Self::Buffer(vk::DescriptorBufferInfo { buffer: buffer.raw, offset: 0, range: vk::WHOLE_SIZE }),
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

    /// The descriptor write for the slot of a binding.
    pub(super) fn write(&self, device: &Device, binding: &Binding) -> vk::WriteDescriptorSet<'_> {
        let kind = binding.kind.descriptor_type(device.offers().texel_buffers);
        let write = vk::WriteDescriptorSet::default().dst_binding(binding.slot).descriptor_type(kind);
        match self {
            Self::Buffer(info) => write.buffer_info(std::slice::from_ref(info)),
            Self::Texels(view) => write.texel_buffer_view(std::slice::from_ref(view)),
            Self::Image(info) => write.image_info(std::slice::from_ref(info)),
        }
    }
}
