//! A window as Vulkan sees it.

use std::ffi::c_char;

use anyhow::{Context as _, Result};
use ash::{khr, vk};
use raw_window_handle::{HasDisplayHandle, HasWindowHandle};

/// What pictures can be shown on.
pub trait Windowed: HasDisplayHandle + HasWindowHandle + Send + Sync {}
impl<W: HasDisplayHandle + HasWindowHandle + Send + Sync> Windowed for W {}

/// Extensions of the instance that a window takes.
pub(super) fn extensions(window: &dyn Windowed) -> Result<&'static [*const c_char]> {
    let display = window.display_handle().context("asking the window for its display")?;
    ash_window::enumerate_required_extensions(display.as_raw()).context("asking what this display takes")
}

/// A `VkSurfaceKHR`; whoever holds it destroys it before the instance.
#[derive(Clone)]
pub(super) struct Surface {
    pub(super) calls: khr::surface::Instance,
    pub(super) raw: vk::SurfaceKHR,
}

impl Surface {
    pub(super) fn new(entry: &ash::Entry, instance: &ash::Instance, window: &dyn Windowed) -> Result<Self> {
        let making = || "making a Vulkan surface of the window";
        let display = window.display_handle().with_context(making)?;
        let handle = window.window_handle().with_context(making)?;
        // SAFETY: both handles are alive while `window` is borrowed; the presenter keeps it longer than the surface.
        let raw = unsafe { ash_window::create_surface(entry, instance, display.as_raw(), handle.as_raw(), None) }
            .with_context(making)?;
        Ok(Self { calls: khr::surface::Instance::new(entry, instance), raw })
    }

    /// Whether a family of queues shows pictures on it.
    pub(super) fn is_shown_by_family(&self, physical: vk::PhysicalDevice, family: u32) -> bool {
        // SAFETY: a plain query of a live surface.
        unsafe { self.calls.get_physical_device_surface_support(physical, family, self.raw) }.unwrap_or_default()
    }

    /// Whether some family of a device does.
    pub(super) fn is_shown_by(&self, instance: &ash::Instance, physical: vk::PhysicalDevice) -> bool {
        // SAFETY: a plain query.
        let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
        (0..families.len() as u32).any(|family| self.is_shown_by_family(physical, family))
    }

    pub(super) fn destroy(&self) {
        // SAFETY: the swapchain on it is gone.
        unsafe { self.calls.destroy_surface(self.raw, None) };
    }
}
