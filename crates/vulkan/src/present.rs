//! Presentation of pictures in a window: a swapchain, a blit per picture, and the egui user interface over them.
//!
//! Read the Vulkan specification, chapter Window System Integration (`vkAcquireNextImageKHR`, `vkQueuePresentKHR`). A
//! swapchain that is out of date or lost is a state, not an error. A picture comes from the host through a staging
//! buffer and is blitted, so that the window shows the bytes of the display output: the swapchain has a UNORM format,
//! which does not encode the sRGB bytes again. One frame is in flight.

use std::sync::Arc;

use anyhow::{Context as _, Result, anyhow, ensure};
use ash::{khr, vk};
use egui_ash_renderer::allocator::DefaultAllocator;
use egui_ash_renderer::{DynamicRendering, Options, RenderMode, Renderer};

use super::access::Access;
use super::choice::DeviceChoice;
use super::device::{Device, Instance, lock};
use super::memory::{Buffer, Image, ImageDesc, Place};
use super::open;
use super::recording::begin;
use super::window::{Surface, Windowed, extensions};

/// A picture with its rectangle in the window.
#[derive(Debug, Clone, Copy)]
pub struct PlacedPicture<'a> {
    /// RGBA8, sRGB-encoded, rows from the top.
    pub rgba: &'a [u8],
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Version of the contents; a new number causes an upload.
    pub version: u64,
    /// Left, top, right, bottom in pixels of the window; a rectangle of another size than the picture is filtered
    /// linearly.
    pub place: [i32; 4],
    /// Columns of the window that show the picture: first, and one past the last.
    pub columns: [i32; 2],
}

/// A picture's image on the device with its staging buffer.
struct SwapchainSlot {
    image: Image,
    staging: Buffer,
    version: u64,
    /// Whether the contents are in `staging` only, not yet in `image`.
    fresh: bool,
}

/// The egui output of a frame.
pub struct Overlay {
    /// Textures that were created, changed or freed.
    pub textures: egui::TexturesDelta,
    /// Triangle meshes with clip rectangles.
    pub primitives: Vec<egui::ClippedPrimitive>,
    /// Pixels of the window per egui point.
    pub pixels_per_point: f32,
}

/// Time limit for `vkAcquireNextImageKHR` in nanoseconds: longer would block the user interface noticeably.
const ACQUIRE_NS: u64 = 100_000_000;

/// The result of a presentation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Presented {
    /// The picture was queued for presentation.
    Shown,
    /// The window has no area, because it is minimised.
    Hidden,
    /// The swapchain is out of date or gave no image in time; the caller retries.
    Changed,
}

struct Swapchain {
    raw: vk::SwapchainKHR,
    images: Vec<vk::Image>,
    views: Vec<vk::ImageView>,
    /// Semaphores that are signalled when the image may be presented, one per image.
    done: Vec<vk::Semaphore>,
    extent: [u32; 2],
}

/// A window with its surface, swapchain and user interface.
pub struct Presenter {
    device: Arc<Device>,
    surface: Surface,
    window: Arc<dyn Windowed>,
    calls: khr::swapchain::Device,
    format: vk::SurfaceFormatKHR,
    swapchain: Option<Swapchain>,
    stale: bool,
    pool: vk::CommandPool,
    acquired: vk::Semaphore,
    finished: vk::Fence,
    commands: Option<vk::CommandBuffer>,
    slots: Vec<SwapchainSlot>,
    overlay: Option<Renderer<DefaultAllocator>>,
    freed: Vec<egui::TextureId>,
}

impl Presenter {
    /// Opens a device that can present to the window.
    ///
    /// # Errors
    /// When there is no loader, no device that can present, or the window has no surface.
    pub fn open(window: Arc<dyn Windowed>, choice: &DeviceChoice, validate: bool) -> Result<(Arc<Device>, Self)> {
        let turn = validate.then(|| open::for_a_window(choice)).transpose()?;
        let instance = Arc::new(Instance::new(turn, extensions(&*window)?)?);
        let surface = Surface::new(&instance, &*window)?;
        let device = Device::open_on(instance, choice, Some(&surface), true)?;
        if validate {
            open::share(&device);
        }
        // SAFETY: a plain query of a live surface.
        let formats = unsafe { surface.calls.get_physical_device_surface_formats(device.physical, surface.raw) }
            .context("asking for formats of the window")?;
        let encoded = |format: &&vk::SurfaceFormatKHR| {
            matches!(format.format, vk::Format::B8G8R8A8_UNORM | vk::Format::R8G8B8A8_UNORM)
                && format.color_space == vk::ColorSpaceKHR::SRGB_NONLINEAR
        };
        let format = *formats
            .iter()
            .find(encoded)
            .ok_or_else(|| anyhow!("device \"{}\" shows no 8-bit sRGB pictures in this window", device.info().name))?;
        let rendering = DynamicRendering {
            color_attachment_format: format.format,
            depth_attachment_format: None,
            stencil_attachment_format: None,
        };
        let overlay = Renderer::with_default_allocator(
            &device.instance.raw,
            device.physical,
            device.raw.clone(),
            RenderMode::DynamicRendering(rendering),
            Options::default(),
        )
        .context("making what draws the panels")?;
        let calls = khr::swapchain::Device::new(&device.instance.raw, &device.raw);
        // Null handles until they are made: dropping the presenter destroys what there is.
        let mut presenter = Self {
            device: device.clone(),
            surface,
            window,
            calls,
            format,
            swapchain: None,
            stale: true,
            pool: vk::CommandPool::null(),
            acquired: vk::Semaphore::null(),
            finished: vk::Fence::null(),
            commands: None,
            slots: Vec::new(),
            overlay: Some(overlay),
            freed: Vec::new(),
        };
        let pool = vk::CommandPoolCreateInfo::default()
            .queue_family_index(device.family)
            .flags(vk::CommandPoolCreateFlags::TRANSIENT);
        let signalled = vk::FenceCreateInfo::default().flags(vk::FenceCreateFlags::SIGNALED);
        let (raw, semaphore) = (&device.raw, vk::SemaphoreCreateInfo::default());
        // SAFETY: objects of a live device.
        unsafe {
            presenter.pool = raw.create_command_pool(&pool, None).context("making a command pool")?;
            presenter.acquired = raw.create_semaphore(&semaphore, None).context("making a semaphore")?;
            presenter.finished = raw.create_fence(&signalled, None).context("making a fence")?;
        }
        Ok((device, presenter))
    }

    /// Marks the swapchain as out of date, because the window has changed its size.
    pub fn resized(&mut self) {
        self.stale = true;
    }

    /// Presents pictures with the user interface over them in a window of `size` pixels.
    ///
    /// # Errors
    /// When the device is lost or memory is short. A surface that is lost or out of date is created again.
    pub fn present(
        &mut self,
        size: [u32; 2],
        pictures: &[PlacedPicture<'_>],
        mut overlay: Overlay,
    ) -> Result<Presented> {
        let applied = self.wait().and_then(|()| self.apply(&overlay));
        overlay.textures.clear();
        applied?;
        self.slots.truncate(pictures.len());
        for (index, picture) in pictures.iter().enumerate() {
            self.upload(index, picture)?;
        }
        if (self.stale || self.swapchain.is_none()) && !self.recreate(size)? {
            // A surface that was created again in the meantime may still have an area.
            return Ok(if size.contains(&0) { Presented::Hidden } else { Presented::Changed });
        }
        let Some(swapchain) = &self.swapchain else { return Ok(Presented::Hidden) };
        // SAFETY: the semaphore is not in use: the previous frame has finished.
        let acquired =
            unsafe { self.calls.acquire_next_image(swapchain.raw, ACQUIRE_NS, self.acquired, vk::Fence::null()) };
        let index = match acquired {
            Ok((index, suboptimal)) => {
                self.stale |= suboptimal;
                index as usize
            }
            // A covered window, or one on another desktop, may get no image while it is hidden.
            Err(vk::Result::TIMEOUT | vk::Result::NOT_READY) => return Ok(Presented::Changed),
            Err(error) => return self.renewed_after(error, "asking for the next picture of the window"),
        };
        let commands = self.record(index, pictures, &overlay)?;
        self.submit(commands, index)?;
        let Some(swapchain) = &self.swapchain else { return Ok(Presented::Hidden) };
        let (swapchains, indices, waits) = ([swapchain.raw], [index as u32], [swapchain.done[index]]);
        let info =
            vk::PresentInfoKHR::default().swapchains(&swapchains).image_indices(&indices).wait_semaphores(&waits);
        let queue = lock(&self.device.queue);
        // SAFETY: the image was acquired, and its semaphore is signalled when the image is drawn.
        let shown = unsafe { self.calls.queue_present(*queue, &info) };
        drop(queue);
        match shown {
            Ok(suboptimal) => self.stale |= suboptimal,
            Err(error) => return self.renewed_after(error, "showing a picture in the window"),
        }
        Ok(Presented::Shown)
    }

    /// Renews a swapchain that is out of date or a surface that is lost; other errors are errors.
    fn renewed_after(&mut self, error: vk::Result, doing: &'static str) -> Result<Presented> {
        match error {
            vk::Result::ERROR_OUT_OF_DATE_KHR => self.stale = true,
            vk::Result::ERROR_SURFACE_LOST_KHR => self.renew_surface()?,
            error => return Err(error).context(doing),
        }
        Ok(Presented::Changed)
    }

    /// Waits until the previous frame has finished, and frees its command buffer and textures.
    fn wait(&mut self) -> Result<()> {
        // SAFETY: the fence is signalled by the last submission, or was created signalled.
        unsafe {
            self.device.raw.wait_for_fences(&[self.finished], true, u64::MAX).context("waiting for the window")?;
            if let Some(commands) = self.commands.take() {
                self.device.raw.free_command_buffers(self.pool, &[commands]);
            }
        }
        if let Some(overlay) = &mut self.overlay {
            for id in self.freed.drain(..) {
                overlay.free_texture(id).context("freeing a texture of the panels")?;
            }
        }
        Ok(())
    }

    fn apply(&mut self, overlay: &Overlay) -> Result<()> {
        let Some(renderer) = &mut self.overlay else { return Ok(()) };
        // `set_texture` submits and waits by itself.
        let queue = lock(&self.device.queue);
        for (id, deltas) in &overlay.textures.set {
            for delta in deltas {
                renderer.set_texture(*queue, self.pool, *id, delta).context("uploading a texture of the panels")?;
            }
        }
        self.freed.extend(overlay.textures.free.iter().copied());
        Ok(())
    }

    fn upload(&mut self, index: usize, placed: &PlacedPicture<'_>) -> Result<()> {
        let fits = |slot: &SwapchainSlot| {
            let desc = slot.image.desc();
            [desc.width, desc.height] == placed.size
        };
        if !self.slots.get(index).is_some_and(fits) {
            // Every image has a view, and a view needs a usage of shaders.
            let usage =
                vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_SRC | vk::ImageUsageFlags::TRANSFER_DST;
            let [width, height] = placed.size;
            let desc = ImageDesc::flat(vk::Format::R8G8B8A8_UNORM, width, height, usage);
            let image = Image::new(&self.device, "picture in the window", desc)?;
            let bytes = 4 * u64::from(width) * u64::from(height);
            let staging = Buffer::new(&self.device, "picture for the window", bytes, Place::Upload)?;
            self.slots.truncate(index);
            self.slots.push(SwapchainSlot { image, staging, version: u64::MAX, fresh: false });
        }
        let slot = &mut self.slots[index];
        if slot.version != placed.version {
            let bytes = slot.staging.bytes();
            ensure!(placed.rgba.len() as u64 == bytes, "a picture of another size than it says: our mistake");
            slot.staging.write(placed.rgba);
            (slot.version, slot.fresh) = (placed.version, true);
        }
        Ok(())
    }

    /// Creates the swapchain again; false when the window has no area.
    fn recreate(&mut self, size: [u32; 2]) -> Result<bool> {
        let making = || format!("making a swapchain of {}x{}", size[0], size[1]);
        // SAFETY: a plain query.
        let asked = unsafe {
            self.surface.calls.get_physical_device_surface_capabilities(self.device.physical, self.surface.raw)
        };
        let caps = match asked {
            Err(vk::Result::ERROR_SURFACE_LOST_KHR) => {
                self.renew_surface()?;
                // SAFETY: as above.
                unsafe {
                    self.surface.calls.get_physical_device_surface_capabilities(self.device.physical, self.surface.raw)
                }
                .with_context(making)?
            }
            other => other.with_context(making)?,
        };
        // The window's current extent, unless the surface leaves the extent to the application.
        let extent = match caps.current_extent.width {
            u32::MAX => [
                size[0].clamp(caps.min_image_extent.width, caps.max_image_extent.width.max(1)),
                size[1].clamp(caps.min_image_extent.height, caps.max_image_extent.height.max(1)),
            ],
            width => [width, caps.current_extent.height],
        };
        if extent.contains(&0) || size.contains(&0) {
            return Ok(false);
        }
        let wanted = vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_DST;
        ensure!(
            caps.supported_usage_flags.contains(wanted),
            "device \"{}\" cannot copy pictures to this window",
            self.device.info().name
        );
        let most = if caps.max_image_count == 0 { u32::MAX } else { caps.max_image_count };
        let opaque = vk::CompositeAlphaFlagsKHR::OPAQUE;
        let alpha =
            if caps.supported_composite_alpha.contains(opaque) { opaque } else { vk::CompositeAlphaFlagsKHR::INHERIT };
        let old = self.swapchain.take();
        let info = vk::SwapchainCreateInfoKHR::default()
            .surface(self.surface.raw)
            .min_image_count((caps.min_image_count + 1).min(most))
            .image_format(self.format.format)
            .image_color_space(self.format.color_space)
            .image_extent(vk::Extent2D { width: extent[0], height: extent[1] })
            .image_array_layers(1)
            .image_usage(wanted)
            .image_sharing_mode(vk::SharingMode::EXCLUSIVE)
            .pre_transform(caps.current_transform)
            .composite_alpha(alpha)
            // FIFO is mandatory in every driver and does not tear.
            .present_mode(vk::PresentModeKHR::FIFO)
            .clipped(true)
            .old_swapchain(old.as_ref().map_or(vk::SwapchainKHR::null(), |old| old.raw));
        // SAFETY: the surface is alive.
        let made = unsafe { self.calls.create_swapchain(&info, None) };
        let (images, views, done) = (Vec::new(), Vec::new(), Vec::new());
        self.swapchain = made.ok().map(|raw| Swapchain { raw, images, views, done, extent });
        self.retire(old)?;
        if made == Err(vk::Result::ERROR_SURFACE_LOST_KHR) {
            self.renew_surface()?;
            return Ok(false);
        }
        made.with_context(making)?;
        // What is made before an error goes with the next swapchain.
        self.stale = true;
        let Some(swapchain) = &mut self.swapchain else { return Ok(false) };
        // SAFETY: the swapchain is alive.
        unsafe {
            swapchain.images = self.calls.get_swapchain_images(swapchain.raw).with_context(making)?;
            for &image in &swapchain.images {
                let view = vk::ImageViewCreateInfo::default()
                    .image(image)
                    .view_type(vk::ImageViewType::TYPE_2D)
                    .format(self.format.format)
                    .subresource_range(WHOLE);
                swapchain.views.push(self.device.raw.create_image_view(&view, None).with_context(making)?);
                let semaphore = vk::SemaphoreCreateInfo::default();
                swapchain.done.push(self.device.raw.create_semaphore(&semaphore, None).with_context(making)?);
            }
        }
        self.stale = false;
        Ok(true)
    }

    /// Creates the surface again after its loss, which also invalidates its swapchain.
    fn renew_surface(&mut self) -> Result<()> {
        let old = self.swapchain.take();
        self.stale = true;
        self.retire(old)?;
        self.surface = Surface::new(&self.device.instance, &*self.window)?;
        Ok(())
    }

    /// Waits for the queue and destroys a swapchain.
    fn retire(&self, swapchain: Option<Swapchain>) -> Result<()> {
        let Some(swapchain) = swapchain else { return Ok(()) };
        let raw = &self.device.raw;
        // SAFETY: nothing of the swapchain is in use once the queue is idle, or the device lost.
        unsafe {
            let queue = lock(&self.device.queue);
            let idle = raw.queue_wait_idle(*queue);
            drop(queue);
            swapchain.views.iter().for_each(|view| raw.destroy_image_view(*view, None));
            swapchain.done.iter().for_each(|semaphore| raw.destroy_semaphore(*semaphore, None));
            self.calls.destroy_swapchain(swapchain.raw, None);
            idle.context("waiting for the window")
        }
    }

    /// Records the commands of a frame: background, pictures, user interface.
    fn record(&mut self, index: usize, pictures: &[PlacedPicture<'_>], overlay: &Overlay) -> Result<vk::CommandBuffer> {
        let swapchain = self.swapchain.as_ref().context("there is no swapchain: our mistake")?;
        let (image, view, [width, height]) = (swapchain.images[index], swapchain.views[index], swapchain.extent);
        let raw = &self.device.raw;
        // SAFETY: the command buffer is recorded here; every handle in it lives until the fence is signalled.
        unsafe {
            let commands = begin(&self.device, self.pool)?;
            self.commands = Some(commands);
            change(raw, commands, image, vk::ImageLayout::UNDEFINED, Access::TransferDst);
            let dark = vk::ClearColorValue { float32: [0.11, 0.11, 0.12, 1.0] };
            raw.cmd_clear_color_image(commands, image, vk::ImageLayout::TRANSFER_DST_OPTIMAL, &dark, &[WHOLE]);
            for (placed, slot) in pictures.iter().zip(&mut self.slots) {
                let to = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
                if std::mem::take(&mut slot.fresh) {
                    change(raw, commands, slot.image.raw, vk::ImageLayout::UNDEFINED, Access::TransferDst);
                    let [width, height] = placed.size;
                    let region = vk::BufferImageCopy::default().image_subresource(LAYER).image_extent(vk::Extent3D {
                        width,
                        height,
                        depth: 1,
                    });
                    raw.cmd_copy_buffer_to_image(commands, slot.staging.raw, slot.image.raw, to, &[region]);
                    change(raw, commands, slot.image.raw, to, Access::TransferSrc);
                }
                // The clear and earlier blits write the same texels, so the blit waits for them.
                change(raw, commands, image, to, Access::TransferDst);
                if let Some([from, to]) = clipped(placed, [width, height]) {
                    let corner = |[x, y]: [i32; 2], z| vk::Offset3D { x, y, z };
                    let same = [from[1][0] - from[0][0], from[1][1] - from[0][1]]
                        == [to[1][0] - to[0][0], to[1][1] - to[0][1]];
                    let blit = vk::ImageBlit::default()
                        .src_subresource(LAYER)
                        .src_offsets([corner(from[0], 0), corner(from[1], 1)])
                        .dst_subresource(LAYER)
                        .dst_offsets([corner(to[0], 0), corner(to[1], 1)]);
                    raw.cmd_blit_image(
                        commands,
                        slot.image.raw,
                        vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
                        image,
                        vk::ImageLayout::TRANSFER_DST_OPTIMAL,
                        &[blit],
                        if same { vk::Filter::NEAREST } else { vk::Filter::LINEAR },
                    );
                }
            }
            change(raw, commands, image, vk::ImageLayout::TRANSFER_DST_OPTIMAL, Access::ColorTarget);
            let attachments = [vk::RenderingAttachmentInfo::default()
                .image_view(view)
                .image_layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)
                .load_op(vk::AttachmentLoadOp::LOAD)
                .store_op(vk::AttachmentStoreOp::STORE)];
            let extent = vk::Extent2D { width, height };
            let info = vk::RenderingInfo::default()
                .render_area(vk::Rect2D { offset: vk::Offset2D::default(), extent })
                .layer_count(1)
                .color_attachments(&attachments);
            raw.cmd_begin_rendering(commands, &info);
            let drawn = self
                .overlay
                .as_mut()
                .map(|renderer| renderer.cmd_draw(commands, extent, overlay.pixels_per_point, &overlay.primitives));
            raw.cmd_end_rendering(commands);
            drawn.transpose().context("drawing the panels")?;
            let shown = vk::ImageMemoryBarrier2::default()
                .image(image)
                .subresource_range(WHOLE)
                .src_stage_mask(vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT)
                .src_access_mask(vk::AccessFlags2::COLOR_ATTACHMENT_WRITE)
                .old_layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)
                .new_layout(vk::ImageLayout::PRESENT_SRC_KHR);
            raw.cmd_pipeline_barrier2(commands, &vk::DependencyInfo::default().image_memory_barriers(&[shown]));
            raw.end_command_buffer(commands).context("recording a picture of the window")?;
            Ok(commands)
        }
    }

    fn submit(&self, commands: vk::CommandBuffer, index: usize) -> Result<()> {
        let done = self.swapchain.as_ref().context("there is no swapchain: our mistake")?.done[index];
        let all = vk::PipelineStageFlags2::ALL_COMMANDS;
        let semaphore = |raw| [vk::SemaphoreSubmitInfo::default().semaphore(raw).stage_mask(all)];
        let (waits, signals) = (semaphore(self.acquired), semaphore(done));
        let buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(commands)];
        let info = vk::SubmitInfo2::default()
            .wait_semaphore_infos(&waits)
            .command_buffer_infos(&buffers)
            .signal_semaphore_infos(&signals);
        let queue = lock(&self.device.queue);
        // SAFETY: the fence is not in use, the command buffer is recorded, and its resources live until the fence is
        // signalled.
        unsafe {
            self.device.raw.reset_fences(&[self.finished]).context("showing a picture")?;
            self.device.raw.queue_submit2(*queue, &[info], self.finished).context("showing a picture")
        }
    }
}

impl Drop for Presenter {
    fn drop(&mut self) {
        // The surface goes after its swapchain and before the window.
        let swapchain = self.swapchain.take();
        let _ = self.retire(swapchain);
        // SAFETY: nothing is in use once the queue is idle.
        unsafe {
            let queue = lock(&self.device.queue);
            let _ = self.device.raw.queue_wait_idle(*queue);
            drop(queue);
            drop(self.overlay.take());
            self.device.raw.destroy_semaphore(self.acquired, None);
            self.device.raw.destroy_fence(self.finished, None);
            self.device.raw.destroy_command_pool(self.pool, None);
        }
    }
}

const WHOLE: vk::ImageSubresourceRange = vk::ImageSubresourceRange {
    aspect_mask: vk::ImageAspectFlags::COLOR,
    base_mip_level: 0,
    level_count: 1,
    base_array_layer: 0,
    layer_count: 1,
};
const LAYER: vk::ImageSubresourceLayers = vk::ImageSubresourceLayers {
    aspect_mask: vk::ImageAspectFlags::COLOR,
    mip_level: 0,
    base_array_layer: 0,
    layer_count: 1,
};

/// Records an image layout transition for an access, after all earlier commands.
unsafe fn change(
    raw: &ash::Device,
    commands: vk::CommandBuffer,
    image: vk::Image,
    from: vk::ImageLayout,
    access: Access,
) {
    let to = access.masks(vk::ShaderStageFlags::empty());
    let barrier = vk::ImageMemoryBarrier2::default()
        .image(image)
        .subresource_range(WHOLE)
        .src_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
        .src_access_mask(vk::AccessFlags2::MEMORY_WRITE)
        .dst_stage_mask(to.stages)
        .dst_access_mask(to.access)
        .old_layout(from)
        .new_layout(to.layout);
    // SAFETY: the command buffer is recording; the image is alive.
    unsafe { raw.cmd_pipeline_barrier2(commands, &vk::DependencyInfo::default().image_memory_barriers(&[barrier])) };
}

/// Corners of the visible part of a picture, in the picture's and in the window's pixels; `None` when nothing is
/// visible.
fn clipped(placed: &PlacedPicture<'_>, window: [u32; 2]) -> Option<[[[i32; 2]; 2]; 2]> {
    let [left, top, right, bottom] = placed.place;
    let (low, high) = ([left, top], [right, bottom]);
    let [first_column, end_column] = placed.columns;
    let seen = [[first_column.max(0), end_column.min(window[0] as i32)], [0, window[1] as i32]];
    let mut corners = [[[0; 2]; 2]; 2];
    for axis in 0..2 {
        let (from, to) = (low[axis].max(seen[axis][0]), high[axis].min(seen[axis][1]));
        let whole = high[axis] - low[axis];
        if from >= to || whole <= 0 {
            return None;
        }
        let texel = |x: i32| {
            (i64::from(x - low[axis]) * i64::from(placed.size[axis]) / i64::from(whole))
                .clamp(0, placed.size[axis].into())
        };
        let (first, last) = (texel(from) as i32, texel(to) as i32);
        if first >= last {
            return None;
        }
        (corners[0][0][axis], corners[0][1][axis]) = (first, last);
        (corners[1][0][axis], corners[1][1][axis]) = (from, to);
    }
    Some(corners)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_outside_of_the_window_is_not_copied() {
        let placed = |place| PlacedPicture { rgba: &[], size: [100, 50], version: 0, place, columns: [0, i32::MAX] };
        assert_eq!(clipped(&placed([10, 20, 110, 70]), [640, 480]), Some([[[0, 0], [100, 50]], [[10, 20], [110, 70]]]));
        assert_eq!(clipped(&placed([-30, 0, 70, 50]), [60, 480]), Some([[[30, 0], [90, 50]], [[0, 0], [60, 50]]]));
        assert_eq!(clipped(&placed([0, 0, 200, 100]), [100, 100]), Some([[[0, 0], [50, 50]], [[0, 0], [100, 100]]]));
        assert_eq!(clipped(&placed([700, 0, 800, 50]), [640, 480]), None);
        let part = |columns| PlacedPicture { columns, ..placed([10, 20, 110, 70]) };
        assert_eq!(clipped(&part([0, 40]), [640, 480]), Some([[[0, 0], [30, 50]], [[10, 20], [40, 70]]]));
        assert_eq!(clipped(&part([40, 640]), [640, 480]), Some([[[30, 0], [100, 50]], [[40, 20], [110, 70]]]));
        assert_eq!(clipped(&part([0, 10]), [640, 480]), None);
    }
}
