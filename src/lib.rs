//! # Etalon: an explicit Vulkan renderer
//!
//! glTF (and OBJ/MTL) in, radiance out: raster G-buffer → deferred lighting → tone map, written directly against `ash`.

pub mod cli;
pub mod frame;
pub mod gpu;
pub mod image;
pub mod pass;
pub mod plan;
pub mod scene;
pub mod shader;
pub mod share;
pub mod study;
