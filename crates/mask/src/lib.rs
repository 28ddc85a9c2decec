//! Devices that one does not own, in tests: a Vulkan layer under which the device here offers no more than one that a file describes.
//!
//! The device still does the work, so what is drawn can be looked at. [`Description`] says what is lowered, [`Mask`] gives a program the
//! environment in which the loader finds the layer.
#![allow(unsafe_code, reason = "a layer is called by the loader, by pointers")]

mod description;
mod layer;

pub use description::{Description, Mask};
