//! The study scenes and their shapes are sound, and the raycast that other tests lean on agrees with closed forms.

use std::collections::{HashMap, HashSet};

use etalon::scene::solid::{self, Solids};
use etalon::scene::{AlphaMode, Camera, Instance, LightKind, Material, Mesh, Projection, Scene};
use etalon::study::{self, generate, shape::Shape};
use glam::{DAffine3, DMat3, DVec2, DVec3};

use etalon_testing::raycast::{Options, Ray, World};

fn scenes() -> Vec<Scene> {
    let mut scenes: Vec<Scene> =
        study::NAMES.iter().map(|name| study::load(name).expect("a listed name loads")).collect();
    scenes.push(generate::lights(64));
    scenes.push(generate::sphere_field(20_000));
    scenes.push(generate::quads_at(&[0.5, 1.0, 2.0, 1000.0]));
    scenes.push(generate::checker_plane(100.0, 100.0));
    scenes.push(generate::at_scale(
        study::load("etalon").expect("the default scene loads"),
        1000.0,
        DVec3::new(1e6, -3e5, 2e5),
    ));
    scenes
}

fn dvec(v: [f32; 3]) -> DVec3 {
    DVec3::from(v.map(f64::from))
}

/// A scene of one shape with the default material and placement.
fn scene_of(shape: Shape, world_from_object: DAffine3) -> Scene {
    Scene {
        meshes: vec![Mesh {
            positions: shape.positions.into(),
            normals: shape.normals.into(),
            uvs: [shape.uvs.into(), Vec::new().into()],
            indices: shape.indices.into(),
            ..Mesh::default()
        }],
        instances: vec![Instance { name: "it".to_owned(), mesh: 0, world_from_object }],
        materials: vec![Material::default()],
        ..Scene::default()
    }
}

fn camera_at(eye: DVec3, fov_y: f64) -> Camera {
    Camera {
        name: "test".to_owned(),
        world_from_camera: DAffine3::from_translation(eye),
        projection: Projection::Perspective { fov_y, near: None },
    }
}

/// Every triangle has area, and its winding agrees with its vertex normals.
fn check_winding(name: &str, positions: &[[f32; 3]], normals: &[[f32; 3]], indices: &[u32]) {
    for t in indices.chunks_exact(3) {
        let [a, b, c] = [t[0], t[1], t[2]].map(|i| dvec(positions[i as usize]));
        let face = (b - a).cross(c - a);
        assert!(face.length() > 0.0, "{name}: a triangle without area");
        for &i in t {
            let n = dvec(normals[i as usize]);
            assert!((n.length() - 1.0).abs() < 1e-6, "{name}: a normal of length {}", n.length());
            assert!(face.dot(n) > 0.0, "{name}: triangle {t:?} is wound against its normals");
        }
    }
}

/// Edges that do not occur exactly once in each direction. Vertices of equal position are one vertex.
fn open_edges(shape: &Shape) -> usize {
    // Adding zero turns −0 into 0.
    let key = |i: u32| shape.positions[i as usize].map(|v| (v + 0.0).to_bits());
    let mut edges = HashMap::new();
    for t in shape.indices.chunks_exact(3) {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            *edges.entry((key(a), key(b))).or_insert(0) += 1;
        }
    }
    edges.iter().filter(|((a, b), count)| **count != 1 || edges.get(&(*b, *a)) != Some(&1)).count()
}

#[test]
fn shapes_are_wound_outwards_and_closed_shapes_are_closed() {
    let triangle = [DVec2::new(-0.5, -0.3), DVec2::new(0.5, -0.3), DVec2::new(0.0, 0.6)];
    let closed = [
        ("cuboid", Shape::cuboid(DVec3::new(1.0, 2.0, 3.0)), 12),
        ("sphere", Shape::sphere(0.7, 13), 4 * 13 * 12),
        ("cylinder", Shape::cylinder(0.3, 1.1, 17), 4 * 17),
        ("torus", Shape::torus(1.0, 0.3, 30), 2 * 30 * 15),
        ("prism", Shape::prism(&triangle, 2.0), 8),
        ("displaced sphere", Shape::displaced_sphere(1.0, 5000), 4 * 36 * 35),
        ("tub", Shape::tub(DVec3::new(3.0, 1.0, 2.0), 0.2, 0.1), 28),
    ];
    for (name, shape, triangles) in closed {
        check_winding(name, &shape.positions, &shape.normals, &shape.indices);
        assert_eq!(open_edges(&shape), 0, "{name} has open edges");
        assert_eq!(shape.triangles(), triangles, "{name}");
        // A closed surface wound outwards has a positive volume.
        let volume: f64 = shape
            .indices
            .chunks_exact(3)
            .map(|t| {
                let [a, b, c] = [t[0], t[1], t[2]].map(|i| dvec(shape.positions[i as usize]));
                a.dot(b.cross(c)) / 6.0
            })
            .sum();
        assert!(volume > 0.0, "{name} is inside out: volume {volume}");
    }
    for (name, shape, triangles) in [
        ("plane", Shape::plane(2.0, 3.0, 4), 32),
        ("panel", Shape::panel(2.0, 3.0), 2),
        ("disc", Shape::disc(2.0, 9), 9),
        ("backdrop", Shape::backdrop(2.0, -1.0, 0.5, 3.0), 50),
    ] {
        check_winding(name, &shape.positions, &shape.normals, &shape.indices);
        assert_eq!(shape.triangles(), triangles, "{name}");
        assert!(open_edges(&shape) > 0, "{name} cannot be closed");
    }
}

#[test]
fn displaced_spheres_have_about_the_triangles_asked_for() {
    for asked in [1_000, 5_000, 200_000] {
        let got = generate::sphere_field(asked).triangles() as f64;
        assert!((got / asked as f64 - 1.0).abs() < 0.15, "{got} triangles for {asked}");
    }
}

#[test]
fn scenes_are_sound() {
    for scene in scenes() {
        let name = &scene.name;
        let bounds = scene.bounds().unwrap();
        assert!(bounds.min.is_finite() && bounds.max.is_finite() && bounds.radius() > 0.0, "{name}: {bounds:?}");
        assert!(!scene.cameras.is_empty(), "{name} has no camera");
        assert!(scene.warnings.is_empty(), "{name}");
        for mesh in &scene.meshes {
            let label = format!("{name}, {}", mesh.name);
            let count = mesh.positions.len();
            assert!(mesh.positions.as_flattened().iter().all(|v| v.is_finite()), "{label}");
            assert_eq!(mesh.normals.len(), count, "{label}");
            assert_eq!(mesh.uvs[0].len(), count, "{label}");
            assert!(mesh.uvs[0].as_flattened().iter().all(|v| v.is_finite()), "{label}");
            assert!(mesh.colors.is_empty() && mesh.uvs[1].is_empty(), "{label}");
            // A lobe with a direction needs tangents.
            let are_units =
                mesh.tangents.iter().all(|[x, y, z, w]| (x * x + y * y + z * z - 1.0).abs() < 1e-5 && *w == 1.0);
            let are_missing = mesh.tangents.is_empty() && !scene.materials[mesh.material].has_direction();
            assert!(are_units && (are_missing || mesh.tangents.len() == count), "{label}");
            assert!(!mesh.indices.is_empty() && mesh.indices.len() % 3 == 0, "{label}");
            assert!(mesh.indices.iter().all(|&i| (i as usize) < count), "{label}");
            assert!(mesh.material < scene.materials.len(), "{label}");
            check_winding(&label, &mesh.positions, &mesh.normals, &mesh.indices);
        }
        for instance in &scene.instances {
            assert!(instance.mesh < scene.meshes.len(), "{name}, {}", instance.name);
            assert!(instance.world_from_object.is_finite(), "{name}, {}", instance.name);
            assert!(instance.world_from_object.matrix3.determinant().abs() > 0.0, "{name}, {}", instance.name);
        }
        for material in &scene.materials {
            let label = format!("{name}, {}", material.name);
            assert!(material.base_color.iter().all(|c| (0.0..=1.0).contains(c)), "{label}");
            for factor in [material.metallic, material.roughness, material.transmission, material.clearcoat] {
                assert!((0.0..=1.0).contains(&factor), "{label}");
            }
            assert!(material.emissive.iter().all(|e| e.is_finite() && *e >= 0.0), "{label}");
            assert!(material.base_color_texture.is_none_or(|t| t.image < scene.images.len()), "{label}");
        }
        for image in &scene.images {
            assert_eq!(image.rgba.len(), (image.width * image.height * 4) as usize, "{name}, {}", image.name);
            assert!(image.width <= 512 && image.height <= 512, "{name}, {}", image.name);
        }
        for light in &scene.lights {
            assert!(light.color.iter().all(|c| c.is_finite() && *c >= 0.0), "{name}, {}", light.name);
            if let LightKind::Directional { direction } | LightKind::Spot { direction, .. } = light.kind {
                assert!((direction.length() - 1.0).abs() < 1e-12, "{name}, {}", light.name);
            }
        }
        for camera in &scene.cameras {
            let axes = camera.world_from_camera.matrix3;
            assert!((axes.transpose() * axes).abs_diff_eq(DMat3::IDENTITY, 1e-12), "{name}, {}", camera.name);
            assert!((axes.determinant() - 1.0).abs() < 1e-12, "{name}, {}", camera.name);
        }
        let unique = |kind: &str, names: Vec<&String>| {
            let set: HashSet<_> = names.iter().collect();
            assert_eq!(set.len(), names.len(), "{name}: {kind} share a name");
        };
        unique("meshes", scene.meshes.iter().map(|m| &m.name).collect());
        unique("instances", scene.instances.iter().map(|i| &i.name).collect());
        unique("materials", scene.materials.iter().map(|m| &m.name).collect());
        unique("images", scene.images.iter().map(|i| &i.name).collect());
        unique("lights", scene.lights.iter().map(|l| &l.name).collect());
        unique("cameras", scene.cameras.iter().map(|c| &c.name).collect());
    }
}

#[test]
fn cameras_see_their_subject() {
    for scene in scenes() {
        for camera in &scene.cameras {
            let pixels =
                etalon_testing::raycast::picture(&scene, camera, 64, 36, Options { blend: true, textures: true });
            let seen = pixels.iter().filter(|p| p.hit.is_some()).count();
            assert!(seen * 5 >= pixels.len(), "{}, {}: {seen} of {} pixels", scene.name, camera.name, pixels.len());
            let edges = pixels.iter().filter(|p| p.edge).count();
            assert!(edges < pixels.len(), "{}, {}: nothing but edges", scene.name, camera.name);
            for hit in pixels.iter().filter_map(|p| p.hit) {
                assert!(hit.position.is_finite() && hit.albedo.is_finite() && hit.shading_normal.is_finite());
                assert!((hit.barycentric.iter().sum::<f64>() - 1.0).abs() < 1e-9);
            }
        }
    }
}

#[test]
fn names_that_cannot_be_loaded_are_refused_with_the_list() {
    let unknown = study::load("etallon").unwrap_err().to_string();
    assert!(unknown.contains("etallon") && study::NAMES.iter().all(|name| unknown.contains(name)), "{unknown}");
}

/// The solids that contain a point, by the names of their instances, from the outside in.
fn media<'a>(scene: &'a Scene, solids: &Solids, p_world: DVec3) -> Vec<&'a str> {
    solid::media_at(scene, solids, p_world).into_iter().map(|i| scene.instances[i].name.as_str()).collect()
}

fn instance_of<'a>(scene: &'a Scene, name: &str) -> &'a Instance {
    scene.instances.iter().find(|i| i.name == name).expect("an instance of this name")
}

fn material_of<'a>(scene: &'a Scene, instance: &str) -> &'a Material {
    &scene.materials[scene.meshes[instance_of(scene, instance).mesh].material]
}

#[test]
fn a_swimmer_sees_the_sky_inside_snells_window_and_the_pool_outside() {
    let mut scene = study::load("pool").unwrap();
    let solids = solid::solids(&scene);
    let [swimmer, surface] = [0, 1].map(|i: usize| scene.cameras[i].world_from_camera.translation);
    assert_eq!(media(&scene, &solids, swimmer), ["water"]);
    assert_eq!(media(&scene, &solids, surface), [""; 0]);
    let n = f64::from(material_of(&scene, "water").ior);
    let critical = (1.0 / n).asin();
    assert!((critical.to_degrees() - 48.6).abs() < 0.01);
    let camera = scene.cameras[0].clone();
    let up = camera.world_from_camera.matrix3.z_axis * -1.0;
    assert_eq!(up, DVec3::Y);
    // From inside the water its faces show their backs.
    scene.materials.iter_mut().filter(|m| m.transmission > 0.0).for_each(|m| m.double_sided = true);
    let world = World::new(&scene, Options::default());
    let name = |hit: &etalon_testing::raycast::Hit| scene.instances[hit.instance].name.as_str();
    let onwards = |hit: &etalon_testing::raycast::Hit, direction: DVec3| {
        let ray = Ray { nearest: 1e-9, ..Ray::new(hit.position, direction) };
        world.closest(&ray).expect("the dome and the pool leave no way out")
    };
    let (width, height) = (320, 180);
    let (mut window, mut mirror, mut least_edge) = (0, 0, f64::INFINITY);
    // Within half a degree of the rim: how many look at the sky.
    let (mut rim, mut bright) = (0, 0);
    for i in 0..width * height {
        let (x, y) = (i % width, i / width);
        let ray = etalon_testing::raycast::camera_ray(&camera, width, height, f64::from(x) + 0.5, f64::from(y) + 0.5);
        let angle = ray.direction.angle_between(DVec3::Y);
        if x == 0 || y == 0 || x == width - 1 || y == height - 1 {
            least_edge = angle.min(least_edge);
        }
        let hit = world.closest(&ray).expect("the water has a surface");
        if name(&hit) != "water" || hit.geometric_normal != DVec3::NEG_Y {
            continue;
        }
        // Straight on beside the vertical: the direction's level part grows by n, the rest is the unit length's.
        let level = ray.direction.with_y(0.0);
        let rise = 1.0 - (level * n).length_squared();
        if rise > 0.0 {
            window += 1;
            assert!(angle < critical);
            let seen = onwards(&hit, (level * n).with_y(rise.sqrt()));
            assert!(seen.position.y > 0.0 || name(&seen) == "float", "{} at {}", name(&seen), seen.position);
            if critical - angle < 0.5_f64.to_radians() {
                rim += 1;
                bright += usize::from(name(&seen) == "sky");
            }
        } else {
            mirror += 1;
            assert!(angle >= critical);
            let seen = onwards(&hit, ray.direction * DVec3::new(1.0, -1.0, 1.0));
            assert!(seen.position.y < 0.0 && name(&seen) != "water" && name(&seen) != "sky", "{}", name(&seen));
        }
    }
    assert!(least_edge > critical + 5.0_f64.to_radians(), "the window is cut off");
    assert!(window > 5_000 && mirror > 10_000, "{window} pixels of the window, {mirror} of the mirror");
    // The rest are the ladder, the stands and the pole.
    assert!(rim > 100 && bright * 100 > rim * 85, "{bright} of {rim} pixels at the rim see the sky");
}

#[test]
fn the_pools_water_ends_inside_its_walls() {
    let scene = study::load("pool").unwrap();
    let extent = |name: &str| {
        let instance = instance_of(&scene, name);
        Scene { meshes: scene.meshes.clone(), instances: vec![instance.clone()], ..Scene::default() }.bounds().unwrap()
    };
    let (water, basin) = (extent("water"), extent("basin"));
    assert!(water.max.y == 0.0, "{}", water.max.y);
    for (solid, wall) in [(water.min, basin.min), (-water.max, -basin.max)] {
        assert!(solid.x > wall.x + 0.1 && solid.y > wall.y && solid.z > wall.z + 0.1);
    }
    // What a diver feels for: each wall and the floor a few millimetres before the water's own end.
    let world = World::new(&scene, Options::default());
    for direction in [DVec3::X, DVec3::NEG_X, DVec3::Z, DVec3::NEG_Z, DVec3::NEG_Y] {
        let from = DVec3::new(0.3, -1.7, 0.4);
        let hit = world.closest(&Ray::new(from, direction)).unwrap();
        assert_eq!(scene.instances[hit.instance].name, "basin");
        let end = if direction.min_element() < 0.0 { water.min } else { water.max };
        let beyond = (end - from).dot(direction.abs()).abs() - hit.distance;
        assert!((0.003..0.008).contains(&beyond), "{beyond} m past the wall along {direction}");
    }
}

#[test]
fn ice_lies_in_water_in_glass() {
    let scene = study::load("nested").unwrap();
    let solids = solid::solids(&scene);
    let middle = |name: &str| instance_of(&scene, name).world_from_object.translation;
    let bubble = middle("bubble");
    assert_eq!(media(&scene, &solids, bubble), ["water", "ice cube 0", "bubble"]);
    // The middle of a cube is below the water line, its highest corner above.
    let cubes = ["ice cube 0", "ice cube 1", "ice cube 2"];
    for cube in cubes {
        assert_eq!(media(&scene, &solids, middle(cube)), ["water", cube]);
        assert_eq!(media(&scene, &solids, highest(&scene, cube)), [cube]);
    }
    // In the wall: inside and outside of the water's end, high, low and above it. In the base above and below the
    // water's foot, and above it all.
    for (p, expected) in [
        (DVec3::new(0.0, 0.086, 0.0417), vec!["tumbler", "water"]),
        (DVec3::new(0.0, 0.017, 0.0372), vec!["tumbler", "water"]),
        (DVec3::new(0.0, 0.05, 0.0385), vec!["tumbler", "water"]),
        (DVec3::new(0.0, 0.05, 0.0421), vec!["tumbler"]),
        (DVec3::new(0.0, 0.05, 0.030), vec!["water"]),
        (DVec3::new(0.0, 0.10, 0.0435), vec!["tumbler"]),
        (DVec3::new(0.0, 0.009, 0.0), vec!["tumbler", "water"]),
        (DVec3::new(0.0, 0.004, 0.0), vec!["tumbler"]),
        (DVec3::new(0.0, 0.11, 0.0), vec![]),
    ] {
        assert_eq!(media(&scene, &solids, p), expected, "{p}");
    }
    // Where they overlap the inner one fills the place: glass before water, air before ice before water.
    let of = |name: &str| (material_of(&scene, name).priority, material_of(&scene, name).ior);
    let [tumbler, water, ice, air] = ["tumbler", "water", cubes[0], "bubble"].map(of);
    assert!(tumbler.0 > water.0 && air.0 > ice.0 && ice.0 > water.0);
    assert_eq!([tumbler.1, water.1, ice.1, air.1], [1.5, 1.333, 1.31, 1.0]);

    // Bodies of one kind stay apart, and the ice and the straw away from the glass: points of one are in no other.
    let mut looked = 0;
    for instance in scene.instances.iter().filter(|i| i.name.starts_with("ice") || i.name == "straw") {
        let own = instance.name.as_str();
        let mesh = &scene.meshes[instance.mesh];
        for t in mesh.indices.chunks_exact(3) {
            let [a, b, c] = [t[0], t[1], t[2]].map(|v| dvec(mesh.positions[v as usize]));
            for (u, v) in (0..=8).flat_map(|u| (0..=8 - u).map(move |v| (f64::from(u) / 8.0, f64::from(v) / 8.0))) {
                let p = instance.world_from_object.transform_point3(a + (b - a) * u + (c - a) * v);
                let inside = media(&scene, &solids, p);
                looked += 1;
                assert!(inside.iter().all(|name| *name == own || *name == "water"), "{own} reaches into {inside:?}");
            }
        }
    }
    assert!(looked > 5_000, "{looked}");
}

/// A point just below the highest corner of an instance, towards its middle.
fn highest(scene: &Scene, name: &str) -> DVec3 {
    let instance = instance_of(scene, name);
    let placed = |p: &[f32; 3]| instance.world_from_object.transform_point3(dvec(*p));
    let corner = scene.meshes[instance.mesh].positions.iter().map(placed).max_by(|a, b| a.y.total_cmp(&b.y));
    corner.expect("a mesh has vertices").lerp(instance.world_from_object.translation, 0.01)
}

#[test]
fn metals_have_the_reflectance_of_their_index() {
    // Published next to the table that n and κ were taken from.
    let expected = [
        ("gold", [0.953, 0.674, 0.408]),
        ("silver", [0.989, 0.983, 0.980]),
        ("copper", [0.931, 0.597, 0.533]),
        ("aluminium", [0.906, 0.917, 0.922]),
    ];
    let scene = study::load("metals").unwrap();
    for (name, f0) in expected {
        let material = scene.materials.iter().find(|m| m.name == name).unwrap();
        for ((got, want), [n, k]) in material.base_color.iter().zip(f0).zip(material.conductor.unwrap()) {
            assert!((got - want).abs() < 1e-3, "{name}: {got} instead of {want}");
            let of_index = ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k);
            assert!((of_index - got).abs() < 1e-6, "{name}: {of_index} instead of {got}");
        }
    }
}

#[test]
fn more_lights_keep_the_first_ones() {
    let (few, many) = (generate::lights(8), generate::lights(100));
    assert_eq!(many.lights.len(), 100);
    assert_eq!(many.instances.len(), 1025);
    for (a, b) in few.lights.iter().zip(&many.lights) {
        assert_eq!((a.kind, a.color), (b.kind, b.color));
    }
}

#[test]
fn a_scaled_scene_shows_the_same_picture() {
    let scene = study::load("etalon").unwrap();
    let (factor, offset) = (128.0, DVec3::new(3000.0, -500.0, 70.0));
    let scaled = generate::at_scale(scene.clone(), factor, offset);
    let [a, b] =
        [&scene, &scaled].map(|s| etalon_testing::raycast::picture(s, &s.cameras[0], 64, 36, Options::default()));
    let mut compared = 0;
    for (a, b) in a.iter().zip(&b).filter(|(a, b)| !a.edge && !b.edge) {
        let (Some(a), Some(b)) = (a.hit, b.hit) else { continue };
        compared += 1;
        assert_eq!(a.instance, b.instance);
        assert!((a.distance * factor - b.distance).abs() < 1e-9 * b.distance);
        assert!((a.position * factor + offset).distance(b.position) < 1e-8);
        assert!(a.shading_normal.distance(b.shading_normal) < 1e-9);
    }
    assert!(compared > 1000, "{compared} pixels compared");
    let intensity = |s: &Scene| s.lights[0].color[0] / (factor * factor) as f32;
    assert_eq!(intensity(&scaled), scene.lights[0].color[0]);
}

#[test]
fn equal_quads_look_equal_at_every_distance() {
    let scene = generate::quads_at(&[0.1, 10.0, 1e5]);
    let pixels = etalon_testing::raycast::picture(&scene, &scene.cameras[0], 160, 90, Options::default());
    let counts = [0, 1, 2].map(|i| pixels.iter().filter(|p| p.hit.is_some_and(|h| h.instance == i)).count());
    assert!(counts[0] > 500 && counts.iter().all(|c| c.abs_diff(counts[0]) * 10 < counts[0]), "{counts:?}");
}

#[test]
fn radiance_shows_every_panel_at_the_same_level() {
    let scene = study::load("radiance").unwrap();
    let pixels = etalon_testing::raycast::picture(&scene, &scene.cameras[0], 320, 180, Options::default());
    let seen: HashSet<usize> = pixels.iter().filter_map(|p| p.hit).map(|h| h.instance).collect();
    assert_eq!(seen.len(), scene.instances.len(), "some emitter is out of the picture or hidden");
    for material in &scene.materials {
        let shown = if material.unlit { [1.0; 3] } else { material.emissive };
        assert_eq!(shown, [1.0; 3], "{}", material.name);
    }
}

#[test]
fn raycast_meets_the_analytic_sphere() {
    let (center, radius, rings) = (DVec3::new(0.3, -0.2, -4.0), 1.25, 256);
    let scene = scene_of(Shape::sphere(radius, rings), DAffine3::from_translation(center));
    let (width, height, fov) = (97, 61, 0.8);
    let camera = camera_at(DVec3::new(0.1, 0.2, 0.5), fov);
    // Half the angle that a facet spans; its middle lies that much of a sine below the sphere.
    let half_facet = std::f64::consts::PI / f64::from(rings) / 2.0_f64.sqrt() * 1.5;
    let sagitta = radius * (1.0 - half_facet.cos()) + 1e-6;
    let mut hits = 0;
    for (i, pixel) in
        etalon_testing::raycast::picture(&scene, &camera, width, height, Options::default()).iter().enumerate()
    {
        // The closed form, from the pixel's coordinates up.
        let (x, y) = (i as f64 % f64::from(width) + 0.5, (i / width as usize) as f64 + 0.5);
        let pixel_size = 2.0 * (fov / 2.0).tan() / f64::from(height);
        let (right, up) = ((x - f64::from(width) / 2.0) * pixel_size, (f64::from(height) / 2.0 - y) * pixel_size);
        let d = DVec3::new(right, up, -1.0).normalize();
        let to_center = center - camera.world_from_camera.translation;
        let closest = to_center.dot(d);
        let discriminant = radius * radius - (to_center.length_squared() - closest * closest);
        if pixel.edge {
            continue;
        }
        assert_eq!(pixel.hit.is_some(), discriminant > 0.0, "pixel {x}, {y}");
        let Some(hit) = pixel.hit else { continue };
        hits += 1;
        assert!(((hit.position - center).length() - radius).abs() <= sagitta, "pixel {x}, {y}");
        // A facet behind the sphere is met later, by the sagitta over the cosine.
        let normal = (hit.position - center).normalize();
        let allowed = 2.0 * sagitta / -normal.dot(d);
        assert!((hit.distance - (closest - discriminant.sqrt())).abs() <= allowed, "pixel {x}, {y}");
        assert!(hit.shading_normal.angle_between(normal) < 1e-3, "pixel {x}, {y}");
        assert!(hit.front && hit.geometric_normal.dot(d) < 0.0);
        // The position is on the ray, the weights give the position.
        let along = camera.world_from_camera.translation + d * hit.distance;
        assert!(along.distance(hit.position) < 1e-12, "pixel {x}, {y}: {}", along.distance(hit.position));
    }
    assert!(hits > 500, "{hits} pixels of the sphere");
}

#[test]
fn raycast_meets_the_plane_where_the_closed_form_does() {
    let turn = DAffine3::from_rotation_x(0.3) * DAffine3::from_rotation_z(-0.2);
    let frame = DAffine3::from_translation(DVec3::new(0.0, -1.0, -3.0)) * turn;
    let scene = scene_of(Shape::plane(40.0, 40.0, 1), frame);
    let camera = camera_at(DVec3::new(0.0, 0.5, 0.0), 1.0);
    let normal = turn.transform_vector3(DVec3::Y);
    for pixel in etalon_testing::raycast::picture(&scene, &camera, 32, 18, Options::default()) {
        let Some(hit) = pixel.hit else { continue };
        // f32 vertices are exact here (±20), the placement is f64.
        assert!((hit.position - frame.translation).dot(normal).abs() < 1e-12);
        assert!(hit.geometric_normal.distance(normal) < 1e-12 && hit.shading_normal.distance(normal) < 1e-12);
        let local = frame.inverse().transform_point3(hit.position);
        let uv = DVec2::new(local.x / 40.0 + 0.5, local.z / 40.0 + 0.5);
        assert!(hit.uv.distance(uv) < 1e-12, "{} instead of {uv}", hit.uv);
    }
    // Straight down from the top the plane is met; from below its back is culled unless the material has two sides.
    let up = Ray::new(frame.translation - normal, normal);
    let mut scene = scene;
    assert!(World::new(&scene, Options::default()).closest(&up).is_none());
    scene.materials[0].double_sided = true;
    let hit = World::new(&scene, Options::default()).closest(&up).unwrap();
    assert!(!hit.front && (hit.distance - 1.0).abs() < 1e-12);
    assert!(hit.shading_normal.distance(-normal) < 1e-12 && hit.geometric_normal.distance(-normal) < 1e-12);
}

#[test]
fn a_mirrored_instance_keeps_its_faces_and_weights() {
    let triangle = [DVec2::new(-0.5, -0.4), DVec2::new(0.8, -0.4), DVec2::new(-0.1, 0.7)];
    let frame = DAffine3::from_scale_rotation_translation(
        DVec3::new(1.0, 2.0, 0.5),
        glam::DQuat::from_rotation_y(0.7),
        DVec3::new(0.1, 0.0, -4.0),
    );
    let mirror = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let camera = camera_at(DVec3::ZERO, 0.9);
    let (width, height) = (63, 35);
    let [plain, mirrored] = [frame, mirror * frame].map(|frame| {
        let scene = scene_of(Shape::prism(&triangle, 1.0), frame);
        etalon_testing::raycast::picture(&scene, &camera, width, height, Options::default())
    });
    let mut hits = 0;
    for y in 0..height {
        for x in 0..width {
            let a = &plain[(y * width + x) as usize];
            let b = &mirrored[(y * width + width - 1 - x) as usize];
            assert_eq!(a.hit.is_some(), b.hit.is_some(), "pixel {x}, {y}");
            let (Some(a), Some(b)) = (a.hit, b.hit) else { continue };
            hits += 1;
            let flip = DVec3::new(-1.0, 1.0, 1.0);
            assert_eq!(a.triangle, b.triangle);
            assert!(a.front && b.front);
            assert!(a.position.distance(b.position * flip) < 1e-12);
            assert!(a.geometric_normal.distance(b.geometric_normal * flip) < 1e-12);
            assert!(a.shading_normal.distance(b.shading_normal * flip) < 1e-12);
            assert!(a.shading_normal.distance(a.geometric_normal) < 1e-6, "flat faces, also under uneven scales");
            assert!(a.barycentric.iter().zip(b.barycentric).all(|(a, b)| (a - b).abs() < 1e-12));
            assert!(a.uv.distance(b.uv) < 1e-12);
        }
    }
    assert!(hits > 100, "{hits} pixels of the prism");
}

#[test]
fn rays_do_not_slip_through_a_closed_mesh() {
    // Straight at shared vertices and along shared edges: the ball's rings and seams from its own centre outwards.
    let mut scene = scene_of(Shape::sphere(1.0, 24), DAffine3::IDENTITY);
    scene.materials[0].double_sided = true;
    let world = World::new(&scene, Options::default());
    let mesh = &scene.meshes[0];
    for t in mesh.indices.chunks_exact(3) {
        let [a, b, c] = [t[0], t[1], t[2]].map(|i| dvec(mesh.positions[i as usize]));
        for target in [a, b, c, (a + b) * 0.5, b * 0.3 + c * 0.7] {
            let hit = world.closest(&Ray::new(DVec3::ZERO, target)).expect("the ball is closed");
            assert!((0.98..=1.000_001).contains(&hit.distance) && !hit.front);
        }
    }
}

#[test]
fn raycast_honours_masks_blending_and_orthographic_cameras() {
    let scene = study::load("blend").unwrap();
    let camera = &scene.cameras[0];
    let opaque = etalon_testing::raycast::picture(&scene, camera, 160, 90, Options::default());
    let all = etalon_testing::raycast::picture(&scene, camera, 160, 90, Options { blend: true, textures: true });
    let name = |hit: etalon_testing::raycast::Hit| scene.instances[hit.instance].name.as_str();
    let share = |pixels: &[etalon_testing::raycast::Pixel], wanted: &str| {
        pixels.iter().filter(|p| p.hit.is_some_and(|h| name(h) == wanted)).count() as f64 / pixels.len() as f64
    };
    let blended = |h: etalon_testing::raycast::Hit| scene.materials[h.material].alpha_mode == AlphaMode::Blend;
    assert!(opaque.iter().filter_map(|p| p.hit).all(|h| !blended(h)));
    assert!(share(&all, "near red") > share(&all, "middle green"));
    assert!(share(&all, "middle green") > share(&all, "far blue"));
    assert!(share(&all, "crossing red") > 0.0 && share(&all, "crossing blue") > 0.0);
    // 16 holes of radius 9 texels out of 128² texels, of a pane of 0.81 m².
    let lattice = share(&opaque, "lattice");
    let uncut = etalon_testing::raycast::picture(&scene, camera, 160, 90, Options { blend: false, textures: false });
    let kept = lattice / share(&uncut, "lattice");
    let expected = 1.0 - 16.0 * std::f64::consts::PI * 81.0 / 16384.0;
    assert!((kept - expected).abs() < 0.03, "{kept} of the lattice is there instead of {expected}");

    let projection = Projection::Orthographic { half_height: 0.5, near: 0.5, far: 10.0 };
    let ortho = Camera { projection, ..camera_at(DVec3::new(0.0, 0.0, 1.0), 1.0) };
    let panel = scene_of(Shape::panel(0.5, 0.5), DAffine3::IDENTITY);
    let pixels = etalon_testing::raycast::picture(&panel, &ortho, 80, 40, Options::default());
    let hits: Vec<_> = pixels.iter().filter_map(|p| p.hit).collect();
    assert_eq!(hits.len(), 20 * 20, "half the height of the picture each way");
    assert!(hits.iter().all(|h| (h.distance - 1.0).abs() < 1e-12));
    // Row 0 is the top one.
    let first = pixels.iter().position(|p| p.hit.is_some()).unwrap();
    assert!(pixels[first].hit.unwrap().position.y > 0.2 && pixels[first].hit.unwrap().position.x < -0.2);
}
