//! Ambient occlusion: the environment's light with visibility, against f64 ray casts and in closed form.
//!
//! Read docs/decisions/ambient-occlusion.md.

use etalon::frame::Settings;
use etalon::image::Picture;
use etalon::plan::rungs::EffectId;
use etalon::plan::{Knobs, Model};
use etalon::scene::environment::{Environment, direction, irradiance};
use etalon::scene::{Material, Scene};
use etalon::study::shape::Shape;
use etalon::transport::bvh::Bvh;
use etalon::transport::emitters::Sky;
use etalon::transport::occluders::mean_albedo;
use etalon::transport::sky_directions::Sphere;
use etalon_testing::gpu::{Gpu, knobs, settings, spread};
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

fn film(gpu: &Gpu, scene: &Scene, environment: &Environment, size: [u32; 2], choices: &[&str]) -> Picture {
    let choices = [&["reflection=off", "refraction=off", "shadows=off"], choices].concat();
    gpu.shot(scene, Some(environment), Settings { knobs: knobs(&choices), ..settings(size) }).1
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
    let sphere = Sphere::new(Sky { map: &map, intensity: 1.0, rotation: 0.0 });
    let lists: Vec<_> = (0..16).map(|list| sphere.directions(16, list)).collect();
    let options = Options { blend: true, textures: false };
    let world = World::new(&scene, options);
    let harmonics = map.irradiance_sh9();
    let solids = etalon::scene::solid::solids(&scene);
    let faced = mean_albedo(&scene, &solids, &Bvh::build(&scene).expect("a tree"), 1e-6);
    // As many rays reach the panels' fronts from the floor as reach it from them; those to their backs come on top.
    assert!((faced[0] - 1.1 / 3.0).abs() < 0.05 && (faced[1] - 1.7 / 3.0).abs() < 0.05, "{faced:?}");
    let seen = picture(&scene, &scene.cameras[0], size[0], size[1], options);
    let (mut compared, mut off, mut darker) = (0, 0, 0);
    for (i, pixel) in seen.iter().enumerate() {
        let Some(hit) = pixel.hit.as_ref().filter(|_| !pixel.edge) else { continue };
        let n = hit.geometric_normal;
        let origin = hit.position + n * 1e-5;
        let (mut sum, mut all, mut away, mut shut, mut hemisphere) = ([0.0; 3], [0.0; 3], DVec3::ZERO, 0.0, 0.0);
        let (x, y) = (i % size[0] as usize, i / size[0] as usize);
        for at in &lists[y % 4 * 4 + x % 4] {
            let cos = n.dot(at.direction).max(0.0);
            let free = cos > 0.0 && world.closest(&Ray::new(origin, at.direction)).is_none();
            let projected = cos * at.solid_angle;
            hemisphere += projected;
            if !free {
                shut += projected;
                away += projected * at.direction;
            }
            for channel in 0..3 {
                all[channel] += at.weight[channel] * cos;
                sum[channel] += if free { at.weight[channel] * cos } else { 0.0 };
            }
        }
        let here = irradiance(&harmonics, n);
        let there = irradiance(&harmonics, -away.normalize_or(-n));
        let albedo = if hit.position.y < 1e-3 { [0.7, 0.5, 0.3] } else { [0.2, 0.6, 0.8] };
        let mut worst = 0.0_f64;
        for channel in 0..3 {
            let share = sum[channel] / all[channel];
            let (obscured, brightness) = (shut / hemisphere, there[channel] / here[channel]);
            let of_others = 0.5 * (albedo[channel] + faced[channel]);
            let (received, given) = (of_others * obscured, albedo[channel] * obscured);
            let expected = (share + received * (1.0 - obscured) * brightness) / (1.0 - received * given);
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

/// Beside a wall without end half of the irradiance arrives, and the wall, which has the same, gives back ρ of it:
/// E = E₀/2 / (1 − ρ/2).
#[test]
fn beside_a_wall_half_of_the_environment_arrives() {
    let (gpu, map) = (Gpu::open(), Environment::constant([1.0; 3]));
    let mut made = Made::new("wall");
    made.add(Shape::plane(400.0, 400.0, 1), matt([0.6, 0.6, 0.6]), DAffine3::IDENTITY);
    let wall = turned(DVec3::Y, 90.0, DVec3::new(0.0, 100.0, 0.0));
    made.add(Shape::panel(400.0, 200.0), matt([0.6, 0.6, 0.6]), wall);
    made.camera(DVec3::new(0.1, 5.0, 0.0), DVec3::new(0.1, 0.0, 0.0), orthographic(0.02));
    let size = [16, 16];
    let got = film(&gpu, &made.0, &map, size, &["samples=16", "indirect=occlusion:64"]);
    let expected = 0.6 * 0.5 / (1.0 - 0.6 * 0.5);
    for pixel in &got.rgba {
        let ratio = f64::from(pixel[0]) / expected;
        // 1,024 directions. The wall is 200 m high and the floor 0.1 m away: the rest of the half is below 1e-6.
        assert!((ratio - 1.0).abs() < 0.02, "{pixel:?}, not {expected}");
    }
}

/// The same floor, seen in a small mirror that hardly occludes it.
#[test]
fn a_mirror_shows_what_is_occluded() {
    let (gpu, map) = (Gpu::open(), Environment::constant([1.0; 3]));
    let mut made = Made::new("mirror");
    made.add(Shape::plane(400.0, 400.0, 1), matt([0.6, 0.6, 0.6]), DAffine3::IDENTITY);
    let wall = turned(DVec3::Y, 90.0, DVec3::new(0.0, 100.0, 0.0));
    made.add(Shape::panel(400.0, 200.0), matt([0.6, 0.6, 0.6]), wall);
    let polished = Material { base_color: [1.0; 4], metallic: 1.0, roughness: 0.0, ..Material::default() };
    made.add(Shape::panel(0.1, 0.1), polished, turned(DVec3::X, 135.0, DVec3::new(0.1, 5.0, 0.0)));
    made.camera(DVec3::new(0.1, 5.0, -3.0), DVec3::new(0.1, 5.0, 0.0), orthographic(0.02));
    let got = film(&gpu, &made.0, &map, [16, 16], &["reflection=ray", "samples=16", "indirect=occlusion:64"]);
    let expected = 0.6 * 0.5 / (1.0 - 0.6 * 0.5);
    for pixel in &got.rgba {
        let ratio = f64::from(pixel[0]) / expected;
        // Sixteen directions for each of 16 samples: the mean of their ratios is 2 % off. Without visibility: 40 %.
        assert!((ratio - 1.0).abs() < 0.03, "{pixel:?}, not {expected}");
    }
}

#[test]
fn the_plan_has_it_only_with_an_environment() {
    let (gpu, map) = (Gpu::open(), Environment::studio());
    let settings = || Settings { knobs: knobs(&["indirect=occlusion:16", "shadows=off"]), ..settings([32, 32]) };
    let camera = panels().cameras[0].clone();
    let mut with = gpu.renderer(&panels(), Some(&map), settings());
    assert_eq!(with.plan().occlusion_rays(), 16);
    let is_pass = |pass: &etalon::gpu::PassPlan| pass.name == EffectId::AmbientOcclusion.name();
    assert!(with.passes(&camera).expect("passes").iter().any(is_pass));
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
    made.add(Shape::plane(400.0, 400.0, 1), matt([0.8; 3]), DAffine3::IDENTITY);
    made.add(Shape::panel(400.0, 200.0), matt([0.8; 3]), DAffine3::from_translation(DVec3::new(0.0, 100.0, 0.0)));
    made.camera(DVec3::new(0.0, 5.0, 1.0), DVec3::new(0.0, 0.0, 1.0), orthographic(0.02));
    let mean = |picture: &Picture| spread(picture, 0)[0];
    let got = mean(&film(&gpu, &made.0, &map, [16, 16], &["samples=16", "indirect=occlusion:64"]));
    let paths = Settings { knobs: Knobs::of(Model::Global), ..settings([16, 16]) };
    let wanted = mean(&gpu.shot(&made.0, Some(&map), paths).1);
    eprintln!("{got} for {wanted}");
    // The wall is taken to face the mean occluded direction, which is not level: 5 % are missing. With the floor's own
    // irradiance for that of the wall, (0.5 + 0.6/π)/(1 − 0.8 · 0.31), it would be 24 %.
    assert!((got / wanted - 1.0).abs() < 0.07, "{got}, not {wanted}");
}
