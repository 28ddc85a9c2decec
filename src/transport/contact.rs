//! Coincident geometry: closed dielectric meshes that touch other surfaces (coincident interfaces), and duplicate
//! triangles.
//!
//! Read docs/decisions/rays.md. Rays cross coincident interfaces together, because they are closer than the ray offset.

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::bvh::{Aabb, Bvh, Node, Triangle};

/// Whether some triangle of a body lies within `distance` metres of the plane of a triangle of another body or of
/// another instance, and their bounding boxes overlap. `bodies`: the body of each instance (`Solids::body`). Coplanar
/// triangles whose boxes overlap count even when the triangles do not: that costs only time. Shells of one mesh that
/// touch each other are not searched: near the pole of a sphere, triangles that are not even neighbours are coplanar.
#[must_use]
pub fn has_coincident_interfaces(bvh: &Bvh, bodies: &[Option<usize>], distance: f64) -> bool {
    let is_body = |t: &&Triangle| bodies[t.instance as usize].is_some();
    bvh.triangles.par_iter().filter(is_body).any(|t| touches(bvh, t, bodies, distance))
}

/// Duplicate triangles: for each pair of instances (equal indices for duplicates within one instance), the number of
/// triangles with the same three corners in any order.
#[must_use]
pub fn twins(bvh: &Bvh) -> BTreeMap<[u32; 2], usize> {
    let corners = |triangle: &Triangle| {
        let mut corners = triangle.corners.map(|corner| corner.map(|x| (x + 0.0).to_bits()));
        corners.sort_unstable();
        corners
    };
    let mut named: Vec<(u64, u32)> = bvh
        .triangles
        .par_iter()
        .enumerate()
        .map(|(i, triangle)| {
            let mut name = DefaultHasher::new();
            corners(triangle).hash(&mut name);
            (name.finish(), i as u32)
        })
        .collect();
    named.par_sort_unstable();
    let mut found = BTreeMap::new();
    for same in named.chunk_by(|a, b| a.0 == b.0) {
        for pair in same.windows(2) {
            let [a, b] = [pair[0], pair[1]].map(|(_, i)| &bvh.triangles[i as usize]);
            if corners(a) == corners(b) {
                *found.entry([a.instance.min(b.instance), a.instance.max(b.instance)]).or_default() += 1;
            }
        }
    }
    found
}

fn touches(bvh: &Bvh, triangle: &Triangle, bodies: &[Option<usize>], distance: f64) -> bool {
    let around = triangle.bounds();
    let apart = |other: &Aabb| {
        (0..3).any(|i| {
            let gap = (f64::from(other.min[i]) - f64::from(around.max[i]))
                .max(f64::from(around.min[i]) - f64::from(other.max[i]));
            gap > distance
        })
    };
    let mut open = vec![0];
    while let Some(i) = open.pop() {
        let node = &bvh.nodes[i as usize];
        if apart(node.bounds()) {
            continue;
        }
        match node {
            Node::Inner { children, .. } => open.extend(children),
            Node::Leaf { first, count, .. } => {
                let inside = &bvh.triangles[*first as usize..(*first + *count) as usize];
                let coincides = |other: &Triangle| {
                    bodies[other.instance as usize] != bodies[triangle.instance as usize]
                        && !apart(&other.bounds())
                        && (in_plane(triangle, other, distance) || in_plane(other, triangle, distance))
                };
                if inside.iter().any(coincides) {
                    return true;
                }
            }
        }
    }
    false
}

/// Whether the corners of `small` lie in the plane of `large`. The plane of a small triangle is not accurate over the
/// extent of a large one, so the caller tests both ways.
fn in_plane(large: &Triangle, small: &Triangle, distance: f64) -> bool {
    let [a, b, c] = corners(large);
    let n = (b - a).cross(c - a).normalize_or_zero();
    corners(small).iter().all(|p| (p - a).dot(n).abs() <= distance)
}

fn corners(triangle: &Triangle) -> [DVec3; 3] {
    triangle.corners.map(|p| Vec3::from(p).as_dvec3())
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::scene::{Instance, Material, Mesh, Scene};

    /// Squares of two triangles each, with side and height; a rotation makes their coordinates inexact.
    fn squares(placed: &[(f32, f32)]) -> Bvh {
        let mut scene = Scene { materials: vec![Material::default()], ..Scene::default() };
        for (i, &(side, height)) in placed.iter().enumerate() {
            let corner = |x: f32, y: f32| [x * side, y * side, height];
            scene.meshes.push(Mesh {
                positions: vec![corner(-0.5, -0.5), corner(0.5, -0.5), corner(0.5, 0.5), corner(-0.5, 0.5)].into(),
                indices: vec![0, 1, 2, 0, 2, 3].into(),
                ..Mesh::default()
            });
            let world_from_object = DAffine3::from_axis_angle(DVec3::new(0.3, 0.7, 0.2).normalize(), 0.9);
            scene.instances.push(Instance { name: String::new(), mesh: i, world_from_object });
        }
        Bvh::build(&scene).unwrap()
    }

    #[test]
    fn small_and_large_faces_in_one_plane_touch_both_ways() {
        let offset = 32.0 * 5.0 * 2_f64.powi(-24);
        let bvh = squares(&[(10.0, 0.5), (0.01, 0.5), (1.0, 0.501)]);
        assert!(has_coincident_interfaces(&bvh, &[Some(0), None, None], offset));
        assert!(has_coincident_interfaces(&bvh, &[None, Some(1), None], offset));
        assert!(!has_coincident_interfaces(&bvh, &[None, None, Some(2)], offset), "a millimetre is no contact");
        assert!(!has_coincident_interfaces(&bvh, &[None; 3], offset));
    }

    #[test]
    fn triangles_that_are_there_twice_are_found() {
        assert!(twins(&squares(&[(1.0, 0.0), (1.0, 0.1), (2.0, 0.0)])).is_empty());
        let found = twins(&squares(&[(1.0, 0.0), (2.0, 0.0), (1.0, 0.0)]));
        assert_eq!(found.into_iter().collect::<Vec<_>>(), [([0, 2], 2)]);
    }
}
