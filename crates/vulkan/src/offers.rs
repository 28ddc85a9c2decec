//! Optional features of devices, queried when a device is opened: Etalon works without them.
//!
//! Read the Vulkan specification, chapters Features and Limits, and docs/decisions/devices.md for the replacements.

use ash::{khr, vk};

use super::limits::{LEAST_TEXELS, PUSH_DESCRIPTORS};

/// Optional features and limits of a device, beyond the required ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Offers {
    /// Fragment shaders read `gl_PrimitiveID` (feature geometryShader). Without it each triangle has vertices of its
    /// own, and the vertex index gives the triangle's number.
    pub primitive_ids: bool,
    /// Vertex indices above 2^24 (feature fullDrawIndexUint32).
    pub large_indices: bool,
    /// Push descriptors (VK_KHR_push_descriptor). Without them each pass has a descriptor set of its own.
    pub push_descriptors: bool,
    /// Lookup tables are storage texel buffers. Without it they are storage buffers (`tables.rs`).
    pub texel_buffers: bool,
    /// Subgroup arithmetic in compute shaders (`subgroupAdd`).
    pub adds_in_subgroups: bool,
    /// The driver reports statistics of compiled pipelines (VK_KHR_pipeline_executable_properties).
    pub tells_compiled: bool,
    /// f32 arithmetic preserves signed zeros, infinities and NaN for shaders that request it.
    pub keeps_specials: bool,
    /// f32 arithmetic rounds to nearest even for shaders that request it.
    pub rounds_to_even: bool,
    /// Largest size of a buffer in bytes (`maxBufferSize`).
    pub max_buffer_bytes: u64,
}

impl Offers {
    /// Queries the optional features of a device.
    pub(super) fn of(
        raw: &ash::Instance,
        physical: vk::PhysicalDevice,
        extensions: &[vk::ExtensionProperties],
    ) -> Self {
        let has = |name| extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
        let has_push = has(khr::push_descriptor::NAME);
        let has_executables = has(khr::pipeline_executable_properties::NAME);
        let mut push = vk::PhysicalDevicePushDescriptorPropertiesKHR::default();
        let mut v11 = vk::PhysicalDeviceVulkan11Properties::default();
        let mut v12 = vk::PhysicalDeviceVulkan12Properties::default();
        let mut v13 = vk::PhysicalDeviceVulkan13Properties::default();
        let mut properties =
            vk::PhysicalDeviceProperties2::default().push_next(&mut v11).push_next(&mut v12).push_next(&mut v13);
        if has_push {
            properties = properties.push_next(&mut push);
        }
        let mut executables = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default();
        let mut features = vk::PhysicalDeviceFeatures2::default();
        if has_executables {
            features = features.push_next(&mut executables);
        }
        // SAFETY: plain queries; the chains outlive the calls, and hold no struct of an absent extension.
        unsafe {
            raw.get_physical_device_properties2(physical, &mut properties);
            raw.get_physical_device_features2(physical, &mut features);
        }
        let (core, features) = (properties.properties, features.features);
        // Other drivers fetch from storage buffers as fast or faster, and their storage buffers hold more.
        let is_software = core.device_type == vk::PhysicalDeviceType::CPU;
        Self {
            primitive_ids: features.geometry_shader == vk::TRUE,
            large_indices: features.full_draw_index_uint32 == vk::TRUE,
            push_descriptors: has_push && push.max_push_descriptors >= PUSH_DESCRIPTORS,
            texel_buffers: is_software && core.limits.max_texel_buffer_elements >= LEAST_TEXELS,
            adds_in_subgroups: v11.subgroup_supported_stages.contains(vk::ShaderStageFlags::COMPUTE)
                && v11.subgroup_supported_operations.contains(vk::SubgroupFeatureFlags::ARITHMETIC),
            tells_compiled: executables.pipeline_executable_info == vk::TRUE,
            keeps_specials: v12.shader_signed_zero_inf_nan_preserve_float32 == vk::TRUE,
            rounds_to_even: v12.shader_rounding_mode_rte_float32 == vk::TRUE,
            max_buffer_bytes: v13.max_buffer_size,
        }
    }
}
