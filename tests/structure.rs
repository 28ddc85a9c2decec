//! Structure of glTF files: scenes, variants, hidden nodes, instancing, animation by pointers, and legal ways to write
//! JSON.
//!
//! Read glTF 2.0 section 3.5, KHR_materials_variants, KHR_node_visibility, EXT_mesh_gpu_instancing and
//! KHR_animation_pointer.

#![allow(clippy::unwrap_used, reason = "a test may stop where it stands")]

use std::path::Path;

use etalon::scene::{LoadOptions, Scene, Source, load};
use etalon_testing::gltf_builder::{Builder, base64};
use glam::DVec3;
use serde_json::{Value, json};

fn loaded(builder: &Builder, options: &LoadOptions) -> anyhow::Result<Scene> {
    let folder = tempfile::tempdir().unwrap();
    load(&builder.save_glb(folder.path()), options)
}

fn refusal(builder: &Builder, options: &LoadOptions) -> String {
    format!("{:#}", loaded(builder, options).map(|_| ()).expect_err("it loads"))
}

/// A file with one triangle as mesh 0 and nothing placed.
fn one_triangle() -> Builder {
    let mut builder = Builder::new();
    let positions = builder.triangle();
    builder.mesh(json!({ "attributes": { "POSITION": positions } }));
    builder
}

fn names(scene: &Scene) -> Vec<&str> {
    scene.instances.iter().map(|instance| instance.name.as_str()).collect()
}

#[test]
fn a_scene_of_the_file_is_chosen_by_name_or_index() {
    let mut builder = one_triangle();
    builder.json["nodes"] = json!([{ "name": "a", "mesh": 0 }, { "name": "b", "mesh": 0 }]);
    builder.json["scenes"] = json!([{ "nodes": [0] }, { "name": "second", "nodes": [1] }]);
    let with = |scene: Option<&str>| LoadOptions { scene: scene.map(str::to_owned), ..LoadOptions::default() };
    for (wanted, shown) in [(None, "a"), (Some("0"), "a"), (Some("1"), "b"), (Some("second"), "b")] {
        assert_eq!(names(&loaded(&builder, &with(wanted)).unwrap()), [shown], "{wanted:?}");
    }
    let said = refusal(&builder, &with(Some("third")));
    assert!(said.ends_with("there is no scene \"third\"; the file has 0, 1 \"second\""), "{said}");
}

#[test]
fn a_variant_gives_primitives_its_materials() {
    let mut builder = one_triangle();
    builder.json["materials"] = json!([{ "name": "plain" }, { "name": "red" }, { "name": "blue" }]);
    builder.json["extensionsUsed"] = json!(["KHR_materials_variants"]);
    builder.json["extensions"] =
        json!({ "KHR_materials_variants": { "variants": [{ "name": "evening" }, { "name": "night" }] } });
    builder.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    builder.json["meshes"][0]["primitives"][0]["extensions"] = json!({ "KHR_materials_variants": {
        "mappings": [{ "material": 1, "variants": [0] }, { "material": 2, "variants": [1] }]
    } });
    builder.root(json!({ "mesh": 0 }));
    let with = |variant: Option<&str>| LoadOptions { variant: variant.map(str::to_owned), ..LoadOptions::default() };
    for (wanted, name) in [(None, "plain"), (Some("evening"), "red"), (Some("night"), "blue"), (Some("1"), "blue")] {
        let scene = loaded(&builder, &with(wanted)).unwrap();
        assert_eq!(scene.materials[scene.meshes[0].material].name, name, "{wanted:?}");
    }
    let said = refusal(&builder, &with(Some("noon")));
    assert!(said.ends_with("there is no variant \"noon\"; the file has 0 \"evening\", 1 \"night\""), "{said}");
    builder.json["meshes"][0]["primitives"][0]["extensions"]["KHR_materials_variants"]["mappings"][0]["material"] =
        json!(9);
    let said = refusal(&builder, &with(Some("evening")));
    assert!(said.contains("mesh 0 primitive 0: the variant \"evening\" names material 9"), "{said}");
}

#[test]
fn hidden_nodes_hide_what_is_below_them() {
    let mut builder = one_triangle();
    let hidden = json!({ "KHR_node_visibility": { "visible": false } });
    builder.json["nodes"] = json!([
        { "name": "root", "mesh": 0, "children": [1, 2] },
        { "name": "hidden", "mesh": 0, "extensions": hidden, "children": [3] },
        { "name": "shown", "mesh": 0, "extensions": { "KHR_node_visibility": { "visible": true } } },
        { "name": "below", "mesh": 0 },
    ]);
    builder.json["scenes"] = json!([{ "nodes": [0] }]);
    builder.json["extensionsUsed"] = json!(["KHR_node_visibility"]);
    assert_eq!(names(&loaded(&builder, &LoadOptions::default()).unwrap()), ["root", "shown"]);
    // Cameras are no meshes.
    builder.json["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }]);
    builder.json["nodes"][3]["camera"] = json!(0);
    let scene = loaded(&builder, &LoadOptions::default()).unwrap();
    assert_eq!(scene.cameras.iter().map(|camera| camera.name.as_str()).collect::<Vec<_>>(), ["below"]);
}

#[test]
fn instancing_places_a_copy_for_each_element() {
    let mut builder = one_triangle();
    let at = [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]];
    let translations = builder.floats("VEC3", at.as_flattened());
    let half = std::f32::consts::FRAC_1_SQRT_2;
    // The third is turned by a quarter about +Z.
    let rotations =
        builder.floats("VEC4", [[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, half, half]].as_flattened());
    let scales = builder.floats("VEC3", [[1.0; 3], [2.0; 3], [1.0; 3]].as_flattened());
    let attributes = json!({ "TRANSLATION": translations, "ROTATION": rotations, "SCALE": scales });
    builder.root(json!({
        "mesh": 0, "translation": [10, 0, 0],
        "extensions": { "EXT_mesh_gpu_instancing": { "attributes": attributes } },
    }));
    builder.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    builder.json["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
    let scene = loaded(&builder, &LoadOptions::default()).unwrap();
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 3));
    let ends: Vec<DVec3> = scene.instances.iter().map(|i| i.world_from_object.transform_point3(DVec3::X)).collect();
    for (end, expected) in ends.iter().zip([[12.0, 0.0, 0.0], [12.0, 2.0, 0.0], [10.0, 1.0, 3.0]]) {
        assert!(end.distance(DVec3::from(expected)) < 1e-6, "{end}");
    }
    builder.json["accessors"][translations]["count"] = json!(2);
    let said = refusal(&builder, &LoadOptions::default());
    assert!(said.contains("EXT_mesh_gpu_instancing: its attributes have [2, 3, 3] elements"), "{said}");
}

/// Adds a channel that animates the property at a JSON pointer from the first value to the second in a second.
fn animate(builder: &mut Builder, pointer: &str, shape: &str, values: &[f32], interpolation: &str) {
    let input = builder.floats("SCALAR", &[0.0, 1.0]);
    let output = builder.floats(shape, values);
    let sampler = json!({ "input": input, "output": output, "interpolation": interpolation });
    let target = json!({ "path": "pointer", "extensions": { "KHR_animation_pointer": { "pointer": pointer } } });
    builder.push("animations", json!({ "samplers": [sampler], "channels": [{ "sampler": 0, "target": target }] }));
    builder.json["extensionsUsed"] = json!(["KHR_animation_pointer", "KHR_node_visibility", "KHR_materials_ior"]);
}

#[test]
fn pointers_animate_nodes_materials_and_visibility() {
    let mut builder = one_triangle();
    // A volume without an attenuation distance, whose default is infinite, which JSON cannot say.
    let volume = json!({ "KHR_materials_volume": { "thicknessFactor": 0.5 } });
    builder.json["materials"] = json!([{ "name": "m", "extensions": volume }]);
    builder.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    builder.root(json!({ "name": "moved", "mesh": 0 }));
    builder.root(json!({ "name": "blinking", "mesh": 0 }));
    animate(&mut builder, "/nodes/0/translation", "VEC3", &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0], "LINEAR");
    animate(&mut builder, "/nodes/1/extensions/KHR_node_visibility/visible", "SCALAR", &[1.0, 0.0], "STEP");
    let colour = "/materials/0/pbrMetallicRoughness/baseColorFactor";
    animate(&mut builder, colour, "VEC4", &[1.0, 1.0, 1.0, 1.0, 0.0, 0.5, 1.0, 1.0], "LINEAR");
    animate(&mut builder, "/materials/0/extensions/KHR_materials_ior/ior", "SCALAR", &[1.5, 2.5], "LINEAR");
    let folder = tempfile::tempdir().unwrap();
    let path = builder.save_glb(folder.path());
    let at = |time: Option<f64>| load(&path, &LoadOptions { time, ..LoadOptions::default() }).unwrap();

    let rest = at(None);
    assert_eq!(names(&rest), ["moved", "blinking"]);
    assert_eq!(rest.materials[0].base_color, [1.0; 4]);
    let middle = at(Some(0.5));
    assert_eq!(names(&middle), ["moved", "blinking"]);
    assert_eq!(middle.instances[0].world_from_object.translation, DVec3::new(2.0, 0.0, 0.0));
    assert_eq!(middle.materials[0].base_color, [0.5, 0.75, 1.0, 1.0]);
    assert_eq!(middle.materials[0].ior, 2.0);
    assert_eq!(middle.materials[0].attenuation_distance, f32::INFINITY);
    assert_eq!(names(&at(Some(1.0))), ["moved"]);
    assert_eq!(rest.duration, Some(1.0));

    // One file read once gives the same scenes.
    let mut source = Source::open(&path, LoadOptions::default()).unwrap();
    for time in [Some(0.25), None, Some(1.0), Some(0.5)] {
        let (again, alone) = (source.at(time).unwrap(), at(time));
        assert_eq!(names(&again), names(&alone));
        assert_eq!(again.materials[0].base_color, alone.materials[0].base_color);
    }
}

#[test]
fn pointers_to_nothing_are_refused_by_name() {
    let mut builder = one_triangle();
    builder.root(json!({ "mesh": 0 }));
    animate(&mut builder, "/nodes/7/translation", "VEC3", &[0.0; 6], "LINEAR");
    assert!(loaded(&builder, &LoadOptions::default()).is_ok());
    let said = refusal(&builder, &LoadOptions { time: Some(0.5), ..LoadOptions::default() });
    assert!(said.contains("the pointer /nodes/7/translation: there is no element 7"), "{said}");
}

#[test]
fn legal_json_that_the_schema_crate_refuses_is_read() {
    // Whole numbers as 1.0, a scene without nodes, a channel without a target.
    let mut builder = one_triangle();
    builder.root(json!({ "name": "a", "mesh": 0 }));
    builder.json["scenes"].as_array_mut().unwrap().push(json!({ "name": "empty" }));
    let times = builder.floats("SCALAR", &[0.0, 1.0]);
    let values = builder.floats("VEC3", &[0.0; 6]);
    builder.json["animations"] = json!([{
        "samplers": [{ "input": times, "output": values }],
        "channels": [{ "sampler": 0, "target": { "path": "translation" } }],
    }]);
    let plain = loaded(&builder, &LoadOptions::default()).unwrap();
    assert_eq!(names(&plain), ["a"]);
    assert_eq!(plain.warnings, ["scene.glb: animation 0 channel 0 has no target node and is ignored"]);

    fn as_floats(value: &mut Value) {
        match value {
            Value::Number(number) => *value = json!(number.as_f64().unwrap()),
            Value::Array(values) => values.iter_mut().for_each(as_floats),
            Value::Object(members) => members.values_mut().for_each(as_floats),
            _ => {}
        }
    }
    let uri = format!("data:application/octet-stream;base64,{}", base64(&builder.bytes));
    let mut json = builder.json.clone();
    json["buffers"] = json!([{ "byteLength": builder.bytes.len(), "uri": uri }]);
    as_floats(&mut json);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, json.to_string()).unwrap();
    assert!(std::fs::read_to_string(&path).unwrap().contains("\"byteLength\":36.0"));
    let floats = load(&path, &LoadOptions::default()).unwrap();
    assert_eq!(floats.meshes[0].positions[..], plain.meshes[0].positions[..]);

    // What is broken is still named as before.
    std::fs::write(&path, r#"{ "asset": { "version": 2 } }"#).unwrap();
    let said = format!("{:#}", load(Path::new(&path), &LoadOptions::default()).map(|_| ()).unwrap_err());
    assert!(said.contains("the JSON cannot be read as glTF 2.0"), "{said}");
}

#[test]
fn a_draft_version_is_read_with_a_warning() {
    let mut builder = one_triangle();
    builder.root(json!({ "mesh": 0 }));
    builder.json["asset"]["minVersion"] = json!("2.1");
    let scene = loaded(&builder, &LoadOptions::default()).unwrap();
    assert_eq!(scene.warnings, ["scene.glb: the file asks for glTF 2.1, a draft; it is read as glTF 2.0"]);
    builder.json["asset"]["minVersion"] = json!("3.0");
    assert!(refusal(&builder, &LoadOptions::default()).contains("\"3.0\""));
}

/// A tree: root above arm and leg, arm above hand; a light at the hand, a camera at the leg.
fn tree() -> Builder {
    let mut builder = one_triangle();
    builder.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    builder.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "name": "lamp", "type": "point" }] } });
    builder.json["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }]);
    builder.json["nodes"] = json!([
        { "name": "hand", "mesh": 0, "extensions": { "KHR_lights_punctual": { "light": 0 } } },
        { "name": "root", "children": [3, 2] },
        { "name": "leg", "mesh": 0, "camera": 0 },
        { "name": "arm", "mesh": 0, "children": [0] },
        { "name": "elsewhere", "mesh": 0 },
    ]);
    builder.json["scenes"] = json!([{ "nodes": [1] }]);
    builder
}

#[test]
fn the_outline_is_the_tree_of_the_scene() {
    let builder = tree();
    let scene = loaded(&builder, &LoadOptions::default()).unwrap();
    let outline = &scene.outline;
    let rows: Vec<_> = outline.nodes.iter().map(|node| (node.name.as_str(), node.parent)).collect();
    assert_eq!(rows, [("root", None), ("arm", Some(0)), ("hand", Some(1)), ("leg", Some(0))]);
    for (index, instance) in scene.instances.iter().enumerate() {
        assert_eq!(outline.nodes[outline.node_of(index).unwrap()].name, instance.name);
    }
    assert_eq!((&outline.nodes[2].lights, &outline.nodes[3].cameras), (&vec![0], &vec![0]));
    assert_eq!(outline.instances_within(1).len(), 2, "the arm with its hand");
}

#[test]
fn nodes_are_hidden_and_alone_shown_with_what_is_below_them() {
    let builder = tree();
    let list = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
    let with = |hide: &[&str], only: &[&str]| {
        loaded(&builder, &LoadOptions { hide: list(hide), only: list(only), ..LoadOptions::default() }).unwrap()
    };
    let hidden = with(&["arm"], &[]);
    assert_eq!((names(&hidden), hidden.lights.len(), hidden.cameras.len()), (vec!["leg"], 0, 1));
    let marks: Vec<bool> = hidden.outline.nodes.iter().map(|node| node.hidden).collect();
    assert_eq!(marks, [false, true, true, false], "the tree stays whole");
    assert_eq!(names(&with(&[], &["arm"])), ["hand", "arm"]);
    assert_eq!(names(&with(&["hand"], &["arm"])), ["arm"]);
    // A camera of what is hidden can still be looked through.
    assert_eq!((names(&with(&["leg"], &[])).len(), with(&["leg"], &[]).cameras.len()), (2, 1));
    let wrong = LoadOptions { hide: list(&["foot"]), ..LoadOptions::default() };
    assert!(refusal(&builder, &wrong).contains("there is no node \"foot\""));
    // Scenes without a tree have their instances as nodes.
    let study =
        etalon::open::scene("study:metals", &LoadOptions { hide: list(&["gold ball"]), ..LoadOptions::default() });
    let study = study.unwrap();
    assert!(!names(&study).contains(&"gold ball") && names(&study).contains(&"silver ball"));
    assert!(study.outline.nodes.iter().any(|node| node.name == "gold ball" && node.hidden));
    let node = study.outline.nodes.iter().find(|node| node.name == "silver ball").unwrap();
    assert_eq!(study.instances[node.instances[0]].name, "silver ball");
}

#[test]
fn animations_that_move_the_same_node_do_not_play_together() {
    let mut builder = one_triangle();
    builder.root(json!({ "name": "a", "mesh": 0 }));
    builder.root(json!({ "name": "b", "mesh": 0 }));
    animate(&mut builder, "/nodes/0/translation", "VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0], "LINEAR");
    animate(&mut builder, "/nodes/0/translation", "VEC3", &[0.0, 0.0, 0.0, 0.0, 1.0, 0.0], "LINEAR");
    animate(&mut builder, "/nodes/1/translation", "VEC3", &[0.0, 0.0, 0.0, 0.0, 0.0, 1.0], "LINEAR");
    for (index, name) in ["walk", "run", "wave"].into_iter().enumerate() {
        builder.json["animations"][index]["name"] = json!(name);
    }
    let with = |animation: Option<&str>| {
        let animation = animation.map(str::to_owned);
        loaded(&builder, &LoadOptions { time: Some(1.0), animation, ..LoadOptions::default() }).unwrap()
    };
    let places = |scene: &Scene| [0, 1].map(|i| scene.instances[i].world_from_object.translation);
    let default = with(None);
    assert_eq!(places(&default), [DVec3::X, DVec3::Z], "the first of two, and what does not contradict it");
    let said = default.warnings.join(" ");
    assert!(said.contains("the animations \"run\" do not play") && said.contains("\"walk\", \"wave\""), "{said}");
    let plays: Vec<bool> = default.outline.animations.iter().map(|animation| animation.plays).collect();
    assert_eq!(plays, [true, false, true]);
    assert_eq!(places(&with(Some("run"))), [DVec3::Y, DVec3::ZERO]);
    assert_eq!(places(&with(Some("0"))), [DVec3::X, DVec3::ZERO]);
    // All together, the last one wins, as in files where several channels name one property.
    assert_eq!(places(&with(Some("all"))), [DVec3::Y, DVec3::Z]);
    let wrong = LoadOptions { animation: Some("fly".to_owned()), ..LoadOptions::default() };
    assert!(refusal(&builder, &wrong).contains("there is no animation \"fly\""));
}

#[test]
fn a_key_light_comes_from_where_it_is_asked_to() {
    let builder = tree();
    let key = |azimuth: f64, elevation: f64| {
        let key_light = Some(etalon::scene::KeyLight { azimuth, elevation, lux: 2.0 });
        let scene = loaded(&builder, &LoadOptions { key_light, ..LoadOptions::default() }).unwrap();
        let light = scene.lights.last().unwrap().clone();
        assert_eq!((scene.lights.len(), light.color), (2, [2.0; 3]));
        let etalon::scene::LightKind::Directional { direction } = light.kind else { panic!("{:?}", light.kind) };
        -direction
    };
    let is = |found: DVec3, expected: DVec3| assert!(found.abs_diff_eq(expected, 1e-12), "{found} {expected}");
    is(key(0.0, 0.0), DVec3::Z);
    is(key(90.0, 0.0), DVec3::X);
    is(key(0.0, 90.0), DVec3::Y);
}
