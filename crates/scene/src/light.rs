//! Punctual lights (lecture R3, R4; KHR_lights_punctual), in world space.

use glam::DVec3;

use super::Bounds;
use etalon_optics::spectra::Emission;

/// A light without extent.
#[derive(Debug, Clone)]
pub struct Light {
    /// Name from the file.
    pub name: String,
    /// Linear Rec. 709 colour times strength: radiant intensity I (cd) for point and spot lights,
    /// perpendicular irradiance E (lx) for directional ones. Never negative.
    pub color: [f32; 3],
    /// Its light by wavelength, whose colour `color` is then; `None`: that of D65 behind a coloured glass.
    pub spectrum: Option<Emission>,
    /// Its shape, where it has one (knob `lights`); its colour is then the intensity along its axis, or of the whole of a ball.
    pub extent: Option<Extent>,
    /// What kind, with its geometry.
    pub kind: LightKind,
    /// Stands for a surface that emits, where such surfaces light nothing: where they do, it is dark. In study scenes; no file says it.
    pub proxy: bool,
}

impl Light {
    /// Whether any light comes from it.
    #[must_use]
    pub fn shines(&self) -> bool {
        self.color != [0.0; 3]
    }

    /// Whether some of it reaches a box; true where its range leaves that open.
    #[must_use]
    pub fn reaches(&self, bounds: &Bounds) -> bool {
        let (LightKind::Point { position, range } | LightKind::Spot { position, range, .. }) = self.kind else {
            return true;
        };
        let distance = (position - position.clamp(bounds.min, bounds.max)).length();
        // Distances on the device have roundings, of 1e-7 of the coordinates about the eye.
        range.is_none_or(|range| distance < range * (1.0 + 1e-3))
    }
}

/// Shape of a light that shines as evenly as paper: the same radiance from every place in every direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Extent {
    /// A ball about a point light.
    Sphere {
        /// Metres.
        radius: f64,
    },
    /// A round face about a spot light, which looks along its axis.
    Disk {
        /// Metres.
        radius: f64,
    },
    /// A rectangular one.
    Rectangle {
        /// Half of its first side, metres.
        across: DVec3,
        /// Half the length of its second, which is at right angles to the first and to the axis.
        half_height: f64,
    },
}

/// Geometry of a light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightKind {
    /// Parallel rays that travel along `direction` (unit, away from the light).
    Directional {
        /// Unit direction in which the light travels.
        direction: DVec3,
    },
    /// All directions from one position.
    Point {
        /// Position in metres.
        position: DVec3,
        /// Distance beyond which the light is cut off smoothly (KHR_lights_punctual), if any.
        range: Option<f64>,
    },
    /// A cone from one position along `direction`.
    Spot {
        /// Position in metres.
        position: DVec3,
        /// Unit axis of the cone, away from the light.
        direction: DVec3,
        /// Distance beyond which the light is cut off smoothly, if any.
        range: Option<f64>,
        /// Half angle in radians inside which the light has full strength.
        inner: f64,
        /// Half angle in radians outside which there is none; `inner < outer <= π/2`.
        outer: f64,
    },
}
