//! Whether transparent bodies lie against other surfaces: faces that coincide are crossed together.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::bvh::{Aabb, Bvh, Node, Triangle};

/// Whether some triangle of an instance for which `is_body` says so lies in the plane of a triangle of another instance,
/// within `distance` metres, and their boxes overlap. Triangles in one plane that only have boxes in common count, too: that
/// costs time, not truth.
#[must_use]
pub fn bodies_touch(bvh: &Bvh, is_body: &[bool], distance: f64) -> bool {
    bvh.triangles.par_iter().filter(|t| is_body[t.instance as usize]).any(|t| touches(bvh, t, distance))
}

fn touches(bvh: &Bvh, triangle: &Triangle, distance: f64) -> bool {
    let [a, b, c] = corners(triangle);
    let n = (b - a).cross(c - a).normalize_or_zero();
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
                    other.instance != triangle.instance
                        && !apart(&other.bounds())
                        && corners(other).iter().all(|p| (p - a).dot(n).abs() <= distance)
                };
                if inside.iter().any(coincides) {
                    return true;
                }
            }
        }
    }
    false
}

fn corners(triangle: &Triangle) -> [DVec3; 3] {
    triangle.corners.map(|p| Vec3::from(p).as_dvec3())
}
