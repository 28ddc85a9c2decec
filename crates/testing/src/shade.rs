//! Reference direct lighting in f64, in textbook form, for comparison with the lighting passes.
//!
//! Read glTF 2.0 appendix B; Walter et al. 2007; Heitz 2014; KHR_lights_punctual. It is written from these formulas and
//! not from the shaders: D, the masking-shadowing term and the spot's falloff have another form.

use std::f64::consts::PI;

use etalon::scene::{Light, LightKind, Scene};
use etalon::share::AovPixel;
use etalon::upload::view::View;
use glam::DVec3;

/// A surface point with its material.
pub struct Point {
    /// Position in metres.
    pub position: DVec3,
    /// Shading normal.
    pub n: DVec3,
    /// Unit direction to the eye.
    pub v: DVec3,
    /// Base colour.
    pub albedo: DVec3,
    /// Metallic, 0 to 1.
    pub metallic: f64,
    /// Perceptual roughness, 0 to 1.
    pub roughness: f64,
    /// Index of refraction.
    pub ior: f64,
    /// Strength of the dielectric specular reflection.
    pub specular: f64,
}

/// Irradiance perpendicular to the direction to the light, and that direction.
pub fn incident(light: &Light, position: DVec3) -> (DVec3, DVec3) {
    let color = DVec3::from(light.color.map(f64::from));
    let from = |place: DVec3, range: Option<f64>| {
        let d = place - position;
        let r = d.length();
        let window = range.map_or(1.0, |range| (1.0 - (r / range).powi(4)).clamp(0.0, 1.0));
        (d / r, window / (r * r))
    };
    match light.kind {
        LightKind::Directional { direction } => (-direction.normalize(), color),
        LightKind::Point { position: place, range } => {
            let (l, e) = from(place, range);
            (l, color * e)
        }
        LightKind::Spot { position: place, direction, range, inner, outer } => {
            let (l, e) = from(place, range);
            let cos = direction.normalize().dot(-l);
            let ramp = ((cos - outer.cos()) / (inner.cos() - outer.cos())).clamp(0.0, 1.0);
            (l, color * e * ramp * ramp)
        }
    }
}

/// BRDF of glTF's metallic-roughness model times cosθ: Lambert under a Fresnel-weighted layer, plus GGX.
pub fn reflected(p: &Point, l: DVec3) -> DVec3 {
    let (n_l, n_v) = (p.n.dot(l), p.n.dot(p.v).max(1e-4));
    if n_l <= 0.0 {
        return DVec3::ZERO;
    }
    let h = (l + p.v).normalize();
    let (n_h, v_h) = (p.n.dot(h), p.v.dot(h));
    let a2 = p.roughness.max(0.01).powi(4);
    let d = if n_h > 0.0 { a2 / (PI * (n_h * n_h * (a2 - 1.0) + 1.0).powi(2)) } else { 0.0 };
    let lambda = |c: f64| ((1.0 + a2 * (1.0 - c * c) / (c * c)).sqrt() - 1.0) / 2.0;
    let g2 = 1.0 / (1.0 + lambda(n_l) + lambda(n_v));
    let r0 = ((p.ior - 1.0) / (p.ior + 1.0)).powi(2);
    let f0 = DVec3::splat(r0.min(1.0) * p.specular).lerp(p.albedo, p.metallic);
    let f90 = p.specular + (1.0 - p.specular) * p.metallic;
    let f = f0 + (DVec3::splat(f90) - f0) * (1.0 - v_h).max(0.0).powi(5);
    let diffuse = p.albedo * (1.0 - p.metallic) / PI * (DVec3::ONE - f);
    (diffuse + f * (d * g2 / (4.0 * n_l * n_v))) * n_l
}

/// Radiance reflected from all lights of the scene.
pub fn direct(scene: &Scene, p: &Point) -> DVec3 {
    scene.lights.iter().fold(DVec3::ZERO, |sum, light| {
        let (l, e) = incident(light, p.position);
        sum + reflected(p, l) * e
    })
}

/// The surface point of a pixel of the G-buffer.
pub fn point(scene: &Scene, pixel: &AovPixel, view: &View, orthographic: bool) -> Point {
    let p_rel = glam::Vec3::from(pixel.p_rel).as_dvec3();
    let material = &scene.materials[pixel.material as usize - 1];
    Point {
        position: p_rel + view.eye,
        n: glam::Vec3::from(pixel.normal).as_dvec3().normalize(),
        v: if orthographic { -view.axes[2] } else { -p_rel.normalize() },
        albedo: glam::Vec3::from(pixel.albedo).as_dvec3(),
        metallic: f64::from(pixel.metallic),
        roughness: f64::from(pixel.roughness),
        ior: f64::from(material.ior),
        specular: f64::from(material.specular),
    }
}
