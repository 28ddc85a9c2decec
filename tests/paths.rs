//! Paths of light against truth: furnaces, rooms whose light is known in closed form, and the same film whatever the
//! order of the work.

use etalon::frame::Settings;
use etalon::image::Picture;
use etalon::plan::{Architecture, Knobs, Model};
use etalon::scene::environment::{self, Environment};
use etalon::scene::solid::solids;
use etalon::scene::{Extent, Light, LightKind, Material, Projection, Scene};
use etalon::study::shape::Shape;
use etalon::transport::bvh::Bvh;
use etalon::transport::emitters::{EmitterSource, Emitters, Sky};
use etalon::transport::photon_guiding::PhotonGuiding;
use etalon_testing::gpu::{Gpu, bits, settings_of, spread};
use etalon_testing::made::{Made, at, lambert, orthographic, perspective};
use glam::{DAffine3, DVec3};

fn settings(size: [u32; 2], choices: &[&str]) -> Settings {
    settings_of(Model::Global, size, choices)
}

/// Next event estimation is the same in every model.
const MODELS: [Model; 3] = [Model::Local, Model::Recursive, Model::Global];

fn draw(gpu: &Gpu, scene: &Scene, environment: Option<&Environment>, settings: Settings) -> Picture {
    gpu.shot(scene, environment, settings).1
}

/// A cube of one material that fills a parallel view, turned so that three of its faces are seen.
fn cube(material: Material) -> Scene {
    let mut made = Made::new("cube");
    let turn = DAffine3::from_rotation_x(0.5) * DAffine3::from_rotation_y(0.6);
    made.add(Shape::cuboid(DVec3::splat(2.0)), material, turn);
    made.front(0.8);
    made.0
}

fn white_metal(roughness: f32) -> Material {
    Material { metallic: 1.0, roughness, specular: 1.0, ..lambert([1.0; 3]) }
}

/// A diffuse floor a metre below an area light, and its expected radiance: E/π times the albedo 0.5.
fn under(light: Light, expected: f64) -> (Scene, f64) {
    let mut made = Made::new("floor");
    made.add(Shape::panel(0.02, 0.02), lambert([0.5; 3]), DAffine3::IDENTITY);
    made.0.lights.push(light);
    made.front(0.008);
    (made.0, 0.5 * expected / std::f64::consts::PI)
}

#[test]
fn lights_with_a_shape_light_as_their_form_factors_say() {
    let gpu = Gpu::open();
    let light = |extent: Option<Extent>, kind: LightKind| Light {
        name: "lamp".to_owned(),
        color: [2.0; 3],
        spectrum: None,
        extent,
        kind,
        proxy: false,
    };
    let position = DVec3::Z;
    let point = LightKind::Point { position, range: None };
    // A step at a right angle: all that a sheet of paper sends.
    let right = std::f64::consts::FRAC_PI_2;
    let face = |direction: DVec3| LightKind::Spot { position, direction, range: None, inner: right, outer: right };
    // π r²/(1 + r²) over the disk's area times its intensity.
    let disk = |r: f64| 2.0 / (1.0 + r * r);
    // Of a rectangle before the middle of a plane, four quarters a by b (Howell, A Catalog of Radiation Heat Transfer
    // Configuration Factors, B-3): E = L/2 (A atan(b/√(1 + a²)) + …), L = I/(4ab).
    let rectangle = |a: f64, b: f64| {
        let (ra, rb) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
        let quarter = 0.5 * (a / ra * (b / ra).atan() + b / rb * (a / rb).atan());
        4.0 * quarter * 2.0 / (4.0 * a * b)
    };
    for (what, extent, kind, expected) in [
        // Of a ball above the horizon any radius lights alike.
        ("small ball", Extent::Sphere { radius: 0.01 }, point, 2.0),
        ("ball", Extent::Sphere { radius: 0.7 }, point, 2.0),
        ("disk", Extent::Disk { radius: 0.6 }, face(DVec3::NEG_Z), disk(0.6)),
        ("disk seen from behind", Extent::Disk { radius: 0.6 }, face(DVec3::Z), 0.0),
        (
            "rectangle",
            Extent::Rectangle { across: DVec3::X * 0.8, half_height: 0.3 },
            face(DVec3::NEG_Z),
            rectangle(0.8, 0.3),
        ),
        ("ball around it", Extent::Sphere { radius: 1.5 }, point, 0.0),
    ] {
        let (scene, radiance) = under(light(Some(extent), kind), expected);
        for model in MODELS {
            let film = draw(&gpu, &scene, None, settings_of(model, [16, 16], &["samples=64", "lights=area:1"]));
            let [mean, deviation, _] = spread(&film, 1);
            eprintln!("{what}, {model:?}: {mean:.6} ± {deviation:.6}, expected {radiance:.6}");
            // Neighbouring pixels have points of their own; the floor reaches 0.01 m from its middle.
            assert!((mean - radiance).abs() <= 4.0 * deviation + 2e-4 * radiance, "{what}: {mean}, not {radiance}");
            // 16,384 samples, each off by no more than the mean: 1/128 of it.
            assert!(deviation <= 0.008 * radiance, "{what}: {mean} ± {deviation}");
        }
        // The rung `points` knows no shapes.
        let film = draw(&gpu, &scene, None, settings([4, 4], &["samples=1", "lights=points"]));
        let mut bare = scene.clone();
        bare.lights[0].extent = None;
        let point = draw(&gpu, &bare, None, settings([4, 4], &["samples=1", "lights=points"]));
        assert!(bits(&film) == bits(&point), "{what}");
    }
}

/// The number of light samples per vertex changes the noise and not the mean. Both forms agree to the last bit.
#[test]
fn more_light_samples_reduce_noise_and_keep_the_mean() {
    let gpu = Gpu::open();
    let mut scene = etalon::study::load("cornell").expect("a scene");
    scene.lights.clear();
    // Half of a small lamp is hidden: a light sample sees it or not, and few paths find it.
    let mut half = Made::new("half a lamp");
    half.add(Shape::panel(0.02, 0.02), lambert([0.5; 3]), DAffine3::IDENTITY);
    let down = at(0.0, 0.0, 1.0) * DAffine3::from_rotation_x(std::f64::consts::PI);
    let lamp = Material { emissive: [1.0; 3], double_sided: false, ..lambert([0.0; 3]) };
    half.add(Shape::panel(0.4, 0.4), lamp, down);
    half.add(Shape::panel(0.4, 0.4), lambert([0.0; 3]), at(0.2, 0.0, 0.5));
    half.camera(DVec3::new(-0.3, 0.0, 0.3), DVec3::ZERO, perspective(2.0));
    let mut noise = Vec::new();
    let mut means = Vec::new();
    for places in ["area:1", "area:4", "area:16"] {
        let rung = format!("lights={places}");
        // One bounce: only the noise of direct light depends on the number of light samples.
        means.push(spread(&draw(&gpu, &scene, None, settings([32, 18], &["samples=16", "interfaces=1", &rung])), 1)[0]);
        // Pictures of two seeds differ by noise alone.
        let [a, b] = [0, 1].map(|seed| {
            let settings = Settings { seed, ..settings([16, 16], &["samples=4", "interfaces=1", &rung]) };
            draw(&gpu, &half.0, None, settings)
        });
        noise.push(a.rgba.iter().zip(&b.rgba).map(|(a, b)| f64::from(a[1] - b[1]).powi(2)).sum::<f64>());
        let [of_cpu, of_gpu] = [Architecture::Cpu, Architecture::Gpu].map(|architecture| {
            let settings = settings([32, 18], &["samples=4", "interfaces=4", &rung]);
            bits(&draw(&gpu, &scene, None, Settings { architecture: Some(architecture), ..settings }))
        });
        assert!(of_cpu == of_gpu, "{places}");
    }
    eprintln!("{means:?} {noise:?}");
    assert!(means.iter().all(|mean| (mean / means[2] - 1.0).abs() < 0.02), "{means:?}");
    assert!(noise.windows(2).all(|noise| noise[0] > 2.0 * noise[1]), "{noise:?}");
}

/// Half of a shape hidden by a wall gives half of its light.
#[test]
fn shapes_cast_soft_shadows() {
    let gpu = Gpu::open();
    let position = DVec3::Z;
    let right = std::f64::consts::FRAC_PI_2;
    let kind = LightKind::Spot { position, direction: DVec3::NEG_Z, range: None, inner: right, outer: right };
    let extent = Some(Extent::Rectangle { across: DVec3::X * 0.5, half_height: 0.5 });
    let light = Light { name: "lamp".to_owned(), color: [2.0; 3], spectrum: None, extent, kind, proxy: false };
    let (mut scene, _) = under(light, 0.0);
    let lit =
        |scene: &Scene, model| draw(&gpu, scene, None, settings_of(model, [8, 8], &["samples=256", "lights=area:1"]));
    let open = MODELS.map(|model| lit(&scene, model));
    let mut made = Made(scene.clone());
    // Black, half way up, over all of one side.
    made.add(Shape::panel(4.0, 4.0), lambert([0.0; 3]), at(2.0, 0.0, 0.5));
    scene = made.0;
    // The eye is below the wall.
    scene.cameras[0].world_from_camera.translation.z = 0.4;
    scene.cameras[0].projection = Projection::Orthographic { half_height: 0.008, near: 0.1, far: 2.0 };
    for (model, open) in MODELS.into_iter().zip(open) {
        let ([open, ..], [half, deviation, _]) = (spread(&open, 1), spread(&lit(&scene, model), 1));
        assert!((half - 0.5 * open).abs() < 4.0 * deviation + 1e-3 * open, "{model:?}: {half} of {open}");
    }
    // Shadow maps are drawn from points; this light has rays all the same. Without shadows it is seen through the wall.
    let share = |shadows: &str| {
        let choices = ["samples=64", "lights=area:4", shadows];
        spread(&draw(&gpu, &scene, None, settings_of(Model::Recursive, [8, 8], &choices)), 1)[0]
    };
    let (by_maps, by_rays) = (share("shadows=map"), share("shadows=ray"));
    assert!(by_maps == by_rays && share("shadows=off") > 1.9 * by_rays, "{by_maps}, {by_rays}");
}

#[test]
fn white_objects_vanish_in_a_furnace_of_paths() {
    let gpu = Gpu::open();
    let sky = Environment::constant([1.0; 3]);
    let glass =
        Material { transmission: 1.0, ior: 1.5, thickness: 1.0, specular: 1.0, roughness: 0.0, ..lambert([1.0; 3]) };
    // Where each path's light is 1, nothing is left to chance; what rough metals keep has the table's error.
    for (name, material, exact) in [
        ("lambert", lambert([1.0; 3]), 1e-5),
        ("mirror", white_metal(0.0), 1e-5),
        ("glass", glass, 1e-5),
        ("metal 0.3", white_metal(0.3), 2e-3),
        ("metal 0.6", white_metal(0.6), 2e-3),
        ("metal 1", white_metal(1.0), 2e-3),
        ("rough coat on a mirror", Material { clearcoat: 1.0, clearcoat_roughness: 0.5, ..white_metal(0.0) }, 4e-3),
    ] {
        let picture = draw(&gpu, &cube(material), Some(&sky), settings([24, 24], &["samples=64"]));
        let [mean, error, _] = spread(&picture, 0);
        assert!((mean - 1.0).abs() <= exact + 4.0 * error, "{name}: {mean} ± {error}");
    }
}

/// The inside of a cube whose walls emit `glow` and reflect `albedo`.
fn room(albedo: f32, glow: f32) -> Scene {
    let mut made = Made::new("room");
    made.add(
        Shape::cuboid(DVec3::splat(2.0)),
        Material { emissive: [glow; 3], ..lambert([albedo; 3]) },
        DAffine3::IDENTITY,
    );
    made.camera(DVec3::new(0.1, -0.2, 0.3), DVec3::new(-0.4, 0.3, -0.9), perspective(90.0));
    made.0
}

#[test]
fn a_room_is_as_bright_as_its_walls_emit_and_keep() {
    let gpu = Gpu::open();
    // L = E/(1 − ρ) everywhere.
    for (albedo, glow) in [(0.5, 0.5), (0.8, 0.2), (0.0, 1.0)] {
        let picture = draw(&gpu, &room(albedo, glow), None, settings([16, 16], &["samples=256"]));
        let [mean, error, _] = spread(&picture, 1);
        assert!((mean - 1.0).abs() <= 1e-5 + 4.0 * error && error < 5e-3, "{albedo}: {mean} ± {error}");
    }
}

/// A unit square of radiance 1 above a Lambert square of albedo 1, seen from between them.
fn parallel_squares(distance: f64) -> Scene {
    let mut made = Made::new("squares");
    let lamp = Material { emissive: [1.0; 3], ..lambert([0.0; 3]) };
    let down = DAffine3::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let up = DAffine3::from_rotation_x(-std::f64::consts::FRAC_PI_2);
    made.add(Shape::panel(1.0, 1.0), lamp, at(0.0, distance, 0.0) * down);
    made.add(Shape::panel(1.0, 1.0), lambert([1.0; 3]), up);
    let near = 0.5 * distance;
    made.camera(
        DVec3::Y * (0.75 * distance),
        DVec3::ZERO,
        Projection::Orthographic { half_height: 0.5, near: 0.5 * near, far: 10.0 },
    );
    made.0
}

#[test]
fn squares_exchange_light_by_their_form_factor() {
    let gpu = Gpu::open();
    // Of parallel unit squares at a distance of 1, 0.5 and 2 (Howell, catalogue of configuration factors, C-11).
    let form_factor = |c: f64| {
        let x = 1.0 / c;
        let root = (1.0 + x * x).sqrt();
        let a = ((1.0 + x * x).powi(2) / (1.0 + 2.0 * x * x)).sqrt().ln();
        let b = x * root * (x / root).atan() * 2.0;
        2.0 / (std::f64::consts::PI * x * x) * (a + b - 2.0 * x * x.atan())
    };
    assert!((form_factor(1.0) - 0.199_824_89).abs() < 1e-7);
    for distance in [1.0, 0.5, 2.0] {
        let scene = parallel_squares(distance);
        for model in MODELS {
            // The lamp is black: what it would send back is found for both squares together.
            let indirect = if model == Model::Global { "indirect=path" } else { "indirect=off" };
            let settings = || settings_of(model, [24, 24], &["samples=64", "lights=area:1", indirect]);
            let [mean, _, _] = spread(&draw(&gpu, &scene, None, settings()), 2);
            // Pixels differ in truth as well: the error is that of another seed.
            let other = draw(&gpu, &scene, None, Settings { seed: 1, ..settings() });
            let noise: f64 = (mean - spread(&other, 2)[0]).abs().max(2e-4);
            let expected = form_factor(distance);
            assert!((mean - expected).abs() < 4.0 * noise, "{distance}, {model:?}: {mean} for {expected}");
        }
    }
}

#[test]
fn a_bright_spot_of_the_environment_is_sampled() {
    let gpu = Gpu::open();
    let mut sky = Environment::constant([0.2; 3]);
    (sky.width, sky.height) = (64, 32);
    sky.radiance = vec![[0.2; 3]; 64 * 32];
    for (x, y) in [(40, 6), (41, 6), (40, 7), (10, 12)] {
        sky.radiance[y * 64 + x] = [300.0, 200.0, 100.0];
    }
    let mut made = Made::new("floor");
    made.add(Shape::panel(4.0, 4.0), lambert([0.8; 3]), DAffine3::from_rotation_x(-std::f64::consts::FRAC_PI_2));
    made.camera(DVec3::Y * 5.0, DVec3::ZERO, orthographic(1.0));
    // E = ∫ L cosθ dω over the upper half, by the midpoint rule in f64.
    let (n, m) = (2000, 500);
    let mut irradiance = [0.0; 3];
    for i in 0..m {
        for j in 0..n {
            let theta = (f64::from(i) + 0.5) / f64::from(m) * std::f64::consts::FRAC_PI_2;
            let phi = (f64::from(j) + 0.5) / f64::from(n) * std::f64::consts::TAU;
            let d = DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
            let weight = theta.sin() * theta.cos() * std::f64::consts::FRAC_PI_2 / f64::from(m) * std::f64::consts::TAU
                / f64::from(n);
            let radiance = sky.sample(d);
            irradiance.iter_mut().zip(radiance).for_each(|(sum, l)| *sum += l * weight);
        }
    }
    let picture = draw(&gpu, &made.0, Some(&sky), settings([16, 16], &["samples=64"]));
    for (channel, irradiance) in irradiance.into_iter().enumerate() {
        let wanted = irradiance * 0.8 / std::f64::consts::PI;
        let [mean, error, _] = spread(&picture, channel);
        assert!((mean - wanted).abs() < 4.0 * error + 2e-3 * wanted, "{channel}: {mean} ± {error} for {wanted}");
        assert!(error < 0.01 * wanted, "{channel}: {mean} ± {error}");
    }
}

#[test]
fn light_from_points_and_from_afar_is_what_the_local_model_says() {
    let gpu = Gpu::open();
    let mut made = Made::new("lit floor");
    let floor = Material { roughness: 0.5, specular: 1.0, ..lambert([0.6, 0.4, 0.2]) };
    made.add(Shape::panel(4.0, 4.0), floor, DAffine3::from_rotation_x(-std::f64::consts::FRAC_PI_2));
    made.light([20.0, 10.0, 5.0], LightKind::Point { position: DVec3::new(0.5, 2.0, 0.3), range: Some(9.0) });
    made.light([1.0, 2.0, 3.0], LightKind::Directional { direction: DVec3::new(0.3, -1.0, 0.2).normalize() });
    made.camera(DVec3::new(0.0, 3.0, 3.0), DVec3::ZERO, perspective(20.0));
    let choices = &["samples=64", "brdf=ggx", "fresnel=exact"][..];
    let paths = draw(&gpu, &made.0, None, settings([16, 16], choices));
    let mut knobs = Knobs::of(Model::Recursive);
    choices.iter().for_each(|choice| knobs.set(choice).expect("a rung"));
    let local = draw(&gpu, &made.0, None, Settings { size: [16, 16], knobs, ..Settings::default() });
    for channel in 0..3 {
        let [mean, error, _] = spread(&paths, channel);
        let [wanted, _, _] = spread(&local, channel);
        assert!((mean - wanted).abs() < 5e-3 * wanted, "{channel}: {mean} ± {error} for {wanted}");
    }
}

#[test]
fn shadow_rays_leave_every_body_that_they_enter() {
    let gpu = Gpu::open();
    // Bodies of index 1 between a floor and a lamp: they reflect nothing, and absorb light on its way in them.
    let lamp = DVec3::new(0.4, 0.2, 4.0);
    let colors = [[0.3_f32, 0.6, 0.9], [0.8, 0.5, 0.4]];
    for gap in [0.0, 0.5] {
        let mut made = Made::new("two bodies");
        made.add(Shape::panel(0.02, 0.02), lambert([0.5; 3]), DAffine3::IDENTITY);
        for (color, z) in colors.into_iter().zip([1.25, 1.75 + gap]) {
            let clear = Material { transmission: 1.0, thickness: 1.0, ior: 1.0, roughness: 0.0, ..lambert([1.0; 3]) };
            let body = Material { attenuation_color: color, attenuation_distance: 1.0, ..clear };
            made.add(Shape::cuboid(DVec3::new(2.0, 2.0, 0.5)), body, at(0.0, 0.0, z));
        }
        made.light([2.0; 3], LightKind::Point { position: lamp, range: None });
        made.camera(DVec3::new(0.0, 0.0, 0.5), DVec3::ZERO, perspective(0.02));
        let film = draw(&gpu, &made.0, None, settings([8, 8], &["samples=4"]));
        let cos = lamp.z / lamp.length();
        for channel in 0..3 {
            let kept: f64 = colors.iter().map(|color| f64::from(color[channel]).powf(0.5 / cos)).product();
            let wanted = 0.5 / std::f64::consts::PI * 2.0 * cos / lamp.length_squared() * kept;
            let [mean, ..] = spread(&film, channel);
            // Rays go on up to two offsets behind a surface (bvh.rs), of each of four.
            assert!((mean / wanted - 1.0).abs() < 5e-5, "gap {gap}, channel {channel}: {mean}, not {wanted}");
        }
    }
}

/// A matt floor that a lamp beside it lights only by way of a mirror above both: the lamp sends upwards. Its mirror
/// image is a rectangle at 1.5 m.
fn by_a_mirror() -> (Made, f64) {
    let mut made = Made::new("by a mirror");
    made.add(Shape::panel(0.02, 0.02), lambert([0.5; 3]), DAffine3::IDENTITY);
    let lamp = Material { emissive: [10.0; 3], double_sided: false, ..lambert([0.0; 3]) };
    made.add(Shape::panel(0.4, 0.4), lamp, at(1.2, 0.0, 0.5));
    let down = DAffine3::from_translation(DVec3::Z) * DAffine3::from_rotation_x(std::f64::consts::PI);
    made.add(Shape::panel(6.0, 6.0), Material { double_sided: false, ..white_metal(0.0) }, down);
    made.front(0.008);
    // The form factor of a parallel rectangle with a corner on the normal (Howell, B-3), and the difference of two of
    // them.
    let corner = |x: f64, y: f64| {
        let (a, b) = (x / 1.5, y / 1.5);
        let (ra, rb) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
        0.5 * (a / ra * (b / ra).atan() + b / rb * (a / rb).atan())
    };
    let irradiance = 10.0 * 2.0 * (corner(1.4, 0.2) - corner(1.0, 0.2));
    (made, 0.5 * irradiance / std::f64::consts::PI)
}

#[test]
fn path_guiding_reduces_noise_and_keeps_the_mean() {
    let gpu = Gpu::open();
    let (made, radiance) = by_a_mirror();
    let [off, aims] = ["guiding=off", "guiding=photons"].map(|guiding| {
        let film = draw(&gpu, &made.0, None, settings([16, 16], &["samples=1024", "interfaces=4", guiding]));
        let [mean, deviation, _] = spread(&film, 1);
        eprintln!("{guiding}: {mean:.6} ± {deviation:.6}, expected {radiance:.6}");
        assert!((mean - radiance).abs() <= 4.0 * deviation + 2e-4 * radiance, "{guiding}: {mean}, not {radiance}");
        deviation
    });
    // 0.66 of it here, where points spread evenly find the lamp by themselves already; 0.39 at 64 samples.
    assert!(aims < 0.8 * off, "{aims}, {off} without aims");
}

#[test]
fn guiding_spheres_lie_where_light_is_mirrored() {
    let (made, _) = by_a_mirror();
    let scene = &made.0;
    let bvh = Bvh::build(scene).expect("a hierarchy");
    let aims = PhotonGuiding::of(scene, &solids(scene), &bvh, &Emitters::of(scene, None, true));
    let floor = ((-bvh.anchor - aims.corner) / aims.cell).floor().as_uvec3();
    let word = aims.firsts[(floor.x + aims.cells[0] * (floor.y + aims.cells[1] * floor.z)) as usize];
    let balls = &aims.spheres[(word >> 4) as usize..][..(word & 15) as usize];
    assert!(!balls.is_empty());
    assert!(balls.iter().map(|ball| ball.share).sum::<f64>() == 1.0 && balls.iter().all(|ball| ball.share > 0.0));
    assert!(balls.iter().all(|ball| half::f16::from_f64(ball.share).to_f64() == ball.share), "{balls:?}");
    // The lamp's middle is seen at two thirds of the way to its image.
    let seen = DVec3::new(0.8, 0.0, 1.0) - bvh.anchor;
    assert!(balls.iter().any(|ball| ball.middle.distance(seen) < ball.radius), "{balls:?}, not {seen}");
    for ball in balls {
        assert!((ball.middle.z - seen.z).abs() < 1e-6, "{ball:?}");
        // A cell and its neighbours see no more of the mirror in which the lamp is than this.
        assert!((ball.middle - seen).abs().max_element() < 0.2 + 3.0 * aims.cell, "{ball:?}, not near {seen}");
    }
    // Without a mirror light comes from nowhere but the lamp: where it is rough, and where it is smooth without a
    // reflectance.
    let not_mirrors: [fn(&mut Material); 2] = [|m| m.roughness = 1.0, |m| (m.metallic, m.specular) = (0.0, 0.0)];
    for change in not_mirrors {
        let mut matt = made.0.clone();
        matt.materials.iter_mut().for_each(change);
        assert!(PhotonGuiding::of(&matt, &solids(&matt), &bvh, &Emitters::of(&matt, None, true)).spheres.is_empty());
    }
}

#[test]
fn both_forms_make_the_same_film_again_and_again() {
    let gpu = Gpu::open();
    for name in ["etalon", "cornell", "blend", "nested", "haze", "lamps", "materials", "metals", "pool", "radiance"] {
        let scene = etalon::study::load(name).unwrap();
        let sky = Environment::studio();
        let sky = scene.studio.map(|_| &sky);
        let of = |architecture, seed: u32| {
            let settings = settings([44, 29], &["samples=4"]);
            bits(&draw(&gpu, &scene, sky, Settings { seed, architecture: Some(architecture), ..settings }))
        };
        let film = of(Architecture::Cpu, 0);
        let other = of(Architecture::Gpu, 0);
        let different = film.iter().zip(&other).filter(|(a, b)| a != b).count();
        assert!(film == other, "{name}: the form for GPUs makes another film, in {different} pixels");
        assert!(film == of(Architecture::Cpu, 0), "{name}: another film the second time");
        assert!(name == "radiance" || film != of(Architecture::Cpu, 1), "{name}: the seed changes nothing");
    }
}

#[test]
fn what_lies_behind_tinted_glass_is_weakened_in_alpha() {
    let gpu = Gpu::open();
    let mut made = Made::new("pane");
    let pane = Material { transmission: 1.0, roughness: 0.0, specular: 0.0, ..lambert([0.1, 0.2, 0.3]) };
    made.add(Shape::panel(4.0, 4.0), pane, DAffine3::IDENTITY);
    made.front(0.5);
    let picture = draw(&gpu, &made.0, None, settings([8, 8], &["samples=64"]));
    // A sheet that reflects nothing leaves its colour of what lies behind: 0.2 in the mean.
    let [alpha, _, _] = spread(&picture, 3);
    assert!((alpha - 0.8).abs() < 1e-5, "{alpha}");
}

#[test]
fn emissive_surfaces_are_lights_only_where_a_knob_says_so() {
    let gpu = Gpu::open();
    let scene = parallel_squares(1.0);
    for model in MODELS {
        let picture = draw(&gpu, &scene, None, settings_of(model, [8, 8], &["samples=4", "lights=points"]));
        assert_eq!(spread(&picture, 0)[2], 0.0);
    }
    // It is seen all the same.
    let mut turned = scene;
    turned.cameras[0] = etalon::scene::Camera {
        projection: perspective(20.0),
        ..etalon_testing::made::looking(DVec3::new(0.0, 0.3, 0.0), DVec3::Y)
    };
    let picture = draw(&gpu, &turned, None, settings([8, 8], &["samples=4", "lights=points"]));
    assert!((spread(&picture, 0)[0] - 1.0).abs() < 1e-6);
}

#[test]
fn lights_are_sampled_by_power_and_the_environment_by_radiance() {
    let scene = etalon::study::load("cornell").unwrap();
    let emitters = Emitters::of(&scene, None, true);
    // The point light, which the plan takes out, and the two triangles of the panel, 1.3 m by 1.05 m of radiance 12.
    let [point, one, other] = emitters.list[..] else { panic!("{emitters:?}") };
    assert_eq!(point.source, EmitterSource::Punctual(0));
    assert!((one.probability - other.probability).abs() < 1e-9);
    let (panel, lamp) = (1.3 * 1.05 * 12.0 * std::f64::consts::PI, 16.4 * 4.0 * std::f64::consts::PI);
    assert!((point.probability - lamp / (lamp + panel)).abs() < 1e-6, "{point:?}");
    assert_eq!(Emitters::of(&scene, None, false).list.len(), 1);
    let mut map = Environment::dark();
    map.radiance[(64 * map.width + 100) as usize] = [100.0; 3];
    let around = |map, rotation| Some(Sky { map, intensity: 1.0, rotation });
    let sky = Emitters::of(&Scene::default(), around(&map, 0.0), true).environment;
    // The three rows around that texel share all but what every other has at least.
    let share = |row: usize| sky.words[row + 1].wrapping_sub(sky.words[row]);
    assert!(share(63) > 1 << 30 && share(64) > 1 << 30 && share(65) > 1 << 30);
    assert!((0..63).chain(66..255).all(|row| share(row) == 1));
    // Sampled directions lie around the bright spot. They turn with the environment: by the angle into it, and back out
    // of it.
    let cell = std::f64::consts::PI / 256.0;
    for rotation in [0.0_f32, 50.0] {
        let sky = Emitters::of(&Scene::default(), around(&map, rotation), true).environment;
        let (sin, cos) = f64::from(rotation).to_radians().sin_cos();
        for word in [1_u32 << 29, 1 << 31, 3 << 30] {
            let d = sky.direction([word; 2]);
            let into = DVec3::new(cos * d.x - sin * d.z, d.y, sin * d.x + cos * d.z);
            let bright = environment::direction(100.5 / f64::from(map.width), 64.5 / f64::from(map.height));
            assert!(into.distance(bright) < 4.0 * cell, "{rotation}: {into}, not {bright}");
        }
    }
    let none = Emitters::of(&Scene::default(), around(&Environment::constant([1.0; 3]), 0.0), true);
    assert_eq!(none, Emitters::default());
}
