//! What a light, an environment, a camera and a place say of themselves is what the picture shows, in all three models:
//! lights with and without a shape on slanted surfaces, the environment turned and dimmed, radiance over distance and
//! tilt, Snell's window, and objects where their instances and the camera put them. Against closed forms and integrals
//! in f64.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use etalon::frame::Settings;
use etalon::image::Picture;
use etalon::plan::Model;
use etalon::scene::environment::{self, Environment};
use etalon::scene::{Camera, Extent, Light, LightKind, Material, Projection, Scene};
use etalon::study;
use etalon::study::shape::Shape;
use etalon_testing::gpu::Gpu;
use etalon_testing::lobe::{DOME, MODELS, dome, model, worst};
use etalon_testing::made::{Made, at, lambert, looking, orthographic, perspective, unlit};
use glam::{DAffine3, DQuat, DVec3};

fn pixel(film: &Picture, x: u32, y: u32) -> DVec3 {
    let [r, g, b, _] = film.rgba[(y * film.width + x) as usize].map(f64::from);
    DVec3::new(r, g, b)
}

/// A white wall 0.2 m wide that faces the eye along z.
fn small_wall(light: Light) -> Scene {
    let mut made = Made::new("wall");
    made.add(Shape::panel(0.4, 0.4), lambert([1.0; 3]), DAffine3::IDENTITY);
    made.0.lights.push(light);
    made.front(0.1);
    made.0
}

fn light(color: [f32; 3], extent: Option<Extent>, kind: LightKind) -> Light {
    Light { name: "lamp".to_owned(), color, spectrum: None, extent, kind, proxy: false }
}

#[test]
fn points_cones_and_what_is_far_light_as_their_formulas_say() {
    let gpu = Gpu::hasty();
    let place = DVec3::new(0.6, -0.3, 0.8);
    let point = |range| LightKind::Point { position: place, range };
    // The wall's middle lies 5° off the axis and more to one side.
    let cone = |inner: f64, outer: f64, tilt: f64| LightKind::Spot {
        position: place,
        direction: DQuat::from_rotation_y(tilt.to_radians()) * -place.normalize(),
        range: None,
        inner: inner.to_radians(),
        outer: outer.to_radians(),
    };
    for (what, kind) in [
        ("far", LightKind::Directional { direction: DVec3::new(0.3, -0.5, -0.7).normalize() }),
        ("point", point(None)),
        ("range", point(Some(1.3))),
        ("within the cone", cone(20.0, 40.0, 5.0)),
        ("on the ramp", cone(2.0, 21.0, 11.0)),
        ("a steep ramp", cone(11.0, 20.0, 15.0)),
    ] {
        let lamp = light([3.0, 2.0, 5.0], None, kind);
        let scene = small_wall(lamp.clone());
        for of in MODELS {
            let size = [12, 12];
            // Paths begin anywhere in a pixel.
            let choices: &[&str] = if of == Model::Global { &["samples=64"] } else { &[] };
            let film = gpu.film(&scene, model(of, size, choices));
            let mut error = 0.0_f64;
            let mut brightest = 0.0_f64;
            for i in 0..144 {
                let (x, y) = (i % 12, i / 12);
                let p = DVec3::new((f64::from(x) + 0.5) / 60.0 - 0.1, 0.1 - (f64::from(y) + 0.5) / 60.0, 0.0);
                let (l, e) = etalon_testing::shade::incident(&lamp, p);
                let want = e * (l.z / PI);
                brightest = brightest.max(want.x);
                error = error.max((pixel(&film, x, y) - want).abs().max_element());
            }
            eprintln!("{of:?}, {what}: {:.1e}", error / brightest);
            // Of what changes by 20 % over a pixel of a steep ramp, 64 even points have 0.2/√12/8, and the worst of 144
            // pixels four times that. Without them a depth is good to 1.2e-6 m of 1 m (tests/light.rs), over cosines
            // that the steepest ramp takes 0.04 of, and squared.
            let bound = if of == Model::Global { 3e-2 } else { 6e-5 };
            assert!(brightest > 0.1 && error < bound * brightest, "{of:?}, {what}: {error:e} of {brightest}");
        }
    }
}

/// E/π at the origin of a plane with normal `n` under a light with a shape: ∫ L cosθ cosθ_light/r² dA in f64.
fn under_a_shape(lamp: &Light, n: DVec3) -> f64 {
    const CELLS: i32 = 400;
    let intensity = f64::from(lamp.color[1]);
    let unit = |i: i32| (f64::from(i) + 0.5) / f64::from(CELLS);
    let mut sum = 0.0;
    let (place, axis, ramp) = match lamp.kind {
        LightKind::Point { position, .. } => (position, DVec3::ZERO, None),
        LightKind::Spot { position, direction, inner, outer, .. } => {
            (position, direction.normalize(), Some((inner, outer)))
        }
        LightKind::Directional { .. } => panic!("no shape"),
    };
    for i in 0..CELLS {
        for j in 0..CELLS {
            let (u, v) = (unit(i), unit(j));
            // A place, its normal, its area, and the light's radiance.
            let (p, facing, area, radiance) = match lamp.extent.expect("a shape") {
                Extent::Sphere { radius } => {
                    let (z, phi) = (2.0 * u - 1.0, TAU * v);
                    let out = DVec3::new((1.0 - z * z).sqrt() * phi.cos(), (1.0 - z * z).sqrt() * phi.sin(), z);
                    (place + out * radius, out, 4.0 * PI * radius * radius, intensity / (PI * radius * radius))
                }
                Extent::Disk { radius } => {
                    let (t, b) = axis.any_orthonormal_pair();
                    let (r, phi) = (radius * u.sqrt(), TAU * v);
                    let area = PI * radius * radius;
                    (place + (t * phi.cos() + b * phi.sin()) * r, axis, area, intensity / area)
                }
                Extent::Rectangle { across, half_height } => {
                    let up = axis.cross(across).normalize() * half_height;
                    let area = 4.0 * across.length() * half_height;
                    (place + across * (2.0 * u - 1.0) + up * (2.0 * v - 1.0), axis, area, intensity / area)
                }
            };
            let l = p.normalize();
            let (cos, cos_light) = (n.dot(l), -facing.dot(l));
            if cos > 0.0 && cos_light > 0.0 {
                let share = ramp.map_or(1.0, |(inner, outer)| {
                    let narrow = inner.cos() - outer.cos();
                    if narrow < 1e-9 { 1.0 } else { ((cos_light - outer.cos()) / narrow).clamp(0.0, 1.0).powi(2) }
                });
                sum += radiance * share * cos * cos_light / p.length_squared() * area / f64::from(CELLS * CELLS);
            }
        }
    }
    sum / PI
}

#[test]
fn lights_with_a_shape_light_slanted_surfaces_as_the_integral_over_them_says() {
    let gpu = Gpu::hasty();
    let position = DVec3::new(0.5, 0.3, 0.9);
    let face = |inner: f64, outer: f64, direction: DVec3| LightKind::Spot {
        position,
        direction: direction.normalize(),
        range: None,
        inner,
        outer,
    };
    let slanted = DVec3::new(-0.3, -0.2, -1.0);
    // At right angles to the axis.
    let across = slanted.cross(DVec3::new(0.3, 1.0, 0.0)).normalize() * 0.5;
    for (what, extent, kind) in [
        ("ball", Extent::Sphere { radius: 0.4 }, LightKind::Point { position, range: None }),
        ("disk", Extent::Disk { radius: 0.5 }, face(FRAC_PI_2, FRAC_PI_2, slanted)),
        ("disk with a cone", Extent::Disk { radius: 0.5 }, face(0.2, 0.9, slanted)),
        ("rectangle", Extent::Rectangle { across, half_height: 0.15 }, face(FRAC_PI_2, FRAC_PI_2, slanted)),
    ] {
        let lamp = light([4.0; 3], Some(extent), kind);
        for tilt in [0.0_f64, 50.0] {
            let turn = DQuat::from_rotation_y(-tilt.to_radians());
            let mut made = Made::new("floor");
            made.add(Shape::panel(0.02, 0.02), lambert([1.0; 3]), DAffine3::from_quat(turn));
            made.0.lights.push(lamp.clone());
            made.front(0.004);
            let film = gpu.film(&made.0, model(Model::Global, [16, 16], &["samples=64"]));
            let all: Vec<f64> = film.rgba.iter().map(|p| f64::from(p[1])).collect();
            let mean = all.iter().sum::<f64>() / 256.0;
            let deviation = (all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 255.0 / 256.0).sqrt();
            let want = under_a_shape(&lamp, turn * DVec3::Z);
            eprintln!("{what}, tilted {tilt}°: {mean:.6} ± {deviation:.6} for {want:.6}");
            // Of the integral's midpoint rule, where a horizon or a cone's edge cuts its cells: some 1/400 of a share.
            assert!(deviation < 2e-3 * want, "{what}, tilted {tilt}°: ± {deviation}");
            assert!((mean - want).abs() < 4.0 * deviation + 1e-3 * want, "{what}, tilted {tilt}°: {mean} for {want}");
        }
    }
}

/// Brighter to one side: spherical harmonics up to degree 2 represent it exactly, in cells as fine as this.
fn uneven() -> Environment {
    let (width, height) = (128_u32, 64_u32);
    let radiance = (0..width * height).map(|i| {
        let (u, v) = (f64::from(i % width) + 0.5, f64::from(i / width) + 0.5);
        let d = environment::direction(u / 128.0, v / 64.0);
        [1.0 + 0.6 * d.x + 0.3 * d.y, 1.0 - 0.5 * d.z + 0.3 * d.x * d.y, 1.2 + 0.5 * d.x * d.z - 0.4 * d.y]
            .map(|x| x as f32)
    });
    Environment { name: "uneven".to_owned(), width, height, radiance: radiance.collect() }
}

/// A direction of the world in an environment that is turned about +Y by so many degrees: turned back.
fn into_map(d: DVec3, degrees: f32) -> DVec3 {
    let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
    DVec3::new(cos * d.x - sin * d.z, d.y, sin * d.x + cos * d.z)
}

/// A cosine lobe leaves 2/3 of what is linear in the direction, and 1/4 of degree 2 (Ramamoorthi and Hanrahan 2001),
/// over π.
fn diffuse_of_uneven(d: DVec3) -> DVec3 {
    DVec3::new(
        1.0 + (0.6 * d.x + 0.3 * d.y) * 2.0 / 3.0,
        1.0 - 0.5 * d.z * 2.0 / 3.0 + 0.3 * d.x * d.y / 4.0,
        1.2 + 0.5 * d.x * d.z / 4.0 - 0.4 * d.y * 2.0 / 3.0,
    )
}

#[test]
fn a_turned_and_dimmed_environment_lights_and_is_mirrored_from_where_it_is() {
    let gpu = Gpu::hasty();
    let environment = uneven();
    let mirror = Material { base_color: [1.0; 4], metallic: 1.0, roughness: 0.0, ..Material::default() };
    let materials = [lambert([1.0; 3]), mirror];
    let (scene, facets) = dome(&materials);
    for (of, degrees, intensity) in [
        (Model::Local, 70.0_f32, 0.5_f32),
        (Model::Recursive, -25.0, 2.0),
        (Model::Global, 70.0, 2.0),
        (Model::Local, 0.0, 1.0),
    ] {
        let choices: &[&str] = if of == Model::Global { &["samples=64"] } else { &[] };
        let settings =
            Settings { environment_rotation: degrees, environment_intensity: intensity, ..model(of, DOME, choices) };
        let (_, film) = gpu.shot(&scene, Some(&environment), settings);
        let lambert_only: Vec<_> = facets.iter().filter(|f| f.material == 0).collect();
        // Of a Lambert facet the mean over its pixels: paths scatter.
        let mut off = 0.0_f64;
        for facet in lambert_only {
            let sum = facet
                .pixels
                .iter()
                .fold(DVec3::ZERO, |sum, &p| sum + etalon_testing::lobe::rgb([0, 1, 2].map(|c| film.rgba[p][c])));
            let want = diffuse_of_uneven(into_map(facet.n, degrees)) * f64::from(intensity);
            off = off.max((sum / facet.pixels.len() as f64 / want - 1.0).abs().max_element());
        }
        let mirrors: Vec<_> = facets
            .iter()
            .filter(|f| f.material == 1)
            .map(|f| etalon_testing::lobe::Facet { pixels: f.pixels.clone(), ..*f })
            .collect();
        let error = worst(&film, &mirrors, 0.1, |facet| {
            let r = 2.0 * facet.n.z * facet.n - DVec3::Z;
            DVec3::from(environment.sample(into_map(r, degrees))) * f64::from(intensity)
        });
        eprintln!("{of:?}, turned {degrees}: Lambert {off:.1e}, mirror {error:.1e}");
        // A pixel of 64 paths has some 3 %, and a facet at least four pixels. Cells of 2.8° flatten what is linear by
        // 3e-4.
        let bound = if of == Model::Global { 0.05 } else { 1e-3 };
        assert!(off < bound, "{of:?}, turned {degrees}: {off:e}");
        // Weights of texels in 8 bits; the prefiltered map is a level of its own, and its table good to 4e-3.
        let bound = if of == Model::Local { 6e-3 } else { 1e-3 };
        assert!(error < bound, "{of:?}, turned {degrees}: {error:e}");
    }
}

/// Lecture R1, on the device: whatever its distance and tilt, a surface of radiance 1 shows 1.
#[test]
fn a_panels_radiance_is_the_same_at_any_distance_and_tilt() {
    let gpu = Gpu::hasty();
    let scene = study::load("radiance").expect("a study scene");
    // The last panel is seen from 4° beside its plane: 5 pixels.
    let size = [480, 270];
    for of in MODELS {
        let settings = model(of, size, &[]);
        let (film, aovs, _) = gpu.all(&scene, &scene.cameras[0], settings);
        let mut seen = vec![0; scene.instances.len()];
        for y in 1..size[1] - 1 {
            for x in 1..size[0] - 1 {
                let instance = |dx: u32, dy: u32| aovs[((y + dy - 1) * size[0] + x + dx - 1) as usize].instance;
                let here = instance(1, 1);
                // Paths begin anywhere in a pixel: away from edges.
                if here == 0 || (0..9).any(|i| instance(i % 3, i / 3) != here) {
                    continue;
                }
                seen[here as usize - 1] += 1;
                let off = (pixel(&film, x, y) - 1.0).abs().max_element();
                // What is 1 is not computed with.
                assert!(
                    off < 1e-6,
                    "{of:?}, {}: {} at {x}, {y}",
                    scene.instances[here as usize - 1].name,
                    pixel(&film, x, y)
                );
            }
        }
        assert!(seen.iter().all(|&count| count >= 4), "{of:?}: pixels by instance {seen:?}");
    }
}

/// Lecture F7: from below, the rim of total reflection lies at asin(1/1.333) = 48.607° from the zenith. Seen through
/// 2.4° about it.
#[test]
fn snells_window_ends_where_it_should_to_a_twentieth_of_a_degree() {
    let gpu = Gpu::hasty();
    let n = f64::from(1.333_f32);
    let rim = (1.0 / n).asin().to_degrees();
    let mut made = Made::new("window");
    let water =
        Material { transmission: 1.0, thickness: 8.0, ior: 1.333, specular: 1.0, roughness: 0.0, ..lambert([1.0; 3]) };
    made.add(Shape::cuboid(DVec3::new(60.0, 8.0, 60.0)), water, at(0.0, -4.0, 0.0));
    // What is mirrored beyond the rim.
    let down = DAffine3::from_rotation_x(-FRAC_PI_2);
    made.add(Shape::panel(50.0, 50.0), unlit([0.0; 3]), at(0.0, -6.0, 0.0) * down);
    let eye = DVec3::new(0.0, -1.0, 0.0);
    let towards = DVec3::new(rim.to_radians().sin(), rim.to_radians().cos(), 0.0);
    made.camera(eye, eye + towards, perspective(2.4));
    // Up is towards the zenith: rows are angles.
    let size = [4_u32, 96];
    let sky = Environment::constant([1.0; 3]);
    for of in [Model::Recursive, Model::Global] {
        // Few paths are enough for which row is dark: nothing comes from beyond the rim at all.
        let choices: &[&str] = if of == Model::Global { &["samples=64"] } else { &["samples=16"] };
        let (_, film) = gpu.shot(&made.0, Some(&sky), model(of, size, choices));
        let angle = |row: f64| rim - ((1.0 - 2.0 * row / 96.0) * 1.2_f64.to_radians().tan()).atan().to_degrees();
        let lit = |row: u32| (0..4).map(|x| pixel(&film, x, row).x).sum::<f64>() / 4.0;
        let first_dark = (0..96).find(|&row| lit(row) < 1e-6).expect("it ends");
        assert!((first_dark..96).all(|row| lit(row) < 1e-6), "{of:?}: light beyond the rim");
        let found = angle(f64::from(first_dark));
        eprintln!("{of:?}: dark from {found:.3}° on, for {rim:.3}°");
        // A row is 0.025°.
        assert!((found - rim).abs() < 0.05, "{of:?}: {found}, not {rim}");
        // Inside, what Fresnel's equations let through, averaged over the row.
        let mut off = 0.0_f64;
        for row in 0..first_dark - 2 {
            let want: f64 = (0..64)
                .map(|i| {
                    let theta = angle(f64::from(row) + (f64::from(i) + 0.5) / 64.0).to_radians();
                    1.0 - etalon_testing::lobe::fresnel(theta.cos(), 1.0 / n, 0.0)
                })
                .sum();
            off = off.max((lit(row) / (want / 64.0) - 1.0).abs());
        }
        eprintln!("{of:?}: what passes is off by {off:.1e}");
        // Columns lean by up to 0.05° of the rim's circle: 5e-7 of an angle. Paths choose between passing and not.
        let bound = if of == Model::Global { 0.04 } else { 0.01 };
        assert!(off < bound, "{of:?}: {off}");
    }
}

/// Lecture F5: a slanted slab moves what lies behind it to the side by t sin(α − β)/cosβ, sinα = n sinβ: rays are bent
/// as they enter and bent back as they leave. One bend and the way through the nominal thickness (`refraction=screen`):
/// by that sin(α − β).
#[test]
fn a_slab_moves_what_lies_behind_it_by_snells_law() {
    let gpu = Gpu::hasty();
    let (n, thickness, alpha) = (1.5_f64, 0.5, 40_f64.to_radians());
    let beta = (alpha.sin() / n).asin();
    let glass = Material {
        transmission: 1.0,
        thickness: thickness as f32,
        ior: 1.5,
        // Nothing is reflected, so only refracted light is seen.
        specular: 0.0,
        roughness: 0.0,
        ..lambert([1.0; 3])
    };
    for (of, refraction, shift) in [
        (Model::Recursive, "refraction=ray", thickness * (alpha - beta).sin() / beta.cos()),
        (Model::Global, "refraction=ray", thickness * (alpha - beta).sin() / beta.cos()),
        (Model::Local, "refraction=screen", thickness * (alpha - beta).sin()),
    ] {
        let mut made = Made::new("slab");
        let turn = DAffine3::from_rotation_y(alpha);
        made.add(Shape::cuboid(DVec3::new(4.0, 4.0, thickness)), glass.clone(), turn);
        // Its normal leans to +x: rays leave it further to the left, and see the edge there where it is straight ahead.
        made.add(Shape::panel(4.0, 4.0), unlit([1.0; 3]), at(2.0 - shift, 0.0, -3.0));
        made.camera(DVec3::Z * 5.0, DVec3::ZERO, orthographic(0.1));
        let size = [128, 64];
        let film = gpu.film(&made.0, model(of, size, &[refraction]));
        let row: Vec<f64> = (0..size[0]).map(|x| pixel(&film, x, 32).x).collect();
        let bright = row.iter().sum::<f64>();
        eprintln!("{of:?}: {bright} of {} pixels are bright, the edge is {shift:.4} m away", size[0]);
        // Half of the picture; a pixel is 0.003 m. What is looked up on the screen is a whole pixel.
        let bound = if of == Model::Local { 1.5 } else { 1.0 };
        assert!((bright - 64.0).abs() <= bound, "{of:?}: {bright} of {} pixels, not half", size[0]);
        assert!(
            row[..60].iter().all(|&x| x < 1e-3) && row[68..].iter().all(|&x| (x - 1.0).abs() < 1e-3),
            "{of:?}: {row:?}"
        );
    }
}

/// Bodies of plain colours, turned, stretched and mirrored.
fn placed() -> Scene {
    let mut made = Made::new("placed");
    let turn = DAffine3::from_rotation_z(0.7) * DAffine3::from_rotation_x(0.4);
    let wedge =
        || Shape::prism(&[glam::DVec2::new(-0.6, -0.5), glam::DVec2::new(0.7, -0.4), glam::DVec2::new(-0.1, 0.8)], 0.6);
    made.add(wedge(), unlit([1.0, 0.0, 0.0]), at(-1.6, 0.5, 0.0) * turn);
    let mirrored = DAffine3::from_scale(DVec3::new(-1.0, 1.2, 0.7));
    made.add(wedge(), unlit([0.0, 1.0, 0.0]), at(0.1, -0.5, 0.4) * turn * mirrored);
    made.add(Shape::cuboid(DVec3::new(0.8, 1.4, 0.5)), unlit([0.0, 0.0, 1.0]), at(1.5, 0.4, -1.0) * turn);
    made.0
}

#[test]
fn cameras_and_instances_put_things_where_the_geometry_says() {
    let gpu = Gpu::hasty();
    let scene = placed();
    let eye = DVec3::new(1.0, 1.5, 6.0);
    let with = |projection: Projection| Camera { projection, ..looking(eye, DVec3::new(0.0, 0.1, 0.0)) };
    for (what, camera, size) in [
        ("35°", with(perspective(35.0)), [64, 36]),
        ("60°, upright", with(perspective(60.0)), [30, 60]),
        ("parallel", with(orthographic(1.7)), [64, 36]),
    ] {
        let oracle = etalon_testing::raycast::picture(
            &scene,
            &camera,
            size[0],
            size[1],
            etalon_testing::raycast::Options::default(),
        );
        for of in MODELS {
            let mut made = Made(scene.clone());
            made.0.cameras = vec![camera.clone()];
            let film = gpu.film(&made.0, model(of, size, &[]));
            let mut compared = [0; 4];
            for (i, (got, want)) in film.rgba.iter().zip(&oracle).enumerate() {
                if want.edge {
                    continue;
                }
                let color = want.hit.map_or(DVec3::ZERO, |hit| hit.albedo);
                compared[want.hit.map_or(3, |hit| hit.instance)] += 1;
                assert!(
                    etalon_testing::lobe::rgb([got[0], got[1], got[2]]) == color,
                    "{of:?}, {what}, pixel {i}: {got:?} for {color}"
                );
            }
            assert!(compared.into_iter().all(|count| count > 8), "{of:?}, {what}: {compared:?}");
        }
    }
}

/// How much of the picture a panel 1.3 m wide and 0.9 m high covers: its sides over those of what is seen at its
/// distance.
#[test]
fn a_panel_is_as_large_in_the_picture_as_field_of_view_and_aspect_say() {
    let gpu = Gpu::hasty();
    let mut made = Made::new("panel");
    made.add(Shape::panel(1.3, 0.9), unlit([1.0; 3]), DAffine3::IDENTITY);
    for (what, projection, half_height, size) in [
        ("35° from 4 m", perspective(35.0), 4.0 * 17.5_f64.to_radians().tan(), [48, 24]),
        ("70° from 4 m, upright", perspective(70.0), 4.0 * 35_f64.to_radians().tan(), [24, 40]),
        ("parallel", orthographic(0.7), 0.7, [48, 32]),
    ] {
        made.0.cameras = vec![Camera { projection, ..looking(DVec3::Z * 4.0, DVec3::ZERO) }];
        let width = half_height * f64::from(size[0]) / f64::from(size[1]);
        let want = 0.65 / width * (0.45 / half_height);
        for of in MODELS {
            let film = gpu.film(&made.0, model(of, size, &["samples=64"]));
            let covered = film.rgba.iter().map(|p| f64::from(p[1])).sum::<f64>() / film.rgba.len() as f64;
            eprintln!("{of:?}, {what}: {covered:.5} for {want:.5}");
            // 64 even points of a pixel locate its edge to about 1/64 of the pixel; the panel is 10 pixels wide at
            // least.
            assert!((covered / want - 1.0).abs() < 3e-3, "{of:?}, {what}: {covered} for {want}");
        }
    }
}

/// A ball that its instance stretches, turns and mirrors: its normals are those of the ellipsoid.
#[test]
fn stretched_and_mirrored_balls_are_lit_as_ellipsoids() {
    let gpu = Gpu::hasty();
    let l = DVec3::new(0.4, 0.5, 0.8).normalize();
    for scale in [DVec3::new(1.0, 0.5, 1.4), DVec3::new(-0.6, 1.0, 1.2)] {
        let mut made = Made::new("ellipsoid");
        let placed = DAffine3::from_rotation_z(0.5) * DAffine3::from_rotation_x(0.6) * DAffine3::from_scale(scale);
        made.add(Shape::sphere(1.0, 48), Material { double_sided: false, ..lambert([1.0; 3]) }, placed);
        made.light([PI as f32; 3], LightKind::Directional { direction: -l });
        made.front(1.2);
        let size = [32, 32];
        let oracle = etalon_testing::raycast::picture(
            &made.0,
            &made.0.cameras[0],
            32,
            32,
            etalon_testing::raycast::Options::default(),
        );
        for of in MODELS {
            let off: &[&str] = match of {
                Model::Global => &["samples=16"],
                _ => &["shadows=off"],
            };
            let film = gpu.film(&made.0, model(of, size, off));
            let cosine = |i: usize| oracle[i].hit.map(|hit| hit.shading_normal.dot(l));
            let (mut worst, mut compared) = (0.0_f64, 0);
            for (i, (got, want)) in film.rgba.iter().zip(&oracle).enumerate() {
                let Some(hit) = want.hit.filter(|_| !want.edge) else { continue };
                let cos = hit.shading_normal.dot(l);
                // Near the horizon of the light, facets know better than their interpolated normals.
                if cos.min(hit.geometric_normal.dot(l)) <= 0.1 {
                    continue;
                }
                compared += 1;
                // Where vertices are snapped to 1/256 of a pixel, a normal is that of a point up to half a step away,
                // down and across. The cosine changes to the next pixel by this; a pixel without neighbours is an
                // edge.
                let change = |step: usize| {
                    let next = [i.checked_sub(step), i.checked_add(step)].map(|i| i.filter(|&i| i < oracle.len()));
                    let changes = next.into_iter().flatten().filter_map(cosine).map(|other| (other - cos).abs());
                    changes.fold(0.0, f64::max)
                };
                let snapped = (change(1) + change(size[0] as usize)) * 0.5 / 256.0;
                // Over a pixel of 0.075 the cosine changes by 0.1 or so, of which 16 even points leave little.
                let bound = match of {
                    Model::Global => 0.02,
                    _ if gpu.device.snap_pixels() > 0.0 => 1e-5 + snapped,
                    _ => 1e-5,
                };
                worst = worst.max((f64::from(got[1]) - cos).abs() / bound);
            }
            eprintln!("{of:?}, {scale}: {worst:.2} of what is allowed, {compared} pixels");
            assert!(compared > 100 && worst < 1.0, "{of:?}, {scale}: {worst} of what is allowed");
        }
    }
}
