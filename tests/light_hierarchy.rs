//! The light hierarchy of path tracing: its probabilities sum to 1, no light is lost, the mean of the picture is that
//! of light sampling by power, and the error is smaller where many lights are far apart.

use std::f64::consts::{FRAC_PI_2, PI};

use etalon::frame::Settings;
use etalon::image::Picture;
use etalon::optics::SplitMix64;
use etalon::optics::Tier;
use etalon::plan::{Architecture, Knobs, Model};
use etalon::scene::environment::Environment;
use etalon::scene::{Extent, Light, LightKind, Material, Scene};
use etalon::share::{LIGHT_INDEX, LIGHT_LEAF, LIGHT_TWO_SIDED, LightNode};
use etalon::study::shape::Shape;
use etalon::transport::emitters::{EmitterSource, Emitters};
use etalon::transport::light_hierarchy::LightHierarchy;
use etalon_testing::gpu::{Gpu, bits, spread};
use etalon_testing::made::{Made, at, lambert, orthographic};
use etalon_testing::probe::evaluate;
use glam::{DAffine3, DVec3};

fn draw(gpu: &Gpu, scene: &Scene, environment: Option<&Environment>, seed: u32, choices: &[&str]) -> Picture {
    let mut knobs = Knobs::of(Model::Global);
    let choices: Vec<String> = choices.iter().map(|&choice| choice.to_owned()).collect();
    knobs.set_all(&choices).expect("rungs");
    gpu.shot(scene, environment, Settings { size: [32, 32], knobs, seed, ..Settings::default() }).1
}

/// A grey floor of 40 m by 40 m, seen from above.
fn floor() -> Made {
    let mut made = Made::new("floor");
    made.add(Shape::panel(40.0, 40.0), lambert([0.7; 3]), DAffine3::from_rotation_x(-FRAC_PI_2));
    made.camera(DVec3::Y * 20.0, DVec3::ZERO, orthographic(18.0));
    made
}

/// Somewhere over the floor.
fn over(random: &mut SplitMix64) -> DVec3 {
    let [x, z] = [(); 2].map(|()| random.between(-18.0, 18.0));
    DVec3::new(x, random.between(0.4, 1.6), z)
}

/// Point lights of several intensities over the floor.
fn points(count: usize) -> Made {
    let mut made = floor();
    let mut random = SplitMix64::new(7);
    for _ in 0..count {
        let position = over(&mut random);
        made.light([random.between(0.5, 2.0) as f32; 3], LightKind::Point { position, range: None });
    }
    made
}

/// Small panels that emit downwards, upwards or on both sides, half of them in mirrored instances.
fn panels(count: usize) -> Made {
    let mut made = floor();
    let mut random = SplitMix64::new(11);
    let lamp = |double_sided| Material { emissive: [20.0; 3], double_sided, ..lambert([0.0; 3]) };
    let meshes = [false, true].map(|double_sided| made.mesh(Shape::panel(0.2, 0.2), lamp(double_sided)));
    for i in 0..count {
        let turn = DAffine3::from_rotation_x(FRAC_PI_2 * if i % 5 == 0 { -1.0 } else { 1.0 });
        let mirror = DAffine3::from_scale(DVec3::new(if i % 2 == 0 { 1.0 } else { -1.0 }, 1.0, 1.0));
        let tilt = DAffine3::from_rotation_z(random.between(-0.5, 0.5));
        made.place(
            meshes[usize::from(i % 3 == 0)],
            DAffine3::from_translation(over(&mut random)) * tilt * turn * mirror,
        );
    }
    made
}

/// All kinds of lights: coincident ones, weak ones beside strong ones, spots that miss the floor, areas, and a triangle
/// that has no area once its corners are rounded.
fn kinds() -> Made {
    let mut made = panels(6);
    let glow = Material { emissive: [20.0; 3], ..lambert([0.0; 3]) };
    made.add(Shape::panel(1.0, 1.0), glow, at(9.0, 1.0, 9.0) * DAffine3::from_scale(DVec3::splat(1e-9)));
    let mut random = SplitMix64::new(13);
    let up_or_down = |i: usize| if i.is_multiple_of(2) { DVec3::NEG_Y } else { DVec3::Y };
    for i in 0..6 {
        let position = over(&mut random);
        made.light([1.0; 3], LightKind::Point { position: DVec3::new(3.0, 1.0, 4.0), range: None });
        made.light([1e-30; 3], LightKind::Point { position, range: None });
        let (inner, outer) = (0.1 * i as f64, 0.1 * i as f64 + [0.0, 0.3][i % 2]);
        let direction = (up_or_down(i) + DVec3::X * 0.3).normalize();
        made.light([3.0; 3], LightKind::Spot { position: over(&mut random), direction, range: None, inner, outer });
    }
    let shapes = [
        Extent::Sphere { radius: 0.3 },
        Extent::Disk { radius: 0.4 },
        Extent::Rectangle { across: DVec3::X * 0.4, half_height: 0.2 },
    ];
    for (i, extent) in (0..6).zip(shapes.iter().cycle()) {
        let (position, direction) = (over(&mut random), up_or_down(i));
        let kind = match extent {
            Extent::Sphere { .. } => LightKind::Point { position, range: None },
            _ => LightKind::Spot { position, direction, range: None, inner: FRAC_PI_2, outer: FRAC_PI_2 },
        };
        made.light([2.0; 3], kind);
        made.0.lights.last_mut().expect("a light").extent = Some(*extent);
    }
    made
}

/// Corners of a triangle of a scene in the order of its front; none of one without area.
fn corners(scene: &Scene, index: u32) -> Option<[DVec3; 3]> {
    let firsts = scene.first_triangles();
    let instance = firsts.partition_point(|&first| first <= index) - 1;
    let placed = &scene.instances[instance];
    let mesh = &scene.meshes[placed.mesh];
    let [a, b, c] = [0, 1, 2].map(|k| {
        let corner = mesh.indices[3 * (index - firsts[instance]) as usize + k] as usize;
        placed.world_from_object.transform_point3(glam::Vec3::from(mesh.positions[corner]).as_dvec3())
    });
    let front = if placed.world_from_object.matrix3.determinant() < 0.0 { [a, c, b] } else { [a, b, c] };
    (front[1] - front[0]).cross(front[2] - front[0]).try_normalize().map(|_| front)
}

fn hierarchy(scene: &Scene) -> (Emitters, LightHierarchy) {
    let emitters = Emitters::of(scene, None, true);
    let hierarchy = LightHierarchy::of(&emitters, &scene.lights, DVec3::ZERO, |index| corners(scene, index));
    (emitters, hierarchy)
}

/// Whether a light shines on a point.
fn lights_up(scene: &Scene, source: EmitterSource, point: DVec3) -> bool {
    let towards = |position: DVec3, axis: DVec3| axis.dot((point - position).normalize());
    match source {
        EmitterSource::Environment => false,
        EmitterSource::Triangle { index, two_sided, .. } => corners(scene, index).is_some_and(|[a, b, c]| {
            let n = (b - a).cross(c - a).normalize();
            two_sided || [a, b, c].iter().any(|&p| towards(p, n) > 0.0)
        }),
        EmitterSource::Punctual(light) => {
            match (scene.lights[light as usize].kind, scene.lights[light as usize].extent) {
                (LightKind::Directional { .. }, _) => false,
                (LightKind::Point { .. }, _) => true,
                (LightKind::Spot { position, direction, outer, .. }, None) => {
                    towards(position, direction) > outer.cos()
                }
                // Of a face every point is in one plane.
                (LightKind::Spot { position, direction, .. }, Some(_)) => towards(position, direction) > 0.0,
            }
        }
    }
}

fn places() -> Vec<DVec3> {
    let mut random = SplitMix64::new(3);
    let mut places: Vec<DVec3> =
        (0..60).map(|_| over(&mut random) * DVec3::new(1.2, random.between(-1.0, 2.0), 1.2)).collect();
    // On a light, and far away.
    places.extend([DVec3::new(3.0, 1.0, 4.0), DVec3::splat(1e4), DVec3::NEG_Y * 1e3]);
    places
}

/// Probability with which the descent ends at a node whose children both have no importance, though the node has some:
/// its bounds are wider than theirs. It then chooses no light.
fn dead_ends(hierarchy: &LightHierarchy, link: u32, importance: &dyn Fn(&LightNode) -> f64) -> f64 {
    if link & LIGHT_LEAF != 0 {
        return 0.0;
    }
    let children = [0, 1].map(|i| &hierarchy.nodes[(link & LIGHT_INDEX) as usize + i]);
    let both = children.map(importance);
    let sum = both[0] + both[1];
    let below = |i: usize| match both[i] > 0.0 {
        true => both[i] / sum * dead_ends(hierarchy, children[i].link, importance),
        false => 0.0,
    };
    if sum > 0.0 { below(0) + below(1) } else { 1.0 }
}

#[test]
fn probabilities_sum_to_one_and_no_light_is_lost() {
    let mut scenes: Vec<(String, Made)> = [1, 2, 3, 16, 300].map(|n| (format!("{n} points"), points(n))).into();
    scenes.extend([2, 50].map(|n| (format!("{n} panels"), panels(n))));
    scenes.push(("all kinds".to_owned(), kinds()));
    // In one place, of one intensity: nothing divides them but their number.
    let mut coincident = floor();
    for _ in 0..300 {
        coincident.light([1.0; 3], LightKind::Point { position: DVec3::Y, range: None });
    }
    scenes.push(("coincident".to_owned(), coincident));
    // Beside what has no area.
    let mut degenerate = panels(3);
    let line = Material { emissive: [1.0; 3], ..lambert([0.0; 3]) };
    degenerate.add(Shape::panel(1.0, 1.0), line, DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0)));
    scenes.push(("degenerate".to_owned(), degenerate));
    for (name, made) in scenes {
        let (emitters, hierarchy) = hierarchy(&made.0);
        assert!(!hierarchy.nodes.is_empty(), "{name}");
        for point in places() {
            let of = |i: usize| hierarchy.probability(i, |node| LightHierarchy::importance(node, point));
            let all: Vec<f64> = (0..emitters.list.len()).map(of).collect();
            let sum = all.iter().sum::<f64>()
                + dead_ends(&hierarchy, hierarchy.nodes[0].link, &|node| LightHierarchy::importance(node, point));
            assert!((sum - 1.0).abs() < 1e-12, "{name} at {point}: {sum}");
            let lit = emitters.list.iter().map(|e| lights_up(&made.0, e.source, point));
            for (i, (&probability, lit)) in all.iter().zip(lit).enumerate() {
                assert!(probability > 0.0 || !lit, "{name}: light {i} is lost at {point}");
                assert!((0.0..=1.0 + 1e-12).contains(&probability), "{name}: {probability}");
            }
        }
    }
}

#[test]
fn near_lights_are_chosen_more_often() {
    let (_, hierarchy) = hierarchy(&points(300).0);
    let scene = points(300).0;
    let mut worst = 1.0_f64;
    for place in places().into_iter().filter(|p| p.y.abs() < 3.0 && p.x.abs() < 18.0 && p.z.abs() < 18.0) {
        let share = |light: &Light| match light.kind {
            LightKind::Point { position, .. } => f64::from(light.color[0]) / position.distance_squared(place),
            _ => 0.0,
        };
        let irradiance: Vec<f64> = scene.lights.iter().map(share).collect();
        let all: f64 = irradiance.iter().sum();
        // E p(i)/f(i) in the mean over lights: 1 were the choice perfect, and the number of lights at worst.
        let of = |i: usize| hierarchy.probability(i, |node| LightHierarchy::importance(node, place));
        let second: f64 = irradiance.iter().enumerate().map(|(i, e)| (e / all).powi(2) / of(i)).sum();
        worst = worst.max(second);
    }
    eprintln!("second moment over squared mean: at most {worst:.2}");
    assert!(worst < 20.0, "{worst}");
}

/// The device's importance of every node, and the probabilities that follow from it.
#[test]
fn importance_on_the_device_gives_the_same_probabilities() {
    let gpu = Gpu::open();
    for made in [points(40), panels(30), kinds()] {
        let (emitters, hierarchy) = hierarchy(&made.0);
        for point in places().into_iter().step_by(7).map(|p| p.as_vec3()) {
            let row = |node: &LightNode| {
                let from = (point - glam::Vec3::from(node.centre)).to_array();
                let (axis, [cos_o, cos_e]) = LightHierarchy::cone(node);
                let two_sided = if node.link & LIGHT_TWO_SIDED == 0 { 0.0 } else { 1.0 };
                let cone = [cos_o as f32, cos_e as f32, two_sided, node.intensity];
                [&from[..], &[node.radius], &axis.as_vec3().to_array(), &cone].concat()
            };
            let rows: Vec<Vec<f32>> = hierarchy.nodes.iter().map(row).collect();
            let of_device = evaluate(&gpu, "light_importance", Tier::Stable, &rows);
            let place =
                |node: &LightNode| hierarchy.nodes.iter().position(|other| std::ptr::eq(node, other)).expect("a node");
            let on_device = |node: &LightNode| f64::from(of_device[place(node)][0]);
            let mut sum = dead_ends(&hierarchy, hierarchy.nodes[0].link, &on_device);
            for i in 0..emitters.list.len() {
                let found = hierarchy.probability(i, on_device);
                let twin = hierarchy.probability(i, |node| LightHierarchy::importance(node, point.as_dvec3()));
                sum += found;
                assert!(twin == 0.0 || found > 0.0, "{}: light {i} is lost at {point}", made.0.name);
                let bound = 4e-3_f64.min(0.02 * twin + 1e-4);
                assert!((found - twin).abs() < bound, "{} at {point}: {found}, {twin}", made.0.name);
            }
            assert!((sum - 1.0).abs() < 1e-12, "{sum}");
        }
    }
}

/// The pictures of both light samplers have one mean: their difference in a pixel is noise around 0.
fn have_one_mean(gpu: &Gpu, name: &str, made: &Made, environment: Option<&Environment>, choices: &[&str]) {
    let [power, hierarchy] = ["light-sampler=power", "light-sampler=hierarchy"]
        .map(|sampler| draw(gpu, &made.0, environment, 0, &[choices, &[sampler]].concat()));
    assert!(bits(&power) != bits(&hierarchy), "{name}: the hierarchy was not used");
    let each = || power.rgba.iter().zip(&hierarchy.rgba).map(|(a, b)| f64::from(b[1]) - f64::from(a[1]));
    let n = power.rgba.len() as f64;
    let [mean, ..] = spread(&power, 1);
    let off = each().sum::<f64>() / n;
    let error = (each().map(|d| (d - off).powi(2)).sum::<f64>() / (n * (n - 1.0))).sqrt();
    eprintln!("{name}: mean {mean:.5}, difference {:.4} ± {:.4} of it", off / mean, error / mean);
    assert!(off.abs() <= 4.0 * error, "{name}: {off} ± {error} of {mean}");
    assert!(error < 0.02 * mean, "{name}: nothing is shown by a difference of {off} ± {error} of {mean}");
}

#[test]
fn many_points_light_alike_by_both_samplers() {
    let gpu = Gpu::open();
    for (count, samples) in [(3, "samples=1024"), (100, "samples=256")] {
        have_one_mean(&gpu, &format!("{count} points"), &points(count), None, &[samples, "interfaces=1"]);
    }
}

/// A ceiling of 36 panels, with a pane just below it. From the floor all panels are about as important; from the pane
/// it is those at the same place.
fn ceiling() -> Made {
    let mut made = Made::new("ceiling");
    made.add(Shape::panel(6.0, 6.0), lambert([0.7; 3]), DAffine3::from_rotation_x(-FRAC_PI_2));
    let lamp = Material { emissive: [1.0; 3], double_sided: false, ..lambert([0.0; 3]) };
    let mesh = made.mesh(Shape::panel(1.0, 1.0), lamp);
    for i in 0..36 {
        let place = at(f64::from(i % 6) - 2.5, 2.0, f64::from(i / 6) - 2.5);
        made.place(mesh, place * DAffine3::from_rotation_x(FRAC_PI_2));
    }
    made.camera(DVec3::Y * 1.5, DVec3::ZERO, orthographic(2.0));
    made
}

/// Paths pass the pane undeflected before they hit a panel, so that the last vertex for MIS is not where the ray
/// starts.
#[test]
fn panels_behind_a_pane_light_alike_by_both_samplers() {
    let gpu = Gpu::open();
    let pane = Material { transmission: 1.0, roughness: 0.0, specular: 0.0, ..lambert([0.9; 3]) };
    for (mut made, height) in [(panels(40), 0.3), (ceiling(), 1.9)] {
        let flat = at(0.0, height, 0.0) * DAffine3::from_rotation_x(-FRAC_PI_2);
        made.add(Shape::panel(40.0, 40.0), pane.clone(), flat);
        let name = format!("{} behind a pane", made.0.name);
        have_one_mean(&gpu, &name, &made, None, &["samples=256", "interfaces=4"]);
    }
}

#[test]
fn an_environment_and_the_sun_light_alike_beside_the_hierarchy() {
    let mut sky = Environment::constant([0.02; 3]);
    (sky.width, sky.height) = (64, 32);
    sky.radiance = vec![[0.02; 3]; 64 * 32];
    (sky.radiance[6 * 64 + 40], sky.radiance[6 * 64 + 41]) = ([30.0; 3], [30.0; 3]);
    let mut made = kinds();
    made.light([0.3; 3], LightKind::Directional { direction: DVec3::new(0.2, -1.0, 0.3).normalize() });
    have_one_mean(&Gpu::open(), "all kinds", &made, Some(&sky), &["samples=1024", "interfaces=2"]);
}

#[test]
fn several_light_samples_and_both_forms_agree() {
    let gpu = Gpu::open();
    let made = kinds();
    have_one_mean(&gpu, "all kinds, 4 samples", &made, None, &["samples=256", "interfaces=1", "lights=area:4"]);
    let mut knobs = Knobs::of(Model::Global);
    for choice in ["samples=1", "interfaces=4", "lights=area:4"] {
        knobs.set(choice).expect("a rung");
    }
    let [of_cpu, of_gpu] = [Architecture::Cpu, Architecture::Gpu].map(|architecture| {
        let settings = Settings { size: [32, 24], knobs: knobs.clone(), ..Settings::default() };
        bits(&gpu.shot(&made.0, None, Settings { architecture: Some(architecture), ..settings }).1)
    });
    assert!(of_cpu == of_gpu);
}

/// A white room whose walls emit: its radiance is known, E/(1 − ρ), whatever each light sample is weighted by.
#[test]
fn a_room_of_emissive_triangles_is_as_bright_as_it_emits() {
    let gpu = Gpu::open();
    let mut made = Made::new("room");
    // Twelve panels each way: 6 walls of 2 triangles alone would not call for the hierarchy.
    let glow = Material { emissive: [0.5; 3], ..lambert([0.5; 3]) };
    for (turn, by) in [
        (DAffine3::IDENTITY, DVec3::NEG_Z),
        (DAffine3::from_rotation_y(PI), DVec3::Z),
        (DAffine3::from_rotation_y(FRAC_PI_2), DVec3::NEG_X),
        (DAffine3::from_rotation_y(-FRAC_PI_2), DVec3::X),
        (DAffine3::from_rotation_x(-FRAC_PI_2), DVec3::NEG_Y),
        (DAffine3::from_rotation_x(FRAC_PI_2), DVec3::Y),
    ] {
        for i in 0..4 {
            let part = DVec3::new(f64::from(i % 2) - 0.5, f64::from(i / 2) - 0.5, 0.0);
            let place = DAffine3::from_translation(by) * turn * DAffine3::from_translation(part);
            made.add(Shape::panel(1.0, 1.0), glow.clone(), place);
        }
    }
    made.camera(DVec3::new(0.1, -0.2, 0.3), DVec3::new(-0.4, 0.3, -0.9), etalon_testing::made::perspective(90.0));
    let picture = draw(&gpu, &made.0, None, 0, &["samples=256"]);
    let [mean, error, _] = spread(&picture, 1);
    eprintln!("room: {mean:.5} ± {error:.5}");
    assert!((mean - 1.0).abs() <= 1e-5 + 4.0 * error && error < 2e-3, "{mean} ± {error}");
}

/// Relative mean squared error of each sampler against the mean of many samples of both.
fn errors(gpu: &Gpu, made: &Made) -> [f64; 2] {
    let samplers = ["light-sampler=power", "light-sampler=hierarchy"];
    let truth = draw(gpu, &made.0, None, 5, &["samples=1024", "interfaces=1", samplers[1]]);
    samplers.map(|sampler| {
        let picture = draw(gpu, &made.0, None, 0, &["samples=16", "interfaces=1", sampler]);
        let each = picture.rgba.iter().zip(&truth.rgba).map(|(x, y)| {
            let (x, y) = (f64::from(x[1]), f64::from(y[1]));
            (x - y) * (x - y) / (y * y + 0.01)
        });
        each.sum::<f64>() / picture.rgba.len() as f64
    })
}

/// Choosing one of n spread lights by power alone has an error that grows with n; by importance it hardly does.
#[test]
fn hundreds_of_spread_lights_have_less_error() {
    let gpu = Gpu::open();
    for (name, made) in [("points", points(400)), ("panels", panels(200))] {
        let [power, hierarchy] = errors(&gpu, &made);
        eprintln!("{name}: relMSE {power:.5} by power, {hierarchy:.5} by the hierarchy, {:.4}", hierarchy / power);
        assert!(hierarchy < 0.5 * power, "{name}: {hierarchy}, {power}");
    }
}
