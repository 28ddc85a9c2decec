//! Ambient occlusion: light from all around with visibility, against f64 ray casts, closed forms and paths.
//!
//! Read docs/decisions/ambient-occlusion.md.

use std::array::from_fn;

use etalon::frame::Settings;
use etalon::image::Picture;
use etalon::plan::rungs::EffectId;
use etalon::plan::{ForcedEffects, Knobs, Model};
use etalon::prepare::{Conditions, Prepared};
use etalon::scene::environment::{Environment, direction, irradiance};
use etalon::scene::{Light, LightKind, Material, Scene};
use etalon::study;
use etalon::study::shape::Shape;
use etalon::transport::emitters::Sky;
use etalon::transport::occluders::squares;
use etalon::transport::sky_directions::Sphere;
use etalon_testing::gpu::{Gpu, knobs, settings, settings_of, spread, studio_of};
use etalon_testing::made::{Made, orthographic, perspective};
use etalon_testing::raycast::{Options, Ray, World, picture};
use glam::{DAffine3, DMat3, DVec3};

/// A diffuse material without a specular lobe.
fn matt(albedo: [f32; 3]) -> Material {
    let [r, g, b] = albedo;
    Material { base_color: [r, g, b, 1.0], specular: 0.0, roughness: 1.0, metallic: 0.0, ..Material::default() }
}

fn turned(axis: DVec3, degrees: f64, position: DVec3) -> DAffine3 {
    DAffine3 { matrix3: DMat3::from_axis_angle(axis, degrees.to_radians()), translation: position }
}

/// What is prepared for a scene under these rungs.
fn prepared(scene: &Scene, sky: Option<Sky>, choices: &[&str]) -> Prepared {
    let knobs = &knobs(choices);
    let conditions = Conditions { knobs, forced: ForcedEffects::None, sky, background: true, blurred: false };
    Prepared::new(scene.clone(), &conditions).expect("a scene")
}

fn film(gpu: &Gpu, scene: &Scene, environment: &Environment, size: [u32; 2], choices: &[&str]) -> Picture {
    let choices = [&["reflection=off", "refraction=off", "shadows=off"], choices].concat();
    gpu.shot(scene, Some(environment), Settings { knobs: knobs(&choices), ..settings(size) }).1
}

/// The list of directions of a pixel: each square of 4x4 has all 16, in an order of its own (`list_of` in the shader).
fn list_of(x: usize, y: usize) -> usize {
    let pcg = |x: u32| {
        let state = x.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let word = (state >> ((state >> 28) + 4) ^ state).wrapping_mul(277_803_737);
        word >> 22 ^ word
    };
    let [square_x, square_y] = [x / 4, y / 4].map(|at| at as u32);
    let order = pcg(square_x.wrapping_add(pcg(square_y.wrapping_add(pcg(0x402)))));
    (y % 4 * 4 + x % 4) ^ (order & 15) as usize
}

/// A floor with three panels that stand on it.
fn panels() -> Scene {
    let mut made = Made::new("panels");
    made.add(Shape::plane(6.0, 6.0, 1), matt([0.7, 0.5, 0.3]), DAffine3::IDENTITY);
    for (x, z, degrees) in [(-0.9, 0.2, 25.0), (0.4, -0.6, -40.0), (1.1, 0.5, 75.0)] {
        let place = turned(DVec3::Y, degrees, DVec3::new(x, 0.5, z));
        made.add(Shape::panel(0.8, 1.0), Material { double_sided: true, ..matt([0.2, 0.6, 0.8]) }, place);
    }
    made.camera(DVec3::new(1.5, 2.0, 3.5), DVec3::new(0.0, 0.3, 0.0), perspective(40.0));
    made.0
}

#[test]
fn the_share_that_arrives_is_that_of_ray_casts() {
    let (gpu, scene, map) = (Gpu::open(), panels(), Environment::studio());
    let size = [96, 64];
    let plain = film(&gpu, &scene, &map, size, &["samples=1", "indirect=ambient"]);
    let occluded = film(&gpu, &scene, &map, size, &["samples=1", "indirect=occlusion:16"]);
    let sky = Sky { map: &map, intensity: 1.0, rotation: 0.0 };
    let sphere = Sphere::new(sky);
    let lists: Vec<_> = (0..16).map(|list| sphere.directions(16, list)).collect();
    let options = Options { blend: true, textures: false };
    let world = World::new(&scene, options);
    let harmonics = map.irradiance_sh9();
    let prepared = prepared(&scene, Some(sky), &["indirect=occlusion:16"]);
    let rays = prepared.hierarchy.expect("rays");
    let radiosity = rays.occluder_radiosity;
    let seen = picture(&scene, &scene.cameras[0], size[0], size[1], options);
    let (mut compared, mut off, mut darker) = (0, 0, 0);
    for (i, pixel) in seen.iter().enumerate() {
        let Some(hit) = pixel.hit.as_ref().filter(|_| !pixel.edge) else { continue };
        let n = hit.geometric_normal;
        let origin = hit.position + n * 1e-5;
        let (mut sum, mut all, mut squared, mut shut, mut hemisphere) =
            ([0.0; 3], [0.0; 3], [DVec3::ZERO; 2], 0.0, 0.0);
        let (x, y) = (i % size[0] as usize, i / size[0] as usize);
        for at in &lists[list_of(x, y)] {
            let cos = n.dot(at.direction).max(0.0);
            let free = cos > 0.0 && world.closest(&Ray::new(origin, at.direction)).is_none();
            let projected = cos * at.solid_angle;
            hemisphere += projected;
            if !free {
                shut += projected;
                squared = from_fn(|side| squared[side] + projected * squares(at.direction)[side]);
            }
            for channel in 0..3 {
                all[channel] += at.weight[channel] * cos;
                sum[channel] += if free { at.weight[channel] * cos } else { 0.0 };
            }
        }
        let here = irradiance(&harmonics, n);
        let from = hit.position - rays.bvh.anchor;
        let sent = radiosity.at(from, squared.map(|sum| sum / shut.max(1e-30)), shut / hemisphere);
        let mut worst = 0.0_f64;
        for channel in 0..3 {
            let share = sum[channel] / all[channel];
            let expected = share + shut / hemisphere * sent[channel].max(0.0) / here[channel];
            let got = f64::from(occluded.rgba[i][channel]) / f64::from(plain.rgba[i][channel]);
            let error = (got - expected).abs();
            worst = worst.max(if error.is_nan() { f64::INFINITY } else { error });
            darker += usize::from(share < 0.9);
        }
        compared += 1;
        // A ray that grazes an edge may fall on either side in f32.
        off += usize::from(worst > 1e-4);
    }
    eprintln!("{compared} pixels, {off} off, {darker} darker by a tenth");
    assert!(compared > 3000 && darker > 1000, "{compared} pixels, {darker} darker");
    assert!(off * 200 <= compared, "{off} of {compared} pixels are off");
}

/// In half shadow neighbours differ, but not in a pattern that repeats: a mesh is seen more than grain.
#[test]
fn half_shadows_have_no_mesh() {
    let (gpu, map) = (Gpu::open(), Environment::studio());
    let mut made = Made::new("wall");
    made.add(Shape::panel(8.0, 8.0), matt([0.8; 3]), turned(DVec3::X, -90.0, DVec3::ZERO));
    made.add(Shape::panel(8.0, 8.0), matt([0.0; 3]), DAffine3::from_translation(DVec3::Z * -1.0));
    made.camera(DVec3::Y * 3.0, DVec3::ZERO, orthographic(0.2));
    let size = [64, 64];
    let film = film(&gpu, &made.0, &map, size, &["samples=1", "indirect=occlusion:16"]);
    let at = |x: usize, y: usize| f64::from(film.rgba[y * 64 + x][1]);
    // What a pixel is off the mean of its square, against the pixel at the same place of the next square.
    let off =
        |x: usize, y: usize| at(x, y) - (0..16).map(|i| at(x / 4 * 4 + i % 4, y / 4 * 4 + i / 4)).sum::<f64>() / 16.0;
    let (mut product, mut square) = (0.0, 0.0);
    for (x, y) in (0..64).flat_map(|y| (0..60).map(move |x| (x, y))) {
        product += off(x, y) * off(x + 4, y);
        square += off(x, y).powi(2);
    }
    eprintln!("correlation of squares {:.3}", product / square);
    assert!(square > 0.0 && (product / square).abs() < 0.3, "{product} of {square}");
}

#[test]
fn an_open_surface_has_plain_ambient_light() {
    let (gpu, map) = (Gpu::open(), Environment::studio());
    let mut made = Made::new("open");
    let tilt = turned(DVec3::new(1.0, 1.0, 0.0).normalize(), 20.0, DVec3::ZERO);
    made.add(Shape::panel(2.0, 2.0), matt([0.8, 0.8, 0.8]), tilt);
    made.front(0.5);
    let size = [32, 32];
    let plain = film(&gpu, &made.0, &map, size, &["samples=4", "indirect=ambient"]);
    for rung in ["indirect=occlusion:4", "indirect=occlusion:16", "indirect=occlusion:64"] {
        let open = film(&gpu, &made.0, &map, size, &["samples=4", rung]);
        for (a, b) in plain.rgba.iter().zip(&open.rgba) {
            for channel in 0..3 {
                assert!((a[channel] / b[channel] - 1.0).abs() < 1e-5, "{rung}: {a:?}, not {b:?}");
            }
        }
    }
}

/// In uniform light clear glass reflects as much towards a surface as away from it.
#[test]
fn clear_glass_hides_nothing_in_uniform_light() {
    let (gpu, map) = (Gpu::open(), Environment::constant([1.0; 3]));
    let mut made = Made::new("glass");
    made.add(Shape::plane(6.0, 6.0, 1), matt([0.6, 0.6, 0.6]), DAffine3::IDENTITY);
    let glass = Material { transmission: 1.0, roughness: 0.0, metallic: 0.0, ..Material::default() };
    let pane = Material { double_sided: true, ..glass.clone() };
    made.add(Shape::panel(2.0, 2.0), pane, turned(DVec3::Y, -90.0, DVec3::new(1.2, 1.0, 0.0)));
    let ball = Material { thickness: 1.0, ..glass };
    made.add(Shape::sphere(0.5, 32), ball, DAffine3::from_translation(DVec3::new(0.0, 0.6, 0.0)));
    made.camera(DVec3::new(0.8, 5.0, 0.0), DVec3::new(0.8, 0.0, 0.0), orthographic(0.3));
    let size = [16, 16];
    let shot = |rung: &str| {
        let choices = ["reflection=off", "refraction=ray", "shadows=off", "samples=4", rung];
        gpu.shot(&made.0, Some(&map), Settings { knobs: knobs(&choices), ..settings(size) }).1
    };
    let (plain, beside) = (shot("indirect=ambient"), shot("indirect=occlusion:16"));
    for (a, b) in plain.rgba.iter().zip(&beside.rgba) {
        // With what the glass reflects counted as hidden the first pixel lacks 4 %.
        assert!((a[0] / b[0] - 1.0).abs() < 1e-5 && b[0] > 0.5, "{b:?}, not {a:?}");
    }
}

/// A hemispherical bowl of radius 5 m, open at the top.
fn bowl(albedo: f32) -> Made {
    let mut made = Made::new("bowl");
    let mut shape = Shape::sphere(5.0, 96);
    let height = |i: u32| shape.positions[i as usize][1];
    shape.indices = shape
        .indices
        .as_chunks::<3>()
        .0
        .iter()
        .filter(|t| t.iter().all(|&i| height(i) < 1e-4))
        .flatten()
        .copied()
        .collect();
    made.add(shape, Material { double_sided: true, ..matt([albedo; 3]) }, DAffine3::IDENTITY);
    made
}

/// In a sphere every point sees every other one with the same form factor. Half of what a point of a hemisphere sees is
/// the hemisphere: E = E₀/2 / (1 − ρ/2).
#[test]
fn in_a_bowl_half_of_the_environment_arrives() {
    let (gpu, map) = (Gpu::open(), Environment::constant([1.0; 3]));
    let mut made = bowl(0.6);
    made.camera(DVec3::new(1.0, 5.0, 2.0), DVec3::new(1.0, 0.0, 2.0), orthographic(0.02));
    let got = film(&gpu, &made.0, &map, [16, 16], &["samples=16", "indirect=occlusion:64"]);
    let expected = 0.6 * 0.5 / (1.0 - 0.6 * 0.5);
    for pixel in &got.rgba {
        let ratio = f64::from(pixel[0]) / expected;
        // 1,024 directions, and the mean of some 8000 paths: what they find is 0.3 of the light.
        assert!((ratio - 1.0).abs() < 0.02, "{pixel:?}, not {expected}");
    }
}

/// The same bowl, seen in a small mirror that hardly occludes it.
#[test]
fn a_mirror_shows_what_is_occluded() {
    let (gpu, map) = (Gpu::open(), Environment::constant([1.0; 3]));
    let mut made = bowl(0.6);
    let polished = Material { base_color: [1.0; 4], metallic: 1.0, roughness: 0.0, ..Material::default() };
    made.add(Shape::panel(0.1, 0.1), polished, turned(DVec3::X, 135.0, DVec3::new(0.1, -0.5, 0.0)));
    made.camera(DVec3::new(0.1, -0.5, -3.0), DVec3::new(0.1, -0.5, 0.0), orthographic(0.02));
    let got = film(&gpu, &made.0, &map, [16, 16], &["reflection=ray", "samples=16", "indirect=occlusion:64"]);
    // Sixteen directions for each of 16 samples, about other axes in each pixel of a square. The mean of their ratios
    // is not the ratio of their means: about the first axes 8 % of the light are missing. Without visibility 40 % would
    // be too much.
    let sphere = Sphere::new(Sky { map: &map, intensity: 1.0, rotation: 0.0 });
    let p = DVec3::new(0.1, -(25.0_f64 - 0.01).sqrt(), 0.0);
    let radiosity = 0.6 * 0.5 / (1.0 - 0.6 * 0.5);
    let expected = [0, 1, 2, 3].map(|list| {
        let directions = sphere.directions(256, list);
        let shares = directions.chunks(16).map(|sample| {
            let cosine = |d: DVec3| (-p / 5.0).dot(d).max(0.0);
            // A ray leaves the sphere at p − 2 (p · d) d.
            let free = |d: DVec3| (p - 2.0 * p.dot(d) * d).y > 0.0;
            let sum = |counts: &dyn Fn(DVec3) -> bool| -> f64 {
                sample.iter().filter(|at| counts(at.direction)).map(|at| at.solid_angle * cosine(at.direction)).sum()
            };
            sum(&free) / sum(&|_| true)
        });
        let open = shares.sum::<f64>() / 16.0;
        0.6 * (open + (1.0 - open) * radiosity)
    });
    let mut seen = [0; 4];
    for pixel in &got.rgba {
        let off = expected.map(|expected| (f64::from(pixel[0]) / expected - 1.0).abs());
        let nearest = (0..4).min_by(|&a, &b| off[a].total_cmp(&off[b])).expect("lists");
        assert!(off[nearest] < 0.02, "{pixel:?}, none of {expected:?}");
        seen[nearest] += 1;
    }
    eprintln!("{expected:?} in {seen:?} pixels");
    // The last two differ by 1 %, as much as is known of what occluders send.
    let each = got.rgba.len() / 4;
    assert_eq!([seen[0], seen[1], seen[2] + seen[3]], [each, each, 2 * each], "each square has all lists");
}

#[test]
fn without_an_environment_and_lamps_the_plan_has_none() {
    let (gpu, map) = (Gpu::open(), Environment::studio());
    let settings = || Settings { knobs: knobs(&["indirect=occlusion:16", "shadows=off"]), ..settings([32, 32]) };
    let camera = panels().cameras[0].clone();
    let mut with = gpu.renderer(&panels(), Some(&map), settings());
    assert_eq!(with.plan().occlusion_rays(), 16);
    let is_pass = |pass: &etalon::gpu::PassPlan| pass.name == EffectId::AmbientOcclusion.name();
    assert!(with.passes(&camera).expect("passes").iter().any(is_pass));
    // A lamp whose light panels send to the floor, and one on a panel alone.
    let mut lit = panels();
    let lamp = LightKind::Point { position: DVec3::new(0.0, 2.0, 0.0), range: None };
    lit.lights.push(Light {
        name: String::new(),
        color: [1.0; 3],
        spectrum: None,
        extent: None,
        kind: lamp,
        proxy: false,
    });
    assert_eq!(prepared(&lit, None, &["indirect=occlusion:16"]).plan.occlusion_rays(), 16);
    lit.instances.truncate(1);
    let alone = prepared(&lit, None, &["indirect=occlusion:16"]).plan;
    let decided = alone.effects.iter().find(|effect| effect.id == EffectId::AmbientOcclusion).expect("a decision");
    assert!(
        alone.occlusion_rays() == 0 && decided.cause.contains("no surface sends light to another one"),
        "{}",
        decided.cause
    );
    let mut without = gpu.renderer(&panels(), None, settings());
    assert_eq!(without.plan().occlusion_rays(), 0);
    assert!(without.plan().rays.is_none(), "no BVH is built");
    assert!(!without.passes(&camera).expect("passes").iter().any(is_pass));
}

/// What occludes is lit from where it faces: a floor at the foot of a bright wall, in an environment that is brighter
/// in front of the wall than above. Truth is path tracing.
#[test]
fn a_wall_gives_back_the_light_that_it_faces() {
    let gpu = Gpu::open();
    let mut map = Environment::constant([1.0; 3]);
    (map.width, map.height) = (64, 32);
    let radiance = |i: u32| {
        let [u, v] = [(f64::from(i % 64) + 0.5) / 64.0, (f64::from(i / 64) + 0.5) / 32.0];
        [(1.0 + 0.9 * direction(u, v).z) as f32; 3]
    };
    map.radiance = (0..64 * 32).map(radiance).collect();
    let mut made = Made::new("wall");
    made.add(Shape::plane(8.0, 8.0, 1), matt([0.8; 3]), DAffine3::IDENTITY);
    made.add(Shape::panel(8.0, 4.0), matt([0.8; 3]), DAffine3::from_translation(DVec3::new(0.0, 2.0, 0.0)));
    made.camera(DVec3::new(0.0, 5.0, 1.0), DVec3::new(0.0, 0.0, 1.0), orthographic(0.02));
    let mean = |picture: &Picture| spread(picture, 0)[0];
    let got = mean(&film(&gpu, &made.0, &map, [16, 16], &["samples=16", "indirect=occlusion:64"]));
    let paths = Settings { knobs: Knobs::of(Model::Global), ..settings([16, 16]) };
    let wanted = mean(&gpu.shot(&made.0, Some(&map), paths).1);
    eprintln!("{got} for {wanted}");
    // One function for all of the floor: 4 % are missing. With no light from the wall it would be more than a third.
    assert!((got / wanted - 1.0).abs() < 0.06, "{got}, not {wanted}");
}

/// A closed room with a lamp, without an environment, in which light reaches each wall from the others. Truth is path
/// tracing.
#[test]
fn walls_give_back_the_light_of_a_lamp() {
    let gpu = Gpu::open();
    let mut made = Made::new("room");
    let wall = |made: &mut Made, albedo: [f32; 3], axis: DVec3, degrees: f64, at: DVec3| {
        made.add(Shape::panel(2.0, 2.0), Material { double_sided: true, ..matt(albedo) }, turned(axis, degrees, at));
    };
    for z in [-1.0, 1.0] {
        wall(&mut made, [0.5; 3], DVec3::X, 0.0, DVec3::new(0.0, 0.0, z));
        wall(&mut made, [0.5; 3], DVec3::X, 90.0, DVec3::new(0.0, z, 0.0));
        wall(
            &mut made,
            if z < 0.0 { [0.8, 0.1, 0.1] } else { [0.1, 0.1, 0.8] },
            DVec3::Y,
            90.0,
            DVec3::new(z, 0.0, 0.0),
        );
    }
    made.light([1.0; 3], LightKind::Point { position: DVec3::new(0.0, 0.3, 0.0), range: None });
    made.camera(DVec3::new(0.0, 0.0, 0.9), DVec3::new(0.0, -0.4, 0.0), perspective(80.0));
    let size = [32, 32];
    let choices = ["indirect=occlusion:16", "samples=16", "brdf=ggx"];
    let got = gpu.shot(&made.0, None, Settings { knobs: knobs(&choices), ..settings(size) }).1;
    let paths = Settings { knobs: knobs(&["indirect=path", "samples=256", "brdf=ggx"]), ..settings(size) };
    let wanted = gpu.shot(&made.0, None, paths).1;
    let direct = knobs(&["indirect=occlusion:16", "samples=16", "brdf=ggx", "indirect=ambient"]);
    let direct = gpu.shot(&made.0, None, Settings { knobs: direct, ..settings(size) }).1;
    let off = |picture: &Picture, channel: usize| {
        let pairs = picture.rgba.iter().zip(&wanted.rgba);
        let [square, all] = pairs.fold([0.0, 0.0], |[square, all], (a, b)| {
            let (a, b) = (f64::from(a[channel]), f64::from(b[channel]));
            [square + (a - b).powi(2), all + b * b]
        });
        (square / all).sqrt()
    };
    for channel in 0..3 {
        let [with, without] = [off(&got, channel), off(&direct, channel)];
        eprintln!("channel {channel}: {with:.4}, without {without:.4}");
        // What is left: one cube with slopes for the whole room, and the reference's noise.
        assert!(with < 0.07 && without > 0.3, "channel {channel}: {with}, without {without}");
    }
}

/// A room with a bright patch, a hundredth of its walls, from which all other light comes: what is far off the fit is
/// not lost. Truth is path tracing.
#[test]
fn a_patch_of_light_lights_a_room() {
    let gpu = Gpu::open();
    let mut made = Made::new("room");
    for z in [-1.0, 1.0] {
        for (axis, degrees, at) in [(DVec3::X, 0.0, DVec3::Z), (DVec3::X, 90.0, DVec3::Y), (DVec3::Y, 90.0, DVec3::X)] {
            let material = Material { double_sided: true, ..matt([0.5; 3]) };
            made.add(Shape::panel(2.0, 2.0), material, turned(axis, degrees, at * z));
        }
    }
    let (position, direction) = (DVec3::new(0.0, 0.8, 0.0), DVec3::NEG_Y);
    made.light([20.0; 3], LightKind::Spot { position, direction, range: None, inner: 0.16, outer: 0.18 });
    made.camera(DVec3::new(0.0, 0.3, 0.9), DVec3::new(0.0, 0.5, -1.0), perspective(60.0));
    let mean = |choices: &[&str]| {
        let picture = gpu.shot(&made.0, None, Settings { knobs: knobs(choices), ..settings([24, 24]) }).1;
        picture.rgba.iter().map(|pixel| f64::from(pixel[0])).sum::<f64>()
    };
    let ratio = mean(&["indirect=occlusion:16", "samples=16", "brdf=ggx"])
        / mean(&["indirect=path", "samples=1024", "brdf=ggx"]);
    // 1.20 by least squares alone, and 0.73 where rays far off count less and nothing makes up for it: one function for
    // the whole room does not know where its light is.
    assert!((ratio - 1.0).abs() < 0.2, "{ratio}");
}

/// Panels on a ground 400 m wide, on which hardly any points would lie by area: what they face is found.
#[test]
fn what_stands_on_a_large_ground_is_found() {
    let map = Environment::constant([1.0; 3]);
    let mut made = Made::new("ground");
    made.add(Shape::plane(400.0, 400.0, 1), matt([0.6; 3]), DAffine3::IDENTITY);
    for (axis, z) in [(DVec3::Y, 0.5), (DVec3::Y, -0.5)] {
        let place = turned(axis, 0.0, DVec3::new(0.0, 0.5, z));
        made.add(Shape::panel(1.0, 1.0), Material { double_sided: true, ..matt([0.6; 3]) }, place);
    }
    let sky = Sky { map: &map, intensity: 1.0, rotation: 0.0 };
    let radiosity =
        prepared(&made.0, Some(sky), &["indirect=occlusion:16"]).hierarchy.expect("rays").occluder_radiosity;
    // The panels see the ground, which has nearly all of the sky beside them and less between them: B is below 0.6 π.
    let below = radiosity.at(DVec3::ZERO, squares(DVec3::NEG_Y), 0.5).x;
    assert!(below > 1.2 && below < 0.6 * std::f64::consts::PI, "{below}");
}

/// The few surfaces beside a lamp, which are brighter than all others by far, do not bend the function for the whole
/// scene: the basin of study:etalon is blue. Truth is path tracing.
#[test]
fn surfaces_beside_a_lamp_do_not_count_for_all() {
    let gpu = Gpu::open();
    let scene = study::load("etalon").expect("a scene");
    let shown = |model: Model, samples: &str| {
        let environment_intensity = studio_of(&scene).expect("a studio");
        let settings = Settings { environment_intensity, ..settings_of(model, [160, 90], &[samples]) };
        let picture = gpu.shot(&scene, Some(&Environment::studio()), settings).1;
        // The outside of the basin, which faces the floor.
        let pixels: Vec<_> = (64..69).flat_map(|y| (117..140).map(move |x| (y * 160 + x) as usize)).collect();
        from_fn::<f64, 3, _>(|i| pixels.iter().map(|&at| f64::from(picture.rgba[at][i])).sum::<f64>())
    };
    let got = shown(Model::Recursive, "samples=16");
    let wanted = shown(Model::Global, "samples=256");
    let ratios: [f64; 3] = from_fn(|i| got[i] / wanted[i]);
    // 2.3 times as red by least squares alone.
    assert!(ratios.iter().all(|ratio| (ratio - 1.0).abs() < 0.15), "{ratios:?}");
}
