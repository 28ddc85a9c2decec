//! Window handles: the instance extensions and the surface of a window.
//!
//! Read the Vulkan specification, chapter Window System Integration, and the documentation of the crates
//! `raw-window-handle` and `ash-window`.

use std::ffi::c_char;
use std::sync::Arc;

use anyhow::{Context as _, Result};
use ash::{khr, vk};
use raw_window_handle::{HasDisplayHandle, HasWindowHandle};

use super::device::{Instance, SurfaceSupport};

/// A window with the handles that a Vulkan surface needs.
pub trait Windowed: HasDisplayHandle + HasWindowHandle + Send + Sync {}
impl<W: HasDisplayHandle + HasWindowHandle + Send + Sync> Windowed for W {}

/// Instance extensions that a surface of the window needs.
pub(super) fn extensions(window: &dyn Windowed) -> Result<&'static [*const c_char]> {
    let display = window.display_handle().context("asking the window for its display")?;
    ash_window::enumerate_required_extensions(display.as_raw()).context("asking what this display takes")
}

/// A `VkSurfaceKHR`; its owner drops it after its swapchain and before its window.
pub(super) struct Surface {
    pub(super) calls: khr::surface::Instance,
    pub(super) raw: vk::SurfaceKHR,
    /// Destroyed after the surface.
    _instance: Arc<Instance>,
}

impl Drop for Surface {
    fn drop(&mut self) {
        // SAFETY: the owner has destroyed the swapchain.
        unsafe { self.calls.destroy_surface(self.raw, None) };
    }
}

impl SurfaceSupport for Surface {
    fn supports(&self, physical: vk::PhysicalDevice, family: u32) -> bool {
        // SAFETY: a plain query of a live surface.
        unsafe { self.calls.get_physical_device_surface_support(physical, family, self.raw) }.unwrap_or_default()
    }
}

impl Surface {
    pub(super) fn new(instance: &Arc<Instance>, window: &dyn Windowed) -> Result<Self> {
        let making = || "making a Vulkan surface of the window";
        let display = window.display_handle().with_context(making)?;
        let handle = window.window_handle().with_context(making)?;
        let (entry, calls) = (&instance.entry, khr::surface::Instance::new(&instance.entry, &instance.raw));
        // SAFETY: both handles are alive while `window` is borrowed; the presenter keeps it longer than the surface.
        let raw = unsafe { ash_window::create_surface(entry, &instance.raw, display.as_raw(), handle.as_raw(), None) }
            .with_context(making)?;
        Ok(Self { calls, raw, _instance: instance.clone() })
    }
}
