//! Limits that shaders rely on: the build refuses a program that exceeds one, and a device below one is not used.
//!
//! Read the Vulkan specification, chapter Limits.

/// Push descriptors of a pass (`maxPushDescriptors`); every device with the extension allows 32 or more.
pub const PUSH_DESCRIPTORS: u32 = 16;
/// Storage images and storage texel buffers in one shader stage.
pub const STORAGE_IMAGES: u32 = 16;
/// Sampled images with samplers in one shader stage: the textures of a material and the tables of the G-buffer.
pub const SAMPLED_IMAGES: u32 = 20;
/// Storage buffers in one shader stage.
pub const STORAGE_BUFFERS: u32 = 16;
/// Storage buffers in one shader stage where lookup tables are storage buffers (`tables.rs`). Vulkan's Roadmap 2022
/// profile has 30.
pub const STORAGE_BUFFERS_AND_TABLES: u32 = 28;
/// Colour attachments of a raster pass.
pub const COLOR_TARGETS: u32 = 8;
/// Texels that a texel buffer must hold for lookup tables to be texel buffers: a picture's depths, textures of a small
/// scene.
pub const LEAST_TEXELS: u32 = 1 << 22;
/// Uniform buffers in one shader stage. lavapipe 22.3 inlines uniforms that conditions depend on, and writes past its
/// table of them for the fourth uniform buffer of a stage or a later one: it crashes while it creates the pipeline
/// (docs/decisions/lavapipe.md).
pub const UNIFORM_BUFFERS: u32 = 3;
