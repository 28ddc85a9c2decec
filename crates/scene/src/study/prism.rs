//! Study scene of dispersion (lecture F1): a slit and a white bar of light, seen through a prism of dense flint glass.
//!
//! Read pbrt 9.3. The index of refraction depends on the wavelength: the slit appears once in each colour, and the bar
//! has coloured edges.

use glam::{DAffine3, DMat3, DVec2, DVec3};

use super::build::{StudyBuilder, at, dielectric, emitter, facing, medium};
use super::shape::Shape;
use crate::substance::SF10;
use crate::{LightKind, Material, Scene};

/// Apex angle between the two refracting faces, in radians.
const APEX: f64 = std::f64::consts::FRAC_PI_4;
/// Distances from the prism to the eye and to the slit, in metres.
const TO_EYE: f64 = 1.2;
const TO_SLIT: f64 = 3.0;

pub(super) fn scene() -> Scene {
    let mut b = StudyBuilder::new("prism");
    // Minimum deviation at the Fraunhofer d line: the ray inside is parallel to the base.
    let deviation = 2.0 * (SF10.n * (0.5 * APEX).sin()).asin() - APEX;
    let flint = b.material(Material { thickness: 0.1, transmission: 1.0, roughness: 0.0, ..medium("flint", SF10) });
    let length = 0.24;
    let half = length * (0.5 * APEX).tan();
    let outline = [DVec2::new(0.5 * length, 0.0), DVec2::new(-0.5 * length, half), DVec2::new(-0.5 * length, -half)];
    let apex = DVec3::new((0.5 * deviation).cos(), 0.0, -(0.5 * deviation).sin());
    let upright = DMat3::from_cols(apex, DVec3::Y.cross(apex), DVec3::Y);
    b.add("prism", Shape::prism(&outline, 0.24), flint, DAffine3::from_mat3(upright));

    // The slit lies in the deviated direction.
    let to_slit = DVec3::new(-deviation.sin(), 0.0, -deviation.cos());
    let across = DVec3::Y.cross(-to_slit);
    let white = b.material(emitter("white", [1.0; 3]));
    // Brighter than the bar, because dispersion spreads the slit to many times its width.
    let bright = b.material(emitter("bright", [6.0; 3]));
    let black = b.material(dielectric("velvet", [0.004; 3], 1.0));
    let place = |x: f64, y: f64, back: f64| facing(to_slit * (TO_SLIT + back) + across * x + DVec3::Y * y, -to_slit);
    b.add("velvet", Shape::panel(1.6, 1.6), black, place(0.0, 0.0, 0.02));
    b.add("slit", Shape::panel(0.008, 0.20), bright, place(0.0, 0.13, 0.0));
    b.add("bar", Shape::panel(0.12, 0.20), white, place(0.0, -0.13, 0.0));

    let grey = b.material(dielectric("wall", [0.12; 3], 0.9));
    b.add("wall", Shape::panel(3.2, 2.0), grey, at(0.7, 0.0, -1.6, 0.0));
    let table = b.material(dielectric("table", [0.2; 3], 0.9));
    b.add("table", Shape::plane(3.2, 1.8, 1), table, at(0.7, -0.13, -0.7, 0.0));
    b.light("lamp", [2.0; 3], LightKind::Point { position: DVec3::new(0.7, 0.9, 0.6), range: None });
    b.camera("front", DVec3::Z * TO_EYE, DVec3::ZERO, 14.0);
    b.finish()
}
