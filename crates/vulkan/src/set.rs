//! Descriptor sets that are written once and bound by many dispatches: scene data, light and path data, textures of
//! materials.
//!
//! Read the Vulkan specification, chapter Resource Descriptors, section Descriptor Sets. Each set has a descriptor pool
//! of its own.

use std::sync::Arc;

use anyhow::{Context as _, Result};
use ash::vk;

use super::bind::{Descriptor, Resource, Sampled};
use super::cache::SamplerDesc;
use super::device::Device;
use super::memory::{Buffer, Image, NOTHING, Place};
use super::shader::{Binding, BindingKind, SetLayout};
use super::sync::ResourceId;

/// A descriptor set with the pool that it was allocated from.
pub(super) struct Pooled {
    pub(super) raw: vk::DescriptorSet,
    pool: vk::DescriptorPool,
    device: Arc<Device>,
}

impl Pooled {
    /// An unwritten set for a layout with these bindings.
    pub(super) fn new(
        device: &Arc<Device>,
        bindings: &[Binding],
        layout: vk::DescriptorSetLayout,
        creating: impl Fn() -> String,
    ) -> Result<Self> {
        let of = |b: &Binding| vk::DescriptorPoolSize {
            ty: b.kind.descriptor_type(device.offers().texel_buffers),
            descriptor_count: 1,
        };
        let sizes: Vec<_> = bindings.iter().map(of).collect();
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        let layouts = [layout];
        // SAFETY: valid infos; the pool has room for exactly this set.
        unsafe {
            let pool = device.raw.create_descriptor_pool(&info, None).with_context(&creating)?;
            let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
            match device.raw.allocate_descriptor_sets(&info) {
                Ok(sets) => Ok(Self { raw: sets[0], pool, device: device.clone() }),
                Err(error) => {
                    device.raw.destroy_descriptor_pool(pool, None);
                    Err(error).with_context(creating)
                }
            }
        }
    }

    /// Writes the descriptor of a binding.
    ///
    /// # Safety
    /// Nothing uses the set yet, and the resource outlives every use of the set.
    pub(super) unsafe fn write(&self, binding: &Binding, descriptor: &Descriptor) {
        let write = descriptor.write(&self.device, binding).dst_set(self.raw);
        // SAFETY: the caller guarantees both conditions.
        unsafe { self.device.raw.update_descriptor_sets(&[write], &[]) };
    }
}

impl Drop for Pooled {
    fn drop(&mut self) {
        // SAFETY: every frame has been waited for.
        unsafe { self.device.raw.destroy_descriptor_pool(self.pool, None) };
    }
}

/// A written descriptor set.
pub struct DescriptorSet {
    pub(super) pooled: Pooled,
    layout: &'static SetLayout,
    written: Vec<(u32, ResourceId)>,
    /// Dummy buffer and image in the slots without an entry.
    nothing: Option<(Buffer, Image)>,
}

impl DescriptorSet {
    /// Writes a set from pairs of slot and resource. No program may read a slot without an entry.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, layout: &'static SetLayout, entries: &[(u32, Resource<'_>)]) -> Result<Self> {
        let creating = || format!("creating a descriptor set of the {}", layout.name);
        let pooled = Pooled::new(device, layout.bindings, device.set_layout(layout)?, creating)?;
        // lavapipe 22.3 follows every descriptor of a set, even those that the program does not read
        // (docs/decisions/lavapipe.md).
        let is_whole = layout.bindings.iter().all(|b| entries.iter().any(|(slot, _)| *slot == b.slot));
        let make = || -> Result<(Buffer, Image)> {
            let format = vk::Format::R32G32B32A32_SFLOAT;
            let buffer = Buffer::texels(device, NOTHING, 0, Place::Device, format)?;
            Ok((buffer, Image::nothing(device, format, vk::ImageUsageFlags::SAMPLED)?))
        };
        let set = Self {
            pooled,
            layout,
            nothing: if is_whole { None } else { Some(make()?) },
            written: entries.iter().map(|(slot, resource)| (*slot, resource.id())).collect(),
        };
        for binding in layout.bindings {
            let written = entries.iter().find(|(slot, _)| *slot == binding.slot).map(|(_, resource)| *resource);
            let other = set.nothing.as_ref().map(|(buffer, image)| match binding.kind {
                BindingKind::SampledImage => Resource::Sampled(Sampled { image, sampler: SamplerDesc::NEAREST }),
                _ => Resource::Buffer(buffer),
            });
            let Some(resource) = written.or(other) else { continue };
            let image_layout = binding.access.masks(binding.stages).layout;
            let descriptor = Descriptor::new(device, binding.kind, resource, image_layout)?;
            // SAFETY: nothing uses the set yet; the resource is alive.
            unsafe { set.pooled.write(binding, &descriptor) };
        }
        Ok(set)
    }

    /// The set with the resources that were written to it, for a frame.
    ///
    /// # Panics
    /// When `entries` differ from the written resources, a bug of the caller.
    #[must_use]
    pub fn bind<'a>(&'a self, entries: Vec<(u32, Resource<'a>)>) -> BoundSet<'a> {
        let same = entries.iter().map(|(slot, resource)| (*slot, resource.id())).eq(self.written.iter().copied());
        assert!(same, "a descriptor set of the {} was written with other resources", self.layout.name);
        BoundSet { set: self, entries }
    }
}

/// A written descriptor set with its resources, bound in a frame.
#[derive(Clone)]
pub struct BoundSet<'a> {
    pub(super) set: &'a DescriptorSet,
    entries: Vec<(u32, Resource<'a>)>,
}

impl<'a> BoundSet<'a> {
    pub(super) fn is_of(&self, layout: &'static SetLayout) -> bool {
        std::ptr::eq(self.set.layout, layout)
    }

    /// The resource in a slot.
    ///
    /// # Panics
    /// When the slot has no entry, a bug of the caller.
    pub(super) fn resource(&self, slot: u32, name: &str) -> Resource<'a> {
        let found = self.entries.iter().find(|(written, _)| *written == slot);
        found.unwrap_or_else(|| panic!("nothing was written to {name} of the {}", self.set.layout.name)).1
    }
}
