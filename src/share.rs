//! What host and shaders both know: the structs and constants of `shaders/share/`, written by the build from the GLSL.

use bytemuck::{Pod, Zeroable};

include!(concat!(env!("OUT_DIR"), "/share.rs"));
