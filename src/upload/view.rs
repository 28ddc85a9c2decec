//! Camera transforms for the device: camera-relative coordinates, reversed depth, one sub-pixel offset per sample.
//!
//! Read Real-Time Rendering (4th ed.), chapter 4 (projections, reversed depth), and docs/numerics.md for the roundings.

use glam::{DVec2, DVec3};

use crate::scene::{Bounds, Camera, Projection};
use crate::share;

/// Basis and projection of a camera for a picture of a given size, in f64.
#[derive(Debug, Clone, Copy)]
pub struct View {
    /// The eye in world space, metres.
    pub eye: DVec3,
    /// Unit axes of the camera in world space: right, up, and the viewing direction.
    pub axes: [DVec3; 3],
    /// Half the picture's width and height: at depth 1 (perspective) or anywhere (orthographic).
    pub half: DVec2,
    near: f64,
    far: f64,
    orthographic: bool,
    size: [u32; 2],
}

impl View {
    /// The view of `camera`; `bounds` decides the near distance where the camera leaves it open.
    #[must_use]
    pub fn new(camera: &Camera, size: [u32; 2], bounds: Option<Bounds>) -> Self {
        let axes = camera.world_from_camera.matrix3;
        let eye = camera.world_from_camera.translation;
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        let (half_height, near, far, orthographic) = match camera.projection {
            Projection::Perspective { fov_y, near } => {
                let half = (fov_y * 0.5).tan();
                // A corner's ray is this much longer than its depth.
                let slant = DVec3::new(half * aspect, half, 1.0).length();
                (half, near.unwrap_or_else(|| near_distance(eye, bounds) / slant), f64::INFINITY, false)
            }
            Projection::Orthographic { half_height, near, far } => (half_height, near, far, true),
        };
        Self {
            eye,
            axes: [axes.x_axis, axes.y_axis, -axes.z_axis],
            half: DVec2::new(half_height * aspect, half_height),
            near,
            far,
            orthographic,
            size,
        }
    }

    /// Width of a pixel at distance 1, or at any distance for an orthographic camera.
    #[must_use]
    pub fn pixel_angle(&self) -> f64 {
        2.0 * self.half.y / f64::from(self.size[1])
    }

    /// Largest distance between a surface and its point reconstructed from depth, on a device that snaps vertices by up
    /// to `pixels` pixels before it interpolates depth: in metres, and relative to the point's largest coordinate.
    ///
    /// Depth d is linear on the screen. With vertices snapped by up to s pixels, a pixel at x has d(x − δ), |δ| ≤ s.
    /// This is the depth of a surface point at most s pixels away, which bounds the distance.
    #[must_use]
    pub fn snap(&self, pixels: f64) -> [f64; 2] {
        let off = pixels * self.pixel_angle();
        // The distance of a point is at most √3 of its largest coordinate.
        if self.orthographic { [off, 0.0] } else { [0.0, 3.0_f64.sqrt() * off] }
    }

    /// The camera block of the shaders, for a sample `jitter` pixels off the pixel centres.
    #[must_use]
    pub fn shared(&self, jitter: DVec2) -> share::Camera {
        let [right, up, forward] = self.axes;
        // Rows of clip_from_rel. In Vulkan's clip space y points down. A sample at +j pixels moves the world by −j
        // pixels.
        let shift = -2.0 * jitter / DVec2::new(f64::from(self.size[0]), f64::from(self.size[1]));
        let (w, w0) = if self.orthographic { (DVec3::ZERO, 1.0) } else { (forward, 0.0) };
        let x = right / self.half.x + w * shift.x;
        let y = -up / self.half.y + w * shift.y;
        let (z, z0) = if self.orthographic {
            // 1 at near, 0 at far.
            let depth = self.far - self.near;
            (-forward / depth, self.far / depth)
        } else {
            (DVec3::ZERO, self.near)
        };
        let row = |v: DVec3, last: f64| [v.x as f32, v.y as f32, v.z as f32, last as f32];
        let rows = [row(x, w0 * shift.x), row(y, w0 * shift.y), row(z, z0), row(w, w0)];
        let mut clip_from_rel = [[0.0; 4]; 4];
        for (column, values) in clip_from_rel.iter_mut().enumerate() {
            for (value, row) in values.iter_mut().zip(&rows) {
                *value = row[column];
            }
        }
        share::Camera {
            clip_from_rel,
            right: (right * self.half.x).as_vec3().into(),
            near: self.near as f32,
            up: (up * self.half.y).as_vec3().into(),
            far: self.far as f32,
            forward: forward.as_vec3().into(),
            orthographic: u32::from(self.orthographic),
            jitter: jitter.as_vec2().into(),
            size: self.size,
            tiles: [0, 1],
        }
    }
}

/// A near distance that clips nothing of a scene seen from outside, and very little from inside. Reversed
/// floating-point depth has the same relative precision for every near distance (numerics.md 42), so a small one costs
/// nothing.
fn near_distance(eye: DVec3, bounds: Option<Bounds>) -> f64 {
    let Some(bounds) = bounds else { return 0.01 };
    let radius = bounds.radius().max(1e-6);
    let outside = (eye - eye.clamp(bounds.min, bounds.max)).length();
    (0.5 * outside).max(1e-5 * radius)
}

/// Sub-pixel offset in (−0.5, 0.5)² of sample `index` of `count`: the first two dimensions of Sobol's sequence, in the
/// middles of the squares of which each row and each column of `count` has one. So the mean of all is the pixel's
/// centre: edges do not move. (With the R2 sequence of Roberts 2018 four samples were 0.14 pixels beside it.) Box
/// reconstruction filter.
#[must_use]
pub fn jitter(index: u32, count: u32) -> DVec2 {
    let bits = count.next_power_of_two().ilog2();
    // The generator matrix of the second dimension is Pascal's triangle modulo 2: each column is the one before, XOR
    // itself shifted.
    let mut column = 1_u32 << 31;
    let mut y = 0;
    for bit in 0..bits {
        y ^= if index >> bit & 1 != 0 { column } else { 0 };
        column ^= column >> 1;
    }
    let squares = f64::from(count.next_power_of_two());
    let middle = |word: u32| f64::from(word) / 2_f64.powi(32) + 0.5 / squares - 0.5;
    DVec2::new(middle(index.reverse_bits()), middle(y))
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;

    fn project(camera: &share::Camera, p_rel: [f32; 3]) -> [f64; 3] {
        let p = [p_rel[0], p_rel[1], p_rel[2], 1.0];
        let clip: Vec<f64> =
            (0..4).map(|row| (0..4).map(|c| f64::from(camera.clip_from_rel[c][row]) * f64::from(p[c])).sum()).collect();
        [clip[0] / clip[3], clip[1] / clip[3], clip[2] / clip[3]]
    }

    fn camera(projection: Projection) -> Camera {
        Camera { name: String::new(), world_from_camera: DAffine3::IDENTITY, projection }
    }

    #[test]
    fn reversed_depth_is_one_at_near_and_falls_to_zero() {
        let view = View::new(&camera(Projection::Perspective { fov_y: 1.0, near: Some(0.1) }), [16, 9], None);
        let shared = view.shared(DVec2::ZERO);
        assert!((project(&shared, [0.0, 0.0, -0.1])[2] - 1.0).abs() < 1e-6);
        assert!((project(&shared, [0.0, 0.0, -100.0])[2] - 1e-3).abs() < 1e-9);
        let view =
            View::new(&camera(Projection::Orthographic { half_height: 1.0, near: 1.0, far: 3.0 }), [16, 9], None);
        let shared = view.shared(DVec2::ZERO);
        assert!((project(&shared, [0.0, 0.0, -1.0])[2] - 1.0).abs() < 1e-6);
        assert!(project(&shared, [0.0, 0.0, -3.0])[2].abs() < 1e-6);
    }

    #[test]
    fn up_is_up_and_the_field_of_view_is_vertical() {
        let fov_y = std::f64::consts::FRAC_PI_2;
        let view = View::new(&camera(Projection::Perspective { fov_y, near: Some(0.1) }), [200, 100], None);
        let shared = view.shared(DVec2::ZERO);
        let top = project(&shared, [0.0, 1.0, -1.0]);
        assert!((top[1] + 1.0).abs() < 1e-6, "the top edge is ndc y = -1: {top:?}");
        let right = project(&shared, [2.0, 0.0, -1.0]);
        assert!((right[0] - 1.0).abs() < 1e-6, "{right:?}");
    }

    #[test]
    fn jitter_moves_the_picture_against_the_sample() {
        for projection in [
            Projection::Perspective { fov_y: 1.0, near: Some(0.1) },
            Projection::Orthographic { half_height: 1.0, near: 0.1, far: 10.0 },
        ] {
            let view = View::new(&camera(projection), [100, 100], None);
            let centre = project(&view.shared(DVec2::ZERO), [0.1, 0.2, -2.0]);
            let moved = project(&view.shared(DVec2::new(0.25, -0.5)), [0.1, 0.2, -2.0]);
            assert!((moved[0] - centre[0] + 0.25 * 0.02).abs() < 1e-6);
            assert!((moved[1] - centre[1] - 0.5 * 0.02).abs() < 1e-6);
        }
    }

    #[test]
    fn jitters_fill_the_pixel_evenly() {
        for count in [1, 4, 16, 64, 256] {
            let all: Vec<_> = (0..count).map(|i| jitter(i, count)).collect();
            let mean = all.iter().sum::<DVec2>() / f64::from(count);
            assert!(mean.length() < 1e-12, "{count}: {mean}");
            for axis in 0..2 {
                let mut rows: Vec<_> = all.iter().map(|at| ((at[axis] + 0.5) * f64::from(count)) as u32).collect();
                rows.sort_unstable();
                assert!(rows.into_iter().eq(0..count), "{count}: one in each row and column");
            }
            // A quarter of the samples lies in each quarter of the pixel, at any time.
            for four in all.as_chunks::<4>().0 {
                let mut quarters = four.map(|at| (at.x > 0.0, at.y > 0.0));
                quarters.sort_unstable();
                assert!(quarters.windows(2).all(|pair| pair[0] != pair[1]), "{count}: {four:?}");
            }
        }
    }
}
