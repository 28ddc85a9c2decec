//! Shapes of the study scenes: triangles with unit normals and one texture-coordinate set, in object space.
//!
//! Every shape is counter-clockwise seen from its outside. Points shared by several faces come from the same
//! computation, so that they are equal to the last bit and closed shapes are watertight.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec2, DVec3};

/// Triangles of one surface, without a name and a material.
#[derive(Debug, Clone, Default)]
pub struct Shape {
    /// Object-space positions in metres.
    pub positions: Vec<[f32; 3]>,
    /// Unit normals, one per position.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinates, one per position: u to the right and v down, seen from the outside.
    pub uvs: Vec<[f32; 2]>,
    /// Three indices per triangle, counter-clockwise seen from the outside.
    pub indices: Vec<u32>,
}

/// A smooth part of an outline: points with their unit normals. Neighbouring parts meet in a hard edge.
type Stretch = Vec<(DVec2, DVec2)>;

/// Rounds a point to nanometres. Sines and cosines of right angles have residues near 1e-17, but a closed outline must
/// meet itself or its axis exactly. No study shape has detail below a nanometre.
fn snap(p: DVec2) -> DVec2 {
    (p * 1e9).round() * 1e-9
}

/// A straight part; its normal points to the right of the direction of travel.
#[must_use]
pub(crate) fn line(from: DVec2, to: DVec2) -> Stretch {
    let along = (to - from).normalize();
    let n = DVec2::new(along.y, -along.x);
    vec![(snap(from), n), (snap(to), n)]
}

/// An arc from angle `from` to `to` in radians; normals point outwards on counter-clockwise arcs, inwards on others.
#[must_use]
pub(crate) fn arc(center: DVec2, radius: f64, from: f64, to: f64, steps: u32) -> Stretch {
    let sign = if to > from { 1.0 } else { -1.0 };
    (0..=steps)
        .map(|i| {
            let (sin, cos) = (from + (to - from) * f64::from(i) / f64::from(steps)).sin_cos();
            let n = snap(DVec2::new(cos, sin));
            (snap(center + n * radius), n.normalize() * sign)
        })
        .collect()
}

impl Shape {
    fn push(&mut self, position: DVec3, normal: DVec3, uv: DVec2) -> u32 {
        let index = self.positions.len() as u32;
        self.positions.push(position.as_vec3().to_array());
        self.normals.push(normal.normalize().as_vec3().to_array());
        self.uvs.push(uv.as_vec2().to_array());
        index
    }

    /// Two triangles of a quadrilateral; if two corners coincide, one triangle.
    fn quad(&mut self, [a, b, c, d]: [u32; 4]) {
        for [i, j, k] in [[a, b, c], [a, c, d]] {
            let [p, q, r] = [i, j, k].map(|v| self.positions[v as usize]);
            if p != q && q != r && r != p {
                self.indices.extend([i, j, k]);
            }
        }
    }

    /// Number of triangles.
    #[must_use]
    pub fn triangles(&self) -> usize {
        self.indices.len() / 3
    }

    /// The shape with its texture repeated `u` by `v` times.
    #[must_use]
    pub fn repeat_uv(mut self, u: f64, v: f64) -> Self {
        for uv in &mut self.uvs {
            *uv = [uv[0] * u as f32, uv[1] * v as f32];
        }
        self
    }

    /// A horizontal rectangle around the origin that faces +Y, of `cells` by `cells` quads.
    #[must_use]
    pub fn plane(size_x: f64, size_z: f64, cells: u32) -> Self {
        let mut shape = Self::default();
        let cells = cells.max(1);
        for i in 0..=cells {
            for j in 0..=cells {
                let uv = DVec2::new(f64::from(i), f64::from(j)) / f64::from(cells);
                let p = DVec3::new((uv.x - 0.5) * size_x, 0.0, (uv.y - 0.5) * size_z);
                shape.push(p, DVec3::Y, uv);
            }
        }
        let row = cells + 1;
        for i in 0..cells {
            for j in 0..cells {
                let a = i * row + j;
                shape.quad([a, a + 1, a + row + 1, a + row]);
            }
        }
        shape
    }

    /// A vertical rectangle around the origin that faces +Z.
    #[must_use]
    pub fn panel(width: f64, height: f64) -> Self {
        let mut shape = Self::default();
        let corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
            .map(|(x, y)| shape.push(DVec3::new(x * width, y * height, 0.0), DVec3::Z, DVec2::new(x + 0.5, 0.5 - y)));
        shape.quad(corners);
        shape
    }

    /// An axis-aligned box around the origin with the given edge lengths.
    #[must_use]
    pub fn cuboid(size: DVec3) -> Self {
        let mut shape = Self::default();
        // Per face: outward normal, direction of u, direction against v; the last two span the face
        // counter-clockwise.
        let faces = [
            (DVec3::X, DVec3::NEG_Z, DVec3::Y),
            (DVec3::NEG_X, DVec3::Z, DVec3::Y),
            (DVec3::Y, DVec3::X, DVec3::NEG_Z),
            (DVec3::NEG_Y, DVec3::X, DVec3::Z),
            (DVec3::Z, DVec3::X, DVec3::Y),
            (DVec3::NEG_Z, DVec3::NEG_X, DVec3::Y),
        ];
        for (normal, right, up) in faces {
            let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| {
                let p = (normal + right * x + up * y) * size * 0.5;
                shape.push(p, normal, DVec2::new(0.5 + 0.5 * x, 0.5 - 0.5 * y))
            });
            shape.quad(corners);
        }
        shape
    }

    /// A sphere around the origin with smooth normals: `4 * rings * (rings - 1)` triangles.
    #[must_use]
    pub fn sphere(radius: f64, rings: u32) -> Self {
        let rings = rings.max(2);
        let outline = arc(DVec2::ZERO, 1.0, -FRAC_PI_2, FRAC_PI_2, rings);
        // Scaled last, so that spheres of all radii have the same directions.
        let outline = outline.into_iter().map(|(p, n)| (p * radius, n)).collect();
        Self::lathe(&[outline], rings * 2)
    }

    /// A vertical closed cylinder that stands on the plane y = 0.
    #[must_use]
    pub fn cylinder(radius: f64, height: f64, segments: u32) -> Self {
        let (foot, top) = (DVec2::new(radius, 0.0), DVec2::new(radius, height));
        let axis = DVec2::new(0.0, height);
        Self::lathe(&[line(DVec2::ZERO, foot), line(foot, top), line(top, axis)], segments)
    }

    /// A horizontal disk around the origin that faces +Y.
    #[must_use]
    pub fn disc(radius: f64, segments: u32) -> Self {
        Self::lathe(&[line(DVec2::new(radius, 0.0), DVec2::ZERO)], segments)
    }

    /// A torus around the Y axis: `ring` is the distance from the axis to the centre of the tube, `tube` its radius.
    #[must_use]
    pub fn torus(ring: f64, tube: f64, segments: u32) -> Self {
        Self::lathe(&[arc(DVec2::new(ring, 0.0), tube, 0.0, TAU, (segments / 2).max(3))], segments)
    }

    /// A surface of revolution: an outline in the half plane (distance from the axis, y), rotated around the Y axis.
    /// The outside lies to the right of the direction of travel, so the outline of a closed body runs from the bottom
    /// of its axis outwards and up.
    #[must_use]
    pub(crate) fn lathe(outline: &[Stretch], segments: u32) -> Self {
        let mut shape = Self::default();
        let segments = segments.max(3);
        let length: f64 = outline.iter().flat_map(|s| s.windows(2)).map(|w| w[0].0.distance(w[1].0)).sum();
        let mut travelled = 0.0;
        for stretch in outline {
            let first = shape.positions.len() as u32;
            for (i, &(p, n)) in stretch.iter().enumerate() {
                if i > 0 {
                    travelled += p.distance(stretch[i - 1].0);
                }
                for j in 0..=segments {
                    // Both copies of the seam use the same angle, hence the same bits.
                    let (sin, cos) = (TAU * f64::from(j % segments) / f64::from(segments)).sin_cos();
                    let uv = DVec2::new(1.0 - f64::from(j) / f64::from(segments), 1.0 - travelled / length);
                    shape.push(DVec3::new(p.x * cos, p.y, p.x * sin), DVec3::new(n.x * cos, n.y, n.x * sin), uv);
                }
            }
            let row = segments + 1;
            for i in 0..stretch.len() as u32 - 1 {
                for j in 0..segments {
                    let a = first + i * row + j;
                    shape.quad([a, a + row, a + row + 1, a + 1]);
                }
            }
        }
        shape
    }

    /// A straight prism around the origin: a convex polygon, counter-clockwise in the XY plane, extruded along Z.
    #[must_use]
    pub fn prism(polygon: &[DVec2], depth: f64) -> Self {
        let mut shape = Self::default();
        let (front, back) = (depth * 0.5, -depth * 0.5);
        let size = polygon.iter().fold(0.0_f64, |size, p| size.max(p.abs().max_element())).max(f64::MIN_POSITIVE);
        let cap_uv = |p: DVec2, mirror: f64| DVec2::new(0.5 + 0.5 * mirror * p.x / size, 0.5 - 0.5 * p.y / size);
        for (z, normal, mirror) in [(front, DVec3::Z, 1.0), (back, DVec3::NEG_Z, -1.0)] {
            let first = shape.positions.len() as u32;
            for p in polygon {
                shape.push(p.extend(z), normal, cap_uv(*p, mirror));
            }
            for i in 1..polygon.len() as u32 - 1 {
                let (b, c) = if mirror > 0.0 { (i, i + 1) } else { (i + 1, i) };
                shape.indices.extend([first, first + b, first + c]);
            }
        }
        for (i, &p) in polygon.iter().enumerate() {
            let q = polygon[(i + 1) % polygon.len()];
            let along = (q - p).normalize();
            let normal = DVec3::new(along.y, -along.x, 0.0);
            let corners = [
                shape.push(p.extend(back), normal, DVec2::new(0.0, 0.0)),
                shape.push(q.extend(back), normal, DVec2::new(1.0, 0.0)),
                shape.push(q.extend(front), normal, DVec2::new(1.0, 1.0)),
                shape.push(p.extend(front), normal, DVec2::new(0.0, 1.0)),
            ];
            shape.quad(corners);
        }
        shape
    }

    /// A rectangular tub, open at the top: `inner` is the width, depth (Y) and length of the cavity, `wall` and `floor`
    /// are the thicknesses. The origin is the centre of the opening. Texture coordinates are in metres from the corners
    /// of the cavity.
    #[must_use]
    pub fn tub(inner: DVec3, wall: f64, floor: f64) -> Self {
        let mut shape = Self::default();
        // Corners of a horizontal rectangle, clockwise seen from above.
        let ring = |x: f64, y: f64, z: f64| [(-x, -z), (x, -z), (x, z), (-x, z)].map(|(x, z)| DVec3::new(x, y, z));
        let (x, z) = (inner.x * 0.5, inner.z * 0.5);
        let foot = ring(x + wall, -inner.y - floor, z + wall);
        let top = ring(x + wall, 0.0, z + wall);
        let edge = ring(x, 0.0, z);
        let bottom = ring(x, -inner.y, z);
        let mut face = |corners: [DVec3; 4]| {
            let n = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
            let corners = corners.map(|p| {
                let from_corner = p + DVec3::new(x, 0.0, z);
                let uv = if n.y.abs() > 0.5 {
                    DVec2::new(from_corner.x, from_corner.z * n.y)
                } else {
                    DVec2::new(from_corner.x * n.z - from_corner.z * n.x, -p.y)
                };
                shape.push(p, n, uv)
            });
            shape.quad(corners);
        };
        for i in 0..4 {
            let j = (i + 1) % 4;
            face([foot[i], top[i], top[j], foot[j]]);
            face([top[i], edge[i], edge[j], top[j]]);
            face([edge[i], bottom[i], bottom[j], edge[j]]);
        }
        face(foot);
        face([bottom[0], bottom[3], bottom[2], bottom[1]]);
        shape
    }

    /// A curved backdrop: from the floor's end at z = `back` it bends up, with radius `bend`, into a wall that ends at
    /// y = `top`; `width` across. Texture coordinates are in metres.
    #[must_use]
    pub fn backdrop(width: f64, back: f64, bend: f64, top: f64) -> Self {
        // Outline in (−z, y); the surface lies to the left of travel, where normals of an arc would have to point
        // inwards.
        let curve = arc(DVec2::new(-back, bend), bend, -FRAC_PI_2, 0.0, 24);
        let wall = line(DVec2::new(-back + bend, bend), DVec2::new(-back + bend, top));
        let mut shape = Self::default();
        let mut travelled = 0.0;
        for stretch in [curve, wall] {
            let first = shape.positions.len() as u32;
            for (i, &(p, n)) in stretch.iter().enumerate() {
                if i > 0 {
                    travelled += p.distance(stretch[i - 1].0);
                }
                for side in [-0.5, 0.5] {
                    let position = DVec3::new(side * width, p.y, -p.x);
                    shape.push(position, DVec3::new(0.0, -n.y, n.x), DVec2::new(side * width, -travelled));
                }
            }
            for i in 0..stretch.len() as u32 - 1 {
                let a = first + i * 2;
                shape.quad([a, a + 1, a + 3, a + 2]);
            }
        }
        shape
    }

    /// A sphere of about `triangles` triangles whose radius varies by a tenth, with the normals of the exact
    /// surface; it has detail at all scales down to a twentieth of its size.
    #[must_use]
    pub fn displaced_sphere(radius: f64, triangles: usize) -> Self {
        // 4 r (r − 1) = triangles, solved for r.
        let rings = (0.5 + (0.25 + triangles as f64 / 4.0).sqrt()).round().max(2.0) as u32;
        let mut shape = Self::sphere(1.0, rings);
        let swell = |d: DVec3| {
            let wave = |k: f64, shift: f64| {
                ((d.x * k + shift).sin() + (d.y * k * 1.1 - shift).sin() + (d.z * k * 0.9 + 2.0 * shift).sin()) / k
            };
            1.0 + 0.15 * (wave(4.0, 0.3) + wave(9.0, 1.7) + wave(20.0 * PI / 3.0, 0.9))
        };
        for (position, normal) in shape.positions.iter_mut().zip(&mut shape.normals) {
            let d = DVec3::from(position.map(f64::from)).normalize();
            // The surface is the zero set of |p| − swell(p / |p|); its gradient is the normal.
            let f = |p: DVec3| p.length() - swell(p.normalize());
            let p = d * swell(d);
            let h = 1e-5;
            let gradient = DVec3::new(
                f(p + DVec3::X * h) - f(p - DVec3::X * h),
                f(p + DVec3::Y * h) - f(p - DVec3::Y * h),
                f(p + DVec3::Z * h) - f(p - DVec3::Z * h),
            );
            *position = (p * radius).as_vec3().to_array();
            *normal = gradient.normalize().as_vec3().to_array();
        }
        shape
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use etalon_optics::frame::quadric_normal;

    #[test]
    fn normals_of_balls_are_those_of_the_quadric() {
        let ball = Shape::sphere(0.7, 24);
        for (p, n) in ball.positions.iter().zip(&ball.normals) {
            let [p, n] = [p, n].map(|v| glam::Vec3::from(*v).as_dvec3());
            let exact = quadric_normal(p, DVec3::ONE);
            assert!(n.distance(exact) < 1e-6, "at {p}: {n}, not {exact}");
        }
    }
}
