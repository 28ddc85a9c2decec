//! Study scene of alpha blending and alpha testing: unlit panes of known colour, opacity and order in front of a
//! striped board.
//!
//! Read RTR 5.5. All surfaces are unlit, so that the expected pixel is the plain composite with the background, far to
//! near.

use glam::DVec3;

use super::build::{StudyBuilder, at, dielectric};
use super::shape::Shape;
use crate::{AlphaMode, Material, Scene};

fn pane(name: &str, color: [f32; 4]) -> Material {
    let [r, g, b, _] = color;
    Material {
        base_color: color,
        alpha_mode: AlphaMode::Blend,
        double_sided: true,
        unlit: true,
        ..dielectric(name, [r, g, b], 1.0)
    }
}

pub(super) fn scene() -> Scene {
    let mut b = StudyBuilder::new("blend");
    let stripes =
        b.picture("stripes", 64, |x, _| if (x / 8) % 2 == 0 { [0.05, 0.05, 0.05, 1.0] } else { [0.6, 0.6, 0.6, 1.0] });
    let board =
        b.material(Material { base_color_texture: Some(stripes), unlit: true, ..dielectric("board", [1.0; 3], 1.0) });
    b.add("board", Shape::panel(6.0, 4.0).repeat_uv(6.0, 4.0), board, at(0.0, 0.0, -1.0, 0.0));

    let red = b.material(pane("red glass", [0.9, 0.1, 0.1, 0.5]));
    let green = b.material(pane("green glass", [0.1, 0.8, 0.1, 0.5]));
    let blue = b.material(pane("blue glass", [0.1, 0.2, 0.9, 0.5]));
    let sheet = |b: &mut StudyBuilder, name: &str, material: usize| b.mesh(name, Shape::panel(0.8, 0.8), material);
    let panes = [sheet(&mut b, "red pane", red), sheet(&mut b, "green pane", green), sheet(&mut b, "blue pane", blue)];

    // Left: three overlapping panes, listed near to far, the wrong order for painting.
    for (i, (name, depth)) in [("near red", 0.4), ("middle green", 0.2), ("far blue", 0.0)].into_iter().enumerate() {
        let shift = 0.25 * (i as f64 - 1.0);
        b.place(name, panes[i], at(-1.25 + shift, 0.25 * (1.0 - i as f64), depth, 0.0));
    }
    // Middle: two intersecting panes; their depth order changes at the crossing line.
    b.place("crossing red", panes[0], at(0.1, 0.0, 0.2, 40.0));
    b.place("crossing blue", panes[2], at(0.1, 0.0, 0.2, -40.0));

    // Right: an alpha-tested surface between two panes.
    let holes = b.picture("holes", 128, |x, y| {
        let (x, y) = (f64::from(x % 32) - 15.5, f64::from(y % 32) - 15.5);
        [0.9, 0.75, 0.2, (0.5 + (x.hypot(y) - 9.0) / 4.0).clamp(0.0, 1.0)]
    });
    let lattice = b.material(Material {
        base_color_texture: Some(holes),
        alpha_mode: AlphaMode::Mask(0.5),
        double_sided: true,
        unlit: true,
        ..dielectric("lattice", [1.0; 3], 1.0)
    });
    b.place("pane behind the lattice", panes[1], at(1.15, 0.15, 0.0, 0.0));
    b.add("lattice", Shape::panel(0.9, 0.9), lattice, at(1.3, 0.0, 0.2, 0.0));
    b.place("pane before the lattice", panes[0], at(1.5, -0.15, 0.4, 0.0));

    b.camera("front", DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, 28.0);
    b.finish()
}
