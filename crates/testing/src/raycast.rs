//! Reference ray caster: the first hit of each pixel, in f64 on the CPU, with a watertight ray/triangle test.
//!
//! Read Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1) 2013. Only the scene types are shared
//! with the renderer; matrices, BVH and triangle test are separate. Edge functions of neighbouring triangles agree on
//! their common edge, so no ray passes through a closed mesh.

use etalon::scene::{AlphaMode, Camera, Meaning, Projection, Scene, TextureRef, Wrap};
use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;

/// Options of intersection.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// Alpha-blended surfaces are opaque; otherwise rays pass through them.
    pub blend: bool,
    /// Base-colour textures (level 0, bilinear) count in the albedo and in the alpha test.
    pub textures: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { blend: false, textures: true }
    }
}

/// The first hit along a ray, in world space.
#[derive(Debug, Clone, Copy)]
pub struct Hit {
    /// Position in metres.
    pub position: DVec3,
    /// Distance from the ray's origin in metres; for a perspective camera the distance from the eye.
    pub distance: f64,
    /// Unit normal of the triangle, facing the viewer.
    pub geometric_normal: DVec3,
    /// Unit interpolated vertex normal, flipped on back faces.
    pub shading_normal: DVec3,
    /// Index of the material.
    pub material: usize,
    /// Index of the instance.
    pub instance: usize,
    /// Triangle of the instance's mesh: its indices start at three times this number.
    pub triangle: usize,
    /// Weights of the triangle's three vertices, in the order of the mesh's indices; their sum is one.
    pub barycentric: [f64; 3],
    /// Texture coordinates of set 0; zero if the mesh has none.
    pub uv: DVec2,
    /// Linear base colour: product of factor, vertex colour and, if enabled, texture.
    pub albedo: DVec3,
    /// Opacity: product of the same three factors.
    pub alpha: f64,
    /// The front face is hit.
    pub front: bool,
}

/// A pixel of [`picture`].
#[derive(Debug, Clone, Copy)]
pub struct Pixel {
    /// The first hit.
    pub hit: Option<Hit>,
    /// Silhouette or crease: one of the eight neighbours sees another object, another normal, another depth, or nothing
    /// where this pixel has a hit. Comparisons skip such pixels.
    pub edge: bool,
}

/// A ray with its valid interval.
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    /// Origin.
    pub origin: DVec3,
    /// Unit direction.
    pub direction: DVec3,
    /// Smallest distance of a hit.
    pub nearest: f64,
    /// Largest distance of a hit.
    pub farthest: f64,
}

impl Ray {
    /// A ray without limits; `direction` is normalised.
    pub fn new(origin: DVec3, direction: DVec3) -> Self {
        Self { origin, direction: direction.normalize(), nearest: 0.0, farthest: f64::INFINITY }
    }
}

/// The ray through a point of the picture: pixel (0, 0) is at the top left, its centre at (0.5, 0.5).
pub fn camera_ray(camera: &Camera, width: u32, height: u32, x: f64, y: f64) -> Ray {
    let frame = camera.world_from_camera;
    let (width, height) = (f64::from(width), f64::from(height));
    let right = 2.0 * x / width - 1.0;
    let up = 1.0 - 2.0 * y / height;
    let aspect = width / height;
    match camera.projection {
        Projection::Perspective { fov_y, near } => {
            let tan = (0.5 * fov_y).tan();
            let local = DVec3::new(right * aspect * tan, up * tan, -1.0);
            // `near` is a depth along the axis; the distance along an oblique ray is larger.
            let nearest = near.unwrap_or(0.0) * local.length();
            Ray { nearest, ..Ray::new(frame.translation, frame.matrix3 * local) }
        }
        Projection::Orthographic { half_height, near, far } => {
            let local = DVec3::new(right * aspect * half_height, up * half_height, 0.0);
            let origin = frame.translation + frame.matrix3 * local;
            Ray { nearest: near, farthest: far, ..Ray::new(origin, frame.matrix3 * DVec3::NEG_Z) }
        }
    }
}

/// The first hit at every pixel centre, rows from the top.
pub fn picture(scene: &Scene, camera: &Camera, width: u32, height: u32, options: Options) -> Vec<Pixel> {
    let world = World::new(scene, options);
    // One more pixel on each side, so that border pixels have eight neighbours, too.
    let stride = width as usize + 2;
    let hits: Vec<Option<Hit>> = (0..stride * (height as usize + 2))
        .into_par_iter()
        .map(|i| {
            let (x, y) = ((i % stride) as f64 - 0.5, (i / stride) as f64 - 0.5);
            world.closest(&camera_ray(camera, width, height, x, y))
        })
        .collect();
    let mut pixels = Vec::with_capacity(width as usize * height as usize);
    for y in 1..=height as usize {
        for x in 1..=width as usize {
            let hit = hits[y * stride + x];
            let edge = (y - 1..=y + 1).any(|v| (x - 1..=x + 1).any(|u| differ(&hit, &hits[v * stride + u])));
            pixels.push(Pixel { hit, edge });
        }
    }
    pixels
}

/// Whether two neighbouring pixels see different surfaces.
fn differ(a: &Option<Hit>, b: &Option<Hit>) -> bool {
    match (a, b) {
        (None, None) => false,
        (Some(a), Some(b)) => {
            a.instance != b.instance
                || a.front != b.front
                || a.geometric_normal.dot(b.geometric_normal) < 0.9
                // Distance from the plane of the face: detects jumps in depth, and tolerates steep depth at grazing
                // angles.
                || a.geometric_normal.dot(b.position - a.position).abs() > 0.01 * a.distance
        }
        _ => true,
    }
}

/// A triangle in world space, its vertices counter-clockwise seen from the front.
struct WorldTriangle {
    p: [DVec3; 3],
    instance: u32,
    index: u32,
}

struct RaycastNode {
    min: DVec3,
    max: DVec3,
    /// Leaf: first triangle and count. Inner node: index of the second child and zero (the first child follows its
    /// parent).
    first: u32,
    count: u32,
}

/// Normal transform of an instance.
struct InstanceFrame {
    /// Inverse transpose of the linear part of the transform.
    normal: DMat3,
    mirrored: bool,
}

/// A scene with its BVH.
pub struct World<'a> {
    scene: &'a Scene,
    options: Options,
    frames: Vec<InstanceFrame>,
    triangles: Vec<WorldTriangle>,
    nodes: Vec<RaycastNode>,
}

/// Result of the triangle test: distance, and weights of the world triangle's vertices.
#[derive(Clone, Copy)]
struct TriangleHit {
    distance: f64,
    weights: [f64; 3],
    triangle: usize,
}

impl<'a> World<'a> {
    /// Transforms every triangle to world space and builds the BVH.
    pub fn new(scene: &'a Scene, options: Options) -> Self {
        let mut frames = Vec::new();
        let mut triangles = Vec::new();
        for (i, instance) in scene.instances.iter().enumerate() {
            let mesh = &scene.meshes[instance.mesh];
            let linear = instance.world_from_object.matrix3;
            let mirrored = linear.determinant() < 0.0;
            // The cofactor matrix is the inverse transpose times the determinant, and exists for singular transforms,
            // too.
            let normal = DMat3::from_cols(
                linear.y_axis.cross(linear.z_axis),
                linear.z_axis.cross(linear.x_axis),
                linear.x_axis.cross(linear.y_axis),
            );
            frames.push(InstanceFrame { normal: if mirrored { normal * -1.0 } else { normal }, mirrored });
            if !options.blend && scene.materials[mesh.material].alpha_mode == AlphaMode::Blend {
                continue;
            }
            for (t, corners) in mesh.indices.chunks_exact(3).enumerate() {
                let [a, b, c] = [corners[0], corners[1], corners[2]].map(|v| {
                    let p = DVec3::from(mesh.positions[v as usize].map(f64::from));
                    linear * p + instance.world_from_object.translation
                });
                let p = if mirrored { [a, c, b] } else { [a, b, c] };
                triangles.push(WorldTriangle { p, instance: i as u32, index: t as u32 });
            }
        }
        let mut world = Self { scene, options, frames, triangles: Vec::new(), nodes: Vec::new() };
        let all = triangles.len();
        if all > 0 {
            world.split(&mut triangles, 0, all);
        }
        world.triangles = triangles;
        world
    }

    /// Builds the BVH over `triangles[begin..end]`, split at the median centroid of the widest axis.
    fn split(&mut self, triangles: &mut [WorldTriangle], begin: usize, end: usize) {
        let part = &mut triangles[begin..end];
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in part.iter().flat_map(|t| t.p) {
            (min, max) = (min.min(p), max.max(p));
        }
        // The slab test rounds: a wider box may cost a visit, a narrower one may lose a hit.
        let slack = (min.abs().max(max.abs())).max_element() * 1e-14;
        let node = self.nodes.len();
        self.nodes.push(RaycastNode {
            min: min - slack,
            max: max + slack,
            first: begin as u32,
            count: part.len() as u32,
        });
        if part.len() <= 4 {
            return;
        }
        let size = max - min;
        let axis = if size.x >= size.y && size.x >= size.z { 0 } else { 1 + usize::from(size.z > size.y) };
        let middle = part.len() / 2;
        let key = |t: &WorldTriangle| t.p[0][axis] + t.p[1][axis] + t.p[2][axis];
        part.select_nth_unstable_by(middle, |s, t| key(s).total_cmp(&key(t)));
        self.split(triangles, begin, begin + middle);
        self.nodes[node].first = self.nodes.len() as u32;
        self.nodes[node].count = 0;
        self.split(triangles, begin + middle, end);
    }

    /// The first hit along the ray.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        let shear = Shear::new(ray);
        let inverse = ray.direction.recip();
        let mut best: Option<(TriangleHit, Hit)> = None;
        let mut stack = if self.nodes.is_empty() { vec![] } else { vec![0_usize] };
        while let Some(i) = stack.pop() {
            let node = &self.nodes[i];
            let limit = best.map_or(ray.farthest, |b| b.0.distance);
            if !crosses(node, ray, inverse, limit) {
                continue;
            }
            if node.count == 0 {
                stack.extend([node.first as usize, i + 1]);
                continue;
            }
            for t in node.first as usize..(node.first + node.count) as usize {
                let Some((distance, weights)) = shear.triangle(ray, &self.triangles[t].p) else { continue };
                let limit = best.map_or(ray.farthest, |b| b.0.distance);
                if distance < ray.nearest || distance <= 0.0 || distance > limit {
                    continue;
                }
                // Ties in distance: the triangle that is first in the scene wins, independent of the order of the BVH.
                let order = |t: usize| (self.triangles[t].instance, self.triangles[t].index);
                if best.is_some_and(|b| b.0.distance == distance && order(b.0.triangle) < order(t)) {
                    continue;
                }
                let candidate = TriangleHit { distance, weights, triangle: t };
                if let Some(hit) = self.surface(ray, &candidate) {
                    best = Some((candidate, hit));
                }
            }
        }
        best.map(|b| b.1)
    }

    /// The complete hit of a candidate; `None` if its material is culled from this side or fails the alpha test at
    /// this point.
    fn surface(&self, ray: &Ray, candidate: &TriangleHit) -> Option<Hit> {
        let triangle = &self.triangles[candidate.triangle];
        let instance = triangle.instance as usize;
        let frame = &self.frames[instance];
        let mesh = &self.scene.meshes[self.scene.instances[instance].mesh];
        let material = &self.scene.materials[mesh.material];

        let [a, b, c] = triangle.p;
        let outward = (b - a).cross(c - a).normalize();
        let front = outward.dot(ray.direction) < 0.0;
        if !front && !material.double_sided {
            return None;
        }
        let [wa, wb, wc] = candidate.weights;
        let barycentric = if frame.mirrored { [wa, wc, wb] } else { [wa, wb, wc] };
        let corner = |k: usize| mesh.indices[triangle.index as usize * 3 + k] as usize;
        let uv = |set: usize| {
            (0..3).fold(DVec2::ZERO, |sum, k| {
                let uv = mesh.uvs[set].get(corner(k)).map_or(DVec2::ZERO, |uv| DVec2::from(uv.map(f64::from)));
                sum + uv * barycentric[k]
            })
        };
        let normal = (0..3)
            .fold(DVec3::ZERO, |sum, k| sum + DVec3::from(mesh.normals[corner(k)].map(f64::from)) * barycentric[k]);
        let shading = (frame.normal * normal).normalize();

        let mut color = material.base_color.map(f64::from);
        if !mesh.colors.is_empty() {
            for (channel, value) in color.iter_mut().enumerate() {
                *value *= (0..3).map(|k| f64::from(mesh.colors[corner(k)][channel]) * barycentric[k]).sum::<f64>();
            }
        }
        if let Some(texture) = material.base_color_texture.filter(|_| self.options.textures) {
            let [texel, ..] = texel(self.scene, &texture, uv(texture.uv_set as usize), Meaning::Color);
            for (value, texel) in color.iter_mut().zip(texel) {
                *value *= texel;
            }
        }
        let [red, green, blue, alpha] = color;
        if matches!(material.alpha_mode, AlphaMode::Mask(cutoff) if alpha < f64::from(cutoff)) {
            return None;
        }
        let turn = if front { 1.0 } else { -1.0 };
        Some(Hit {
            position: a * wa + b * wb + c * wc,
            distance: candidate.distance,
            geometric_normal: outward * turn,
            shading_normal: shading * turn,
            material: mesh.material,
            instance,
            triangle: triangle.index as usize,
            barycentric,
            uv: uv(0),
            albedo: DVec3::new(red, green, blue),
            alpha: if material.alpha_mode == AlphaMode::Opaque { 1.0 } else { alpha },
            front,
        })
    }
}

/// Level 0 of a texture at a coordinate, bilinear, or nearest if the sampler requests it: the value, and the least and
/// greatest of the texels that it is made of. Colours are linearised before filtering.
pub fn texel(scene: &Scene, texture: &TextureRef, uv: DVec2, meaning: Meaning) -> [[f64; 4]; 3] {
    let image = &scene.images[texture.image];
    let DVec2 { x, y } = texel_place(scene, texture, uv);
    let texel = |x: f64, y: f64| {
        let x = wrap(x, image.width, texture.sampler.wrap_u);
        let y = wrap(y, image.height, texture.sampler.wrap_v);
        let at = (y * image.width as usize + x) * 4;
        let [r, g, b, a] = [0, 1, 2, 3].map(|c| f64::from(image.rgba[at + c]) / 255.0);
        if meaning == Meaning::Color { [linear(r), linear(g), linear(b), a] } else { [r, g, b, a] }
    };
    if texture.sampler.mag_nearest {
        return [texel(x.floor(), y.floor()); 3];
    }
    let (x0, y0) = ((x - 0.5).floor(), (y - 0.5).floor());
    let (fx, fy) = (x - 0.5 - x0, y - 0.5 - y0);
    let [mut sum, mut least, mut most] = [[0.0; 4], [f64::INFINITY; 4], [f64::NEG_INFINITY; 4]];
    for (dx, dy, weight) in [
        (0.0, 0.0, (1.0 - fx) * (1.0 - fy)),
        (1.0, 0.0, fx * (1.0 - fy)),
        (0.0, 1.0, (1.0 - fx) * fy),
        (1.0, 1.0, fx * fy),
    ] {
        for (channel, texel) in texel(x0 + dx, y0 + dy).into_iter().enumerate() {
            sum[channel] += weight * texel;
            (least[channel], most[channel]) = (least[channel].min(texel), most[channel].max(texel));
        }
    }
    [sum, least, most]
}

/// The place of a coordinate in an image, in texels from the upper left corner.
pub fn texel_place(scene: &Scene, texture: &TextureRef, uv: DVec2) -> DVec2 {
    let image = &scene.images[texture.image];
    let m = texture.uv_transform;
    (m.matrix2.as_dmat2() * uv + m.translation.as_dvec2()) * DVec2::new(image.width.into(), image.height.into())
}

fn wrap(index: f64, size: u32, wrap: Wrap) -> usize {
    let (i, n) = (index as i64, i64::from(size));
    let wrapped = match wrap {
        Wrap::Repeat => i.rem_euclid(n),
        Wrap::Clamp => i.clamp(0, n - 1),
        Wrap::Mirror => {
            let i = i.rem_euclid(2 * n);
            i.min(2 * n - 1 - i)
        }
    };
    wrapped as usize
}

fn linear(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

fn crosses(node: &RaycastNode, ray: &Ray, inverse: DVec3, limit: f64) -> bool {
    let (mut enter, mut leave) = (0.0_f64, limit);
    for axis in 0..3 {
        let a = (node.min[axis] - ray.origin[axis]) * inverse[axis];
        let b = (node.max[axis] - ray.origin[axis]) * inverse[axis];
        // A ray inside the plane of a slab gives 0 · ∞; `min` and `max` of f64 then keep the other operand.
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    enter <= leave * (1.0 + 1e-14)
}

/// Sheared frame of the watertight test: the ray becomes the unit z axis.
struct Shear {
    kx: usize,
    ky: usize,
    kz: usize,
    sx: f64,
    sy: f64,
    sz: f64,
}

impl Shear {
    fn new(ray: &Ray) -> Self {
        let d = ray.direction;
        let size = d.abs();
        let kz = if size.x >= size.y && size.x >= size.z { 0 } else { 1 + usize::from(size.z > size.y) };
        let (kx, ky) = ((kz + 1) % 3, (kz + 2) % 3);
        Self { kx, ky, kz, sx: d[kx] / d[kz], sy: d[ky] / d[kz], sz: 1.0 / d[kz] }
    }

    /// Distance along the ray and weights of the three vertices, for hits from either side.
    fn triangle(&self, ray: &Ray, p: &[DVec3; 3]) -> Option<(f64, [f64; 3])> {
        let [a, b, c] = p.map(|p| {
            let p = p - ray.origin;
            DVec3::new(p[self.kx] - self.sx * p[self.kz], p[self.ky] - self.sy * p[self.kz], p[self.kz] * self.sz)
        });
        // Each edge function is the exact negative of the neighbour's for the same edge.
        let u = c.x * b.y - c.y * b.x;
        let v = a.x * c.y - a.y * c.x;
        let w = b.x * a.y - b.y * a.x;
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let det = u + v + w;
        if det == 0.0 {
            return None;
        }
        let weights = [u / det, v / det, w / det];
        Some((weights[0] * a.z + weights[1] * b.z + weights[2] * c.z, weights))
    }
}
