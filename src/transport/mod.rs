//! Light transport on the host: what rays go through, what paths aim at, and what is met at one picked pixel.
//!
//! It knows scenes and no Vulkan. The passes upload what is made here.

mod aabb;
pub mod bvh;
pub mod caustics;
pub mod contact;
pub mod emitters;
pub mod events;
pub mod layers;
mod line;
mod ploc;
pub mod sight;
