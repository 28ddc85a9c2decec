//! The programs under `shaders/pass/`, as build.rs describes them: one module each with `PROGRAM`, `Bind`, `Constants`.

use ash::vk;

use crate::gpu::{
    Access, Binding, BindingKind, Bindings, Buffer, Image, Program, Resource, Sampled, Stage, VertexInput,
};

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
