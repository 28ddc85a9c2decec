//! Render passes: one file per pass, each with one public function that records the pass into a [`crate::gpu::Frame`].
//!
//! Read docs/frame.md. A pass reads its arguments, writes what its name says, and contains no formula: formulas are in
//! `shaders/lib/`.

pub mod accumulate;
pub mod ambient;
pub mod aov;
pub mod background;
pub mod classify;
pub mod composite;
pub mod denoise;
pub mod fragments;
pub mod gbuffer;
pub mod interact;
pub mod light;
pub mod lighting;
pub mod mirror;
pub mod part;
pub mod path;
pub mod path_pairs;
pub mod path_states;
pub mod path_steps;
pub mod ray_trees;
pub mod rows;
pub mod screen;
pub mod shadow_map;
pub mod sum;
pub mod tiles;
pub mod tonemap;
pub mod trace_photons;
pub mod trace_rays;
