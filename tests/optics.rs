//! Mirrors, glass, media and shadows by rays: against closed forms and against paths traced here in f64.
//!
//! Most pictures look at a card, an unlit panel whose colour is the place on it. What is seen through optics is that
//! colour times the throughput: red over blue is where the path ended, blue how much of the light arrived.

#[path = "support/gpu.rs"]
mod gpu;
#[path = "support/made.rs"]
mod made;
#[path = "support/raycast.rs"]
mod raycast;

use etalon::frame::Settings;
use etalon::optics::fresnel::fresnel_dielectric;
use etalon::optics::snell::{critical_angle, refract};
use etalon::scene::{Camera, Material, Projection, Scene};
use etalon::study::{self, shape::Shape};
use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};
use gpu::{Gpu, knobs, settings};
use made::{Made, at, lambert, looking, orthographic, perspective, unlit};

/// Rays for mirrors and glass with the exact formulas, and some other rungs.
fn optics(size: [u32; 2], more: &[&str]) -> Settings {
    let rungs = ["samples=1", "reflection=ray", "refraction=ray", "fresnel=exact", "absorption=path"];
    Settings { knobs: knobs(&[&rungs[..], more].concat()), ..settings(size) }
}

/// How far rays start off surfaces in a scene whose largest coordinate, counted from the middle of its box, is `extent`:
/// 32 roundings of it, as shaders/lib/trace.glsl says.
fn offset(extent: f64) -> f64 {
    32.0 * extent * 2.0_f64.powi(-24)
}

fn glass(n: f32) -> Material {
    Material { ior: n, metallic: 0.0, roughness: 0.0, transmission: 1.0, thickness: 1.0, ..Material::default() }
}

fn mirror(base: f32) -> Material {
    Material { base_color: [base, base, base, 1.0], metallic: 1.0, roughness: 0.0, ..Material::default() }
}

/// An unlit panel that shows where on it one looks: red runs from 0 to 1 along its +X, green along +Y, blue is 1.
fn card(made: &mut Made, size: f64, frame: DAffine3) {
    let mesh = made.mesh(Shape::panel(size, size), unlit([1.0; 3]));
    let place = |p: &[f32; 3]| [p[0] / size as f32 + 0.5, p[1] / size as f32 + 0.5, 1.0, 1.0];
    made.0.meshes[mesh].colors = made.0.meshes[mesh].positions.iter().map(place).collect();
    made.place(mesh, frame);
}

/// Where on a card a pixel's light comes from, and the share that arrives.
fn on_card(pixel: [f32; 4], size: f64) -> (DVec2, f64) {
    let [r, g, b, _] = pixel.map(f64::from);
    ((DVec2::new(r, g) / b - 0.5) * size, b)
}

/// The f64 ray through the middle of each pixel, or `shift` pixels beside it.
fn ray(camera: &Camera, size: [u32; 2], i: usize, shift: DVec2) -> (DVec3, DVec3) {
    let (x, y) = (i as u32 % size[0], i as u32 / size[0]);
    let (x, y) = (f64::from(x) + 0.5 + shift.x, f64::from(y) + 0.5 + shift.y);
    let ray = raycast::camera_ray(camera, size[0], size[1], x, y);
    (ray.origin, ray.direction)
}

const AROUND: [DVec2; 5] = [
    DVec2::ZERO,
    DVec2::new(-1.0 / 64.0, 0.0),
    DVec2::new(1.0 / 64.0, 0.0),
    DVec2::new(0.0, -1.0 / 64.0),
    DVec2::new(0.0, 1.0 / 64.0),
];

// ---------------------------------------------------------------------------------------------------- mirrors

const PATTERNS: usize = 60;

/// Balls and boxes that shine, all on the side z > 0.
fn patterns() -> Made {
    let mut made = Made::new("patterns");
    let mut random = made::Random(11);
    for i in 0..PATTERNS {
        let color = [0; 3].map(|_| random.between(0.1, 3.0) as f32);
        let glow = Material { emissive: color, specular: 0.0, ..lambert([0.0; 3]) };
        let place = at(random.between(-3.0, 0.4), random.between(-0.9, 0.9), random.between(0.5, 2.5));
        let turn =
            DAffine3::from_rotation_y(random.between(0.0, 3.0)) * DAffine3::from_rotation_x(random.between(0.0, 3.0));
        let edges = DVec3::new(random.between(0.2, 0.8), random.between(0.2, 0.6), 0.3);
        made.add(if i % 3 == 0 { Shape::sphere(0.25, 12) } else { Shape::cuboid(edges) }, glow, place * turn);
    }
    made
}

#[test]
fn a_plane_mirror_shows_what_a_mirrored_camera_sees() {
    let gpu = Gpu::new();
    let size = [160, 90];
    for projection in [perspective(50.0), orthographic(1.0)] {
        let mut scene = patterns();
        let eye = DVec3::new(2.2, 0.4, 3.0);
        let camera = Camera { projection, ..looking(eye, DVec3::new(0.3, 0.0, 0.0)) };
        // The mirror lies in z = 0, and the camera as it sees it behind. A reflected picture is a picture of the reflected
        // frame with left and right exchanged.
        let m = camera.world_from_camera.matrix3;
        let flip = |v: DVec3| DVec3::new(v.x, v.y, -v.z);
        let frame = DMat3::from_cols(-flip(m.x_axis), flip(m.y_axis), flip(m.z_axis));
        let behind = Camera { world_from_camera: DAffine3::from_mat3_translation(frame, flip(eye)), ..camera.clone() };
        scene.0.cameras = vec![behind];
        let want = gpu.film(&scene.0, optics(size, &[]));
        let world_scene = scene.0.clone();
        let world = raycast::World::new(&world_scene, raycast::Options::default());
        scene.add(Shape::panel(9.0, 6.0), mirror(1.0), DAffine3::IDENTITY);
        scene.0.cameras = vec![camera.clone()];
        let with = gpu.film(&scene.0, optics(size, &["interfaces=1"]));
        let everything = raycast::World::new(&scene.0, raycast::Options::default());
        let (mut compared, mut seen, mut left_out) = (0, 0, 0);
        for (i, got) in with.rgba.iter().enumerate() {
            let (x, y) = (i % size[0] as usize, i / size[0] as usize);
            let other = y * size[0] as usize + (size[0] as usize - 1 - x);
            let hits = |shift: DVec2| {
                let (o, d) = ray(&camera, size, i, shift);
                everything.closest(&raycast::Ray::new(o, d)).map(|hit| hit.instance)
            };
            // Pixels that see the mirror, and in it one thing all around their middles.
            if !AROUND.iter().all(|&shift| hits(shift) == Some(PATTERNS)) {
                continue;
            }
            let mirrored = |shift: DVec2| {
                let (o, d) = ray(&world_scene.cameras[0], size, other, shift);
                let plane = raycast::Ray { nearest: -o.z / d.z, ..raycast::Ray::new(o, d) };
                world.closest(&plane).map(|hit| hit.instance)
            };
            let here = mirrored(DVec2::ZERO);
            if AROUND.iter().any(|&shift| mirrored(shift) != here) {
                left_out += 1;
                continue;
            }
            compared += 1;
            seen += usize::from(here.is_some());
            // What shines has one radiance and the mirror reflects all of it: no rounding at all.
            assert_eq!(got[..3], want.rgba[other][..3], "pixel {x}, {y}: {here:?}");
        }
        eprintln!("{compared} pixels, {seen} of them see something in the mirror, {left_out} left out");
        assert!(seen > 1500 && compared > 4000 && left_out < 200);
    }
}

#[test]
fn a_tilted_mirror_shows_every_place_where_it_is() {
    let gpu = Gpu::new();
    let size = [96, 54];
    for tilt in [0.0, 0.35, -0.5] {
        let mut made = Made::new("tilted mirror");
        let turn = DAffine3::from_rotation_y(tilt) * DAffine3::from_rotation_x(0.7 * tilt);
        made.add(Shape::panel(8.0, 8.0), mirror(0.75), turn);
        // Behind the camera, facing it.
        let card_at = at(0.0, 0.0, 4.0);
        card(&mut made, 8.0, card_at);
        made.camera(DVec3::new(0.2, 0.1, 2.5), DVec3::new(0.1, 0.0, 0.0), perspective(40.0));
        let film = gpu.film(&made.0, optics(size, &[]));
        let n = turn.transform_vector3(DVec3::Z);
        let (mut worst, mut compared) = (0.0_f64, 0);
        for (i, &pixel) in film.rgba.iter().enumerate() {
            let (o, d) = ray(&made.0.cameras[0], size, i, DVec2::ZERO);
            let p = o + d * (-n.dot(o) / n.dot(d));
            let r = d - n * (2.0 * n.dot(d));
            let q = p + r * ((4.0 - p.z) / r.z);
            if r.z < 0.2 || q.truncate().abs().max_element() > 3.99 {
                continue;
            }
            let (place, share) = on_card(pixel, 8.0);
            // A metal's F0 is its base colour, 0.75, and rises to 1 as (1 − cos)⁵.
            let f = 0.75 + 0.25 * (1.0 + n.dot(d)).powi(5);
            assert!((share / f - 1.0).abs() < 2e-6, "pixel {i}: {share} for {f}");
            worst = worst.max((place - q.truncate()).length());
            compared += 1;
        }
        eprintln!("tilt {tilt}: {worst:e} m over {compared} pixels");
        assert!(compared > 1000);
        // The ray starts `offset` off along the normal and again towards the eye; along a reflected ray of slope up to 5
        // that is as many times as far. Rounded directions add 1e-7 of 6 m.
        assert!(worst < 2.0 * offset(4.0) * 5.0 + 3e-6, "tilt {tilt}: {worst:e}");
    }
}

// ---------------------------------------------------------------------------------------------------- glass

#[test]
fn a_slab_shifts_what_is_behind_it_sideways() {
    let gpu = Gpu::new();
    let size = [128, 72];
    for (d, n) in [(0.5, 1.5_f32), (1.2, 1.5), (0.8, 1.333), (0.3, 2.4)] {
        let mut made = Made::new("slab");
        made.add(Shape::cuboid(DVec3::new(7.0, 5.0, d)), glass(n), at(0.0, 0.0, -0.5 * d));
        let far = 2.0;
        card(&mut made, 13.0, at(0.0, 0.0, -far));
        made.camera(DVec3::Z, DVec3::ZERO, perspective(95.0));
        // Two surfaces and no more: what is reflected inside is not followed.
        let film = gpu.film(&made.0, optics(size, &["interfaces=2"]));
        let n = f64::from(n);
        let (mut worst, mut worst_share, mut most, mut steepest) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
        for (i, &pixel) in film.rgba.iter().enumerate() {
            let (o, v) = ray(&made.0.cameras[0], size, i, DVec2::ZERO);
            let cos_a = -v.z;
            let sin_a = (1.0 - cos_a * cos_a).sqrt();
            let cos_b = (1.0 - (sin_a / n).powi(2)).sqrt();
            let straight = (o + v * ((o.z + far) / cos_a)).truncate();
            // Across the ray, and so 1/cos a of it along the card, towards the axis.
            let shift = d * sin_a * (1.0 - cos_a / (n * cos_b));
            let want = straight - v.truncate().normalize() * (shift / cos_a);
            let (place, share) = on_card(pixel, 13.0);
            let (tan_a, tan_b) = (sin_a / cos_a, sin_a / n / cos_b);
            // Behind each of the surfaces the ray starts `offset` further along the normal; the card's 13 m are read off
            // from three rounded numbers.
            let bound = offset(6.5) * (tan_a + tan_b) + 13.0 * 2.0_f64.powi(-22) / (cos_a * cos_a);
            let error = (place - want).length();
            assert!(error < bound, "{d} m of {n} at {:.1}°: {error:e} m, {bound:e}", cos_a.acos().to_degrees());
            let passes = (1.0 - fresnel_dielectric(cos_a, n)[0]).powi(2);
            worst = worst.max(error);
            worst_share = worst_share.max((share / passes - 1.0).abs());
            most = most.max(shift);
            steepest = steepest.max(cos_a.acos().to_degrees());
        }
        eprintln!(
            "{d} m of {n}: to {steepest:.1}°, shifted by up to {most:.3} m, {worst:e} m off, share {worst_share:e}"
        );
        assert!(most > 0.15 * d && steepest > 60.0);
        // F has a few roundings, and 1 − F at 65° loses none of it.
        assert!(worst_share < 3e-6, "{worst_share:e}");
    }
}

/// Where a ray through a ball of radius `r_in` at its entry and `r_out` at its exit meets z = `far`.
fn through_ball(o: DVec3, d: DVec3, [r_in, r_out]: [f64; 2], n: f64, far: f64) -> Option<DVec2> {
    let near = |o: DVec3, d: DVec3, r: f64, sign: f64| {
        let half = o.dot(d);
        let disc = half * half - (o.length_squared() - r * r);
        (disc > 0.0).then(|| o + d * (-half + sign * disc.sqrt()))
    };
    let p = near(o, d, r_in, -1.0)?;
    let (inner, _, _) = refract(d, p, n);
    let q = near(p, inner, r_out, 1.0)?;
    let (outer, total, _) = refract(inner, -q, 1.0 / n);
    (!total && outer.z < -0.05).then(|| (q + outer * ((far - q.z) / outer.z)).truncate())
}

#[test]
fn a_glass_ball_maps_places_as_an_exact_sphere_does() {
    let gpu = Gpu::new();
    let size = [96, 96];
    let (radius, far) = (0.8, -1.6);
    let mut mean = Vec::new();
    for rings in [48, 96] {
        let mut made = Made::new("ball");
        made.add(Shape::sphere(radius, rings), glass(1.5), DAffine3::IDENTITY);
        card(&mut made, 4.0, at(0.0, 0.0, far));
        made.camera(DVec3::new(0.1, 0.3, 3.0), DVec3::new(0.0, 0.0, 0.0), perspective(30.0));
        let film = gpu.film(&made.0, optics(size, &["interfaces=2"]));
        // Normals at the corners are the directions from the middle, so those between them are so too, of the facet's own
        // points: each facet refracts as a concentric sphere through its point would. A facet lies below the sphere by no
        // more than the half diagonal of its cells says, √2/2 of π/rings.
        let low = radius * (std::f64::consts::FRAC_1_SQRT_2 * std::f64::consts::PI / f64::from(rings)).cos();
        let (mut worst, mut compared, mut used, mut sum) = (0.0_f64, 0, 0.0_f64, 0.0);
        for (i, &pixel) in film.rgba.iter().enumerate() {
            let (o, d) = ray(&made.0.cameras[0], size, i, DVec2::ZERO);
            // Up to 64° of incidence: beyond, one ray may miss a facet.
            if o.cross(d).length() > 0.9 * radius {
                continue;
            }
            let map = |radii| through_ball(o, d, radii, 1.5, far);
            let all = [[radius, radius], [low, radius], [radius, low], [low, low]].map(map);
            let [Some(want), Some(a), Some(b), Some(c)] = all else { continue };
            if want.abs().max_element() > 1.95 {
                continue;
            }
            let (place, _) = on_card(pixel, 4.0);
            let error = (place - want).length();
            let bound = [a, b, c].iter().fold(0.0_f64, |m, p| m.max((*p - want).length()));
            // Rays start two roundings of 32 further along the normals, and run at slopes up to 4 beyond; the map is
            // nearly linear over such small differences of the radii.
            assert!(error < 1.1 * bound + 8.0 * offset(2.0), "{rings} rings, pixel {i}: {error:e} m, {bound:e}");
            (worst, used) = (worst.max(error), used.max(error / bound));
            sum += error;
            compared += 1;
        }
        eprintln!(
            "{rings} rings: {worst:e} m, {used:.3} of the bound, mean {:e}, {compared} pixels",
            sum / f64::from(compared)
        );
        assert!(compared > 2500);
        mean.push(sum / f64::from(compared));
    }
    // The depth of the facets falls with the square of their size.
    assert!(mean[1] < 0.3 * mean[0], "{mean:?}");
}

#[test]
fn a_prism_deviates_by_snells_law_applied_twice() {
    let gpu = Gpu::new();
    let size = [16, 9];
    let n = f64::from(1.62_f32);
    let apex = 60.0_f64.to_radians();
    let least = (n * (0.5 * apex).sin()).asin();
    let mut deviations = Vec::new();
    for incidence in [38.0_f64, 42.0, 48.0, least.to_degrees(), 60.0, 70.0, 80.0] {
        let i = incidence.to_radians();
        // Corners in the plane of incidence, x to the right and z towards the light, turned so that the normal of the
        // face of entry is at i on the left of it; the light bends to the right, to the base.
        let corners = [90.0_f64, 210.0, 330.0].map(|angle| {
            let turned = (angle + 60.0).to_radians() + i;
            DVec2::new(turned.cos(), turned.sin()) * 3.0_f64.sqrt().recip()
        });
        let upright = DAffine3::from_mat3(DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y));
        let middle_of_face = DVec3::new(-i.sin(), 0.0, i.cos()) * 3.0_f64.sqrt().recip() * 0.5;
        let at_distance = |far: f64| {
            let mut made = Made::new("prism");
            made.add(Shape::prism(&corners, 1.0), glass(1.62), upright);
            // On the right only: from 45° on the face of entry reflects downwards as well, to the left.
            card(&mut made, 14.0, at(6.7, 0.0, -far));
            let eye = DVec3::new(middle_of_face.x, 0.0, 10.0);
            made.camera(eye, eye - DVec3::Z, orthographic(0.05));
            gpu.film(&made.0, optics(size, &["interfaces=2"]))
        };
        let [near, far] = [1.0, 3.0].map(at_distance);
        // The other face's angle from the geometry of the prism, not from the direction.
        let want = i + (apex.sin() * (n * n - i.sin().powi(2)).sqrt() - apex.cos() * i.sin()).asin() - apex;
        let mut worst = 0.0_f64;
        for (near, far) in near.rgba.iter().zip(&far.rgba) {
            let along = on_card(*far, 14.0).0 - on_card(*near, 14.0).0;
            worst = worst.max(((along.x / 2.0).atan() - want).abs()).max(along.y.abs() / 2.0);
        }
        eprintln!("incidence {incidence:.2}°: deviation {:.4}°, {worst:e} rad off", want.to_degrees());
        // Places on the card are good to 2e-6 m on 2 m; near grazing exit the angle grows tenfold.
        assert!(worst < 4e-6, "incidence {incidence}: {worst:e} rad");
        deviations.push(want);
    }
    let smallest = deviations.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(smallest, deviations[3]);
    assert!((smallest - (2.0 * least - apex)).abs() < 1e-12);
}

#[test]
fn snells_window_is_as_wide_as_the_critical_angle() {
    let gpu = Gpu::new();
    let size = [160, 90];
    let scene = study::load("pool").expect("a study scene");
    let picture = |sky: f32| {
        let mut scene = scene.clone();
        for material in scene.materials.iter_mut().filter(|m| m.name == "sky") {
            material.emissive = material.emissive.map(|x| x * sky);
        }
        gpu.film(&scene, optics(size, &["interfaces=4"]))
    };
    let [bright, dark] = [1.0, 0.0].map(picture);
    let Projection::Perspective { fov_y, .. } = scene.cameras[0].projection else { panic!("a perspective camera") };
    let pixels_per_unit = 45.0 / (0.5 * fov_y).tan();
    let water = scene.materials.iter().find(|m| m.name == "water").expect("water").ior;
    let half_angle = critical_angle(f64::from(water), 1.0)[1];
    assert!((half_angle.to_degrees() - 48.6).abs() < 0.05);
    let want = half_angle.tan() * pixels_per_unit;
    let sees_sky = |x: f64, y: f64| {
        let i = y.floor() as usize * 160 + x.floor() as usize;
        bright.rgba[i][..3].iter().zip(&dark.rgba[i][..3]).any(|(a, b)| a - b > 1e-3)
    };
    // Things stand in front of the rim here and there, in the water and above: where a path by Snell's law does not end at
    // the sky all the way up to the rim, nothing can be measured.
    let mut air = scene.clone();
    let is = |i: usize, name: &str| scene.materials[scene.meshes[scene.instances[i].mesh].material].name == name;
    air.instances =
        (0..scene.instances.len()).filter(|&i| !is(i, "water")).map(|i| scene.instances[i].clone()).collect();
    let air = raycast::World::new(&air, raycast::Options::default());
    let free = |r: f64, azimuth: f64| {
        let (x, y) = (80.0 + r * azimuth.cos(), 45.0 + r * azimuth.sin());
        let below = raycast::camera_ray(&scene.cameras[0], 160, 90, x, y);
        let surface = -below.origin.y / below.direction.y;
        let (direction, total, _) = refract(below.direction, DVec3::NEG_Y, 1.0 / f64::from(water));
        let above = raycast::Ray::new(below.origin + below.direction * surface, direction);
        !total
            && air.closest(&raycast::Ray { farthest: surface, ..below }).is_none()
            && air.closest(&above).is_some_and(|hit| scene.materials[hit.material].name == "sky")
    };
    let (mut measured, mut worst) = (0, 0.0_f64);
    for azimuth in (0..360).step_by(5).map(|a| f64::from(a).to_radians()) {
        if !(1..30).all(|k| free(want - 0.1 * f64::from(k), azimuth)) {
            continue;
        }
        let at = |k: u32| want - 5.0 + 0.1 * f64::from(k);
        let sees = |r: f64| sees_sky(80.0 + r * azimuth.cos(), 45.0 + r * azimuth.sin());
        let edge = (0..90).filter(|&k| sees(at(k))).map(at).fold(0.0, f64::max);
        measured += 1;
        worst = worst.max((edge - want).abs());
    }
    eprintln!(
        "half-angle {:.2}° is {want:.2} pixels; {measured} azimuths, {worst:.2} pixels off",
        half_angle.to_degrees()
    );
    assert!(measured > 50 && worst <= 1.0, "{measured} azimuths, {worst}");
}
