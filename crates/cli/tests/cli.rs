//! The program as its users meet it: what it prints where, which files it leaves, and that every mistake ends in one
//! sentence that names the cause, exit code 1 (or 2 for wrong usage), no panic, and no output file.

#[path = "support/program.rs"]
mod program;

use std::path::Path;

use program::{Run, etalon};
use serde_json::{Value, json};
use tempfile::TempDir;

/// A folder with a scene of one white triangle, `scene.glb`.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let mut b = etalon_testing::gltf_builder::Builder::new();
    let position = b.triangle();
    let mesh = b.mesh(json!({ "attributes": { "POSITION": position } }));
    b.root(json!({ "mesh": mesh }));
    b.save_glb(folder.path());
    folder
}

fn render(folder: &Path, arguments: &[&str]) -> Run {
    let mut all = vec!["render", "scene.glb", "--size", "32x18", "--device", "cpu", "--env", "none"];
    all.extend(arguments);
    etalon(folder, &all, &[])
}

fn files(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let mut names: Vec<_> = entries.map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.retain(|name| name != "cache");
    names.sort();
    names
}

fn pixels(path: &Path) -> image::RgbaImage {
    image::open(path).expect("a PNG").into_rgba8()
}

#[test]
fn mistakes_end_in_one_sentence_and_no_file() {
    let folder = folder();
    let at = folder.path();
    let empty = json!({ "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{}] });
    std::fs::write(at.join("empty.gltf"), empty.to_string()).expect("a file");
    let nodes = json!([{ "children": [1] }, { "children": [0] }]);
    let looped = json!({ "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": nodes });
    std::fs::write(at.join("loop.gltf"), looped.to_string()).expect("a file");
    std::fs::write(at.join("broken.glb"), b"glTF\x02\0\0\0nonsense").expect("a file");
    std::fs::write(at.join("not.hdr"), b"nonsense").expect("a file");
    std::fs::create_dir(at.join("folder.png")).expect("a folder");
    let before = files(at);
    let out = ["-o", "out.png"];
    for (arguments, code, said) in [
        (vec!["missing.glb"], 1, "missing.glb"),
        (vec!["scene.fbx"], 1, "only .gltf, .glb, .obj"),
        (vec!["broken.glb"], 1, "broken.glb"),
        (vec!["empty.gltf"], 1, "nothing to draw"),
        (vec!["loop.gltf"], 1, "loop.gltf"),
        (vec!["study:nothing"], 2, "no study scene `nothing`"),
        (vec!["scene.glb", "--size", "0x0"], 2, "at least one pixel"),
        (vec!["scene.glb", "--size", "0x10"], 2, "at least one pixel"),
        (vec!["scene.glb", "--size", "wide"], 2, "WIDTHxHEIGHT"),
        (vec!["scene.glb", "--size", "100000x100000"], 2, "no device draws more than 32768 pixels a side"),
        (vec!["scene.glb", "--set", "gloss=1"], 2, "no knob is called \"gloss\""),
        (vec!["scene.glb", "--set", "samples=5"], 2, "no rung"),
        (vec!["scene.glb", "--set", "normals=f16"], 2, "it has oct16, oct24, oct32, f32"),
        (vec!["scene.glb", "--model", "global", "--set", "reflection=off"], 2, "contradicts indirect=path"),
        (vec!["scene.glb", "--set", "guiding=photons"], 2, "contradicts indirect=occlusion:16"),
        (
            vec!["scene.glb", "--set", "denoise=nl-means"],
            2,
            "contradicts indirect=occlusion:16: only path tracing estimates",
        ),
        (vec!["scene.glb", "--model", "local", "--max-error", "2%"], 2, "only paths tell their error"),
        (vec!["scene.glb", "--max-error", "0%"], 2, "expected a fraction above 0"),
        (vec!["scene.glb", "--model", "global", "--max-error", "none"], 2, "expected a fraction above 0"),
        (
            vec!["scene.glb", "--model", "global", "--max-error", "1%", "--set", "samples=4"],
            2,
            "contradicts --set samples",
        ),
        (vec!["scene.glb", "--model", "global", "--aov", "reflection", "-o", "out.exr"], 2, "follows paths instead"),
        (vec!["scene.glb", "--model", "magic"], 2, "--model"),
        (vec!["scene.glb", "--eye", "1,2,3", "--target", "1,2,3"], 2, "the target equals the eye"),
        (vec!["scene.glb", "--eye", "0,1,0", "--target", "0,0,0"], 2, "the up direction"),
        (vec!["scene.glb", "--eye", "1,2"], 2, "X,Y,Z"),
        (vec!["scene.glb", "--eye", "1,2,NaN"], 2, "finite"),
        (vec!["scene.glb", "--target", "1,2,3"], 2, "--eye"),
        (vec!["scene.glb", "--camera", "nobody"], 2, "has no cameras"),
        (vec!["study:lamps", "--camera", "nobody"], 2, "has the cameras \"front\""),
        (vec!["scene.glb", "--fov", "180"], 2, "between 0 and 180 degrees"),
        (vec!["scene.glb", "--device", "nonsense"], 2, "nonsense"),
        (vec!["scene.glb", "--device", "99"], 2, "index 99"),
        (vec!["scene.glb", "--device", "gpu"], 1, "asked for a GPU"),
        (vec!["scene.glb", "--env", "missing.hdr"], 1, "missing.hdr"),
        (vec!["scene.glb", "--env", "not.hdr"], 1, "not.hdr"),
        (vec!["scene.glb", "--env", "none", "--background", "env"], 2, "there is no environment"),
        (
            vec!["scene.glb", "--env", "none", "--background-blur", "0.5"],
            2,
            "--background-blur 0.5: the background is not an environment",
        ),
        (vec!["scene.glb", "--background", "#123456", "--background-blur", "0.5"], 2, "is not an environment"),
        (vec!["scene.glb", "--background-blur", "2"], 2, "a number from 0 to 1"),
        (vec!["scene.glb", "--env-intensity", "NaN"], 2, "--env-intensity"),
        (vec!["scene.glb", "--background", "#12345"], 2, "#rrggbb"),
        (vec!["scene.glb", "--exposure", "inf"], 2, "--exposure"),
        (vec!["scene.glb", "--time", "noon"], 2, "expected seconds, or none"),
        (vec!["scene.glb", "--aov", "normal"], 2, "--aov"),
        (vec!["scene.glb", "--aov", "beauty"], 2, "--aov"),
        (vec!["scene.glb", "--aov", "reflection", "-o", "out.exr", "--model", "local"], 2, "choose reflection=ray"),
        (
            vec!["scene.glb", "--aov", "refraction", "-o", "out.exr", "--set", "refraction=screen"],
            2,
            "refraction=screen",
        ),
        (vec!["scene.glb", "--repeat", "0"], 2, "--repeat"),
        (vec!["scene.glb", "-o", "out.jpg"], 2, "only .png and .exr"),
        (vec!["scene.glb", "-o", "out"], 2, "only .png and .exr"),
        (vec!["scene.glb", "-o", "out.png"], 2, "named twice"),
        (vec!["scene.glb", "-o", "nowhere/out.png"], 1, "nowhere"),
        (vec!["scene.glb", "-o", "/proc/out.png"], 1, "/proc/out.png"),
        (vec!["scene.glb", "-o", "folder.png"], 1, "folder.png"),
        (vec!["scene.glb", "--report", "nowhere/report.json"], 1, "nowhere"),
        (vec!["scene.glb", "--no-such-option"], 2, "--no-such-option"),
        (vec!["scene.glb", "-q", "-v"], 2, "cannot be used with"),
    ] {
        let mut all = vec!["render"];
        all.extend(&arguments);
        all.extend(out);
        etalon(at, &all, &[]).failed(code, said);
        assert_eq!(files(at), before, "{arguments:?} left a file");
    }
    // Also the outputs that could be written are not when another one cannot.
    etalon(at, &["render", "scene.glb", "-o", "out.png", "-o", "nowhere/out.exr"], &[]).failed(1, "nowhere");
    assert_eq!(files(at), before, "an output beside the one that cannot be written");
    etalon(at, &["diff", "a.png", "b.png"], &[]).failed(1, "a.png");
    etalon(at, &["nonsense"], &[]).failed(2, "nonsense");
}

#[test]
fn without_a_driver_it_says_so() {
    let folder = folder();
    // An empty list of drivers: the loader finds no device.
    let none = [("VK_DRIVER_FILES", "/nonexistent.json"), ("VK_ICD_FILENAMES", "/nonexistent.json")];
    let run = etalon(folder.path(), &["render", "scene.glb", "-o", "out.png"], &none);
    assert!(run.stderr.contains("Vulkan"), "{run:?}");
    run.failed(1, "error:");
    assert_eq!(files(folder.path()), ["scene.glb"]);
}

#[test]
fn stdout_has_the_paths_and_nothing_else() {
    let folder = folder();
    let run = render(folder.path(), &["-o", "a.png", "-o", "b.exr"]).succeeded();
    assert_eq!(run.stdout, "a.png\nb.exr\n");
    assert!(run.stderr.contains("drawing on"), "{run:?}");
    let run = render(folder.path(), &["-o", "c.png", "-q"]).succeeded();
    assert_eq!((run.stdout.as_str(), run.stderr.as_str()), ("c.png\n", ""), "-q is silent");
    let run = render(folder.path(), &["-q"]).succeeded();
    assert_eq!(run.stdout, "scene.png\n", "the scene's name");
    assert_eq!(files(folder.path()), ["a.png", "b.exr", "c.png", "scene.glb", "scene.png"]);
    let same = |name: &str| std::fs::read(folder.path().join(name)).expect("a file");
    assert!(same("a.png") == same("c.png"));
    // Its file also says whose picture it is.
    assert!(pixels(&folder.path().join("a.png")) == pixels(&folder.path().join("scene.png")));
}

#[test]
fn an_old_output_survives_a_failure_and_is_replaced_by_success() {
    let folder = folder();
    let path = folder.path().join("out.png");
    std::fs::write(&path, "old").expect("a file");
    render(folder.path(), &["-o", "out.png", "--camera", "nobody"]).failed(2, "nobody");
    assert_eq!(std::fs::read(&path).expect("a file"), b"old");
    render(folder.path(), &["-o", "out.png"]).succeeded();
    assert_eq!(pixels(&path).dimensions(), (32, 18));
}

#[test]
fn repeats_are_compared_and_the_validation_layer_is_heard() {
    let folder = folder();
    render(folder.path(), &["-o", "a.png", "--repeat", "3", "--validate"]).succeeded();
}

#[test]
fn backgrounds_are_what_was_asked() {
    let folder = folder();
    let corner = |arguments: &[&str]| {
        let mut all = vec!["-q", "-o", "out.png"];
        all.extend(arguments);
        render(folder.path(), &all).succeeded();
        pixels(&folder.path().join("out.png")).get_pixel(31, 0).0
    };
    assert_eq!(corner(&[]), [119, 119, 119, 255]);
    for tonemap in ["linear", "reinhard", "aces", "agx", "khronos-neutral"] {
        assert_eq!(
            corner(&["--background", "#336699", "--tonemap", tonemap, "--exposure", "2"]),
            [0x33, 0x66, 0x99, 255]
        );
    }
    assert_eq!(corner(&["--background", "transparent"]), [0; 4]);
    let image = pixels(&folder.path().join("out.png"));
    assert!(image.pixels().any(|p| p.0[3] == 255), "the triangle is there");
    let partly = image.pixels().filter(|p| (1..255).contains(&p.0[3])).count();
    assert!(partly > 0, "its outline covers pixels in part");
}

/// Every name of `shape` is in `value`, and what is nested too; one element stands for all of a list.
fn has_names(value: &Value, shape: &Value, path: &str) {
    match shape {
        Value::Object(names) => {
            for (name, inner) in names {
                let found = value.get(name).unwrap_or_else(|| panic!("{path}.{name} is missing in {value}"));
                has_names(found, inner, &format!("{path}.{name}"));
            }
        }
        Value::Array(inner) => {
            let list = value.as_array().unwrap_or_else(|| panic!("{path} is no list: {value}"));
            for (element, inner) in list.iter().zip(inner.iter().cycle()) {
                has_names(element, inner, path);
            }
        }
        Value::Number(_) => assert!(value.is_number(), "{path} is no number: {value}"),
        Value::String(text) if text.is_empty() => assert!(value.is_string(), "{path} is no text: {value}"),
        Value::String(text) => assert_eq!(value, text, "{path}"),
        _ => {}
    }
}

#[test]
fn the_report_has_every_name_of_the_contract() {
    let folder = folder();
    let arguments = ["-q", "-o", "a.png", "-o", "a.exr", "--report", "r.json", "--repeat", "2", "--validate"];
    render(folder.path(), &arguments).succeeded();
    let text = std::fs::read_to_string(folder.path().join("r.json")).expect("the report");
    let report: Value = serde_json::from_str(&text).expect("JSON");
    // product.md, "JSON names".
    let times = json!({ "min": 0, "median": 0, "max": 0, "n": 0 });
    let contract = json!({
        "schema": "etalon.report/1",
        "device": { "name": "", "driver": "", "version": "", "type": "cpu", "api": "" },
        "scene": { "path": "", "triangles": 0, "instances": 0, "materials": 0, "lights": 0, "textures": 0 },
        "knobs": { "fresnel": "", "brdf": "", "samples": "", "shadows": "" },
        "plan": {
            "schema": "",
            "effects": [{ "name": "", "state": "", "rung": "", "reason": "", "evidence": null }],
            "passes": [],
            "pipelines": null,
            "buffers": null,
            "warnings": [],
        },
        "passes": [{ "name": "", "gpu_ms": times }],
        "phases_ms": { "start": 0, "load": 0, "bvh": 0, "pipelines": 0, "upload": 0, "frame": 0, "readback": 0, "encode": 0, "total": 0 },
        "work": { "rays": { "primary": 0, "reflection": 0, "refraction": 0, "shadow": 0, "indirect": 0 }, "node_visits": 0, "triangle_tests": 0 },
        "pipelines": { "count": 0, "spirv_bytes": 0 },
        "memory": { "host_peak_bytes": 0, "device_bytes": 0 },
        "image": { "width": 0, "height": 0, "nan": 0, "inf": 0, "negative": 0, "min": 0, "max": 0, "mean": 0 },
        "validation": { "errors": 0, "warnings": 0, "messages": [] },
        "outputs": [{ "path": "", "hash": "" }],
    });
    has_names(&report, &contract, "report");
    assert_eq!(report["scene"]["triangles"], 1);
    assert_eq!(report["image"]["width"], 32);
    assert_eq!(report["passes"][0]["gpu_ms"]["n"], 2, "one time per repeat");
    assert_eq!(report["validation"]["errors"], 0);
    assert_eq!(report["outputs"].as_array().map(Vec::len), Some(2));
    let passes = report["passes"].as_array().expect("passes");
    assert!(passes.len() >= 4 && passes.iter().all(|p| p["gpu_ms"]["min"].as_f64() <= p["gpu_ms"]["max"].as_f64()));
}

#[test]
fn devices_are_listed_as_json() {
    let folder = folder();
    let run = etalon(folder.path(), &["devices", "--json"], &[]).succeeded();
    let document: Value = serde_json::from_str(&run.stdout).expect("one JSON document");
    has_names(
        &document,
        &json!({ "schema": "etalon.devices/1", "devices": [{ "name": "", "driver": "", "version": "", "type": "", "api": "", "missing": [] }] }),
        "devices",
    );
    assert!(document["devices"].as_array().is_some_and(|all| !all.is_empty()));
    let used = document["used"].as_u64().expect("a device that can be used") as usize;
    assert_eq!(document["devices"][used]["missing"], json!([]));
    let plain = etalon(folder.path(), &["devices"], &[]).succeeded();
    assert!(plain.stdout.contains(document["devices"][0]["name"].as_str().expect("a name")));
}

#[test]
fn pictures_are_compared() {
    let folder = folder();
    let at = folder.path();
    render(at, &["-q", "-o", "a.png", "--background", "#000000"]).succeeded();
    render(at, &["-q", "-o", "b.png", "--background", "#808080"]).succeeded();
    let contract = json!({ "schema": "etalon.diff/1", "metric": "flip", "value": 0, "pass": true });
    let diff = |arguments: &[&str]| {
        let mut all = vec!["diff", "--json"];
        all.extend(arguments);
        etalon(at, &all, &[])
    };
    let run = diff(&["a.png", "a.png", "--max", "0"]).succeeded();
    let same: Value = serde_json::from_str(&run.stdout).expect("JSON");
    has_names(&same, &contract, "diff");
    assert_eq!((same["value"].as_f64(), same["max"].as_f64(), &same["pass"]), (Some(0.0), Some(0.0), &json!(true)));
    let run = diff(&["a.png", "b.png", "--max", "0.01", "-o", "map.png"]);
    assert_eq!(run.code, Some(1), "{run:?}");
    let other: Value = serde_json::from_str(&run.stdout).expect("JSON");
    assert!(other["value"].as_f64().is_some_and(|v| v > 0.01) && other["pass"] == json!(false), "{other}");
    assert_eq!(pixels(&at.join("map.png")).dimensions(), (32, 18));
    diff(&["a.png", "b.png"]).succeeded();
}

#[test]
fn layers_come_with_the_exr() {
    let folder = folder();
    let all = "albedo,normal,geometric_normal,position,depth,distance,roughness,metallic,emissive,material,instance";
    render(folder.path(), &["-q", "-o", "a.exr", "--aov", all]).succeeded();
    let bytes = std::fs::read(folder.path().join("a.exr")).expect("an EXR");
    let meta = exr::meta::MetaData::read_from_buffered(bytes.as_slice(), false).expect("a header");
    let names: Vec<String> = meta.headers[0].channels.list.iter().map(|c| c.name.to_string()).collect();
    for name in [
        "R",
        "G",
        "B",
        "A",
        "albedo.R",
        "normal.X",
        "geometric_normal.Z",
        "position.Y",
        "depth.Z",
        "distance.Z",
        "roughness.Y",
        "metallic.Y",
        "emissive.B",
        "material.id",
        "instance.id",
    ] {
        assert!(names.iter().any(|n| n == name), "{name} is not in {names:?}");
    }
}

#[test]
fn parts_of_the_picture_are_layers() {
    let folder = folder();
    let (beside, alone) = ("reflection,normal,refraction", "refraction");
    let run = |out: &str, rest: &[&str]| {
        let all = ["render", "study:etalon", "--size", "32x18", "--device", "cpu", "-o", out];
        etalon(folder.path(), &[&all[..], rest].concat(), &[])
    };
    run("none.exr", &["--report", "none.json"]).succeeded();
    run("both.exr", &["--report", "both.json", "--aov", beside]).succeeded();
    run("one.exr", &["--aov", alone]).succeeded();
    let channels = |name: &str| {
        let image = exr::prelude::read_first_flat_layer_from_file(folder.path().join(name)).expect("an EXR");
        let list = image.layer_data.channel_data.list;
        let all = list.into_iter().map(|c| (c.name.to_string(), c.sample_data.values_as_f32().collect::<Vec<_>>()));
        all.collect::<std::collections::BTreeMap<_, _>>()
    };
    let (none, both, one) = (channels("none.exr"), channels("both.exr"), channels("one.exr"));
    for color in ["R", "G", "B"] {
        assert_eq!(none[color], both[color], "{color} of the picture");
        let [reflection, refraction] = ["reflection", "refraction"].map(|part| &both[&format!("{part}.{color}")]);
        assert!(reflection.iter().sum::<f32>() > 1.0 && refraction.iter().sum::<f32>() > 1.0, "{color}");
        assert_eq!(*refraction, one[&format!("refraction.{color}")]);
        for ((film, a), b) in none[color].iter().zip(reflection).zip(refraction) {
            assert!(*a >= 0.0 && *b >= 0.0 && a + b <= film * (1.0 + 1e-5) + 1e-6, "{film} of {a} and {b}");
        }
    }
    assert!(!one.contains_key("reflection.R"));
    let work = |name: &str| {
        let bytes = std::fs::read(folder.path().join(name)).expect("a report");
        serde_json::from_slice::<Value>(&bytes).expect("JSON")["work"].clone()
    };
    assert_eq!(work("none.json"), work("both.json"));
    // Nothing there mirrors: a layer of zeros, and that is said.
    let run = render(folder.path(), &["-o", "zero.exr", "--aov", "refraction"]).succeeded();
    assert!(run.stderr.contains("the layer is 0"), "{run:?}");
    assert!(channels("zero.exr")["refraction.G"].iter().all(|value| *value == 0.0));
}
