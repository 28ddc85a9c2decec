//! What a device says of itself, by Vulkan's names: what Etalon or its tests look at, whether it is needed or not.
//!
//! Read the Vulkan specification, chapters Features, Limits, Formats and Memory.

use std::collections::BTreeMap;
use std::sync::Arc;

use ash::{khr, vk};
use serde::{Deserialize, Serialize};

use super::device::Device;

/// Features, extensions, limits, formats and memory of a device.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Capabilities {
    /// Features, by the names of their members.
    pub features: BTreeMap<String, bool>,
    /// Extensions.
    pub extensions: BTreeMap<String, bool>,
    /// Limits, by the names of their members.
    pub limits: BTreeMap<String, u64>,
    /// Uses of images of each format with optimal tiling.
    pub formats: BTreeMap<String, Vec<String>>,
    /// Properties of each memory type.
    pub memory: Vec<Vec<String>>,
    /// Bytes of each memory heap.
    pub heaps: Vec<u64>,
    /// Whether compute shaders add within subgroups.
    pub subgroup_arithmetic: bool,
    /// Invocations of a subgroup.
    pub subgroup_size: u32,
    /// Whether every queue has timestamps.
    pub timestamps: bool,
    /// Nanoseconds of a timestamp's unit.
    pub timestamp_ns: f32,
}

/// A map from the names of members to their values.
macro_rules! members {
    ($($of:expr, $value:expr, { $($field:ident = $name:literal),+ $(,)? })+) => {
        BTreeMap::from([$($(($name.to_owned(), $value($of.$field))),+),+])
    };
}

/// Extensions that are looked at.
const EXTENSIONS: [&std::ffi::CStr; 5] = [
    khr::push_descriptor::NAME,
    khr::pipeline_executable_properties::NAME,
    khr::acceleration_structure::NAME,
    khr::ray_query::NAME,
    khr::swapchain::NAME,
];

/// Formats that are looked at: of the G-buffer, of pictures, and of textures.
const FORMATS: [vk::Format; 9] = [
    vk::Format::R16G16B16A16_SFLOAT,
    vk::Format::R16G16B16A16_UNORM,
    vk::Format::R16G16B16A16_SNORM,
    vk::Format::R32G32_UINT,
    vk::Format::R32_UINT,
    vk::Format::R32_SFLOAT,
    vk::Format::R32G32B32A32_SFLOAT,
    vk::Format::R8G8B8A8_UNORM,
    vk::Format::D32_SFLOAT,
];

/// Uses of images that are looked at.
const USES: [(vk::FormatFeatureFlags, &str); 6] = [
    (vk::FormatFeatureFlags::SAMPLED_IMAGE, "SAMPLED_IMAGE"),
    (vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR, "SAMPLED_IMAGE_FILTER_LINEAR"),
    (vk::FormatFeatureFlags::STORAGE_IMAGE, "STORAGE_IMAGE"),
    (vk::FormatFeatureFlags::COLOR_ATTACHMENT, "COLOR_ATTACHMENT"),
    (vk::FormatFeatureFlags::COLOR_ATTACHMENT_BLEND, "COLOR_ATTACHMENT_BLEND"),
    (vk::FormatFeatureFlags::DEPTH_STENCIL_ATTACHMENT, "DEPTH_STENCIL_ATTACHMENT"),
];

/// Properties of memory that are looked at.
const MEMORY: [(vk::MemoryPropertyFlags, &str); 4] = [
    (vk::MemoryPropertyFlags::DEVICE_LOCAL, "DEVICE_LOCAL"),
    (vk::MemoryPropertyFlags::HOST_VISIBLE, "HOST_VISIBLE"),
    (vk::MemoryPropertyFlags::HOST_COHERENT, "HOST_COHERENT"),
    (vk::MemoryPropertyFlags::HOST_CACHED, "HOST_CACHED"),
];

impl Capabilities {
    /// What an open device says.
    #[must_use]
    pub fn of(device: &Arc<Device>) -> Self {
        let (raw, physical) = (&device.instance.raw, device.physical);
        let mut v11 = vk::PhysicalDeviceVulkan11Properties::default();
        let mut v12_properties = vk::PhysicalDeviceVulkan12Properties::default();
        let mut v13_properties = vk::PhysicalDeviceVulkan13Properties::default();
        let mut push = vk::PhysicalDevicePushDescriptorPropertiesKHR::default();
        let mut v12 = vk::PhysicalDeviceVulkan12Features::default();
        let mut v13 = vk::PhysicalDeviceVulkan13Features::default();
        // SAFETY: plain queries on a live instance; the chains outlive the calls and hold no struct of an absent
        // extension.
        let (limits, features, memory, extensions, formats) = unsafe {
            let known = raw.enumerate_device_extension_properties(physical).unwrap_or_default();
            let has = |name| known.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
            let mut properties = vk::PhysicalDeviceProperties2::default()
                .push_next(&mut v11)
                .push_next(&mut v12_properties)
                .push_next(&mut v13_properties);
            if has(khr::push_descriptor::NAME) {
                properties = properties.push_next(&mut push);
            }
            raw.get_physical_device_properties2(physical, &mut properties);
            let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut v12).push_next(&mut v13);
            raw.get_physical_device_features2(physical, &mut features);
            let extensions = EXTENSIONS.map(|name| (name.to_string_lossy().into_owned(), has(name)));
            let formats = FORMATS.map(|format| (format, raw.get_physical_device_format_properties(physical, format)));
            let memory = raw.get_physical_device_memory_properties(physical);
            (properties.properties.limits, features.features, memory, extensions, formats)
        };
        let yes = |value: vk::Bool32| value == vk::TRUE;
        let features = members! {
            features, yes, {
                geometry_shader = "geometryShader",
                fragment_stores_and_atomics = "fragmentStoresAndAtomics",
                shader_storage_image_extended_formats = "shaderStorageImageExtendedFormats",
                full_draw_index_uint32 = "fullDrawIndexUint32",
                robust_buffer_access = "robustBufferAccess",
                shader_float64 = "shaderFloat64",
                shader_int64 = "shaderInt64",
                sampler_anisotropy = "samplerAnisotropy",
            }
            v12, yes, {
                timeline_semaphore = "timelineSemaphore",
                scalar_block_layout = "scalarBlockLayout",
                shader_float16 = "shaderFloat16",
                shader_int8 = "shaderInt8",
                descriptor_indexing = "descriptorIndexing",
                buffer_device_address = "bufferDeviceAddress",
            }
            v13, yes, {
                dynamic_rendering = "dynamicRendering",
                synchronization2 = "synchronization2",
                maintenance4 = "maintenance4",
                subgroup_size_control = "subgroupSizeControl",
            }
            v12_properties, yes, {
                shader_signed_zero_inf_nan_preserve_float32 = "shaderSignedZeroInfNanPreserveFloat32",
                shader_rounding_mode_rte_float32 = "shaderRoundingModeRTEFloat32",
                shader_denorm_preserve_float32 = "shaderDenormPreserveFloat32",
                shader_denorm_flush_to_zero_float32 = "shaderDenormFlushToZeroFloat32",
            }
        };
        let mut lowered = members! {
            limits, u64::from, {
                max_image_dimension2_d = "maxImageDimension2D",
                max_texel_buffer_elements = "maxTexelBufferElements",
                max_storage_buffer_range = "maxStorageBufferRange",
                max_color_attachments = "maxColorAttachments",
                max_per_stage_descriptor_storage_images = "maxPerStageDescriptorStorageImages",
                max_per_stage_descriptor_storage_buffers = "maxPerStageDescriptorStorageBuffers",
                max_per_stage_descriptor_uniform_buffers = "maxPerStageDescriptorUniformBuffers",
                max_per_stage_descriptor_samplers = "maxPerStageDescriptorSamplers",
                max_per_stage_descriptor_sampled_images = "maxPerStageDescriptorSampledImages",
                max_draw_indexed_index_value = "maxDrawIndexedIndexValue",
                sub_pixel_precision_bits = "subPixelPrecisionBits",
                sub_texel_precision_bits = "subTexelPrecisionBits",
                max_compute_shared_memory_size = "maxComputeSharedMemorySize",
                max_compute_work_group_invocations = "maxComputeWorkGroupInvocations",
            }
            v13_properties, u64::from, {
                min_subgroup_size = "minSubgroupSize",
                max_subgroup_size = "maxSubgroupSize",
            }
            push, u64::from, { max_push_descriptors = "maxPushDescriptors" }
        };
        lowered.insert("maxBufferSize".to_owned(), v13_properties.max_buffer_size);
        let named = |flags: &[(u32, &str)], has: u32| -> Vec<String> {
            flags.iter().filter(|(bit, _)| has & bit != 0).map(|(_, name)| (*name).to_owned()).collect()
        };
        let uses = USES.map(|(flag, name)| (flag.as_raw(), name));
        let kinds = MEMORY.map(|(flag, name)| (flag.as_raw(), name));
        let compute = v11.subgroup_supported_stages.contains(vk::ShaderStageFlags::COMPUTE);
        Self {
            features,
            extensions: extensions.into_iter().collect(),
            limits: lowered,
            formats: formats
                .map(|(format, has)| (format!("{format:?}"), named(&uses, has.optimal_tiling_features.as_raw())))
                .into(),
            memory: memory.memory_types_as_slice().iter().map(|t| named(&kinds, t.property_flags.as_raw())).collect(),
            heaps: memory.memory_heaps_as_slice().iter().map(|heap| heap.size).collect(),
            subgroup_arithmetic: compute
                && v11.subgroup_supported_operations.contains(vk::SubgroupFeatureFlags::ARITHMETIC),
            subgroup_size: v11.subgroup_size,
            timestamps: device.has_timestamps(),
            timestamp_ns: limits.timestamp_period,
        }
    }
}
