//! The Vulkan layer: device queries go to the next layer, and their results are lowered; described faults take the
//! place of submissions and allocations. All other calls are passed through.
//!
//! Read LunarG, "Architecture of the Vulkan Loader Interfaces", layer interface version 2.

use std::ffi::{CStr, c_char, c_void};
use std::ptr;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use ash::vk;

use crate::description::Description;

/// `VkNegotiateLayerInterface`, by which loader and layer agree on a version.
#[repr(C)]
struct Negotiation {
    kind: i32,
    next: *mut c_void,
    version: u32,
    instance_proc: Option<vk::PFN_vkGetInstanceProcAddr>,
    device_proc: Option<vk::PFN_vkGetDeviceProcAddr>,
    physical_device_proc: Option<vk::PFN_vkGetInstanceProcAddr>,
}

/// `VkLayerInstanceLink`: the next layer in the loader's chain for an instance.
#[repr(C)]
struct Link {
    next: *mut Link,
    instance_proc: vk::PFN_vkGetInstanceProcAddr,
    physical_device_proc: Option<vk::PFN_vkGetInstanceProcAddr>,
}

#[repr(C)]
struct LinkInfo {
    kind: vk::StructureType,
    next: *const c_void,
    function: i32,
    link: *mut Link,
}

/// `VK_LAYER_LINK_INFO`.
const LINK_INFO: i32 = 0;

/// Functions of the next layer, and the description. Test programs create one instance; with several, the last one
/// counts.
struct Below {
    description: Description,
    properties: vk::PFN_vkGetPhysicalDeviceProperties,
    properties2: vk::PFN_vkGetPhysicalDeviceProperties2,
    features: vk::PFN_vkGetPhysicalDeviceFeatures,
    features2: vk::PFN_vkGetPhysicalDeviceFeatures2,
    format: vk::PFN_vkGetPhysicalDeviceFormatProperties,
    memory: vk::PFN_vkGetPhysicalDeviceMemoryProperties,
    memory2: vk::PFN_vkGetPhysicalDeviceMemoryProperties2,
    extensions: vk::PFN_vkEnumerateDeviceExtensionProperties,
}

static NEXT: OnceLock<vk::PFN_vkGetInstanceProcAddr> = OnceLock::new();
static BELOW: OnceLock<Below> = OnceLock::new();
/// The last instance that was made.
static INSTANCE: AtomicU64 = AtomicU64::new(0);

fn below() -> &'static Below {
    BELOW.get().expect("an instance was made")
}

/// First call of the loader.
///
/// # Safety
/// Called by the loader, with a struct of version 2.
#[unsafe(no_mangle)]
#[allow(unreachable_pub, private_interfaces, reason = "the loader finds it by its name")]
pub unsafe extern "system" fn vkNegotiateLoaderLayerInterfaceVersion(asked: *mut Negotiation) -> vk::Result {
    // SAFETY: guaranteed by the loader.
    let asked = unsafe { &mut *asked };
    asked.version = asked.version.min(2);
    asked.instance_proc = Some(instance_proc);
    asked.device_proc = Some(device_proc);
    asked.physical_device_proc = None;
    vk::Result::SUCCESS
}

/// A function as the pointer type that Vulkan returns for all functions.
macro_rules! ours {
    ($function:ident as $kind:ty) => {
        // SAFETY: a caller that asks by name casts the pointer back to the type of that name.
        Some(unsafe { std::mem::transmute::<$kind, unsafe extern "system" fn()>($function as $kind) })
    };
}

unsafe extern "system" fn instance_proc(instance: vk::Instance, name: *const c_char) -> vk::PFN_vkVoidFunction {
    // SAFETY: a string with a terminating 0.
    match unsafe { CStr::from_ptr(name) }.to_bytes() {
        b"vkGetInstanceProcAddr" => ours!(instance_proc as vk::PFN_vkGetInstanceProcAddr),
        b"vkCreateInstance" => ours!(create_instance as vk::PFN_vkCreateInstance),
        b"vkCreateDevice" => ours!(create_device as vk::PFN_vkCreateDevice),
        b"vkGetPhysicalDeviceProperties" => ours!(properties as vk::PFN_vkGetPhysicalDeviceProperties),
        b"vkGetPhysicalDeviceProperties2" | b"vkGetPhysicalDeviceProperties2KHR" => {
            ours!(properties2 as vk::PFN_vkGetPhysicalDeviceProperties2)
        }
        b"vkGetPhysicalDeviceFeatures" => ours!(features as vk::PFN_vkGetPhysicalDeviceFeatures),
        b"vkGetPhysicalDeviceFeatures2" | b"vkGetPhysicalDeviceFeatures2KHR" => {
            ours!(features2 as vk::PFN_vkGetPhysicalDeviceFeatures2)
        }
        b"vkGetPhysicalDeviceFormatProperties" => ours!(format as vk::PFN_vkGetPhysicalDeviceFormatProperties),
        b"vkGetPhysicalDeviceMemoryProperties" => ours!(memory as vk::PFN_vkGetPhysicalDeviceMemoryProperties),
        b"vkGetPhysicalDeviceMemoryProperties2" => ours!(memory2 as vk::PFN_vkGetPhysicalDeviceMemoryProperties2),
        b"vkEnumerateDeviceExtensionProperties" => ours!(extensions as vk::PFN_vkEnumerateDeviceExtensionProperties),
        // SAFETY: the function of the next layer.
        _ => NEXT.get().and_then(|next| unsafe { next(instance, name) }),
    }
}

unsafe extern "system" fn create_instance(
    info: *const vk::InstanceCreateInfo<'_>,
    allocator: *const vk::AllocationCallbacks<'_>,
    made: *mut vk::Instance,
) -> vk::Result {
    let description = match Description::from_environment() {
        Ok(description) => description,
        Err(error) => {
            eprintln!("the mask: {error}");
            return vk::Result::ERROR_INITIALIZATION_FAILED;
        }
    };
    // SAFETY: the loader's chain holds the link of this layer, which must be advanced to the next layer's.
    unsafe {
        let mut at = (*info).p_next.cast::<LinkInfo>().cast_mut();
        while !at.is_null()
            && ((*at).kind != vk::StructureType::LOADER_INSTANCE_CREATE_INFO || (*at).function != LINK_INFO)
        {
            at = (*at).next.cast::<LinkInfo>().cast_mut();
        }
        if at.is_null() {
            return vk::Result::ERROR_INITIALIZATION_FAILED;
        }
        let next = (*(*at).link).instance_proc;
        (*at).link = (*(*at).link).next;
        let _ = NEXT.set(next);
        /// Looks up a function of the next layer by name.
        macro_rules! next {
            ($instance:expr, $name:literal, $kind:ty) => {
                match next($instance, $name.as_ptr()) {
                    Some(found) => std::mem::transmute::<unsafe extern "system" fn(), $kind>(found),
                    None => return vk::Result::ERROR_INITIALIZATION_FAILED,
                }
            };
        }
        let create = next!(vk::Instance::null(), c"vkCreateInstance", vk::PFN_vkCreateInstance);
        let answer = create(info, allocator, made);
        if answer != vk::Result::SUCCESS {
            return answer;
        }
        let instance = *made;
        INSTANCE.store(vk::Handle::as_raw(instance), Ordering::Relaxed);
        let _ = BELOW.set(Below {
            description,
            properties: next!(instance, c"vkGetPhysicalDeviceProperties", vk::PFN_vkGetPhysicalDeviceProperties),
            properties2: next!(instance, c"vkGetPhysicalDeviceProperties2", vk::PFN_vkGetPhysicalDeviceProperties2),
            features: next!(instance, c"vkGetPhysicalDeviceFeatures", vk::PFN_vkGetPhysicalDeviceFeatures),
            features2: next!(instance, c"vkGetPhysicalDeviceFeatures2", vk::PFN_vkGetPhysicalDeviceFeatures2),
            format: next!(
                instance,
                c"vkGetPhysicalDeviceFormatProperties",
                vk::PFN_vkGetPhysicalDeviceFormatProperties
            ),
            memory: next!(
                instance,
                c"vkGetPhysicalDeviceMemoryProperties",
                vk::PFN_vkGetPhysicalDeviceMemoryProperties
            ),
            memory2: next!(
                instance,
                c"vkGetPhysicalDeviceMemoryProperties2",
                vk::PFN_vkGetPhysicalDeviceMemoryProperties2
            ),
            extensions: next!(
                instance,
                c"vkEnumerateDeviceExtensionProperties",
                vk::PFN_vkEnumerateDeviceExtensionProperties
            ),
        });
    }
    vk::Result::SUCCESS
}

unsafe extern "system" fn properties(device: vk::PhysicalDevice, to: *mut vk::PhysicalDeviceProperties) {
    // SAFETY: the caller's struct, filled by the next layer.
    unsafe {
        (below().properties)(device, to);
        below().description.lower_properties(&mut *to);
    }
}

unsafe extern "system" fn properties2(device: vk::PhysicalDevice, to: *mut vk::PhysicalDeviceProperties2<'_>) {
    let description = &below().description;
    // SAFETY: the caller's chain, filled by the next layer; each struct has the type of its `s_type`.
    unsafe {
        (below().properties2)(device, to);
        description.lower_properties(&mut (*to).properties);
        for at in chain((*to).p_next) {
            match (*at).s_type {
                vk::StructureType::PHYSICAL_DEVICE_VULKAN_1_1_PROPERTIES => {
                    description.lower_subgroups(&mut *at.cast())
                }
                vk::StructureType::PHYSICAL_DEVICE_VULKAN_1_3_PROPERTIES => {
                    description.lower_properties_1_3(&mut *at.cast());
                }
                vk::StructureType::PHYSICAL_DEVICE_PUSH_DESCRIPTOR_PROPERTIES_KHR => {
                    description.lower_push_descriptors(&mut *at.cast());
                }
                _ => {}
            }
        }
    }
}

unsafe extern "system" fn features(device: vk::PhysicalDevice, to: *mut vk::PhysicalDeviceFeatures) {
    // SAFETY: the caller's struct, filled by the next layer.
    unsafe {
        (below().features)(device, to);
        below().description.lower_features(&mut *to);
    }
}

unsafe extern "system" fn features2(device: vk::PhysicalDevice, to: *mut vk::PhysicalDeviceFeatures2<'_>) {
    let description = &below().description;
    // SAFETY: the caller's chain, filled by the next layer; each struct has the type of its `s_type`.
    unsafe {
        (below().features2)(device, to);
        description.lower_features(&mut (*to).features);
        for at in chain((*to).p_next) {
            match (*at).s_type {
                vk::StructureType::PHYSICAL_DEVICE_VULKAN_1_2_FEATURES => {
                    description.lower_features_1_2(&mut *at.cast())
                }
                vk::StructureType::PHYSICAL_DEVICE_VULKAN_1_3_FEATURES => {
                    description.lower_features_1_3(&mut *at.cast())
                }
                _ => {}
            }
        }
    }
}

/// The structs of a `pNext` chain.
///
/// # Safety
/// `first` is such a chain, and it outlives the iterator.
unsafe fn chain(first: *mut c_void) -> impl Iterator<Item = *mut vk::BaseOutStructure<'static>> {
    let first = first.cast::<vk::BaseOutStructure<'static>>();
    // SAFETY: guaranteed by the caller.
    std::iter::successors((!first.is_null()).then_some(first), |at| unsafe {
        let next = (**at).p_next;
        (!next.is_null()).then_some(next)
    })
}

unsafe extern "system" fn format(device: vk::PhysicalDevice, of: vk::Format, to: *mut vk::FormatProperties) {
    // SAFETY: the caller's struct, filled by the next layer.
    unsafe {
        (below().format)(device, of, to);
        below().description.lower_format(of, &mut *to);
    }
}

unsafe extern "system" fn memory(device: vk::PhysicalDevice, to: *mut vk::PhysicalDeviceMemoryProperties) {
    // SAFETY: the caller's struct, filled by the next layer.
    unsafe {
        (below().memory)(device, to);
        below().description.lower_memory(&mut *to);
    }
}

unsafe extern "system" fn memory2(device: vk::PhysicalDevice, to: *mut vk::PhysicalDeviceMemoryProperties2<'_>) {
    // SAFETY: the caller's struct, filled by the next layer.
    unsafe {
        (below().memory2)(device, to);
        below().description.lower_memory(&mut (*to).memory_properties);
    }
}

unsafe extern "system" fn extensions(
    device: vk::PhysicalDevice,
    layer: *const c_char,
    count: *mut u32,
    to: *mut vk::ExtensionProperties,
) -> vk::Result {
    // SAFETY: callers ask for the count first, then for all; the caller's array holds that many elements.
    unsafe {
        let next = below().extensions;
        let mut all_count = 0;
        let answer = next(device, layer, &raw mut all_count, ptr::null_mut());
        if answer != vk::Result::SUCCESS {
            return answer;
        }
        let mut all = vec![vk::ExtensionProperties::default(); all_count as usize];
        let answer = next(device, layer, &raw mut all_count, all.as_mut_ptr());
        if answer != vk::Result::SUCCESS {
            return answer;
        }
        let is_hidden = |extension: &vk::ExtensionProperties| {
            let name = extension.extension_name_as_c_str().unwrap_or_default().to_string_lossy();
            below().description.without_extensions.iter().any(|hidden| *hidden == name)
        };
        all.retain(|extension| !is_hidden(extension));
        if to.is_null() {
            *count = all.len() as u32;
            return vk::Result::SUCCESS;
        }
        let fit = all.len().min(*count as usize);
        ptr::copy_nonoverlapping(all.as_ptr(), to, fit);
        *count = fit as u32;
        if fit < all.len() { vk::Result::INCOMPLETE } else { vk::Result::SUCCESS }
    }
}

/// `VkLayerDeviceLink`: the next layer in the loader's chain for a device.
#[repr(C)]
struct DeviceLink {
    next: *mut DeviceLink,
    instance_proc: vk::PFN_vkGetInstanceProcAddr,
    device_proc: vk::PFN_vkGetDeviceProcAddr,
}

#[repr(C)]
struct DeviceLinkInfo {
    kind: vk::StructureType,
    next: *const c_void,
    function: i32,
    link: *mut DeviceLink,
}

/// Functions of the next layer for devices: the same ones for all devices of a driver.
struct DeviceBelow {
    device_proc: vk::PFN_vkGetDeviceProcAddr,
    submit: vk::PFN_vkQueueSubmit2,
    allocate: vk::PFN_vkAllocateMemory,
    map: vk::PFN_vkMapMemory,
    unmap: vk::PFN_vkUnmapMemory,
    shader: vk::PFN_vkCreateShaderModule,
    create_cache: vk::PFN_vkCreatePipelineCache,
    cache_data: vk::PFN_vkGetPipelineCacheData,
    query_results: vk::PFN_vkGetQueryPoolResults,
    /// Of devices with windows.
    acquire: Option<vk::PFN_vkAcquireNextImageKHR>,
}

static DEVICE_BELOW: OnceLock<DeviceBelow> = OnceLock::new();
/// Submissions, allocations and requests for pictures so far. The loader unloads the layer with the last instance.
static SUBMISSIONS: AtomicU64 = AtomicU64::new(0);
static LOST: AtomicBool = AtomicBool::new(false);
static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);
static ACQUIRED: AtomicU64 = AtomicU64::new(0);

fn device_below() -> &'static DeviceBelow {
    DEVICE_BELOW.get().expect("a device was made")
}

unsafe extern "system" fn create_device(
    physical: vk::PhysicalDevice,
    info: *const vk::DeviceCreateInfo<'_>,
    allocator: *const vk::AllocationCallbacks<'_>,
    made: *mut vk::Device,
) -> vk::Result {
    // SAFETY: the loader's chain holds the link of this layer, which must be advanced to the next layer's.
    unsafe {
        let mut at = (*info).p_next.cast::<DeviceLinkInfo>().cast_mut();
        while !at.is_null()
            && ((*at).kind != vk::StructureType::LOADER_DEVICE_CREATE_INFO || (*at).function != LINK_INFO)
        {
            at = (*at).next.cast::<DeviceLinkInfo>().cast_mut();
        }
        if at.is_null() {
            return vk::Result::ERROR_INITIALIZATION_FAILED;
        }
        let (instance_proc, device_proc) = ((*(*at).link).instance_proc, (*(*at).link).device_proc);
        (*at).link = (*(*at).link).next;
        let instance = vk::Handle::from_raw(INSTANCE.load(Ordering::Relaxed));
        let Some(create) = instance_proc(instance, c"vkCreateDevice".as_ptr()) else {
            return vk::Result::ERROR_INITIALIZATION_FAILED;
        };
        let create = std::mem::transmute::<unsafe extern "system" fn(), vk::PFN_vkCreateDevice>(create);
        let mut features = (*info).p_enabled_features.as_ref().copied().unwrap_or_default();
        let mut with_doubles = *info;
        if below().description.contracts {
            features.shader_float64 = vk::TRUE;
            with_doubles.p_enabled_features = &raw const features;
        }
        let answer = create(physical, &raw const with_doubles, allocator, made);
        if answer != vk::Result::SUCCESS {
            return answer;
        }
        /// Looks up a function of the next layer by name.
        macro_rules! next {
            ($name:literal, $kind:ty) => {
                match device_proc(*made, $name.as_ptr()) {
                    Some(found) => std::mem::transmute::<unsafe extern "system" fn(), $kind>(found),
                    None => return vk::Result::ERROR_INITIALIZATION_FAILED,
                }
            };
        }
        let _ = DEVICE_BELOW.set(DeviceBelow {
            device_proc,
            submit: next!(c"vkQueueSubmit2", vk::PFN_vkQueueSubmit2),
            allocate: next!(c"vkAllocateMemory", vk::PFN_vkAllocateMemory),
            map: next!(c"vkMapMemory", vk::PFN_vkMapMemory),
            unmap: next!(c"vkUnmapMemory", vk::PFN_vkUnmapMemory),
            shader: next!(c"vkCreateShaderModule", vk::PFN_vkCreateShaderModule),
            create_cache: next!(c"vkCreatePipelineCache", vk::PFN_vkCreatePipelineCache),
            cache_data: next!(c"vkGetPipelineCacheData", vk::PFN_vkGetPipelineCacheData),
            query_results: next!(c"vkGetQueryPoolResults", vk::PFN_vkGetQueryPoolResults),
            acquire: device_proc(*made, c"vkAcquireNextImageKHR".as_ptr())
                .map(|found| std::mem::transmute::<unsafe extern "system" fn(), vk::PFN_vkAcquireNextImageKHR>(found)),
        });
    }
    vk::Result::SUCCESS
}

unsafe extern "system" fn device_proc(device: vk::Device, name: *const c_char) -> vk::PFN_vkVoidFunction {
    // SAFETY: a string with a terminating 0.
    match unsafe { CStr::from_ptr(name) }.to_bytes() {
        b"vkGetDeviceProcAddr" => ours!(device_proc as vk::PFN_vkGetDeviceProcAddr),
        b"vkQueueSubmit2" => ours!(submit as vk::PFN_vkQueueSubmit2),
        b"vkAllocateMemory" => ours!(allocate as vk::PFN_vkAllocateMemory),
        b"vkCreateShaderModule" => ours!(shader as vk::PFN_vkCreateShaderModule),
        b"vkGetQueryPoolResults" => ours!(query_results as vk::PFN_vkGetQueryPoolResults),
        b"vkAcquireNextImageKHR" if device_below().acquire.is_some() => {
            ours!(acquire as vk::PFN_vkAcquireNextImageKHR)
        }
        b"vkCreatePipelineCache" => ours!(create_cache as vk::PFN_vkCreatePipelineCache),
        b"vkGetPipelineCacheData" => ours!(cache_data as vk::PFN_vkGetPipelineCacheData),
        // SAFETY: the function of the next layer.
        _ => unsafe { (device_below().device_proc)(device, name) },
    }
}

unsafe extern "system" fn submit(
    queue: vk::Queue,
    count: u32,
    infos: *const vk::SubmitInfo2<'_>,
    fence: vk::Fence,
) -> vk::Result {
    let number = SUBMISSIONS.fetch_add(1, Ordering::Relaxed) + 1;
    if let Some(lost) = below().description.lost_at_submission {
        if number == lost && Description::loses_its_first_device() {
            LOST.store(true, Ordering::Relaxed);
        }
        if LOST.load(Ordering::Relaxed) {
            return vk::Result::ERROR_DEVICE_LOST;
        }
    }
    // SAFETY: the caller's arguments.
    unsafe { (device_below().submit)(queue, count, infos, fence) }
}

unsafe extern "system" fn allocate(
    device: vk::Device,
    info: *const vk::MemoryAllocateInfo<'_>,
    allocator: *const vk::AllocationCallbacks<'_>,
    memory: *mut vk::DeviceMemory,
) -> vk::Result {
    let number = ALLOCATIONS.fetch_add(1, Ordering::Relaxed) + 1;
    if below().description.no_memory_from_allocation.is_some_and(|first| number >= first) {
        return vk::Result::ERROR_OUT_OF_DEVICE_MEMORY;
    }
    let next = device_below();
    // SAFETY: the caller's arguments. Nobody knows the new memory yet, so it is mapped here alone.
    unsafe {
        let answer = (next.allocate)(device, info, allocator, memory);
        if answer == vk::Result::SUCCESS && below().description.dirty_memory {
            let (size, mut at) = ((*info).allocation_size, ptr::null_mut());
            let flags = vk::MemoryMapFlags::empty();
            if (next.map)(device, *memory, 0, size, flags, &raw mut at) == vk::Result::SUCCESS {
                ptr::write_bytes(at.cast::<u8>(), 0xff, size as usize);
                (next.unmap)(device, *memory);
            }
        }
        answer
    }
}

unsafe extern "system" fn shader(
    device: vk::Device,
    info: *const vk::ShaderModuleCreateInfo<'_>,
    allocator: *const vk::AllocationCallbacks<'_>,
    module: *mut vk::ShaderModule,
) -> vk::Result {
    // SAFETY: the caller's info, with as many bytes of code as it says; the rewritten code outlives the call.
    unsafe {
        let words = std::slice::from_raw_parts((*info).p_code, (*info).code_size / 4);
        match below().description.rewritten(words) {
            Some(words) => {
                let other = vk::ShaderModuleCreateInfo { p_code: words.as_ptr(), code_size: 4 * words.len(), ..*info };
                (device_below().shader)(device, &raw const other, allocator, module)
            }
            None => (device_below().shader)(device, info, allocator, module),
        }
    }
}

/// Bytes of the header of a pipeline cache, behind which the content of a described one lies.
const CACHE_HEADER: usize = 32;
const CACHE_CONTENT: [u8; 1000] = [0xa5; 1000];

unsafe extern "system" fn create_cache(
    device: vk::Device,
    info: *const vk::PipelineCacheCreateInfo<'_>,
    allocator: *const vk::AllocationCallbacks<'_>,
    cache: *mut vk::PipelineCache,
) -> vk::Result {
    // SAFETY: the caller's info, with as many bytes as it says.
    unsafe {
        let mut info = *info;
        if below().description.keeps_pipelines && info.initial_data_size > 0 {
            let bytes = std::slice::from_raw_parts(info.p_initial_data.cast::<u8>(), info.initial_data_size);
            Description::note(bytes);
            // The driver below knows nothing of the content.
            info.initial_data_size = info.initial_data_size.min(CACHE_HEADER);
        }
        (device_below().create_cache)(device, &raw const info, allocator, cache)
    }
}

unsafe extern "system" fn cache_data(
    device: vk::Device,
    cache: vk::PipelineCache,
    size: *mut usize,
    to: *mut c_void,
) -> vk::Result {
    let next = device_below().cache_data;
    // SAFETY: callers ask for the size first, then for the data; the caller's room holds as many bytes as it says.
    unsafe {
        if !below().description.keeps_pipelines {
            return next(device, cache, size, to);
        }
        let whole = CACHE_HEADER + CACHE_CONTENT.len();
        if to.is_null() {
            *size = whole;
            return vk::Result::SUCCESS;
        }
        if *size < whole {
            return vk::Result::INCOMPLETE;
        }
        let mut header = CACHE_HEADER;
        let answer = next(device, cache, &raw mut header, to);
        ptr::copy_nonoverlapping(CACHE_CONTENT.as_ptr(), to.cast::<u8>().add(CACHE_HEADER), CACHE_CONTENT.len());
        *size = whole;
        answer
    }
}

unsafe extern "system" fn query_results(
    device: vk::Device,
    pool: vk::QueryPool,
    first: u32,
    count: u32,
    bytes: usize,
    to: *mut c_void,
    stride: vk::DeviceSize,
    flags: vk::QueryResultFlags,
) -> vk::Result {
    // SAFETY: the caller's arguments. Its results are timestamps, of 8 bytes as the flags say, each at its stride.
    unsafe {
        let answer = (device_below().query_results)(device, pool, first, count, bytes, to, stride, flags);
        if let (Some(factor), true) =
            (below().description.timestamp_factor, flags.contains(vk::QueryResultFlags::TYPE_64))
        {
            for query in 0..count as usize {
                let ticks = to.cast::<u8>().add(query * stride as usize).cast::<u64>();
                ticks.write_unaligned(ticks.read_unaligned().wrapping_mul(factor));
            }
        }
        answer
    }
}

unsafe extern "system" fn acquire(
    device: vk::Device,
    swapchain: vk::SwapchainKHR,
    timeout: u64,
    semaphore: vk::Semaphore,
    fence: vk::Fence,
    index: *mut u32,
) -> vk::Result {
    let number = ACQUIRED.fetch_add(1, Ordering::Relaxed);
    match (below().description.acquired(number), device_below().acquire) {
        (Some(fault), _) => fault,
        // SAFETY: the caller's arguments.
        (None, Some(next)) => unsafe { next(device, swapchain, timeout, semaphore, fence, index) },
        (None, None) => vk::Result::ERROR_EXTENSION_NOT_PRESENT,
    }
}
