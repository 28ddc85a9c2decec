//! Study scene of global illumination (lecture R6): the Cornell box, whose colour bleeding needs the global model.
//!
//! Read Goral et al., "Modeling the Interaction of Light Between Diffuse Surfaces", 1984. Proportions follow the later
//! data of Cornell University's page at a hundredth of its millimetres, rotated so that the camera looks along −Z.

use glam::DVec3;

use super::build::{StudyBuilder, at, dielectric, emitter, facing};
use super::shape::Shape;
use crate::{LightKind, Scene};

/// Half the width in metres, and the height of the room in metres.
const HALF: f64 = 2.78;
const HEIGHT: f64 = 5.488;
const DEPTH: f64 = 5.592;

pub(super) fn scene() -> Scene {
    let mut b = StudyBuilder::new("cornell");
    // Linear Rec. 709 colours in place of the measured spectra.
    let white = b.material(dielectric("white", [0.73, 0.73, 0.73], 1.0));
    let red = b.material(dielectric("red", [0.63, 0.065, 0.05], 1.0));
    let green = b.material(dielectric("green", [0.14, 0.45, 0.091], 1.0));

    let middle = DVec3::new(0.0, HEIGHT * 0.5, -DEPTH * 0.5);
    let walls = [
        ("floor", white, DVec3::Y, 2.0 * HALF, DEPTH),
        ("ceiling", white, DVec3::NEG_Y, 2.0 * HALF, DEPTH),
        ("back wall", white, DVec3::Z, 2.0 * HALF, HEIGHT),
        ("left wall", red, DVec3::X, DEPTH, HEIGHT),
        ("right wall", green, DVec3::NEG_X, DEPTH, HEIGHT),
    ];
    for (name, material, inwards, width, height) in walls {
        let reach = DVec3::new(HALF, HEIGHT * 0.5, DEPTH * 0.5);
        b.add(name, Shape::panel(width, height), material, facing(middle - inwards * reach, inwards));
    }

    let short = Shape::cuboid(DVec3::new(1.65, 1.65, 1.65));
    b.add("short block", short, white, at(0.925, 0.8251, -1.69, -17.0));
    let tall = Shape::cuboid(DVec3::new(1.65, 3.30, 1.65));
    b.add("tall block", tall, white, at(-0.905, 1.6501, -3.51, 17.2));

    // The panel and the proxy light are the same lamp: 1.3 m by 1.05 m of radiance 12 has the axial intensity 16.4. The
    // proxy's 16.4 lights models with punctual lights only. The panel hangs a little below the ceiling, and the proxy
    // below the panel.
    let glow = b.material(emitter("lamp", [12.0, 12.0, 12.0]));
    let lamp = DVec3::new(0.0, HEIGHT - 0.01, -2.795);
    b.add("ceiling panel", Shape::panel(1.3, 1.05), glow, facing(lamp, DVec3::NEG_Y));
    b.proxy("ceiling lamp", [16.4; 3], LightKind::Point { position: lamp - DVec3::Y * 0.05, range: None });
    // Farther away than the original's 8 m, the room still fills the height of a wide picture.
    b.camera("front", DVec3::new(0.0, HEIGHT * 0.5, 8.0), middle, 39.3);
    b.finish()
}
