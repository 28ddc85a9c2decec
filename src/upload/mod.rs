//! What the device holds of a prepared scene, one file per table or picture, and the descriptor sets in which all programs find it.
//!
//! It is written before the first frame; [`crate::pass`] reads it.

pub mod aims;
pub mod emitters;
pub mod environment;
pub mod rays;
pub mod scene;
pub mod shared;
pub mod sigma_grid;
pub mod spectrum;
pub mod table;
pub mod texture;
pub mod view;
