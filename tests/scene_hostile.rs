//! Files that are broken or mean harm: every one is an error in one sentence, none a panic or a flood of memory.
#![allow(clippy::unwrap_used, reason = "a test may stop where it stands")]

use std::{fs, panic::AssertUnwindSafe, path::Path};

use etalon::optics::SplitMix64;
use etalon::scene::{self, LoadOptions};
use etalon_testing::gltf_builder::{Builder, FLOAT, UNSIGNED_BYTE, UNSIGNED_INT, f32s, png, u16s};
use serde_json::{Value, json};

fn refuse(path: &Path) -> String {
    match scene::load(path, &LoadOptions { time: Some(0.5), ..LoadOptions::default() }) {
        Ok(_) => panic!("{} was read", path.display()),
        Err(error) => {
            let text = format!("{error:#}");
            assert!(text.starts_with("loading ") && !text.contains('\n'), "{text}");
            text
        }
    }
}

#[track_caller]
fn assert_refused(builder: &Builder, expected: &str) {
    let folder = tempfile::tempdir().unwrap();
    let text = refuse(&builder.save_glb(folder.path()));
    assert!(text.contains(expected), "\"{text}\" does not say \"{expected}\"");
}

/// A file that uses most of what is read: indices, normals, textures, a skin, morphs, animation, light, camera.
fn rich() -> Builder {
    let mut b = Builder::new();
    let position = b.triangle();
    let normal = b.floats("VEC3", &[0.0, 0.0, 1.0].repeat(3));
    let uv = b.floats("VEC2", &[0.0, 1.0, 1.0, 1.0, 0.0, 0.0]);
    let joints = b.accessor(&[0, 1, 0, 0].repeat(3), UNSIGNED_BYTE, "VEC4", 3);
    let weights = b.floats("VEC4", &[0.5, 0.5, 0.0, 0.0].repeat(3));
    let indices = b.indices(&[0, 1, 2]);
    let sparse_at = b.view(&u16s(&[1]), None);
    let sparse = b.view(&f32s(&[0.0, 0.0, 1.0]), None);
    let delta = b.push("accessors", json!({ "componentType": FLOAT, "type": "VEC3", "count": 3, "sparse": {
        "count": 1, "indices": { "bufferView": sparse_at, "componentType": 5123 }, "values": { "bufferView": sparse } } }));
    let times = b.floats("SCALAR", &[0.0, 1.0]);
    let moves = b.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    let swells = b.floats("SCALAR", &[0.0, 1.0]);
    let view = b.view(&png(4, 4, [1, 2, 3, 4]), None);
    b.push("images", json!({ "bufferView": view, "mimeType": "image/png" }));
    b.push("samplers", json!({ "wrapS": 33071 }));
    b.push("textures", json!({ "source": 0, "sampler": 0 }));
    b.push(
        "materials",
        json!({ "normalTexture": { "index": 0 }, "extensions": {
        "KHR_materials_clearcoat": { "clearcoatFactor": 1, "clearcoatNormalTexture": { "index": 0 } } },
        "extras": { "etalon": { "priority": 1, "preset": "gold", "n": 0.2, "kappa": [3, 2, 2] }, "other": 1 } }),
    );
    let bent = json!({ "attributes": { "POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv, "JOINTS_0": joints, "WEIGHTS_0": weights },
        "indices": indices, "material": 0, "targets": [{ "POSITION": delta }] });
    let plain = json!({ "attributes": { "POSITION": position, "COLOR_0": weights }, "mode": 2 });
    b.push("meshes", json!({ "primitives": [bent], "weights": [0.5] }));
    b.push("meshes", json!({ "primitives": [plain], "name": "loop" }));
    b.root(json!({ "mesh": 0, "skin": 0 }));
    b.root(json!({ "children": [2], "rotation": [0, 0, 0, 1] }));
    b.push("nodes", json!({ "mesh": 1, "camera": 0, "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
    b.push("skins", json!({ "joints": [1, 2] }));
    b.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 1, "znear": 0.1 } }));
    b.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "point" }] } });
    b.push(
        "animations",
        json!({
        "samplers": [{ "input": times, "output": moves }, { "input": times, "output": swells }],
        "channels": [{ "sampler": 0, "target": { "node": 1, "path": "translation" } },
                     { "sampler": 1, "target": { "node": 0, "path": "weights" } }] }),
    );
    b.json["extensionsUsed"] = json!(["KHR_lights_punctual", "KHR_materials_clearcoat"]);
    b
}

/// Loads and reports a panic with the seed that led to it; any other outcome will do.
fn survives(path: &Path, seed: u64) -> bool {
    let load = || {
        scene::load(path, &LoadOptions { time: Some(0.5), ..LoadOptions::default() })
            .map(|s| (s.bounds(), s.triangles()))
    };
    match std::panic::catch_unwind(AssertUnwindSafe(load)) {
        Ok(outcome) => outcome.is_ok(),
        Err(_) => panic!("seed {seed} made the importer panic"),
    }
}

#[test]
fn the_rich_file_is_sound_before_it_is_broken() {
    let folder = tempfile::tempdir().unwrap();
    let scene =
        scene::load(&rich().save_glb(folder.path()), &LoadOptions { time: Some(0.5), ..LoadOptions::default() })
            .unwrap();
    assert_eq!((scene.triangles(), scene.cameras.len(), scene.lights.len()), (1 + 36, 1, 1));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn flipped_and_missing_bytes_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.glb");
    let sound = rich().glb();
    let mut read = 0;
    for seed in 0..2000 {
        let mut numbers = SplitMix64::new(seed);
        let mut bytes = sound.clone();
        for _ in 0..1 + numbers.below(4) {
            let at = numbers.below(bytes.len());
            bytes[at] = match numbers.below(3) {
                0 => bytes[at] ^ 1 << numbers.below(8),
                1 => b'0' + numbers.below(10) as u8,
                _ => numbers.bits() as u8,
            };
        }
        if numbers.below(8) == 0 {
            bytes.truncate(numbers.below(bytes.len()));
            if bytes.len() >= 12 && numbers.below(2) == 0 {
                // A header that agrees lets the damage through to the chunks.
                let length = (bytes.len() as u32).to_le_bytes();
                bytes[8..12].copy_from_slice(&length);
            }
        }
        fs::write(&path, &bytes).unwrap();
        read += usize::from(survives(&path, seed));
    }
    // Flips in vertex data go unnoticed, most in the JSON do not: both must have happened.
    assert!((100..1900).contains(&read), "{read} of 2000 were read");
}

/// Puts an odd value somewhere into a JSON document.
fn mutate(value: &mut Value, numbers: &mut SplitMix64) {
    let odd = || {
        vec![
            json!(0),
            json!(1),
            json!(7),
            json!(-1),
            json!(4_294_967_295_u64),
            json!(4_294_967_296_u64),
            json!(1e38),
            json!(1e300),
            json!(0.5),
            json!(null),
            json!([]),
            json!({}),
            json!("x"),
            json!(true),
            json!(u64::MAX),
            json!(5126),
            json!(5121),
            json!([0, 0, 0]),
        ]
    };
    match value {
        Value::Object(map) if !map.is_empty() && numbers.below(12) > 0 => {
            let key = map.keys().nth(numbers.below(map.len())).unwrap().clone();
            if numbers.below(12) == 0 {
                map.remove(&key);
            } else {
                mutate(&mut map[&key], numbers);
            }
        }
        Value::Array(list) if !list.is_empty() && numbers.below(12) > 0 => {
            let i = numbers.below(list.len());
            match numbers.below(16) {
                0 => drop(list.remove(i)),
                1 => list.push(list[i].clone()),
                _ => mutate(&mut list[i], numbers),
            }
        }
        _ => {
            let odd = odd();
            *value = odd[numbers.below(odd.len())].clone();
        }
    }
}

#[test]
fn odd_values_in_the_json_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let sound = rich();
    let mut read = 0;
    for seed in 0..3000 {
        let mut numbers = SplitMix64::new(seed ^ 0x5eed);
        let mut b = sound.clone();
        b.json["buffers"] = json!([{ "byteLength": b.bytes.len() }]);
        for _ in 0..1 + numbers.below(3) {
            mutate(&mut b.json, &mut numbers);
        }
        let path = b.save_glb(folder.path());
        read += usize::from(survives(&path, seed));
    }
    assert!((100..2900).contains(&read), "{read} of 3000 were read");
}

#[test]
fn mutated_wavefront_files_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let obj = "mtllib m.mtl\nv 0 0 0\nv 2 0 0 1 0 0\nv 2 2 0\nv 0 2 0 1\nv 1 3 0\nvt 0 0\nvt 1 1\nvn 0 0 1\no quad\nusemtl t\n\
               f 1/1/1 2/2/1 3/2/1 4//1 5\nf -4 -3 -2\nl 1 3 4\np 2\n";
    let mtl =
        "newmtl t\nKd 1 1 1\nKs 0.5\nNs 6\nNi 1.5\nd 0.5\nillum 7\nTf 1 0 1\nmap_Kd -s 2 2 1 -o 0 t.png\nbump b.png\n";
    fs::write(folder.path().join("t.png"), png(1, 1, [0; 4])).unwrap();
    let path = folder.path().join("a.obj");
    let alphabet = b"0123456789 -/.\n#\\vtfnlpo\xff\te";
    fs::write(&path, obj).unwrap();
    fs::write(folder.path().join("m.mtl"), mtl).unwrap();
    assert!(survives(&path, 0), "the file is sound before it is broken");
    let mut read = 0;
    for seed in 0..2000 {
        let mut numbers = SplitMix64::new(seed ^ 0x0b1);
        let mut texts = [obj.as_bytes().to_vec(), mtl.as_bytes().to_vec()];
        for _ in 0..1 + numbers.below(3) {
            let text = &mut texts[numbers.below(2)];
            let at = numbers.below(text.len());
            text[at] = alphabet[numbers.below(alphabet.len())];
        }
        fs::write(&path, &texts[0]).unwrap();
        fs::write(folder.path().join("m.mtl"), &texts[1]).unwrap();
        read += usize::from(survives(&path, seed));
    }
    assert!((100..1900).contains(&read), "{read} of 2000 were read");
}

#[test]
fn every_cut_of_a_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.glb");
    let sound = rich().glb();
    for length in (0..sound.len()).step_by(37) {
        fs::write(&path, &sound[..length]).unwrap();
        refuse(&path);
        if length >= 12 {
            // Even when the header has been made to agree, something is missing now.
            let mut bytes = sound[..length].to_vec();
            bytes[8..12].copy_from_slice(&(length as u32).to_le_bytes());
            fs::write(&path, &bytes).unwrap();
            refuse(&path);
        }
    }
}

#[test]
fn glb_headers_and_chunks_are_checked() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.glb");
    let sound = rich().glb();
    let with = |at: usize, value: u32| {
        let mut bytes = sound.clone();
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        fs::write(&path, &bytes).unwrap();
        refuse(&path)
    };
    for (at, value, expected) in [
        (0, 0, "it is no GLB file"),
        (4, 1, "version 1"),
        (8, 99, "says 99 bytes"),
        (12, u32::MAX, "GLB chunk 0 claims 4294967295 bytes"),
        (16, 7, "the first GLB chunk is not JSON"),
    ] {
        let text = with(at, value);
        assert!(text.contains(expected), "{text}");
    }
}

#[test]
fn huge_counts_are_refused_without_memory_for_them() {
    for count in [4_000_000_000_u64, u64::MAX] {
        let mut b = rich();
        b.json["accessors"][0]["count"] = count.into();
        assert_refused(&b, "mesh 0 primitive 0: accessor 0");
        b.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
        assert_refused(&b, "without a buffer view");
    }
    let mut b = rich();
    b.json["bufferViews"][0]["byteLength"] = u64::MAX.into();
    assert_refused(&b, "buffer view 0 spans 18446744073709551615 bytes");
    let mut b = rich();
    b.json["buffers"] = json!([{ "byteLength": 4_000_000_000_u64 }]);
    assert_refused(&b, "buffer 0 should have 4000000000 bytes");
}

#[test]
fn overruns_name_the_mesh_and_the_accessor() {
    let mut b = rich();
    b.json["accessors"][0]["byteOffset"] = 4.into();
    assert_refused(
        &b,
        "mesh 0 primitive 0: accessor 0 reads 3 elements from byte 4 up to byte 40 of buffer view 0, which has 36 bytes",
    );
    let mut b = rich();
    b.json["bufferViews"][0]["byteStride"] = 16.into();
    assert_refused(&b, "accessor 0 reads 3 elements");
    let mut b = rich();
    b.json["bufferViews"][0]["byteStride"] = 8.into();
    assert_refused(&b, "elements of 12 bytes, but a stride of 8 bytes");
    let mut b = rich();
    b.json["accessors"][6]["sparse"]["count"] = 2.into();
    assert_refused(&b, "the sparse index list of accessor 6");
}

#[test]
fn references_out_of_range_are_refused() {
    for (pointer, expected) in [
        ("/nodes/0/mesh", "nodes[0].mesh"),
        ("/nodes/0/skin", "nodes[0].skin"),
        ("/nodes/2/camera", "nodes[2].camera"),
        ("/nodes/1/children/0", "nodes[1].children[0]"),
        ("/scenes/0/nodes/0", "scenes[0].nodes[0]"),
        ("/meshes/0/primitives/0/attributes/POSITION", "meshes[0].primitives[0].attributes[\"POSITION\"]"),
        ("/meshes/0/primitives/0/attributes/NORMAL", "meshes[0].primitives[0].attributes[\"NORMAL\"]"),
        ("/meshes/0/primitives/0/indices", "meshes[0].primitives[0].indices"),
        ("/meshes/0/primitives/0/material", "meshes[0].primitives[0].material"),
        ("/meshes/0/primitives/0/targets/0/POSITION", "meshes[0].primitives[0].targets[0]"),
        ("/accessors/0/bufferView", "accessors[0].bufferView"),
        ("/bufferViews/0/buffer", "bufferViews[0].buffer"),
        ("/skins/0/joints/1", "skins[0].joints[1]"),
        ("/textures/0/source", "textures[0].source"),
        ("/textures/0/sampler", "textures[0].sampler"),
        ("/images/0/bufferView", "images[0].bufferView"),
        ("/materials/0/normalTexture/index", "materials[0].normalTexture.index"),
        ("/materials/0/extensions/KHR_materials_clearcoat/clearcoatNormalTexture/index", "texture 99 does not exist"),
        ("/animations/0/channels/0/sampler", "animations[0].channels[0].sampler"),
        ("/animations/0/channels/0/target/node", "animations[0].channels[0].target.node"),
        ("/animations/0/samplers/0/output", "animations[0].samplers[0].output"),
        ("/nodes/2/extensions/KHR_lights_punctual/light", "light"),
    ] {
        let mut b = rich();
        *b.json.pointer_mut(pointer).unwrap_or_else(|| panic!("{pointer}")) = 99.into();
        assert_refused(&b, expected);
    }
}

#[test]
fn values_out_of_range_inside_buffers_are_refused() {
    let mut b = rich();
    let indices = b.indices(&[0, 1, 3]);
    b.json["meshes"][0]["primitives"][0]["indices"] = indices.into();
    assert_refused(&b, "has the index 3, but there are 3 vertices");
    let mut b = rich();
    let joints = b.accessor(&[0, 2, 0, 0].repeat(3), UNSIGNED_BYTE, "VEC4", 3);
    b.json["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"] = joints.into();
    assert_refused(&b, "vertex 0 follows joint 2, but the skin has 2");
    let mut b = rich();
    let short = b.floats("VEC3", &[0.0; 6]);
    b.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = short.into();
    assert_refused(&b, "has 2 elements");
    let mut b = rich();
    let view = b.view(&1_u32.to_le_bytes(), None);
    b.json["accessors"][6]["sparse"]["indices"] = json!({ "bufferView": view, "componentType": UNSIGNED_INT });
    let sparse = b.view(&3_u32.to_le_bytes(), None);
    b.json["accessors"][6]["sparse"]["indices"]["bufferView"] = sparse.into();
    assert_refused(&b, "the sparse index list of accessor 6 names element 3 of 3");
}

#[test]
fn hierarchies_that_are_no_trees_are_refused() {
    let mut b = rich();
    b.json["nodes"][2]["children"] = json!([1]);
    assert_refused(&b, "is its own ancestor");
    let mut b = rich();
    b.json["nodes"][0]["children"] = json!([2]);
    assert_refused(&b, "is a child of both node 0 and node 1");
    let mut b = rich();
    b.json["nodes"][0]["children"] = json!([0]);
    assert_refused(&b, "node 0 is its own ancestor");
    // A chain of 100 000 nodes is a tree, and must not exhaust the stack.
    let mut b = Builder::new();
    let nodes: Vec<Value> = (1..100_000).map(|i| json!({ "children": [i] })).chain([json!({})]).collect();
    b.json["nodes"] = nodes.into();
    let folder = tempfile::tempdir().unwrap();
    assert!(scene::load(&b.save_glb(folder.path()), &LoadOptions::default()).is_ok());
}

#[test]
fn extensions_that_are_required_and_unknown_are_refused_by_name() {
    let mut b = rich();
    b.json["extensionsRequired"] = json!(["KHR_lights_punctual", "VENDOR_magic"]);
    assert_refused(&b, "the file requires the extension VENDOR_magic, which is not supported");
}

#[test]
fn a_picture_of_absurd_size_is_refused() {
    let mut b = rich();
    // A PNG header that claims 4 000 000 000 pixels across.
    let mut picture = png(4, 4, [0; 4]);
    picture[16..20].copy_from_slice(&4_000_000_000_u32.to_be_bytes());
    let view = b.view(&picture, None);
    b.json["images"][0]["bufferView"] = view.into();
    assert_refused(&b, "image 0");
    // A sound one that no device could hold.
    let view = b.view(&png(16_385, 1, [0; 4]), None);
    b.json["images"][0]["bufferView"] = view.into();
    assert_refused(&b, "image 0");
}

fn grid(size: [u64; 3], values: &[f64]) -> Value {
    json!({ "sigma": { "size": size, "values": values } })
}

fn boxed(min: Value, max: Value) -> Value {
    json!({ "sigma": { "size": [1, 2, 2], "values": [1, 2, 3, 4], "min": min, "max": max } })
}

#[test]
fn etalon_extras_that_cannot_be_meant_are_refused_by_material_and_key() {
    for (etalon, expected) in [
        (json!(3), "extras.etalon is not an object"),
        (json!("x"), "extras.etalon is not an object"),
        (json!({ "priority": 1.5 }), "extras.etalon priority: 1.5 is not a whole number"),
        (json!({ "priority": "1" }), "extras.etalon priority: \"1\" is not a whole number"),
        (json!({ "priority": 2_147_483_648_u64 }), "extras.etalon priority: 2147483648 is not a whole number"),
        (json!({ "preset": "aluminum" }), "extras.etalon preset: \"aluminum\" is no preset; these are: gold, silver"),
        (json!({ "preset": 1 }), "extras.etalon preset: 1 is no preset"),
        (json!({ "n": 0 }), "extras.etalon n: an index of refraction lies above 0"),
        (json!({ "n": [1, 1e-60, 1] }), "extras.etalon n: an index of refraction lies above 0"),
        (json!({ "n": -1.5 }), "extras.etalon n: -1.5 is negative"),
        (json!({ "n": [1, 2] }), "extras.etalon n: [1,2] is neither a number nor three numbers"),
        (json!({ "n": [1, 2, null] }), "extras.etalon n: [1,2,null] is neither a number nor three numbers"),
        (json!({ "n": "1.5" }), "extras.etalon n: \"1.5\" is neither a number nor three numbers"),
        (json!({ "n": 1, "kappa": [0, 0, -1e-9] }), "extras.etalon kappa: [0,0,-1e-9] is negative"),
        (json!({ "kappa": true }), "extras.etalon kappa: true is neither a number nor three numbers"),
        (json!({ "n": vec![1; 100_000] }), "extras.etalon n: [1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1… is neither"),
        (json!({ "preset": "two\nlines" }), "extras.etalon preset: \"two\\nlines\" is no preset"),
        (json!({ "kappa": 2 }), "extras.etalon kappa: a metal has an n too"),
        (json!({ "sigma": 3 }), "extras.etalon sigma: invalid type"),
        (json!({ "sigma": { "size": [1, 1, 1] } }), "extras.etalon sigma: missing field `values`"),
        (json!({ "sigma": { "size": [1, 1], "values": [1] } }), "extras.etalon sigma: invalid length 2"),
        (json!({ "sigma": { "size": [1, 1, -1], "values": [1] } }), "extras.etalon sigma: invalid value: integer `-1`"),
        (
            json!({ "sigma": { "size": [1, 1, 1.5], "values": [1] } }),
            "extras.etalon sigma: invalid type: floating point",
        ),
        (
            json!({ "sigma": { "size": [1, 0, 1], "values": [] } }),
            "extras.etalon sigma: a grid of 1 x 0 x 1 points has none",
        ),
        (
            grid([2, 2, 1], &[1.0; 3]),
            "extras.etalon sigma: 2 x 2 x 1 points have 4 values, or 12 of three channels, not 3",
        ),
        (
            grid([2, 2, 1], &[1.0; 8]),
            "extras.etalon sigma: 2 x 2 x 1 points have 4 values, or 12 of three channels, not 8",
        ),
        (
            grid([1 << 32, 1 << 32, 1], &[1.0]),
            "extras.etalon sigma: 4294967296 x 4294967296 x 1 points are more than 16777216",
        ),
        (grid([1 << 12, 1 << 12, 2], &[1.0]), "extras.etalon sigma: 4096 x 4096 x 2 points are more than 16777216"),
        (grid([2, 1, 1], &[1.0, -1e-9]), "extras.etalon sigma: value 1, -0.000000001, is negative"),
        (grid([2, 1, 1], &[1e39, 0.0]), "extras.etalon sigma: value 0 is not a finite number of 32 bits"),
        (
            json!({ "sigma": { "size": [1, 1, 1], "values": [null] } }),
            "extras.etalon sigma: invalid type: null, expected f32",
        ),
        (
            boxed(json!([0, 0, 0]), json!([1, 1, 0])),
            "extras.etalon sigma: the box [0, 0, 0] to [1, 1, 0] has no extent along z",
        ),
        (
            boxed(json!([0, 2, 0]), json!([1, 1, 1])),
            "extras.etalon sigma: the box [0, 2, 0] to [1, 1, 1] has no extent along y",
        ),
        (
            boxed(json!([0, 0, 0]), json!(null)),
            "extras.etalon sigma: of a box there are both corners, min and max, or none",
        ),
        (
            json!({ "sigma": { "size": "x\ny".repeat(1000), "values": [1] } }),
            "extras.etalon sigma: invalid type: string \"x\\ny",
        ),
        (json!({ "sigma": { "mi\nn": 1 } }), "extras.etalon sigma: unknown field `mi n`"),
    ] {
        let mut b = rich();
        b.json["materials"][0]["name"] = "odd".into();
        b.json["materials"][0]["extras"]["etalon"] = etalon;
        assert_refused(&b, &format!("material 0 \"odd\": {expected}"));
    }
    // Numbers that JSON can spell and f64 cannot hold, and nesting without end.
    let folder = tempfile::tempdir().unwrap();
    for (text, expected) in [
        ("\"n\":1e400".to_owned(), "extras.etalon n: number out of range"),
        (format!("\"n\":{}", "[".repeat(500) + &"]".repeat(500)), "extras.etalon n: recursion limit exceeded"),
        (r#""sigma":{"size":[1,1,1],"values":[1e400]}"#.to_owned(), "extras.etalon sigma: number out of range"),
        ("\"n\":1,\"n\":2,\"kappa\":-1".to_owned(), "extras.etalon kappa: -1 is negative"),
    ] {
        let mut b = rich();
        b.json["materials"][0]["extras"]["etalon"] = json!({ "here": 0 });
        let path = b.save_gltf(folder.path(), &b.data_uri());
        fs::write(&path, fs::read_to_string(&path).unwrap().replace("\"here\":0", &text)).unwrap();
        let found = refuse(&path);
        assert!(found.contains(&format!("material 0: {expected}")), "{found}");
    }
    let mut b = rich();
    b.json["materials"][0]["extensions"]["KHR_materials_transmission"] = json!({ "transmissionFactor": 0.5 });
    b.json["extensionsUsed"].as_array_mut().unwrap().push("KHR_materials_transmission".into());
    assert_refused(&b, "material 0: extras.etalon kappa: with a kappa above 0 light ends");
}

#[test]
fn numbers_that_are_not_possible_are_refused() {
    for (pointer, value, expected) in [
        ("/nodes/1/rotation", json!([1e300, 0, 0, 0]), None),
        ("/nodes/2/translation", json!([1e300, 0, 0]), Some("node 2")),
        ("/cameras/0/perspective/yfov", json!(4), Some("camera 0 at node 2: its field of view of 4 radians")),
        ("/animations/0/samplers/0/input", json!(0), Some("animation 0 channel 0")),
    ] {
        let mut b = rich();
        let slot = b.json.pointer_mut(pointer);
        match slot {
            Some(slot) => *slot = value,
            None => b.json["nodes"][2]["translation"] = value,
        }
        match expected {
            Some(expected) => assert_refused(&b, expected),
            None => {
                let folder = tempfile::tempdir().unwrap();
                let scene = scene::load(&b.save_glb(folder.path()), &LoadOptions::default()).unwrap();
                assert!(scene.warnings[0].contains("is no quaternion"), "{:?}", scene.warnings);
            }
        }
    }
}
