//! Reflection data of the shaders, as the build generates it: programs, bindings, specialization constants, vertex
//! inputs.
//!
//! Read the Vulkan specification, chapters Shaders and Resource Descriptors, and shaders/README.md. `crates/reflect`
//! reads the data out of the SPIR-V.

use ash::vk;

use super::access::Access;
use super::specialize::specialized;

/// One program: a compute shader, or a vertex shader with its fragment shader.
#[derive(Debug)]
pub struct Program {
    /// Stem of the files under `shaders/pass/`.
    pub name: &'static str,
    /// Optimised SPIR-V per stage.
    pub stages: &'static [Stage],
    /// Bindings of set 0, pushed or written with each use of the program, in slot order.
    pub bindings: &'static [Binding],
    /// The shared sets 1 and 2 with the bindings that the program reads.
    pub sets: &'static [SharedSet],
    /// Vertex attributes, each its own tightly packed stream of f32.
    pub inputs: &'static [VertexInput],
    /// Specialization constants in the order of their ids.
    pub constants: &'static [Constant],
    /// Size of the push constants in bytes.
    pub push_bytes: u32,
    /// Workgroup size of a compute shader.
    pub local_size: [u32; 3],
}

/// A specialization constant.
#[derive(Debug, Clone, Copy)]
pub struct Constant {
    /// The constant's id (`constant_id`).
    pub id: u32,
    /// The constant's name, in lower case.
    pub name: &'static str,
    /// Whether the 32-bit word is a float.
    pub float: bool,
}

/// A program or layout is equal to itself alone: another crate may have one of the same name.
macro_rules! equal_by_address {
    ($Type:ty) => {
        impl PartialEq for $Type {
            fn eq(&self, other: &Self) -> bool {
                std::ptr::eq(self, other)
            }
        }

        impl Eq for $Type {}

        impl std::hash::Hash for $Type {
            fn hash<H: std::hash::Hasher>(&self, state: &mut H) {
                std::ptr::hash(self, state);
            }
        }
    };
}

equal_by_address!(Program);
equal_by_address!(SetLayout);

impl Program {
    /// Bytes of SPIR-V that the driver receives for these specialization constants.
    #[must_use]
    pub fn spirv_bytes(&self, constants: &[(u32, u32)]) -> usize {
        self.stages.iter().map(|stage| specialized(stage.words, constants).len() * 4).sum()
    }
}

/// The layout of a shared descriptor set; it is the same for every program, whatever bindings the program reads.
#[derive(Debug)]
pub struct SetLayout {
    /// Name in the shaders: `scene`, `pages`, `paths`.
    pub name: &'static str,
    /// All bindings of the set, in slot order, with the stages of all programs.
    pub bindings: &'static [Binding],
}

/// The part of a shared descriptor set that a program reads.
#[derive(Debug)]
pub struct SharedSet {
    /// The layout of the whole set.
    pub layout: &'static SetLayout,
    /// The bindings that the program reads.
    pub used: &'static [Binding],
}

/// A generated struct of specialization constants.
pub trait Specialization {
    /// (id, 32-bit value) pairs for the pipeline.
    fn words(&self) -> Vec<(u32, u32)>;
}

/// The code of one shader stage.
#[derive(Debug)]
pub struct Stage {
    /// The shader stage.
    pub flag: vk::ShaderStageFlags,
    /// SPIR-V 1.6.
    pub words: &'static [u32],
}

/// One binding, with the access that its GLSL qualifiers declare.
#[derive(Debug)]
pub struct Binding {
    /// Name in the GLSL.
    pub name: &'static str,
    /// Binding number.
    pub slot: u32,
    /// Kind of descriptor.
    pub kind: BindingKind,
    /// The shader's access to the resource.
    pub access: Access,
    /// Stages that declare the binding.
    pub stages: vk::ShaderStageFlags,
}

/// Kinds of descriptors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BindingKind {
    /// `uniform` block.
    UniformBuffer,
    /// `buffer` block.
    StorageBuffer,
    /// `sampler2D` and its kin.
    SampledImage,
    /// `image2D` and its kin.
    StorageImage,
    /// `imageBuffer`: the fastest fetch on lavapipe.
    StorageTexelBuffer,
}

impl BindingKind {
    /// Vulkan's descriptor type; lookup tables are storage texel buffers or, without `texel_buffers`, storage buffers.
    #[must_use]
    pub fn descriptor_type(self, texel_buffers: bool) -> vk::DescriptorType {
        match self {
            Self::UniformBuffer => vk::DescriptorType::UNIFORM_BUFFER,
            Self::StorageBuffer => vk::DescriptorType::STORAGE_BUFFER,
            Self::SampledImage => vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
            Self::StorageImage => vk::DescriptorType::STORAGE_IMAGE,
            Self::StorageTexelBuffer if texel_buffers => vk::DescriptorType::STORAGE_TEXEL_BUFFER,
            Self::StorageTexelBuffer => vk::DescriptorType::STORAGE_BUFFER,
        }
    }
}

/// One vertex attribute.
#[derive(Debug)]
pub struct VertexInput {
    /// Name in the GLSL.
    pub name: &'static str,
    /// Location, also the stream's index.
    pub location: u32,
    /// 1 to 4 components of f32.
    pub components: u32,
}

/// Replacement code for one stage of a program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Replacement {
    /// Name of the program.
    pub program: &'static str,
    /// Index into [`Program::stages`].
    pub stage: usize,
    /// SPIR-V with the same interface.
    pub words: Vec<u32>,
}
