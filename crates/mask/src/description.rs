//! Description of a less capable device, and the environment in which a program sees it.

use std::collections::BTreeMap;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use ash::vk;
use serde::Deserialize;

use crate::arithmetic::Inexact;
use crate::contraction::contracted;
use crate::order::reversed;

/// Environment variable with the path of the description file.
pub(crate) const VARIABLE: &str = "ETALON_MASK";

/// Capabilities that the described device lacks, compared with the device of the machine. Names are those of Vulkan.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Description {
    /// Name of the device, and the reason for its description.
    pub name: String,
    /// Device type: `cpu`, `discrete` or `integrated`.
    #[serde(rename = "type")]
    pub kind: Option<String>,
    /// Vulkan version.
    pub api: Option<[u32; 2]>,
    /// Features that it lacks.
    pub without_features: Vec<String>,
    /// Extensions that it lacks.
    pub without_extensions: Vec<String>,
    /// Limits that are lower.
    pub limits: BTreeMap<String, u64>,
    /// Formats that it lacks, by use.
    pub without_formats: BTreeMap<String, Vec<String>>,
    /// Memory properties that none of its memory types has.
    pub without_memory: Vec<String>,
    /// No arithmetic operations in subgroups.
    pub without_subgroup_arithmetic: bool,
    /// No timestamps in queues.
    pub without_timestamps: bool,
    /// Number of the submission, from 1, with which the device is lost, and every later one on it. Only the first
    /// device is lost: the file `NAME.lost` beside the description says that it was.
    pub lost_at_submission: Option<u64>,
    /// Number of the memory allocation, from 1, from which on all fail for want of device memory.
    pub no_memory_from_allocation: Option<u64>,
    /// New memory is full of ones: NaN as floats, the largest numbers as integers. For devices whose memory the host
    /// sees.
    pub dirty_memory: bool,
    /// Factor of all timestamps: 0 for a clock that stands still, or much for one that runs too fast.
    pub timestamp_factor: Option<u64>,
    /// What asking for a window's next picture comes to, in turns. Each fault is noted in the file `NAME.noted` beside
    /// the description.
    pub(crate) acquire: Vec<Acquired>,
    /// Pipeline caches have content: 1,000 bytes behind the header. What a cache begins with is noted in `NAME.noted`.
    pub keeps_pipelines: bool,
    /// Errors of arithmetic operations.
    pub(crate) inexact: Inexact,
    /// Products are fused with the sums that they are in, as the specification allows (`contraction.rs`).
    pub contracts: bool,
    /// Workgroups run in the reverse order.
    pub reverses: bool,
    /// Words in the program's expected refusal. Empty: the program is expected to render.
    pub refused: Vec<String>,
}

/// What comes of asking for a window's next picture.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
pub(crate) enum Acquired {
    Picture,
    NotReady,
    Timeout,
    OutOfDate,
    SurfaceLost,
}

/// What is read of a passport.
#[derive(Deserialize)]
struct MailedPassport {
    device: MailedDevice,
    capabilities: MailedCapabilities,
}

#[derive(Deserialize)]
struct MailedDevice {
    name: String,
    #[serde(rename = "type")]
    kind: String,
}

#[derive(Deserialize)]
struct MailedCapabilities {
    features: BTreeMap<String, bool>,
    extensions: BTreeMap<String, bool>,
    limits: BTreeMap<String, u64>,
    formats: BTreeMap<String, Vec<String>>,
    memory: Vec<Vec<String>>,
    subgroup_arithmetic: bool,
    timestamps: bool,
}

/// Uses of formats and properties of memory that can be lowered.
const USES: [&str; 3] = ["COLOR_ATTACHMENT", "STORAGE_IMAGE", "SAMPLED_IMAGE_FILTER_LINEAR"];
const MEMORY: [&str; 2] = ["HOST_CACHED", "DEVICE_LOCAL"];

impl From<MailedPassport> for Description {
    fn from(MailedPassport { device, capabilities: of }: MailedPassport) -> Self {
        let absent = |has: BTreeMap<String, bool>| has.into_iter().filter(|(_, has)| !has).map(|(name, _)| name);
        let lacks = |uses: &[String]| -> Vec<String> {
            USES.into_iter().filter(|wanted| uses.iter().all(|has| has != wanted)).map(str::to_owned).collect()
        };
        let is_nowhere = |wanted: &&str| of.memory.iter().flatten().all(|has| has != wanted);
        Self {
            name: device.name,
            kind: Some(device.kind),
            api: None,
            without_features: absent(of.features).collect(),
            without_extensions: absent(of.extensions).collect(),
            limits: of.limits,
            without_formats: of.formats.iter().map(|(format, uses)| (format.clone(), lacks(uses))).collect(),
            without_memory: MEMORY.into_iter().filter(is_nowhere).map(str::to_owned).collect(),
            without_subgroup_arithmetic: !of.subgroup_arithmetic,
            without_timestamps: !of.timestamps,
            dirty_memory: false,
            inexact: Inexact::default(),
            contracts: false,
            reverses: false,
            lost_at_submission: None,
            no_memory_from_allocation: None,
            timestamp_factor: None,
            acquire: Vec::new(),
            keeps_pipelines: false,
            refused: Vec::new(),
        }
    }
}

/// Sets the listed features of one struct to `false`.
macro_rules! without {
    ($listed:expr, $features:expr, $($field:ident = $name:literal),+ $(,)?) => {
        for name in $listed {
            match name.as_str() {
                $($name => $features.$field = vk::FALSE,)+
                _ => {}
            }
        }
    };
}

/// Lowers the listed limits of one struct.
macro_rules! lowered {
    ($listed:expr, $limits:expr, $($field:ident = $name:literal),+ $(,)?) => {
        for (name, &most) in $listed {
            match name.as_str() {
                $($name => $limits.$field = $limits.$field.min(most as _),)+
                _ => {}
            }
        }
    };
}

impl Description {
    /// Whether no device was lost by the description that the environment variable names; from now on one was.
    pub(crate) fn loses_its_first_device() -> bool {
        let Some(path) = std::env::var_os(VARIABLE).map(PathBuf::from) else { return false };
        std::fs::File::create_new(path.with_extension("lost")).is_ok()
    }

    /// The SPIR-V that the driver gets; `None` for the given one.
    #[must_use]
    pub fn rewritten(&self, words: &[u32]) -> Option<Vec<u32>> {
        let inexact = self.inexact.rewritten(words);
        let contracted = self.contracts.then(|| contracted(inexact.as_deref().unwrap_or(words))).flatten().or(inexact);
        let reversed = self.reverses.then(|| reversed(contracted.as_deref().unwrap_or(words))).flatten();
        reversed.or(contracted)
    }

    /// What the nth request for a window's picture comes to, in place of the picture.
    pub(crate) fn acquired(&self, number: u64) -> Option<vk::Result> {
        let turn = number.checked_rem(self.acquire.len() as u64)?;
        let fault = match self.acquire[turn as usize] {
            Acquired::Picture => return None,
            Acquired::NotReady => vk::Result::NOT_READY,
            Acquired::Timeout => vk::Result::TIMEOUT,
            Acquired::OutOfDate => vk::Result::ERROR_OUT_OF_DATE_KHR,
            Acquired::SurfaceLost => vk::Result::ERROR_SURFACE_LOST_KHR,
        };
        Self::note(format!("{fault:?}\n").as_bytes());
        Some(fault)
    }

    /// Appends to the file of notes.
    pub(crate) fn note(bytes: &[u8]) {
        let Some(path) = std::env::var_os(VARIABLE).map(PathBuf::from) else { return };
        let noted = std::fs::OpenOptions::new().create(true).append(true).open(path.with_extension("noted"));
        if let Err(error) = noted.and_then(|mut file| file.write_all(bytes)) {
            eprintln!("the mask: {error}");
        }
    }

    /// Reads the file that the environment variable names.
    pub(crate) fn from_environment() -> io::Result<Self> {
        let path = std::env::var_os(VARIABLE).ok_or_else(|| io::Error::other(format!("{VARIABLE} is not set")))?;
        Self::read(Path::new(&path))
    }

    /// Reads a description file, or a passport (`etalon passport`), whose capabilities it takes.
    ///
    /// # Errors
    /// The file is missing or invalid.
    pub fn read(path: &Path) -> io::Result<Self> {
        let text = std::fs::read_to_string(path)?;
        let read = || -> serde_json::Result<Self> {
            let whole: serde_json::Value = serde_json::from_str(&text)?;
            let is_passport = whole["schema"].as_str().is_some_and(|schema| schema.starts_with("etalon.passport/"));
            if is_passport { MailedPassport::deserialize(whole).map(Self::from) } else { serde_json::from_str(&text) }
        };
        read().map_err(|error| io::Error::other(format!("{}: {error}", path.display())))
    }

    pub(crate) fn lower_features(&self, features: &mut vk::PhysicalDeviceFeatures) {
        without!(
            &self.without_features,
            features,
            geometry_shader = "geometryShader",
            fragment_stores_and_atomics = "fragmentStoresAndAtomics",
            shader_storage_image_extended_formats = "shaderStorageImageExtendedFormats",
            full_draw_index_uint32 = "fullDrawIndexUint32",
            robust_buffer_access = "robustBufferAccess",
        );
    }

    pub(crate) fn lower_features_1_2(&self, features: &mut vk::PhysicalDeviceVulkan12Features<'_>) {
        without!(
            &self.without_features,
            features,
            timeline_semaphore = "timelineSemaphore",
            scalar_block_layout = "scalarBlockLayout",
        );
    }

    pub(crate) fn lower_features_1_3(&self, features: &mut vk::PhysicalDeviceVulkan13Features<'_>) {
        without!(
            &self.without_features,
            features,
            dynamic_rendering = "dynamicRendering",
            synchronization2 = "synchronization2",
            maintenance4 = "maintenance4",
        );
    }

    pub(crate) fn lower_properties(&self, properties: &mut vk::PhysicalDeviceProperties) {
        properties.device_type = match self.kind.as_deref() {
            Some("discrete") => vk::PhysicalDeviceType::DISCRETE_GPU,
            Some("integrated") => vk::PhysicalDeviceType::INTEGRATED_GPU,
            Some("cpu") => vk::PhysicalDeviceType::CPU,
            _ => properties.device_type,
        };
        if let Some([major, minor]) = self.api {
            properties.api_version = vk::make_api_version(0, major, minor, 0);
        }
        lowered!(
            &self.limits,
            properties.limits,
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
        );
        if self.without_timestamps {
            properties.limits.timestamp_compute_and_graphics = vk::FALSE;
        }
    }

    pub(crate) fn lower_push_descriptors(&self, properties: &mut vk::PhysicalDevicePushDescriptorPropertiesKHR<'_>) {
        lowered!(&self.limits, properties, max_push_descriptors = "maxPushDescriptors");
    }

    pub(crate) fn lower_properties_1_3(&self, properties: &mut vk::PhysicalDeviceVulkan13Properties<'_>) {
        lowered!(&self.limits, properties, max_buffer_size = "maxBufferSize");
    }

    pub(crate) fn lower_subgroups(&self, properties: &mut vk::PhysicalDeviceVulkan11Properties<'_>) {
        if self.without_subgroup_arithmetic {
            properties.subgroup_supported_operations &= !vk::SubgroupFeatureFlags::ARITHMETIC;
        }
    }

    pub(crate) fn lower_format(&self, format: vk::Format, properties: &mut vk::FormatProperties) {
        for lacks in self.without_formats.get(&format!("{format:?}")).into_iter().flatten() {
            properties.optimal_tiling_features &= !match lacks.as_str() {
                "COLOR_ATTACHMENT" => vk::FormatFeatureFlags::COLOR_ATTACHMENT,
                "STORAGE_IMAGE" => vk::FormatFeatureFlags::STORAGE_IMAGE,
                "SAMPLED_IMAGE_FILTER_LINEAR" => vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR,
                _ => vk::FormatFeatureFlags::empty(),
            };
        }
    }

    pub(crate) fn lower_memory(&self, memory: &mut vk::PhysicalDeviceMemoryProperties) {
        for kind in &mut memory.memory_types {
            for lacks in &self.without_memory {
                kind.property_flags &= !match lacks.as_str() {
                    "HOST_CACHED" => vk::MemoryPropertyFlags::HOST_CACHED,
                    "DEVICE_LOCAL" => vk::MemoryPropertyFlags::DEVICE_LOCAL,
                    _ => vk::MemoryPropertyFlags::empty(),
                };
            }
        }
    }
}

/// A folder with the layer's manifest, for programs that tests start.
pub struct Mask {
    folder: PathBuf,
}

impl Mask {
    /// Writes the layer's manifest to a folder. The layer's library must lie beside the test executable.
    ///
    /// # Errors
    /// The folder cannot be written, or the library is missing.
    pub fn in_folder(folder: &Path) -> io::Result<Self> {
        let beside = std::env::current_exe()?;
        let name = format!("{}etalon_mask{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
        let library = beside.with_file_name(name);
        if !library.is_file() {
            return Err(io::Error::other(format!("{} is not there", library.display())));
        }
        let manifest = serde_json::json!({
            "file_format_version": "1.2.0",
            "layer": {
                "name": "VK_LAYER_ETALON_mask",
                "type": "GLOBAL",
                "library_path": library,
                "api_version": "1.3.0",
                "implementation_version": "1",
                "description": "The device offers no more than a file describes",
            },
        });
        std::fs::write(folder.join("etalon_mask.json"), manifest.to_string())?;
        Ok(Self { folder: folder.to_owned() })
    }

    /// Environment variables under which a program sees the described device.
    #[must_use]
    pub fn variables(&self, description: &Path) -> [(&'static str, String); 3] {
        [
            ("VK_ADD_LAYER_PATH", self.folder.display().to_string()),
            ("VK_INSTANCE_LAYERS", "VK_LAYER_ETALON_mask".to_owned()),
            (VARIABLE, description.display().to_string()),
        ]
    }
}
