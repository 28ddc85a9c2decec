//! `#[repr(C)]` twins of `shaders/share/`. build.rs writes an assert for the size and for each offset.

#![allow(missing_docs, reason = "the fields are described in shaders/share/")]

use bytemuck::{Pod, Zeroable};

/// `shaders/share/camera.glsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct Camera {
    pub clip_from_rel: [[f32; 4]; 4],
    pub right: [f32; 3],
    pub near: f32,
    pub up: [f32; 3],
    pub far: f32,
    pub forward: [f32; 3],
    pub orthographic: u32,
    pub jitter: [f32; 2],
    pub size: [u32; 2],
}

/// `shaders/share/scene.glsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct Instance {
    pub rel_from_object: [[f32; 3]; 4],
    pub normal_from_object: [[f32; 3]; 3],
    pub handedness: f32,
    pub material: u32,
    pub scale: f32,
    pub flags: u32,
    pub first_triangle: u32,
}

impl Instance {
    /// Transmits light and is no closed solid: read as a thin sheet.
    pub const SHEET: u32 = 1;
}

/// `shaders/share/scene.glsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct Material {
    pub base_color: [f32; 4],
    pub emissive: [f32; 3],
    pub metallic: f32,
    pub f0: [f32; 3],
    pub roughness: f32,
    pub sigma_thickness: [f32; 3],
    pub f90: f32,
    pub ior: f32,
    pub occlusion_strength: f32,
    pub normal_scale: f32,
    pub alpha_cutoff: f32,
    pub transmission: f32,
    pub clearcoat: f32,
    pub clearcoat_roughness: f32,
    pub flags: u32,
    pub sigma: [f32; 3],
    pub medium: u32,
    pub n_metal: [f32; 3],
    pub thickness: f32,
    pub kappa_metal: [f32; 3],
    pub grid: u32,
}

impl Material {
    /// Shown as it is.
    pub const UNLIT: u32 = 1;
    /// Alpha is coverage.
    pub const BLENDED: u32 = 2;
    /// `n_metal` and `kappa_metal` tell its reflectance.
    pub const CONDUCTOR: u32 = 4;
    /// Reflects anything at all at its surface.
    pub const MIRRORS: u32 = 8;
    /// In a band of wavelengths, `base_color` is red, green and blue all the same.
    pub const BASE_RGB: u32 = 16;
    /// In a band of wavelengths, what varies over its surface is red, green and blue, and `base_color` a number.
    pub const VARIES_RGB: u32 = 64;
    /// In a band of wavelengths, `emissive` is red, green and blue all the same.
    pub const EMISSIVE_RGB: u32 = 32;
}

/// `shaders/share/environment.glsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct EnvironmentTerms {
    pub irradiance: [[f32; 3]; 9],
    pub cos_rotation: f32,
    pub sin_rotation: f32,
    pub intensity: f32,
    pub width: f32,
    pub levels: f32,
}

/// `shaders/share/aov.glsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct AovPixel {
    pub p_rel: [f32; 3],
    pub normal: [f32; 3],
    pub geometric_normal: [f32; 3],
    pub albedo: [f32; 3],
    pub distance: f32,
    pub roughness: f32,
    pub metallic: f32,
    pub emissive: [f32; 3],
    pub material: u32,
    pub instance: u32,
}

/// `shaders/share/trace.glsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct TraceTerms {
    pub bvh_from_rel: [f32; 3],
    pub offset: f32,
    pub grid_middle: [f32; 3],
    pub nodes: u32,
    pub grid_unit: [f32; 3],
    pub seed: u32,
    pub camera_media: [u32; 4],
    pub pixel_angle: f32,
    pub lod_bias: f32,
    pub sample_index: u32,
    pub interfaces: u32,
}

/// `shaders/share/work.glsl`. Sums are pairs of words, the low one first.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct WorkCounts {
    pub reflection: [u32; 2],
    pub refraction: [u32; 2],
    pub shadow: [u32; 2],
    pub node_visits: [u32; 2],
    pub triangle_tests: [u32; 2],
    pub stray_interfaces: [u32; 2],
    pub lights_cut_off: [u32; 2],
    pub lost: [u32; 2],
    pub most_lost: u32,
    pub indirect: [u32; 2],
    pub not_finite: u32,
    pub not_finite_event: u32,
    pub not_finite_pixel: u32,
    pub not_finite_material: u32,
}
