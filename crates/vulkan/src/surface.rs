//! The surface of a window, as Vulkan's window system integration (WSI) sees it.
//!
//! Read the Vulkan specification, chapter Window System Integration.

use std::sync::Arc;

use ash::{khr, vk};

use super::device::{Instance, QUEUE};

/// A `VkSurfaceKHR`; its owner drops it after its swapchain and before its window.
#[cfg_attr(not(feature = "window"), allow(dead_code, reason = "only a window has one"))]
pub(super) struct Surface {
    pub(super) calls: khr::surface::Instance,
    pub(super) raw: vk::SurfaceKHR,
    /// Destroyed after the surface.
    pub(super) _instance: Arc<Instance>,
}

impl Drop for Surface {
    fn drop(&mut self) {
        // SAFETY: the owner has destroyed the swapchain.
        unsafe { self.calls.destroy_surface(self.raw, None) };
    }
}

impl Surface {
    /// Whether a queue family can present to the surface.
    pub(super) fn is_shown_by_family(&self, physical: vk::PhysicalDevice, family: u32) -> bool {
        // SAFETY: a plain query of a live surface.
        unsafe { self.calls.get_physical_device_surface_support(physical, family, self.raw) }.unwrap_or_default()
    }

    /// Whether a queue family of a device can draw, compute and present to the surface.
    pub(super) fn is_shown_by(&self, instance: &ash::Instance, physical: vk::PhysicalDevice) -> bool {
        // SAFETY: a plain query.
        let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
        families.iter().enumerate().any(|(family, properties)| {
            properties.queue_flags.contains(QUEUE) && self.is_shown_by_family(physical, family as u32)
        })
    }
}
