//! Points and lines as thin triangles: octahedra and four-sided boxes with flat outward normals.
//!
//! Read glTF 2.0 section 3.7.2 (point and line primitives). The thickness is a fraction of the size of the whole scene.
//! Strokes are therefore built in world axes after all other geometry, and placed by a translation alone.

use glam::{DAffine3, DVec3, Vec3};

use super::{Bounds, Instance, Mesh, Scene};

/// Half the thickness, as a fraction of the scene's bounding diagonal.
const HALF_THICKNESS: f64 = 0.002;

/// A point or a line, by vertex indices.
#[derive(Clone, Copy)]
pub(crate) enum Stroke {
    Point(u32),
    Line(u32, u32),
}

/// Strokes over the vertices of one mesh, and the instances that draw them.
pub(crate) struct StrokeGroup {
    /// Name and world transform of each instance.
    pub(crate) placements: Vec<(String, DAffine3)>,
    /// Vertices with their attributes; its triangles and normals are ignored.
    pub(crate) mesh: Mesh,
    /// Points and lines to build.
    pub(crate) strokes: Vec<Stroke>,
}

/// Appends a mesh and an instance for each group and placement; the thickness comes from the bounds of the whole scene.
pub(crate) fn add(groups: &[StrokeGroup], meshes: &mut Vec<Mesh>, instances: &mut Vec<Instance>) {
    if groups.is_empty() {
        return;
    }
    let at = |mesh: &Mesh, world: &DAffine3, i: u32| {
        world.transform_point3(Vec3::from(mesh.positions[i as usize]).as_dvec3())
    };
    let drawn = Scene { meshes: std::mem::take(meshes), instances: std::mem::take(instances), ..Scene::default() };
    let mut bounds = drawn.bounds();
    (*meshes, *instances) = (drawn.meshes, drawn.instances);
    for StrokeGroup { placements, mesh, strokes } in groups {
        for (_, world) in placements {
            for stroke in strokes {
                let (a, b) = match *stroke {
                    Stroke::Point(a) => (a, a),
                    Stroke::Line(a, b) => (a, b),
                };
                for p in [at(mesh, world, a), at(mesh, world, b)] {
                    let b = bounds.get_or_insert(Bounds { min: p, max: p });
                    *b = Bounds { min: b.min.min(p), max: b.max.max(p) };
                }
            }
        }
    }
    let diagonal = bounds.map_or(0.0, |b| 2.0 * b.radius());
    let radius = HALF_THICKNESS * if diagonal > 0.0 { diagonal } else { 1.0 };
    for StrokeGroup { placements, mesh, strokes } in groups {
        let Some(Stroke::Point(first) | Stroke::Line(first, _)) = strokes.first().copied() else { continue };
        for (name, world) in placements {
            let corner = |i: u32| Corner { position: at(mesh, world, i), source: i as usize };
            let mut builder = StrokeBuilder::new(at(mesh, world, first), radius, mesh);
            for stroke in strokes {
                match *stroke {
                    Stroke::Point(i) => builder.point(corner(i)),
                    Stroke::Line(a, b) => builder.line(corner(a), corner(b)),
                }
            }
            let (thin, world_from_object) = builder.finish();
            instances.push(Instance { name: name.clone(), mesh: meshes.len(), world_from_object });
            meshes.push(thin);
        }
    }
}

/// A vertex of a stroke.
#[derive(Clone, Copy)]
struct Corner {
    /// World position.
    position: DVec3,
    /// Index of the source vertex for colour and texture coordinates.
    source: usize,
}

/// Collects stroke geometry relative to an origin.
struct StrokeBuilder<'a> {
    origin: DVec3,
    radius: f64,
    attributes: &'a Mesh,
    out: Mesh,
}

impl<'a> StrokeBuilder<'a> {
    /// Strokes with half-thickness `radius` in metres; colours and texture coordinates come from `attributes`.
    fn new(origin: DVec3, radius: f64, attributes: &'a Mesh) -> Self {
        let out = Mesh { name: attributes.name.clone(), material: attributes.material, ..Mesh::default() };
        Self { origin, radius, attributes, out }
    }

    /// A flat polygon, counter-clockwise seen from `normal`.
    fn face<const N: usize>(&mut self, normal: DVec3, corners: [Corner; N]) {
        let first = self.out.positions.len() as u32;
        for corner in corners {
            self.out.positions.push((corner.position - self.origin).as_vec3().to_array());
            self.out.normals.push(normal.as_vec3().to_array());
            for (to, from) in self.out.uvs.iter_mut().zip(&self.attributes.uvs) {
                to.extend(from.get(corner.source));
            }
            self.out.colors.extend(self.attributes.colors.get(corner.source));
        }
        for i in 1..N as u32 - 1 {
            self.out.indices.extend([first, first + i, first + i + 1]);
        }
    }

    /// An octahedron around a point.
    fn point(&mut self, at: Corner) {
        for octant in 0..8 {
            let sign = |bit: u32| if octant >> bit & 1 == 0 { 1.0 } else { -1.0 };
            let s = DVec3::new(sign(0), sign(1), sign(2));
            let tip = |axis: DVec3| Corner { position: at.position + axis * s * self.radius, ..at };
            let (x, y, z) = (tip(DVec3::X), tip(DVec3::Y), tip(DVec3::Z));
            let corners = if s.x * s.y * s.z > 0.0 { [x, y, z] } else { [x, z, y] };
            self.face(s.normalize(), corners);
        }
    }

    /// A four-sided box from `a` to `b`; coincident ends become a point.
    fn line(&mut self, a: Corner, b: Corner) {
        let Some(along) = (b.position - a.position).try_normalize() else {
            return self.point(a);
        };
        let (u, v) = along.any_orthonormal_pair();
        let side = |end: Corner, k: usize| {
            let (x, y) = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)][k % 4];
            Corner { position: end.position + (u * x + v * y) * (self.radius * std::f64::consts::FRAC_1_SQRT_2), ..end }
        };
        let rings: [[Corner; 4]; 2] = [a, b].map(|end| std::array::from_fn(|k| side(end, k)));
        // The handedness of (u, v, along) is arbitrary; it decides the order of the corners.
        let right = u.cross(v).dot(along) > 0.0;
        for k in 0..4 {
            let quad = [rings[0][k], rings[0][(k + 1) % 4], rings[1][(k + 1) % 4], rings[1][k]];
            let normal = [v, -u, -v, u][k];
            self.face(normal, if right { quad } else { [quad[3], quad[2], quad[1], quad[0]] });
        }
        let (near, far) = (rings[0], rings[1]);
        let back = |r: [Corner; 4]| [r[3], r[2], r[1], r[0]];
        self.face(-along, if right { back(near) } else { near });
        self.face(along, if right { far } else { back(far) });
    }

    /// The mesh and its translation to the world.
    fn finish(self) -> (Mesh, DAffine3) {
        (self.out, DAffine3::from_translation(self.origin))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume_and_outwardness(mesh: &Mesh) -> f64 {
        let p = |i: u32| glam::Vec3::from(mesh.positions[i as usize]).as_dvec3();
        let mut volume = 0.0;
        for t in mesh.indices.as_chunks::<3>().0 {
            let (a, b, c) = (p(t[0]), p(t[1]), p(t[2]));
            let n = glam::Vec3::from(mesh.normals[t[0] as usize]).as_dvec3();
            let cross = (b - a).cross(c - a);
            assert!(cross.normalize().dot(n) > 0.999_999, "normal {n} of a face whose winding says {cross}");
            volume += a.dot(b.cross(c)) / 6.0;
        }
        volume
    }

    #[test]
    fn a_line_is_a_closed_box_with_outward_faces() {
        for end in [DVec3::X, DVec3::new(-1.0, 2.0, 0.5), DVec3::NEG_Z * 3.0, DVec3::new(0.1, 0.0, -7.0)] {
            let source = Mesh { colors: vec![[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0]].into(), ..Mesh::default() };
            let mut builder = StrokeBuilder::new(DVec3::ZERO, 0.1, &source);
            builder.line(Corner { position: DVec3::ZERO, source: 0 }, Corner { position: end, source: 1 });
            let (mesh, _) = builder.finish();
            assert_eq!(mesh.indices.len(), 36);
            assert_eq!(mesh.colors.len(), mesh.positions.len());
            // The cross-section is a square whose half-diagonal is the radius: side 0.1 √2.
            let expected = 0.02 * end.length();
            assert!((volume_and_outwardness(&mesh) - expected).abs() < 1e-6 * expected.max(1.0));
        }
    }

    #[test]
    fn a_point_is_a_closed_octahedron() {
        let source = Mesh::default();
        let mut builder = StrokeBuilder::new(DVec3::ZERO, 0.3, &source);
        builder.point(Corner { position: DVec3::ZERO, source: 0 });
        let (mesh, _) = builder.finish();
        assert_eq!(mesh.indices.len(), 24);
        assert!((volume_and_outwardness(&mesh) - 4.0 / 3.0 * 0.027).abs() < 1e-7);
    }
}
