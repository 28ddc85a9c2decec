//! A thin Vulkan 1.3 layer: devices, memory, pipelines, descriptor sets, and frames whose pipeline barriers are
//! derived.
//!
//! Read the Vulkan specification, chapters Devices and Queues, Synchronization and Cache Control, Pipelines, Resource
//! Descriptors and Memory Allocation. The crate contains no renderer.
//!
//! This is the only crate that may use `unsafe`: every call into the driver is here, and each block states why it is
//! sound. Objects own a reference to their [`Device`] and destroy themselves. [`Frame::finish`] returns only when the
//! device has finished the frame, so nothing is destroyed while in use.
#![allow(unsafe_code, reason = "the one room that talks to the driver")]

mod access;
mod bind;
mod cache;
mod capabilities;
mod choice;
mod compiled;
mod device;
mod error;
mod float_controls;
mod frame;
mod kept_pipelines;
pub mod limits;
mod loops;
mod memory;
mod offers;
mod open;
mod pace;
mod pipeline;
#[cfg(feature = "window")]
mod present;
mod primitive_ids;
mod recording;
mod set;
mod shader;
mod specialize;
pub mod sync;
mod tables;
mod time_slices;
#[cfg(feature = "window")]
mod window;

pub use access::Access;
pub use bind::{Bindings, Resource, Sampled};
pub use cache::SamplerDesc;
pub use capabilities::Capabilities;
pub use choice::DeviceChoice;
pub use compiled::{Compiled, Footprint};
pub use device::{Candidate, Created, Device, DeviceInfo, Message, Severity, candidates, is_lost};
pub use error::{NotOpened, TooLarge};
pub use float_controls::with_float_controls;
pub use frame::{ColorTarget, DepthTarget, Draw, Frame, PassPlan, PassTime, Raster, VertexStream};
pub use kept_pipelines::keep_pipelines_in;
pub use loops::with_loops_counted;
pub use memory::{Buffer, Image, ImageDesc, NOTHING, Place};
pub use offers::Offers;
pub use pace::Interrupted;
#[cfg(feature = "window")]
pub use present::{Overlay, PlacedPicture, Presented, Presenter};
pub use primitive_ids::without_primitive_ids;
pub use recording::IndirectGroups;
pub use set::{BoundSet, DescriptorSet};
pub use shader::{
    Binding, BindingKind, Constant, Program, Replacement, SetLayout, SharedSet, Specialization, Stage, VertexInput,
};
pub use specialize::specialized;
pub use tables::with_tables_in_storage;
#[cfg(feature = "window")]
pub use window::Windowed;
