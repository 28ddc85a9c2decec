//! The mean albedo of what the surfaces of a scene face, which ambient occlusion takes for that of half of what
//! occludes.
//!
//! Read docs/decisions/ambient-occlusion.md. The mean is over all surfaces by their areas and over directions by the
//! cosine, as light arrives from diffuse surfaces; it is the same for every device, traversal and camera.

use glam::DVec3;
use rayon::prelude::*;

use super::bvh::{Bvh, Triangle};
use super::line::{self, Crossing};
use crate::optics::SplitMix64;
use crate::scene::lobe::DIFFUSE_TRANSMISSION;
use crate::scene::solid::Solids;
use crate::scene::{AlphaMode, Material, Scene};

/// Number of rays. Where all meet something, the mean of their albedos has a standard error of at most
/// 0.5 / √2048 = 0.011.
const RAYS: usize = 2048;

/// Casts rays from points all over the scene; `offset` is where they start, in metres from the surface. Black where no
/// surface faces another one.
#[must_use]
pub fn mean_albedo(scene: &Scene, solids: &Solids, bvh: &Bvh, offset: f64) -> [f64; 3] {
    let mut area = 0.0;
    let areas: Vec<f64> = bvh
        .triangles
        .iter()
        .map(|triangle| {
            area += edges(triangle)[0].cross(edges(triangle)[1]).length();
            area
        })
        .collect();
    let found: Vec<Option<(DVec3, f64)>> = (0..RAYS)
        .into_par_iter()
        .map(|i| {
            let at = (i as f64 + 0.5) / RAYS as f64 * area;
            let triangle = bvh.triangles.get(areas.partition_point(|&up_to| up_to <= at))?;
            let mut random = SplitMix64::new(i as u64);
            let (origin, direction) = ray_from(scene, solids, triangle, &mut random);
            let hit = line::nearest(bvh, origin, direction, offset)?;
            Some(occluder(scene, &hit))
        })
        .collect();
    let (sum, weight) = found
        .into_iter()
        .flatten()
        .fold((DVec3::ZERO, 0.0), |(sum, weight), (albedo, share)| (sum + albedo * share, weight + share));
    if weight > 0.0 { (sum / weight).to_array() } else { [0.0; 3] }
}

/// The edges from the first corner.
fn edges(triangle: &Triangle) -> [DVec3; 2] {
    let [a, b, c] = triangle.corners.map(|corner| DVec3::from(corner.map(f64::from)));
    [b - a, c - a]
}

/// A ray from a uniform point of the triangle's front, with the density cos θ / π.
fn ray_from(scene: &Scene, solids: &Solids, triangle: &Triangle, random: &mut SplitMix64) -> (DVec3, DVec3) {
    let ([mut u, mut v], [ab, ac]) = ([random.unit(), random.unit()], edges(triangle));
    if u + v > 1.0 {
        (u, v) = (1.0 - u, 1.0 - v);
    }
    let outwards = line::winds_outwards(scene, solids, triangle.instance as usize);
    let n = ab.cross(ac).normalize_or_zero() * if outwards { 1.0 } else { -1.0 };
    // A uniform point of the sphere around the tip of n.
    let (z, phi) = (random.between(-1.0, 1.0), random.between(0.0, std::f64::consts::TAU));
    let around = (1.0 - z * z).sqrt();
    let direction = n + DVec3::new(around * phi.cos(), around * phi.sin(), z);
    (DVec3::from(triangle.corners[0].map(f64::from)) + ab * u + ac * v, direction.normalize_or(n))
}

/// The albedo of what a ray meets, and how far it occludes.
fn occluder(scene: &Scene, hit: &Crossing<'_>) -> (DVec3, f64) {
    let m = hit.point().material(scene);
    let alpha = f64::from(m.base_color[3]);
    let covers = match m.alpha_mode {
        AlphaMode::Opaque => 1.0,
        AlphaMode::Mask(cutoff) => f64::from(u8::from(alpha >= f64::from(cutoff))),
        AlphaMode::Blend => alpha,
    };
    (albedo(&m), covers * (1.0 - passing(&m)))
}

/// The share of light that passes a material straight on.
fn passing(m: &Material) -> f64 {
    f64::from(m.transmission * (1.0 - m.metallic))
}

/// The share of light that a material gives back: metals their base colour, other materials theirs without what they
/// transmit diffusely. The few percent of a dielectric's own mirror are left out.
fn albedo(m: &Material) -> DVec3 {
    let [r, g, b, _] = m.base_color.map(f64::from);
    let through = f64::from(m.lobes[DIFFUSE_TRANSMISSION].factors[0] * (1.0 - m.metallic));
    DVec3::new(r, g, b) * (1.0 - through)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::solid::solids;
    use crate::scene::{Instance, Mesh};
    use glam::{DAffine3, DMat3};

    /// Squares of 2 m with these albedos at z = 0, 1, …; the fronts of odd ones face down, by a mirrored instance.
    fn squares(materials: Vec<Material>) -> Scene {
        let mesh = |material| Mesh {
            positions: vec![[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]].into(),
            normals: vec![[0.0, 0.0, 1.0]; 4].into(),
            indices: vec![0, 1, 2, 0, 2, 3].into(),
            material,
            ..Mesh::default()
        };
        let instance = |mesh: usize| Instance {
            name: String::new(),
            mesh,
            world_from_object: DAffine3 {
                matrix3: DMat3::from_diagonal(DVec3::new(1.0, 1.0, if mesh % 2 == 1 { -1.0 } else { 1.0 })),
                translation: DVec3::Z * mesh as f64,
            },
        };
        let all = 0..materials.len();
        Scene {
            meshes: all.clone().map(mesh).collect(),
            instances: all.map(instance).collect(),
            materials,
            ..Scene::default()
        }
    }

    fn mean(materials: Vec<Material>) -> [f64; 3] {
        let scene = squares(materials);
        mean_albedo(&scene, &solids(&scene), &Bvh::build(&scene).expect("a tree"), 1e-6)
    }

    fn painted(r: f32, g: f32, b: f32) -> Material {
        Material { base_color: [r, g, b, 1.0], metallic: 0.0, ..Material::default() }
    }

    #[test]
    fn equal_surfaces_face_each_other_equally() {
        let both = mean(vec![painted(0.9, 0.1, 0.5), painted(0.1, 0.3, 0.5)]);
        for (found, wanted) in both.into_iter().zip([0.5, 0.2, 0.5]) {
            // Four standard errors of a mean of some 400 rays that meet the other square.
            assert!((found - wanted).abs() < 4.0 * 0.4 / 20.0, "{both:?}");
        }
        assert!((both[2] - 0.5).abs() < 1e-6, "{both:?}");
    }

    #[test]
    fn what_lets_light_through_counts_for_less() {
        let mut leaf = painted(0.8, 0.8, 0.8);
        leaf.lobes[DIFFUSE_TRANSMISSION].factors = [0.5, 1.0, 1.0, 1.0];
        let glass = Material { transmission: 1.0, ..painted(1.0, 1.0, 1.0) };
        let leaves = mean(vec![leaf.clone(), leaf]);
        assert!(leaves.iter().all(|albedo| (albedo - 0.4).abs() < 1e-6), "{leaves:?}");
        assert_eq!(mean(vec![painted(0.7, 0.7, 0.7), glass])[0], f64::from(0.7_f32));
        // Nothing faces a square alone.
        assert_eq!(mean(vec![painted(0.7, 0.7, 0.7)]), [0.0; 3]);
    }
}
