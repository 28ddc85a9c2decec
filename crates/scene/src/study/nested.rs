//! Study scene of nested dielectrics: an air bubble in ice in water in glass, as overlapping closed meshes with
//! priorities.
//!
//! Read Schmidt and Budge, "Simple Nested Dielectrics in Ray Traced Images", 2002. No interfaces coincide, and no mesh
//! is cut to fit another. The water reaches into the wall of the glass, the ice lies in the water and the bubble in the
//! ice. In an overlap the medium with the higher priority counts.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DAffine3, DQuat, DVec2, DVec3, EulerRot};

use super::build::{StudyBuilder, at, dielectric, emitter, facing, glass};
use super::shape::{Shape, arc, line};
use crate::{LightKind, Material, Scene};

/// Height of the water above the table in metres.
const LEVEL: f64 = 0.088;

pub(super) fn scene() -> Scene {
    let mut b = StudyBuilder::new("nested");
    surroundings(&mut b);
    tumbler(&mut b);
    ice(&mut b);
    straw(&mut b);
    lights(&mut b);
    b.camera("front", DVec3::new(0.0, 0.155, 0.52), DVec3::new(0.0, 0.07, 0.0), 20.0);
    b.camera("above", DVec3::new(-0.10, 0.27, 0.22), DVec3::new(0.0, 0.06, 0.0), 27.0);
    b.studio(0.4);
    b.finish()
}

/// A solid with a priority, which fills overlaps before solids of lower priority.
fn medium(name: &str, ior: f32, thickness: f32, priority: i32) -> Material {
    Material { priority, ..glass(name, ior, thickness) }
}

/// A table and a striped board, red on the left and blue on the right, so that a mirrored picture is recognisable.
fn surroundings(b: &mut StudyBuilder) {
    let checker = b.checker("table checker", [0.22, 0.21, 0.20], [0.34, 0.33, 0.31]);
    let table = b.material(Material { base_color_texture: Some(checker), ..dielectric("table", [1.0; 3], 0.8) });
    b.add("table", Shape::plane(2.4, 1.6, 1).repeat_uv(12.0, 8.0), table, at(0.0, 0.0, 0.3, 0.0));
    let stripes = b.picture("stripes", 512, |x, _| {
        let [r, g, b] = match ((x / 8) % 2, x < 256) {
            (0, _) => [0.75, 0.75, 0.73],
            (_, true) => [0.60, 0.07, 0.05],
            (_, false) => [0.05, 0.14, 0.55],
        };
        [r, g, b, 1.0]
    });
    let board = b.material(Material { base_color_texture: Some(stripes), ..dielectric("board", [1.0; 3], 0.9) });
    b.add("striped board", Shape::panel(0.8, 0.44), board, at(0.0, 0.22, -0.18, 0.0));
}

/// A thick-walled glass just above the table, and the water, whose side and bottom lie inside the wall and the base.
fn tumbler(b: &mut StudyBuilder) {
    let p = DVec2::new;
    let crown = b.material(medium("glass", 1.5, 0.005, 4));
    let outline = [
        line(p(0.0, 0.0), p(0.038, 0.0)),
        arc(p(0.038, 0.002), 0.002, -FRAC_PI_2, 0.0, 6),
        line(p(0.040, 0.002), p(0.0465, 0.118)),
        // The rim, rounded from the outside over the top.
        arc(p(0.0446, 0.118), 0.0019, 0.0, PI, 12),
        line(p(0.0427, 0.118), p(0.0355, 0.015)),
        // The corner of the cavity, whose normals point inwards.
        arc(p(0.0315, 0.015), 0.004, 0.0, -FRAC_PI_2, 8),
        line(p(0.0315, 0.011), p(0.0, 0.011)),
    ];
    b.add("tumbler", Shape::lathe(&outline, 96), crown, at(0.0, 0.0001, 0.0, 0.0));

    let water = b.material(Material {
        attenuation_color: [0.80, 0.93, 0.96],
        attenuation_distance: 0.3,
        ..medium("water", 1.333, 0.08, 1)
    });
    let (low, high) = (p(0.0378, 0.007), p(0.0427, LEVEL));
    let body = [line(p(0.0, 0.007), low), line(low, high), line(high, p(0.0, LEVEL))];
    b.add("water", Shape::lathe(&body, 96), water, at(0.0, 0.0001, 0.0, 0.0));
}

/// Three floating cubes with a corner or a face above the water; the first contains a bubble.
fn ice(b: &mut StudyBuilder) {
    let ice = b.material(medium("ice", 1.31, 0.022, 2));
    let cube = b.mesh("ice cube", Shape::cuboid(DVec3::splat(0.022)), ice);
    // A third of a turn apart; the corners reach 19 mm, so centres 35 mm apart need only a suitable orientation.
    let frames =
        [(90.0, -0.004, [0.35, 0.5, 0.2]), (210.0, -0.006, [-0.2, 1.1, 0.45]), (330.0, -0.003, [0.15, 0.2, -0.5])].map(
            |(around, depth, [x, y, z]): (f64, f64, [f64; 3])| {
                let (sin, cos) = around.to_radians().sin_cos();
                let middle = DVec3::new(0.0205 * cos, LEVEL + depth, 0.0205 * sin);
                DAffine3::from_rotation_translation(DQuat::from_euler(EulerRot::XYZ, x, y, z), middle)
            },
        );
    for (i, frame) in frames.into_iter().enumerate() {
        b.place(&format!("ice cube {i}"), cube, frame);
    }
    let air = b.material(medium("air", 1.0, 0.009, 3));
    let inside = frames[0] * DAffine3::from_translation(DVec3::new(0.004, -0.003, 0.003));
    b.add("bubble", Shape::sphere(0.0045, 32), air, inside);
}

/// A straw between two cubes: broken at the water surface, magnified behind the glass.
fn straw(b: &mut StudyBuilder) {
    let spiral =
        b.picture("spiral", 64, |x, y| if (x + y) % 64 < 24 { [0.70, 0.10, 0.08, 1.0] } else { [0.8, 0.8, 0.8, 1.0] });
    let paper = b.material(Material { base_color_texture: Some(spiral), ..dielectric("paper", [1.0; 3], 0.7) });
    let out = DVec3::new(30.0_f64.to_radians().cos(), 0.0, 30.0_f64.to_radians().sin());
    let (foot, through) = (out * 0.010 + DVec3::Y * 0.0135, out * 0.036 + DVec3::Y * 0.112);
    // The cylinder's axis is +Y; this rotation turns it to the third axis of the frame.
    let frame = facing(foot, through - foot) * DAffine3::from_rotation_x(FRAC_PI_2);
    b.add("straw", Shape::cylinder(0.0028, 0.165, 32).repeat_uv(1.0, 8.0), paper, frame);
}

/// Two soft boxes beside the camera for highlights, with their proxy lights.
fn lights(b: &mut StudyBuilder) {
    let middle = DVec3::new(0.0, 0.07, 0.0);
    let boxes = [
        ("key", DVec3::new(-0.55, 0.55, 0.35), 0.40, 0.25, [6.0, 6.0, 6.0], [1.5, 1.5, 1.5]),
        ("fill", DVec3::new(0.60, 0.30, 0.25), 0.10, 0.40, [2.6, 2.8, 3.2], [0.5, 0.53, 0.6]),
    ];
    for (name, position, width, height, radiance, intensity) in boxes {
        let white = b.material(emitter(&format!("{name} soft box"), radiance));
        let towards = (middle - position).normalize();
        b.add(&format!("{name} soft box"), Shape::panel(width, height), white, facing(position, towards));
        // In front of the panel, whose back would otherwise occlude the light.
        b.light(name, intensity, LightKind::Point { position: position + towards * 0.02, range: None });
    }
}
