//! What host and shaders both know: the structs and constants of `shaders/share/`, written by the build from the GLSL.

use bytemuck::{Pod, Zeroable};

include!(concat!(env!("OUT_DIR"), "/share.rs"));

// What scenes know of shaders too.
const _: () = assert!(LEAST_SHEEN_ROUGHNESS == crate::scene::lobe::sheen::LEAST_ROUGHNESS);
