//! One file per pass, each with one public function that describes it to a [`crate::gpu::Frame`].
//!
//! A pass takes what it reads, writes what its name says, and contains no formula: those are in `shaders/lib/`.

pub mod accumulate;
pub mod aov;
pub mod background;
pub mod classify;
pub mod composite;
pub mod fragments;
pub mod gbuffer;
pub mod interact;
pub mod light;
pub mod lighting;
pub mod mirror;
pub mod part;
pub mod path;
pub mod rows;
pub mod screen;
pub mod shadow_map;
pub mod sum;
pub mod tiles;
pub mod tonemap;
pub mod trace_rays;
