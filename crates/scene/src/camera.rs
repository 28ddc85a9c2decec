//! Cameras: position, orientation and projection.
//!
//! Read glTF 2.0 section 3.10 and README, "Conventions". The camera looks along −Z.

use glam::{DAffine3, DMat3, DVec3};

/// A camera in the world. It looks along −Z of its frame; +X is to the right and +Y is up in the picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Name from the file, or of the generator.
    pub name: String,
    /// Rigid transform: orthonormal axes, and the eye as translation.
    pub world_from_camera: DAffine3,
    /// Perspective or orthographic projection.
    pub projection: Projection,
}

/// The two projections of glTF 2.0 section 3.10.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// Pinhole camera. glTF's `aspectRatio` is not stored: the output size gives the aspect ratio.
    Perspective {
        /// Vertical field of view in radians, in (0, π).
        fov_y: f64,
        /// Near distance in metres, if the file gives one.
        near: Option<f64>,
    },
    /// Parallel rays, with near and far distances along the view direction.
    Orthographic {
        /// Half the picture's height in metres (glTF `ymag`).
        half_height: f64,
        /// Near distance in metres.
        near: f64,
        /// Far distance in metres.
        far: f64,
    },
}

/// Default vertical field of view in radians (40°).
pub const DEFAULT_FOV_Y: f64 = 0.698_131_700_797_731_8;

/// Errors of [`Camera::looking_at`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CameraError {
    /// The target equals the eye.
    NoDirection,
    /// The up direction is zero or parallel to the view direction.
    NoUp,
    /// An argument is NaN or infinite.
    NotFinite,
}

impl std::fmt::Display for CameraError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::NoDirection => "the target equals the eye, so there is no direction to look in",
            Self::NoUp => "the up direction is zero or parallel to the view",
            Self::NotFinite => "a coordinate is not a finite number",
        })
    }
}

impl std::error::Error for CameraError {}

impl Camera {
    /// A perspective camera at `eye` that looks at `target` with `up` upwards in the picture; `fov_y` in radians.
    ///
    /// # Errors
    /// The arguments are not finite, or do not define a frame.
    pub fn looking_at(eye: DVec3, target: DVec3, up: DVec3, fov_y: f64) -> Result<Self, CameraError> {
        if !(eye.is_finite() && target.is_finite() && up.is_finite() && fov_y.is_finite()) {
            return Err(CameraError::NotFinite);
        }
        let forward = (target - eye).try_normalize().ok_or(CameraError::NoDirection)?;
        let up = up.try_normalize().ok_or(CameraError::NoUp)?;
        let right = forward.cross(up);
        // Closer than a ten-thousandth of a degree to parallel, the roll of the picture would be rounding noise.
        if right.length() < 1e-6 {
            return Err(CameraError::NoUp);
        }
        let right = right.normalize();
        let frame = DMat3::from_cols(right, right.cross(forward), -forward);
        Ok(Self {
            name: "eye and target".to_owned(),
            world_from_camera: DAffine3::from_mat3_translation(frame, eye),
            projection: Projection::Perspective { fov_y, near: None },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impossible_cameras_are_errors() {
        let at = |eye, target, up| Camera::looking_at(eye, target, up, 0.7).unwrap_err();
        assert_eq!(at(DVec3::ONE, DVec3::ONE, DVec3::Y), CameraError::NoDirection);
        assert_eq!(at(DVec3::ZERO, DVec3::Y, DVec3::Y), CameraError::NoUp);
        assert_eq!(at(DVec3::ZERO, DVec3::X, DVec3::ZERO), CameraError::NoUp);
        assert_eq!(at(DVec3::NAN, DVec3::X, DVec3::Y), CameraError::NotFinite);
    }

    #[test]
    fn looking_down_z_is_the_identity() {
        let camera = Camera::looking_at(DVec3::ZERO, -DVec3::Z, DVec3::Y, 0.7).unwrap();
        assert!(camera.world_from_camera.abs_diff_eq(DAffine3::IDENTITY, 1e-15));
    }
}
