//! Study scene of numerically hard cases, ten kilometres from the origin and in front of a plane mirror that shows the
//! back.
//!
//! Read docs/numerics.md for the errors of f32 in such cases.

use glam::{DAffine3, DVec2, DVec3};

use super::build::{StudyBuilder, at, conductor, dielectric, emitter, facing, glass, metal};
use super::shape::Shape;
use crate::substance::SILVER;
use crate::{LightKind, Material, Scene};

/// Position of the scene in metres: f32 sums of such numbers have errors up to half a millimetre.
const FAR: DVec3 = DVec3::new(10_000.3, 0.0, -7_000.7);

pub(super) fn scene() -> Scene {
    let mut b = StudyBuilder::new("torture");
    let far = DAffine3::from_translation(FAR);
    let here = |x: f64, y: f64, z: f64, turn: f64| far * at(x, y, z, turn);

    let checker = b.checker("floor checker", [0.25; 3], [0.5, 0.49, 0.47]);
    let matt = b.material(Material { base_color_texture: Some(checker), ..dielectric("floor", [1.0; 3], 0.9) });
    b.add("floor", Shape::plane(6.0, 6.0, 1).repeat_uv(12.0, 12.0), matt, here(0.0, 0.0, 0.0, 0.0));
    // Seen at angles down to one degree: Fresnel terms, shadow rays, and repeated reflection.
    let silver = b.material(conductor("silver", SILVER, 0.0));
    b.add("back mirror", Shape::panel(2.6, 1.2), silver, far * facing(DVec3::new(0.0, 0.62, -1.1), DVec3::Z));
    b.add("mirror strip", Shape::cuboid(DVec3::new(0.16, 0.002, 2.0)), silver, here(0.62, 0.001_1, 0.0, 0.0));

    // A highlight of a hundredth of a degree: (cos δ)^shine, and D of α = 1e-4.
    let polished = b.material(metal("polished", [0.9, 0.7, 0.5], 0.01));
    b.add("polished ball", Shape::sphere(0.12, 64), polished, here(-0.72, 0.1201, 0.0, 0.0));

    // Two thousand triangles a thousand times as long as wide: their normals are differences of nearly equal numbers.
    let paper = b.material(dielectric("paper", [0.7, 0.3, 0.25], 0.8));
    let tilted = DAffine3::from_rotation_x(1.2);
    b.add("needles", Shape::disc(0.16, 2000), paper, here(-0.36, 0.18, -0.2, 0.0) * tilted);

    // Faces exactly −Z, where the simplest tangent frame around a normal divides by zero; visible in the mirror.
    let board = b.material(dielectric("board", [0.25, 0.45, 0.7], 0.9));
    b.add("board", Shape::panel(0.34, 0.3), board, far * facing(DVec3::new(0.0, 0.16, -0.35), DVec3::NEG_Z));

    // Refracts by a hundredth of a degree: n² − 1 + cos² is a difference of nearly equal numbers.
    let faint = b.material(glass("faint glass", 1.0003, 0.2));
    b.add("faint block", Shape::cuboid(DVec3::new(0.2, 0.2, 0.2)), faint, here(0.02, 0.1002, 0.18, 30.0));

    // Light inside meets the sides at angles around the critical angle of 41.8°.
    let crown = b.material(glass("crown glass", 1.5, 0.2));
    let (half, foot, tip) = (0.12, -0.046_188 * 1.5, 0.092_376 * 1.5);
    let triangle = [DVec2::new(-half, foot), DVec2::new(half, foot), DVec2::new(0.0, tip)];
    b.add("prism", Shape::prism(&triangle, 0.24), crown, here(0.34, -foot + 0.000_1, 0.1, 65.0));

    // A gap of 20 µm between two plates, in a scene of metres.
    let plate = b.mesh("plate", Shape::cuboid(DVec3::new(0.2, 0.2, 0.01)), crown);
    b.place("front plate", plate, here(0.95, 0.1002, 0.05, -20.0));
    b.place("rear plate", plate, here(0.95, 0.1002, 0.05, -20.0) * at(0.0, 0.0, -0.010_02, 0.0));

    // Emitters of a millimetre and a metre; the intensity of a proxy light is π r² times the radiance.
    let spark = b.material(emitter("spark", [2.0e5, 1.8e5, 1.5e5]));
    b.add("spark", Shape::sphere(0.001, 16), spark, here(-0.95, 0.55, 0.5, 0.0));
    let position = FAR + DVec3::new(-0.95, 0.548, 0.5);
    b.proxy("spark lamp", [0.63, 0.57, 0.47], LightKind::Point { position, range: None });
    let sheet = b.material(emitter("sheet", [2.2, 2.3, 2.5]));
    let above = DVec3::new(0.3, 2.2, 0.6);
    b.add("sheet", Shape::panel(1.0, 1.0), sheet, far * facing(above, DVec3::NEG_Y));
    let kind = LightKind::Spot {
        position: FAR + above - DVec3::Y * 0.05,
        direction: DVec3::NEG_Y,
        range: None,
        inner: 0.6,
        outer: 1.4,
    };
    b.proxy("sheet lamp", [2.2, 2.3, 2.5], kind);
    b.camera("front", FAR + DVec3::new(0.05, 0.42, 2.3), FAR + DVec3::new(0.03, 0.2, 0.0), 34.0);
    b.studio(0.3);
    b.finish()
}
