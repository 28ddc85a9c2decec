//! Cameras: where the picture is taken from (product.md "Conventions").

use glam::DAffine3;

/// A camera in the world. It looks along −Z of its frame; +X is right and +Y up in the picture.
#[derive(Debug, Clone)]
pub struct Camera {
    /// Name from the file, or what made it.
    pub name: String,
    /// Rigid placement: orthonormal axes and the eye as translation.
    pub world_from_camera: DAffine3,
    /// How directions become pixels.
    pub projection: Projection,
}

/// The two projections of glTF 2.0 section 3.10.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// Pinhole: vertical field of view in radians, in (0, π); `aspect` (width / height) is the file's wish and is
    /// ignored where the output has its own; `near` in metres when the file names it.
    Perspective {
        /// Vertical field of view in radians.
        fov_y: f64,
        /// Near distance in metres, where the file gives one.
        near: Option<f64>,
    },
    /// Parallel rays: half the height of the picture in metres; `near` and `far` along the view direction.
    Orthographic {
        /// Half the picture's height in metres (glTF `ymag`).
        half_height: f64,
        /// Near distance in metres.
        near: f64,
        /// Far distance in metres.
        far: f64,
    },
}
