//! Mirrors, glass, media and shadows by rays: against closed forms and against paths traced here in f64.
//!
//! Most pictures look at a card, an unlit panel whose colour is the place on it. What is seen through optics is that
//! colour times the throughput: red over blue is where the path ended, blue how much of the light arrived.

use etalon::frame::{Rendered, Settings};
use etalon::optics::fresnel::fresnel_dielectric;
use etalon::optics::snell::{critical_angle, refract};
use etalon::scene::environment::Environment;
use etalon::scene::{AlphaMode, Camera, Image, LightKind, Material, Mesh, Projection, Sampler, TextureRef};
use etalon::study::{self, shape::Shape};
use etalon_testing::gpu::{Gpu, knobs, settings};
use etalon_testing::made::{Made, at, lambert, looking, orthographic, perspective, unlit};
use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};

/// Rays for mirrors and glass with the exact formulas, and some other rungs.
fn optics(size: [u32; 2], more: &[&str]) -> Settings {
    let rungs = ["samples=1", "reflection=ray", "refraction=ray", "fresnel=exact", "absorption=path"];
    Settings { knobs: knobs(&[&rungs[..], more].concat()), ..settings(size) }
}

/// How far rays start off surfaces in a scene whose largest coordinate, counted from the middle of its box, is
/// `extent`: 32 roundings of it, as shaders/lib/trace.glsl says.
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
    let ray = etalon_testing::raycast::camera_ray(camera, size[0], size[1], x, y);
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
    let mut random = etalon::optics::SplitMix64::new(11);
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
    let gpu = Gpu::open();
    let size = [160, 90];
    for projection in [perspective(50.0), orthographic(1.0)] {
        let mut scene = patterns();
        let eye = DVec3::new(2.2, 0.4, 3.0);
        let camera = Camera { projection, ..looking(eye, DVec3::new(0.3, 0.0, 0.0)) };
        // The mirror lies in z = 0, and the camera as it sees it behind. A reflected picture is a picture of the
        // reflected frame with left and right exchanged.
        let m = camera.world_from_camera.matrix3;
        let flip = |v: DVec3| DVec3::new(v.x, v.y, -v.z);
        let frame = DMat3::from_cols(-flip(m.x_axis), flip(m.y_axis), flip(m.z_axis));
        let behind = Camera { world_from_camera: DAffine3::from_mat3_translation(frame, flip(eye)), ..camera.clone() };
        scene.0.cameras = vec![behind];
        let want = gpu.film(&scene.0, optics(size, &[]));
        let world_scene = scene.0.clone();
        let world = etalon_testing::raycast::World::new(&world_scene, etalon_testing::raycast::Options::default());
        scene.add(Shape::panel(9.0, 6.0), mirror(1.0), DAffine3::IDENTITY);
        scene.0.cameras = vec![camera.clone()];
        let with = gpu.film(&scene.0, optics(size, &["interfaces=1"]));
        let everything = etalon_testing::raycast::World::new(&scene.0, etalon_testing::raycast::Options::default());
        let (mut compared, mut seen, mut left_out) = (0, 0, 0);
        for (i, got) in with.rgba.iter().enumerate() {
            let (x, y) = (i % size[0] as usize, i / size[0] as usize);
            let other = y * size[0] as usize + (size[0] as usize - 1 - x);
            let hits = |shift: DVec2| {
                let (o, d) = ray(&camera, size, i, shift);
                everything.closest(&etalon_testing::raycast::Ray::new(o, d)).map(|hit| hit.instance)
            };
            // Pixels that see the mirror, and in it one thing all around their middles.
            if !AROUND.iter().all(|&shift| hits(shift) == Some(PATTERNS)) {
                continue;
            }
            let mirrored = |shift: DVec2| {
                let (o, d) = ray(&world_scene.cameras[0], size, other, shift);
                let plane =
                    etalon_testing::raycast::Ray { nearest: -o.z / d.z, ..etalon_testing::raycast::Ray::new(o, d) };
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
        assert!(seen > 1000 && compared > 4000 && left_out < 200);
    }
}

#[test]
fn a_tilted_mirror_shows_every_place_where_it_is() {
    let gpu = Gpu::open();
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
        // The ray starts `offset` off along the normal and again towards the eye; along a reflected ray of slope up to
        // 5 that is as many times as far. Rounded directions add 1e-7 of 6 m.
        assert!(worst < 2.0 * offset(4.0) * 5.0 + 3e-6, "tilt {tilt}: {worst:e}");
    }
}

// ---------------------------------------------------------------------------------------------------- glass

#[test]
fn a_slab_shifts_what_is_behind_it_sideways() {
    let gpu = Gpu::open();
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
            // Behind each of the surfaces the ray starts `offset` further along the normal; the card's 13 m are read
            // off from three rounded numbers.
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
    let gpu = Gpu::open();
    let size = [96, 96];
    let (radius, far) = (0.8, -1.6);
    let mut mean = Vec::new();
    for rings in [48, 96] {
        let mut made = Made::new("ball");
        made.add(Shape::sphere(radius, rings), glass(1.5), DAffine3::IDENTITY);
        card(&mut made, 4.0, at(0.0, 0.0, far));
        made.camera(DVec3::new(0.1, 0.3, 3.0), DVec3::new(0.0, 0.0, 0.0), perspective(30.0));
        let film = gpu.film(&made.0, optics(size, &["interfaces=2"]));
        // Normals at the corners are the directions from the middle, so those between them are so too, of the facet's
        // own points: each facet refracts as a concentric sphere through its point would. A facet lies below the sphere
        // by no more than the half diagonal of its cells says, √2/2 of π/rings.
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
    let gpu = Gpu::open();
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
        let (mut worst, mut sum) = (0.0_f64, 0.0);
        for (near, far) in near.rgba.iter().zip(&far.rgba) {
            let ((near, here), (far, there)) = (on_card(*near, 14.0), on_card(*far, 14.0));
            // The place of a black pixel is NaN. Half of the light arrives where it grazes the face of exit.
            assert!(here.min(there) > 0.25, "incidence {incidence}: shares {here} and {there} of the light");
            let along = far - near;
            let deviation = (along.x / 2.0).atan();
            worst = worst.max((deviation - want).abs()).max(along.y.abs() / 2.0);
            sum += deviation;
        }
        eprintln!("incidence {incidence:.2}°: deviation {:.4}°, {worst:e} rad off", want.to_degrees());
        // Places on the card are good to 2e-6 m on 2 m; near grazing exit the angle grows tenfold.
        assert!(worst < 4e-6, "incidence {incidence}: {worst:e} rad");
        deviations.push(sum / f64::from(size[0] * size[1]));
    }
    let smallest = deviations.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(smallest, deviations[3]);
    assert!((smallest - (2.0 * least - apex)).abs() < 4e-6, "{deviations:?}");
}

#[test]
fn snells_window_is_as_wide_as_the_critical_angle() {
    let gpu = Gpu::open();
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
    // Things stand in front of the rim here and there, in the water and above: where a path by Snell's law does not end
    // at the sky all the way up to the rim, nothing can be measured.
    let mut air = scene.clone();
    let is = |i: usize, name: &str| scene.materials[scene.meshes[scene.instances[i].mesh].material].name == name;
    air.instances =
        (0..scene.instances.len()).filter(|&i| !is(i, "water")).map(|i| scene.instances[i].clone()).collect();
    let air = etalon_testing::raycast::World::new(&air, etalon_testing::raycast::Options::default());
    let free = |r: f64, azimuth: f64| {
        let (x, y) = (80.0 + r * azimuth.cos(), 45.0 + r * azimuth.sin());
        let below = etalon_testing::raycast::camera_ray(&scene.cameras[0], 160, 90, x, y);
        let surface = -below.origin.y / below.direction.y;
        let (direction, total, _) = refract(below.direction, DVec3::NEG_Y, 1.0 / f64::from(water));
        let above = etalon_testing::raycast::Ray::new(below.origin + below.direction * surface, direction);
        !total
            && air.closest(&etalon_testing::raycast::Ray { farthest: surface, ..below }).is_none()
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

// ---------------------------------------------------------------------------------------------------- media

/// Where a ray is inside a convex body given by outward normals and a point of each face.
fn chord(o: DVec3, d: DVec3, faces: &[(DVec3, DVec3)]) -> Option<[(f64, DVec3); 2]> {
    let mut span = [(f64::NEG_INFINITY, DVec3::ZERO), (f64::INFINITY, DVec3::ZERO)];
    for &(n, p) in faces {
        let (towards, height) = (n.dot(d), n.dot(p - o));
        let t = height / towards;
        if towards < 0.0 && t > span[0].0 {
            span[0] = (t, n);
        }
        if towards > 0.0 && t < span[1].0 {
            span[1] = (t, n);
        }
        if towards == 0.0 && height < 0.0 {
            return None;
        }
    }
    (span[0].0 < span[1].0).then_some(span)
}

/// Of a placed prism: each edge's face and the two ends.
fn prism_faces(corners: &[DVec2], depth: f64, frame: DAffine3) -> Vec<(DVec3, DVec3)> {
    let linear = frame.matrix3.inverse().transpose();
    let mut faces = vec![(DVec3::Z, DVec3::Z * 0.5 * depth), (DVec3::NEG_Z, DVec3::NEG_Z * 0.5 * depth)];
    for (i, p) in corners.iter().enumerate() {
        let along = corners[(i + 1) % corners.len()] - *p;
        faces.push((DVec3::new(along.y, -along.x, 0.0), p.extend(0.0)));
    }
    faces.iter().map(|&(n, p)| ((linear * n).normalize(), frame.transform_point3(p))).collect()
}

#[test]
fn a_wedge_absorbs_by_the_length_of_each_path() {
    let gpu = Gpu::open();
    let size = [72, 54];
    let corners = [DVec2::new(-0.45, -0.25), DVec2::new(0.45, -0.25), DVec2::new(-0.45, 0.35)];
    let depth = 0.4;
    let color = [0.3, 0.6, 0.9_f32];
    for scale in [1.0, 2.0] {
        let frame =
            DAffine3::from_rotation_y(0.4) * DAffine3::from_rotation_x(0.3) * DAffine3::from_scale(DVec3::splat(scale));
        let mut made = Made::new("wedge");
        let body = Material { attenuation_color: color, attenuation_distance: 1.0, thickness: 0.3, ..glass(1.0) };
        made.add(Shape::prism(&corners, depth), body, frame);
        made.add(Shape::panel(2.9, 2.9), unlit([1.0; 3]), at(0.0, 0.0, -0.9));
        made.camera(DVec3::new(0.3, 0.2, 3.0), DVec3::ZERO, perspective(24.0));
        let faces = prism_faces(&corners, depth, frame);
        let sigma = color.map(|c| -f64::from(c).ln());
        let rungs = ["absorption=path", "absorption=thickness", "absorption=off"];
        for &rung in if scale > 1.0 { &rungs[..2] } else { &rungs[..] } {
            for (fresnel, behind_plate) in [("fresnel=exact", false), ("fresnel=schlick", true)] {
                // Behind a plate of nothing the wedge is met by rays and not in the G-buffer.
                let mut made = Made(made.0.clone());
                if behind_plate {
                    made.add(Shape::cuboid(DVec3::new(2.4, 1.8, 0.02)), glass(1.0), at(0.0, 0.0, 1.2));
                }
                let film = gpu.film(&made.0, optics(size, &[rung, fresnel]));
                let (mut worst, mut inside, mut least, mut most) = (0.0_f64, 0, f64::MAX, 0.0_f64);
                for (i, pixel) in film.rgba.iter().enumerate() {
                    let spans = AROUND.map(|shift| {
                        let (o, d) = ray(&made.0.cameras[0], size, i, shift);
                        chord(o, d, &faces)
                    });
                    if spans.iter().any(Option::is_some) != spans.iter().all(Option::is_some) {
                        continue;
                    }
                    let path = spans[0].map_or(0.0, |[a, b]| b.0 - a.0);
                    if spans[0].is_some() {
                        inside += 1;
                        (least, most) = (least.min(path), most.max(path));
                    }
                    for c in 0..3 {
                        let length = match rung {
                            "absorption=path" => path,
                            // The nominal thickness is in metres of the object.
                            "absorption=thickness" if spans[0].is_some() => f64::from(0.3_f32) * scale,
                            _ => 0.0,
                        };
                        worst = worst.max((f64::from(pixel[c]) / (-sigma[c] * length).exp() - 1.0).abs());
                    }
                }
                eprintln!("scale {scale}, {rung}, {fresnel}: {worst:e}, {inside} pixels, {least:.3} to {most:.3} m");
                assert!(inside > 500 && least < 0.02 * scale && most > 0.4 * scale);
                // The inner ray starts `offset` below the surface it enters by, up to 2 of that along the ray; the
                // largest sigma is 1.2 per metre. With boxes of 2.9 m that is 1e-5; the plate moves the ray sideways by
                // as much again.
                assert!(worst < if behind_plate { 2e-5 } else { 1e-5 }, "scale {scale}, {rung}, {fresnel}: {worst:e}");
            }
        }
    }
}

/// Balls and strips on a lit floor.
fn lit_floor() -> Made {
    let mut made = Made::new("floor");
    made.add(Shape::plane(6.0, 6.0, 1), lambert([0.5, 0.25, 0.75]), DAffine3::IDENTITY);
    for i in 0..6 {
        let strip = Shape::cuboid(DVec3::new(0.25, 0.5, 2.0));
        made.add(strip, lambert([0.25, 0.125 * i as f32, 0.5]), at(f64::from(i) * 0.6 - 1.5, 0.25, -1.0));
    }
    let direction = DVec3::new(0.4, -1.0, -0.3).normalize();
    made.light([2.0; 3], LightKind::Directional { direction });
    let position = DVec3::new(-1.0, 3.0, 1.0);
    made.light([4.0, 5.0, 6.0], LightKind::Point { position, range: None });
    made.camera(DVec3::new(0.5, 2.0, 4.0), DVec3::new(0.0, 0.3, 0.0), perspective(40.0));
    made
}

#[test]
fn a_ball_of_nothing_is_invisible_and_so_is_its_shadow() {
    let gpu = Gpu::open();
    let size = [128, 72];
    // Bright above and dark below: what the ball mirrored would show.
    let sky = Environment {
        name: "sky".to_owned(),
        width: 16,
        height: 8,
        radiance: (0..128).map(|i| if i < 64 { [2.0; 3] } else { [0.1; 3] }).collect(),
    };
    for (fresnel, roughness) in
        [("fresnel=exact", 0.0), ("fresnel=schlick", 0.0), ("fresnel=exact", 0.15), ("fresnel=schlick", 0.7)]
    {
        for (camera, eye) in [("outside", None), ("inside", Some(DVec3::new(0.1, 1.0, 0.9)))] {
            let mut made = lit_floor();
            if let Some(eye) = eye {
                made.0.cameras[0] = looking(eye, DVec3::new(0.0, 0.3, -1.0));
            }
            let rungs = ["shadows=ray", fresnel];
            let without = gpu.shot(&made.0, Some(&sky), optics(size, &rungs)).1;
            made.add(Shape::sphere(0.8, 24), Material { roughness, ..glass(1.0) }, at(0.2, 0.9, 0.8));
            let (rendered, with) = gpu.shot(&made.0, Some(&sky), optics(size, &rungs));
            let (mut worst, mut off, mut through) = (0.0_f64, 0, 0);
            for (a, b) in with.rgba.iter().zip(&without.rgba) {
                let e = (0..3).map(|c| f64::from((a[c] - b[c]).abs() / b[c].max(0.01))).fold(0.0, f64::max);
                off += usize::from(e > 1e-4);
                through += usize::from(a != b);
                worst = worst.max(if e > 1e-4 { 0.0 } else { e });
            }
            eprintln!(
                "{camera}, {fresnel}, roughness {roughness}: {worst:e}, {through} pixels differ, {off} of them are others, {:?}",
                rendered.work
            );
            assert!(rendered.work.refraction > 1000);
            // Seen through the ball a surface is hit by a ray, 1e-6 m beside where the G-buffer has it, and its colours
            // are no halves: edges may fall to the other side in a few pixels of a few hundred along edges. Where
            // vertices are snapped, the G-buffer has it up to 2^-8.5 of a pixel beside, 1e-4 m at 5 m.
            let close = if gpu.device.snap_pixels() > 0.0 { 1e-4 } else { 2e-5 };
            assert!(worst < close && off <= 8, "{camera}, {fresnel}: {worst:e}, {off}");
        }
    }
}

// ---------------------------------------------------------------------------------------------------- reflectance

/// A body all around that shines with radiance 1.
fn glowing_room(made: &mut Made, size: f64) {
    let glow = Material { emissive: [1.0; 3], specular: 0.0, ..lambert([0.0; 3]) };
    made.add(Shape::cuboid(DVec3::splat(size)), glow, DAffine3::IDENTITY);
}

#[test]
fn a_boundary_reflects_what_fresnels_equations_say() {
    let gpu = Gpu::open();
    let size = [96, 96];
    for n in [1.333_f32, 1.5, 2.4] {
        let mut made = Made::new("boundary");
        // What is refracted meets only the bottom or a side of the block, and is not followed any further.
        made.add(Shape::cuboid(DVec3::new(3.6, 1.0, 3.6)), glass(n), at(0.0, -0.5, 0.0));
        glowing_room(&mut made, 4.0);
        let eye = DVec3::new(0.0, 0.05, 0.4);
        made.camera(eye, eye - DVec3::new(0.0, 0.5, 1.0), perspective(125.0));
        let film = gpu.film(&made.0, optics(size, &["interfaces=1"]));
        let (mut worst, mut compared, mut steepest) = (0.0_f64, 0, 0.0_f64);
        for (i, pixel) in film.rgba.iter().enumerate() {
            let (o, d) = ray(&made.0.cameras[0], size, i, DVec2::ZERO);
            let p = o + d * (-o.y / d.y);
            if d.y > -1e-3 || p.abs().max_element() > 1.79 {
                continue;
            }
            let want = fresnel_dielectric(-d.y, f64::from(n))[0];
            let error = (f64::from(pixel[0]) / want - 1.0).abs();
            worst = worst.max(error);
            compared += 1;
            steepest = steepest.max((-d.y).acos().to_degrees());
        }
        eprintln!("n = {n}: {worst:e} over {compared} pixels up to {steepest:.2}°");
        // f32 has F to a few roundings; F0 near 0.02 is a square of a difference of ones.
        assert!(compared > 2000 && steepest > 87.0 && worst < 4e-6, "{n}: {worst:e}");
    }
}

#[test]
fn beyond_the_critical_angle_all_light_stays_inside() {
    let gpu = Gpu::open();
    let size = [96, 96];
    for n in [1.333_f32, 1.5, 2.4] {
        let mut made = Made::new("inside");
        made.add(Shape::cuboid(DVec3::new(4.0, 1.0, 4.0)), glass(n), at(0.0, -0.5, 0.0));
        // Within the glass, below the eye.
        let glow = Material { emissive: [1.0; 3], specular: 0.0, ..lambert([0.0; 3]) };
        made.add(Shape::plane(3.9, 3.9, 1), glow, at(0.0, -0.6, 0.0));
        made.camera(DVec3::new(0.0, -0.5, 0.0), DVec3::ZERO, perspective(130.0));
        let film = gpu.film(&made.0, optics(size, &["interfaces=1"]));
        let critical = critical_angle(f64::from(n), 1.0)[1];
        let (mut worst, mut below, mut beyond) = (0.0_f64, 0, 0);
        for (i, pixel) in film.rgba.iter().enumerate() {
            let (_, d) = ray(&made.0.cameras[0], size, i, DVec2::ZERO);
            let (x, z) = (d.x / d.y * 1.1, d.z / d.y * 1.1);
            if d.y <= 0.0 || x.abs().max(z.abs()) > 1.94 {
                continue;
            }
            let angle = d.y.acos();
            if angle > critical + 1e-6 {
                assert_eq!(pixel[..3], [1.0; 3], "n = {n} at {:.2}°", angle.to_degrees());
                beyond += 1;
            } else if angle < critical - 1e-6 {
                let want = fresnel_dielectric(d.y, 1.0 / f64::from(n))[0];
                // Towards the critical angle F rises ever steeper: two roundings of the cosine count as much as it
                // says.
                let beside =
                    [-1.2e-7, 1.2e-7].map(|e| (fresnel_dielectric(d.y + e, 1.0 / f64::from(n))[0] - want).abs());
                let bound = 2e-6 * want + beside[0].max(beside[1]);
                let error = (f64::from(pixel[0]) - want).abs();
                assert!(error < bound, "n = {n} at {:.3}°: {} for {want}, {bound:e}", angle.to_degrees(), pixel[0]);
                worst = worst.max(error / bound);
                below += 1;
            }
        }
        eprintln!("n = {n}: {below} pixels below, {worst:.3} of the bound, {beyond} beyond");
        assert!(below > 300 && beyond > 1000);
    }
}

// ---------------------------------------------------------------------------------------------------- nested media

/// A box of some medium in the world.
#[derive(Clone)]
struct Body {
    frame: DAffine3,
    edges: DVec3,
    n: f32,
    priority: i32,
    material: u32,
}

impl Body {
    fn faces(&self) -> Vec<(DVec3, DVec3)> {
        [DVec3::X, DVec3::Y, DVec3::Z]
            .iter()
            .flat_map(|&n| [n, -n])
            .map(|n| (self.frame.matrix3 * n, self.frame.transform_point3(n * self.edges * 0.5)))
            .collect()
    }
}

/// All paths of a ray through boxes, in f64: which medium is where follows from priorities, of several the one entered
/// last. Surfaces and faintest branches count as they do for the renderer.
struct Paths<'a> {
    bodies: &'a [Body],
    faces: Vec<Vec<(DVec3, DVec3)>>,
    card: f64,
    card_size: f64,
    interfaces: u32,
    /// Light from the card, and the light of branches that may or may not be too faint.
    sum: DVec3,
    unsure: DVec3,
    /// What was met, in order.
    events: Vec<(usize, DVec3)>,
}

/// Branches that weigh less are not followed (shaders/lib/ray_tree.glsl).
const FAINTEST: f64 = 1.0 / 512.0;

impl<'a> Paths<'a> {
    fn new(bodies: &'a [Body], card: f64, card_size: f64, interfaces: u32) -> Self {
        let faces = bodies.iter().map(Body::faces).collect();
        Self { bodies, faces, card, card_size, interfaces, sum: DVec3::ZERO, unsure: DVec3::ZERO, events: Vec::new() }
    }

    fn present(&self, inside: &[usize]) -> Option<usize> {
        let mut present: Option<usize> = None;
        for &i in inside {
            if present.is_none_or(|p| self.bodies[i].priority >= self.bodies[p].priority) {
                present = Some(i);
            }
        }
        present
    }

    fn index(&self, medium: Option<usize>) -> f64 {
        medium.map_or(1.0, |i| f64::from(self.bodies[i].n))
    }

    /// `met` surfaces lie before.
    fn follow(&mut self, o: DVec3, d: DVec3, weight: f64, sure: bool, inside: &[usize], met: u32) {
        let mut next: Option<(f64, usize, DVec3, bool)> = None;
        for (i, faces) in self.faces.iter().enumerate() {
            let Some([enter, leave]) = chord(o, d, faces) else { continue };
            let within = inside.contains(&i);
            let (t, n) = if within { leave } else { enter };
            if t > 1e-9 && next.is_none_or(|other| t < other.0) {
                next = Some((t, i, n, !within));
            }
        }
        let to_card = (self.card - o.z) / d.z;
        if to_card > 0.0 && next.is_none_or(|(t, ..)| to_card < t) {
            let p = (o + d * to_card).truncate() / self.card_size + 0.5;
            if p.min_element() > 0.0 && p.max_element() < 1.0 {
                self.events.push((usize::MAX, DVec3::ZERO));
                let light = p.extend(1.0) * weight;
                if sure {
                    self.sum += light;
                } else {
                    self.unsure += light;
                }
                return;
            }
        }
        let Some((t, i, outward, enters)) = next else { return };
        self.events.push((i, outward));
        let p = o + d * t;
        let n = if enters { outward } else { -outward };
        let mut after = inside.to_vec();
        if enters {
            after.push(i);
        } else {
            after.retain(|&j| j != i);
        }
        let (here, there) = (self.present(inside), self.present(&after));
        if here.map(|i| self.bodies[i].material) == there.map(|i| self.bodies[i].material) {
            return self.follow(p, d, weight, sure, &after, met);
        }
        let relative = self.index(there) / self.index(here);
        let f = fresnel_dielectric(-n.dot(d), relative)[0];
        let mut send = |d: DVec3, weight: f64, media: &[usize]| {
            if met < self.interfaces && weight > FAINTEST * 0.9999 {
                self.follow(p, d, weight, sure && weight > FAINTEST * 1.0001, media, met + 1);
            }
        };
        send(d - n * (2.0 * n.dot(d)), weight * f, inside);
        let (bent, total, _) = refract(d, n, relative);
        if !total {
            send(bent, weight * (1.0 - f), &after);
        }
    }
}

/// Boxes over a card against all their paths in f64: the largest difference, and how many pixels were compared.
fn against_paths(gpu: &Gpu, bodies: &[Body], interfaces: u32) -> (f64, usize) {
    let size = [80, 45];
    let (far, card_size) = (-2.0, 4.0);
    let mut made = Made::new("bodies");
    for (i, body) in bodies.iter().enumerate() {
        let material = Material { priority: body.priority, ..glass(body.n) };
        let mesh = made.mesh(Shape::cuboid(body.edges), material);
        made.0.meshes[mesh].material = bodies.iter().position(|other| other.material == body.material).unwrap_or(i);
        made.place(mesh, body.frame);
    }
    card(&mut made, card_size, at(0.0, 0.0, far));
    made.camera(DVec3::new(0.3, 0.2, 2.6), DVec3::ZERO, perspective(38.0));
    let film = gpu.film(&made.0, optics(size, &[&format!("interfaces={interfaces}")]));
    let (mut worst, mut compared) = (0.0_f64, 0);
    for (i, pixel) in film.rgba.iter().enumerate() {
        let all = AROUND.map(|shift| {
            let (o, d) = ray(&made.0.cameras[0], size, i, shift);
            let mut paths = Paths::new(bodies, far, card_size, interfaces);
            paths.follow(o, d, 1.0, true, &[], 0);
            paths
        });
        // What is seen directly is in the G-buffer's halves, and next to edges anything may be met.
        if all[0].events.len() < 2 || all.iter().any(|other| other.events != all[0].events) {
            continue;
        }
        let [r, g, b, _] = pixel.map(f64::from);
        let off = DVec3::new(r, g, b) - all[0].sum;
        let error = (-off).max(off - all[0].unsure).max_element();
        if error > 1e-4 {
            eprintln!("pixel {}, {}: {pixel:?} for {} {:?}", i % 80, i / 80, all[0].sum, all[0].unsure);
        }
        worst = worst.max(error);
        compared += 1;
    }
    (worst, compared)
}

fn turned(x: f64, y: f64, z: f64, axis: DVec3, angle: f64) -> DAffine3 {
    DAffine3::from_rotation_translation(DQuat::from_axis_angle(axis.normalize(), angle), DVec3::new(x, y, z))
}

#[test]
fn rays_through_nested_dielectrics_follow_the_medium_of_highest_priority() {
    let gpu = Gpu::open();
    let block = Body {
        frame: turned(0.0, 0.0, 0.0, DVec3::new(1.0, 2.0, 0.5), 0.4),
        edges: DVec3::splat(1.2),
        n: 1.5,
        priority: 0,
        material: 0,
    };
    let water = |priority| Body {
        frame: turned(0.25, 0.1, 0.05, DVec3::new(-1.0, 0.6, 0.3), 0.5),
        edges: DVec3::new(1.1, 0.8, 0.9),
        n: 1.333,
        priority,
        material: 1,
    };
    let shell = |edge: f64, n, angle| Body {
        frame: turned(0.0, 0.0, 0.0, DVec3::new(1.0, 0.3 + edge, -0.7), angle),
        edges: DVec3::splat(edge),
        n,
        priority: 0,
        material: edge.to_bits() as u32 ^ (edge.to_bits() >> 32) as u32,
    };
    let nested = [shell(1.3, 1.5, 0.3), shell(0.9, 1.333, 0.7), shell(0.55, 1.7, 1.1), shell(0.28, 1.2, 0.2)];
    for (name, bodies, interfaces) in [
        ("two of one glass", vec![block.clone(), Body { n: 1.5, material: 0, ..water(0) }], 4),
        ("two glasses of one index", vec![block.clone(), Body { n: 1.5, ..water(0) }], 4),
        ("water over glass", vec![block.clone(), water(1)], 4),
        ("glass over water", vec![block.clone(), water(-1)], 4),
        ("the last one entered", vec![block.clone(), water(0)], 4),
        ("glass over water, many surfaces", vec![block, water(-1)], 8),
        ("four in one another", nested.to_vec(), 8),
        ("a bubble in glass", vec![shell(1.3, 1.5, 0.3), shell(0.9, 1.0, 0.7)], 8),
        ("a bubble in ice in glass", vec![shell(1.3, 1.5, 0.3), shell(0.9, 1.31, 0.7), shell(0.55, 1.0, 1.1)], 8),
        ("four, the outer ones win", (0..4).map(|i| Body { priority: -(i as i32), ..nested[i].clone() }).collect(), 4),
    ] {
        let (worst, compared) = against_paths(&gpu, &bodies, interfaces);
        eprintln!("{name}: {worst:e} over {compared} pixels");
        assert!(compared > 400, "{name}: {compared}");
        // Each surface adds `offset` times a slope of some units to the place on the card, which is 4 m wide.
        let bound = f64::from(interfaces) * offset(2.3) * 4.0 / 4.0 + 2e-6;
        assert!(worst < bound, "{name}: {worst:e}, {bound:e}");
    }
}

#[test]
fn closed_meshes_of_equal_index_act_as_one() {
    let gpu = Gpu::open();
    let size = [80, 45];
    let (color, distance) = ([0.4, 0.7, 0.9_f32], 0.8);
    for (n, fresnel) in [(1.5_f32, "fresnel=exact"), (1.5, "fresnel=schlick"), (1.0, "fresnel=exact")] {
        let material = Material { attenuation_color: color, attenuation_distance: distance, ..glass(n) };
        let picture = |parts: &[(f64, usize)], rungs: &[&str]| {
            let mut made = Made::new("parts");
            let turn = DAffine3::from_rotation_y(0.6) * DAffine3::from_rotation_x(0.4);
            let mut meshes: Vec<Option<usize>> = vec![None; 2];
            for &(edge, which) in parts {
                // Scaled from one mesh, so that two parts may also be two instances of one.
                let new = || made.mesh(Shape::cuboid(DVec3::new(1.4, 0.8, 0.8)), material.clone());
                let mesh = *meshes[which].get_or_insert_with(new);
                made.place(mesh, turn * DAffine3::from_scale(DVec3::splat(edge)));
            }
            card(&mut made, 4.0, at(0.0, 0.0, -2.0));
            made.camera(DVec3::new(0.2, 0.3, 2.6), DVec3::ZERO, perspective(35.0));
            gpu.film(&made.0, optics(size, rungs))
        };
        let rungs = ["interfaces=32", fresnel];
        let union = picture(&[(1.0, 0)], &rungs);
        for (name, second) in [("one material", 0), ("two materials", 1)] {
            let parts = picture(&[(1.0, 0), (0.6, second)], &rungs);
            let (mut worst, mut off, mut absorbed) = (0.0_f64, 0, 0);
            for (a, b) in union.rgba.iter().zip(&parts.rgba) {
                let e = (0..3).map(|c| f64::from((a[c] - b[c]).abs())).fold(0.0, f64::max);
                off += usize::from(e > 1e-4);
                absorbed += usize::from(a[0] < 0.9 * a[2]);
                worst = worst.max(if e > 1e-4 { 0.0 } else { e });
            }
            eprintln!("n = {n}, {fresnel}, {name}: {worst:e}, {off} pixels off, {absorbed} absorb");
            // Every boundary that is not there still moves the ray by an offset; next to an edge it may then take
            // another path.
            assert!(absorbed > 400 && worst < 3e-5 && off <= 6, "n = {n}, {fresnel}, {name}: {worst:e}, {off}");
        }
    }
}

// ---------------------------------------------------------------------------------------------------- shadows

/// A wall in z = 0 seen from the front, with a light, and what may stand between them outside of the picture.
fn lit_wall(kind: LightKind) -> Made {
    let mut made = Made::new("wall");
    made.add(Shape::panel(4.0, 3.0), lambert([0.5; 3]), DAffine3::IDENTITY);
    made.light([5.0; 3], kind);
    made.front(0.5);
    made
}

/// From a point of the wall to the light: direction and length.
fn to_light(kind: &LightKind, p: DVec3) -> (DVec3, f64) {
    match *kind {
        LightKind::Directional { direction } => (-direction, f64::INFINITY),
        LightKind::Point { position, .. } | LightKind::Spot { position, .. } => {
            ((position - p).normalize(), (position - p).length())
        }
    }
}

fn lights() -> [LightKind; 3] {
    let position = DVec3::new(3.2, 0.4, 2.6);
    let direction = DVec3::new(-3.0, -0.5, -2.6).normalize();
    [
        LightKind::Directional { direction },
        LightKind::Point { position, range: None },
        LightKind::Spot { position, direction, range: None, inner: 0.5, outer: 0.9 },
    ]
}

/// Half way to the lights.
const BETWEEN: DVec3 = DVec3::new(1.75, 0.25, 1.5);

/// The share of the light that arrives at each pixel of the wall, by the picture without shadows, against `want` in f64
/// at the point that the pixel shows. Points where that differs a tenth of a millimetre beside are left out; all must
/// be few.
fn against_shares(gpu: &Gpu, made: &Made, bound: f64, want: impl Fn(DVec3, DVec3, f64) -> DVec3) -> [f64; 2] {
    let size = [128, 72];
    let film = gpu.film(&made.0, optics(size, &["shadows=ray"]));
    let lit = gpu.film(&made.0, optics(size, &["shadows=off"]));
    let (mut compared, mut least, mut most) = (0, f64::MAX, 0.0_f64);
    for i in 0..film.rgba.len() {
        let (o, _) = ray(&made.0.cameras[0], size, i, DVec2::ZERO);
        let p = DVec3::new(o.x, o.y, 0.0);
        let at = |shift: DVec2| {
            let p = p + shift.extend(0.0) * 64.0 * 1e-4;
            let (d, length) = to_light(&made.0.lights[0].kind, p);
            want(p, d, length)
        };
        let share = at(DVec2::ZERO);
        if AROUND.iter().any(|&shift| (at(shift) - share).abs().max_element() > 1e-3) {
            continue;
        }
        compared += 1;
        // The ray to the light starts off the wall, by `offset` along its normal and as much to the eye.
        let (d, length) = to_light(&made.0.lights[0].kind, p);
        let raised = want(p + DVec3::Z * 2.0 * offset(2.1), d, length);
        for c in 0..3 {
            let got = f64::from(film.rgba[i][c]) / f64::from(lit.rgba[i][c]);
            let error = (got - share[c]).abs();
            assert!(
                error < bound + 1.5 * (raised[c] - share[c]).abs(),
                "{:?}, {p}: {got} of the light for {share}, channel {c}",
                made.0.lights[0].kind
            );
        }
        (least, most) = (least.min(share.x), most.max(share.x));
    }
    assert!(compared > 128 * 72 * 97 / 100, "{compared}");
    [least, most]
}

#[test]
fn an_opaque_object_casts_its_shadow_where_f64_has_it() {
    let gpu = Gpu::open();
    for kind in lights() {
        let mut made = lit_wall(kind);
        let body = Body {
            frame: turned(BETWEEN.x, BETWEEN.y, BETWEEN.z, DVec3::ONE, 0.6),
            edges: DVec3::new(0.4, 0.3, 0.35),
            n: 1.0,
            priority: 0,
            material: 0,
        };
        made.add(Shape::cuboid(body.edges), lambert([0.5; 3]), body.frame);
        // Beyond the light, or behind the wall, nothing shadows.
        let (d, length) = to_light(&kind, DVec3::ZERO);
        if length.is_finite() {
            made.add(
                Shape::cuboid(DVec3::splat(0.5)),
                lambert([0.5; 3]),
                DAffine3::from_translation(d * (length + 1.0)),
            );
        }
        made.add(Shape::cuboid(DVec3::splat(0.5)), lambert([0.5; 3]), DAffine3::from_translation(d * -1.0));
        let faces = body.faces();
        // The terminator's factor of flat surfaces is 1 to a few roundings.
        let seen = against_shares(&gpu, &made, 2e-6, |p, d, length| {
            let blocked = chord(p, d, &faces).is_some_and(|[a, b]| b.0 > 0.0 && a.0 < length);
            DVec3::splat(if blocked { 0.0 } else { 1.0 })
        });
        assert_eq!(seen, [0.0, 1.0], "{kind:?}");
    }
}

#[test]
fn coloured_sheets_and_closed_meshes_colour_the_light_that_passes_them() {
    let gpu = Gpu::open();
    for kind in lights() {
        // A sheet: its colour once and one boundary's transmission.
        let mut made = lit_wall(kind);
        let color = [0.9, 0.5, 0.2_f32];
        let [r, g, b] = color;
        let sheet = Material { base_color: [r, g, b, 1.0], thickness: 0.0, ..glass(1.5) };
        let frame = turned(BETWEEN.x, BETWEEN.y, BETWEEN.z, DVec3::new(0.2, 1.0, 0.1), 1.1);
        made.add(Shape::panel(0.6, 0.4), sheet, frame);
        let n = frame.transform_vector3(DVec3::Z);
        let [least, most] = against_shares(&gpu, &made, 4e-6, |p, d, _| {
            let t = n.dot(frame.translation - p) / n.dot(d);
            let at = frame.inverse().transform_point3(p + d * t);
            let meets = at.x.abs() < 0.3 && at.y.abs() < 0.2;
            let passes = 1.0 - fresnel_dielectric(n.dot(d).abs(), f64::from(1.5_f32))[0];
            if meets { DVec3::from(color.map(f64::from)) * passes } else { DVec3::ONE }
        });
        assert!(least < 0.87 && most == 1.0, "{kind:?}");

        // A body: the root of its colour at each surface, both boundaries, and what is absorbed on the straight line.
        let mut made = lit_wall(kind);
        let dye = [0.3, 0.8, 0.6_f32];
        let tinted =
            Material { base_color: [r, g, b, 1.0], attenuation_color: dye, attenuation_distance: 0.25, ..glass(1.5) };
        let body = Body {
            frame: turned(BETWEEN.x, BETWEEN.y, BETWEEN.z, DVec3::ONE, 0.6),
            edges: DVec3::new(0.4, 0.3, 0.35),
            n: 1.5,
            priority: 0,
            material: 0,
        };
        made.add(Shape::cuboid(body.edges), tinted, body.frame);
        let faces = body.faces();
        let [least, most] = against_shares(&gpu, &made, 1e-5, |p, d, _| {
            let Some([enter, leave]) = chord(p, d, &faces) else { return DVec3::ONE };
            let passes = [enter, leave].map(|(_, n)| 1.0 - fresnel_dielectric(n.dot(d).abs(), 1.5)[0]);
            let absorbed = dye.map(|c| (f64::from(c).ln() / 0.25 * (leave.0 - enter.0)).exp());
            DVec3::from(color.map(f64::from)) * DVec3::from(absorbed) * passes[0] * passes[1]
        });
        assert!(least < 0.2 && most == 1.0, "{kind:?}");
    }
}

#[test]
fn light_passes_the_holes_of_a_mask() {
    let gpu = Gpu::open();
    let holes = |x: u32, y: u32| (x * 3 + y * 5) % 7 < 3;
    for kind in lights() {
        let mut made = lit_wall(kind);
        let texel = |i: u32| [255, 255, 255, if holes(i % 8, i / 8) { 100 } else { 200 }];
        let rgba = (0..64).flat_map(texel).collect();
        made.0.images.push(Image { name: "mask".to_owned(), width: 8, height: 8, rgba });
        let sampler = Sampler { mag_nearest: true, min_nearest: true, mips: false, ..Sampler::default() };
        let texture = TextureRef { image: 0, uv_set: 0, uv_transform: glam::Affine2::IDENTITY, sampler };
        let mask =
            Material { alpha_mode: AlphaMode::Mask(0.5), base_color_texture: Some(texture), ..lambert([1.0; 3]) };
        let frame = turned(BETWEEN.x, BETWEEN.y, BETWEEN.z, DVec3::new(0.2, 1.0, 0.1), 1.1);
        made.add(Shape::panel(0.6, 0.4), mask, frame);
        let n = frame.transform_vector3(DVec3::Z);
        let seen = against_shares(&gpu, &made, 2e-6, |p, d, _| {
            let t = n.dot(frame.translation - p) / n.dot(d);
            let at = frame.inverse().transform_point3(p + d * t);
            let (x, y) = ((at.x / 0.6 + 0.5) * 8.0, (0.5 - at.y / 0.4) * 8.0);
            let within = (0.0..8.0).contains(&x) && (0.0..8.0).contains(&y);
            DVec3::splat(if within && !holes(x as u32, y as u32) { 0.0 } else { 1.0 })
        });
        assert_eq!(seen, [0.0, 1.0], "{kind:?}");
    }
}

// ---------------------------------------------------------------------------------------------------- what should not
// be

/// Everything white and clear in a room that shines with radiance 1 all around: each path ends there, so every pixel is
/// 1 less what was not followed.
fn in_a_furnace(gpu: &Gpu, made: &mut Made, fresnel: &str) -> (Rendered, Vec<String>, f64) {
    glowing_room(made, 8.0);
    let settings = optics([80, 45], &["interfaces=16", fresnel]);
    let mut renderer = gpu.renderer(&made.0, None, settings);
    let rendered = renderer.render(&made.0.cameras[0], &mut |_| ()).expect("a picture");
    let film = renderer.film().expect("the film");
    let lost = f64::from(rendered.work.most_lost);
    let mut mean = 0.0;
    for pixel in &film.rgba {
        assert!(pixel.iter().all(|v| v.is_finite()), "{}: {pixel:?}", made.0.name);
        for v in &pixel[..3] {
            let v = f64::from(*v);
            // As many products and sums as surfaces, some 1e-7 each.
            assert!(v < 1.0 + 4e-6 && v > 1.0 - lost - 4e-6, "{}: {pixel:?}, at most {lost} lost", made.0.name);
        }
        mean += (1.0 - f64::from(pixel[0])) / film.rgba.len() as f64;
    }
    // What is missing is what was not followed, which is counted in steps of 2^-16 rounded up.
    let counted = rendered.work.mean_lost;
    assert!(mean < counted + 4e-6 && mean > counted - 2e-5, "{}: {mean} for {counted}", made.0.name);
    eprintln!(
        "{}, {fresnel}: {lost} lost at most, {mean:e} in the mean, {} stray",
        made.0.name, rendered.work.unmatched_exits
    );
    (rendered, renderer.warnings.clone(), lost)
}

/// A mesh of clear glass called `name`, turned a little, and a camera before it.
fn flawed(name: &str, n: f32, edit: impl FnOnce(&mut Mesh)) -> Made {
    let mut made = Made::new(name);
    let mesh = made.mesh(Shape::cuboid(DVec3::new(1.2, 1.0, 0.8)), glass(n));
    made.0.meshes[mesh].name = name.to_owned();
    edit(&mut made.0.meshes[mesh]);
    made.place(mesh, turned(0.0, 0.0, 0.0, DVec3::new(0.3, 1.0, 0.2), 0.5));
    made.camera(DVec3::new(0.2, 0.3, 2.2), DVec3::ZERO, perspective(40.0));
    made
}

#[test]
fn flawed_glass_gives_a_defined_picture_and_is_named() {
    let gpu = Gpu::open();
    let nothing_more = |_: &mut Mesh| ();
    for fresnel in ["fresnel=exact", "fresnel=schlick"] {
        for n in [1.5, 1.0] {
            let sound = in_a_furnace(&gpu, &mut flawed("sound", n, nothing_more), fresnel);
            assert!(sound.1.is_empty() && sound.0.work.unmatched_exits == 0 && sound.0.work.refraction > 1000);
            assert!(sound.2 < 0.1, "{}", sound.2);

            let open = in_a_furnace(&gpu, &mut flawed("open one", n, |m| drop(m.indices.drain(3..6))), fresnel);
            assert!(open.1.iter().any(|w| w.contains("\"open one\"") && w.contains("not closed")), "{:?}", open.1);
            assert_eq!(open.0.work.unmatched_exits, 0, "a sheet has no inside");

            let turned_over = |m: &mut Mesh| m.indices.chunks_exact_mut(3).for_each(|t| t.swap(1, 2));
            let flipped = in_a_furnace(&gpu, &mut flawed("turned one", n, turned_over), fresnel);
            assert!(
                flipped.1.iter().any(|w| w.contains("\"turned one\"") && w.contains("inside out")),
                "{:?}",
                flipped.1
            );
            assert_eq!(flipped.0.work.unmatched_exits, 0, "turned back, it is sound");
            assert!((flipped.0.work.refraction as f64 / sound.0.work.refraction as f64 - 1.0).abs() < 0.01);

            let one_turned = in_a_furnace(&gpu, &mut flawed("one face", n, |m| m.indices[6..9].swap(0, 1)), fresnel);
            assert!(one_turned.1.iter().any(|w| w.contains("\"one face\"")), "{:?}", one_turned.1);

            // Every triangle twice: closed still, and entered twice.
            let doubled = |m: &mut Mesh| m.indices.extend_from_within(..);
            let doubled = in_a_furnace(&gpu, &mut flawed("doubled", n, doubled), fresnel);
            assert!(doubled.1.len() == 1 && doubled.1[0].contains("\"doubled\""), "{:?}", doubled.1);
            assert!((doubled.0.work.refraction as f64 / sound.0.work.refraction as f64 - 1.0).abs() < 0.01);

            // No area: two corners in one place, and three on a line, which in the world may get some by rounding.
            let thin = |m: &mut Mesh| {
                let (a, b) = (m.indices[0], m.indices[1]);
                m.indices.extend([a, b, b]);
                let middle = m.positions.len() as u32;
                let [p, q] = [a, b].map(|i| glam::Vec3::from(m.positions[i as usize]));
                m.positions.push(((p + q) * 0.5).to_array());
                let normal = m.normals[a as usize];
                m.normals.push(normal);
                m.uvs[0].push([0.0; 2]);
                m.indices.extend([a, b, middle, b, a, middle]);
            };
            let thin = in_a_furnace(&gpu, &mut flawed("thin", n, thin), fresnel);
            assert!(thin.1.iter().any(|w| w.contains("triangles without area")), "{:?}", thin.1);
            assert_eq!(thin.0.work.unmatched_exits, 0);

            let broken = |m: &mut Mesh| {
                let at = m.positions.len() as u32;
                m.positions.extend([[f32::NAN; 3], [0.1, f32::INFINITY, 0.0]]);
                m.normals.extend([[0.0, 0.0, 1.0]; 2]);
                m.uvs[0].extend([[0.0; 2]; 2]);
                m.indices.extend([0, 1, at, 2, at + 1, 3]);
            };
            let broken = in_a_furnace(&gpu, &mut flawed("broken", n, broken), fresnel);
            assert!(broken.1.iter().any(|w| w.contains("\"broken\"")), "{:?}", broken.1);
            assert!(broken.1.iter().any(|w| w.starts_with("2 triangles")), "{:?}", broken.1);
        }
    }
}

#[test]
fn turned_over_glass_looks_as_it_would_the_right_way_round() {
    let gpu = Gpu::open();
    let picture = |[turned_over, normals, mirrored]: [bool; 3]| {
        let mut made = flawed("ball", 1.5, |m| {
            *m = Mesh { material: m.material, name: m.name.clone(), ..Mesh::default() };
            let ball = Shape::sphere(0.6, 16);
            (m.positions, m.normals, m.indices) = (ball.positions.into(), ball.normals.into(), ball.indices.into());
            m.uvs[0] = ball.uvs.into();
            if turned_over {
                m.indices.chunks_exact_mut(3).for_each(|t| t.swap(1, 2));
            }
            if normals {
                m.normals.iter_mut().flatten().for_each(|x| *x = -*x);
            }
        });
        if mirrored {
            // The ball is its own mirror image.
            made.0.instances[0].world_from_object *= DAffine3::from_scale(DVec3::new(1.0, -1.0, 1.0));
        }
        card(&mut made, 4.0, at(0.0, 0.0, -1.5));
        gpu.shot(&made.0, None, optics([80, 80], &[]))
    };
    let (_, want) = picture([false; 3]);
    for (name, how) in [
        ("mirrored", [false, false, true]),
        ("faces and normals turned", [true, true, false]),
        ("faces and normals turned, mirrored", [true, true, true]),
        ("faces turned", [true, false, false]),
    ] {
        let (rendered, got) = picture(how);
        let off = |a: &[f32; 4], b: &[f32; 4]| (0..3).any(|c| (a[c] - b[c]).abs() > 2e-5);
        let others = want.rgba.iter().zip(&got.rgba).filter(|(a, b)| off(a, b)).count();
        eprintln!("{name}: {others} pixels are others");
        // The same facets from other corners: along their edges a few pixels fall to the other side.
        assert!(others < 20 && rendered.work.unmatched_exits == 0, "{name}: {others}");
    }
}

#[test]
fn closed_meshes_with_a_common_face_lose_no_light() {
    let gpu = Gpu::open();
    for (name, gap, n) in
        [("touching", 0.0, [1.5, 1.333]), ("twins", -0.6, [1.5, 1.5]), ("far apart", 0.5, [1.5, 1.333])]
    {
        let mut made = Made::new(name);
        let turn = turned(0.0, 0.0, 0.0, DVec3::new(0.3, 1.0, 0.2), 0.5);
        for (n, x) in [(n[0], -0.3 - 0.5 * gap), (n[1], 0.3 + 0.5 * gap)] {
            made.add(Shape::cuboid(DVec3::splat(0.6)), glass(n), turn * at(x, 0.0, 0.0));
        }
        made.camera(DVec3::new(0.2, 0.3, 2.2), DVec3::ZERO, perspective(40.0));
        let (rendered, ..) = in_a_furnace(&gpu, &mut made, "fresnel=exact");
        assert!(gap <= 0.0 || rendered.work.unmatched_exits == 0, "{name}: {:?}", rendered.work);
    }
}

#[test]
fn an_eye_on_the_glass_sees() {
    let gpu = Gpu::open();
    // On the front face of a block, in its plane to the last bit, looking in, out and along it; and on an edge and a
    // corner.
    for (name, eye) in [
        ("on a face", DVec3::new(0.1, 0.2, 0.5)),
        ("on an edge", DVec3::new(0.1, 0.5, 0.5)),
        ("on a corner", DVec3::splat(0.5)),
    ] {
        for towards in [DVec3::NEG_Z, DVec3::Z, DVec3::X, DVec3::new(0.1, -0.3, -1.0)] {
            let mut made = Made::new(name);
            made.add(Shape::cuboid(DVec3::ONE), glass(1.5), DAffine3::IDENTITY);
            made.camera(eye, eye + towards, perspective(90.0));
            in_a_furnace(&gpu, &mut made, "fresnel=exact");
        }
    }
}

// ---------------------------------------------------------------------------------------------------- cut-off

#[test]
fn what_is_not_followed_is_reported() {
    let gpu = Gpu::open();
    let size = [96, 54];
    let mut made = Made::new("mirrors");
    // Two mirrors face one another, not quite parallel, with lamps between them.
    made.add(Shape::panel(6.0, 6.0), mirror(0.9), at(0.0, 0.0, -1.0) * DAffine3::from_rotation_y(0.002));
    let front = DAffine3::from_rotation_y(std::f64::consts::PI - 0.005);
    made.add(Shape::panel(6.0, 6.0), mirror(0.9), at(0.0, 0.0, 2.0) * front);
    for i in 0..8 {
        let glow = Material { emissive: [1.0, 0.5, 0.25], specular: 0.0, ..lambert([0.0; 3]) };
        let x = 0.12 * f64::from(i) - 0.4;
        made.add(Shape::cuboid(DVec3::new(0.03, 0.06, 0.03)), glow, at(x, 0.2 - 0.1 * f64::from(i % 4), 0.2));
    }
    made.camera(DVec3::new(0.1, 0.05, 1.6), DVec3::new(0.0, 0.0, -1.0), perspective(10.0));
    let pictures: Vec<_> = ["1", "2", "4", "8", "16", "32"]
        .map(|n| gpu.shot(&made.0, None, optics(size, &[&format!("interfaces={n}")])))
        .into_iter()
        .collect();
    let mut before = f64::INFINITY;
    for (i, (less, a)) in pictures.iter().enumerate() {
        for (more, b) in &pictures[i..] {
            let (mut most, mut mean) = (0.0_f64, 0.0);
            for (p, q) in a.rgba.iter().zip(&b.rgba) {
                // Nothing shines brighter than 1, and each mirror takes some: a branch that is not followed carries no
                // more than its weight. None brings less than nothing.
                let missing = (0..3).map(|c| f64::from(q[c]) - f64::from(p[c])).fold(0.0, f64::max);
                assert!((0..3).all(|c| q[c] >= p[c] - 1e-6));
                most = most.max(missing);
                mean += missing / a.rgba.len() as f64;
            }
            assert!(most <= f64::from(less.work.most_lost) + 1e-6, "{most} for {:?} and {:?}", less.work, more.work);
            assert!(mean <= less.work.mean_lost + 1e-6, "{mean} for {:?}", less.work);
            if i < 3 {
                let last = &pictures[5].0.work;
                assert!(more.work == less.work || mean > 1e-4, "{mean}: more surfaces show more; {last:?}");
            }
        }
        eprintln!(
            "{} reflections: {} lost at most, {} in the mean",
            less.work.reflection, less.work.most_lost, less.work.mean_lost
        );
        // Each mirror more takes a tenth of what is left.
        assert!(less.work.mean_lost < before && less.work.mean_lost > 0.0);
        before = less.work.mean_lost;
    }
    // All who see the mirrors lose what 32 of 0.9 leave or, in lamps, nothing.
    let expected = 0.9_f64.powi(33);
    assert!(f64::from(pictures[5].0.work.most_lost) < 1.2 * expected, "{:?}, {expected}", pictures[5].0.work);
}

#[test]
fn two_slabs_that_touch_shift_a_ray_as_both_do() {
    let gpu = Gpu::open();
    // Glass on water without a gap: all faces are parallel, so a ray leaves in its own direction.
    for indices in [[1.5_f32, 1.333], [1.333, 1.5]] {
        let mut made = Made::new("sandwich");
        for (n, z) in indices.iter().zip([-0.25, -0.75]) {
            made.add(Shape::cuboid(DVec3::new(7.0, 5.0, 0.5)), glass(*n), at(0.0, 0.0, z));
        }
        card(&mut made, 10.0, at(0.0, 0.0, -2.0));
        made.camera(DVec3::Z, DVec3::ZERO, perspective(70.0));
        let (rendered, film) = gpu.shot(&made.0, None, optics([64, 36], &["interfaces=4"]));
        let (mut worst, mut wrong) = (0.0_f64, 0);
        for (i, &pixel) in film.rgba.iter().enumerate() {
            let (o, v) = ray(&made.0.cameras[0], [64, 36], i, DVec2::ZERO);
            let slope = |n: f64| {
                let sin = (1.0 - v.z * v.z).sqrt() / n;
                sin / (1.0 - sin * sin).sqrt()
            };
            let across = 0.5 * (slope(f64::from(indices[0])) + slope(f64::from(indices[1]))) + (o.z + 1.0) * slope(1.0);
            let want = v.truncate().normalize() * across;
            // Reflections between the faces add a few percent of light from nearby.
            let error = (on_card(pixel, 10.0).0 - want).length();
            worst = worst.max(error);
            // NaN where nothing of the card is seen.
            wrong += usize::from(error.is_nan() || error > 0.1);
        }
        eprintln!("{indices:?}: {worst} m, {wrong} pixels, {} stray", rendered.work.unmatched_exits);
        assert_eq!((wrong, rendered.work.unmatched_exits), (0, 0), "{indices:?}: {worst} m");
    }
}

#[test]
fn coincident_interfaces_of_equal_index_vanish() {
    let gpu = Gpu::open();
    let picture = |cuts: &[f64], moved: DVec3| {
        let mut made = Made::new("cut");
        for ends in cuts.windows(2) {
            let (near, far) = (ends[0], ends[1]);
            // Faces turned, so that the coordinates of those that coincide are rounded.
            let frame = DAffine3::from_translation(moved) * DAffine3::from_rotation_y(0.4);
            let shape = Shape::cuboid(DVec3::new(2.0, 1.6, near - far));
            made.add(shape, glass(1.5), frame * at(0.0, 0.0, 0.5 * (near + far)));
        }
        card(&mut made, 10.0, at(moved.x, moved.y, moved.z - 2.0));
        made.camera(moved + DVec3::new(0.3, 0.4, 3.0), moved, perspective(50.0));
        gpu.film(&made.0, optics([64, 48], &["interfaces=16"]))
    };
    for moved in [DVec3::ZERO, DVec3::new(3.3, -7.1, 40.0)] {
        let (one, three) = (picture(&[0.4, -0.6], moved), picture(&[0.4, 0.15, -0.3, -0.6], moved));
        let (mut off, mut seen) = (0, 0);
        for (a, b) in one.rgba.iter().zip(&three.rgba) {
            let apart = (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max);
            off += usize::from(apart > 2e-5);
            seen += usize::from(a[2] < 0.999);
        }
        eprintln!("{off} pixels of {seen} differ");
        // Where the joints come to the surface, a pixel may look along one.
        assert!(seen > 500 && off * 200 <= seen, "{off} of {seen}");
    }
}

#[test]
fn what_touches_a_closed_mesh_is_seen_through_it() {
    let gpu = Gpu::open();
    // The slab lies on a card, as a glass stands on a table, or a little above it. "small" has facets that are small
    // beside the card's two. "two" has one closed mesh in another: both stand on the card, or the inner one is a little
    // higher.
    for (name, size, inner) in [("slab", 1.0, false), ("small", 0.01, false), ("two", 1.0, true)] {
        let picture = |gap: f64| {
            let mut made = Made::new(name);
            let frame = DAffine3::from_rotation_x(0.3) * DAffine3::from_rotation_z(0.7);
            let edges = DVec3::new(7.0, 5.0, 0.5) * size;
            made.add(Shape::cuboid(edges), glass(1.5), frame * at(0.0, 0.0, -0.25 * size));
            if inner {
                let more = Material { priority: 1, ..glass(1.3) };
                made.add(Shape::cuboid(edges * DVec3::new(0.8, 0.8, 0.6)), more, frame * at(0.0, 0.0, gap - 0.35));
            }
            let below = if inner { 0.0 } else { gap };
            card(&mut made, 10.0, frame * at(0.0, 0.0, (-0.5 - below) * size));
            made.camera(DVec3::new(0.2, 0.1, 2.0) * size, DVec3::ZERO, perspective(60.0));
            gpu.shot(&made.0, None, optics([64, 36], &["interfaces=8"]))
        };
        let ((rendered, against), (_, apart)) = (picture(0.0), picture(1e-3));
        let mut worst = 0.0_f64;
        for (a, b) in against.rgba.iter().zip(&apart.rgba) {
            let error = (on_card(*a, 10.0).0 - on_card(*b, 10.0).0).length();
            worst = worst.max(error);
            // A thousandth is seen as up to three; light goes to and fro between the two where there is a gap.
            assert!(error < 0.03 * size && a[2] > 0.5, "{name}: {error}: {a:?} {b:?}");
        }
        eprintln!("{name}: {worst}, {:?}", rendered.work);
        assert_eq!(rendered.work.unmatched_exits, 0, "{name}");
    }
}

#[test]
fn every_level_of_a_texture_is_read_where_it_lies() {
    let gpu = Gpu::open();
    // Half black, half white: on every level, but near the edge. The tilted wall is seen in a mirror from 4 to 12 m.
    let texels = 1024_u32;
    let rgba =
        (0..texels * texels).flat_map(|i| if i % texels < texels / 2 { [0, 0, 0, 255] } else { [255; 4] }).collect();
    let mut made = Made::new("two halves");
    made.0.images.push(Image { name: "halves".to_owned(), width: texels, height: texels, rgba });
    let sampler = Sampler { mips: true, ..Sampler::default() };
    let texture = TextureRef { image: 0, uv_set: 0, uv_transform: glam::Affine2::IDENTITY, sampler };
    made.add(Shape::panel(6.0, 6.0), mirror(1.0), at(0.0, 0.0, -2.0));
    let frame = at(0.0, 0.0, 4.0) * DAffine3::from_rotation_y(std::f64::consts::PI) * DAffine3::from_rotation_x(0.8);
    let wall = Material { base_color_texture: Some(texture), ..unlit([1.0; 3]) };
    made.add(Shape::panel(12.0, 12.0), wall, frame);
    made.camera(DVec3::new(0.4, 0.0, 1.0), DVec3::new(0.0, 0.0, -2.0), perspective(60.0));
    let size = [70, 40];
    let film = gpu.film(&made.0, optics(size, &[]));
    let n = frame.transform_vector3(DVec3::Z);
    let (mut black, mut white) = (0, 0);
    for (i, pixel) in film.rgba.iter().enumerate() {
        let (o, d) = ray(&made.0.cameras[0], size, i, DVec2::ZERO);
        let p = o + d * ((-2.0 - o.z) / d.z);
        let r = DVec3::new(d.x, d.y, -d.z);
        let t = n.dot(frame.translation - p) / n.dot(r);
        let local = frame.inverse().transform_point3(p + r * t);
        let on_mirror = p.x.abs() < 2.9 && p.y.abs() < 2.9;
        // A pixel is at most 0.4 m wide there.
        if on_mirror && t > 0.0 && local.y.abs() < 5.5 && (0.6..5.5).contains(&local.x.abs()) {
            let want = if local.x > 0.0 { 1.0 } else { 0.0 };
            assert!((pixel[0] - want).abs() < 1e-3, "pixel {i}: {pixel:?}, not {want}, at {local}");
            black += usize::from(want == 0.0);
            white += usize::from(want == 1.0);
        }
    }
    assert!(black > 200 && white > 200, "{black} {white}");
}

#[test]
fn light_to_an_eye_inside_a_medium_is_absorbed() {
    let gpu = Gpu::open();
    let color = [0.3, 0.6, 0.9_f32];
    for (projection, moved) in [(perspective(60.0), 0.0), (orthographic(1.5), 900.0)] {
        let mut made = Made::new("under water");
        let x = DVec3::new(moved, 0.0, 0.0);
        let body = Material { attenuation_color: color, attenuation_distance: 2.0, ..glass(1.0) };
        made.add(Shape::cuboid(DVec3::new(8.0, 8.0, 6.0)), body, DAffine3::from_translation(x));
        // Something inside, and something behind it.
        made.add(Shape::panel(1.0, 8.0), unlit([1.0; 3]), at(moved - 1.5, 0.0, -2.0));
        made.add(Shape::panel(30.0, 30.0), unlit([1.0; 3]), at(moved, 0.0, -5.0));
        made.camera(x + DVec3::new(0.0, 0.0, 1.0), x, projection);
        let size = [48, 36];
        let (mut worst, mut within) = (0.0_f64, 0);
        for (i, pixel) in gpu.film(&made.0, optics(size, &["reflection=off"])).rgba.iter().enumerate() {
            let (o, d) = ray(&made.0.cameras[0], size, i, DVec2::ZERO);
            let on_panel = o + d * ((-2.0 - o.z) / d.z) - x + DVec3::new(1.5, 0.0, 0.0);
            if (on_panel.x.abs() - 0.5).abs() < 0.1 {
                continue;
            }
            let end = if on_panel.x.abs() < 0.5 { -2.0 } else { -3.0 };
            within += usize::from(end == -2.0);
            for c in 0..3 {
                let want = f64::from(color[c]).powf(0.5 * (end - o.z) / d.z);
                worst = worst.max((f64::from(pixel[c]) / want - 1.0).abs());
            }
        }
        eprintln!("{worst:e}, {within} within");
        assert!(worst < 1e-5 && within > 50, "{worst:e}, {within}");
    }
}

#[test]
fn triangles_that_are_there_twice_are_named() {
    let gpu = Gpu::open();
    let warnings = |twice: Material| {
        let mut made = Made::new("twice");
        made.add(Shape::panel(2.0, 2.0), mirror(0.9), at(0.0, 0.0, -3.0));
        for name in ["one", "other"] {
            let mesh = made.mesh(Shape::cuboid(DVec3::ONE), twice.clone());
            made.0.meshes[mesh].name = name.to_owned();
            made.place(mesh, DAffine3::IDENTITY);
        }
        made.camera(DVec3::Z * 4.0, DVec3::ZERO, perspective(40.0));
        gpu.renderer(&made.0, None, optics([16, 9], &[])).warnings
    };
    let said = warnings(lambert([0.5; 3]));
    assert!(
        said.len() == 1 && said[0].contains("12 triangles of mesh \"other\"") && said[0].contains("\"one\""),
        "{said:?}"
    );
    // Bodies that touch are no mistake.
    assert_eq!(warnings(glass(1.5)), Vec::<String>::new());
}

#[test]
fn mirrors_between_glass_vanish_in_a_white_furnace() {
    let gpu = Gpu::open();
    // Strips narrower than a group of lanes: their paths end at different turns of the loop, and each keeps its light.
    let mut made = Made::new("strips");
    for i in 0..24 {
        let place = at(f64::from(i) * 0.25 - 3.0, 0.0, 0.0) * DAffine3::from_rotation_x(0.2);
        match i % 3 {
            0 => made.add(Shape::panel(0.25, 4.0), mirror(1.0), place),
            1 => made.add(Shape::cuboid(DVec3::new(0.24, 4.0, 0.3)), glass(1.5), place),
            _ => made.add(Shape::sphere(0.12, 8), glass(1.8), place),
        }
    }
    made.camera(DVec3::new(0.3, 0.4, 6.0), DVec3::ZERO, perspective(35.0));
    let white = Environment::constant([1.0; 3]);
    for interfaces in ["interfaces=1", "interfaces=4", "interfaces=16"] {
        let (rendered, film) = gpu.shot(&made.0, Some(&white), optics([96, 54], &[interfaces, "absorption=off"]));
        let worst = film.rgba.iter().flat_map(|p| &p[..3]).map(|c| (c - 1.0).abs()).fold(0.0, f32::max);
        eprintln!("{interfaces}: {worst:e}, {:?}", rendered.work);
        // What is not followed sees the environment as well; a few roundings a surface.
        assert!(worst < 2e-6 && rendered.work.reflection > 1000, "{interfaces}: {worst:e}");
    }
}

#[test]
fn what_lies_behind_the_holes_of_masks_is_seen_in_mirrors() {
    let gpu = Gpu::open();
    // Fine holes before a card: neighbouring lanes end at the first, second or third mask, or behind them.
    let mut made = Made::new("holes");
    let texel = |i: u32| if (i + i / 8).is_multiple_of(2) { [255; 4] } else { [255, 255, 255, 0] };
    made.0.images.push(Image { name: "mask".to_owned(), width: 8, height: 8, rgba: (0..64).flat_map(texel).collect() });
    let sampler = Sampler { mag_nearest: true, min_nearest: true, mips: false, ..Sampler::default() };
    made.add(Shape::panel(6.0, 6.0), mirror(1.0), at(0.0, 0.0, -2.0));
    let back = DAffine3::from_rotation_y(std::f64::consts::PI);
    for i in 0..4 {
        let texture = TextureRef { image: 0, uv_set: 0, uv_transform: glam::Affine2::IDENTITY, sampler };
        let mask = Material { alpha_mode: AlphaMode::Mask(0.5), base_color_texture: Some(texture), ..unlit([1.0; 3]) };
        let turn = DAffine3::from_rotation_z(0.3 * f64::from(i));
        made.add(Shape::panel(5.0, 5.0), mask, at(0.0, 0.0, 4.0 + 0.3 * f64::from(i)) * back * turn);
    }
    made.add(Shape::panel(40.0, 40.0), unlit([0.5; 3]), at(0.0, 0.0, 6.0) * back);
    made.camera(DVec3::new(0.3, 0.2, 1.0), DVec3::new(0.0, 0.0, -2.0), perspective(50.0));
    let film = gpu.film(&made.0, optics([96, 54], &[]));
    let near = |c: f32, want: f32| (c - want).abs() < 1e-4;
    let (mut masks, mut card) = (0, 0);
    for (i, pixel) in film.rgba.iter().enumerate() {
        assert!(near(pixel[0], 1.0) || near(pixel[0], 0.5), "pixel {i}: {pixel:?}");
        masks += usize::from(near(pixel[0], 1.0));
        card += usize::from(near(pixel[0], 0.5));
    }
    assert!(masks > 500 && card > 50, "{masks} {card}");
}

#[test]
fn a_light_behind_many_sheets_is_as_dark_beside_them_as_a_blocked_one() {
    let gpu = Gpu::open();
    // Strips finer than a group of lanes, opaque and not, over eleven sheets: one lane is through at once, the next one
    // goes on behind the fourth sheet and the eighth.
    let mut made = Made::new("comb");
    made.add(Shape::panel(20.0, 20.0), lambert([0.5; 3]), DAffine3::IDENTITY);
    let clear = Material { thickness: 0.0, specular: 0.0, base_color: [0.95, 0.95, 0.95, 1.0], ..glass(1.0) };
    for i in 0..11 {
        made.add(Shape::panel(20.0, 20.0), clear.clone(), at(0.0, 0.0, 12.0 + 0.1 * f64::from(i)));
    }
    for i in -40..40 {
        made.add(Shape::panel(0.1, 20.0), lambert([0.0; 3]), at(0.2 * f64::from(i), 0.0, 14.0));
    }
    made.light([1.0; 3], LightKind::Directional { direction: DVec3::NEG_Z });
    made.front(1.0);
    let size = [94, 52];
    let film = gpu.film(&made.0, optics(size, &["shadows=ray"]));
    let (mut dark, mut lit) = (0, 0);
    for (i, pixel) in film.rgba.iter().enumerate() {
        let (o, _) = ray(&made.0.cameras[0], size, i, DVec2::ZERO);
        let from_edge = (o.x / 0.1 + 0.5).rem_euclid(2.0);
        if (from_edge - from_edge.round()).abs() < 0.02 {
            continue;
        }
        let want = if from_edge < 1.0 { 0.0 } else { 0.5 / std::f64::consts::PI * 0.95_f64.powi(11) };
        assert!((f64::from(pixel[0]) - want).abs() < 1e-4, "pixel {i}: {pixel:?}, {want}");
        dark += usize::from(want == 0.0);
        lit += usize::from(want > 0.0);
    }
    assert!(dark > 1000 && lit > 1000, "{dark} {lit}");
}
