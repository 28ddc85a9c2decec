//! Radiance against closed forms: one light over one Lambert plane, where the answer is a line of algebra; many lights
//! against an f64 sum over all of them (crates/testing/src/shade.rs), which finds a light that a tile's list lost;
//! emitters; and the environment, inside which a white body must vanish.

use std::f64::consts::PI;

use etalon::frame::{Background, Renderer, Settings};
use etalon::image::Picture;
use etalon::optics::fresnel::fresnel_dielectric;
use etalon::optics::{SplitMix64, brdf};
use etalon::plan::{Knobs, Model};
use etalon::scene::environment::{self, Environment};
use etalon::scene::{LightKind, Material, Scene};
use etalon::study::shape::Shape;
use etalon::study::{self, generate};
use etalon::upload::view::View;
use etalon_testing::gpu::{Gpu, assert_finite, bits, knobs, largest_difference, settings};
use etalon_testing::made::{Made, at, lambert, unlit};
use glam::{DAffine3, DVec3, Vec3};

const SIZE: [u32; 2] = [64, 36];

/// A wall in the plane z = 0 that faces a parallel view: albedo, normal and positions are exact or nearly so there.
fn wall(albedo: [f32; 3]) -> Made {
    let mut made = Made::new("wall");
    made.add(Shape::panel(8.0, 4.0), lambert(albedo), DAffine3::IDENTITY);
    made.front(1.0);
    made
}

/// World position of a pixel's centre on the wall.
fn on_wall(i: usize, size: [u32; 2]) -> DVec3 {
    let (x, y) = ((i as u32 % size[0]) as f64 + 0.5, (i as u32 / size[0]) as f64 + 0.5);
    let (w, h) = (f64::from(size[0]), f64::from(size[1]));
    DVec3::new((2.0 * x / w - 1.0) * w / h, 1.0 - 2.0 * y / h, 0.0)
}

/// Largest relative error of the film against `expected` per pixel, over the brightest expected value of a channel
/// times `floor` where the expected value is smaller than that.
fn worst(film: &Picture, floor: f64, expected: impl Fn(usize) -> DVec3) -> f64 {
    let all: Vec<DVec3> = (0..film.rgba.len()).map(expected).collect();
    let brightest = all.iter().fold(0.0_f64, |m, e| m.max(e.max_element()));
    assert!(brightest > 0.0, "nothing is lit");
    let mut most = 0.0_f64;
    for (got, want) in film.rgba.iter().zip(&all) {
        for c in 0..3 {
            most = most.max((f64::from(got[c]) - want[c]).abs() / want[c].max(floor * brightest));
        }
    }
    most
}

#[test]
fn a_directional_light_gives_irradiance_times_albedo_over_pi_times_cosine() {
    let gpu = Gpu::open();
    let albedo = [0.75, 0.5, 0.125];
    for (direction, color) in [
        (DVec3::NEG_Z, [1.0, 2.0, 4.0]),
        (DVec3::new(0.3, -0.4, -1.0), [3.0; 3]),
        (DVec3::new(1.0, 0.0, -1e-2), [1e4, 1e-4, 1.0]),
        // From behind: nothing.
        (DVec3::new(0.3, 0.2, 0.9), [1.0; 3]),
    ] {
        let direction = direction.normalize();
        let mut made = wall(albedo);
        made.light(color, LightKind::Directional { direction });
        let film = gpu.film(&made.0, settings(SIZE));
        let cos = (-direction.z).max(0.0);
        for pixel in &film.rgba {
            for c in 0..3 {
                let want = f64::from(color[c]) * f64::from(albedo[c]) / PI * cos;
                // Five f32 factors.
                assert!((f64::from(pixel[c]) - want).abs() <= 1e-6 * want, "{direction}: {pixel:?}, {want}");
            }
        }
    }
}

#[test]
fn a_point_light_falls_with_the_square_of_the_distance_and_ends_at_its_range() {
    let gpu = Gpu::open();
    for range in [None, Some(0.6), Some(2.0), Some(100.0)] {
        for z in [0.1, 0.5, 1.0, 7.0, 1e4] {
            let position = DVec3::new(0.3, -0.2, z);
            let mut made = wall([0.5, 1.0, 0.25]);
            made.light([2.0, 3.0, 5.0], LightKind::Point { position, range });
            let film = gpu.film(&made.0, settings(SIZE));
            let expected = |i: usize| {
                let d = position - on_wall(i, SIZE);
                let r = d.length();
                let window = range.map_or(1.0, |range| (1.0 - (r / range).powi(4)).max(0.0));
                DVec3::new(1.0, 3.0, 1.25) / PI * (d.z / r) / (r * r) * window
            };
            if range.is_some_and(|range| range <= z) {
                assert!(film.rgba.iter().all(|p| p[..3] == [0.0; 3]), "range {range:?} at {z}");
                continue;
            }
            // The wall's depth is good to an ulp of 1 over a range of 40 m: 1.2e-6 m, and cosθ / r² has three powers of
            // it; where the window closes it is a difference of ones, whose error is absolute and has four more.
            let error = worst(&film, if range.is_some() { 1.0 } else { 0.01 }, expected);
            eprintln!("range {range:?}, height {z}: {error:e}");
            assert!(error < 2e-6 + 12e-6 / z, "range {range:?}, height {z}: {error:e}");
        }
    }
}

#[test]
fn a_point_light_far_away_is_a_directional_light() {
    let gpu = Gpu::open();
    let towards = DVec3::new(0.4, 0.3, 1.0).normalize();
    for r in [1e4, 1e6, 1e9] {
        let mut near = wall([0.8; 3]);
        near.light([(2.0 * r * r) as f32; 3], LightKind::Point { position: towards * r, range: None });
        let mut far = wall([0.8; 3]);
        far.light([2.0; 3], LightKind::Directional { direction: -towards });
        let [near, far] = [near, far].map(|made| gpu.film(&made.0, settings(SIZE)));
        // The wall reaches 2 m from the point that the light is r away from: (1 ± 2/r)² and the cosine as much again.
        let error = worst(&near, 1.0, |i| Vec3::from_slice(&far.rgba[i]).as_dvec3());
        eprintln!("{r:e} m: {error:e}");
        assert!(error < 8.0 / r + 2e-6, "{r:e} m: {error:e}");
    }
}

#[test]
fn a_spot_has_a_squared_ramp_between_its_cones() {
    let gpu = Gpu::open();
    for (inner, outer, axis, half_height) in [
        (10.0_f64, 30.0_f64, DVec3::NEG_Z, 1.0),
        (0.0, 40.0, DVec3::new(0.4, 0.1, -1.0), 1.0),
        (20.0, 20.5, DVec3::new(-0.2, 0.1, -1.0), 1.0),
        (0.0, 90.0, DVec3::new(0.0, -0.3, -1.0), 1.0),
        // Narrow ones, whose cosines differ by less than 0.001, over a picture as small as their spot.
        (0.5, 1.0, DVec3::NEG_Z, 0.03),
        (0.0, 2.0, DVec3::NEG_Z, 0.06),
        (0.5, 1.0, DVec3::new(0.02, -0.01, -1.0), 0.06),
    ] {
        let (inner, outer, direction) = (inner.to_radians(), outer.to_radians(), axis.normalize());
        let position = if half_height < 1.0 { DVec3::Z * 1.5 } else { DVec3::new(0.1, 0.2, 1.5) };
        let mut made = wall([0.5; 3]);
        made.0.cameras[0].projection = etalon_testing::made::orthographic(half_height);
        made.light([7.0; 3], LightKind::Spot { position, direction, range: Some(9.0), inner, outer });
        let film = gpu.film(&made.0, settings(SIZE));
        let light = made.0.lights[0].clone();
        let error = worst(&film, 1.0, |i| {
            let (l, e) = etalon_testing::shade::incident(&light, on_wall(i, SIZE) * half_height);
            e * 0.5 / PI * l.z
        });
        // The ramp's slope over cosθ is 1 / (cos inner − cos outer), and it is squared: twice that is what errors of
        // cosθ grow by. These are 1.2e-6 m (see above) at 1.5 m times sinθ, and four roundings of half an ulp of 1.
        let slope = 2.0 / (inner.cos() - outer.cos());
        eprintln!("{inner} to {outer}: {error:e}");
        assert!(error < 3e-6 + (8e-7 * outer.sin() + 2.4e-7) * slope, "{inner} to {outer}: {error:e}");
    }
}

/// Some of every kind over a scene with slopes and gloss.
fn lit_scene(count: usize) -> Scene {
    let mut scene = study::load("lamps").expect("a study scene");
    scene.lights.clear();
    let mut random = SplitMix64::new(7);
    let mut made = Made(scene);
    for i in 0..count {
        let color = [0, 1, 2].map(|_| random.between(0.2, 3.0) as f32);
        let position = DVec3::new(random.between(-4.0, 4.0), random.between(0.5, 3.0), random.between(-3.0, 3.0));
        let direction = DVec3::new(random.between(-1.0, 1.0), -1.0, random.between(-1.0, 1.0)).normalize();
        made.light(
            color,
            match i % 3 {
                0 => LightKind::Point { position, range: None },
                1 => LightKind::Spot { position, direction, range: None, inner: 0.2, outer: 0.8 },
                _ => LightKind::Directional { direction },
            },
        );
    }
    made.0
}

#[test]
fn light_adds_up_in_any_order() {
    let gpu = Gpu::open();
    let scene = lit_scene(9);
    let together = gpu.film(&scene, settings(SIZE));
    let brightest = together.rgba.iter().flatten().fold(0.0_f32, |m, v| m.max(*v));
    assert!(brightest > 0.5);
    let mut sum = vec![[0.0_f64; 3]; together.rgba.len()];
    for light in &scene.lights {
        let alone = Scene { lights: vec![light.clone()], ..scene.clone() };
        for (sum, pixel) in sum.iter_mut().zip(&gpu.film(&alone, settings(SIZE)).rgba) {
            for c in 0..3 {
                sum[c] += f64::from(pixel[c]);
            }
        }
    }
    let mut turned = scene.clone();
    turned.lights.reverse();
    turned.lights.swap(1, 6);
    let other = gpu.film(&turned, settings(SIZE));
    for ((a, b), want) in together.rgba.iter().zip(&other.rgba).zip(&sum) {
        for c in 0..3 {
            // Nine positive terms: eight additions of half an ulp of the sum.
            let bound = 8.0 * 2.0_f64.powi(-24) * want[c] + 1e-30;
            assert!((f64::from(a[c]) - want[c]).abs() <= bound, "{a:?} and the sum of the pictures {want:?}");
            assert!((f64::from(a[c]) - f64::from(b[c])).abs() <= 2.0 * bound, "{a:?} and reordered {b:?}");
        }
    }
}

/// The film against all lights in f64, at the points, normals and materials that the G-buffer holds.
fn against_all_lights(gpu: &Gpu, scene: &Scene, orthographic: bool, size: [u32; 2]) -> f64 {
    let mut settings = settings(size);
    settings.knobs.set("brdf=ggx").expect("a rung");
    let (film, aovs, view) = gpu.all(scene, &scene.cameras[0], settings);
    let mut error = 0.0_f64;
    let (mut lit, mut brightest) = (0, 0.0_f64);
    let mut wants = Vec::new();
    for pixel in &aovs {
        let want = (pixel.material != 0).then(|| {
            etalon_testing::shade::direct(scene, &etalon_testing::shade::point(scene, pixel, &view, orthographic))
        });
        brightest = brightest.max(want.unwrap_or_default().max_element());
        lit += usize::from(want.is_some_and(|w| w.max_element() > 0.0));
        wants.push(want);
    }
    assert!(lit * 8 > aovs.len(), "only {lit} of {} pixels are lit", aovs.len());
    for (i, (got, want)) in film.rgba.iter().zip(&wants).enumerate() {
        let Some(want) = want else { continue };
        for c in 0..3 {
            let e = (f64::from(got[c]) - want[c]).abs() / want[c].max(1e-3 * brightest);
            let e = if e.is_nan() { f64::INFINITY } else { e };
            if e > error {
                error = e;
                if e > 1e-4 {
                    eprintln!("{i}: {got:?} for {want} {:?}", aovs[i]);
                }
            }
        }
    }
    error
}

#[test]
fn lists_of_lights_per_tile_lose_no_light() {
    let gpu = Gpu::open();
    for count in [1, 15, 16, 33, 1000] {
        for orthographic in [false, true] {
            // Neither divides by the tiles of 16 nor by the work tiles of 8.
            let size = if count == 1000 { [67, 37] } else { [123, 71] };
            let mut scene = generate::lights(count);
            // A few lights reach everywhere and far, on both sides of the limit of the lists.
            for (i, light) in scene.lights.iter_mut().enumerate() {
                if let (0, LightKind::Point { range, .. }) = (i % 7, &mut light.kind) {
                    *range = if i % 2 == 0 { None } else { Some(17.0) };
                }
            }
            if orthographic {
                scene.cameras[0].projection =
                    etalon::scene::Projection::Orthographic { half_height: 9.0, near: 0.1, far: 90.0 };
            }
            let error = against_all_lights(&gpu, &scene, orthographic, size);
            eprintln!("{count} lights, parallel {orthographic}: {error:e}");
            // Grazing light is the worst: cosθ has an absolute error of 1.2e-7 (numerics.md 25) and pixels count from
            // 1e-3 of the brightest on, which is 1e-4.
            assert!(error < 1e-4, "{count} lights, parallel {orthographic}: {error:e}");
        }
    }
}

#[test]
fn more_lights_than_a_loop_can_run_over_are_refused() {
    let gpu = Gpu::open();
    let with = |count: u32| {
        let mut made = wall([0.5; 3]);
        let mut random = SplitMix64::new(4);
        for i in 0..count {
            let position = DVec3::new(random.between(-2.0, 2.0), random.between(-1.0, 1.0), random.between(0.5, 3.0));
            // The last one is as strong as all before it.
            let color = if i + 1 == count { count as f32 } else { 1.0 };
            made.light([color; 3], LightKind::Point { position, range: None });
        }
        made.0
    };
    // Lists spend two loop heads a light.
    let mut listed = with(30_001);
    for light in &mut listed.lights {
        if let LightKind::Point { range, .. } = &mut light.kind {
            *range = Some(100.0);
        }
    }
    let refuses = gpu.device.limits_loops();
    let made = Renderer::new(&gpu.device, listed.clone(), None, settings([8, 8]));
    assert_eq!(made.is_err(), refuses, "30,001 listed lights");
    listed.lights.remove(0);
    let error = against_all_lights(&gpu, &listed, true, [9, 7]);
    eprintln!("30,000 listed lights: {error:e}");
    assert!(error < 30_000.0 * 2.0_f64.powi(-24), "{error:e}");
    if !refuses {
        eprintln!("skipped: this device limits no loops, so it refuses no number of lights");
    }
    for count in [60_001, 70_000].into_iter().filter(|_| refuses) {
        let Err(error) = Renderer::new(&gpu.device, with(count), None, settings([8, 8])) else {
            panic!("{count} lights are drawn on a software device");
        };
        let text = format!("{error:#}");
        eprintln!("{text}");
        assert!(text.contains(&format!("{count} lights")) && text.contains("60000"), "{text}");
    }
    // What is not refused is right, to the last light.
    let error = against_all_lights(&gpu, &with(60_000), true, [9, 7]);
    eprintln!("60,000 lights: {error:e}");
    // As many positive terms, half an ulp of the sum each.
    assert!(error < 60_000.0 * 2.0_f64.powi(-24), "{error:e}");
}

#[test]
fn more_lights_than_the_loops_of_rays_allow_are_an_error() {
    let gpu = Gpu::open();
    let shot = |first: u32, end: u32| {
        let mut made = wall([0.5; 3]);
        let metal = Material { base_color: [1.0; 4], metallic: 1.0, roughness: 0.0, ..Material::default() };
        let place = DAffine3::from_translation(DVec3::new(0.0, 0.0, 2.0)) * DAffine3::from_rotation_y(2.6);
        made.add(Shape::panel(2.0, 2.0), metal, place);
        for i in first..end {
            let position = DVec3::new(f64::from(i % 40) * 0.1 - 2.0, f64::from(i / 40) * 0.02 - 1.0, 1.5);
            made.light([1.0; 3], LightKind::Point { position, range: None });
        }
        made.camera(DVec3::new(0.0, 0.0, 1.0), DVec3::new(0.3, 0.0, 2.0), etalon_testing::made::perspective(60.0));
        let settings = Settings { knobs: knobs(&["reflection=ray", "shadows=ray", "samples=1"]), ..settings([16, 9]) };
        let mut renderer = gpu.renderer(&made.0, None, settings);
        let work = renderer.render(&made.0.cameras[1], &mut |_| ())?.work;
        anyhow::Ok((work, renderer.film()?))
    };
    let all = shot(0, 1200).expect("a picture of 1200 lights");
    // Light adds up: what a loop had lost would be missing.
    let parts: Vec<_> = (0..12).map(|i| shot(i * 100, (i + 1) * 100).expect("a picture of 100 lights")).collect();
    for (i, pixel) in all.1.rgba.iter().enumerate() {
        let sum: f64 = parts.iter().map(|part| f64::from(part.1.rgba[i][1])).sum();
        assert!((f64::from(pixel[1]) - sum).abs() <= 1e-4 * sum, "pixel {i}: {} {sum}", pixel[1]);
    }
    assert!(all.0.reflection > 0 && all.0.shadow > 10_000);
    if !gpu.device.limits_loops() {
        eprintln!("skipped: this device limits no loops, so 20,000 rays to lights are no error");
        return;
    }
    let error = shot(0, 20_000).map(|_| ()).expect_err("20,000 rays to lights at one surface").to_string();
    assert!(error.contains("(20000 lights") && error.contains("shadows=map"), "{error}");
}

#[test]
fn all_kinds_of_light_on_study_scenes_agree_with_the_formulas() {
    let gpu = Gpu::open();
    for name in ["lamps", "materials", "metals", "cornell"] {
        let mut scene = if name == "lamps" { lit_scene(12) } else { study::load(name).expect("a study scene") };
        if name != "lamps" {
            scene.lights = lit_scene(6).lights;
        }
        for material in &mut scene.materials {
            // The twin knows one layer and no glow; roughness from 0.25 keeps the lobe within f32's reach.
            material.emissive = [0.0; 3];
            material.clearcoat = 0.0;
            material.transmission = 0.0;
            material.roughness = material.roughness.max(0.25);
            material.normal_texture = None;
            material.occlusion_texture = None;
        }
        let error = against_all_lights(&gpu, &scene, false, SIZE);
        eprintln!("{name}: {error:e}");
        assert!(error < 1e-5, "{name}: {error:e}");
    }
}

#[test]
fn emitters_and_unlit_surfaces_show_their_radiance() {
    let gpu = Gpu::open();
    let glow = [3.0, 1e-5, 4e4];
    for (material, want) in [
        (Material { emissive: glow, ..lambert([0.0; 3]) }, glow),
        (unlit([0.3, 0.7, 11.0]), [0.3, 0.7, 11.0]),
        // What is lit besides adds its part; what is unlit does not.
        (Material { emissive: [1.0; 3], ..unlit([0.25, 0.5, 0.75]) }, [0.25, 0.5, 0.75]),
    ] {
        let mut made = Made::new("emitter");
        made.add(Shape::panel(8.0, 4.0), material, DAffine3::IDENTITY);
        made.light([9.0; 3], LightKind::Directional { direction: DVec3::NEG_Z });
        made.front(1.0);
        let film = gpu.film(&made.0, settings(SIZE));
        assert!(film.rgba.iter().all(|p| *p == [want[0], want[1], want[2], 1.0]), "{want:?}, got {:?}", film.rgba[9]);
    }
}

/// Half the picture is covered by a ball, the rest shows what is behind.
fn ball(material: Material) -> Scene {
    let mut made = Made::new("ball");
    made.add(Shape::sphere(1.0, 24), material, DAffine3::IDENTITY);
    made.camera(DVec3::new(0.5, 1.0, 4.0), DVec3::ZERO, etalon_testing::made::perspective(40.0));
    made.0
}

#[test]
fn a_white_object_vanishes_in_a_white_furnace() {
    let gpu = Gpu::open();
    let radiance = [0.25_f32, 1.0, 3.0];
    let environment = Environment::constant(radiance);
    let mirror = Material { base_color: [1.0; 4], metallic: 1.0, roughness: 0.0, ..Material::default() };
    // A Lambert body: nine harmonics of a constant are one, c = L √(4π) π / √(4π); its constants have six digits in the
    // shader: 0.282095 against 0.2820948 is 8e-7, and the coefficients sum 2048 terms and more. A mirror has F0 = F90 =
    // 1 and no shadowing at roughness 0.01: the split sum's two factors add to one, to 1e-5.
    for (name, material, bound) in [("Lambert", lambert([1.0; 3]), 4e-6), ("mirror", mirror, 2e-5)] {
        let (_, film) = gpu.shot(&ball(material), Some(&environment), settings(SIZE));
        let mut error = 0.0_f64;
        for pixel in &film.rgba {
            assert!((pixel[3] - 1.0).abs() < 1e-6);
            for c in 0..3 {
                error = error.max((f64::from(pixel[c]) / f64::from(radiance[c]) - 1.0).abs());
            }
        }
        eprintln!("{name}: {error:e}");
        assert!(error < bound, "{name}: {error:e}");
    }
}

/// A rough white metal loses to single scattering what `ggx-multi` gives back: its directional reflectance, A + B of
/// the table, divides out to a rounding where F0 = F90 = 1.
#[test]
fn a_rough_metal_is_dark_in_the_furnace_until_compensated() {
    let gpu = Gpu::open();
    let metal = Material { base_color: [1.0; 4], metallic: 1.0, roughness: 0.9, ..Material::default() };
    let environment = Environment::constant([1.0; 3]);
    let darkest = |brdf: &str| {
        let mut settings = settings(SIZE);
        settings.knobs.set(brdf).expect("a rung");
        let (_, film) = gpu.shot(&ball(metal.clone()), Some(&environment), settings);
        film.rgba.iter().fold((f32::MAX, f32::MIN), |(low, high), p| (low.min(p[0]), high.max(p[0])))
    };
    let (low, high) = darkest("brdf=ggx");
    eprintln!("ggx {low} .. {high}");
    assert!(low < 0.8 && high < 1.0001);
    let (low, high) = darkest("brdf=ggx-multi");
    eprintln!("ggx-multi {low} .. {high}");
    assert!((low - 1.0).abs() < 2e-5 && (high - 1.0).abs() < 2e-5);
}

/// The same compensation for punctual lights: by 1 / (A + B), which is what the same metal shows in a furnace of 1.
#[test]
fn compensation_is_for_lights_too() {
    let gpu = Gpu::open();
    let metal = Material { base_color: [1.0; 4], metallic: 1.0, roughness: 0.9, ..Material::default() };
    let mut scene = ball(metal);
    let seen = |scene: &Scene, environment: Option<&Environment>, brdf: &str| {
        let mut settings = settings(SIZE);
        settings.knobs.set(brdf).expect("a rung");
        gpu.shot(scene, environment, settings).1
    };
    let furnace = seen(&scene, Some(&Environment::constant([1.0; 3])), "brdf=ggx");
    let direction = DVec3::new(0.0, -0.3, -1.0).normalize();
    scene.lights.push(etalon::scene::Light {
        proxy: false,
        spectrum: None,
        extent: None,
        name: "sun".to_owned(),
        color: [1.0; 3],
        kind: LightKind::Directional { direction },
    });
    let (single, multiple) = (seen(&scene, None, "brdf=ggx"), seen(&scene, None, "brdf=ggx-multi"));
    let mut lit = 0;
    for ((single, multiple), furnace) in single.rgba.iter().zip(&multiple.rgba).zip(&furnace.rgba) {
        if single[0] > 1e-3 {
            lit += 1;
            // A handful of roundings of f32, and of the map's filter.
            assert!((multiple[0] / single[0] * furnace[0] - 1.0).abs() < 2e-5, "{single:?} {multiple:?} {furnace:?}");
        }
    }
    assert!(lit > 100, "{lit} pixels");
}

/// `fresnel=exact` of a half metal lies between its dielectric and its metal: the index of refraction is not mixed
/// towards 1, below which a surface would reflect totally.
#[test]
fn exact_fresnel_of_a_half_metal_lies_between() {
    let gpu = Gpu::open();
    let environment = Environment::constant([1.0; 3]);
    let seen = |metallic: f32| {
        let material = Material { base_color: [0.5, 0.5, 0.5, 1.0], metallic, roughness: 0.3, ..Material::default() };
        let mut scene = ball(material);
        scene.lights.push(etalon::scene::Light {
            proxy: false,
            spectrum: None,
            extent: None,
            name: "sun".to_owned(),
            color: [1.0; 3],
            kind: LightKind::Directional { direction: DVec3::new(0.9, -0.1, 0.4).normalize() },
        });
        let mut settings = settings(SIZE);
        settings.knobs.set("fresnel=exact").expect("a rung");
        gpu.shot(&scene, Some(&environment), settings).1
    };
    let (dielectric, half, metal) = (seen(0.0), seen(0.5), seen(1.0));
    for ((d, h), m) in dielectric.rgba.iter().zip(&half.rgba).zip(&metal.rgba) {
        let (low, high) = (d[0].min(m[0]), d[0].max(m[0]));
        // The mixture is linear but for the ambient term's largest component: a hundredth of room.
        assert!(h[0] > low * 0.99 - 1e-4 && h[0] < high * 1.01 + 1e-4, "{d:?} {h:?} {m:?}");
    }
}

/// A smooth map without symmetries; every texel differs from its mirror images and its turned ones.
fn gradient() -> Environment {
    let (width, height) = (64_u32, 32_u32);
    let radiance = (0..width * height)
        .map(|i| {
            let (x, y) = (f64::from(i % width) / 64.0, f64::from(i / width) / 32.0);
            let wave = (x * 2.0 * PI).sin();
            [(1.5 + wave) as f32, (0.2 + y) as f32, (1.5 + (x * 2.0 * PI + 1.0).cos() * (1.0 - y)) as f32]
        })
        .collect();
    Environment { name: "gradient".to_owned(), width, height, radiance }
}

/// Direction from the eye through the centre of a pixel.
fn through_pixel(i: usize, view: &View) -> DVec3 {
    let x = 2.0 * ((i as u32 % SIZE[0]) as f64 + 0.5) / f64::from(SIZE[0]) - 1.0;
    let y = 1.0 - 2.0 * ((i as u32 / SIZE[0]) as f64 + 0.5) / f64::from(SIZE[1]);
    let [right, up, forward] = view.axes;
    (forward + right * (x * view.half.x) + up * (y * view.half.y)).normalize()
}

#[test]
fn behind_the_scene_is_the_environment_turned_as_asked() {
    let gpu = Gpu::open();
    let environment = gradient();
    let scene = ball(lambert([0.5; 3]));
    for (degrees, intensity) in [(0.0_f32, 1.0_f32), (90.0, 1.0), (-33.0, 2.5), (360.0, 1.0)] {
        let mut camera = etalon_testing::made::looking(DVec3::new(0.5, 1.0, 4.0), DVec3::new(0.2, 0.4, 0.0));
        camera.projection = etalon_testing::made::perspective(100.0);
        let settings = Settings {
            background: Background::Environment,
            environment_rotation: degrees,
            environment_intensity: intensity,
            ..settings(SIZE)
        };
        let mut renderer = gpu.renderer(&scene, Some(&environment), settings);
        assert_finite(&renderer.render(&camera, &mut |_| ()).expect("a picture"));
        let film = renderer.film().expect("the film");
        let (aovs, view) = renderer.aovs(&camera).expect("the G-buffer");
        let turn = f64::from(degrees).to_radians();
        let (mut seen, mut error) = (0, 0.0_f64);
        for (i, (pixel, aov)) in film.rgba.iter().zip(&aovs).enumerate() {
            if aov.material != 0 {
                continue;
            }
            seen += 1;
            let d = through_pixel(i, &view);
            // The map turned by +θ about +Y shows at d what lies at d turned back: azimuth atan2(z, x) falls as +Y
            // turns x towards −z, so turning back adds θ to it.
            let (sin, cos) = turn.sin_cos();
            let into_map = DVec3::new(cos * d.x - sin * d.z, d.y, sin * d.x + cos * d.z);
            let want = environment.sample(into_map);
            for c in 0..3 {
                error = error.max((f64::from(pixel[c]) / f64::from(intensity) - want[c]).abs());
            }
        }
        assert!(seen > 1000, "{seen}");
        eprintln!("turned {degrees}: {error:e}");
        // lavapipe weighs texels with 8 bits of fraction: 1/512 of the largest step between neighbours (0.1) twice, and
        // its atan2 is good to 342 ulps (numerics.md, 2).
        assert!(error < 2.0 * 0.1 / 512.0 + 1e-4, "turned {degrees}: {error:e}");
    }
}

#[test]
fn a_turned_environment_lights_as_the_turned_map_does() {
    let gpu = Gpu::open();
    let environment = gradient();
    // 90° are 16 of 64 columns: the turned map is the map with its columns moved.
    let mut moved = environment.clone();
    for row in moved.radiance.chunks_exact_mut(64) {
        row.rotate_left(16);
    }
    let scene = ball(Material { roughness: 0.5, metallic: 0.0, ..lambert([0.5; 3]) });
    let turned = Settings { environment_rotation: 90.0, ..settings(SIZE) };
    let (_, a) = gpu.shot(&scene, Some(&environment), turned);
    let (_, b) = gpu.shot(&scene, Some(&moved), settings(SIZE));
    let error = etalon_testing::gpu::largest_difference(&a, &b, 1.0);
    eprintln!("{error:e}");
    // The same texels at the same places up to rounding of the coordinates (1e-6 of the map) and the fraction's 8 bits.
    assert!(error < 1e-3, "{error:e}");
    let (_, unturned) = gpu.shot(&scene, Some(&environment), settings(SIZE));
    assert!(etalon_testing::gpu::largest_difference(&a, &unturned, 1.0) > 0.5, "the turn shows");
}

/// A lamp of 12° in a dim room; the map is as fine as its prefiltered levels.
fn room() -> Environment {
    let lamp = DVec3::new(0.5, 0.35, 1.0).normalize();
    let texel = |i: u32| environment::direction((f64::from(i % 256) + 0.5) / 256.0, (f64::from(i / 256) + 0.5) / 128.0);
    let radiance = |i: u32| if texel(i).dot(lamp) > 12_f64.to_radians().cos() { [50.0_f32; 3] } else { [0.25; 3] };
    let radiance = (0..256 * 128).map(radiance).collect();
    Environment { name: "lamp".to_owned(), width: 256, height: 128, radiance }
}

/// Returns the mean of a map's first channel over all directions, by solid angle and a weight.
fn mean_of_map(map: &Environment, weight: impl Fn(DVec3) -> f64) -> f64 {
    let (width, height) = (f64::from(map.width), f64::from(map.height));
    let (mut sum, mut whole) = (0.0, 0.0);
    for (i, radiance) in map.radiance.iter().enumerate() {
        let (x, y) = (i as u32 % map.width, i as u32 / map.width);
        let l = environment::direction((f64::from(x) + 0.5) / width, (f64::from(y) + 0.5) / height);
        let weight = weight(l) * (1.0 - l.y * l.y).sqrt();
        sum += weight * f64::from(radiance[0]);
        whole += weight;
    }
    sum / whole
}

/// Returns a map filtered by a GGX lobe about `n`: ∫ L D(h) G1(l) dω over the same integral with L = 1, for n = v = r.
fn through_lobe(map: &Environment, n: DVec3, alpha: f64) -> f64 {
    mean_of_map(map, |l| {
        let cos_l = n.dot(l);
        if cos_l <= 0.0 {
            return 0.0;
        }
        let cos_h2 = 0.5 * (1.0 + cos_l);
        let d = (cos_h2 * (alpha * alpha - 1.0) + 1.0).powi(-2);
        d * 2.0 / (1.0 + (1.0 + alpha * alpha * (cos_l.powi(-2) - 1.0)).sqrt())
    })
}

/// What is seen directly is blurred, also through glass; what lights surfaces is the environment as it is.
#[test]
fn a_blurred_background_is_the_environment_through_a_lobe() {
    let gpu = Gpu::open();
    let room = room();
    let glass = Material { transmission: 1.0, ior: 1.0, thickness: 1.0, ..lambert([1.0; 3]) };
    let mut camera = etalon_testing::made::looking(DVec3::new(-1.0, 0.3, -4.0), DVec3::new(-0.4, 0.3, 1.0));
    camera.projection = etalon_testing::made::perspective(80.0);
    for model in [Model::Local, Model::Recursive, Model::Global] {
        let mut knobs = Knobs::of(model);
        knobs.set("samples=4").expect("a rung");
        let shot = |material: &Material, background, background_blur| {
            let settings = Settings { background, background_blur, knobs: knobs.clone(), ..settings(SIZE) };
            let mut renderer = gpu.renderer(&ball(material.clone()), Some(&room), settings);
            assert_finite(&renderer.render(&camera, &mut |_| ()).expect("a picture"));
            (renderer.film().expect("the film"), renderer.aovs(&camera).expect("the G-buffer").1)
        };
        let solid = lambert([0.5; 3]);
        let (clear, view) = shot(&solid, Background::Transparent, 0.0);
        let (sharp, _) = shot(&solid, Background::Environment, 0.0);
        for alpha in [0.25_f64, 0.5] {
            let blur = alpha.sqrt() as f32;
            let (blurred, _) = shot(&solid, Background::Environment, blur);
            let (mut behind, mut covered, mut worst, mut brightest) = (0, 0, 0.0_f64, 0.0_f64);
            for (i, pixel) in blurred.rgba.iter().enumerate() {
                if clear.rgba[i][3] == 1.0 {
                    assert_eq!(*pixel, sharp.rgba[i], "{model:?}, pixel {i}: another light");
                    covered += 1;
                } else if clear.rgba[i][3] == 0.0 && i % 7 == 0 {
                    let d = through_pixel(i, &view);
                    let want = through_lobe(&room, d, alpha);
                    worst = worst.max((f64::from(pixel[0]) - want).abs());
                    brightest = brightest.max(want);
                    behind += 1;
                }
            }
            eprintln!("{model:?}, alpha {alpha}: {worst} of {brightest}, {behind} behind, {covered} covered");
            assert!(behind > 100 && covered > 20 && brightest > 1.0, "{model:?}: {behind} {covered} {brightest}");
            // Of a level 128 to 4096 directions are looked up for a texel, and those of a level are interpolated.
            assert!(worst < 0.03 * brightest, "{model:?}, alpha {alpha}: {worst} of {brightest}");
        }
        // Glass of index 1 is not seen.
        let (through, _) = shot(&glass, Background::Environment, 0.5);
        let (without, _) = shot(&solid, Background::Environment, 0.5);
        let open = |i: &usize| clear.rgba[*i][3] == 0.0;
        let brightest = (0..without.rgba.len()).filter(open).fold(0.0_f32, |m, i| m.max(without.rgba[i][0]));
        let of_sharp = shot(&glass, Background::Environment, 0.0).0;
        let mut differs = 0;
        for i in (0..through.rgba.len()).filter(|i| clear.rgba[*i][3] == 1.0) {
            let d = through_pixel(i, &view);
            let want = through_lobe(&room, d, 0.25);
            let found = f64::from(through.rgba[i][0]);
            assert!((found - want).abs() < 0.05 * f64::from(brightest), "{model:?}, {i}: {found} {want}");
            differs += usize::from((of_sharp.rgba[i][0] - through.rgba[i][0]).abs() > 0.05);
        }
        assert!(differs > 10, "{model:?}: the blur does not show in the glass");
    }
}

/// Returns a map through the GGX lobe of a white metal about +Z, seen from the unit direction v: ∫ L f cosθ dω over the
/// same integral with L = 1.
fn through_lobe_of_metal(map: &Environment, v: DVec3, alpha: f64) -> f64 {
    mean_of_map(map, |l| if l.z > 0.0 { brdf::ggx(DVec3::Z, l, v, alpha, 1.0)[4] } else { 0.0 })
}

/// The lobe of the prefiltered map whose mean is that of the metal's lobe, beside the exact integral and the lobe about
/// the direction of reflection (docs/decisions/split-sum.md). A narrow lobe about a lamp keeps an error: it is longer
/// than wide.
#[test]
fn a_rough_metal_mirrors_the_lobe_of_what_is_around() {
    let gpu = Gpu::open();
    let room = room();
    let white = Environment { radiance: vec![[1.0; 3]; 256 * 128], ..room.clone() };
    for (alpha, near, most) in [(0.125_f64, 0.95, 0.035), (0.25, 0.85, 0.06), (0.5, 0.55, 0.06), (1.0, 0.1, 0.02)] {
        let roughness = alpha.sqrt() as f32;
        let metal = Material { base_color: [1.0; 4], metallic: 1.0, roughness, ..Material::default() };
        let mut made = Made::new("metal wall");
        made.add(Shape::panel(40.0, 40.0), metal, DAffine3::IDENTITY);
        made.camera(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, etalon_testing::made::perspective(70.0));
        let shot = |environment| gpu.shot(&made.0, Some(environment), settings(SIZE)).1;
        let (of_room, of_white) = (shot(&room), shot(&white));
        let tan = 35_f64.to_radians().tan();
        let (mut error, mut without, mut brightest, mut pixels) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0);
        for i in (0..of_room.rgba.len()).step_by(7) {
            let (x, y) = (i as u32 % SIZE[0], i as u32 / SIZE[0]);
            let across = (f64::from(x) + 0.5) / f64::from(SIZE[0]) * 2.0 - 1.0;
            let down = (f64::from(y) + 0.5) / f64::from(SIZE[1]) * 2.0 - 1.0;
            let aspect = f64::from(SIZE[0]) / f64::from(SIZE[1]);
            let r = DVec3::new(across * tan * aspect, -down * tan, 1.0).normalize();
            let want = through_lobe_of_metal(&room, DVec3::new(-r.x, -r.y, r.z), alpha);
            assert!(of_white.rgba[i][0] > 0.0, "pixel {i} mirrors nothing");
            let found = f64::from(of_room.rgba[i][0]) / f64::from(of_white.rgba[i][0]);
            error += (found - want).powi(2);
            without += (through_lobe(&room, r, alpha) - want).powi(2);
            brightest = brightest.max(want);
            pixels += 1.0;
        }
        let [error, without] = [error, without].map(|sum| (sum / pixels).sqrt() / brightest);
        eprintln!("alpha {alpha}: {error} of the brightest, {without} about the direction of reflection");
        assert!(error < near * without && error < most, "alpha {alpha}: {error} {without}");
    }
}

#[test]
fn light_through_both_sides_of_a_sheet() {
    // A double-sided wall seen from behind is lit by what shines on that side only.
    let gpu = Gpu::open();
    let mut made = wall([1.0; 3]);
    made.0.instances[0].world_from_object = DAffine3::from_rotation_y(PI) * at(0.0, 0.0, 0.0);
    made.light([PI as f32; 3], LightKind::Directional { direction: DVec3::NEG_Z });
    made.light([50.0; 3], LightKind::Directional { direction: DVec3::Z });
    let film = gpu.film(&made.0, settings(SIZE));
    assert!(film.rgba.iter().all(|p| (p[0] - 1.0).abs() < 1e-6), "{:?}", film.rgba[0]);
}

/// A lamp behind frosted glass: its lobe is that of the mirrored lamp before a white metal, times what enters and the
/// colour of the glass. Smooth glass shows no lamp that has no size.
#[test]
fn lamps_shine_through_rough_thin_walls() {
    let gpu = Gpu::open();
    let (base, lamp) = ([0.8_f32, 0.5, 0.25], DVec3::new(0.4, -0.2, -1.5));
    for (model, brdf) in [
        (Model::Local, "brdf=ggx"),
        (Model::Local, "brdf=blinn-phong"),
        (Model::Recursive, "brdf=ggx"),
        (Model::Recursive, "brdf=ggx-multi"),
        (Model::Global, "brdf=ggx"),
    ] {
        for roughness in [0.4_f32, 0.8, 0.0] {
            let mut made = Made::new("frosted glass");
            let [r, g, b] = base;
            let color = [r, g, b, 1.0];
            let glass =
                Material { base_color: color, metallic: 0.0, transmission: 1.0, roughness, ..Material::default() };
            made.add(Shape::panel(8.0, 4.0), glass, DAffine3::IDENTITY);
            made.front(1.0);
            made.light([3.0; 3], LightKind::Point { position: lamp, range: None });
            let mut settings = Settings { knobs: Knobs::of(model), ..settings(SIZE) };
            for choice in ["samples=1", "fresnel=exact", brdf] {
                settings.knobs.set(choice).expect("a rung");
            }
            let film = gpu.film(&made.0, settings);
            if roughness == 0.0 {
                assert!(film.rgba.iter().all(|p| p[..3] == [0.0; 3]), "{model:?}: {:?}", film.rgba[0]);
                continue;
            }
            let alpha = f64::from(roughness).powi(2);
            let expected = |i: usize| {
                let to_lamp = lamp - on_wall(i, SIZE);
                let l = to_lamp.normalize();
                let mirrored = DVec3::new(l.x, l.y, -l.z);
                let white = brdf::ggx(DVec3::Z, mirrored, DVec3::Z, alpha, 1.0)[4];
                let enters = 1.0 - fresnel_dielectric((mirrored + DVec3::Z).normalize().z, 1.5)[0];
                DVec3::from(base.map(f64::from)) * (3.0 * white * enters / to_lamp.length_squared())
            };
            if model == Model::Global {
                // Paths begin anywhere in a pixel: their mean counts.
                let found: f64 = film.rgba.iter().map(|p| f64::from(p[0])).sum();
                let want: f64 = (0..film.rgba.len()).map(|i| expected(i).x).sum();
                assert!((found - want).abs() < 5e-3 * want, "roughness {roughness}: {found} {want}");
                continue;
            }
            let error = worst(&film, 0.01, expected);
            eprintln!("{model:?}, {brdf}, roughness {roughness}: {error:e}");
            assert!(error < 1e-5, "{model:?}, {brdf}, roughness {roughness}: {error:e}");
            // A wall between lamp and glass.
            made.add(Shape::panel(8.0, 8.0), lambert([0.0; 3]), at(0.0, 0.0, -0.5));
            let mut knobs = Knobs::of(model);
            knobs.set("samples=1").expect("a rung");
            let film = gpu.film(&made.0, Settings { knobs, ..self::settings(SIZE) });
            assert!(film.rgba.iter().all(|p| p[..3] == [0.0; 3]), "{model:?}: {:?}", film.rgba[0]);
        }
    }
}

#[test]
fn no_tier_of_arithmetic_makes_nan_of_a_scene() {
    let gpu = Gpu::open();
    for name in ["materials", "lamps"] {
        let scene = study::load(name).expect("a study scene");
        for brdf in ["ggx", "blinn-phong-reciprocal"] {
            let [fast, stable, compensated] = ["fast", "stable", "compensated"].map(|tier| {
                let choices = ["samples=1", &format!("brdf={brdf}"), &format!("arithmetic={tier}")];
                let chosen = Settings { knobs: knobs(&choices), ..settings([64, 36]) };
                let (rendered, film) = gpu.shot(&scene, None, chosen);
                assert_eq!((rendered.counts.nan, rendered.counts.inf), (0, 0), "{name}, {brdf}, {tier}");
                film
            });
            // Away from the hard cases the tiers are one formula.
            assert!(largest_difference(&stable, &compensated, 1.0) < 2e-3, "{name}, {brdf}");
            let differ = bits(&fast).iter().zip(bits(&stable)).filter(|(a, b)| **a != *b).count();
            assert!(differ > 0, "{name}, {brdf}: the knob changes nothing");
        }
    }
}
