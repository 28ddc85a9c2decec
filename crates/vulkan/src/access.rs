//! Kinds of access to a resource, and the one table that maps them to pipeline stages, access masks and image layouts.
//!
//! Read the Vulkan specification, chapter Synchronization and Cache Control (`VkPipelineStageFlagBits2`,
//! `VkAccessFlagBits2`) and chapter Resource Creation, section Image Layouts.

use ash::vk;

/// A pass's kind of access to a buffer or an image. The barriers of a frame take their masks from here alone.
///
/// Two files write barriers with masks of their own, because theirs lie outside a frame. `time_slices.rs` submits the
/// parts of a pass one by one, and lets each wait for all before it, as repeated dispatches do. `present.rs` draws
/// into swapchain images, which are no resources of a frame and end in the layout for showing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Access {
    /// Colour attachment, written (and cleared or blended over).
    ColorTarget,
    /// Depth attachment, tested and written.
    DepthTarget,
    /// Depth attachment, tested but not written; may be sampled in the same pass.
    DepthRead,
    /// Read through a sampler.
    Sampled,
    /// Uniform buffer.
    UniformRead,
    /// `readonly` storage buffer, storage image or texel buffer.
    StorageRead,
    /// `writeonly` storage buffer, image or texel buffer.
    StorageWrite,
    /// Storage buffer, image or texel buffer, both read and written.
    StorageReadWrite,
    /// Vertex attributes.
    VertexRead,
    /// Index buffer.
    IndexRead,
    /// Arguments of an indirect dispatch.
    IndirectRead,
    /// Source of a copy.
    TransferSrc,
    /// Destination of a copy or clear.
    TransferDst,
    /// Read by the host after the frame has finished.
    HostRead,
}

/// Vulkan's masks for an [`Access`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Masks {
    /// Stages that perform the access.
    pub stages: vk::PipelineStageFlags2,
    /// Kinds of memory access.
    pub access: vk::AccessFlags2,
    /// Required image layout.
    pub layout: vk::ImageLayout,
    /// Whether the access writes.
    pub writes: bool,
}

impl Access {
    /// The masks of the access. `shaders` are the shader stages of the binding, for accesses of shaders.
    #[must_use]
    pub fn masks(self, shaders: vk::ShaderStageFlags) -> Masks {
        use vk::{AccessFlags2 as A, ImageLayout as L, PipelineStageFlags2 as S};
        let mut shader = S::NONE;
        for (flag, stage) in [
            (vk::ShaderStageFlags::VERTEX, S::VERTEX_SHADER),
            (vk::ShaderStageFlags::FRAGMENT, S::FRAGMENT_SHADER),
            (vk::ShaderStageFlags::COMPUTE, S::COMPUTE_SHADER),
        ] {
            if shaders.contains(flag) {
                shader |= stage;
            }
        }
        let depth = S::EARLY_FRAGMENT_TESTS | S::LATE_FRAGMENT_TESTS;
        let (stages, access, layout, writes) = match self {
            Self::ColorTarget => (
                S::COLOR_ATTACHMENT_OUTPUT,
                A::COLOR_ATTACHMENT_READ | A::COLOR_ATTACHMENT_WRITE,
                L::COLOR_ATTACHMENT_OPTIMAL,
                true,
            ),
            Self::DepthTarget => (
                depth,
                A::DEPTH_STENCIL_ATTACHMENT_READ | A::DEPTH_STENCIL_ATTACHMENT_WRITE,
                L::DEPTH_ATTACHMENT_OPTIMAL,
                true,
            ),
            Self::DepthRead => (depth, A::DEPTH_STENCIL_ATTACHMENT_READ, L::DEPTH_READ_ONLY_OPTIMAL, false),
            Self::Sampled => (shader, A::SHADER_SAMPLED_READ, L::SHADER_READ_ONLY_OPTIMAL, false),
            Self::UniformRead => (shader, A::UNIFORM_READ, L::GENERAL, false),
            Self::StorageRead => (shader, A::SHADER_STORAGE_READ, L::GENERAL, false),
            Self::StorageWrite => (shader, A::SHADER_STORAGE_WRITE, L::GENERAL, true),
            Self::StorageReadWrite => (shader, A::SHADER_STORAGE_READ | A::SHADER_STORAGE_WRITE, L::GENERAL, true),
            Self::VertexRead => (S::VERTEX_ATTRIBUTE_INPUT, A::VERTEX_ATTRIBUTE_READ, L::UNDEFINED, false),
            Self::IndexRead => (S::INDEX_INPUT, A::INDEX_READ, L::UNDEFINED, false),
            Self::IndirectRead => (S::DRAW_INDIRECT, A::INDIRECT_COMMAND_READ, L::UNDEFINED, false),
            Self::TransferSrc => (S::ALL_TRANSFER, A::TRANSFER_READ, L::TRANSFER_SRC_OPTIMAL, false),
            Self::TransferDst => (S::ALL_TRANSFER, A::TRANSFER_WRITE, L::TRANSFER_DST_OPTIMAL, true),
            Self::HostRead => (S::HOST, A::HOST_READ, L::GENERAL, false),
        };
        Masks { stages, access, layout, writes }
    }
}
