//! Triangles at the pixels of a picture, looked up on the host: the layers of edges and of texture coordinates.

use std::sync::Arc;

use glam::{DAffine3, DVec2, DVec3, Vec3};
use rayon::prelude::*;

use etalon::scene::{Camera, Projection, Scene};
use etalon::transport::events::EventTracer;
use etalon::transport::surface_point::SurfacePoint;

/// What the triangle at a pixel tells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriangleFacts {
    /// Distance of the pixel's centre to the nearest edge of its triangle, in pixels.
    pub edge: f32,
    /// Texture coordinates of the first set, if the mesh has them.
    pub uv: Option<[f32; 2]>,
}

/// Triangles at the pixel centres of a picture.
#[derive(Clone)]
pub struct PixelTriangles {
    /// Row by row; `None` where no surface is seen.
    pub pixels: Arc<Vec<Option<TriangleFacts>>>,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Versions of the pictures that they were looked up with.
    pub versions: [Option<u64>; 2],
}

/// Looks up the triangle at each pixel of `camera`'s picture: one ray per pixel through the scene's BVH.
#[must_use]
pub fn triangles(tracer: &EventTracer, scene: &Scene, camera: &Camera, size: [u32; 2]) -> Vec<Option<TriangleFacts>> {
    let camera_from_world = camera.world_from_camera.inverse();
    let facts = |index: u32| {
        let pixel = [index % size[0], index / size[0]];
        let seen = tracer.point_at(scene, camera, size, pixel)?;
        Some(facts_of(scene, &camera_from_world, camera.projection, size, pixel, seen))
    };
    (0..size[0] * size[1]).into_par_iter().map(facts).collect()
}

fn facts_of(
    scene: &Scene,
    camera_from_world: &DAffine3,
    projection: Projection,
    size: [u32; 2],
    pixel: [u32; 2],
    seen: SurfacePoint,
) -> TriangleFacts {
    let instance = &scene.instances[seen.instance];
    let mesh = &scene.meshes[instance.mesh];
    let corners: [usize; 3] = std::array::from_fn(|i| mesh.indices[3 * seen.primitive + i] as usize);
    let uv = (!mesh.uvs[0].is_empty()).then(|| {
        let [u, v] = seen.uv.map(|x| x as f32);
        let [a, b, c] = corners.map(|i| mesh.uvs[0][i]);
        [0, 1].map(|axis| (1.0 - u - v) * a[axis] + u * b[axis] + v * c[axis])
    });
    let seen_corners = corners.map(|i| {
        let p_world = instance.world_from_object.transform_point3(Vec3::from(mesh.positions[i]).as_dvec3());
        camera_from_world.transform_point3(p_world)
    });
    let at = DVec2::new(f64::from(pixel[0]) + 0.5, f64::from(pixel[1]) + 0.5);
    let edges = [[0, 1], [1, 2], [2, 0]].map(|[a, b]| {
        let ends = before_the_eye(projection, [seen_corners[a], seen_corners[b]]);
        ends.map_or(f64::INFINITY, |ends| to_segment(at, ends.map(|p| on_picture(projection, size, p))))
    });
    TriangleFacts { edge: edges.into_iter().fold(f64::INFINITY, f64::min) as f32, uv }
}

/// The part of a line in camera space that lies before the eye.
fn before_the_eye(projection: Projection, [a, b]: [DVec3; 2]) -> Option<[DVec3; 2]> {
    if matches!(projection, Projection::Orthographic { .. }) {
        return Some([a, b]);
    }
    // A thousandth of the distance of the farther end.
    let near = -1e-3 * a.z.abs().max(b.z.abs());
    if a.z > near && b.z > near {
        return None;
    }
    let cut = |a: DVec3, b: DVec3| a.lerp(b, (near - a.z) / (b.z - a.z));
    Some([if a.z > near { cut(a, b) } else { a }, if b.z > near { cut(b, a) } else { b }])
}

/// Place of a point in camera space on a picture, in pixels from its upper left corner.
fn on_picture(projection: Projection, size: [u32; 2], p: DVec3) -> DVec2 {
    let [width, height] = size.map(f64::from);
    let half = match projection {
        Projection::Perspective { fov_y, .. } => (0.5 * fov_y).tan() * -p.z,
        Projection::Orthographic { half_height, .. } => half_height,
    };
    DVec2::new(p.x / (half * width / height) * 0.5 + 0.5, -p.y / half * 0.5 + 0.5) * DVec2::new(width, height)
}

/// The part of a line in world space before the eye, on a picture of `size` pixels; `None` where it is behind the eye.
#[must_use]
pub fn on_picture_of(camera: &Camera, size: [u32; 2], ends: [DVec3; 2]) -> Option<[DVec2; 2]> {
    let camera_from_world = camera.world_from_camera.inverse();
    let ends = ends.map(|p| camera_from_world.transform_point3(p));
    let ends = before_the_eye(camera.projection, ends)?;
    Some(ends.map(|p| on_picture(camera.projection, size, p)))
}

/// Distance of a point to a segment.
fn to_segment(p: DVec2, [a, b]: [DVec2; 2]) -> f64 {
    let along = b - a;
    let t = ((p - a).dot(along) / along.length_squared().max(1e-30)).clamp(0.0, 1.0);
    p.distance(a + along * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_meet_the_pixels_that_they_are_seen_in() {
        let camera = Camera::looking_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 90_f64.to_radians()).expect("a camera");
        // 45 degrees up, and twice as far to the right because of the 2:1 aspect ratio.
        let seen = on_picture_of(&camera, [200, 100], [DVec3::new(0.0, 0.0, -5.0), DVec3::new(4.0, 2.0, -2.0)]);
        let [a, b] = seen.expect("before the eye");
        assert!(a.distance(DVec2::new(100.0, 50.0)) < 1e-9 && b.distance(DVec2::new(200.0, 0.0)) < 1e-9, "{a} {b}");
        assert!(on_picture_of(&camera, [200, 100], [DVec3::Z, DVec3::new(1.0, 1.0, 4.0)]).is_none());
        let towards = [DVec3::new(0.0, 0.0, 3.0), DVec3::new(0.0, 0.0, -3.0)];
        let [a, b] = on_picture_of(&camera, [200, 100], towards).expect("cut");
        assert!(a.distance(b) < 1e-9, "towards the eye it is one point: {a} {b}");
    }

    #[test]
    fn edges_are_where_the_corners_are_seen() {
        let scene = etalon::study::load("cornell").expect("a scene");
        let original: etalon::prepare::Original = scene.into();
        let scene = original.scene();
        let tracer = EventTracer::new(scene, original.bvh().expect("a BVH"));
        let size = [96, 54];
        let found = triangles(&tracer, scene, &scene.cameras[0], size);
        // Two triangles make a wall: its diagonal and its sides are edges, and most pixels are none.
        let on_edges = found.iter().flatten().filter(|facts| facts.edge < 0.7).count();
        let seen = found.iter().flatten().count();
        assert!(seen > 2000 && on_edges > 200 && 2 * on_edges < seen, "{on_edges} of {seen}");
    }
}
