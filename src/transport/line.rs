//! Ray casting through the BVH on the host, in f64: a slab test per box, an intersection test per triangle.
//!
//! Read Möller and Trumbore 1997, "Fast, Minimum Storage Ray/Triangle Intersection"; Real-Time Rendering (4th ed.),
//! chapter 22. Coordinates are in bvh space.

use glam::DVec3;

use super::bvh::{Bvh, Node, Triangle};
use super::surface_point::SurfacePoint;
use crate::scene::Scene;
use crate::scene::solid::Solids;

/// The intersection of a line with a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crossing<'a> {
    pub(super) triangle: &'a Triangle,
    /// Parameter along the line, in lengths of the direction.
    pub(super) t: f64,
    /// Barycentric coordinates of the second and the third corner.
    pub(super) uv: [f64; 2],
}

/// The orientation of an intersected triangle relative to the line.
pub(super) struct Facing {
    /// Whether the line meets the front side; fronts of closed meshes face outwards.
    pub(super) front: bool,
    /// Unit shading normal, interpolated from the corners and bent by the normal map, on the line's side. The geometric
    /// normal replaces it where it faces away, near silhouettes, or is NaN.
    pub(super) normal: DVec3,
    /// Unit geometric normal on the line's side.
    pub(super) flat: DVec3,
}

impl Crossing<'_> {
    /// The point of the surface.
    pub(super) fn point(&self) -> SurfacePoint {
        let Triangle { instance, primitive, .. } = *self.triangle;
        SurfacePoint { instance: instance as usize, primitive: primitive as usize, uv: self.uv }
    }

    /// The orientation for a line in `direction`. `bend` applies a normal map to the interpolated normal.
    pub(super) fn facing(
        &self,
        scene: &Scene,
        solids: &Solids,
        direction: DVec3,
        bend: impl FnOnce(DVec3) -> DVec3,
    ) -> Facing {
        let instance = self.triangle.instance as usize;
        let [a, b, c] = self.triangle.corners.map(|corner| DVec3::from(corner.map(f64::from)));
        let n = (b - a).cross(c - a).normalize();
        let faces = n.dot(direction) < 0.0;
        let flat = if faces { n } else { -n };
        let smooth = self.normal(scene);
        let bent = if smooth.dot(flat) < 0.0 { -bend(smooth) } else { bend(smooth) };
        let normal = if -direction.dot(bent) > 0.0 { bent } else { flat };
        Facing { front: faces == winds_outwards(scene, solids, instance), normal, flat }
    }

    /// Unit shading normal, interpolated from the corners; NaN where they cancel.
    pub(super) fn normal(&self, scene: &Scene) -> DVec3 {
        let placed = &scene.instances[self.triangle.instance as usize];
        let mesh = &scene.meshes[placed.mesh];
        let first = 3 * self.triangle.primitive as usize;
        let [u, v] = self.uv;
        let n: DVec3 = [1.0 - u - v, u, v]
            .into_iter()
            .zip(&mesh.indices[first..first + 3])
            .map(|(weight, &i)| glam::Vec3::from(mesh.normals[i as usize]).as_dvec3() * weight)
            .sum();
        (placed.world_from_object.matrix3.inverse().transpose() * n).normalize()
    }
}

/// Whether the normals (b − a) × (c − a) of an instance's triangles are on their fronts.
pub(super) fn winds_outwards(scene: &Scene, solids: &Solids, instance: usize) -> bool {
    let mirrored = scene.instances[instance].world_from_object.matrix3.determinant() < 0.0;
    mirrored == solids.flipped[instance]
}

/// Calls `crossed` with each intersection of a line from `origin` (bvh space) with t > `from`, in no order. The return
/// value of `crossed` is the new upper limit of t.
pub(super) fn traverse<'a>(
    bvh: &'a Bvh,
    origin: DVec3,
    direction: DVec3,
    from: f64,
    mut crossed: impl FnMut(Crossing<'a>) -> f64,
) {
    let mut until = f64::INFINITY;
    let mut open = if bvh.nodes.is_empty() { Vec::new() } else { vec![0_u32] };
    let inverse = direction.recip();
    while let Some(node) = open.pop() {
        let node = &bvh.nodes[node as usize];
        let bounds = node.bounds();
        let [low, high] =
            [bounds.min, bounds.max].map(|corner| (DVec3::from(corner.map(f64::from)) - origin) * inverse);
        let (near, far) = (low.min(high).max_element(), low.max(high).min_element());
        // A line in the plane of a box's side gives NaN; the box is then visited.
        if far < from || near > far || near > until {
            continue;
        }
        match node {
            Node::Inner { children, .. } => open.extend(children),
            Node::Leaf { first, count, .. } => {
                for triangle in &bvh.triangles[*first as usize..(*first + *count) as usize] {
                    if let Some((t, uv)) = meets(triangle.corners, origin, direction).filter(|(t, _)| *t > from) {
                        until = crossed(Crossing { triangle, t, uv });
                    }
                }
            }
        }
    }
}

/// The nearest intersection with t > `from`.
pub(super) fn nearest(bvh: &Bvh, origin: DVec3, direction: DVec3, from: f64) -> Option<Crossing<'_>> {
    let mut found: Option<Crossing> = None;
    traverse(bvh, origin, direction, from, |crossing| {
        if found.is_none_or(|best| crossing.t < best.t) {
            found = Some(crossing);
        }
        found.map_or(f64::INFINITY, |best| best.t)
    });
    found
}

/// Ray/triangle intersection (Möller and Trumbore 1997): t and barycentric coordinates.
fn meets(corners: [[f32; 3]; 3], origin: DVec3, direction: DVec3) -> Option<(f64, [f64; 2])> {
    let [a, b, c] = corners.map(|corner| DVec3::from(corner.map(f64::from)));
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let inverse = ab.dot(p).recip();
    let from = origin - a;
    let u = from.dot(p) * inverse;
    let q = from.cross(ab);
    let v = direction.dot(q) * inverse;
    let t = ac.dot(q) * inverse;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then_some((t, [u, v]))
}
