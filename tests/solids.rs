//! What is a solid, and which solids a point lies in: against closed forms.

use etalon::frame::Settings;
use etalon::optics::SplitMix64;
use etalon::plan::{Knobs, Model};
use etalon::scene::environment::Environment;
use etalon::scene::solid::{Solids, deepest_nesting, is_closed, media_at, solids};
use etalon::scene::{Instance, Material, Mesh, Scene};
use etalon::study::{self, shape::Shape};
use etalon_testing::gpu::{Gpu, largest_difference};
use etalon_testing::made::looking;
use glam::{DAffine3, DQuat, DVec2, DVec3};

fn mesh(name: &str, shape: Shape) -> Mesh {
    Mesh {
        name: name.to_owned(),
        positions: shape.positions.into(),
        normals: shape.normals.into(),
        indices: shape.indices.into(),
        ..Mesh::default()
    }
}

fn glass() -> Material {
    Material { name: "glass".to_owned(), metallic: 0.0, transmission: 1.0, thickness: 1.0, ..Material::default() }
}

/// One instance of each mesh, all of glass.
fn scene_of(parts: Vec<(Mesh, DAffine3)>) -> Scene {
    let mut scene = Scene { materials: vec![glass()], ..Scene::default() };
    for (mesh, world_from_object) in parts {
        scene.instances.push(Instance { name: mesh.name.clone(), mesh: scene.meshes.len(), world_from_object });
        scene.meshes.push(mesh);
    }
    scene
}

fn cube(name: &str, edge: f64) -> Mesh {
    mesh(name, Shape::cuboid(DVec3::splat(edge)))
}

/// The same surface with every triangle wound the other way.
fn turned(mut mesh: Mesh) -> Mesh {
    mesh.indices.chunks_exact_mut(3).for_each(|t| t.swap(1, 2));
    mesh
}

fn without_a_triangle(mut mesh: Mesh) -> Mesh {
    mesh.indices.drain(3..6);
    mesh
}

/// A uniform point in the cube from −`reach` to `reach`.
fn within(random: &mut SplitMix64, reach: f64) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| random.between(-reach, reach)))
}

#[test]
fn shapes_that_bound_a_volume_are_closed() {
    let triangle = [DVec2::new(-0.5, -0.3), DVec2::new(0.5, -0.3), DVec2::new(0.0, 0.6)];
    for (name, shape, closed) in [
        ("cuboid", Shape::cuboid(DVec3::new(1.0, 2.0, 3.0)), true),
        ("sphere", Shape::sphere(0.7, 13), true),
        ("cylinder", Shape::cylinder(0.3, 1.1, 17), true),
        ("torus", Shape::torus(1.0, 0.3, 30), true),
        ("prism", Shape::prism(&triangle, 2.0), true),
        ("displaced sphere", Shape::displaced_sphere(1.0, 5000), true),
        ("plane", Shape::plane(1.0, 1.0, 3), false),
        ("panel", Shape::panel(1.0, 1.0), false),
        ("disc", Shape::disc(1.0, 12), false),
    ] {
        assert_eq!(is_closed(&mesh(name, shape)), closed, "{name}");
    }
    assert!(!is_closed(&Mesh::default()), "nothing bounds nothing");
}

/// A sphere as it is often generated: its seam ends at the sine of 2π, and its poles are rings of the sine of 0 and π.
fn turned_by_sines(radius: f32, sides: u32, rings: u32) -> Mesh {
    let mut made = Mesh { name: "turned".to_owned(), ..Mesh::default() };
    for ring in 0..=rings {
        let polar = std::f32::consts::PI * ring as f32 / rings as f32;
        for side in 0..=sides {
            let turn = std::f32::consts::TAU * side as f32 / sides as f32;
            let n = [polar.sin() * turn.sin(), polar.cos(), polar.sin() * turn.cos()];
            made.positions.push(n.map(|x| x * radius));
            made.normals.push(n);
            if ring < rings && side < sides {
                let [a, b] = [ring, ring + 1].map(|ring| ring * (sides + 1) + side);
                made.indices.extend([a, b, a + 1, a + 1, b, b + 1]);
            }
        }
    }
    made
}

#[test]
fn seams_within_rounding_are_closed() {
    for (radius, sides, rings) in [(1.0, 24, 12), (0.003, 48, 24), (250.0, 7, 5), (1.0, 500, 300)] {
        let made = turned_by_sines(radius, sides, rings);
        let [first, last] = [0, sides].map(|side| made.positions[(sides + 1 + side) as usize]);
        assert_ne!(first, last, "the seam has a gap");
        let found = solids(&scene_of(vec![(made, DAffine3::IDENTITY)]));
        assert_eq!((found.solid, found.flipped), (vec![true], vec![false]), "{radius} {sides} {rings}");
        assert!(found.warnings.is_empty(), "{:?}", found.warnings);
    }
}

/// The front and the back of a pane, wound outwards, so near that their edges meet: they are sheets.
#[test]
fn two_sheets_within_rounding_bound_nothing() {
    let [mut pane, back] = [Shape::panel(1.0, 1.0), Shape::panel(1.0, 1.0)].map(|shape| mesh("pane", shape));
    let count = pane.positions.len() as u32;
    pane.positions.extend(back.positions.iter().map(|&[x, y, _]| [x, y, -2e-7]));
    pane.normals.extend(back.normals.iter().map(|n| n.map(|x| -x)));
    pane.indices.extend(turned(back).indices.iter().map(|i| i + count));
    assert!(!is_closed(&pane));
}

#[test]
fn one_flaw_opens_a_mesh_and_what_is_none_does_not() {
    let ball = || mesh("ball", Shape::sphere(1.0, 12));
    assert!(!is_closed(&without_a_triangle(ball())), "a hole");
    let mut flaw = ball();
    flaw.indices[..3].swap(1, 2);
    assert!(!is_closed(&flaw), "one triangle turned");
    let mut flaw = ball();
    flaw.indices.extend_from_within(..3);
    assert!(!is_closed(&flaw), "one triangle twice");
    let mut flaw = ball();
    // Twelve rings of 25: the first and the last of a ring are the two sides of the seam.
    assert_eq!(flaw.positions[75], flaw.positions[99]);
    let x = flaw.positions[75][0];
    flaw.positions[75][0] = x.next_up();
    assert!(is_closed(&flaw), "one copy of a shared corner is off by its last bit");
    flaw.positions[75][0] = x + 1e-5;
    assert!(!is_closed(&flaw), "one copy is off by 5e-6 of the diameter");

    assert!(is_closed(&turned(ball())), "inside out is closed");
    let mut sound = ball();
    // The seam's and the poles' zeros of either sign are one place.
    sound.positions.iter_mut().flatten().filter(|x| **x == 0.0).enumerate().for_each(|(i, x)| {
        *x = if i % 2 == 0 { -0.0 } else { 0.0 };
    });
    assert!(sound.positions.iter().flatten().any(|x| x.to_bits() == (-0.0_f32).to_bits()));
    assert!(is_closed(&sound), "−0 is 0");
    let (a, b) = (sound.indices[0], sound.indices[1]);
    sound.indices.extend([a, b, b, a, a, a]);
    assert!(is_closed(&sound), "triangles with two corners in one place are no surface");
    let mut two = ball();
    let shift = two.positions.len() as u32;
    two.positions.extend_from_within(..);
    two.indices.extend(ball().indices.iter().map(|i| i + shift));
    assert!(is_closed(&two), "two surfaces in one mesh, here in one place");
}

#[test]
fn every_transmissive_mesh_of_the_study_scenes_is_closed_and_wound_outwards() {
    let mut bodies = 0;
    for name in study::NAMES {
        let scene = study::load(name).expect("a listed name loads");
        let found = solids(&scene);
        assert_eq!(found.warnings, Vec::<String>::new(), "study:{name}");
        for (i, instance) in scene.instances.iter().enumerate() {
            let mesh = &scene.meshes[instance.mesh];
            let material = &scene.materials[mesh.material];
            if material.transmission > 0.0 && material.thickness > 0.0 {
                bodies += 1;
                assert!(is_closed(mesh) && !found.sheet[i] && !found.flipped[i], "study:{name}, {}", mesh.name);
            }
        }
    }
    assert!(bodies >= 5, "{bodies} bodies");
}

#[test]
fn each_flaw_is_said_once_and_by_name() {
    let middle = DAffine3::IDENTITY;
    let mut doubled = mesh("pane", Shape::panel(1.0, 1.0));
    let back: Vec<u32> = doubled.indices.chunks_exact(3).flat_map(|t| [t[0], t[2], t[1]]).collect();
    doubled.indices.extend(back);
    let mut scene = scene_of(vec![
        (cube("sound", 1.0), middle),
        (without_a_triangle(cube("open", 1.0)), middle),
        (turned(cube("turned", 1.0)), middle),
        (doubled, middle),
        (without_a_triangle(turned(cube("both", 1.0))), middle),
        (without_a_triangle(cube("window", 1.0)), middle),
        (without_a_triangle(cube("stone", 1.0)), middle),
    ]);
    // A sheet by its own word, and something opaque: neither need be closed.
    scene.materials.push(Material { thickness: 0.0, ..glass() });
    scene.materials.push(Material { transmission: 0.0, ..glass() });
    (scene.meshes[5].material, scene.meshes[6].material) = (1, 2);
    for i in 0..7 {
        scene.instances.push(scene.instances[i].clone());
    }
    let found = solids(&scene);
    let expected = [
        "mesh \"open\" transmits light and is not closed: read as a thin sheet of its nominal thickness",
        "mesh \"turned\" transmits light and is inside out: its faces are turned",
        "mesh \"pane\" transmits light and bounds no volume: read as a thin sheet of its nominal thickness",
        "mesh \"both\" transmits light and is not closed: read as a thin sheet of its nominal thickness",
    ];
    assert_eq!(found.warnings, expected);
    assert_eq!(found.sheet, [false, true, false, true, true, true, false].repeat(2));
    assert_eq!(found.flipped, [false, false, true, false, false, false, false].repeat(2));
}

#[test]
fn winding_is_judged_in_object_space_and_far_from_the_origin() {
    let mirror = DAffine3::from_scale(DVec3::new(1.0, -2.0, 1.0));
    // In f32 at 3 km a millimetre is four steps: the small cube keeps its shape, and its tetrahedra to the origin would
    // be two million times its volume.
    let far = |mut mesh: Mesh| {
        mesh.positions.iter_mut().for_each(|p| *p = [p[0] + 3000.0, p[1] - 3000.0, p[2] + 3000.0]);
        mesh
    };
    let scene = scene_of(vec![
        (cube("plain", 1.0), mirror),
        (turned(cube("turned", 1.0)), mirror),
        (far(cube("far", 0.003_906_25)), DAffine3::IDENTITY),
        (far(turned(cube("far and turned", 0.003_906_25))), DAffine3::IDENTITY),
    ]);
    assert_eq!(solids(&scene).flipped, [false, true, false, true]);
}

#[test]
fn nested_cubes_are_listed_from_the_outside_in() {
    // Listed in a jumble, so that the order of the scene is not the answer.
    let scene = scene_of(vec![
        (cube("middle", 2.0), DAffine3::IDENTITY),
        (cube("inner", 1.0), DAffine3::from_rotation_y(0.3)),
        (turned(cube("outer", 4.0)), DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0))),
        (cube("beside", 1.0), DAffine3::from_translation(DVec3::X * 10.0)),
    ]);
    let found = solids(&scene);
    let at = |x: f64| media_at(&scene, &found, DVec3::new(x, 0.01, -0.02));
    assert_eq!(at(0.1), [2, 0, 1]);
    assert_eq!(at(0.8), [2, 0]);
    assert_eq!(at(1.5), [2]);
    assert_eq!(at(2.5), [0; 0]);
    assert_eq!(at(10.2), [3]);
}

#[test]
fn nested_meshes_are_counted_by_their_boxes() {
    let place = |x: f64| DAffine3::from_translation(DVec3::new(x, 0.0, 0.0));
    let deepest = |parts: &[(f64, f64)]| {
        let scene = scene_of(parts.iter().map(|&(edge, x)| (cube("cube", edge), place(x))).collect());
        deepest_nesting(&scene, &solids(&scene))
    };
    assert_eq!(deepest(&[]), 0);
    assert_eq!(deepest(&[(1.0, 0.0), (1.0, 2.0), (1.0, -7.0)]), 1);
    // A chain of three of which two meet at a time, in any order.
    assert_eq!(deepest(&[(1.0, 0.0), (1.0, 0.75), (1.0, 1.5)]), 2);
    assert_eq!(deepest(&[(1.0, 1.5), (1.0, 0.0), (1.0, 0.75)]), 2);
    assert_eq!(deepest(&[(4.0, 0.0), (2.0, 0.1), (1.0, 0.2), (0.5, 10.0)]), 3);
}

#[test]
fn a_ball_contains_what_lies_a_hair_inside_its_facets() {
    let scene = scene_of(vec![(mesh("ball", Shape::sphere(1.0, 16)), DAffine3::IDENTITY)]);
    let found = solids(&scene);
    let ball = &scene.meshes[0];
    for t in ball.indices.chunks_exact(3) {
        let [a, b, c] = [t[0], t[1], t[2]].map(|i| DVec3::from(ball.positions[i as usize].map(f64::from)));
        let normal = (b - a).cross(c - a).normalize();
        for weights in [[0.34, 0.33, 0.33], [0.9, 0.05, 0.05], [0.01, 0.495, 0.495]] {
            let p = a * weights[0] + b * weights[1] + c * weights[2];
            // The ball is convex, so a step along the facet's own normal decides; f64 sums of 960 angles leave 1e-13.
            assert_eq!(media_at(&scene, &found, p - normal * 1e-9), [0], "{p}");
            assert_eq!(media_at(&scene, &found, p + normal * 1e-9), [0; 0], "{p}");
        }
    }
    // Inside the sphere, outside its facets: between the middle of a facet's edge and the arc above it.
    let [a, b] = [ball.indices[60], ball.indices[61]].map(|i| DVec3::from(ball.positions[i as usize].map(f64::from)));
    let arc = ((a + b) * 0.5).normalize() * 0.9999;
    assert!(arc.length() > ((a + b) * 0.5).length() + 1e-4);
    assert_eq!(media_at(&scene, &found, arc), [0; 0]);
}

#[test]
fn placements_that_mirror_shear_and_stretch_agree_with_the_cube_they_place() {
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -1.1, 2.0);
    let far = DVec3::new(4.0e6, -2.0e6, 1.0e6);
    let frame = |scale: DVec3, at: DVec3| DAffine3::from_scale_rotation_translation(scale, turn, at);
    let frames = [
        frame(DVec3::new(3.0, 0.2, 1.0), DVec3::new(0.1, 0.2, 0.3)),
        frame(DVec3::new(-1.0, 2.0, 0.5), DVec3::ZERO),
        frame(DVec3::new(1.0, 5.0, 0.1), far) * DAffine3::from_rotation_z(0.7),
        frame(DVec3::new(-2.0, -1.0, -1.0), far) * DAffine3::from_rotation_x(-0.4),
    ];
    let mut numbers = SplitMix64::new(4);
    for frame in frames {
        for cube in [cube("cube", 1.0), turned(cube("turned cube", 1.0))] {
            let scene = scene_of(vec![(cube, frame)]);
            let found = solids(&scene);
            let mut inside = 0;
            for _ in 0..400 {
                let p_object = within(&mut numbers, 0.75);
                let distance = 0.5 - p_object.abs().max_element();
                if distance.abs() < 1e-4 {
                    // Four thousand kilometres out f64 keeps nanometres; the stretches make that 1e-8 of the cube.
                    continue;
                }
                inside += usize::from(distance > 0.0);
                let media = media_at(&scene, &found, frame.transform_point3(p_object));
                assert_eq!(media.len(), usize::from(distance > 0.0), "{p_object} under {frame:?}");
            }
            // (2/3)³ of 400 points are 119.
            assert!((80..160).contains(&inside), "{inside}");
        }
    }
}

#[test]
fn only_closed_bodies_contain() {
    let open = without_a_triangle(cube("open", 1.0));
    let mut scene = scene_of(vec![(open, DAffine3::IDENTITY), (cube("sheet", 1.0), DAffine3::IDENTITY)]);
    scene.materials.push(Material { thickness: 0.0, ..glass() });
    scene.meshes[1].material = 1;
    scene.materials.push(Material { transmission: 0.0, ..glass() });
    scene.meshes.push(Mesh { material: 2, ..cube("opaque", 1.0) });
    scene.instances.push(Instance { mesh: 2, ..scene.instances[0].clone() });
    let found = solids(&scene);
    assert_eq!(found.sheet, [true, true, false]);
    assert_eq!(media_at(&scene, &found, DVec3::ZERO), [0; 0]);
    assert_eq!(media_at(&Scene::default(), &Solids::default(), DVec3::ZERO), [0; 0]);
}

#[test]
fn holes_and_hollows_are_outside() {
    let ring = mesh("ring", Shape::torus(1.0, 0.3, 48));
    // A hollow ball: the inner surface looks into the hollow.
    let mut hollow = mesh("hollow ball", Shape::sphere(1.0, 24));
    let inner = turned(mesh("hollow", Shape::sphere(0.5, 24)));
    let shift = hollow.positions.len() as u32;
    hollow.positions.extend(&inner.positions);
    hollow.indices.extend(inner.indices.iter().map(|i| i + shift));
    let scene = scene_of(vec![(ring, DAffine3::IDENTITY), (hollow, DAffine3::from_translation(DVec3::Y * 3.0))]);
    let found = solids(&scene);
    assert_eq!(found.warnings, Vec::<String>::new());
    for (p, expected) in [
        (DVec3::ZERO, vec![]),
        (DVec3::new(0.9, 0.1, 0.0), vec![0]),
        (DVec3::new(0.8, 0.29, 0.8), vec![]),
        (DVec3::Y * 3.0, vec![]),
        (DVec3::new(0.2, 3.3, 0.3), vec![]),
        (DVec3::new(0.0, 3.75, 0.0), vec![1]),
        (DVec3::new(0.5, 2.5, 0.0), vec![1]),
    ] {
        assert_eq!(media_at(&scene, &found, p), expected, "{p}");
    }
}

/// The faces of a mesh, dealt to `count` meshes.
fn dealt(whole: &Mesh, count: usize) -> Vec<Mesh> {
    let part = |k: usize| {
        let triangles = whole.indices.chunks_exact(3).enumerate().filter(|(i, _)| i / 2 % count == k);
        let indices: Vec<u32> = triangles.flat_map(|(_, t)| t.to_vec()).collect();
        Mesh { name: format!("part {k}"), indices: indices.into(), material: k, ..whole.clone() }
    };
    (0..count).map(part).collect()
}

fn in_parts(count: usize, turn: bool) -> Scene {
    let whole = if turn { turned(cube("cube", 1.0)) } else { cube("cube", 1.0) };
    let mut scene = scene_of(dealt(&whole, count).into_iter().map(|part| (part, DAffine3::IDENTITY)).collect());
    scene.materials = vec![glass(); count];
    scene
}

#[test]
fn meshes_that_close_each_others_edges_bound_one_body() {
    for turn in [false, true] {
        let scene = in_parts(3, turn);
        let found = solids(&scene);
        assert_eq!((found.solid.clone(), found.sheet.clone()), (vec![true; 3], vec![false; 3]));
        assert_eq!((found.body.clone(), found.medium.clone()), (vec![Some(0); 3], vec![0; 3]));
        assert_eq!(found.flipped, [turn; 3]);
        assert_eq!(media_at(&scene, &found, DVec3::splat(0.3)), [0], "inside");
        assert!(media_at(&scene, &found, DVec3::splat(0.6)).is_empty(), "outside");
    }
    // An opaque lid closes a body, too, and is none of its own.
    let mut lid = in_parts(3, false);
    lid.materials[1].transmission = 0.0;
    let found = solids(&lid);
    assert_eq!((found.solid.clone(), found.body.clone()), (vec![true, false, true], vec![Some(0); 3]));
    assert_eq!(media_at(&lid, &found, DVec3::splat(0.3)), [0]);
    // A pane in a wall closes with it, and bounds no body: most of the surface is opaque.
    let mut room = in_parts(3, false);
    room.materials[1].transmission = 0.0;
    room.materials[2].transmission = 0.0;
    let found = solids(&room);
    assert_eq!((found.solid.clone(), found.sheet.clone()), (vec![false; 3], vec![true, false, false]));
    assert!(media_at(&room, &found, DVec3::splat(0.3)).is_empty());
}

#[test]
fn parts_of_other_media_or_elsewhere_bound_no_body() {
    let mut two = in_parts(2, false);
    two.materials[1].ior = 1.3;
    let mut moved = in_parts(2, false);
    moved.instances[1].world_from_object = DAffine3::from_translation(DVec3::X);
    let mut missing = in_parts(3, false);
    missing.instances.pop();
    for (name, scene) in [("another index", two), ("another place", moved), ("a part is missing", missing)] {
        let found = solids(&scene);
        assert_eq!(found.solid, [false, false], "{name}");
        assert_eq!(found.warnings.len(), 2, "{name}: {:?}", found.warnings);
    }
}

/// A body refracts and absorbs as it does in one mesh, from outside and from inside.
#[test]
fn a_body_of_several_meshes_looks_like_one() {
    let gpu = Gpu::hasty();
    let inside = DVec3::new(0.1, 0.2, 0.3);
    for (model, eye) in [
        (Model::Recursive, DVec3::new(1.0, 1.5, 3.0)),
        (Model::Recursive, inside),
        (Model::Global, DVec3::new(1.0, 1.5, 3.0)),
    ] {
        let drawn = |count: usize| {
            let mut scene = in_parts(count, false);
            for material in &mut scene.materials {
                *material = Material {
                    attenuation_distance: 0.5,
                    attenuation_color: [0.3, 0.6, 0.9],
                    roughness: 0.0,
                    ..glass()
                };
            }
            scene.cameras.push(looking(eye, DVec3::ZERO));
            let knobs = knobs(&["samples=1", "interfaces=4"], model);
            gpu.shot(&scene, Some(&Environment::studio()), Settings { size: [48, 48], knobs, ..Settings::default() }).1
        };
        let difference = largest_difference(&drawn(1), &drawn(3), 1.0);
        assert!(difference < 1e-4, "{model:?} from {eye}: {difference}");
    }
}

fn knobs(choices: &[&str], model: Model) -> Knobs {
    let mut knobs = Knobs::of(model);
    let choices: Vec<String> = choices.iter().map(|&choice| choice.to_owned()).collect();
    knobs.set_all(&choices).expect("rungs");
    knobs
}
