//! The default study scene: two half-silvered plates that face each other, among reflective, refractive and emissive
//! objects in front of a curved backdrop.

use glam::{DAffine3, DVec2, DVec3};

use super::build::{StudyBuilder, at, conductor, dielectric, emitter, facing, glass, metal};
use super::shape::{Shape, arc, line};
use crate::substance::GOLD;
use crate::{LightKind, Material, Scene};

pub(super) fn scene() -> Scene {
    let mut b = StudyBuilder::new("etalon");
    table(&mut b);
    plates(&mut b);

    let gold = b.material(conductor("gold", GOLD, 0.06));
    b.add("gold ball", Shape::sphere(0.07, 48), gold, at(-0.16, 0.07, 0.03, 0.0));

    let crown = b.material(glass("crown glass", 1.517, 0.16));
    b.add("glass ball", Shape::sphere(0.085, 48), crown, at(0.13, 0.0851, 0.33, 0.0));

    // Equilateral, lying on one side: edge 0.16, centroid a third of the height above the table.
    let flint = b.material(glass("flint glass", 1.62, 0.12));
    let (half, foot, tip) = (0.08, -0.046_188, 0.092_376);
    let triangle = [DVec2::new(-half, foot), DVec2::new(half, foot), DVec2::new(0.0, tip)];
    b.add("prism", Shape::prism(&triangle, 0.2), flint, at(-0.43, -foot + 0.0001, 0.26, 28.0));

    basin(&mut b);
    lamp(&mut b);
    studio(&mut b);
    b.camera("front", DVec3::new(0.0, 0.44, 1.75), DVec3::new(0.02, 0.19, 0.0), 24.0);
    b.camera("above", DVec3::new(0.9, 1.1, 1.2), DVec3::new(0.0, 0.12, -0.05), 30.0);
    b.studio(0.4);
    b.finish()
}

/// Matt floor and backdrop. The contrast of the checkerboard is low, so that it does not distract, and still visible in
/// reflections.
fn table(b: &mut StudyBuilder) {
    let checker = b.checker("table checker", [0.30, 0.30, 0.31], [0.43, 0.42, 0.41]);
    let matt = b.material(Material { base_color_texture: Some(checker), ..dielectric("table", [1.0; 3], 0.9) });
    // One repeat of eight squares per half metre: 7 m by 3.5 m, from behind the camera to the backdrop.
    b.add("table", Shape::plane(7.0, 3.5, 1).repeat_uv(14.0, 7.0), matt, at(0.0, 0.0, 0.65, 0.0));
    let paper = b.material(dielectric("backdrop", [0.36, 0.36, 0.37], 0.9));
    b.add("backdrop", Shape::backdrop(7.0, -1.1, 0.6, 2.6), paper, DAffine3::IDENTITY);
}

/// The etalon itself: plates near enough for a chain of reflections, and far enough apart for a view between
/// them.
fn plates(b: &mut StudyBuilder) {
    // Partly metal, partly clear glass: the metallic fraction reflects, the rest transmits.
    let silver = b.material(Material {
        base_color: [0.96, 0.96, 0.97, 1.0],
        metallic: 0.55,
        ..glass("half-silvered glass", 1.5, 0.012)
    });
    let plate = b.mesh("plate", Shape::cuboid(DVec3::new(0.012, 0.46, 0.36)), silver);
    let turn = -24.0;
    for (name, across) in [("left plate", -0.17), ("right plate", 0.17)] {
        // A small gap above the table avoids coincident interfaces, where the nearest hit is ambiguous.
        b.place(name, plate, at(-0.14, 0.2301, -0.06, turn) * at(across, 0.0, 0.0, 0.0));
    }
}

/// A glazed bowl of water. The water's side and bottom lie inside the bowl's wall, so that no surfaces coincide.
fn basin(b: &mut StudyBuilder) {
    let glaze = b.material(dielectric("glazed clay", [0.05, 0.12, 0.20], 0.25));
    let p = DVec2::new;
    let bowl = [
        line(p(0.0, 0.0), p(0.15, 0.0)),
        line(p(0.15, 0.0), p(0.19, 0.062)),
        // The rim, rounded from the outside over the top.
        arc(p(0.184, 0.062), 0.006, 0.0, std::f64::consts::PI, 8),
        line(p(0.178, 0.062), p(0.142, 0.012)),
        line(p(0.142, 0.012), p(0.0, 0.012)),
    ];
    b.add("basin", Shape::lathe(&bowl, 96), glaze, at(0.42, 0.0001, 0.0, 0.0));

    let water = b.material(Material {
        attenuation_color: [0.55, 0.85, 0.92],
        attenuation_distance: 0.25,
        ..glass("water", 1.333, 0.04)
    });
    let (low, high) = (p(0.145, 0.008), p(0.173, 0.048));
    let body = [line(p(0.0, 0.008), low), line(low, high), line(high, p(0.0, 0.048))];
    b.add("water", Shape::lathe(&body, 96), water, at(0.42, 0.0001, 0.0, 0.0));
}

/// An emitter and its proxy light are the same lamp: radiance times the area that its front shows is the intensity.
fn emitter_of(b: &mut StudyBuilder, name: &str, intensity: [f32; 3], area: f64) -> usize {
    b.material(emitter(name, intensity.map(|i| i / area as f32)))
}

/// An emissive ball on a thin stand. Its proxy light hangs below the ball, because the ball would shadow a light inside
/// it. Its range ends before the backdrop, where the ball's shadow would be visible.
fn lamp(b: &mut StudyBuilder) {
    let (x, z, radius, height) = (0.56, -0.62, 0.05, 0.30);
    let brass = b.material(metal("brass", [0.89, 0.76, 0.43], 0.3));
    let p = DVec2::new;
    let stand = [
        line(p(0.0, 0.0), p(0.06, 0.0)),
        line(p(0.06, 0.0), p(0.06, 0.008)),
        line(p(0.06, 0.008), p(0.006, 0.016)),
        line(p(0.006, 0.016), p(0.006, height - radius + 0.004)),
        line(p(0.006, height - radius + 0.004), p(0.0, height - radius + 0.004)),
    ];
    b.add("lamp stand", Shape::lathe(&stand, 48), brass, at(x, 0.0001, z, 0.0));
    let intensity = [0.60, 0.36, 0.15];
    let glow = emitter_of(b, "lamp glow", intensity, std::f64::consts::PI * radius * radius);
    b.add("lamp ball", Shape::sphere(radius, 32), glow, at(x, height, z, 0.0));
    let position = DVec3::new(x - 0.02, height - 0.06, z + 0.035);
    b.proxy("lamp", intensity, LightKind::Point { position, range: Some(1.1) });
}

/// Two soft boxes for highlights on glass and metal, with their proxy lights.
fn studio(b: &mut StudyBuilder) {
    let middle = DVec3::new(0.0, 0.15, 0.0);
    let (width, height, intensity) = (0.9, 0.6, [15.0; 3]);
    let key = emitter_of(b, "key soft box", intensity, width * height);
    let key_at = DVec3::new(-1.5, 1.7, 0.7);
    b.add("key soft box", Shape::panel(width, height), key, facing(key_at, middle - key_at));
    let (width, height, fill) = (0.25, 1.2, [1.3, 1.5, 1.8]);
    let rim = emitter_of(b, "rim soft box", fill, width * height);
    let rim_at = DVec3::new(1.7, 0.9, 0.5);
    b.add("rim soft box", Shape::panel(width, height), rim, facing(rim_at, middle - rim_at));

    let direction = (middle - key_at).normalize();
    let kind = LightKind::Spot {
        // In front of the panel, whose back would otherwise occlude the light.
        position: key_at + direction * 0.05,
        direction,
        range: None,
        inner: 30.0_f64.to_radians(),
        outer: 62.0_f64.to_radians(),
    };
    b.proxy("key", intensity, kind);
    let position = rim_at + (middle - rim_at).normalize() * 0.05;
    b.proxy("fill", fill, LightKind::Point { position, range: None });
}
