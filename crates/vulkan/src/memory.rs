//! Buffers and images with device memory, sub-allocated from large blocks.
//!
//! Read the Vulkan specification, chapters Resource Creation and Memory Allocation, and the documentation of the crate
//! `gpu-allocator`, which does the sub-allocation. A staging buffer is a buffer with [`Place::Upload`].

use std::sync::{Arc, Mutex};

use anyhow::{Context as _, Result, bail};
use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

use super::device::{Device, lock};
use super::error::TooLarge;
use super::sync::ResourceState;

/// The kind of memory of a buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Device-local memory, not mapped by the host.
    Device,
    /// Host-visible memory that the host writes and the device reads: staging and upload buffers.
    Upload,
    /// Host-visible memory that the device writes and the host reads.
    Readback,
    /// Device-local memory that shaders add to, and a copy that the host reads
    /// ([`Frame::read_back`](crate::Frame::read_back)): additions across the bus of a GPU are slow.
    Counters,
}

/// A buffer with its memory.
pub struct Buffer {
    pub(super) raw: vk::Buffer,
    pub(super) view: vk::BufferView,
    pub(super) id: u64,
    pub(super) state: Mutex<ResourceState>,
    bytes: u64,
    allocation: Mutex<Option<Allocation>>,
    /// What the host reads of [`Place::Counters`].
    pub(super) host_copy: Option<Box<Buffer>>,
    device: Arc<Device>,
}

/// Sub-allocates memory for a resource; `linear` for buffers.
fn allocate(
    device: &Device,
    name: &str,
    requirements: vk::MemoryRequirements,
    location: MemoryLocation,
    linear: bool,
) -> Result<Allocation> {
    let allocation = lock(&device.allocator).allocate(&AllocationCreateDesc {
        name,
        requirements,
        location,
        linear,
        allocation_scheme: AllocationScheme::GpuAllocatorManaged,
    })?;
    #[cfg(target_os = "linux")]
    if device.is_software() {
        prefer_large_pages(&allocation);
    }
    Ok(allocation)
}

/// Requests huge pages of 2 MiB from Linux (`madvise`) for the memory of a software device, from the start of the
/// allocation's block to the allocation's end: docs/decisions/large-pages.md.
#[cfg(target_os = "linux")]
fn prefer_large_pages(allocation: &Allocation) {
    let Some(start) = allocation.mapped_ptr() else { return };
    let page = rustix::param::page_size();
    let first = (start.as_ptr() as usize - allocation.offset() as usize) / page * page;
    let end = (start.as_ptr() as usize + allocation.size() as usize).next_multiple_of(page);
    // SAFETY: the advice changes only the speed of memory. Contents stay, also in the rest of the first and last page,
    // and the advice may outlive the block. A kernel without huge pages ignores it.
    let _ = unsafe {
        rustix::mm::madvise(
            std::ptr::with_exposed_provenance_mut(first),
            end - first,
            rustix::mm::Advice::LinuxHugepage,
        )
    };
}

impl Device {
    /// Refuses a buffer that shaders cannot bind whole.
    ///
    /// # Errors
    /// [`TooLarge`].
    pub fn check_bound(&self, name: &str, bytes: u64) -> Result<()> {
        let most = self.max_storage_bytes();
        if bytes > most {
            let what = format!("creating buffer \"{name}\" of {bytes} bytes");
            bail!(TooLarge { what, limit: format!("binds at most {most} bytes of one") });
        }
        Ok(())
    }
}

impl Buffer {
    /// A buffer of `bytes` bytes with every usage of a shader or copy. A buffer of 0 bytes is a dummy to bind where no
    /// shader reads, and is named [`NOTHING`].
    ///
    /// # Errors
    /// When it is larger than the device's buffers may be, when a shader cannot bind so much of the device's own
    /// memory, or when memory is short.
    pub fn new(device: &Arc<Device>, name: &str, bytes: u64, place: Place) -> Result<Self> {
        Self::create(device, name, bytes, place, None)
    }

    /// A buffer that shaders also read as texels of `format` (`imageBuffer`).
    ///
    /// # Errors
    /// As [`Buffer::new`], and when it has more texels than the device allows.
    pub fn texels(device: &Arc<Device>, name: &str, bytes: u64, place: Place, format: vk::Format) -> Result<Self> {
        Self::create(device, name, bytes, place, Some(format))
    }

    /// An upload buffer with the contents `data`.
    ///
    /// # Errors
    /// As [`Buffer::new`].
    pub fn with_data<T: bytemuck::NoUninit>(device: &Arc<Device>, name: &str, data: &[T]) -> Result<Self> {
        let mut buffer = Self::new(device, name, size_of_val(data) as u64, Place::Upload)?;
        buffer.write(bytemuck::cast_slice(data));
        Ok(buffer)
    }

    fn create(device: &Arc<Device>, name: &str, bytes: u64, place: Place, texels: Option<vk::Format>) -> Result<Self> {
        let name = if bytes == 0 { NOTHING } else { name };
        let creating = || format!("creating buffer \"{name}\" of {bytes} bytes");
        let bytes = bytes.max(16);
        let is_bound = match texels {
            Some(_) => !device.offers().texel_buffers,
            None => matches!(place, Place::Device | Place::Counters),
        };
        if is_bound {
            device.check_bound(name, bytes)?;
        }
        let texels = texels.filter(|_| device.offers().texel_buffers);
        let largest = device.offers().max_buffer_bytes;
        if bytes > largest {
            bail!(TooLarge { what: creating(), limit: format!("has buffers of at most {largest} bytes") });
        }
        let most = u64::from(device.limits.max_texel_buffer_elements);
        if let Some(format) = texels
            && bytes / texel_bytes(format) > most
        {
            bail!(TooLarge { what: creating(), limit: format!("fetches at most {most} texels from one") });
        }
        let mut usage = vk::BufferUsageFlags::UNIFORM_BUFFER
            | vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::VERTEX_BUFFER
            | vk::BufferUsageFlags::INDEX_BUFFER
            | vk::BufferUsageFlags::INDIRECT_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST;
        if texels.is_some() {
            usage |= vk::BufferUsageFlags::STORAGE_TEXEL_BUFFER;
        }
        let host_copy = match place {
            Place::Counters => {
                let name = if name == NOTHING { NOTHING.to_owned() } else { format!("{name} for the host") };
                Some(Box::new(Self::new(device, &name, bytes, Place::Readback)?))
            }
            Place::Device | Place::Upload | Place::Readback => None,
        };
        let info = vk::BufferCreateInfo::default().size(bytes).usage(usage);
        let location = match place {
            Place::Device | Place::Counters => MemoryLocation::GpuOnly,
            Place::Upload => MemoryLocation::CpuToGpu,
            Place::Readback => MemoryLocation::GpuToCpu,
        };
        // SAFETY: the create infos are valid for the device, and the memory satisfies the buffer's requirements.
        unsafe {
            let raw = device.raw.create_buffer(&info, None).with_context(creating)?;
            let requirements = device.raw.get_buffer_memory_requirements(raw);
            let allocation = match allocate(device, name, requirements, location, true) {
                Ok(allocation) => allocation,
                Err(error) => {
                    device.raw.destroy_buffer(raw, None);
                    return Err(error).with_context(creating);
                }
            };
            let mut buffer = Self {
                raw,
                view: vk::BufferView::null(),
                id: device.next_id(),
                state: Mutex::default(),
                bytes,
                allocation: Mutex::new(None),
                host_copy,
                device: device.clone(),
            };
            device.note("buffer", name, requirements.size);
            let bound = device.raw.bind_buffer_memory(raw, allocation.memory(), allocation.offset());
            buffer.allocation = Mutex::new(Some(allocation));
            bound.with_context(creating)?;
            if let Some(format) = texels {
                let info =
                    vk::BufferViewCreateInfo::default().buffer(raw).format(format).offset(0).range(vk::WHOLE_SIZE);
                buffer.view = device.raw.create_buffer_view(&info, None).with_context(creating)?;
            }
            device.name(raw, name);
            Ok(buffer)
        }
    }

    /// Size in bytes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Copies `data` to the start of an upload buffer.
    ///
    /// # Panics
    /// When the buffer is not host-visible or too small, a bug of the caller.
    pub fn write(&mut self, data: &[u8]) {
        self.write_at(0, data);
    }

    /// Copies `data` to `offset` of an upload buffer.
    ///
    /// # Panics
    /// As [`Buffer::write`].
    pub fn write_at(&mut self, offset: usize, data: &[u8]) {
        let mut allocation = lock(&self.allocation);
        let mapped = allocation.as_mut().and_then(Allocation::mapped_slice_mut).expect("an upload buffer is mapped");
        mapped[offset..offset + data.len()].copy_from_slice(data);
    }

    /// Calls `read` with the bytes of a buffer that a frame has read back, after that frame has finished.
    ///
    /// # Panics
    /// When the buffer is not host-visible, a bug of the caller.
    pub fn read<R>(&self, read: impl FnOnce(&[u8]) -> R) -> R {
        if let Some(copy) = &self.host_copy {
            return copy.read(read);
        }
        let allocation = lock(&self.allocation);
        let mapped = allocation.as_ref().and_then(Allocation::mapped_slice).expect("a readback buffer is mapped");
        read(&mapped[..self.bytes as usize])
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        // SAFETY: frames wait for the device before they end, so nothing uses the buffer any more.
        unsafe {
            self.device.raw.destroy_buffer_view(self.view, None);
            self.device.raw.destroy_buffer(self.raw, None);
        }
        if let Some(allocation) = lock(&self.allocation).take() {
            // Freeing fails only for memory of another allocator.
            let _ = lock(&self.device.allocator).free(allocation);
        }
        self.device.gone();
    }
}

/// Bytes of a texel of a texel buffer.
fn texel_bytes(format: vk::Format) -> u64 {
    match format {
        vk::Format::R32G32B32A32_SFLOAT | vk::Format::R32G32B32A32_UINT => 16,
        vk::Format::R32G32_SFLOAT => 8,
        _ => 4,
    }
}

/// Format, size and usage of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageDesc {
    /// Pixel format.
    pub format: vk::Format,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Number of array layers; `array` decides whether a single layer is viewed as an array.
    pub layers: u32,
    /// Number of mip levels.
    pub levels: u32,
    /// Whether the view is a `2DArray`.
    pub array: bool,
    /// Usage flags beyond copies.
    pub usage: vk::ImageUsageFlags,
}

impl ImageDesc {
    /// A single-level 2D image.
    #[must_use]
    pub fn flat(format: vk::Format, width: u32, height: u32, usage: vk::ImageUsageFlags) -> Self {
        Self { format, width, height, layers: 1, levels: 1, array: false, usage }
    }
}

/// Name of the dummy resources that are bound in slots for which a plan has no resource.
pub const NOTHING: &str = "nothing";

/// An image with a view of all of it.
pub struct Image {
    pub(super) raw: vk::Image,
    pub(super) view: vk::ImageView,
    pub(super) id: u64,
    pub(super) state: Mutex<ResourceState>,
    desc: ImageDesc,
    allocation: Mutex<Option<Allocation>>,
    device: Arc<Device>,
}

impl Image {
    /// An image with undefined content.
    ///
    /// # Errors
    /// When it is larger than the device allows or memory is short.
    pub fn new(device: &Arc<Device>, name: &str, desc: ImageDesc) -> Result<Self> {
        let ImageDesc { width, height, layers, levels, .. } = desc;
        let creating = || format!("creating image \"{name}\" of {width}x{height}x{layers}, {levels} levels");
        let limit = device.limits.max_image_dimension2_d;
        if width > limit || height > limit || layers > device.limits.max_image_array_layers {
            let layers = device.limits.max_image_array_layers;
            bail!(TooLarge { what: creating(), limit: format!("allows {limit} pixels a side and {layers} layers") });
        }
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(desc.format)
            .extent(vk::Extent3D { width, height, depth: 1 })
            .mip_levels(levels)
            .array_layers(layers)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(desc.usage | vk::ImageUsageFlags::TRANSFER_SRC | vk::ImageUsageFlags::TRANSFER_DST);
        // SAFETY: the create infos are valid for the device, and the memory satisfies the image's requirements.
        unsafe {
            let raw = device.raw.create_image(&info, None).with_context(creating)?;
            let requirements = device.raw.get_image_memory_requirements(raw);
            let allocation = match allocate(device, name, requirements, MemoryLocation::GpuOnly, false) {
                Ok(allocation) => allocation,
                Err(error) => {
                    device.raw.destroy_image(raw, None);
                    return Err(error).with_context(creating);
                }
            };
            let mut image = Self {
                raw,
                view: vk::ImageView::null(),
                id: device.next_id(),
                state: Mutex::default(),
                desc,
                allocation: Mutex::new(None),
                device: device.clone(),
            };
            device.note("image", name, requirements.size);
            let bound = device.raw.bind_image_memory(raw, allocation.memory(), allocation.offset());
            image.allocation = Mutex::new(Some(allocation));
            bound.with_context(creating)?;
            let kind = if desc.array { vk::ImageViewType::TYPE_2D_ARRAY } else { vk::ImageViewType::TYPE_2D };
            let view = vk::ImageViewCreateInfo::default()
                .image(raw)
                .view_type(kind)
                .format(desc.format)
                .subresource_range(image.range());
            image.view = device.raw.create_image_view(&view, None).with_context(creating)?;
            device.name(raw, name);
            Ok(image)
        }
    }

    /// A dummy image of one texel that no shader reads: [`NOTHING`].
    ///
    /// # Errors
    /// When memory is short.
    pub fn nothing(device: &Arc<Device>, format: vk::Format, usage: vk::ImageUsageFlags) -> Result<Self> {
        Self::new(device, NOTHING, ImageDesc::flat(format, 1, 1, usage))
    }

    /// Format, size and usage of the image.
    #[must_use]
    pub fn desc(&self) -> ImageDesc {
        self.desc
    }

    pub(super) fn aspect(&self) -> vk::ImageAspectFlags {
        match self.desc.format {
            vk::Format::D32_SFLOAT => vk::ImageAspectFlags::DEPTH,
            _ => vk::ImageAspectFlags::COLOR,
        }
    }

    pub(super) fn range(&self) -> vk::ImageSubresourceRange {
        vk::ImageSubresourceRange {
            aspect_mask: self.aspect(),
            base_mip_level: 0,
            level_count: self.desc.levels,
            base_array_layer: 0,
            layer_count: self.desc.layers,
        }
    }
}

impl Drop for Image {
    fn drop(&mut self) {
        // SAFETY: frames wait for the device before they end, so nothing uses the image any more.
        unsafe {
            self.device.raw.destroy_image_view(self.view, None);
            self.device.raw.destroy_image(self.raw, None);
        }
        if let Some(allocation) = lock(&self.allocation).take() {
            // Freeing fails only for memory of another allocator.
            let _ = lock(&self.device.allocator).free(allocation);
        }
        self.device.gone();
    }
}
