//! Uploads: the device's buffers and images of a prepared scene, one file per table, and the descriptor sets that bind
//! them.
//!
//! Read docs/frame.md. Uploads happen before the first frame; [`crate::pass`] reads them.

pub mod emitters;
pub mod environment;
pub mod path_guiding;
pub mod photon_map;
pub mod rays;
pub mod scene;
pub mod shared;
pub mod sigma_grid;
pub mod spectrum;
pub mod split_sum;
pub mod table;
pub mod texture;
pub mod view;
