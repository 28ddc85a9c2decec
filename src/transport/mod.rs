//! The host's part of light transport: BVH, light sampling tables, photons for path guiding and for the photon map, and
//! the rays of one picked pixel.
//!
//! Read pbrt (4th ed.), chapters 7 and 12 to 14. This module uses scenes and no Vulkan; [`crate::upload`] uploads its
//! results.

mod aabb;
pub mod bvh;
pub mod contact;
pub mod emitters;
pub mod events;
pub mod layers;
pub mod light_hierarchy;
mod line;
pub mod occluders;
mod octahedral;
pub mod photon_guiding;
pub mod photon_map;
mod ploc;
pub mod sight;
pub mod sky_directions;
pub mod surface_point;
