//! A file shown with no option: its light and its exposure, and the sentences that say them
//! (docs/decisions/first-look.md).

#[path = "support/program.rs"]
mod program;

use std::path::Path;

use etalon_testing::gltf_builder::Builder;
use program::{HASTY, Run, etalon};
use serde_json::{Value, json};
use tempfile::TempDir;

/// A folder with `scene.glb`: a square of two metres that faces +Z, of this material, with these lights at z = 1.
fn folder(material: Value, lights: &[Value]) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let mut b = Builder::new();
    let position = b.floats("VEC3", &[-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 1.0, 1.0, 0.0, -1.0, 1.0, 0.0]);
    let normal = b.floats("VEC3", &[0.0, 0.0, 1.0].repeat(4));
    let indices = b.indices(&[0, 1, 2, 0, 2, 3]);
    let material = b.push("materials", material);
    let attributes = json!({ "POSITION": position, "NORMAL": normal });
    let mesh = b.mesh(json!({ "attributes": attributes, "indices": indices, "material": material }));
    b.root(json!({ "mesh": mesh }));
    if !lights.is_empty() {
        b.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": lights } });
        for light in 0..lights.len() {
            b.root(json!({ "translation": [0, 0, 1], "extensions": { "KHR_lights_punctual": { "light": light } } }));
        }
    }
    b.json["extensionsUsed"] = json!(["KHR_lights_punctual", "KHR_materials_emissive_strength"]);
    b.save_glb(folder.path());
    folder
}

fn emitting(radiance: f64) -> Value {
    json!({
        "pbrMetallicRoughness": { "baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0 },
        "emissiveFactor": [1, 1, 1],
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": radiance } },
    })
}

fn white() -> Value {
    json!({ "pbrMetallicRoughness": { "metallicFactor": 0, "roughnessFactor": 1 } })
}

fn sun(lux: f64) -> Value {
    json!({ "type": "directional", "intensity": lux })
}

fn run(folder: &Path, line: &str) -> Run {
    etalon(folder, &line.split_whitespace().collect::<Vec<_>>(), &HASTY).succeeded()
}

/// Draws `scene.glb` at 48x32 with more options; returns its messages, the report and the colour in the middle.
fn shown(folder: &TempDir, more: &str) -> (String, Value, [u8; 3]) {
    let at = folder.path();
    let line = format!("render scene.glb --size 48x32 --set samples=1 -o out.png -o out.exr --report out.json {more}");
    let said = run(at, &line).stderr;
    let report = std::fs::read(at.join("out.json")).expect("a report");
    let picture = image::open(at.join("out.png")).expect("a PNG").into_rgb8();
    (said, serde_json::from_slice(&report).expect("JSON"), picture.get_pixel(24, 16).0)
}

#[test]
fn a_picture_that_would_be_white_or_black_is_exposed_by_its_luminance() {
    // log2(0.5 / 1000) is −10.97 and log2(0.5 / 0.001) is 8.97; rounded to tenths they bring 1000 to 0.4883 and 0.001
    // to 0.512. Khronos PBR Neutral subtracts 0.04 of both; the sRGB encoding of 0.4483 is 178.6, that of 0.472 182.7.
    for (radiance, stops, byte) in [(1000.0, -11.0, 179), (0.001, 9.0, 183)] {
        let folder = folder(emitting(radiance), &[]);
        let (said, report, middle) = shown(&folder, "--env none");
        assert_eq!(report["exposure"]["stops"], json!(stops), "{said}");
        assert_eq!(report["exposure"]["from"], json!("metered"));
        assert!(said.contains(&format!("exposure {stops:+.1}")) && said.contains("--exposure 0 keeps 0"), "{said}");
        assert_eq!(middle, [byte; 3]);
        let exposed = std::fs::read(folder.path().join("out.exr")).expect("an EXR");
        let (said, report, middle) = shown(&folder, "--env none --exposure 0");
        assert_eq!(report["exposure"], json!({ "stops": 0.0, "from": "given" }));
        assert!(!said.contains("exposure +") && !said.contains("exposure -"), "{said}");
        assert!(middle.iter().all(|byte| *byte >= 254 || *byte <= 3), "{middle:?}");
        assert!(exposed == std::fs::read(folder.path().join("out.exr")).expect("an EXR"), "an EXR is not exposed");
    }
}

#[test]
fn what_can_be_read_keeps_its_bits() {
    for folder in [folder(white(), &[]), folder(white(), &[sun(2.0)]), folder(emitting(0.4), &[])] {
        let (said, report, _) = shown(&folder, "");
        let png = std::fs::read(folder.path().join("out.png")).expect("a PNG");
        assert_eq!(report["exposure"], json!({ "stops": 0.0, "from": "default" }), "{said}");
        shown(&folder, "--exposure 0");
        assert!(png == std::fs::read(folder.path().join("out.png")).expect("a PNG"));
    }
    // log2(0.5 / 0.4) is 0.32.
    let (said, report, _) = shown(&folder(emitting(0.4), &[]), "--env none --exposure auto");
    assert_eq!(report["exposure"]["stops"], json!(0.3), "{said}");
}

#[test]
fn parts_and_frames_have_the_exposure_of_the_whole() {
    let folder = folder(white(), &[sun(68_300.0)]);
    let at = folder.path();
    let (said, report, _) = shown(&folder, "");
    // White paper of radiance 68,300 / π takes −15.4 stops; the dielectric layer adds or takes a few per cent.
    let stops = report["exposure"]["stops"].as_f64().expect("a number");
    assert!((-15.5..=-15.2).contains(&stops), "{said}");
    for index in 1..=2 {
        run(at, &format!("render scene.glb --size 48x32 --set samples=1 --shard {index}/2 -o {index}.part"));
    }
    run(at, "merge 1.part 2.part -o merged.png");
    let bytes = |name: &str| std::fs::read(at.join(name)).expect("a file");
    assert!(bytes("merged.png") == bytes("out.png"));
    // The second frame sees the square from behind: dark, and all the same at the exposure of the first.
    run(at, "render scene.glb --size 48x32 --set samples=1 --turntable 2 --report all.json -o {frame}.png");
    run(
        at,
        "render scene.glb --size 48x32 --set samples=1 --turntable 2 --frames 1 --report one.json -o only{frame}.png",
    );
    let [all, one]: [Value; 2] = ["all.json", "one.json"].map(|n| serde_json::from_slice(&bytes(n)).expect("JSON"));
    assert_eq!(all["exposure"], one["exposure"]);
    assert_eq!(all["exposure"]["from"], json!("metered"));
    assert!(bytes("1.png") == bytes("only1.png"));
}

#[test]
fn what_lights_a_file_follows_from_what_it_contains() {
    let lit = |folder: &TempDir, more: &str| {
        let (said, report, _) = shown(folder, more);
        let lit_by = report["lit_by"].clone();
        // The last line says it, and no other line does.
        assert!(said.trim_end().ends_with(lit_by["sentence"].as_str().expect("a sentence")), "{said}");
        assert_eq!(said.matches("lit by").count(), 1, "{said}");
        (lit_by["environment"].clone(), lit_by["factor"].clone(), lit_by["lights"].clone())
    };
    let plain = folder(white(), &[]);
    assert_eq!(lit(&plain, ""), (json!("studio"), json!(1.0), json!(0)));
    assert_eq!(lit(&plain, "--env none"), (Value::Null, json!(0.0), json!(0)));
    let lamp = folder(white(), &[sun(1.0)]);
    assert_eq!(lit(&lamp, ""), (json!("studio"), json!(0.5), json!(1)));
    assert_eq!(lit(&lamp, "--env none"), (Value::Null, json!(0.0), json!(1)));
    assert_eq!(lit(&lamp, "--background env"), (json!("studio"), json!(1.0), json!(1)));
    let panel = folder(emitting(10.0), &[]);
    assert_eq!(lit(&panel, "--model local"), (json!("studio"), json!(1.0), json!(0)));
    for follows in ["", "--model global", "--model local --set lights=area:1"] {
        assert_eq!(lit(&panel, follows), (Value::Null, json!(0.0), json!(0)), "{follows}");
    }
    assert_eq!(lit(&panel, "--model global --background env"), (json!("studio"), json!(1.0), json!(0)));
    // Letters that glow as white paper does are no lamp.
    assert_eq!(lit(&folder(emitting(1.0), &[]), "--model global"), (json!("studio"), json!(1.0), json!(0)));
}

#[test]
fn no_picture_is_black_without_a_word() {
    let dark = folder(white(), &[]);
    assert!(shown(&dark, "--env none").0.contains("no light reaches what the camera sees"));
    let away = shown(&dark, "--env none --eye 0,0,5 --target 0,0,9").0;
    assert!(away.contains("the camera sees no surface of the scene"), "{away}");
    let close = "--env none --eye 0,0,0.1 --target 0,0,0 --exposure 0";
    assert!(shown(&dark, close).0.contains("the picture is black"));
    assert!(shown(&folder(emitting(1e6), &[]), close).0.contains("the picture is white"));
}
