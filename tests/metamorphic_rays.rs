//! What must not change a picture that rays make: units, place, the order of triangles and of lights, and which way the
//! world is turned. Rays that have crossed many curved surfaces amplify any rounding: there it is counted how many
//! pixels differ.

use etalon::frame::Settings;
use etalon::image::Picture;
use etalon::optics::SplitMix64;
use etalon::plan::{Knobs, Model};
use etalon::scene::{LightKind, Scene};
use etalon::study;
use etalon::study::generate::at_scale;
use etalon_testing::gpu::{Gpu, bits};
use glam::DVec3;

const SIZE: [u32; 2] = [96, 54];

fn scenes() -> Vec<Scene> {
    ["etalon", "pool", "nested", "materials"].iter().map(|name| study::load(name).expect("a study scene")).collect()
}

/// Without the radiosity of occluders: its paths start elsewhere when triangles have another order.
fn settings() -> Settings {
    let mut knobs = Knobs::of(Model::Recursive);
    // Random numbers choose among triangles in their order: light samples have other noise.
    ["samples=1", "lights=points", "indirect=ambient"].iter().for_each(|choice| knobs.set(choice).expect("a rung"));
    Settings { size: SIZE, knobs, ..Settings::default() }
}

/// How many pixels differ by more than `bound`, relative to the larger of the value and 1 % of the brightest but 1 %.
fn differing(a: &Picture, b: &Picture, bound: f32) -> usize {
    let mut sorted: Vec<f32> = a.rgba.iter().map(|p| p[0].max(p[1]).max(p[2])).collect();
    sorted.sort_by(f32::total_cmp);
    let bright = sorted[sorted.len() * 99 / 100];
    assert!(bright > 0.05, "nothing is lit");
    let differs = |a: f32, b: f32| a.is_nan() || b.is_nan() || (a - b).abs() > bound * a.abs().max(0.01 * bright);
    a.rgba.iter().zip(&b.rgba).filter(|(a, b)| (0..4).any(|c| differs(a[c], b[c]))).count()
}

fn compare(a: &Picture, b: &Picture, bound: f32, most: usize, what: &str) {
    let many = differing(a, b, bound);
    eprintln!("{what}: {many} of {} pixels differ by more than {bound:e}", a.rgba.len());
    assert!(many <= most, "{what}: {many} pixels differ by more than {bound:e}, {most} may");
}

/// A metre may be a micrometre or a thousand kilometres: every length is scaled exactly, and nothing in the passes has
/// a length of its own.
#[test]
fn powers_of_two_are_only_units() {
    let gpu = Gpu::open();
    for scene in scenes() {
        let here = gpu.film(&scene, settings());
        for exponent in [-20, -7, 1, 20] {
            let scaled = at_scale(scene.clone(), f64::from(exponent).exp2(), DVec3::ZERO);
            let there = gpu.film(&scaled, settings());
            let many = differing(&here, &there, 0.0);
            assert!(bits(&here) == bits(&there), "{} times 2^{exponent}: {many} pixels differ", scene.name);
        }
    }
}

/// Positions and lights differ by 1e-12 m, which rounds some of them to the other f32 neighbour.
#[test]
fn ten_kilometres_away_it_looks_the_same() {
    let gpu = Gpu::open();
    for scene in scenes() {
        let here = gpu.film(&scene, settings());
        let moved = at_scale(scene.clone(), 1.0, DVec3::new(-7e3, 1e4, 3e3));
        let there = gpu.film(&moved, settings());
        compare(&here, &there, 1e-3, here.rgba.len() / 100, &format!("{} moved", scene.name));
    }
}

/// Another order of triangles is another tree with the same hits. But which triangles follow each other decides what is
/// taken as one flat face, and rays from rough surfaces graze the other half of it: in the pool, whose parasol does
/// that, 25 pixels differ.
#[test]
fn the_order_of_triangles_does_not_show() {
    let gpu = Gpu::open();
    for scene in scenes() {
        let here = gpu.film(&scene, settings());
        let mut shuffled = scene.clone();
        let mut random = SplitMix64::new(1);
        for mesh in &mut shuffled.meshes {
            let mut triangles: Vec<[u32; 3]> = mesh.indices.as_chunks::<3>().0.to_vec();
            random.shuffle(&mut triangles);
            mesh.indices = triangles.concat().into();
        }
        let there = gpu.film(&shuffled, settings());
        let most = if scene.name.contains("pool") { 25 } else { 0 };
        compare(&here, &there, 0.0, most, &format!("{} shuffled", scene.name));
    }
}

/// Sums of floats in another order.
#[test]
fn the_order_of_lights_does_not_show() {
    let gpu = Gpu::open();
    for scene in scenes().into_iter().filter(|scene| scene.lights.len() > 1) {
        let here = gpu.film(&scene, settings());
        let mut turned = scene.clone();
        turned.lights.reverse();
        let there = gpu.film(&turned, settings());
        compare(&here, &there, 1e-5, 0, &format!("{} with its lights reversed", scene.name));
    }
}

/// Normals of the G-buffer are not alike along all axes, and other boxes bound the same triangles.
#[test]
fn a_quarter_turn_of_the_world_does_not_show() {
    let gpu = Gpu::open();
    for scene in scenes() {
        let here = gpu.film(&scene, settings());
        let turn = etalon_testing::made::quarter_turn();
        let mut turned = scene.clone();
        turned.instances.iter_mut().for_each(|i| i.world_from_object = turn * i.world_from_object);
        turned.cameras.iter_mut().for_each(|c| c.world_from_camera = turn * c.world_from_camera);
        for light in &mut turned.lights {
            match &mut light.kind {
                LightKind::Directional { direction } => *direction = turn.transform_vector3(*direction),
                LightKind::Point { position, .. } => *position = turn.transform_point3(*position),
                LightKind::Spot { position, direction, .. } => {
                    *position = turn.transform_point3(*position);
                    *direction = turn.transform_vector3(*direction);
                }
            }
        }
        let there = gpu.film(&turned, settings());
        compare(&here, &there, 6e-3, here.rgba.len() / 50, &format!("{} turned", scene.name));
    }
}
