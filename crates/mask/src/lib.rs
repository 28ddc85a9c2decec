//! Emulation of less capable devices for tests: a Vulkan layer under which the machine's device reports only the
//! capabilities in a description file.
//!
//! The machine's device still executes all work, so pictures can be checked. [`Description`] lists the missing
//! capabilities. [`Mask`] gives a program the environment in which the loader finds the layer.
#![allow(unsafe_code, reason = "a layer is called by the loader, by pointers")]

mod arithmetic;
mod contraction;
mod description;
mod layer;
mod order;
mod rewrite;

pub use description::{Description, Mask};
