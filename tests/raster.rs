//! The G-buffer against an independent oracle: every pixel of several scenes is traced in f64 on the CPU
//! (crates/testing/src/raycast.rs), and what the rasteriser stored there must be the same surface, at the same place,
//! with the same normals, ids and material numbers. Pixels next to an edge of the picture's content are left to the
//! coverage test, which lets hit and miss disagree there and nowhere else.

use etalon::frame::Settings;
use etalon::plan::is_transparent;
use etalon::scene::{Camera, LoadOptions, Scene, load};
use etalon::study;
use etalon::study::generate::{at_scale, checker_plane};
use etalon::study::shape::Shape;
use etalon_testing::gpu::{Gpu, knobs, settings};
use glam::{DVec3, Vec3};
use serde_json::json;

const SIZE: [u32; 2] = [160, 90];

/// Largest errors over the pixels that are no edges, beyond what snapping of vertices explains.
#[derive(Debug, Default)]
struct Worst {
    /// Distance of positions over the size of the scene.
    position: f64,
    /// Of distances from the eye, over the size of the scene.
    distance: f64,
    /// Degrees.
    geometric: f64,
    shading: f64,
    compared: usize,
    /// Pixels whose albedo is the material's factor alone, bit for bit.
    untextured: usize,
    /// Pixels on the border of two facets.
    either: usize,
    edges: usize,
    /// Pixels where one of the two sees nothing; all of them on edges.
    coverage: usize,
}

fn degrees(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b)).to_degrees()
}

/// What the G-buffer pass draws: transparent surfaces have a pass of their own.
fn without_transparent(scene: &Scene) -> Scene {
    let mut opaque = scene.clone();
    for mesh in &mut opaque.meshes {
        if is_transparent(&scene.materials[mesh.material], false) {
            mesh.indices.clear();
        }
    }
    opaque
}

fn compare(gpu: &Gpu, scene: &Scene, camera: &Camera) -> Worst {
    compare_stored(gpu, scene, camera, &[])
}

fn compare_stored(gpu: &Gpu, scene: &Scene, camera: &Camera, stored: &[&str]) -> Worst {
    let settings = Settings { knobs: knobs(&[&["samples=1"], stored].concat()), ..settings(SIZE) };
    let (aovs, view) = gpu.renderer(scene, None, settings).aovs(camera).expect("the G-buffer");
    let opaque = without_transparent(scene);
    let oracle = etalon_testing::raycast::picture(
        &opaque,
        camera,
        SIZE[0],
        SIZE[1],
        etalon_testing::raycast::Options::default(),
    );
    let world = etalon_testing::raycast::World::new(&opaque, etalon_testing::raycast::Options::default());
    let scale = scene.bounds().expect("a scene").radius();
    let snaps = gpu.device.snap_pixels() > 0.0;
    let mut worst = Worst::default();
    for (i, (got, pixel)) in aovs.iter().zip(&oracle).enumerate() {
        let here = format!("{}: pixel {}, {}", scene.name, i as u32 % SIZE[0], i as u32 / SIZE[0]);
        worst.edges += usize::from(pixel.edge);
        if (got.material != 0) != pixel.hit.is_some() {
            assert!(pixel.edge, "{here}: one of the two sees nothing, away from any edge");
            worst.coverage += 1;
        }
        let Some(want) = pixel.hit.filter(|_| !pixel.edge) else { continue };
        let material = &scene.materials[want.material];
        assert_eq!((got.material, got.instance), (want.material as u32 + 1, want.instance as u32 + 1), "{here}: ids");
        let vector = |v: [f32; 3]| Vec3::from(v).as_dvec3();
        // The largest of numbers does not see NaN.
        let vectors = [got.p_rel, got.normal, got.geometric_normal].map(vector);
        assert!(got.distance.is_finite() && vectors.iter().all(|v| v.is_finite()), "{here}: {got:?}");
        let center = (f64::from(i as u32 % SIZE[0]) + 0.5, f64::from(i as u32 / SIZE[0]) + 0.5);
        let beside = |dx: f64, dy: f64| {
            let ray = etalon_testing::raycast::camera_ray(camera, SIZE[0], SIZE[1], center.0 + dx, center.1 + dy);
            world.closest(&ray)
        };
        // Where depth and normals are interpolated between snapped vertices, they are those of a point up to half a
        // grid step away in x and in y; a whole step, for rasterisers that do not round to the nearest.
        let step = 1.0 / 256.0;
        let near: Vec<_> = [(-step, -step), (step, -step), (-step, step), (step, step)]
            .into_iter()
            .filter(|_| snaps)
            .filter_map(|(dx, dy)| beside(dx, dy))
            .collect();
        let allowed = |of: &dyn Fn(&etalon_testing::raycast::Hit) -> f64| near.iter().map(of).fold(0.0, f64::max);
        let moved = allowed(&|hit| hit.position.distance(want.position));
        let off = (vector(got.p_rel) + view.eye).distance(want.position);
        worst.position = worst.position.max((off - moved) / scale);
        worst.distance = worst.distance.max(((f64::from(got.distance) - want.distance).abs() - moved) / scale);
        // Rasterisers snap vertices to 1/256 of a pixel, so a centre that close to the border of two facets may belong
        // to either: the nearest of the facets within 1/128 of a pixel counts.
        let normal = vector(got.geometric_normal);
        let mut angle = degrees(normal, want.geometric_normal);
        if angle > 0.02 {
            let step = 1.0 / 128.0;
            for (dx, dy) in [(-step, 0.0), (step, 0.0), (0.0, -step), (0.0, step)] {
                if let Some(beside) = beside(dx, dy) {
                    angle = angle.min(degrees(normal, beside.geometric_normal));
                }
            }
            worst.either += 1;
        }
        worst.geometric = worst.geometric.max(angle);
        if material.normal_texture.is_none() {
            let turned = allowed(&|hit| degrees(hit.shading_normal, want.shading_normal));
            worst.shading = worst.shading.max(degrees(vector(got.normal), want.shading_normal) - turned);
        }
        let [r, g, b, _] = material.base_color;
        let has_colors = !scene.meshes[scene.instances[want.instance].mesh].colors.is_empty();
        if material.base_color_texture.is_none() && !has_colors {
            // The factor, multiplied by nothing: equal bits.
            assert_eq!(got.albedo.map(f32::to_bits), [r, g, b].map(f32::to_bits), "{here}: {:?}", got.albedo);
            worst.untextured += 1;
        }
        if material.metallic_roughness_texture.is_none() {
            assert_eq!((got.metallic, got.roughness), (material.metallic, material.roughness), "{here}");
        }
        worst.compared += 1;
    }
    worst
}

/// What is promised, away from edges. Positions come from an f32 depth and an f32 ray: a few ulps of the distance,
/// which is a few scene sizes; the plane of depth through a triangle is a quotient by its area, so the slivers at a
/// ball's pole cost ten times more: 1e-5. Interpolated normals are good to f32 and stored as octahedra of 2 x 16 bits,
/// whose rounding is at most 3.7e-3 degrees (numerics.md 16). The face normal is a difference of neighbouring
/// positions: an ulp of the distance over the width of a pixel, 2^-23 / (0.7 rad / 90) = 9e-4 degrees, some of these
/// beside the octahedron's. The base colour of what has no texture is not computed with: equal bits, asserted where it
/// is seen.
fn check(worst: &Worst, name: &str) {
    eprintln!("{name}: {worst:?}");
    assert!(worst.compared * 3 > worst.edges && worst.compared > 300, "{name}: nearly nothing was compared: {worst:?}");
    assert!(worst.position < 1e-5 && worst.distance < 1e-5, "{name}: {worst:?}");
    assert!(worst.shading < 0.0045, "{name}: {worst:?}");
    assert!(worst.geometric < 0.015, "{name}: {worst:?}");
    assert!(worst.untextured > 300, "{name}: {worst:?}");
    // Both sides sample the same pixel centres; only a centre within rounding of an outline may fall to either side.
    assert!(worst.coverage <= 4, "{name}: {worst:?}");
    assert!(worst.either * 100 < worst.compared, "{name}: {worst:?}");
}

#[test]
fn the_gbuffer_of_study_scenes_agrees_with_ray_casts() {
    let gpu = Gpu::open();
    for name in ["etalon", "materials", "cornell", "metals", "lamps"] {
        let scene = study::load(name).expect("a study scene");
        check(&compare(&gpu, &scene, &scene.cameras[0]), name);
    }
}

/// Octahedra of 2 x n bits are off by at most 0.95°, 0.059° and 0.0037° (numerics.md 16), and by no less than a third
/// of that somewhere on a ball; as floats normals are as good as they are interpolated (2e-4°), and stored positions as
/// depth's.
#[test]
fn quantised_values_are_off_by_their_quantisation_error() {
    let gpu = Gpu::open();
    let scene = study::load("materials").expect("a study scene");
    let worst = |rung| compare_stored(&gpu, &scene, &scene.cameras[0], &[rung]);
    for (rung, bound) in
        [("normals=oct16", 0.96), ("normals=oct24", 0.064), ("normals=oct32", 0.0045), ("normals=f32", 5e-4)]
    {
        let found = worst(rung);
        eprintln!("{rung}: {found:?}");
        // What snapping explains is subtracted from what is found.
        let reaches = rung == "normals=f32" || gpu.device.snap_pixels() > 0.0 || found.shading > 0.3 * bound;
        assert!(found.shading < bound && reaches, "{rung}: {found:?}");
    }
    for rung in ["position=depth", "position=stored"] {
        check(&worst(rung), rung);
    }
}

/// Every pass that reads the G-buffer reads it as it is stored: pictures by rays and of the screen are the same but for
/// what the angles say. A normal off by an angle e changes a mirror's or a lobe's picture by so many e: 0.94° to 0.06°
/// is 16 times less.
#[test]
fn every_reader_knows_how_it_is_stored() {
    let gpu = Gpu::open();
    let scene = study::load("materials").expect("a study scene");
    for ways in [&["reflection=ray", "refraction=ray", "shadows=ray"][..], &["reflection=screen", "refraction=screen"]]
    {
        let draw = |rung: &str| {
            let knobs = knobs(&[&["samples=1", rung], ways].concat());
            gpu.film(&scene, Settings { knobs, ..settings(SIZE) })
        };
        let plain = draw("normals=oct32");
        let off = |rung: &str| {
            let film = draw(rung);
            let each = |(a, b): (&[f32; 4], &[f32; 4])| (0..3).map(|c| f64::from((a[c] - b[c]).abs())).sum::<f64>();
            let sum: f64 = film.rgba.iter().zip(&plain.rgba).map(each).sum();
            sum / plain.rgba.iter().map(|p| f64::from(p[0] + p[1] + p[2])).sum::<f64>()
        };
        let [oct16, oct24, f32, stored] = ["normals=oct16", "normals=oct24", "normals=f32", "position=stored"].map(off);
        eprintln!("{ways:?}: {oct16:.1e} {oct24:.1e} {f32:.1e} {stored:.1e}");
        assert!(oct16 < 0.05 && oct24 < 0.2 * oct16 && f32 < 0.2 * oct24 && stored < f32, "{ways:?}");
        assert!(oct24 > 0.0 && f32 > 0.0 && stored > 0.0, "{ways:?}: the rungs are read");
    }
}

#[test]
fn place_and_scale_do_not_matter() {
    let gpu = Gpu::open();
    let scene = study::load("materials").expect("a study scene");
    for (factor, offset) in [
        (1.0, DVec3::new(1e4, 0.0, 0.0)),
        (1.0, DVec3::new(-3e3, 1e4, 7e3)),
        (1e-3, DVec3::ZERO),
        (1e3, DVec3::ZERO),
        (1e3, DVec3::new(1e4, -1e4, 1e6)),
    ] {
        let moved = at_scale(scene.clone(), factor, offset);
        check(&compare(&gpu, &moved, &moved.cameras[0]), &format!("times {factor}, moved by {offset}"));
    }
}

#[test]
fn parallel_views_see_the_same() {
    let gpu = Gpu::open();
    for (name, half_height, eye) in
        [("etalon", 1.2, DVec3::new(3.0, 4.0, 9.0)), ("cornell", 3.0, DVec3::new(0.3, 2.9, 8.0))]
    {
        let scene = study::load(name).expect("a study scene");
        let bounds = scene.bounds().expect("a scene");
        let camera = Camera {
            projection: etalon_testing::made::orthographic(half_height),
            ..etalon_testing::made::looking(eye, bounds.center())
        };
        check(&compare(&gpu, &scene, &camera), &format!("{name}, parallel"));
    }
}

#[test]
fn mirrored_and_stretched_placements_stay_outside_out() {
    let gpu = Gpu::open();
    let mut b = etalon_testing::gltf_builder::Builder::new();
    let ball = Shape::sphere(0.5, 16);
    let position = b.floats("VEC3", ball.positions.as_flattened());
    let normal = b.floats("VEC3", ball.normals.as_flattened());
    let indices = b.indices(&ball.indices.iter().map(|&i| i as u16).collect::<Vec<_>>());
    let primitive = |material: usize| json!({ "attributes": { "POSITION": position, "NORMAL": normal }, "indices": indices, "material": material });
    for (index, double_sided) in [false, true].into_iter().enumerate() {
        let base = [0.3 + 0.1 * index as f64, 0.7, 1.0 / 3.0, 1.0];
        let pbr = json!({ "baseColorFactor": base, "roughnessFactor": 0.37, "metallicFactor": 0.21 });
        let material = json!({ "pbrMetallicRoughness": pbr, "doubleSided": double_sided });
        b.push("materials", material);
        b.mesh(primitive(index));
    }
    let turn = json!([0.182_574_19, 0.365_148_37, 0.547_722_56, 0.730_296_74]);
    for (i, scale) in
        [[1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [2.0, 0.5, -1.3], [-0.4, -1.6, -1.0], [1.0, -1.0, 1.4], [0.2, 1.7, 1.0]]
            .into_iter()
            .enumerate()
    {
        let translation = [(i % 3) as f64 * 2.2 - 2.2, (i / 3) as f64 * 2.0 - 1.0, 0.0];
        // One mirrored parent of a mirrored child: two wrongs make a right.
        let child = b.push("nodes", json!({ "mesh": i % 2, "scale": scale, "rotation": turn }));
        let parent = if i == 3 { [1.0, -1.2, 1.0] } else { [1.0, 1.0, 1.0] };
        b.root(json!({ "children": [child], "translation": translation, "scale": parent }));
    }
    let folder = tempfile::tempdir().expect("a folder");
    let scene = load(&b.save_glb(folder.path()), &LoadOptions::default()).expect("a scene");
    assert_eq!(scene.instances.len(), 6);
    let camera = etalon_testing::made::looking(DVec3::new(1.0, 2.0, 9.0), DVec3::ZERO);
    check(&compare(&gpu, &scene, &camera), "mirrored");
    // From the other side too: a wrong winding shows at one of the two at least.
    let camera = etalon_testing::made::looking(DVec3::new(-2.0, -1.0, -9.0), DVec3::ZERO);
    check(&compare(&gpu, &scene, &camera), "mirrored, from behind");
}

#[test]
fn edges_between_triangles_do_not_show_in_a_texture() {
    let gpu = Gpu::open();
    let coarse = checker_plane(20.0, 10.0);
    let camera = &coarse.cameras[0];
    let oracle = etalon_testing::raycast::picture(
        &coarse,
        camera,
        SIZE[0],
        SIZE[1],
        etalon_testing::raycast::Options::default(),
    );
    let (want, _) = gpu.renderer(&coarse, None, settings(SIZE)).aovs(camera).expect("the G-buffer");
    for cells in [7, 64, 150] {
        let mut fine = coarse.clone();
        let shape = Shape::plane(20.0, 20.0, cells).repeat_uv(10.0, 10.0);
        fine.meshes[0].positions = shape.positions.into();
        fine.meshes[0].normals = shape.normals.into();
        fine.meshes[0].uvs[0] = shape.uvs.into();
        fine.meshes[0].indices = shape.indices.into();
        let (got, _) = gpu.renderer(&fine, None, settings(SIZE)).aovs(camera).expect("the G-buffer");
        let (mut seen, mut most) = (0, 0.0_f32);
        for ((got, want), pixel) in got.iter().zip(&want).zip(&oracle) {
            if pixel.edge || pixel.hit.is_none() {
                continue;
            }
            seen += 1;
            assert_eq!(got.material, want.material);
            for (a, b) in got.albedo.into_iter().zip(want.albedo) {
                most = most.max((a - b).abs());
            }
        }
        eprintln!("{cells} cells a side: {most:e} over {seen} pixels");
        assert!(seen > 3000, "{seen} pixels");
        // lavapipe weighs texels and levels with 8 bits: a step of 1/256 of the contrast (0.88) in each of u, v and
        // level.
        assert!(most < 3.0 * 0.88 / 256.0, "{cells} cells a side: {most:e}");
    }
}

/// Tangent-space normals on a double-sided face: (T x + B y + N z) from the front, and all of it reversed from behind
/// (glTF 2.0, double sided): a bump seen from behind is a dent.
#[test]
fn a_mapped_normal_is_reversed_as_a_whole_from_behind() {
    use etalon::scene::{Image, Material, Sampler, TextureRef};
    let gpu = Gpu::open();
    let mut made = etalon_testing::made::Made::new("bumps");
    let texel = [192_u8, 160, 230, 255];
    made.0.images.push(Image { name: "tilt".to_owned(), width: 1, height: 1, rgba: texel.to_vec().into() });
    let texture =
        TextureRef { image: 0, uv_set: 0, uv_transform: glam::Affine2::IDENTITY, sampler: Sampler::default() };
    let material = Material { normal_texture: Some(texture), double_sided: true, ..Material::default() };
    made.add(Shape::panel(8.0, 8.0), material, glam::DAffine3::IDENTITY);
    let corners = made.0.meshes[0].positions.len();
    made.0.meshes[0].tangents = vec![[1.0, 0.0, 0.0, 1.0]; corners].into();
    made.camera(DVec3::Z * 5.0, DVec3::ZERO, etalon_testing::made::perspective(40.0));
    made.camera(DVec3::NEG_Z * 5.0, DVec3::ZERO, etalon_testing::made::perspective(40.0));
    let expected = DVec3::from_array([0, 1, 2].map(|c| f64::from(texel[c]) / 255.0 * 2.0 - 1.0)).normalize();
    for (camera, sign) in [(0, 1.0), (1, -1.0)] {
        let mut renderer = gpu.renderer(&made.0, None, settings([16, 16]));
        let (aovs, _) = renderer.aovs(&made.0.cameras[camera]).expect("AOVs");
        let seen = Vec3::from(aovs[8 * 16 + 8].normal).as_dvec3();
        // Octahedral 2x16 bits: 3.7e-3 degrees are 6.5e-5.
        assert!((seen - expected * sign).length() < 1e-4, "camera {camera}: {seen} is not {}", expected * sign);
    }
}
