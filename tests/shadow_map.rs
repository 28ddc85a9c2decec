//! Shadow maps against visibility in f64 (crates/testing/src/raycast.rs): where edges lie, that nothing lit is dark and
//! nothing dark is lit beyond the band that the map's texels leave open, at any scale, and what does not cast.
//!
//! One Lambert scene is drawn with shadows=off and with shadows=map: their ratio is the share of the light that the map
//! lets through. Facets have their own normals here, so that no terminator is in it.

use etalon::frame::{Renderer, Settings};
use etalon::image::Picture;
use etalon::scene::{AlphaMode, Image, LightKind, Material, Sampler, Scene, TextureRef, Wrap};
use etalon::study;
use etalon::study::shape::Shape;
use etalon_testing::gpu::{Gpu, bits, knobs};
use etalon_testing::made::{Made, at, lambert};
use etalon_testing::raycast::{Options, Ray, World};
use glam::{Affine2, DAffine3, DVec3};
use rayon::prelude::*;

const SIZE: [u32; 2] = [160, 120];

fn with(size: [u32; 2], choices: &[&str]) -> Settings {
    Settings {
        size,
        knobs: knobs(&[&["samples=1", "indirect=off", "reflection=off"], choices].concat()),
        ..Settings::default()
    }
}

/// Red of the film with maps over that without shadows; `None` where the light does not shine on the surface.
fn shares(gpu: &Gpu, scene: &Scene, size: [u32; 2]) -> Vec<Option<f64>> {
    let [off, map] = ["shadows=off", "shadows=map"].map(|choice| gpu.film(scene, with(size, &[choice])));
    let brightest = off.rgba.iter().fold(0.0_f32, |m, p| m.max(p[0]));
    let share =
        |(off, map): (&[f32; 4], &[f32; 4])| (off[0] > 1e-6 * brightest).then(|| f64::from(map[0]) / f64::from(off[0]));
    off.rgba.iter().zip(&map.rgba).map(share).collect()
}

/// Every triangle with corners of its own and its own normal.
fn faceted(shape: &Shape) -> Shape {
    let mut flat = Shape::default();
    for corners in shape.indices.chunks_exact(3) {
        let [a, b, c] = [0, 1, 2].map(|i| DVec3::from(shape.positions[corners[i] as usize].map(f64::from)));
        let n = (b - a).cross(c - a).normalize().as_vec3().to_array();
        for &corner in corners {
            flat.indices.push(flat.positions.len() as u32);
            flat.positions.push(shape.positions[corner as usize]);
            flat.normals.push(n);
            flat.uvs.push(shape.uvs[corner as usize]);
        }
    }
    flat
}

/// A floor, a box sunk into it, a ball, and a step under a slanted roof: hollows and edges of all kinds.
fn room() -> Made {
    let mut made = Made::new("room");
    made.add(Shape::plane(8.0, 8.0, 1), lambert([1.0; 3]), DAffine3::IDENTITY);
    let turned = DAffine3::from_rotation_y(0.4);
    made.add(Shape::cuboid(DVec3::new(0.8, 1.2, 0.6)), lambert([1.0; 3]), at(1.1, 0.5, -0.2) * turned);
    made.add(faceted(&Shape::sphere(0.6, 24)), lambert([1.0; 3]), at(-0.9, 0.55, 0.3));
    let slanted = DAffine3::from_rotation_x(0.5) * DAffine3::from_rotation_y(0.3);
    made.add(Shape::cuboid(DVec3::new(1.0, 0.05, 0.8)), lambert([1.0; 3]), at(0.2, 0.9, -1.6) * slanted);
    made.add(faceted(&Shape::torus(0.5, 0.2, 24)), lambert([1.0; 3]), at(-0.2, 0.15, 1.7));
    made.camera(DVec3::new(3.5, 3.0, 5.0), DVec3::new(0.0, 0.3, 0.0), etalon_testing::made::perspective(42.0));
    made
}

fn sun(elevation: f64, azimuth: f64) -> LightKind {
    let [e, a] = [elevation, azimuth].map(f64::to_radians);
    LightKind::Directional { direction: -DVec3::new(e.cos() * a.cos(), e.sin(), e.cos() * a.sin()) }
}

fn point(position: DVec3) -> LightKind {
    LightKind::Point { position, range: None }
}

fn spot(position: DVec3, target: DVec3, outer: f64) -> LightKind {
    let direction = (target - position).normalize();
    LightKind::Spot { position, direction, range: None, inner: 0.1, outer: outer.to_radians() }
}

fn all_kinds() -> Vec<(&'static str, LightKind)> {
    vec![
        ("zenith", sun(90.0, 0.0)),
        ("high sun", sun(75.0, 30.0)),
        ("sun", sun(40.0, 130.0)),
        ("low sun", sun(10.0, 70.0)),
        ("setting sun", sun(2.0, 200.0)),
        ("lamp above", point(DVec3::new(0.1, 2.8, 0.4))),
        ("lamp on the floor", point(DVec3::new(2.4, 0.12, 2.1))),
        ("lamp outside", point(DVec3::new(5.0, 6.0, 1.0))),
        ("lamp far away", point(DVec3::new(300.0, 700.0, -200.0))),
        ("lamp at the end of the world", point(DVec3::new(3e6, 2e6, 1e6))),
        ("distant spot", spot(DVec3::new(40.0, 30.0, -20.0), DVec3::new(0.5, 0.0, 0.0), 4.0)),
        ("distant wide spot", spot(DVec3::new(-40.0, 10.0, -20.0), DVec3::new(0.5, 0.0, 0.0), 60.0)),
        ("spot above", spot(DVec3::new(0.4, 3.5, 0.8), DVec3::ZERO, 35.0)),
        ("grazing spot", spot(DVec3::new(-3.6, 0.3, 2.5), DVec3::new(0.5, 0.1, -0.3), 40.0)),
        ("wide spot", spot(DVec3::new(0.5, 2.2, 0.2), DVec3::new(0.3, 0.0, 0.0), 80.0)),
    ]
}

/// A light's rays and how wide a texel of its map is at a point, across the ray.
struct Seen {
    kind: LightKind,
    center: DVec3,
    radius: f64,
}

impl Seen {
    /// Direction of the light at p, from it, and the distance.
    fn ray(&self, p: DVec3) -> (DVec3, f64) {
        match self.kind {
            LightKind::Directional { direction } => (direction, 4.0 * self.radius),
            LightKind::Point { position, .. } | LightKind::Spot { position, .. } => {
                ((p - position).normalize(), (p - position).length())
            }
        }
    }

    /// One light has a map of 2048 texels of its cone or of the scene's sphere, or six of 1024, with a border of 2:
    /// src/pass/shadow_map.rs.
    fn texel(&self, p: DVec3) -> f64 {
        let (_, distance) = self.ray(p);
        match self.kind {
            LightKind::Directional { .. } => 2.0 * self.radius / 2044.0,
            LightKind::Spot { position, .. } | LightKind::Point { position, .. } => {
                let around = (self.radius / (position - self.center).length()).min(1.0).asin();
                let half = if let LightKind::Spot { outer, .. } = self.kind { around.min(outer) } else { around };
                2.0 * distance * if half < 1.05 { half.tan() / 2044.0 } else { 1.0 / 1020.0 }
            }
        }
    }

    /// The first surface on the way from the light through `p`, with how far before `p` it is.
    fn first(&self, world: &World<'_>, p: DVec3) -> Option<(etalon_testing::raycast::Hit, f64)> {
        let (direction, distance) = self.ray(p);
        let hit = world.closest(&Ray::new(p - direction * distance, direction))?;
        Some((hit, distance - hit.distance))
    }
}

#[derive(Debug, Default)]
struct Wrong {
    dark: usize,
    lit: usize,
    /// What was judged: lit, dark, and not judged.
    judged: [usize; 3],
}

/// Pixels of these instances that the map has wrong, outside the band of an edge, seen from the light.
fn wrong(scene: &Scene, shares: &[Option<f64>], instances: std::ops::Range<usize>) -> Wrong {
    let camera = &scene.cameras[0];
    let bounds = scene.bounds().expect("bounds");
    let seen = Seen { kind: scene.lights[0].kind, center: bounds.center(), radius: bounds.radius() };
    let world = World::new(scene, Options::default());
    let pixels = etalon_testing::raycast::picture(scene, camera, SIZE[0], SIZE[1], Options::default());
    // How far a thing that is "at" a point may be off it for f64: the scene's size is some metres.
    let same = 1e-9 * seen.radius;
    let verdicts: Vec<[usize; 5]> = pixels
        .par_iter()
        .zip(shares)
        .filter_map(|(pixel, share)| {
            let (hit, share) = (pixel.hit?, (*share)?);
            let (direction, _) = seen.ray(hit.position);
            let cos = -hit.geometric_normal.dot(direction);
            if pixel.edge || cos <= 0.0 || !instances.contains(&hit.instance) {
                return None;
            }
            let p = hit.position;
            let reach = BAND * seen.texel(p);
            let is_lit = seen.first(&world, p).is_none_or(|(_, before)| before < same / cos);
            let across = direction.any_orthonormal_vector();
            let down = direction.cross(across);
            // A point of the surface is judged if all light around it, as far as the band reaches, meets the same: it
            // is lit, and so is all of a connected surface; or all is stopped before it gets to the point's plane.
            let clear = (0..48).all(|i| {
                let (ring, turn) = (f64::from(i / 12 + 1) / 4.0, f64::from(i % 12) / 12.0 * std::f64::consts::TAU);
                let off = (across * turn.cos() + down * turn.sin()) * (ring * reach);
                // Where that ray meets the plane of p.
                let on_plane = p + off + direction * (off.dot(hit.geometric_normal) / cos);
                let Some((other, before)) = seen.first(&world, on_plane) else { return is_lit };
                if is_lit {
                    let facing = -other.geometric_normal.dot(direction);
                    // Of one sheet with p: no further from it than two planes that meet between them would be.
                    (other.position - p).length() <= 1.1 * reach * (1.0 / cos + 1.0 / facing.max(1e-3))
                } else {
                    before > same / cos
                }
            });
            Some(match (clear, is_lit) {
                (false, _) => [0, 0, 0, 0, 1],
                // At a right angle to the light the stored normals' 16 bits are seen in the terminator: 0.998 at cos
                // 0.002.
                (true, true) => [usize::from(share < 0.99), 0, 1, 0, 0],
                (true, false) => [0, usize::from(share > 1e-3), 0, 1, 0],
            })
        })
        .collect();
    let sum = |i: usize| verdicts.iter().map(|v| v[i]).sum();
    Wrong { dark: sum(0), lit: sum(1), judged: [sum(2), sum(3), sum(4)] }
}

/// Two texels each way (shaders/lib/shadow.glsl), along the diagonal.
const BAND: f64 = 2.0 * std::f64::consts::SQRT_2;

#[test]
fn what_is_lit_is_lit_and_what_is_dark_is_dark() {
    let gpu = Gpu::open();
    let mut failures = Vec::new();
    for (name, kind) in all_kinds() {
        let mut made = room();
        made.light([10.0; 3], kind);
        let wrong = wrong(&made.0, &shares(&gpu, &made.0, SIZE), 0..usize::MAX);
        eprintln!("{name}: {wrong:?}");
        if wrong.dark + wrong.lit > 0 {
            failures.push(format!("{name}: {wrong:?}"));
        }
        let [lit, dark, open] = wrong.judged;
        assert!(lit > 1000 && dark > 30, "{name}: {wrong:?}");
        assert!(open < (lit + dark) / 3, "{name}: {wrong:?}");
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// Where a wall meets the floor, both lit, seen from so near that a texel has many pixels: no dark seam.
#[test]
fn hollows_have_no_seams() {
    let gpu = Gpu::open();
    let kinds = [
        ("high sun", sun(75.0, 30.0)),
        ("sun", sun(45.0, 60.0)),
        ("low sun", sun(10.0, 70.0)),
        ("lamp outside", point(DVec3::new(5.0, 6.0, 6.0))),
        ("lamp on the floor", point(DVec3::new(2.4, 0.12, 2.1))),
        ("spot above", spot(DVec3::new(1.4, 3.5, 0.8), DVec3::new(1.0, 0.0, 0.0), 35.0)),
    ];
    for (name, kind) in kinds {
        let mut made = room();
        made.light([10.0; 3], kind);
        // The foot of the box's side to +z.
        let foot = DVec3::new(1.1 + 0.3 * 0.4_f64.sin(), 0.0, -0.2 + 0.3 * 0.4_f64.cos());
        made.0.cameras.clear();
        made.camera(foot + DVec3::new(0.04, 0.05, 0.08), foot, etalon_testing::made::perspective(40.0));
        let wrong = wrong(&made.0, &shares(&gpu, &made.0, SIZE), 0..usize::MAX);
        eprintln!("{name}: {wrong:?}");
        assert!(wrong.dark + wrong.lit == 0 && wrong.judged[0] > 10_000, "{name}: {wrong:?}");
    }
}

/// A shadow's edge on a floor lies where f64 has it: a square blind above it, each kind of light, seen from so near
/// that a texel has many pixels. Whether a texel is covered is decided at its centre, and between covered and free
/// centres the share is interpolated: half of it is reached within a texel of the edge, and all of it within the four
/// around.
#[test]
fn edges_lie_where_they_should_within_a_texel() {
    let gpu = Gpu::open();
    let kinds = [
        ("zenith", sun(90.0, 0.0)),
        ("sun", sun(40.0, 130.0)),
        ("low sun", sun(15.0, 75.0)),
        ("lamp", point(DVec3::new(0.4, 2.8, 0.3))),
        ("lamp outside", point(DVec3::new(4.0, 9.0, 5.0))),
        ("spot", spot(DVec3::new(0.4, 3.5, 0.8), DVec3::ZERO, 35.0)),
        ("wide spot", spot(DVec3::new(-0.4, 2.2, 0.2), DVec3::new(0.3, 0.0, 0.0), 80.0)),
    ];
    for (name, kind) in kinds {
        let mut made = Made::new("blind");
        made.add(Shape::plane(12.0, 12.0, 1), lambert([1.0; 3]), DAffine3::IDENTITY);
        made.add(Shape::plane(1.0, 1.0, 1), lambert([1.0; 3]), at(0.0, 0.7, 0.0));
        made.light([10.0; 3], kind);
        let bounds = made.0.bounds().expect("bounds");
        let seen = Seen { kind, center: bounds.center(), radius: bounds.radius() };
        // Shadow of a point of the blind on the floor.
        let shadow = |corner: DVec3| {
            let (direction, _) = seen.ray(corner);
            corner - direction * (corner.y / direction.y)
        };
        for side in 0..4 {
            let corner = |i: usize| {
                let [x, z] = [[0.5, 0.5], [0.5, -0.5], [-0.5, -0.5], [-0.5, 0.5]][i % 4];
                shadow(DVec3::new(x, 0.7, z))
            };
            let (a, b) = (corner(side), corner(side + 1));
            let middle = (a + b) * 0.5;
            let outward = {
                let n = (b - a).cross(DVec3::Y).normalize();
                n * n.dot(middle - shadow(DVec3::new(0.0, 0.7, 0.0))).signum()
            };
            let (direction, _) = seen.ray(middle);
            // Texels across the ray, measured on the floor.
            let texel = seen.texel(middle) / -direction.y;
            let half_height = 8.0 * texel;
            // Below the blind, so that it is not in the way.
            let mut camera = etalon_testing::made::looking(middle + DVec3::Y * 0.5, middle);
            camera.projection = etalon::scene::Projection::Orthographic { half_height, near: 0.01, far: 1.0 };
            made.0.cameras = vec![camera];
            let size = [64, 64];
            let shares = shares(&gpu, &made.0, size);
            let (mut halves, mut count) = ((0.0_f64, 0.0_f64), 0);
            for (i, share) in shares.iter().enumerate() {
                let share = share.expect("a lit floor");
                let ray = etalon_testing::raycast::camera_ray(
                    &made.0.cameras[0],
                    64,
                    64,
                    (i % 64) as f64 + 0.5,
                    (i / 64) as f64 + 0.5,
                );
                let on_floor = ray.origin + ray.direction * (ray.origin.y / -ray.direction.y);
                let beyond = (on_floor - middle).dot(outward) / texel;
                if beyond.abs() > 1.5 {
                    let want = f64::from(u8::from(beyond > 0.0));
                    assert!((share - want).abs() < 1e-3, "{name}, side {side}: {share} at {beyond} texels");
                }
                if (0.25..0.75).contains(&share) {
                    halves = (halves.0.min(beyond), halves.1.max(beyond));
                    count += 1;
                }
            }
            eprintln!("{name}, side {side}: half of the light {halves:?} texels from the edge");
            assert!(count > 4, "{name}: {count} pixels on the edge");
            assert!(halves.0 > -1.0 && halves.1 < 1.0, "{name}, side {side}: {halves:?}");
        }
    }
}

/// The same scene a thousand times smaller and larger, in powers of two: the same picture, bit for bit.
#[test]
fn scale_does_not_matter() {
    let gpu = Gpu::open();
    for (name, kind) in all_kinds() {
        let films = [1.0, 2.0_f64.powi(-10), 1024.0].map(|scale| {
            let mut scene = room().0;
            let scaled = DAffine3::from_scale(DVec3::splat(scale));
            for instance in &mut scene.instances {
                instance.world_from_object = scaled * instance.world_from_object;
            }
            scene.cameras[0].world_from_camera.translation *= scale;
            let mut strength = (scale * scale) as f32;
            let kind = match kind {
                LightKind::Directional { .. } => {
                    strength = 1.0;
                    kind
                }
                LightKind::Point { position, range } => LightKind::Point { position: position * scale, range },
                LightKind::Spot { position, direction, range, inner, outer } => {
                    LightKind::Spot { position: position * scale, direction, range, inner, outer }
                }
            };
            let mut made = Made(scene);
            made.light([10.0 * strength; 3], kind);
            gpu.film(&made.0, with(SIZE, &["shadows=map"]))
        });
        assert!(bits(&films[0]) == bits(&films[1]) && bits(&films[0]) == bits(&films[2]), "{name}");
    }
}

/// A picture of holes and bars, alpha 0 and 255.
fn grating() -> Image {
    let rgba = (0..64).flat_map(|i| [255, 255, 255, if (i % 8 + i / 8) % 2 == 0 { 255 } else { 0 }]).collect();
    Image { name: "grating".to_owned(), width: 8, height: 8, rgba }
}

#[test]
fn masks_let_light_through_their_holes() {
    let gpu = Gpu::open();
    for (name, kind) in [("sun", sun(60.0, 40.0)), ("lamp", point(DVec3::new(0.2, 2.5, 0.3)))] {
        let mut made = Made::new("grating");
        made.add(Shape::plane(6.0, 6.0, 1), lambert([1.0; 3]), DAffine3::IDENTITY);
        made.0.images.push(grating());
        let sampler = Sampler {
            mag_nearest: true,
            min_nearest: true,
            wrap_u: Wrap::Clamp,
            wrap_v: Wrap::Clamp,
            ..Sampler::default()
        };
        let material = Material {
            alpha_mode: AlphaMode::Mask(0.5),
            base_color_texture: Some(TextureRef { image: 0, uv_set: 0, uv_transform: Affine2::IDENTITY, sampler }),
            ..lambert([1.0; 3])
        };
        made.add(Shape::plane(1.6, 1.6, 1), material, at(0.0, 0.6, 0.0));
        made.light([10.0; 3], kind);
        made.camera(DVec3::new(2.5, 3.0, 2.0), DVec3::ZERO, etalon_testing::made::perspective(45.0));
        let wrong = wrong(&made.0, &shares(&gpu, &made.0, SIZE), 0..usize::MAX);
        eprintln!("{name}: {wrong:?}");
        assert!(wrong.dark + wrong.lit == 0, "{name}: {wrong:?}");
        assert!(wrong.judged[1] > 100, "{name}: {wrong:?}");
    }
}

/// What lets light through does not stop it on this rung, and the plan says so.
#[test]
fn glass_and_blended_surfaces_cast_nothing() {
    let gpu = Gpu::open();
    let glass = Material { transmission: 1.0, ..lambert([1.0; 3]) };
    for material in [glass, etalon_testing::made::pane([1.0; 3], 0.9)] {
        let mut made = Made::new("pane");
        made.add(Shape::plane(6.0, 6.0, 1), lambert([1.0; 3]), DAffine3::IDENTITY);
        made.add(Shape::plane(1.0, 1.0, 1), material, at(0.0, 2.0, 0.0));
        made.light([1.0; 3], sun(70.0, 0.0));
        // Below the pane.
        made.camera(DVec3::new(1.0, 1.5, 1.0), DVec3::ZERO, etalon_testing::made::perspective(50.0));
        let lit: Vec<f64> = shares(&gpu, &made.0, SIZE).into_iter().flatten().collect();
        assert!(lit.len() > 1000 && lit.iter().all(|share| *share == 1.0), "{} pixels are lit", lit.len());
        let renderer = gpu.renderer(&made.0, None, with(SIZE, &["shadows=map"]));
        assert!(
            renderer.plan().warnings.iter().any(|w| w.contains("casts no shadow")),
            "{:?}",
            renderer.plan().warnings
        );
    }
}

/// Pixels of `a` and `b` that differ by more than a hundredth of the brightest, where `b` does not change within two
/// pixels by being shadowed: by how much of `off` is left of it.
fn unlike(a: &Picture, b: &Picture, off: &Picture) -> [usize; 2] {
    let (width, height) = (a.width as i32, a.height as i32);
    let at = |x: i32, y: i32| (y.clamp(0, height - 1) * width + x.clamp(0, width - 1)) as usize;
    let brightest = off.rgba.iter().fold(0.0_f32, |m, p| m.max(p[1])).min(1.0);
    let left = |i: usize| b.rgba[i][1] / off.rgba[i][1].max(1e-9);
    let (mut judged, mut unlike) = (0, 0);
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let i = at(x, y);
        let edge = (-2..=2).any(|v| (-2..=2).any(|u| (left(at(x + u, y + v)) - left(i)).abs() > 0.03));
        if !edge {
            judged += 1;
            unlike += usize::from((a.rgba[i][1] - b.rgba[i][1]).abs() > 0.01 * brightest);
        }
    }
    [unlike, judged]
}

#[test]
fn maps_and_rays_agree_away_from_edges() {
    let gpu = Gpu::open();
    let size = [320, 180];
    for name in ["lamps", "materials"] {
        let scene = study::load(name).expect("a study scene");
        let [off, map, ray] =
            ["off", "map", "ray"].map(|rung| gpu.film(&scene, with(size, &[&format!("shadows={rung}")])));
        let [unlike, judged] = unlike(&map, &ray, &off);
        eprintln!("{name}: {unlike} of {judged} pixels differ");
        // A pixel's centre next to an edge thinner than the pixels that were looked at.
        assert!(unlike * 5000 < judged && judged > 30_000, "{name}: {unlike} of {judged}");
    }
}

/// What a mirror shows is lit by the same maps, and so is what lies over it.
#[test]
fn mirrored_and_blended_surfaces_are_shadowed_too() {
    let gpu = Gpu::open();
    let mut made = room();
    let mirror = Material { metallic: 1.0, roughness: 0.0, ..lambert([0.9; 3]) };
    made.add(Shape::cuboid(DVec3::new(5.0, 3.0, 0.1)), mirror, at(0.0, 1.5, -2.8));
    made.light([3.0; 3], sun(50.0, 60.0));
    // Nothing lies below the pane: rays would lose half of their light in it, maps nothing.
    let mut over = Made::new("pane");
    let pane = Material { alpha_mode: AlphaMode::Blend, base_color: [1.0, 1.0, 1.0, 0.5], ..lambert([1.0; 3]) };
    over.add(Shape::plane(3.0, 3.0, 1), pane, DAffine3::IDENTITY);
    over.add(Shape::cuboid(DVec3::new(0.6, 0.4, 0.8)), lambert([1.0; 3]), at(0.2, 0.7, 0.1));
    over.light([3.0; 3], sun(50.0, 60.0));
    over.camera(DVec3::new(-2.0, 3.0, 2.0), DVec3::ZERO, etalon_testing::made::perspective(50.0));
    for scene in [made.0, over.0] {
        let [off, map, ray] = ["shadows=off", "shadows=map", "shadows=ray"]
            .map(|choice| gpu.film(&scene, with([320, 240], &["reflection=ray", choice])));
        let [wrong, judged] = unlike(&map, &ray, &off);
        let dark = map.rgba.iter().zip(&off.rgba).filter(|(map, off)| map[0] < 0.5 * off[0]).count();
        eprintln!("{}: {wrong} of {judged} pixels differ, {dark} are dark", scene.name);
        assert!(wrong * 2000 < judged && judged > 60_000 && dark > 500, "{}: {wrong}, {judged}, {dark}", scene.name);
    }
}

/// The maps are drawn once: the second picture costs nothing, and the first one again is the same.
#[test]
fn other_views_cost_nothing() {
    let gpu = Gpu::alone();
    let mut made = room();
    made.light([10.0; 3], point(DVec3::new(0.1, 2.8, 0.4)));
    let mut renderer = gpu.renderer(&made.0, None, with(SIZE, &["shadows=map"]));
    let mut other = made.0.cameras[0].clone();
    other.world_from_camera.translation += DVec3::new(0.5, 1.0, 0.0);
    let mut films = Vec::new();
    for (camera, drawn) in [(&made.0.cameras[0], true), (&other, false), (&made.0.cameras[0], false)] {
        let rendered = renderer.render(camera, &mut |_| ()).expect("a picture");
        assert_eq!(rendered.passes.iter().any(|pass| pass.name == "shadow maps"), drawn);
        films.push(bits(&renderer.film().expect("the film")));
    }
    assert!(films[0] == films[2] && films[0] != films[1]);
}

/// Many lights share 64 MiB; more than fit are an error that names the other rungs.
#[test]
fn many_lights_stay_within_the_budget() {
    let gpu = Gpu::alone();
    let lit_by = |count: usize| {
        let mut made = room();
        for i in 0..count {
            let turn = i as f64 * 2.4;
            let out = 0.3 + 3.0 * (i as f64 / count as f64).sqrt();
            let position = DVec3::new(out * turn.cos(), 2.0, out * turn.sin());
            made.light([10.0 / count as f32; 3], point(position));
        }
        made.0
    };
    for count in [1, 40, 600] {
        let scene = lit_by(count);
        let before = gpu.device.created().len();
        let [off, map] = ["shadows=off", "shadows=map"].map(|choice| gpu.film(&scene, with(SIZE, &[choice])));
        let bytes: Vec<u64> =
            gpu.device.created()[before..].iter().filter(|c| c.name == "shadow maps").map(|c| c.bytes).collect();
        eprintln!("{count} lights: {bytes:?} bytes");
        assert!(bytes.iter().all(|&bytes| bytes <= 64 << 20) && bytes.iter().any(|&bytes| bytes > 20 << 20));
        let sum = |film: &Picture| film.rgba.iter().map(|p| f64::from(p[0])).sum::<f64>();
        let share = sum(&map) / sum(&off);
        eprintln!("{count} lights: {share} of the light");
        assert!(share > 0.8 && share < 0.99);
    }
    let error = Renderer::new(&gpu.device, lit_by(1000), None, with(SIZE, &["shadows=map"])).err().expect("an error");
    let text = format!("{error:#}");
    assert!(text.contains("1000 lights") && text.contains("shadows=ray") && text.contains("shadows=off"), "{text}");
}

/// Triangles far smaller than texels, whose slopes the rasteriser computes badly: still almost no lit pixel is dark on
/// them. (Edges of their shadow on the floor lie closer to them than a few of these texels.)
#[test]
fn meshes_finer_than_texels_are_not_spotted() {
    let gpu = Gpu::open();
    for (name, kind) in
        [("sun", sun(35.0, 150.0)), ("low sun", sun(6.0, 150.0)), ("lamp", point(DVec3::new(-4.0, 2.0, 5.0)))]
    {
        let mut made = Made::new("fine");
        made.add(Shape::plane(60.0, 60.0, 1), lambert([1.0; 3]), DAffine3::IDENTITY);
        made.add(faceted(&Shape::sphere(0.6, 128)), lambert([1.0; 3]), at(0.0, 0.5, 0.0));
        made.light([10.0; 3], kind);
        made.camera(DVec3::new(-0.2, 1.0, 1.9), DVec3::new(0.0, 0.5, 0.0), etalon_testing::made::perspective(42.0));
        let wrong = wrong(&made.0, &shares(&gpu, &made.0, SIZE), 1..2);
        eprintln!("{name}: {wrong:?}");
        // The argument of lib/shadow.glsl needs planes as large as texels; what is left is a pixel in some thousands.
        assert!(wrong.dark * 1000 < wrong.judged[0] && wrong.lit == 0, "{name}: {wrong:?}");
        assert!(wrong.judged[0] > 1000, "{name}: {wrong:?}");
    }
}
