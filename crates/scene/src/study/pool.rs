//! Study scene of total internal reflection (lecture F7): Snell's window, seen by a swimmer below water.
//!
//! Read RTR 9.5. The whole sky fits into a circle of half-angle asin(1/1.333) = 48.6° around the zenith; outside it the
//! water surface is a perfect mirror of the pool.

use glam::{DAffine3, DVec2, DVec3};

use super::build::{StudyBuilder, at, dielectric, emitter, glass, metal};
use super::shape::{Shape, arc, line};
use crate::{LightKind, Material, Sampler, Scene, TextureRef, Wrap};

/// Length, depth and width of the water in metres; its surface is at y = 0.
const POOL: DVec3 = DVec3::new(9.0, 2.4, 5.6);
/// Height of the rim above the water in metres: it hides at most half a degree of sky.
const RIM: f64 = 0.02;
/// Depth in metres to which the water reaches into the walls and the floor, so that no surfaces coincide.
const INTO_WALL: f64 = 0.005;

pub(super) fn scene() -> Scene {
    let mut b = StudyBuilder::new("pool");
    basin(&mut b);
    let water = b.material(Material {
        attenuation_color: [0.55, 0.86, 0.92],
        attenuation_distance: 7.0,
        ..glass("water", 1.333, POOL.y as f32)
    });
    let body = POOL + DVec3::new(2.0 * INTO_WALL, INTO_WALL, 2.0 * INTO_WALL);
    // Half the height as rounded in the mesh, so that the surface is at exactly 0.
    let half = f64::from((0.5 * body.y) as f32);
    b.add("water", Shape::cuboid(body), water, at(0.0, -half, 0.0, 0.0));
    ladder(&mut b);
    balls(&mut b);
    things_above(&mut b);
    sky(&mut b);
    lamps(&mut b);
    let swimmer = DVec3::new(-1.4, -1.5, -0.8);
    // The sky as ambient light where the lamps do not reach.
    b.studio(0.3);
    b.camera("swimmer", swimmer, swimmer + DVec3::Y, 115.0);
    b.camera("surface", DVec3::new(4.6, 3.2, 7.4), DVec3::new(-0.5, -0.5, -0.3), 42.0);
    b.finish()
}

/// Matt tiles of 20 cm with grout, and a deck around them whose edge lies inside the tiled wall.
fn basin(b: &mut StudyBuilder) {
    let tiles = b.picture("tiles", 256, |x, y| {
        // Two texels of 32 are grout: 12.5 mm, wider than in a real pool, to be visible from the other end.
        let (column, row) = (x / 32, y / 32);
        let [r, g, b] = match (x % 32 < 2 || y % 32 < 2, (column + row) % 2) {
            (true, _) => [0.08, 0.10, 0.11],
            (_, 0) => [0.42, 0.58, 0.62],
            _ => [0.58, 0.70, 0.72],
        };
        [r, g, b, 1.0]
    });
    let tiled = b.material(Material { base_color_texture: Some(tiles), ..dielectric("tiles", [1.0; 3], 0.9) });
    // One repeat of eight tiles per 1.6 m.
    let tub = Shape::tub(POOL + DVec3::Y * RIM, 0.4, 0.2).repeat_uv(0.625, 0.625);
    b.add("basin", tub, tiled, at(0.0, RIM, 0.0, 0.0));
    let stone = b.material(dielectric("stone", [0.46, 0.40, 0.33], 0.9));
    let ring = Shape::tub(DVec3::new(POOL.x + 0.6, 2.9, POOL.z + 0.6), 2.7, 0.2);
    b.add("deck", ring, stone, at(0.0, RIM - 0.015, 0.0, 0.0));
}

/// Rails that stand on the floor, rise through the surface and bend back to the deck.
fn ladder(b: &mut StudyBuilder) {
    let steel = b.material(metal("steel", [0.56, 0.57, 0.58], 0.2));
    let (front, back, top, radius) = (-0.5 * POOL.z + 0.3, -0.5 * POOL.z - 0.45, 0.72, 0.025);
    let foot = -POOL.y - 0.02;
    let upright = b.mesh("rail", Shape::cylinder(radius, top - foot, 24), steel);
    let post = b.mesh("post", Shape::cylinder(radius, top + 0.05, 24), steel);
    let bar = b.mesh("bar", Shape::cylinder(radius, front - back, 24), steel);
    let joint = b.mesh("joint", Shape::sphere(1.3 * radius, 16), steel);
    let step = b.mesh("step", Shape::cuboid(DVec3::new(0.5, 0.03, 0.09)), steel);
    let middle = -0.75;
    for (side, x) in [("left", middle - 0.25), ("right", middle + 0.25)] {
        b.place(&format!("{side} rail"), upright, at(x, foot, front, 0.0));
        b.place(&format!("{side} post"), post, at(x, -0.05, back, 0.0));
        let along = at(x, top, back, 0.0) * DAffine3::from_rotation_x(std::f64::consts::FRAC_PI_2);
        b.place(&format!("{side} bar"), bar, along);
        b.place(&format!("{side} front joint"), joint, at(x, top, front, 0.0));
        b.place(&format!("{side} back joint"), joint, at(x, top, back, 0.0));
    }
    for i in 0..6 {
        b.place(&format!("step {i}"), step, at(middle, -0.25 - 0.35 * f64::from(i), front, 0.0));
    }
}

/// A ball on the floor, visible to the swimmer only by total reflection outside the window, and a floating ball.
fn balls(b: &mut StudyBuilder) {
    let red = b.material(dielectric("red rubber", [0.70, 0.06, 0.04], 0.6));
    b.add("ball", Shape::sphere(0.35, 48), red, at(3.1, -POOL.y + 0.3501, -0.9, 0.0));
    let yellow = b.material(dielectric("yellow rubber", [0.80, 0.52, 0.04], 0.6));
    b.add("float", Shape::sphere(0.2, 48), yellow, at(0.9, 0.04, 1.1, 0.0));
}

/// Objects above the water: low ones appear near the rim of the window, high ones near its centre.
fn things_above(b: &mut StudyBuilder) {
    let board = b.material(dielectric("board", [0.10, 0.30, 0.62], 0.5));
    b.add("diving board", Shape::cuboid(DVec3::new(3.6, 0.06, 0.5)), board, at(-4.2, 1.03, -0.6, 0.0));
    let white = b.material(dielectric("white paint", [0.75; 3], 0.7));
    b.add("board stand", Shape::cuboid(DVec3::new(0.35, 1.05, 0.42)), white, at(-5.5, 0.495, -0.6, 0.0));

    // Bands of half a metre: equal in height, hence thinner towards the rim of the window.
    let bands =
        b.picture("bands", 64, |_, y| if (y / 8) % 2 == 0 { [0.75, 0.08, 0.05, 1.0] } else { [0.8, 0.8, 0.8, 1.0] });
    let banded = b.material(Material { base_color_texture: Some(bands), ..dielectric("banded pole", [1.0; 3], 0.7) });
    b.add("pole", Shape::cylinder(0.09, 4.0, 32), banded, at(-0.4, -0.05, 3.6, 0.0));

    let p = DVec2::new;
    let canopy = [line(p(0.0, 2.25), p(1.2, 1.85)), line(p(1.2, 1.85), p(1.2, 1.88)), line(p(1.2, 1.88), p(0.0, 2.30))];
    let green = b.material(dielectric("canvas", [0.08, 0.42, 0.16], 0.9));
    let (x, z) = (1.3, -4.1);
    b.add("parasol", Shape::lathe(&canopy, 64), green, at(x, 0.0, z, 0.0));
    b.add("parasol stand", Shape::cylinder(0.03, 2.3, 24), white, at(x, -0.05, z, 0.0));
}

/// A dome that emits inwards, from the zenith to below the horizon, so that the window is bright up to its rim.
fn sky(b: &mut StudyBuilder) {
    let radius = 14.0;
    let lowest = -20.0_f64.to_radians();
    // Downwards from the top, the right of the direction of travel is the inside.
    let outline = arc(DVec2::ZERO, 1.0, std::f64::consts::FRAC_PI_2, lowest, 44);
    let outline = outline.into_iter().map(|(p, n)| (p * radius, n)).collect();
    // v runs from the lowest ring to the zenith.
    let gradient = b.picture("sky", 128, |_, y| {
        let elevation = ((f64::from(y) + 0.5) / 128.0 * 110.0 - 20.0).max(0.0) / 90.0;
        let mix = |zenith: f64, horizon: f64| zenith + (horizon - zenith) * (1.0 - elevation).powi(3);
        [mix(0.20, 0.88), mix(0.42, 0.95), mix(0.86, 1.0), 1.0]
    });
    let clamped = TextureRef { sampler: Sampler { wrap_v: Wrap::Clamp, ..gradient.sampler }, ..gradient };
    let shine = b.material(Material { emissive_texture: Some(clamped), ..emitter("sky", [1.4; 3]) });
    b.add("sky", Shape::lathe(&[outline], 96), shine, DAffine3::IDENTITY);
}

/// The sun, and two lamps in the walls for models whose light does not pass the water surface.
fn lamps(b: &mut StudyBuilder) {
    let direction = DVec3::new(0.45, -1.0, -0.35).normalize();
    b.light("sun", [3.2, 3.0, 2.7], LightKind::Directional { direction });
    let glow = b.material(emitter("lamp glow", [6.0, 5.6, 4.8]));
    let globe = b.mesh("lamp", Shape::sphere(0.08, 24), glow);
    for (side, x) in [("left", -0.5 * POOL.x), ("right", 0.5 * POOL.x)] {
        b.place(&format!("{side} lamp"), globe, at(x, -1.2, 0.9, 0.0));
        // In front of the globe, which would shadow a light inside it.
        let position = DVec3::new(x - 0.25 * x.signum(), -1.2, 0.9);
        b.light(&format!("{side} lamp"), [3.5, 3.3, 2.8], LightKind::Point { position, range: None });
    }
}
