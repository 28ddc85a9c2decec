//! What must not change the picture: units, place, the order of triangles, and which way the world is turned.

use etalon::image::Picture;
use etalon::optics::SplitMix64;
use etalon::scene::{LightKind, Scene};
use etalon::study;
use etalon::study::generate::{self, at_scale};
use etalon_testing::gpu::{Gpu, bits, settings};
use glam::{DAffine3, DVec3};

const SIZE: [u32; 2] = [96, 54];

fn scenes() -> Vec<Scene> {
    let mut all: Vec<Scene> =
        ["lamps", "blend", "cornell"].iter().map(|name| study::load(name).expect("a study scene")).collect();
    all.push(generate::lights(40));
    all
}

/// Per pixel, the largest difference over the value, or over 1 % of the brightest where the value is smaller.
fn differences(a: &Picture, b: &Picture) -> Vec<f64> {
    let brightest = a.rgba.iter().flatten().fold(0.0_f32, |m, v| m.max(*v));
    assert!(brightest > 0.1, "nothing is lit");
    let one = |a: f32, b: f32| {
        let error = f64::from((a - b).abs()) / f64::from(a.abs().max(0.01 * brightest));
        if error.is_nan() { f64::INFINITY } else { error }
    };
    a.rgba.iter().zip(&b.rgba).map(|(a, b)| (0..4).fold(0.0, |most, c| one(a[c], b[c]).max(most))).collect()
}

/// Pixels that are no outlines differ by less than `bound`; of all pixels, one in a thousand may differ by more.
fn same_but_outlines(a: &Picture, b: &Picture, scene: &Scene, bound: f64, what: &str) {
    let options = etalon_testing::raycast::Options { blend: true, textures: true };
    let edges = etalon_testing::raycast::picture(scene, &scene.cameras[0], a.width, a.height, options);
    let differences = differences(a, b);
    let many = differences.iter().filter(|d| **d > bound).count();
    let inside = differences.iter().zip(&edges).filter(|(_, p)| !p.edge).map(|(d, _)| *d);
    let (count, most) = inside.fold((0, 0.0_f64), |(count, most), d| (count + 1, most.max(d)));
    eprintln!("{}, {what}: {most:e} over {count} pixels, {many} beyond", scene.name);
    assert!(count > 1000, "{}, {what}: nearly nothing was compared", scene.name);
    assert!(most <= bound, "{}, {what}: {most:e}", scene.name);
    assert!(many * 1000 <= a.rgba.len(), "{}, {what}: {many} pixels", scene.name);
}

#[test]
fn powers_of_two_are_only_units() {
    let gpu = Gpu::open();
    for scene in scenes() {
        let here = gpu.film(&scene, settings(SIZE));
        for exponent in [-10, -3, 1, 10] {
            let scaled = at_scale(scene.clone(), f64::from(exponent).exp2(), DVec3::ZERO);
            let there = gpu.film(&scaled, settings(SIZE));
            // Every length is scaled exactly, every ratio stays, and what is squared stays a power of two away.
            let worst = differences(&here, &there).into_iter().fold(0.0, f64::max);
            assert!(bits(&here) == bits(&there), "{} times 2^{exponent}: {worst:e}", scene.name);
        }
    }
}

#[test]
fn ten_kilometres_away_it_looks_the_same() {
    let gpu = Gpu::open();
    for scene in scenes() {
        let here = gpu.film(&scene, settings(SIZE));
        for offset in [DVec3::new(1e4, 0.0, 0.0), DVec3::new(-7e3, 1e4, 3e3)] {
            let there = gpu.film(&at_scale(scene.clone(), 1.0, offset), settings(SIZE));
            // f64 keeps 1e-12 m at 10 km; a difference to the eye may round to the other f32 neighbour. Reflected light
            // then changes by a few ulps, 1e-5 with the lobe's slope, and centres on outlines may fall to the other
            // side.
            same_but_outlines(&here, &there, &scene, 1e-5, &format!("moved by {offset}"));
        }
    }
}

#[test]
fn the_order_of_triangles_and_of_their_corners_does_not_show() {
    let gpu = Gpu::open();
    for scene in scenes() {
        let here = gpu.film(&scene, settings(SIZE));
        let mut shuffled = scene.clone();
        let mut random = SplitMix64::new(1);
        for mesh in &mut shuffled.meshes {
            let mut triangles: Vec<[u32; 3]> = mesh.indices.as_chunks::<3>().0.to_vec();
            random.shuffle(&mut triangles);
            mesh.indices = triangles.concat().into();
        }
        let there = gpu.film(&shuffled, settings(SIZE));
        assert!(bits(&here) == bits(&there), "{}: the order of triangles shows", scene.name);

        let mut turned = scene.clone();
        for mesh in &mut turned.meshes {
            mesh.indices.as_chunks_mut::<3>().0.iter_mut().for_each(|t| t.rotate_left(1));
        }
        let there = gpu.film(&turned, settings(SIZE));
        // The rasteriser interpolates from the first corner: normals may round to the next of the octahedron's, 3.7e-3
        // degrees off (numerics.md 16); the lobe of the glossiest material (α = 0.04) has relative slopes to 1.5 / α
        // per radian, which makes 2.4e-3. Texels round to half floats, 2^-11.
        same_but_outlines(&here, &there, &scene, 3e-3, "corners turned");
    }
}

#[test]
fn a_quarter_turn_of_the_world_with_its_camera_does_not_show() {
    let gpu = Gpu::open();
    for scene in scenes() {
        let here = gpu.film(&scene, settings(SIZE));
        let mut turned = scene.clone();
        let turn: DAffine3 = etalon_testing::made::quarter_turn();
        for instance in &mut turned.instances {
            instance.world_from_object = turn * instance.world_from_object;
        }
        for camera in &mut turned.cameras {
            camera.world_from_camera = turn * camera.world_from_camera;
        }
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
        let there = gpu.film(&turned, settings(SIZE));
        // Octahedra are not alike along all axes: normals differ by up to twice 3.7e-3 degrees; see above.
        same_but_outlines(&here, &there, &scene, 6e-3, "turned");
    }
}
