//! What programs may ask of a device. The build refuses a program that asks for more, and a device with less is not used.

/// Descriptors that a pass pushes: no device has to take more than 32.
pub const PUSH_DESCRIPTORS: u32 = 12;
/// Storage images and storage texel buffers that one stage of a pass sees.
pub const STORAGE_IMAGES: u32 = 16;
/// Storage buffers.
pub const STORAGE_BUFFERS: u32 = 16;
/// Storage buffers where tables are such (`tables.rs`).
pub const STORAGE_BUFFERS_AND_TABLES: u32 = 24;
/// Colour targets of a raster pass.
pub const COLOR_TARGETS: u32 = 7;
/// Texels that a buffer must hold for tables to be fetched from it: a picture's depths, the textures of a small scene.
pub const LEAST_TEXELS: u32 = 1 << 22;
/// Uniform buffers: lavapipe 22.3 inlines uniforms that conditions depend on, and writes past its table of them where such a buffer is
/// the fourth or a later one of a stage: it crashes while it makes the pipeline (docs/decisions/lavapipe.md).
pub const UNIFORM_BUFFERS: u32 = 3;
