//! Structs and constants shared by host and shaders: the build generates them from the GLSL in `shaders/share/`.
//!
//! Read the Vulkan specification, section Shader Interfaces (scalar block layout).

use bytemuck::{Pod, Zeroable};

include!(concat!(env!("OUT_DIR"), "/share.rs"));

// A constant that scenes and shaders share.
const _: () = assert!(LEAST_SHEEN_ROUGHNESS == crate::scene::lobe::sheen::LEAST_ROUGHNESS);
