//! What a glTF or OBJ file says is what the scene holds: each feature against numbers worked out by hand.
#![allow(clippy::unwrap_used, reason = "a test may stop where it stands")]

use std::{f64::consts::FRAC_PI_2, fs, path::Path};

use etalon::scene::{self, AlphaMode, AmbientLight, LightKind, LoadOptions, Projection, Prune, Scene, Wrap};
use etalon::spectra::{Dispersion, Spectrum};
use etalon_testing::gltf_builder::{
    BYTE, Builder, FLOAT, SHORT, UNSIGNED_BYTE, UNSIGNED_INT, UNSIGNED_SHORT, f32s, png, u16s,
};
use glam::{DVec3, Vec2, Vec3};
use serde_json::json;

fn load_at(builder: &Builder, time: Option<f64>) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let path = builder.save_glb(folder.path());
    scene::load(&path, &LoadOptions { time, ..LoadOptions::default() }).unwrap_or_else(|e| panic!("{e:#}"))
}

fn load(builder: &Builder) -> Scene {
    load_at(builder, None)
}

fn sentence(builder: &Builder) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = builder.save_glb(folder.path());
    format!("{:#}", scene::load(&path, &LoadOptions::default()).expect_err("the file should be refused"))
}

/// World positions of all corners of all triangles, in drawing order.
fn corners(scene: &Scene) -> Vec<DVec3> {
    let placed = scene.instances.iter().flat_map(|instance| {
        let mesh = &scene.meshes[instance.mesh];
        mesh.indices
            .iter()
            .map(|&i| instance.world_from_object.transform_point3(Vec3::from(mesh.positions[i as usize]).as_dvec3()))
    });
    placed.collect()
}

#[track_caller]
fn assert_close(found: &[DVec3], expected: &[[f64; 3]], tolerance: f64) {
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for (f, e) in found.iter().zip(expected) {
        assert!((*f - DVec3::from(*e)).abs().max_element() <= tolerance, "{found:?} is not {expected:?}");
    }
}

const TRIANGLE: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

fn one_triangle() -> Builder {
    let mut b = Builder::new();
    let position = b.triangle();
    let mesh = b.mesh(json!({ "attributes": { "POSITION": position } }));
    b.root(json!({ "mesh": mesh }));
    b
}

#[test]
fn a_plain_triangle_gets_flat_normals_and_the_default_material() {
    let scene = load(&one_triangle());
    assert_close(&corners(&scene), &TRIANGLE, 0.0);
    assert_eq!(scene.meshes[0].normals, [[0.0, 0.0, 1.0]; 3]);
    assert_eq!(scene.materials.len(), 1);
    assert_eq!((scene.materials[0].metallic, scene.materials[0].roughness), (1.0, 1.0));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert!(scene.meshes[0].tangents.is_empty() && scene.meshes[0].colors.is_empty());
}

#[test]
fn buffers_come_from_data_uris_and_percent_encoded_files() {
    let b = one_triangle();
    let folder = tempfile::tempdir().unwrap();
    let scene = scene::load(&b.save_gltf(folder.path(), &b.data_uri()), &LoadOptions::default()).unwrap();
    assert_close(&corners(&scene), &TRIANGLE, 0.0);
    fs::create_dir(folder.path().join("a b")).unwrap();
    fs::write(folder.path().join("a b/ü.bin"), &b.bytes).unwrap();
    let path = b.save_gltf(folder.path(), "a%20b/%C3%BC.bin");
    let upper = folder.path().join("SCENE.GLTF");
    fs::rename(path, &upper).unwrap();
    assert_close(&corners(&scene::load(&upper, &LoadOptions::default()).unwrap()), &TRIANGLE, 0.0);
}

#[test]
fn indices_of_every_width_are_read() {
    let as_u8 = [2_u8, 0, 1].to_vec();
    let as_u32: Vec<u8> = [2_u32, 0, 1].iter().flat_map(|i| i.to_le_bytes()).collect();
    for (bytes, component) in [(as_u8, UNSIGNED_BYTE), (u16s(&[2, 0, 1]), UNSIGNED_SHORT), (as_u32, UNSIGNED_INT)] {
        let mut b = Builder::new();
        let position = b.triangle();
        let indices = b.accessor(&bytes, component, "SCALAR", 3);
        let mesh = b.mesh(json!({ "attributes": { "POSITION": position }, "indices": indices }));
        b.root(json!({ "mesh": mesh }));
        assert_close(&corners(&load(&b)), &[TRIANGLE[2], TRIANGLE[0], TRIANGLE[1]], 0.0);
    }
}

#[test]
fn interleaved_attributes_share_a_strided_view() {
    let mut b = Builder::new();
    // Position, normal, then four bytes nobody reads.
    let mut bytes = Vec::new();
    for p in TRIANGLE {
        bytes.extend(f32s(&p.map(|x| x as f32)));
        bytes.extend(f32s(&[0.0, 0.0, -1.0]));
        bytes.extend([0xff; 4]);
    }
    let view = b.view(&bytes, Some(28));
    let at = |offset: usize| json!({ "bufferView": view, "byteOffset": offset, "componentType": FLOAT, "type": "VEC3", "count": 3 });
    let position = b.push("accessors", at(0));
    let normal = b.push("accessors", at(12));
    let mesh = b.mesh(json!({ "attributes": { "POSITION": position, "NORMAL": normal } }));
    b.root(json!({ "mesh": mesh }));
    let scene = load(&b);
    assert_close(&corners(&scene), &TRIANGLE, 0.0);
    assert_eq!(scene.meshes[0].normals, [[0.0, 0.0, -1.0]; 3]);
}

#[test]
fn sparse_accessors_replace_elements_of_a_view_or_of_zeros() {
    for with_base in [true, false] {
        let mut b = Builder::new();
        let base = b.view(&f32s(&[9.0; 9]), None);
        let indices = b.view(&u16s(&[0, 2]), None);
        let values = b.view(&f32s(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), None);
        let mut accessor = json!({ "componentType": FLOAT, "type": "VEC3", "count": 3, "sparse": {
            "count": 2,
            "indices": { "bufferView": indices, "componentType": UNSIGNED_SHORT },
            "values": { "bufferView": values },
        }});
        if with_base {
            accessor["bufferView"] = base.into();
        }
        let position = b.push("accessors", accessor);
        let mesh = b.mesh(json!({ "attributes": { "POSITION": position } }));
        b.root(json!({ "mesh": mesh }));
        let middle = if with_base { [9.0; 3] } else { [0.0; 3] };
        assert_close(&corners(&load(&b)), &[[1.0, 2.0, 3.0], middle, [4.0, 5.0, 6.0]], 0.0);
    }
}

#[test]
fn quantised_attributes_keep_integers_or_become_fractions() {
    // Signed normalised numbers are max(c / (2^(n-1) - 1), -1): -128 and -127 are both -1.
    let cases: [(u32, bool, Vec<u8>, [f64; 3]); 8] = [
        (BYTE, true, vec![0x80, 127, 64], [-1.0, 1.0, 64.0 / 127.0]),
        (BYTE, false, vec![0x80, 127, 64], [-128.0, 127.0, 64.0]),
        (UNSIGNED_BYTE, true, vec![0, 255, 51], [0.0, 1.0, 0.2]),
        (UNSIGNED_BYTE, false, vec![0, 255, 51], [0.0, 255.0, 51.0]),
        (SHORT, true, u16s(&[0x8000, 0x7fff, 0x4000]), [-1.0, 1.0, 16384.0 / 32767.0]),
        (SHORT, false, u16s(&[0x8000, 0x7fff, 0x4000]), [-32768.0, 32767.0, 16384.0]),
        (UNSIGNED_SHORT, true, u16s(&[0, 65535, 13107]), [0.0, 1.0, 0.2]),
        (UNSIGNED_SHORT, false, u16s(&[0, 65535, 13107]), [0.0, 65535.0, 13107.0]),
    ];
    for (component, normalized, bytes, expected) in cases {
        let mut b = Builder::new();
        b.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
        b.json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
        // One vertex carries the case, two make a triangle of it; each vertex is padded to four or eight bytes.
        let stride = bytes.len().next_multiple_of(4);
        let mut all = bytes.clone();
        all.resize(stride, 0xee);
        let one = bytes.len() / 3;
        all.extend(vec![0; stride]);
        let mut third = vec![0; stride];
        third[one] = 1;
        all.extend(third);
        let view = b.view(&all, Some(stride));
        let position = b.push("accessors", json!({ "bufferView": view, "componentType": component, "type": "VEC3", "count": 3, "normalized": normalized }));
        let mesh = b.mesh(json!({ "attributes": { "POSITION": position } }));
        b.root(json!({ "mesh": mesh }));
        let found = corners(&load(&b))[0];
        assert!(
            (found - DVec3::from(expected)).abs().max_element() < 1e-7 * 65536.0_f64.min(expected[1].max(1.0)),
            "{component} {normalized}: {found}"
        );
    }
}

#[test]
fn quantised_normals_and_coordinates_and_colours_are_read() {
    let mut b = Builder::new();
    let position = b.triangle();
    let normal = b.view(&[0, 0, 127, 0].repeat(3), Some(4));
    let normal = b.push(
        "accessors",
        json!({ "bufferView": normal, "componentType": BYTE, "type": "VEC3", "count": 3, "normalized": true }),
    );
    let uv = b.view(&u16s(&[0, 65535, 13107, 26214, 0, 0]), None);
    let uv = b.push(
        "accessors",
        json!({ "bufferView": uv, "componentType": UNSIGNED_SHORT, "type": "VEC2", "count": 3, "normalized": true }),
    );
    let color = b.view(&[255, 0, 51, 99].repeat(3), Some(4));
    let color = b.push(
        "accessors",
        json!({ "bufferView": color, "componentType": UNSIGNED_BYTE, "type": "VEC3", "count": 3, "normalized": true }),
    );
    let uv1 = b.floats("VEC2", &[5.0, 6.0, 7.0, 8.0, 9.0, 10.0]);
    let attributes = json!({ "POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv, "TEXCOORD_1": uv1, "COLOR_0": color, "_MINE": position });
    let mesh = b.mesh(json!({ "attributes": attributes }));
    b.root(json!({ "mesh": mesh }));
    let scene = load(&b);
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.normals, [[0.0, 0.0, 1.0]; 3]);
    assert_eq!(mesh.uvs[0], [[0.0, 1.0], [0.2, 0.4], [0.0, 0.0]]);
    assert_eq!(mesh.uvs[1], [[5.0, 6.0], [7.0, 8.0], [9.0, 10.0]]);
    assert_eq!(mesh.colors, [[1.0, 0.0, 0.2, 1.0]; 3]);
}

#[test]
fn strips_and_fans_turn_all_their_triangles_the_same_way() {
    // A strip of a 2 x 1 quad row and a fan around a corner, all counter-clockwise seen from +Z.
    let strip = [0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 0.0, 2.0, 1.0, 0.0];
    let fan = [0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 2.0, 1.0, 0.0, 1.0, 2.0, 0.0, 0.0, 1.0, 0.0];
    for (mode, positions) in [(5, strip), (6, fan)] {
        let mut b = Builder::new();
        let position = b.floats("VEC3", &positions);
        let mesh = b.mesh(json!({ "attributes": { "POSITION": position }, "mode": mode }));
        b.root(json!({ "mesh": mesh }));
        let scene = load(&b);
        assert_eq!(scene.triangles(), 3);
        assert!(
            scene.meshes[0].normals.iter().all(|n| *n == [0.0, 0.0, 1.0]),
            "mode {mode}: {:?}",
            scene.meshes[0].normals
        );
    }
}

#[test]
fn points_and_lines_become_thin_meshes_that_scale_with_the_scene() {
    let square = [0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 3.0, 4.0, 0.0, 0.0, 4.0, 0.0];
    for (mode, bodies, triangles) in [(0, 4, 8), (1, 2, 12), (2, 4, 12), (3, 3, 12)] {
        for scale in [1.0, 100.0] {
            let mut b = Builder::new();
            let position = b.floats("VEC3", &square);
            let mesh = b.mesh(json!({ "attributes": { "POSITION": position }, "mode": mode }));
            b.root(json!({ "mesh": mesh, "scale": [scale, scale, scale] }));
            let scene = load(&b);
            assert_eq!(scene.triangles(), bodies * triangles, "mode {mode}");
            let bounds = scene.bounds().unwrap();
            // Half-thickness is 0.002 of the diagonal of 5; a box turned by an eighth shows 1/√2 of it, 0.00707.
            let stick_out = -bounds.min.min_element() / scale;
            assert!((0.00707..=0.01001).contains(&stick_out), "mode {mode}: {stick_out}");
            assert!((bounds.max - DVec3::new(3.0, 4.0, 0.0) * scale).abs().max_element() <= 0.01001 * scale);
        }
    }
}

#[test]
fn transforms_chain_in_f64_and_keep_mirroring() {
    let mut b = one_triangle();
    // 10 000 km away and back: f32 would leave nothing of the millimetres.
    b.json["nodes"] = json!([
        { "translation": [1.0e7, 0.0, 0.0], "children": [1] },
        { "translation": [-1.0e7, 0.001, 0.0], "rotation": [0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2], "children": [2, 3] },
        { "mesh": 0, "scale": [-2.0, 1.0, 3.0], "name": "mirrored" },
        { "mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1] },
    ]);
    b.json["scenes"] = json!([{ "nodes": [0] }]);
    let scene = load(&b);
    assert_eq!(scene.meshes.len(), 1, "nodes share the geometry");
    assert_eq!(scene.instances.len(), 2);
    assert_eq!(scene.instances[0].name, "mirrored");
    assert!(scene.instances[0].world_from_object.matrix3.determinant() < 0.0);
    // A quarter turn about Z takes (x, y) to (-y, x).
    assert_close(
        &corners(&scene),
        &[
            [0.0, 0.001, 0.0],
            [0.0, -1.999, 0.0],
            [-1.0, 0.001, 0.0],
            [-6.0, 5.001, 7.0],
            [-6.0, 6.001, 7.0],
            [-7.0, 5.001, 7.0],
        ],
        1e-6,
    );
}

#[test]
fn the_scene_shown_is_the_default_the_first_or_all_roots() {
    let mut b = one_triangle();
    b.json["nodes"] = json!([{ "mesh": 0 }, { "children": [2] }, { "mesh": 0 }, { "mesh": 0 }]);
    b.json["scenes"] = json!([{ "nodes": [1] }, { "nodes": [0, 1] }]);
    assert_eq!(load(&b).instances.len(), 1);
    b.json["scene"] = 1.into();
    assert_eq!(load(&b).instances.len(), 2);
    b.json.as_object_mut().unwrap().retain(|k, _| !k.starts_with("scene"));
    assert_eq!(load(&b).instances.len(), 3);
}

#[test]
fn cameras_lose_scale_and_mirroring_but_not_their_view() {
    let mut b = one_triangle();
    b.push("cameras", json!({ "type": "perspective", "name": "eye", "perspective": { "yfov": 0.5, "znear": 0.25 } }));
    b.push(
        "cameras",
        json!({ "type": "orthographic", "orthographic": { "xmag": 3, "ymag": 2, "znear": 0, "zfar": 9 } }),
    );
    let half = std::f64::consts::FRAC_1_SQRT_2;
    // A quarter turn about Y: the view goes along -X.
    b.root(json!({ "camera": 0, "translation": [1, 2, 3], "rotation": [0, half, 0, half], "scale": [2, -3, 4] }));
    b.root(json!({ "camera": 1 }));
    let scene = load(&b);
    let [eye, flat] = &scene.cameras[..] else { panic!("{:?}", scene.cameras) };
    assert_eq!(eye.name, "eye");
    assert_eq!(eye.projection, Projection::Perspective { fov_y: f64::from(0.5_f32), near: Some(0.25) });
    assert_eq!(flat.projection, Projection::Orthographic { half_height: 2.0, near: 0.0, far: 9.0 });
    let m = eye.world_from_camera;
    assert_eq!(m.translation, DVec3::new(1.0, 2.0, 3.0));
    let axes = [m.matrix3.x_axis, m.matrix3.y_axis, -m.matrix3.z_axis];
    assert_close(&axes, &[[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0]], 1e-7);
    assert!((m.matrix3.determinant() - 1.0).abs() < 1e-12);
}

#[test]
fn lights_stand_in_the_world_with_their_strength() {
    let mut b = one_triangle();
    b.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    b.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [
        { "type": "directional", "intensity": 3, "color": [1, 0.5, 0] },
        { "type": "point", "range": 7, "name": "bulb" },
        { "type": "spot", "intensity": 2, "spot": { "innerConeAngle": 0.25, "outerConeAngle": 0.5 } },
        { "type": "spot", "spot": { "innerConeAngle": 1.0, "outerConeAngle": 0.5 } },
    ]}});
    let at = |light: usize| json!({ "KHR_lights_punctual": { "light": light } });
    let half = std::f64::consts::FRAC_1_SQRT_2;
    for light in 0..4 {
        b.root(json!({
            "extensions": at(light), "translation": [1, 2, 3], "scale": [9, 9, 9],
            // A quarter turn about X takes -Z to +Y.
            "rotation": [half, 0, 0, half],
        }));
    }
    let scene = load(&b);
    assert_eq!(scene.lights[0].color, [3.0, 1.5, 0.0]);
    let place = DVec3::new(1.0, 2.0, 3.0);
    let LightKind::Directional { direction } = scene.lights[0].kind else { panic!() };
    assert_close(&[direction], &[[0.0, 1.0, 0.0]], 1e-7);
    assert_eq!(scene.lights[1].name, "bulb");
    assert_eq!(scene.lights[1].kind, LightKind::Point { position: place, range: Some(7.0) });
    let LightKind::Spot { position, direction, range, inner, outer } = scene.lights[2].kind else { panic!() };
    assert_eq!((position, range, inner, outer), (place, None, 0.25, 0.5));
    assert_close(&[direction], &[[0.0, 1.0, 0.0]], 1e-7);
    let LightKind::Spot { inner, outer, .. } = scene.lights[3].kind else { panic!() };
    assert!(inner < outer && outer == 0.5);
    assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
}

/// A triangle with texture coordinates and normals under a material.
fn textured(material: serde_json::Value, extensions: &[&str]) -> Builder {
    let mut b = Builder::new();
    let position = b.triangle();
    let normal = b.floats("VEC3", &[0.0, 0.0, 1.0].repeat(3));
    // v points down, as in glTF: (0, 1) is the lower left corner of the picture.
    let uv = b.floats("VEC2", &[0.0, 1.0, 1.0, 1.0, 0.0, 0.0]);
    b.push("materials", material);
    let mesh =
        b.mesh(json!({ "attributes": { "POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv }, "material": 0 }));
    b.root(json!({ "mesh": mesh }));
    for (i, color) in [[255, 0, 0, 255], [0, 255, 0, 128]].into_iter().enumerate() {
        let view = b.view(&png(2 + i as u32, 1, color), None);
        // The type is a lie; the bytes decide.
        b.push("images", json!({ "bufferView": view, "mimeType": "image/jpeg" }));
        b.push("textures", json!({ "source": i, "sampler": i }));
    }
    b.push("samplers", json!({ "wrapS": 33071, "wrapT": 33648, "magFilter": 9728, "minFilter": 9729 }));
    b.push("samplers", json!({ "minFilter": 9728 }));
    b.json["extensionsUsed"] = json!(extensions);
    b
}

#[test]
fn every_material_field_is_read() {
    let names = [
        "KHR_materials_clearcoat",
        "KHR_materials_dispersion",
        "KHR_materials_emissive_strength",
        "KHR_materials_ior",
        "KHR_materials_specular",
        "KHR_materials_transmission",
        "KHR_materials_unlit",
        "KHR_materials_volume",
    ];
    let mut b = textured(
        json!({
            "name": "all",
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5, "roughnessFactor": 0.6,
                "baseColorTexture": { "index": 1 }, "metallicRoughnessTexture": { "index": 0 },
            },
            "normalTexture": { "index": 0, "scale": 0.7 },
            "occlusionTexture": { "index": 0, "strength": 0.8 },
            "emissiveFactor": [0.5, 1.0, 0.25], "emissiveTexture": { "index": 0 },
            "alphaMode": "MASK", "alphaCutoff": 0.3, "doubleSided": true,
            "extensions": {
                "KHR_materials_clearcoat": { "clearcoatFactor": 0.9, "clearcoatTexture": { "index": 0 },
                    "clearcoatRoughnessFactor": 0.15, "clearcoatRoughnessTexture": { "index": 1 }, "clearcoatNormalTexture": { "index": 0 } },
                "KHR_materials_dispersion": { "dispersion": 0.35 },
                "KHR_materials_emissive_strength": { "emissiveStrength": 8 },
                "KHR_materials_ior": { "ior": 1.33 },
                "KHR_materials_specular": { "specularFactor": 0.45, "specularTexture": { "index": 0 },
                    "specularColorFactor": [0.1, 1.0, 2.0], "specularColorTexture": { "index": 1 } },
                "KHR_materials_transmission": { "transmissionFactor": 0.55, "transmissionTexture": { "index": 0 } },
                "KHR_materials_unlit": {},
                "KHR_materials_volume": { "thicknessFactor": 0.65, "thicknessTexture": { "index": 0 },
                    "attenuationDistance": 4, "attenuationColor": [0.2, 0.3, 0.4] },
            },
        }),
        &names,
    );
    b.json["extensionsRequired"] = json!(names);
    let scene = load(&b);
    let m = &scene.materials[0];
    assert_eq!(m.name, "all");
    assert_eq!((m.base_color, m.metallic, m.roughness), ([0.1, 0.2, 0.3, 0.4], 0.5, 0.6));
    assert_eq!((m.normal_scale, m.occlusion_strength), (0.7, 0.8));
    assert_eq!(m.emissive, [4.0, 8.0, 2.0]);
    assert_eq!((m.alpha_mode, m.double_sided, m.unlit), (AlphaMode::Mask(0.3), true, true));
    assert_eq!((m.ior, m.specular, m.specular_color), (1.33, 0.45, [0.1, 1.0, 2.0]));
    assert_eq!((m.transmission, m.thickness, m.attenuation_distance), (0.55, 0.65, 4.0));
    assert_eq!((m.attenuation_color, m.dispersion), ([0.2, 0.3, 0.4], Dispersion::Abbe(f64::from(0.35_f32))));
    assert_eq!((m.clearcoat, m.clearcoat_roughness), (0.9, 0.15));
    let present = [
        m.base_color_texture,
        m.metallic_roughness_texture,
        m.normal_texture,
        m.occlusion_texture,
        m.emissive_texture,
        m.specular_texture,
        m.specular_color_texture,
        m.transmission_texture,
        m.thickness_texture,
        m.clearcoat_texture,
        m.clearcoat_roughness_texture,
        m.clearcoat_normal_texture,
    ];
    let widths: Vec<u32> = present.iter().map(|t| scene.images[t.unwrap().image].width).collect();
    assert_eq!(widths, [3, 2, 2, 2, 2, 2, 3, 2, 2, 2, 3, 2]);
    let green = &scene.images[m.base_color_texture.unwrap().image];
    assert_eq!((green.height, &green.rgba[..4]), (1, &[0, 255, 0, 128][..]));
    let (a, b) = (m.normal_texture.unwrap().sampler, m.base_color_texture.unwrap().sampler);
    assert_eq!(
        (a.wrap_u, a.wrap_v, a.mag_nearest, a.min_nearest, a.mips),
        (Wrap::Clamp, Wrap::Mirror, true, false, true)
    );
    assert_eq!(
        (b.wrap_u, b.wrap_v, b.mag_nearest, b.min_nearest, b.mips),
        (Wrap::Repeat, Wrap::Repeat, false, true, false)
    );
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn only_pictures_of_materials_are_decoded_and_out_of_range_factors_are_reported() {
    let scene = load(&textured(
        json!({ "pbrMetallicRoughness": { "metallicFactor": 1.5, "baseColorTexture": { "index": 1 } },
                "extensions": { "KHR_materials_ior": { "ior": 0 } } }),
        &["KHR_materials_ior", "VENDOR_sparkle"],
    ));
    assert_eq!(scene.images.len(), 1);
    assert_eq!(scene.materials[0].metallic, 1.0);
    let n = scene.materials[0].ior;
    assert!(((n - 1.0) / (n + 1.0)).powi(2) > 0.99999, "an index of 0 reflects everything");
    assert_eq!(scene.warnings.len(), 3, "{:?}", scene.warnings);
    assert!(scene.warnings[0].starts_with("scene.glb: ") && scene.warnings[0].contains("VENDOR_sparkle"));
}

/// One triangle under a material with this in `extras.etalon`, and with these extensions.
fn with_etalon(etalon: serde_json::Value, extensions: serde_json::Value) -> Builder {
    let material = json!({ "name": "odd", "extensions": extensions, "extras": { "other": [1], "etalon": etalon } });
    textured(material, &["KHR_materials_ior", "KHR_materials_transmission"])
}

#[test]
fn presets_carry_the_indices_of_their_substance() {
    // n_d of the catalogues, and F0 as published beside the tables of the metals.
    for (name, n) in [("water", 1.333), ("bk7", 1.5168), ("sf10", 1.728_25), ("diamond", 2.4175)] {
        let m = &load(&with_etalon(json!({ "preset": name }), json!({}))).materials[0];
        assert_eq!((m.ior, m.conductor, m.base_color), (n, None, [1.0; 4]), "{name}");
    }
    for (name, f0) in [
        ("gold", [0.953, 0.674, 0.408]),
        ("silver", [0.989, 0.983, 0.980]),
        ("copper", [0.931, 0.597, 0.533]),
        ("aluminium", [0.906, 0.917, 0.922]),
    ] {
        let scene = load(&with_etalon(json!({ "preset": name }), json!({})));
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        let m = &scene.materials[0];
        let index = m.conductor.unwrap();
        for c in 0..3 {
            let [n, k] = index[c];
            let reflectance = ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k);
            assert!((reflectance - f0[c]).abs() < 1e-3 && (m.base_color[c] - f0[c]).abs() < 1e-3, "{name}: {m:?}");
        }
        assert_eq!((m.metallic, m.ior), (1.0, 1.5), "{name}");
    }
}

#[test]
fn etalon_extras_are_read_into_the_material() {
    let m = &load(&with_etalon(json!({ "priority": -3, "n": 1.25 }), json!({}))).materials[0];
    assert_eq!((m.priority, m.ior, m.conductor), (-3, 1.25, None));
    let metal = json!({ "n": [0.5, 2, 4], "kappa": 0.25 });
    let m = &load(&with_etalon(metal, json!({}))).materials[0];
    assert_eq!(m.conductor, Some([[0.5, 0.25], [2.0, 0.25], [4.0, 0.25]]));
    // (n, κ) = (4, 0.25): (9 + 1/16) / (25 + 1/16).
    assert!((m.base_color[2] - 145.0 / 401.0).abs() < 1e-6, "{:?}", m.base_color);
    // Numbers beside a preset replace its own, and a kappa of 0 makes no metal.
    let m = &load(&with_etalon(json!({ "preset": "gold", "kappa": [3, 2, 1] }), json!({}))).materials[0];
    assert_eq!(m.conductor, Some([[0.1635, 3.0], [0.5828, 2.0], [1.4022, 1.0]]));
    let m = &load(&with_etalon(json!({ "preset": "water", "n": 1.34 }), json!({}))).materials[0];
    assert_eq!((m.ior, m.conductor), (1.34, None));
    let m = &load(&with_etalon(json!({ "n": [1.4, 1.4, 1.4], "kappa": 0 }), json!({}))).materials[0];
    assert_eq!((m.ior, m.conductor), (1.4, None));
    let transmission = json!({ "KHR_materials_transmission": { "transmissionFactor": 0.5 } });
    let scene = load(&with_etalon(json!({ "preset": "diamond", "priority": 7 }), transmission));
    assert_eq!((scene.materials[0].ior, scene.materials[0].priority), (2.4175, 7));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    // Materials that say nothing of it.
    for extras in [json!(5), json!("etalon"), json!([{ "etalon": 1 }]), json!({}), json!({ "etalon": null })] {
        let scene = load(&textured(json!({ "extras": extras }), &[]));
        assert_eq!((scene.materials[0].priority, scene.materials[0].conductor), (0, None));
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    }
}

#[test]
fn etalon_extras_describe_spectra() {
    let one = |etalon: serde_json::Value| {
        let mut b = with_etalon(etalon, json!({}));
        b.json["materials"][0]["emissiveFactor"] = json!([1, 1, 1]);
        let scene = load(&b);
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        scene.materials[0].clone()
    };
    let m = one(json!({ "preset": "sf10" }));
    assert!((m.dispersion.index(1.0, 444.44) - 1.758_835).abs() < 1e-5 && m.ior == 1.728_25);
    assert!(matches!(one(json!({ "preset": "water", "n": 1.4 })).dispersion, Dispersion::None));
    let m = one(json!({ "sellmeier": { "b": [1.5], "c": [0.01] } }));
    let n = |nm: f64| (1.0 + 1.5 * (nm * 1e-3).powi(2) / ((nm * 1e-3).powi(2) - 0.01)).sqrt();
    assert!((m.dispersion.index(1.0, 500.0) - n(500.0)).abs() < 1e-12 && (f64::from(m.ior) - n(587.5618)).abs() < 1e-7);
    let m = one(json!({ "cauchy": [1.5, 0.004] }));
    assert!((m.dispersion.index(1.0, 500.0) - 1.516).abs() < 1e-12);
    let m = one(json!({ "reflectance": { "table": [[400, 0.1], [700, 0.7]] } }));
    assert!(m.reflectance.as_ref().is_some_and(|s| (s.at(500.0) - 0.3).abs() < 1e-12));
    assert!(m.base_color[0] > m.base_color[2], "more red than blue: {:?}", m.base_color);
    let m = one(json!({ "preset": "copper" }));
    assert!(m.conductor_spectra.is_some());
    assert!(one(json!({ "preset": "copper", "kappa": 2 })).conductor_spectra.is_none());
    for (emission, spectrum) in
        [(json!("a"), Spectrum::IlluminantA), (json!({ "blackbody": 3000 }), Spectrum::BlackBody(3000.0))]
    {
        let m = one(json!({ "emission": emission }));
        let emission = m.emission.expect("an emission");
        assert_eq!(emission.spectrum, spectrum);
        assert!((emission.luminance - 1.0).abs() < 1e-6 && m.emissive[0] > m.emissive[2]);
    }
    // Lights, too.
    let mut b = textured(json!({}), &[]);
    b.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    b.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [
        { "type": "point", "intensity": 4, "extras": { "etalon": { "spectrum": { "table": [[500, 1], [510, 3]] }, "b": 1 } } }] } });
    b.root(json!({ "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
    let scene = load(&b);
    let emission = scene.lights[0].spectrum.clone().expect("a spectrum");
    assert!((emission.luminance - 4.0).abs() < 1e-6);
    assert_eq!([499.0, 505.0, 511.0].map(|nm| emission.spectrum.at(nm)), [0.0, 2.0, 0.0]);
    assert_eq!(scene.warnings.len(), 1);
    assert!(
        scene.warnings[0].ends_with("extras.etalon of a light has no key \"b\"; it is ignored"),
        "{:?}",
        scene.warnings
    );
}

#[test]
fn impossible_spectra_are_reported_by_name() {
    for (etalon, said) in [
        (json!({ "emission": "sun" }), "\"sun\" is no illuminant; these are: a, d65, e, f2, f11"),
        (json!({ "emission": { "blackbody": 20 } }), "a black body of 20 K"),
        (json!({ "emission": { "table": [[500, 1], [500, 2]] } }), "500 nm comes before 500 nm"),
        (json!({ "emission": { "table": [[500, -1], [510, 1]] } }), "the value at 500 nm, -1, is negative"),
        (json!({ "emission": { "table": [] } }), "0 rows"),
        (json!({ "preset": "gold", "reflectance": { "table": [[400, 1], [500, 1]] } }), "one of them tells the base"),
        (json!({ "emission": { "table": [[100, 1], [200, 1]] } }), "no light between 380 and 780 nm"),
        (json!({ "reflectance": { "rows": [] } }), "unknown field"),
        (json!({ "sellmeier": { "b": [1], "c": [] } }), "1 B and 0 C"),
        (json!({ "sellmeier": { "b": [1], "c": [0.25] } }), "which is no medium's"),
        (json!({ "cauchy": [0.5, 0] }), "which is no medium's"),
        (json!({ "cauchy": [1.5, 0], "sellmeier": { "b": [1], "c": [0] } }), "both sellmeier and cauchy"),
    ] {
        let text = sentence(&with_etalon(etalon, json!({})));
        assert!(text.contains("material 0 \"odd\"") && text.contains("extras.etalon") && text.contains(said), "{text}");
    }
    for (etalon, said) in [
        (
            json!({ "reflectance": { "table": [[500, 1.5], [510, 0.5]] } }),
            "a reflectance of 1.5 sends back more light than there is",
        ),
        (json!({ "reflectance": { "table": [[300, 0.5], [900, 0.5]] } }), "300 nm, which nobody sees"),
        (json!({ "emission": "d65" }), "it is 0, so it is dark"),
    ] {
        let warnings = load(&with_etalon(etalon, json!({}))).warnings;
        assert!(warnings.len() == 1 && warnings[0].contains(said), "{warnings:?}");
    }
    for (key, slot, value) in [
        ("reflectance", "baseColorTexture", json!({ "table": [[500, 0.5], [510, 0.5]] })),
        ("emission", "emissiveTexture", json!("a")),
    ] {
        let mut b = with_etalon(json!({ key: value }), json!({}));
        let texture = json!({ "index": 0 });
        match slot {
            "baseColorTexture" => b.json["materials"][0]["pbrMetallicRoughness"] = json!({ slot: texture }),
            _ => b.json["materials"][0][slot] = texture,
        }
        assert!(sentence(&b).contains("one of them must go"), "{}", sentence(&b));
    }
}

#[test]
fn a_grid_of_sigma_is_read_and_each_node_gets_a_medium_of_its_own() {
    let fog = json!({ "name": "fog", "extensions": {
        "KHR_materials_transmission": { "transmissionFactor": 1 }, "KHR_materials_volume": { "thicknessFactor": 1 } },
        "extras": { "etalon": { "sigma": { "size": [2, 1, 2], "values": [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11.5],
                                           "min": [0, 0, 0], "max": [2, 0, 1] } } } });
    let mut b = textured(fog, &["KHR_materials_transmission", "KHR_materials_volume"]);
    let node = b.json["nodes"][0].clone();
    b.root(node);
    let scene = load(&b);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let materials: Vec<_> = scene.instances.iter().map(|i| scene.meshes[i.mesh].material).collect();
    assert_eq!(materials, [0, 1]);
    let [first, second] = [0, 1].map(|i| scene.materials[i].marched_sigma().unwrap());
    assert_eq!(first, second);
    assert_eq!((first.size(), first.channels()), ([2, 1, 2], 3));
    // x fastest, then y, then z; red, green and blue of a point together.
    assert_eq!((first.at([1, 0, 0], 0), first.at([0, 0, 1], 2), first.at([1, 0, 1], 2)), (3.0, 8.0, 11.5));
    let place = first.grid_from_object(&scene.meshes[0]).transform_point3(DVec3::new(0.5, 7.0, 0.25));
    assert_eq!(place, DVec3::new(0.25, 0.0, 0.25));
}

#[test]
fn what_etalon_extras_say_in_vain_is_a_warning_that_names_material_and_key() {
    let warned = |etalon: serde_json::Value, extensions: serde_json::Value, expected: &[&str]| {
        let scene = load(&with_etalon(etalon, extensions));
        assert_eq!(scene.warnings.len(), expected.len(), "{:?}", scene.warnings);
        for (warning, expected) in scene.warnings.iter().zip(expected) {
            assert_eq!(*warning, format!("scene.glb: material 0 \"odd\": {expected}"));
        }
        scene.materials[0].clone()
    };
    warned(
        json!({ "Priority": 1, "a\nb": 2 }),
        json!({}),
        &["extras.etalon has no key \"Priority\"; it is ignored", "extras.etalon has no key \"a\\nb\"; it is ignored"],
    );
    warned(json!({ "brdf": [1, "x"] }), json!({}), &["extras.etalon brdf is not read yet"]);
    let told = warned(
        json!({ "kd": 0.2, "ks": [0.4, 0.4, 0.4], "shine": 3 }),
        json!({}),
        &["extras.etalon kd, ks, shine: π kd + 2π ks/(shine + 2) is 1.131, more light than there is; with \
           brdf=blinn-phong-reciprocal of kd the share is drawn that ks leaves"],
    );
    assert!(told.phong && (told.base_color[0] - 0.628_318_5).abs() < 1e-6, "{told:?}");
    for (extensions, lacks) in [
        (json!({}), "transmits nothing"),
        (json!({ "KHR_materials_transmission": { "transmissionFactor": 0.5 } }), "is a thin sheet, of thickness 0"),
    ] {
        let m = warned(
            json!({ "sigma": { "size": [1, 1, 1], "values": [1] } }),
            extensions,
            &[&format!("extras.etalon sigma is seen inside of bodies, and the material {lacks}")],
        );
        assert!(m.sigma.is_some() && m.marched_sigma().is_none());
    }
    let m = warned(
        json!({ "n": [1.4, 1.5, 1.6] }),
        json!({}),
        &["extras.etalon n of each colour is read for metals only; green's 1.5 is taken"],
    );
    assert_eq!(m.ior, 1.5);
    let ior = json!({ "KHR_materials_ior": { "ior": 1.25 } });
    let m = warned(json!({ "n": 2 }), ior.clone(), &["extras.etalon n 2 replaces the 1.25 of KHR_materials_ior"]);
    assert_eq!(m.ior, 2.0);
    warned(json!({ "n": 1.25 }), ior, &[]);
    let m = warned(json!({ "n": 1e9 }), json!({}), &["extras.etalon n 1e9 is clamped to 1e6"]);
    assert_eq!(m.ior, 1e6);
    let m = warned(json!({ "n": 0.5 }), json!({}), &["the index of refraction 0.5 is below 1, that of a vacuum"]);
    assert_eq!(m.ior, 0.5);
    let mut b = with_etalon(json!({ "preset": "silver" }), json!({}));
    b.json["materials"][0]["pbrMetallicRoughness"] = json!({ "metallicFactor": 0, "baseColorFactor": [1, 1, 1, 0.5] });
    let scene = load(&b);
    assert!(scene.warnings.len() == 1 && scene.warnings[0].contains("metallic factor 0 is read as 1"));
    assert_eq!((scene.materials[0].metallic, scene.materials[0].base_color[3]), (1.0, 0.5));
}

#[test]
fn indices_of_refraction_that_let_no_light_in_are_refused_where_light_is_transmitted() {
    let with = |ior: f64, transmission: f64| {
        let mut b = textured(
            json!({ "extensions": { "KHR_materials_ior": { "ior": ior },
                "KHR_materials_transmission": { "transmissionFactor": transmission } } }),
            &["KHR_materials_ior", "KHR_materials_transmission"],
        );
        b.json["materials"][0]["name"] = "odd".into();
        b
    };
    for (ior, transmission, expected, warnings) in [
        (1.0, 1.0, 1.0, 0),
        (0.75, 1.0, 0.75, 1),
        (0.75, 0.0, 0.75, 1),
        (1e30, 1.0, 1e6, 1),
        (0.0, 0.0, 1e6, 1),
        (-2.0, 0.0, 1.0, 1),
    ] {
        let scene = load(&with(ior, transmission));
        assert_eq!((scene.materials[0].ior, scene.warnings.len()), (expected, warnings), "{ior}: {:?}", scene.warnings);
    }
    for ior in [0.0, -0.5] {
        let text = sentence(&with(ior, 0.25));
        let expected = format!("material 0 \"odd\": n = {ior} in KHR_materials_ior");
        assert!(text.contains(&expected) && text.contains("0.25") && !text.contains('\n'), "{text}");
    }
}

#[test]
fn texture_transforms_turn_as_the_extension_says() {
    let transform = json!({ "KHR_texture_transform": { "offset": [0.5, 0.25], "rotation": FRAC_PI_2, "scale": [2, 3], "texCoord": 1 } });
    let mut b = textured(
        json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0, "extensions": transform } },
                "normalTexture": { "index": 0, "extensions": transform },
                "occlusionTexture": { "index": 0, "extensions": transform } }),
        &["KHR_texture_transform"],
    );
    let uv1 = b.floats("VEC2", &[0.0, 1.0, 1.0, 1.0, 0.0, 0.0]);
    b.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = uv1.into();
    let scene = load(&b);
    let m = &scene.materials[0];
    for texture in [m.base_color_texture, m.normal_texture, m.occlusion_texture] {
        let t = texture.unwrap();
        assert_eq!(t.uv_set, 1);
        // Scaled to (2 u, 3 v), then turned counter-clockwise as seen with v down: (a, b) to (b, -a); then moved.
        for (uv, expected) in [((0.0, 0.0), (0.5, 0.25)), ((1.0, 0.0), (0.5, -1.75)), ((0.0, 1.0), (3.5, 0.25))] {
            let found = t.uv_transform.transform_point2(Vec2::from(uv));
            assert!((found - Vec2::from(expected)).length() < 1e-6, "{uv:?} goes to {found}");
        }
    }
}

#[test]
fn tangents_are_generated_for_normal_maps_only_and_point_up_the_picture() {
    let mut b = textured(json!({ "normalTexture": { "index": 0 } }), &[]);
    // u grows along +X and v shrinks along +Y, so the bitangent normal × tangent is +Y: handedness +1.
    assert_eq!(load(&b).meshes[0].tangents, [[1.0, 0.0, 0.0, 1.0]; 3]);
    let tangent = b.floats("VEC4", &[0.0, 2.0, 0.0, -1.0].repeat(3));
    b.json["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = tangent.into();
    assert_eq!(
        load(&b).meshes[0].tangents,
        [[0.0, 1.0, 0.0, -1.0]; 3],
        "tangents of the file are taken, at unit length"
    );
    b.json["materials"] = json!([{}]);
    assert!(load(&b).meshes[0].tangents.is_empty());
}

#[test]
fn a_vertex_between_mirrored_charts_gets_two_tangents() {
    let mut b = Builder::new();
    // Two triangles share an edge; the second has its u mirrored.
    let position = b.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0]);
    let normal = b.floats("VEC3", &[0.0, 0.0, 1.0].repeat(4));
    let uv = b.floats("VEC2", &[0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0]);
    let indices = b.indices(&[0, 1, 2, 0, 2, 3]);
    let view = b.view(&png(1, 1, [128, 128, 255, 255]), None);
    b.push("images", json!({ "bufferView": view, "mimeType": "image/png" }));
    b.push("textures", json!({ "source": 0 }));
    b.push("materials", json!({ "normalTexture": { "index": 0 } }));
    let mesh = b.mesh(json!({ "attributes": { "POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv }, "indices": indices, "material": 0 }));
    b.root(json!({ "mesh": mesh }));
    let scene = load(&b);
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.positions.len(), 6);
    for (corner, &i) in mesh.indices.iter().enumerate() {
        let expected = if corner < 3 { [1.0, 0.0, 0.0, 1.0] } else { [-1.0, 0.0, 0.0, -1.0] };
        assert_eq!(mesh.tangents[i as usize], expected, "corner {corner}");
    }
}

#[test]
fn a_missing_texture_coordinate_is_zero_with_a_warning() {
    let mut b = textured(json!({ "emissiveTexture": { "index": 0, "texCoord": 1 } }), &[]);
    b.json["materials"][0]["emissiveFactor"] = json!([1, 1, 1]);
    let scene = load(&b);
    assert_eq!(scene.meshes[0].uvs[1], [[0.0; 2]; 3]);
    assert!(scene.warnings.len() == 1 && scene.warnings[0].contains("TEXCOORD_1"), "{:?}", scene.warnings);
}

#[test]
fn slivers_keep_their_normal_and_triangles_without_area_or_number_go() {
    let mut b = Builder::new();
    // A sliver of height 1e-6 far off the origin, in a tilted plane: exact in f32 and known exactly.
    let (x, h) = (1.0_f32, 2.0_f32.powi(-20));
    let position = b.floats(
        "VEC3",
        &[
            x,
            1.0,
            0.0,
            x + 1.0,
            1.0,
            1.0,
            x + 2.0,
            1.0 + h,
            2.0,
            0.0,
            0.0,
            0.0,
            1.0,
            1.0,
            1.0,
            2.0,
            2.0,
            2.0,
            0.0,
            0.0,
            0.0,
            f32::NAN,
            0.0,
            0.0,
            0.0,
            1.0,
            0.0,
            0.0,
            0.0,
            0.0,
            1.0,
            0.0,
            0.0,
            f32::INFINITY,
            1.0,
            0.0,
        ],
    );
    let mesh = b.mesh(json!({ "attributes": { "POSITION": position } }));
    b.root(json!({ "mesh": mesh }));
    let scene = load(&b);
    assert_eq!(scene.triangles(), 1);
    // (1, 0, 1) × (2, h, 2) = (-h, 0, h).
    let n = Vec3::from(scene.meshes[0].normals[0]).as_dvec3();
    let expected = DVec3::new(-1.0, 0.0, 1.0).normalize();
    assert!(n.angle_between(expected) < 1e-6, "{n}");
    assert_eq!(scene.warnings.len(), 2, "{:?}", scene.warnings);
    assert!(scene.warnings[0].contains("2 triangle(s) with a corner that is not finite"), "{:?}", scene.warnings);
    assert!(scene.warnings[1].contains("1 triangle(s) without area"), "{:?}", scene.warnings);
    assert!(scene.bounds().unwrap().max.is_finite());
}

#[test]
fn vertices_that_no_triangle_uses_are_left_out() {
    let mut b = Builder::new();
    let position = b.floats("VEC3", &[99.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, f32::NAN, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let normal = b.floats("VEC3", &[0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    let indices = b.indices(&[1, 2, 4, 2, 4, 1]);
    let mesh = b.mesh(json!({ "attributes": { "POSITION": position, "NORMAL": normal }, "indices": indices }));
    b.root(json!({ "mesh": mesh }));
    let scene = load(&b);
    assert_eq!(scene.meshes[0].positions.len(), 3);
    assert_eq!(scene.meshes[0].normals, [[0.0, 0.0, 1.0]; 3]);
    assert_eq!(scene.bounds().unwrap().max, DVec3::new(1.0, 1.0, 0.0));
    assert_close(&corners(&scene)[..3], &TRIANGLE, 0.0);
}

#[test]
fn nodes_scaled_to_nothing_are_left_out_with_a_warning() {
    let mut b = one_triangle();
    b.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 1, "znear": 0.1 } }));
    b.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    b.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "directional" }] } });
    b.root(
        json!({ "mesh": 0, "camera": 0, "scale": [0, 0, 0], "extensions": { "KHR_lights_punctual": { "light": 0 } } }),
    );
    b.root(json!({ "mesh": 0, "scale": [1, 1, 0] }));
    let scene = load(&b);
    assert_eq!((scene.instances.len(), scene.cameras.len(), scene.lights.len()), (2, 0, 0));
    assert_eq!(scene.warnings.len(), 3, "{:?}", scene.warnings);
}

#[test]
fn a_sliver_of_large_coordinates_has_the_normal_of_exact_arithmetic() {
    let [a, b, c] = [[1_i64, 2, 3], [8_000_001, 7_000_003, 5_000_007], [16_000_000, 14_000_005, 10_000_012]];
    let (u, v) = ([b[0] - a[0], b[1] - a[1], b[2] - a[2]], [c[0] - a[0], c[1] - a[1], c[2] - a[2]]);
    let exact = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let mut builder = Builder::new();
    let position = builder.floats("VEC3", &[a, b, c].concat().iter().map(|&x| x as f32).collect::<Vec<_>>());
    let mesh = builder.mesh(json!({ "attributes": { "POSITION": position } }));
    builder.root(json!({ "mesh": mesh }));
    let found = Vec3::from(load(&builder).meshes[0].normals[0]).as_dvec3();
    let expected = DVec3::from(exact.map(|x| x as f64)).normalize();
    assert!(found.angle_between(expected) < 1e-6, "{found} is not {expected}");
}

#[test]
fn normals_of_zero_length_take_their_faces_normal_and_others_become_unit() {
    let mut b = Builder::new();
    let position = b.triangle();
    let normal = b.floats("VEC3", &[0.0, 0.0, 0.0, 0.0, 3.0, 0.0, f32::NAN, 0.0, 0.0]);
    let mesh = b.mesh(json!({ "attributes": { "POSITION": position, "NORMAL": normal } }));
    b.root(json!({ "mesh": mesh }));
    let scene = load(&b);
    assert_eq!(scene.meshes[0].normals, [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    assert!(scene.warnings[0].contains("2 normal(s)"), "{:?}", scene.warnings);
}

fn morphing() -> Builder {
    let mut b = Builder::new();
    let position = b.triangle();
    let up = b.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 3.0]);
    let right = b.floats("VEC3", &[4.0, 0.0, 0.0].repeat(3));
    b.push("meshes", json!({
        "primitives": [{ "attributes": { "POSITION": position }, "targets": [{ "POSITION": up }, { "POSITION": right }] }],
        "weights": [0.5, 0.25],
    }));
    b.root(json!({ "mesh": 0 }));
    b.root(json!({ "mesh": 0, "weights": [0, 1] }));
    b.root(json!({ "mesh": 0, "weights": [0, 0] }));
    b.root(json!({ "mesh": 0, "weights": [0, 0] }));
    b
}

#[test]
fn morph_weights_come_from_the_node_then_the_mesh() {
    let scene = load(&morphing());
    assert_eq!((scene.meshes.len(), scene.instances.len()), (3, 4), "unbent nodes share geometry");
    let c = corners(&scene);
    assert_close(&c[..3], &[[1.0, 0.0, 0.5], [2.0, 0.0, 1.0], [1.0, 1.0, 1.5]], 1e-6);
    assert_close(&c[3..6], &[[4.0, 0.0, 0.0], [5.0, 0.0, 0.0], [4.0, 1.0, 0.0]], 0.0);
    assert_close(&c[6..9], &TRIANGLE, 0.0);
    // Flat normals follow the bent surface: (1, 0, 0.5) × (0, 1, 1).
    let n = Vec3::from(scene.meshes[0].normals[0]);
    assert!((n - Vec3::new(-0.5, -1.0, 1.0).normalize()).length() < 1e-6, "{n}");
}

#[test]
fn animated_morph_weights_replace_the_others() {
    let mut b = morphing();
    let times = b.floats("SCALAR", &[0.0, 2.0]);
    let weights = b.floats("SCALAR", &[0.0, 0.0, 1.0, 0.5]);
    b.push(
        "animations",
        json!({
            "samplers": [{ "input": times, "output": weights }],
            "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }],
        }),
    );
    let c = corners(&load_at(&b, Some(1.0)));
    assert_close(&c[..3], &[[1.0, 0.0, 0.5], [2.0, 0.0, 1.0], [1.0, 1.0, 1.5]], 1e-6);
    let c = corners(&load_at(&b, Some(99.0)));
    assert_close(&c[..3], &[[2.0, 0.0, 1.0], [3.0, 0.0, 2.0], [2.0, 1.0, 3.0]], 1e-6);
}

#[test]
fn animation_interpolates_as_each_sampler_says() {
    let mut b = one_triangle();
    let times = b.floats("SCALAR", &[1.0, 3.0]);
    let linear = b.floats("VEC3", &[0.0, 0.0, 0.0, 10.0, 0.0, 0.0]);
    let stepped = b.floats("VEC3", &[1.0, 1.0, 1.0, 2.0, 2.0, 2.0]);
    // In-tangent, value, out-tangent: from 0 to 8 with slopes 1 and 2 per second along x.
    let mut cubic = vec![0.0; 18];
    (cubic[6], cubic[9], cubic[12]) = (1.0, 2.0, 8.0);
    let cubic = b.floats("VEC3", &cubic);
    let s = std::f32::consts::FRAC_1_SQRT_2;
    // No turn, then a quarter turn about Z written with the opposite sign: the short way is taken.
    let turn = b.floats("VEC4", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -s, -s]);
    b.push(
        "animations",
        json!({ "samplers": [
            { "input": times, "output": linear }, { "input": times, "output": stepped, "interpolation": "STEP" },
            { "input": times, "output": turn },
        ], "channels": [
            { "sampler": 0, "target": { "node": 0, "path": "translation" } },
            { "sampler": 1, "target": { "node": 0, "path": "scale" } },
            { "sampler": 2, "target": { "node": 0, "path": "rotation" } },
        ]}),
    );
    assert_close(&corners(&load(&b)), &TRIANGLE, 0.0);
    let at = |b: &Builder, time| {
        let scene = load_at(b, Some(time));
        let m = scene.instances[0].world_from_object;
        (m.translation.x, m.matrix3.x_axis)
    };
    let (x, axis) = at(&b, 2.0);
    assert!((x - 5.0).abs() < 1e-9);
    let (sin, cos) = (FRAC_PI_2 / 2.0).sin_cos();
    assert_close(&[axis], &[[cos, sin, 0.0]], 1e-6);
    // A third of the way in time is a third of the angle, which a lerp would miss by a degree.
    let (sin, cos) = (FRAC_PI_2 / 4.0).sin_cos();
    assert_close(&[at(&b, 1.5).1], &[[cos, sin, 0.0]], 1e-6);
    assert_close(&[at(&b, 3.0).1], &[[0.0, 2.0, 0.0]], 1e-6);
    assert_eq!(at(&b, -5.0).0, 0.0);
    assert_eq!(at(&b, 50.0).0, 10.0);
    b.json["animations"][0]["samplers"][0] = json!({ "input": times, "output": cubic, "interpolation": "CUBICSPLINE" });
    // Hermite at a quarter: t = 0.25, two seconds long; p1 8 (3t² - 2t³), m0 1·2 (t³ - 2t² + t), m1 2·2 (t³ - t²).
    let t = 0.25_f64;
    let (t2, t3) = (t * t, t * t * t);
    let expected = 8.0 * (3.0 * t2 - 2.0 * t3) + 2.0 * (t3 - 2.0 * t2 + t) + 4.0 * (t3 - t2);
    assert!((at(&b, 1.5).0 - expected).abs() < 1e-9, "{} is not {expected}", at(&b, 1.5).0);
}

fn skinned() -> Builder {
    let mut b = Builder::new();
    let position = b.triangle();
    let normal = b.floats("VEC3", &[0.0, 0.0, 1.0].repeat(3));
    let joints = b.accessor(&[0, 1, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0], UNSIGNED_BYTE, "VEC4", 3);
    // The first vertex follows joint 0, the second joint 1, the third both, with weights that sum to 2.
    let weights = b.floats("VEC4", &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0]);
    let mut binds = vec![];
    for x in [0.0, -1.0] {
        binds.extend([1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, 0.0, 0.0, 1.0]);
    }
    let binds = b.floats("MAT4", &binds);
    let mesh = b.mesh(
        json!({ "attributes": { "POSITION": position, "NORMAL": normal, "JOINTS_0": joints, "WEIGHTS_0": weights } }),
    );
    b.root(json!({ "mesh": mesh, "skin": 0, "translation": [100, 100, 100] }));
    b.root(json!({ "translation": [0, 0, 5] }));
    let s = std::f64::consts::FRAC_1_SQRT_2;
    b.root(json!({ "translation": [1, 0, 5], "rotation": [0, 0, s, s] }));
    b.push("skins", json!({ "joints": [1, 2], "inverseBindMatrices": binds }));
    b
}

#[test]
fn skins_bend_by_weights_and_ignore_their_node() {
    let scene = load(&skinned());
    // Joint 1 turns a quarter about (1, 0): the third vertex (0, 1) goes to (0, -1) there and stays put under joint 0.
    assert_close(&corners(&scene), &[[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 0.0, 5.0]], 1e-6);
    let mut b = skinned();
    b.json["nodes"][2]["rotation"] = json!([1, 0, 0, 0]);
    let scene = load(&b);
    // Half a turn about X flips the normal of what follows joint 1 only.
    assert_eq!(scene.meshes[0].normals[0], [0.0, 0.0, 1.0]);
    let n = Vec3::from(scene.meshes[0].normals[1]);
    assert!((n - Vec3::NEG_Z).length() < 1e-6, "{n}");
}

#[test]
fn a_mirrored_skeleton_keeps_front_faces_in_front() {
    let mut b = skinned();
    for node in [1, 2] {
        b.json["nodes"][node] = json!({ "scale": [-1, 1, 1] });
    }
    b.json["skins"][0].as_object_mut().unwrap().remove("inverseBindMatrices");
    let scene = load(&b);
    let c = corners(&scene);
    let face = (c[1] - c[0]).cross(c[2] - c[0]);
    assert!(face.z > 0.0, "the winding says {face}");
    assert_eq!(scene.meshes[0].normals[0], [0.0, 0.0, 1.0]);
}

#[test]
fn a_picture_that_cannot_be_decoded_names_file_image_and_cause() {
    let mut b = textured(json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }), &[]);
    let view = b.view(b"no picture at all", None);
    b.json["images"][0] = json!({ "bufferView": view, "mimeType": "image/png", "name": "leaf" });
    let text = sentence(&b);
    assert!(text.contains("scene.glb: image 0 \"leaf\": the data is not PNG, JPEG, WebP or KTX2"), "{text}");
}

#[test]
fn webp_pictures_come_through_their_extension() {
    let mut b =
        textured(json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }), &["EXT_texture_webp"]);
    let mut webp = std::io::Cursor::new(Vec::new());
    image::RgbaImage::from_pixel(5, 1, image::Rgba([9, 8, 7, 255]))
        .write_to(&mut webp, image::ImageFormat::WebP)
        .unwrap();
    let view = b.view(webp.get_ref(), None);
    let image = b.push("images", json!({ "bufferView": view, "mimeType": "image/webp" }));
    b.json["textures"][0] = json!({ "extensions": { "EXT_texture_webp": { "source": image } } });
    let scene = load(&b);
    let found = &scene.images[scene.materials[0].base_color_texture.unwrap().image];
    assert_eq!((found.width, &found.rgba[..4]), (5, &[9, 8, 7, 255][..]));
}

fn save(folder: &Path, name: &str, text: &str) -> std::path::PathBuf {
    let path = folder.join(name);
    fs::write(&path, text).unwrap();
    path
}

#[test]
fn wavefront_files_are_read_with_their_materials() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("my tile.png"), png(1, 1, [10, 20, 30, 255])).unwrap();
    fs::write(folder.path().join("hole.png"), png(1, 1, [60, 60, 60, 255])).unwrap();
    save(
        folder.path(),
        "m.mtl",
        "newmtl tile\nKd 1 1 1\nNs 6\nillum 1\nmap_Kd my tile.png\nmap_d hole.png\n\nnewmtl glass\nillum 7\nNi 1.5\nTf 0.5 1 1\n",
    );
    let obj = "# comment\nmtllib m.mtl\nv 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n\
               o quad\nusemtl tile\nf 1/1/1 2/2/1 3/3/1 \\\n 4/4/1\nusemtl glass\nf -4 -3 -2\nl 1 3 4\n";
    let scene =
        scene::load(&save(folder.path(), "a.OBJ", obj), &LoadOptions::default()).unwrap_or_else(|e| panic!("{e:#}"));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert_eq!(scene.triangles(), 2 + 1 + 2 * 12);
    let quad = &scene.meshes[0];
    assert_eq!((quad.positions.len(), quad.indices.len()), (4, 6));
    assert_eq!(quad.uvs[0][0], [0.0, 1.0], "rows are counted from the top");
    let tile = &scene.materials[quad.material];
    assert_eq!(
        (tile.name.as_str(), tile.metallic, tile.specular, tile.alpha_mode),
        ("tile", 0.0, 0.0, AlphaMode::Mask(0.5))
    );
    assert!((tile.roughness - 0.5_f32.sqrt()).abs() < 1e-6, "α = sqrt(2 / 8)");
    let image = &scene.images[tile.base_color_texture.unwrap().image];
    assert_eq!(image.rgba, [10, 20, 30, 60], "colour from one file, opacity from the other");
    assert_eq!(scene.meshes[1].normals, [[0.0, 0.0, 1.0]; 3], "flat where the file has none");
    let glass = &scene.materials[scene.meshes[1].material];
    assert_eq!((glass.transmission, glass.ior, glass.base_color), (1.0, 1.5, [0.5, 1.0, 1.0, 1.0]));
}

#[test]
fn wavefront_mistakes_name_their_line() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |text: &str| {
        let path = save(folder.path(), "a.obj", text);
        format!("{:#}", scene::load(&path, &LoadOptions::default()).expect_err("should be refused"))
    };
    for (text, expected) in [
        ("v 0 0 0\nf 1 2 3\n", "a.obj: line 2: a face names position 2, but there are 1 so far"),
        ("v 0 zero 0\n", "line 1: \"zero\" is not a number"),
        ("v 0 0 0\nf 1 1\n", "line 2: a face has 2 corners"),
        ("v 0 0 0\nf 0 0 0\n", "position 0"),
    ] {
        let found = refused(text);
        assert!(found.contains(expected), "{found}");
    }
    save(folder.path(), "t.mtl", "newmtl t\nmap_Kd gone.png\n");
    let found = refused("mtllib t.mtl\n");
    assert!(found.contains("gone.png"), "{found}");
    let path = save(folder.path(), "b.obj", "mtllib gone.mtl\nusemtl t\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let scene = scene::load(&path, &LoadOptions::default()).unwrap();
    assert!(scene.warnings.len() == 1 && scene.warnings[0].contains("gone.mtl"), "{:?}", scene.warnings);
}

#[test]
fn mtl_materials_beyond_nature_are_drawn_with_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let warned = |mtl: &str| {
        save(folder.path(), "m.mtl", &format!("newmtl m\n{mtl}"));
        let path = save(folder.path(), "m.obj", "mtllib m.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
        scene::load(&path, &LoadOptions::default()).unwrap().warnings
    };
    for (mtl, expected) in [
        ("Kd 1.5 0 0\n", "material \"m\": Kd 1.5 would send more light than there is"),
        ("Ks 0 -0.5 0\n", "Ks -0.5 is negative"),
        ("Ke 0 0 -1\n", "Ke -1 would take light away"),
        ("Kd 0.8 0.8 0.8\nKs 0.1 0.5 0.1\n", "Kd + Ks is 1.30"),
    ] {
        let found = warned(mtl);
        assert!(found.len() == 1 && found[0].contains(expected), "{mtl}: {found:?}");
    }
    for sound in
        ["Kd 0.8 0.8 0.8\nKs 0.2 0.2 0.2\n", "Kd 1 1 1\nKs 1 1 1\nillum 1\n", "Kd 1 1 1\nKs 1 1 1\nillum 7\nNi 1.5\n"]
    {
        assert!(warned(sound).is_empty(), "{sound}");
    }
}

#[test]
fn other_endings_are_refused_by_name() {
    let error = format!("{:#}", scene::load(Path::new("a.fbx"), &LoadOptions::default()).unwrap_err());
    assert_eq!(error, "loading a.fbx: only .gltf, .glb, .obj, .stl and .ply files are supported");
}

/// What no picture depends on is neither decoded nor kept, and each is named with its reason; read for everything, all
/// is there.
#[test]
fn what_cannot_be_seen_is_not_read() {
    let read = |material: serde_json::Value, reads| {
        let builder = textured(material, &["KHR_materials_unlit", "KHR_materials_clearcoat"]);
        let folder = tempfile::tempdir().unwrap();
        let path = builder.save_glb(folder.path());
        scene::load(&path, &LoadOptions { prune: reads, ..LoadOptions::default() }).unwrap()
    };
    let visible = |ambience| Prune::Unused(ambience);
    let material = json!({
        "name": "m",
        "occlusionTexture": { "index": 0 },
        "emissiveTexture": { "index": 1 },
        "extensions": { "KHR_materials_clearcoat": { "clearcoatFactor": 0, "clearcoatTexture": { "index": 1 } } },
    });
    let all = read(material.clone(), Prune::Nothing);
    assert_eq!((all.images.len(), all.unread.len(), all.meshes[0].uvs[0].is_empty()), (2, 0, false));
    // Occlusion is seen in light from all around.
    let some = read(material.clone(), visible(AmbientLight::Present));
    assert_eq!((some.images.len(), some.meshes[0].uvs[0].is_empty()), (1, false));
    assert_eq!(
        some.unread,
        ["emissive texture of \"m\": nothing is emitted", "clear coat texture of \"m\": there is no coat"]
    );
    assert!(some.materials[0].occlusion_texture.is_some_and(|texture| texture.image == 0));
    let none = read(material, visible(AmbientLight::Absent));
    assert_eq!((none.images.len(), none.meshes[0].uvs[0].is_empty()), (0, true));
    assert_eq!(none.unread.len(), 4, "{:?}", none.unread);
    assert!(none.unread[1].ends_with("no light comes from all around"), "{:?}", none.unread);
    assert!(none.unread[3].starts_with("texture coordinates 0 of mesh"), "{:?}", none.unread);

    let unlit = json!({
        "pbrMetallicRoughness": { "baseColorTexture": { "index": 1 } },
        "occlusionTexture": { "index": 0 },
        "extensions": { "KHR_materials_unlit": {} },
    });
    let unlit = read(unlit, visible(AmbientLight::Present));
    assert_eq!((unlit.images.len(), unlit.images[0].width), (1, 3));
    assert_eq!(unlit.unread, ["occlusion texture of \"material 0\": the material is unlit"]);
}

/// A picture that nothing reads is still looked at as far as its header.
#[test]
fn a_broken_picture_that_nothing_reads_is_an_error() {
    let mut builder = textured(json!({ "emissiveTexture": { "index": 0 } }), &[]);
    let view = builder.view(b"no picture at all", None);
    builder.json["images"][0]["bufferView"] = view.into();
    let folder = tempfile::tempdir().unwrap();
    let path = builder.save_glb(folder.path());
    let reads = Prune::Unused(AmbientLight::Present);
    let error = scene::load(&path, &LoadOptions { prune: reads, ..LoadOptions::default() }).unwrap_err();
    assert!(format!("{error:#}").contains("not PNG, JPEG, WebP or KTX2"), "{error:#}");
}
