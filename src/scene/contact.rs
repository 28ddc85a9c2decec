//! Whether transparent bodies lie against other surfaces: faces that coincide are crossed together.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::bvh::{Aabb, Bvh, Node, Triangle};

/// Whether some triangle of an instance for which `is_body` says so lies in the plane of another one, within `distance`
/// metres, and their boxes overlap. Neighbours, which share a corner, do not count within an instance; triangles in one
/// plane that only have boxes in common do: that costs time, not truth.
#[must_use]
pub fn bodies_touch(bvh: &Bvh, is_body: &[bool], distance: f64) -> bool {
    bvh.triangles.par_iter().filter(|t| is_body[t.instance as usize]).any(|t| touches(bvh, t, distance))
}

fn touches(bvh: &Bvh, triangle: &Triangle, distance: f64) -> bool {
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
                    (other.instance != triangle.instance || !share_a_corner(triangle, other))
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

/// Whether the corners of `small` lie in the plane of `large`. The plane of a small triangle is not known as far away as a
/// large one reaches: the caller asks both ways.
fn in_plane(large: &Triangle, small: &Triangle, distance: f64) -> bool {
    let [a, b, c] = corners(large);
    let n = (b - a).cross(c - a).normalize_or_zero();
    corners(small).iter().all(|p| (p - a).dot(n).abs() <= distance)
}

/// As neighbours on one surface do.
fn share_a_corner(a: &Triangle, b: &Triangle) -> bool {
    a.corners.iter().any(|corner| b.corners.contains(corner))
}

fn corners(triangle: &Triangle) -> [DVec3; 3] {
    triangle.corners.map(|p| Vec3::from(p).as_dvec3())
}
