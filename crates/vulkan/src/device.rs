//! Instance, physical devices, and the logical device with its queue, allocator and caches.
//!
//! Read the Vulkan specification, chapters Initialization, Devices and Queues, Features and Limits; validation reports
//! through `VK_EXT_debug_utils`. One queue executes everything, and one timeline semaphore counts its submissions.
//! Features that every device must have are listed in `Instance::missing`, optional features in `offers.rs`.

use std::ffi::{CStr, CString, FromBytesUntilNulError, c_char, c_void};
use std::mem::ManuallyDrop;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use anyhow::{Context as _, Result, anyhow, bail, ensure};
use ash::{ext, khr, vk};
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};
use serde::Serialize;

use super::cache::Caches;
use super::choice::DeviceChoice;
use super::error::NotOpened;
use super::kept_pipelines::KeptPipelines;
use super::limits::{
    COLOR_TARGETS, SAMPLED_IMAGES, STORAGE_BUFFERS, STORAGE_BUFFERS_AND_TABLES, STORAGE_IMAGES, UNIFORM_BUFFERS,
};
use super::offers::Offers;
use super::pace::{OF_FRAME, SliceTimes};

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// The identity of a device, for reports.
#[derive(Debug, Clone, Serialize)]
pub struct DeviceInfo {
    /// Marketing name.
    pub name: String,
    /// Driver name and driver information.
    pub driver: String,
    /// Driver version.
    pub version: String,
    /// `cpu`, `discrete`, `integrated`, `virtual` or `other`.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// Vulkan version of the device.
    pub api: String,
}

impl DeviceInfo {
    /// Rank of the device's kind, 0 for the best; `None` for an unknown kind.
    #[must_use]
    pub fn rank(&self) -> Option<usize> {
        ["discrete", "integrated", "virtual", "other", "cpu"].iter().position(|kind| *kind == self.kind)
    }
}

/// A physical device, and the reasons why Etalon cannot use it.
#[derive(Debug, Clone, Serialize)]
pub struct Candidate {
    /// Identity of the device.
    #[serde(flatten)]
    pub info: DeviceInfo,
    /// Required features and limits that the device lacks; empty when Etalon can use it.
    pub missing: Vec<String>,
    /// Optional features of the device.
    pub offers: Offers,
    #[serde(skip)]
    is_lavapipe: bool,
    #[serde(skip)]
    physical: vk::PhysicalDevice,
}

/// Severity of a validation message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Worth a look.
    Warning,
    /// A bug of Etalon or of its caller.
    Error,
}

/// A message of the validation layer.
#[derive(Debug, Clone, Serialize)]
pub struct Message {
    /// Warning or error.
    pub severity: Severity,
    /// Text of the message.
    pub text: String,
}

/// Record of a Vulkan object that was created.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Created {
    /// `buffer`, `image`, `pipeline` or `sampler`.
    pub kind: &'static str,
    /// Debug name of the object.
    pub name: String,
    /// Bytes of memory bound to the object.
    pub bytes: u64,
}

type Messages = Mutex<Vec<Message>>;

/// Locks a mutex and ignores poisoning: the data consists of counters and caches only.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Keeps the drivers loaded from the second instance of the process on, by an instance that is never destroyed: the
/// loader unloads them with the last one. NVIDIA's driver (580.159) can be loaded a few dozen times in a process; after
/// that the loader finds no driver any more.
fn keep_drivers_loaded(entry: &ash::Entry, extensions: &[*const c_char], flags: vk::InstanceCreateFlags) {
    static CREATED: AtomicU64 = AtomicU64::new(0);
    if CREATED.fetch_add(1, Ordering::Relaxed) == 1 {
        let app = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
        let info =
            vk::InstanceCreateInfo::default().application_info(&app).enabled_extension_names(extensions).flags(flags);
        // SAFETY: the structures outlive the call.
        match unsafe { entry.create_instance(&info, None) } {
            Ok(kept) => std::mem::forget((entry.clone(), kept)),
            // The instance that was asked for is there: only a later one may be missing.
            Err(error) => tracing::debug!("no instance keeps the drivers loaded: {error}"),
        }
    }
}

/// The right of an instance to enable validation (`open.rs`).
pub(super) type RightToValidate = Box<dyn Send + Sync>;

/// What a surface supports (`vkGetPhysicalDeviceSurfaceSupportKHR`).
pub(super) trait SurfaceSupport {
    /// Whether a queue family can present to it.
    fn supports(&self, physical: vk::PhysicalDevice, family: u32) -> bool;
}

/// The Vulkan instance with its loader and debug messenger.
pub(super) struct Instance {
    pub(super) entry: ash::Entry,
    pub(super) raw: ash::Instance,
    debug: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    has_debug_utils: bool,
    messages: Box<Messages>,
    /// Dropped last, when the validation layer has nothing left of this instance.
    _right: Option<RightToValidate>,
}

impl Instance {
    /// Creates an instance, with validation when the caller has the right to it.
    pub(super) fn new(right: Option<RightToValidate>, wanted_extensions: &[*const c_char]) -> Result<Self> {
        let validate = right.is_some();
        // SAFETY: the loader is a shared library that stays loaded as long as `entry` lives.
        let entry = unsafe { ash::Entry::load() }.map_err(|e| NotOpened::NoLoader(e.to_string()))?;
        // SAFETY: plain queries.
        let (extensions, layers) = unsafe {
            (entry.enumerate_instance_extension_properties(None)?, entry.enumerate_instance_layer_properties()?)
        };
        let has = |name: &CStr| extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
        for &wanted in wanted_extensions {
            // SAFETY: names from ash's own tables.
            let wanted = unsafe { CStr::from_ptr(wanted) };
            ensure!(has(wanted), NotOpened::NoWindows(wanted.to_string_lossy().into_owned()));
        }
        let mut enabled = wanted_extensions.to_vec();
        let mut flags = vk::InstanceCreateFlags::empty();
        let has_debug_utils = has(ext::debug_utils::NAME);
        if has_debug_utils {
            enabled.push(ext::debug_utils::NAME.as_ptr());
        }
        let portability = [khr::portability_enumeration::NAME.as_ptr()];
        let portability = if has(khr::portability_enumeration::NAME) { &portability[..] } else { &[] };
        if !portability.is_empty() {
            enabled.extend(portability);
            flags |= vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR;
        }
        let mut layer_names = Vec::new();
        if validate {
            if !layers.iter().any(|l| l.layer_name_as_c_str() == Ok(VALIDATION_LAYER)) {
                bail!(NotOpened::NoValidation);
            }
            layer_names.push(VALIDATION_LAYER.as_ptr());
            enabled.push(ext::validation_features::NAME.as_ptr());
        }
        let app = vk::ApplicationInfo::default().application_name(c"etalon").api_version(vk::API_VERSION_1_3);
        let wanted = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&wanted);
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&app)
            .enabled_extension_names(&enabled)
            .enabled_layer_names(&layer_names)
            .flags(flags);
        if validate {
            info = info.push_next(&mut features);
        }
        // SAFETY: `info` points at data that outlives the call.
        let raw = unsafe { entry.create_instance(&info, None) }.context("creating a Vulkan 1.3 instance")?;
        keep_drivers_loaded(&entry, portability, flags);
        let messages: Box<Messages> = Box::default();
        let debug = if validate {
            let utils = ext::debug_utils::Instance::new(&entry, &raw);
            let create = vk::DebugUtilsMessengerCreateInfoEXT::default()
                .message_severity(
                    vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
                )
                .message_type(
                    vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION | vk::DebugUtilsMessageTypeFlagsEXT::GENERAL,
                )
                .pfn_user_callback(Some(on_message))
                .user_data(std::ptr::from_ref::<Messages>(&messages).cast_mut().cast());
            // SAFETY: the box behind `user_data` is freed after the messenger is destroyed.
            let messenger = unsafe { utils.create_debug_utils_messenger(&create, None) }?;
            Some((utils, messenger))
        } else {
            None
        };
        Ok(Self { entry, raw, debug, has_debug_utils, messages, _right: right })
    }

    fn candidates(&self, surface: Option<&dyn SurfaceSupport>) -> Result<Vec<Candidate>> {
        // SAFETY: plain queries on a live instance.
        let devices = unsafe { self.raw.enumerate_physical_devices() }.context("listing Vulkan devices")?;
        Ok(devices.into_iter().map(|physical| self.candidate(physical, surface)).collect())
    }

    fn candidate(&self, physical: vk::PhysicalDevice, surface: Option<&dyn SurfaceSupport>) -> Candidate {
        let mut driver = vk::PhysicalDeviceDriverProperties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
        // SAFETY: plain queries; the chain outlives the call.
        let extensions = unsafe {
            self.raw.get_physical_device_properties2(physical, &mut properties);
            self.raw.enumerate_device_extension_properties(physical).unwrap_or_default()
        };
        let properties = properties.properties;
        let version =
            |v: u32| format!("{}.{}.{}", vk::api_version_major(v), vk::api_version_minor(v), vk::api_version_patch(v));
        let info = DeviceInfo {
            name: text(properties.device_name_as_c_str()),
            driver: format!("{} {}", text(driver.driver_name_as_c_str()), text(driver.driver_info_as_c_str())),
            version: version(properties.driver_version),
            kind: match properties.device_type {
                vk::PhysicalDeviceType::CPU => "cpu",
                vk::PhysicalDeviceType::DISCRETE_GPU => "discrete",
                vk::PhysicalDeviceType::INTEGRATED_GPU => "integrated",
                vk::PhysicalDeviceType::VIRTUAL_GPU => "virtual",
                _ => "other",
            },
            api: version(properties.api_version),
        };
        let offers = Offers::of(&self.raw, physical, &extensions);
        let is_lavapipe = driver.driver_id == vk::DriverId::MESA_LLVMPIPE;
        let mut missing = self.missing(physical, properties.api_version, &offers, properties.limits);
        missing.extend(
            surface
                .filter(|surface| !self.presents_to(physical, *surface))
                .map(|_| "a way to show pictures in this window".to_owned()),
        );
        Candidate { info, missing, offers, physical, is_lavapipe }
    }

    /// Whether a queue family can draw, compute and present to a surface.
    fn presents_to(&self, physical: vk::PhysicalDevice, surface: &dyn SurfaceSupport) -> bool {
        // SAFETY: a plain query.
        let families = unsafe { self.raw.get_physical_device_queue_family_properties(physical) };
        families.iter().enumerate().any(|(family, properties)| {
            properties.queue_flags.contains(QUEUE) && surface.supports(physical, family as u32)
        })
    }

    /// Required features and limits that the device lacks, each with the Mesa version that has it where an update
    /// helps.
    fn missing(
        &self,
        physical: vk::PhysicalDevice,
        api: u32,
        offers: &Offers,
        limits: vk::PhysicalDeviceLimits,
    ) -> Vec<String> {
        if api < vk::API_VERSION_1_3 {
            return vec!["Vulkan 1.3 (lavapipe: Mesa 22.1 or newer)".to_owned()];
        }
        let mut missing = Vec::new();
        let mut v12 = vk::PhysicalDeviceVulkan12Features::default();
        let mut v13 = vk::PhysicalDeviceVulkan13Features::default();
        let mut all = vk::PhysicalDeviceFeatures2::default().push_next(&mut v12).push_next(&mut v13);
        // SAFETY: plain queries; the chain outlives the call.
        let families = unsafe {
            self.raw.get_physical_device_features2(physical, &mut all);
            self.raw.get_physical_device_queue_family_properties(physical)
        };
        let core = all.features;
        for (has, what) in [
            (core.fragment_stores_and_atomics, "feature fragmentStoresAndAtomics"),
            (core.shader_storage_image_extended_formats, "feature shaderStorageImageExtendedFormats"),
            (v12.timeline_semaphore, "feature timelineSemaphore"),
            (v12.scalar_block_layout, "feature scalarBlockLayout (lavapipe: Mesa 21.1 or newer)"),
            (v13.dynamic_rendering, "feature dynamicRendering (lavapipe: Mesa 22.1 or newer)"),
            (v13.maintenance4, "feature maintenance4 (lavapipe: Mesa 22.1 or newer)"),
            (v13.synchronization2, "feature synchronization2 (lavapipe: Mesa 22.1 or newer)"),
        ] {
            if has == vk::FALSE {
                missing.push(what.to_owned());
            }
        }
        use vk::FormatFeatureFlags as F;
        let target = F::COLOR_ATTACHMENT | F::STORAGE_IMAGE;
        for (format, uses, what) in [
            (vk::Format::R16G16B16A16_SFLOAT, target, "colour targets and storage images of RGBA16_SFLOAT"),
            (vk::Format::R16G16B16A16_UNORM, target, "colour targets and storage images of RGBA16_UNORM"),
            (vk::Format::R32G32_UINT, target, "colour targets and storage images of RG32_UINT"),
            (vk::Format::R32G32B32A32_SFLOAT, F::SAMPLED_IMAGE_FILTER_LINEAR, "linear filtering of RGBA32_SFLOAT"),
        ] {
            // SAFETY: a plain query.
            let has = unsafe { self.raw.get_physical_device_format_properties(physical, format) };
            if !has.optimal_tiling_features.contains(uses) {
                missing.push(what.to_owned());
            }
        }
        let buffers = if offers.texel_buffers { STORAGE_BUFFERS } else { STORAGE_BUFFERS_AND_TABLES };
        let sampled = limits.max_per_stage_descriptor_samplers.min(limits.max_per_stage_descriptor_sampled_images);
        for (has, needed, what) in [
            (sampled, SAMPLED_IMAGES, "sampled images in a shader"),
            (limits.max_per_stage_descriptor_storage_images, STORAGE_IMAGES, "storage images in a shader"),
            (limits.max_per_stage_descriptor_storage_buffers, buffers, "storage buffers in a shader"),
            (limits.max_per_stage_descriptor_uniform_buffers, UNIFORM_BUFFERS, "uniform buffers in a shader"),
            (limits.max_color_attachments, COLOR_TARGETS, "colour targets"),
        ] {
            if has < needed {
                missing.push(format!("{needed} {what} (it has {has})"));
            }
        }
        if !families.iter().any(|f| f.queue_flags.contains(QUEUE)) {
            missing.push("a queue with graphics and compute".to_owned());
        }
        missing
    }
}

pub(super) const QUEUE: vk::QueueFlags =
    vk::QueueFlags::from_raw(vk::QueueFlags::GRAPHICS.as_raw() | vk::QueueFlags::COMPUTE.as_raw());

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: the device, the only child, is destroyed; the messenger is destroyed before the box that it writes
        // to.
        unsafe {
            if let Some((utils, messenger)) = &self.debug {
                utils.destroy_debug_utils_messenger(*messenger, None);
            }
            self.raw.destroy_instance(None);
        }
    }
}

unsafe extern "system" fn on_message(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: Vulkan passes valid callback data, and `user` is the box of messages (see `Instance::new`).
    let (text, messages) = unsafe {
        let text = CStr::from_ptr((*data).p_message).to_string_lossy().into_owned();
        (text, &*user.cast::<Messages>())
    };
    let error = severity.contains(vk::DebugUtilsMessageSeverityFlagsEXT::ERROR);
    let severity = if error { Severity::Error } else { Severity::Warning };
    tracing::warn!(target: "validation", "{text}");
    lock(messages).push(Message { severity, text });
    vk::FALSE
}

/// All physical devices, in the order of `--device INDEX`.
pub fn candidates() -> Result<Vec<Candidate>> {
    Instance::new(None, &[])?.candidates(None)
}

/// A driver's string.
pub(super) fn text(name: Result<&CStr, FromBytesUntilNulError>) -> String {
    name.map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

fn choose(all: Vec<Candidate>, choice: &DeviceChoice) -> Result<Candidate> {
    if all.is_empty() {
        bail!(NotOpened::NoDevice);
    }
    let offered: Vec<String> = all.iter().map(|c| format!("\"{}\"", c.info.name)).collect();
    let mut wanted: Vec<(usize, Candidate)> = all
        .into_iter()
        .enumerate()
        .filter(|(index, c)| match choice {
            DeviceChoice::Best => true,
            DeviceChoice::Cpu => c.info.kind == "cpu",
            DeviceChoice::Gpu => c.info.kind != "cpu",
            DeviceChoice::Index(i) => i == index,
            DeviceChoice::Name(name) => c.info.name.to_lowercase().contains(&name.to_lowercase()),
        })
        .collect();
    // A usable device of lower rank is preferred to an unusable one of higher rank.
    wanted.sort_by_key(|(index, c)| (!c.missing.is_empty(), c.info.rank(), *index));
    let Some((_, best)) = wanted.into_iter().next() else {
        bail!(NotOpened::NoneLike { choice: choice.clone(), offered });
    };
    if !best.missing.is_empty() {
        let DeviceInfo { name: device, driver, .. } = best.info;
        let missing = best.missing.iter().map(ToString::to_string).collect();
        bail!(NotOpened::Lacks { device, driver, missing });
    }
    Ok(best)
}

/// Whether the error is `VK_ERROR_DEVICE_LOST`: no object of the device can be used again.
#[must_use]
pub fn is_lost(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| cause.downcast_ref() == Some(&vk::Result::ERROR_DEVICE_LOST))
}

/// A logical device with its one queue, and the caches of the objects created on it.
pub struct Device {
    pub(super) raw: ash::Device,
    pub(super) queue: Mutex<vk::Queue>,
    pub(super) commands: Mutex<vk::CommandPool>,
    pub(super) timeline: vk::Semaphore,
    pub(super) push: Option<khr::push_descriptor::Device>,
    pub(super) debug: Option<ext::debug_utils::Device>,
    /// Functions of VK_KHR_pipeline_executable_properties, on drivers that have it.
    pub(super) executables: Option<khr::pipeline_executable_properties::Device>,
    pub(super) allocator: Mutex<ManuallyDrop<Allocator>>,
    pub(super) caches: Mutex<Caches>,
    pub(super) kept_pipelines: KeptPipelines,
    pub(super) limits: vk::PhysicalDeviceLimits,
    offers: Offers,
    is_lavapipe: bool,
    pub(super) submitted: AtomicU64,
    next_id: AtomicU64,
    created: Mutex<Vec<Created>>,
    objects: AtomicU64,
    info: DeviceInfo,
    pub(super) physical: vk::PhysicalDevice,
    #[cfg(feature = "window")]
    pub(super) family: u32,
    pub(super) time_slices: SliceTimes,
    pub(super) instance: Arc<Instance>,
    /// The bits of a timestamp that count; none on a device without timestamps.
    timestamp_bits: u64,
}

impl Device {
    /// Opens a device of an instance; with a surface, one that can present to it.
    pub(super) fn open_on(
        instance: Arc<Instance>,
        choice: &DeviceChoice,
        surface: Option<&dyn SurfaceSupport>,
        time_slices: bool,
    ) -> Result<Arc<Self>> {
        let Candidate { info, physical, offers, is_lavapipe, .. } = choose(instance.candidates(surface)?, choice)?;
        let opening = || format!("opening device \"{}\"", info.name);
        let is_software = info.kind == "cpu";
        // SAFETY: plain queries on a live instance.
        let (families, properties, extensions) = unsafe {
            (
                instance.raw.get_physical_device_queue_family_properties(physical),
                instance.raw.get_physical_device_properties(physical),
                instance.raw.enumerate_device_extension_properties(physical)?,
            )
        };
        let family = families
            .iter()
            .enumerate()
            .position(|(i, f)| {
                f.queue_flags.contains(QUEUE) && surface.is_none_or(|surface| surface.supports(physical, i as u32))
            })
            .ok_or_else(|| anyhow!("no queue with graphics and compute"))
            .with_context(opening)? as u32;

        let bits = families[family as usize].timestamp_valid_bits;
        let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
        let mut names = Vec::new();
        if offers.push_descriptors {
            names.push(khr::push_descriptor::NAME.as_ptr());
        }
        names.extend(surface.map(|_| khr::swapchain::NAME.as_ptr()));
        if extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(khr::portability_subset::NAME)) {
            names.push(khr::portability_subset::NAME.as_ptr());
        }
        if offers.tells_compiled {
            names.push(khr::pipeline_executable_properties::NAME.as_ptr());
        }
        let core = vk::PhysicalDeviceFeatures::default()
            .fragment_stores_and_atomics(true)
            .shader_storage_image_extended_formats(true)
            .full_draw_index_uint32(offers.large_indices)
            .geometry_shader(offers.primitive_ids)
            // Reads out of bounds are harmless in texel buffers; robust buffer access keeps them so in the storage
            // buffers that replace them.
            .robust_buffer_access(!offers.texel_buffers);
        let mut v12 = vk::PhysicalDeviceVulkan12Features::default().timeline_semaphore(true).scalar_block_layout(true);
        let mut v13 = vk::PhysicalDeviceVulkan13Features::default()
            .dynamic_rendering(true)
            .synchronization2(true)
            .maintenance4(true);
        let mut executables =
            vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default().pipeline_executable_info(true);
        let mut create = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&names)
            .enabled_features(&core)
            .push_next(&mut v12)
            .push_next(&mut v13);
        if offers.tells_compiled {
            create = create.push_next(&mut executables);
        }
        // SAFETY: `Instance::missing` and `Offers` have found every requested feature.
        let raw = unsafe { instance.raw.create_device(physical, &create, None) }.with_context(opening)?;
        let allocated = Allocator::new(&AllocatorCreateDesc {
            instance: instance.raw.clone(),
            device: raw.clone(),
            physical_device: physical,
            debug_settings: gpu_allocator::AllocatorDebugSettings::default(),
            buffer_device_address: false,
            // Small blocks for sub-allocation: an idle block of 256 MiB would be most of a software renderer's memory.
            allocation_sizes: gpu_allocator::AllocationSizes::new(16 << 20, 8 << 20),
        });
        let pool = vk::CommandPoolCreateInfo::default()
            .queue_family_index(family)
            .flags(vk::CommandPoolCreateFlags::TRANSIENT);
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let semaphore = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: the queue family was requested above; the create infos outlive the calls. Where one object is
        // missing, the others are destroyed, and then the device.
        let (queue, allocator, commands, timeline) = unsafe {
            let (queue, commands) = (raw.get_device_queue(family, 0), raw.create_command_pool(&pool, None));
            let timeline = raw.create_semaphore(&semaphore, None);
            let made = allocated.map_err(anyhow::Error::from);
            match made.and_then(|allocator| Ok((allocator, commands?, timeline?))) {
                Ok((allocator, commands, timeline)) => (queue, allocator, commands, timeline),
                Err(error) => {
                    raw.destroy_semaphore(timeline.unwrap_or_default(), None);
                    raw.destroy_command_pool(commands.unwrap_or_default(), None);
                    raw.destroy_device(None);
                    return Err(error).with_context(opening);
                }
            }
        };
        let kept_pipelines = KeptPipelines::open(&raw, &properties);
        let device = Arc::new(Self {
            push: offers.push_descriptors.then(|| khr::push_descriptor::Device::new(&instance.raw, &raw)),
            executables: offers
                .tells_compiled
                .then(|| khr::pipeline_executable_properties::Device::new(&instance.raw, &raw)),
            debug: instance.has_debug_utils.then(|| ext::debug_utils::Device::new(&instance.raw, &raw)),
            raw,
            queue: Mutex::new(queue),
            commands: Mutex::new(commands),
            timeline,
            allocator: Mutex::new(ManuallyDrop::new(allocator)),
            caches: Mutex::default(),
            kept_pipelines,
            limits: properties.limits,
            offers,
            is_lavapipe,
            submitted: AtomicU64::new(0),
            next_id: AtomicU64::new(1),
            created: Mutex::default(),
            objects: AtomicU64::new(0),
            info,
            physical,
            #[cfg(feature = "window")]
            family,
            time_slices: SliceTimes::new(surface.is_some(), time_slices, is_software),
            instance,
            timestamp_bits: match (properties.limits.timestamp_compute_and_graphics, bits) {
                (vk::FALSE, _) => 0,
                (_, 64..) => u64::MAX,
                (_, bits) => (1 << bits) - 1,
            },
        });
        Ok(device)
    }

    /// Identity of the device.
    #[must_use]
    pub fn info(&self) -> &DeviceInfo {
        &self.info
    }

    /// Whether commands can be timed.
    pub(super) fn has_timestamps(&self) -> bool {
        self.timestamp_bits != 0
    }

    /// Milliseconds between two timestamps; the counter may have started again in between.
    pub(super) fn ms_between(&self, from: u64, to: u64) -> f64 {
        let ticks = to.wrapping_sub(from) & self.timestamp_bits;
        // More than half of the counter: the second is the earlier one.
        let ticks = if ticks > self.timestamp_bits / 2 { 0 } else { ticks };
        ticks as f64 * f64::from(self.limits.timestamp_period) * 1e-6
    }

    /// Whether the validation layer is enabled.
    pub(super) fn validates(&self) -> bool {
        self.instance.debug.is_some()
    }

    /// Messages of the validation layer so far.
    #[must_use]
    pub fn messages(&self) -> Vec<Message> {
        lock(&self.instance.messages).clone()
    }

    /// Every object created so far, in order; empty for a device with time-sliced submission.
    #[must_use]
    pub fn created(&self) -> Vec<Created> {
        lock(&self.created).clone()
    }

    /// Bytes of device memory in the allocator's blocks now.
    #[must_use]
    pub fn memory_bytes(&self) -> u64 {
        lock(&self.allocator).generate_report().total_capacity_bytes
    }

    /// Whether the driver silently ends all loops of an invocation after 65,535 loop iterations, as lavapipe does.
    #[must_use]
    pub fn limits_loops(&self) -> bool {
        self.is_lavapipe
    }

    pub(super) fn is_lavapipe(&self) -> bool {
        self.is_lavapipe
    }

    /// Whether the device is the CPU: its memory is the process's own.
    #[must_use]
    pub fn is_software(&self) -> bool {
        self.info.kind == "cpu"
    }

    /// Largest distance in pixels by which the rasteriser snaps vertices to its sub-pixel grid before it interpolates
    /// depth. lavapipe rasterises coverage from snapped vertices and depth from exact ones, so its value is 0.
    #[must_use]
    pub fn snap_pixels(&self) -> f64 {
        // Half a grid step in x and in y.
        let half_diagonal = std::f64::consts::FRAC_1_SQRT_2 * 0.5_f64.powi(self.limits.sub_pixel_precision_bits as i32);
        if self.is_lavapipe { 0.0 } else { half_diagonal }
    }

    /// Largest width and height of a 2D image and of a viewport.
    #[must_use]
    pub fn max_image_size(&self) -> u32 {
        self.limits.max_image_dimension2_d.min(self.limits.max_viewport_dimensions[0])
    }

    /// Largest number of vertices of one draw.
    #[must_use]
    pub fn max_vertices(&self) -> usize {
        let largest = if self.offers.large_indices { u32::MAX - 1 } else { self.limits.max_draw_indexed_index_value };
        largest as usize + 1
    }

    /// Largest size in bytes of a storage buffer that is bound whole.
    #[must_use]
    pub fn max_storage_bytes(&self) -> u64 {
        u64::from(self.limits.max_storage_buffer_range).min(self.offers.max_buffer_bytes)
    }

    /// Size of the largest memory heap that is local to the device, in bytes.
    #[must_use]
    pub fn local_bytes(&self) -> u64 {
        // SAFETY: the physical device belongs to the instance, which is alive.
        let memory = unsafe { self.instance.raw.get_physical_device_memory_properties(self.physical) };
        let local =
            memory.memory_heaps_as_slice().iter().filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL));
        local.map(|heap| heap.size).max().unwrap_or_default()
    }

    /// Optional features of the device.
    #[must_use]
    pub fn offers(&self) -> &Offers {
        &self.offers
    }

    /// Number of buffers, images, pipelines and samplers that exist now.
    #[must_use]
    pub fn objects(&self) -> u64 {
        self.objects.load(Ordering::Relaxed)
    }

    pub(super) fn gone(&self) {
        self.objects.fetch_sub(1, Ordering::Relaxed);
    }

    pub(super) fn note(&self, kind: &'static str, name: &str, bytes: u64) {
        self.objects.fetch_add(1, Ordering::Relaxed);
        // A window runs for hours, and a picture has many frames: a list of every object would grow without bound.
        if self.time_slices.beside_window || name == OF_FRAME {
            return;
        }
        lock(&self.created).push(Created { kind, name: name.to_owned(), bytes });
    }

    pub(super) fn next_id(&self) -> u64 {
        self.next_id.fetch_add(1, Ordering::Relaxed)
    }

    /// Names an object for validation messages and captures (`VK_EXT_debug_utils`).
    pub(super) fn name<H: vk::Handle>(&self, object: H, name: &str) {
        if let Some(debug) = &self.debug {
            let name = CString::new(name.replace('\0', " ")).unwrap_or_default();
            let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(object).object_name(&name);
            // SAFETY: the object is alive. An object without its name is not worth an error.
            let _ = unsafe { debug.set_debug_utils_object_name(&info) };
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: every buffer, image and frame holds an `Arc` of the device, so none exists any more; the allocator is
        // dropped before the device that it allocates from.
        unsafe {
            let _ = self.raw.device_wait_idle();
            lock(&self.caches).destroy(&self.raw);
            self.kept_pipelines.close(&self.raw);
            ManuallyDrop::drop(&mut lock(&self.allocator));
            self.raw.destroy_semaphore(self.timeline, None);
            self.raw.destroy_command_pool(*lock(&self.commands), None);
            self.raw.destroy_device(None);
        }
        // `instance` is dropped after this function; it keeps `entry`, the loader's library, until then.
        let _ = &self.instance.entry;
    }
}

impl std::fmt::Debug for Device {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Device({})", self.info.name)
    }
}
