//! Punctual and analytic area lights (lecture R3, R4; KHR_lights_punctual), in world space.
//!
//! Read KHR_lights_punctual, and pbrt 12 for lights with and without extent.

use glam::DVec3;

use super::Bounds;
use etalon_optics::spectra::Emission;

/// A punctual light, or an analytic area light if it has an extent.
#[derive(Debug, Clone)]
pub struct Light {
    /// Name from the file.
    pub name: String,
    /// Linear Rec. 709 colour times strength: radiant intensity I (cd) for point and spot lights,
    /// perpendicular irradiance E (lx) for directional ones. Never negative.
    pub color: [f32; 3],
    /// Spectrum, whose colour `color` then is; `None`: the spectrum of D65 filtered to `color`.
    pub spectrum: Option<Emission>,
    /// Shape of an analytic area light (knob `lights`). `color` is then the intensity along the axis, or of the whole
    /// sphere.
    pub extent: Option<Extent>,
    /// Kind and geometry.
    pub kind: LightKind,
    /// Proxy light for an emissive surface, in study scenes only: it is black when emissive surfaces are lights
    /// themselves.
    pub proxy: bool,
}

impl Light {
    /// Whether the light has a colour above 0.
    #[must_use]
    pub fn shines(&self) -> bool {
        self.color != [0.0; 3]
    }

    /// Whether the light reaches some part of a box; true for lights without a range.
    #[must_use]
    pub fn reaches(&self, bounds: &Bounds) -> bool {
        let (LightKind::Point { position, range } | LightKind::Spot { position, range, .. }) = self.kind else {
            return true;
        };
        let distance = (position - position.clamp(bounds.min, bounds.max)).length();
        // Margin for the device: its distances have rounding errors of 1e-7 of the coordinates relative to the eye.
        range.is_none_or(|range| distance < range * (1.0 + 1e-3))
    }
}

/// A directional light that is added to a scene: where it comes from, and how strong it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KeyLight {
    /// Direction that it comes from, in degrees about +Y: 0 is +Z, the front of a glTF model; 90 is +X.
    pub azimuth: f64,
    /// Height above the horizon in degrees.
    pub elevation: f64,
    /// Irradiance of a surface that faces it, in lux.
    pub lux: f32,
}

impl KeyLight {
    /// The light; its colour is white.
    #[must_use]
    pub fn light(self) -> Light {
        let [(sin_a, cos_a), (sin_e, cos_e)] =
            [self.azimuth, self.elevation].map(|degrees| degrees.to_radians().sin_cos());
        let direction = -DVec3::new(sin_a * cos_e, sin_e, cos_a * cos_e);
        Light {
            name: "key light".to_owned(),
            color: [self.lux; 3],
            spectrum: None,
            extent: None,
            kind: LightKind::Directional { direction },
            proxy: false,
        }
    }
}

/// Shape of an analytic area light. It emits diffusely, with the same radiance at every point and in every direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Extent {
    /// A sphere around a point light.
    Sphere {
        /// Radius in metres.
        radius: f64,
    },
    /// A disk around a spot light, perpendicular to the axis.
    Disk {
        /// Radius in metres.
        radius: f64,
    },
    /// A rectangle around a spot light, perpendicular to the axis.
    Rectangle {
        /// Half of the first side, as a vector in metres.
        across: DVec3,
        /// Half the length of the second side in metres, perpendicular to the first side and to the axis.
        half_height: f64,
    },
}

/// Kind and geometry of a light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightKind {
    /// Parallel rays that travel along `direction` (unit, away from the light).
    Directional {
        /// Unit direction in which the light travels.
        direction: DVec3,
    },
    /// Emits into all directions from one position.
    Point {
        /// Position in metres.
        position: DVec3,
        /// Distance beyond which the light is cut off smoothly (KHR_lights_punctual), if any.
        range: Option<f64>,
    },
    /// Emits into a cone around `direction` from one position.
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
