//! The surface of a window, as Vulkan's window system integration (WSI) sees it.
//!
//! Read the Vulkan specification, chapter Window System Integration.

use ash::{khr, vk};

/// A `VkSurfaceKHR`; its owner destroys it before the instance.
#[derive(Clone)]
#[cfg_attr(not(feature = "window"), allow(dead_code, reason = "only a window has one"))]
pub(super) struct Surface {
    pub(super) calls: khr::surface::Instance,
    pub(super) raw: vk::SurfaceKHR,
}

impl Surface {
    /// Whether a queue family can present to the surface.
    pub(super) fn is_shown_by_family(&self, physical: vk::PhysicalDevice, family: u32) -> bool {
        // SAFETY: a plain query of a live surface.
        unsafe { self.calls.get_physical_device_surface_support(physical, family, self.raw) }.unwrap_or_default()
    }

    /// Whether any queue family of a device can present to the surface.
    pub(super) fn is_shown_by(&self, instance: &ash::Instance, physical: vk::PhysicalDevice) -> bool {
        // SAFETY: a plain query.
        let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
        (0..families.len() as u32).any(|family| self.is_shown_by_family(physical, family))
    }
}
