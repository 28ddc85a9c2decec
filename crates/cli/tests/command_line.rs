//! What the command line says about itself and does with paths: help and its examples, lists of scenes and knobs,
//! scenes in place of commands, standard input and output, names of outputs, the last line of a picture, folders,
//! Ctrl-C.

#[path = "support/program.rs"]
mod program;

use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use etalon::plan::{KNOBS, Model};
use etalon::study;
use etalon_testing::gltf_builder::Builder;
use program::{HASTY, Run, etalon};
use serde_json::{Value, json};
use tempfile::TempDir;

/// Saves a scene of one triangle as `scene.glb` into `folder`, with a change to its JSON.
fn triangle(folder: &Path, change: impl FnOnce(&mut Value)) {
    let mut b = Builder::new();
    let position = b.triangle();
    let mesh = b.mesh(json!({ "attributes": { "POSITION": position } }));
    b.root(json!({ "mesh": mesh }));
    change(&mut b.json);
    std::fs::create_dir_all(folder).expect("a folder");
    b.save_glb(folder);
}

fn folder() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    triangle(folder.path(), |_| ());
    folder
}

const SMALL: [&str; 6] = ["--size", "32x18", "--device", "cpu", "--set", "samples=1"];

/// Runs the program with bytes on its standard input; returns the bytes of its standard output as well.
fn fed(folder: &Path, arguments: &[&str], input: &[u8]) -> (Vec<u8>, Run) {
    let mut child = program::command(folder)
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    // A program that refuses its arguments reads nothing.
    drop(child.stdin.take().expect("a pipe").write_all(input));
    let output = child.wait_with_output().expect("it ends");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let run = Run { code: output.status.code(), stdout: text(&output.stdout), stderr: text(&output.stderr) };
    (output.stdout, run)
}

/// The calls under "Examples:" in the help of a command.
fn examples(command: &clap::Command) -> Vec<String> {
    let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    help.lines().filter_map(|line| line.strip_prefix("    ")).map(str::to_owned).collect()
}

#[test]
fn every_command_has_examples_and_each_runs() {
    let folder = folder();
    let at = folder.path();
    std::fs::create_dir(at.join("models")).expect("a folder");
    std::fs::copy(at.join("scene.glb"), at.join("models/scene.glb")).expect("a copy");
    for name in ["picture.png", "golden.png"] {
        let draw = ["render", "scene.glb", "-q", "-o", name];
        etalon(at, &[&draw[..], &SMALL].concat(), &HASTY).succeeded();
    }
    let program = etalon_cli::arguments::command();
    let mut ran = 0;
    for command in std::iter::once(&program).chain(program.get_subcommands()) {
        let name = command.get_name();
        let calls = examples(command);
        // Without the window, `view` only says that it is missing.
        let is_missing = name == "view" && !cfg!(feature = "window");
        assert!(is_missing || !calls.is_empty(), "{name} has no example");
        for call in calls {
            let (call, _) = call.split_once(" > ").unwrap_or((&call, ""));
            let (call, input) = call.split_once(" < ").unwrap_or((call, ""));
            let mut words: Vec<&str> = call.split(' ').collect();
            assert_eq!(words.remove(0), "etalon", "{call}");
            let size = words.iter().position(|word| *word == "--size");
            if let Some(size) = size {
                words.drain(size..size + 2);
            }
            match words[0] {
                // A window needs a display, and a whole measurement some minutes: the program knows their options.
                "view" => {
                    let parsed = program.clone().try_get_matches_from([&["etalon"], &words[..]].concat());
                    parsed.unwrap_or_else(|error| panic!("{call}: {error}"));
                    continue;
                }
                "cost" if !words.contains(&"--compare") => continue,
                "render" => words.extend(SMALL),
                "plan" if !words.contains(&"models") => words.extend(SMALL),
                "cost" => words.extend(&SMALL[..4]),
                _ => {}
            }
            let input = if input.is_empty() { Vec::new() } else { std::fs::read(at.join(input)).expect("a file") };
            let (_, run) = fed(at, &words, &input);
            assert_eq!(run.code, Some(0), "{name}: {call}: {run:?}");
            ran += 1;
        }
    }
    assert!(ran > 20, "{ran} examples");
}

#[test]
fn options_are_in_groups() {
    let folder = folder();
    let help = etalon(folder.path(), &["render", "--help"], &[]).succeeded().stdout;
    let heading = |option: &str| {
        let at = help.find(&format!("{option} <")).unwrap_or_else(|| panic!("{option} is not in {help}"));
        help[..at]
            .lines()
            .rev()
            .find(|line| line.ends_with(':') && !line.starts_with(' '))
            .expect("a heading")
            .to_owned()
    };
    assert_eq!(heading("--eye"), "Camera:");
    assert_eq!(heading("--env-rotation"), "Environment and background:");
    assert_eq!(heading("--within"), heading("--max-error"));
    assert_ne!(heading("--color"), heading("--env"));
    assert_eq!(heading("--progress"), heading("--color"));
    // What a command refuses is not in its help.
    for (command, refused) in [("cost", "--max-error"), ("cost", "--plan"), ("view", "--max-error")] {
        let help = etalon(folder.path(), &[command, "--help"], &[]).succeeded().stdout;
        assert!(!help.contains(refused), "{command}: {help}");
    }
}

#[test]
fn scenes_and_knobs_are_listed() {
    let folder = folder();
    let run = |arguments: &[&str]| etalon(folder.path(), arguments, &[]).succeeded().stdout;
    let document = |arguments: &[&str]| serde_json::from_str::<Value>(&run(arguments)).expect("JSON");
    let scenes = run(&["scenes"]);
    for (name, about) in study::SCENES {
        assert!(
            scenes
                .lines()
                .any(|line| line.contains(&format!("study:{name} ")) && line.contains(&about[..20.min(about.len())])),
            "{name}: {scenes}"
        );
    }
    let scenes = document(&["scenes", "--json"]);
    assert_eq!(scenes["schema"], "etalon.scenes/1");
    assert_eq!(scenes["scenes"].as_array().map(Vec::len), Some(study::SCENES.len()));
    let table = run(&["knobs"]);
    let knobs = document(&["knobs", "--json"]);
    for (knob, json) in KNOBS.iter().zip(knobs["knobs"].as_array().expect("a list")) {
        assert!(table.lines().any(|line| line.trim_start().starts_with(knob.name)), "{}: {table}", knob.name);
        assert_eq!(
            (&json["name"], &json["rungs"], &json["rung_about"], &json["exact"]),
            (&json!(knob.name), &json!(knob.rungs), &json!(knob.rung_about), &json!(knob.exact))
        );
        assert_eq!(json["presets"]["local"], knob.presets[Model::Local as usize]);
        assert_eq!(json["presets"]["global"], knob.presets[Model::Global as usize]);
    }
    let shadows = run(&["knobs", "shadows"]);
    for said in [
        "shadow maps",
        "No shadows: every light reaches every surface that faces it.",
        "map",
        "--model local",
        "R5",
        "depth images",
        "cost SCENE --compare shadows=off,ray",
    ] {
        assert!(shadows.contains(said), "{said}: {shadows}");
    }
    let one = document(&["knobs", "fresnel", "--json"]);
    assert_eq!((one["knobs"].as_array().map(Vec::len), &one["knobs"][0]["name"]), (Some(1), &json!("fresnel")));
    etalon(folder.path(), &["knobs", "gloss"], &[]).failed(2, "possible values: shadows");
}

#[test]
fn an_unknown_option_gets_a_tip_that_helps() {
    let folder = folder();
    let run = etalon(folder.path(), &["render", "scene.glb", "--samples", "16"], &[]);
    assert!(!run.stderr.contains("--frames"), "{run:?}");
    run.failed(2, "--set samples=4");
    let run = etalon(folder.path(), &["render", "scene.glb", "-s", "16"], &[]);
    assert!(!run.stderr.contains("as a value"), "{run:?}");
    run.failed(2, "unexpected argument '-s'");
    etalon(folder.path(), &["render", "scene.glb", "--exposre", "1"], &[]).failed(2, "--exposure");
}

/// A scene with a file that does not exist shows that the value is found before it is loaded.
#[test]
fn wrong_values_are_found_before_the_scene_is_loaded() {
    let folder = folder();
    for wrong in [
        "--time abc",
        "--set foo=1",
        "-o x.jpg",
        "-o x.png --format exr",
        "--format exr",
        "--within 0",
        "--size 0x0",
        "--fov 0",
        "--up 0,0,0",
        "--eye 1,1,1 --target 1,1,1",
        "--size 100000x100000",
        "--exposure inf",
        "--env-intensity -1",
        "--env none --background env",
        "--env none --env-rotation 5",
        "--max-error 0",
        "--model local --max-error 2%",
        "--aov normal -o a.png",
        "--aov variance -o a.exr",
        "-o a.png -o ./a.png",
        "-o a.png --report a.png",
        "--format png -o missing.glb",
        "-o a.png --report ./missing.glb",
        "--shard 1/2 -o missing.glb",
        "--turntable 2 --report missing.glb",
        "--turntable 2 -o {frame}.png -o a.apng --env a.apng",
        "--frames 1-2 -o a.png",
        "--shard 1/2",
        "--keep --repeat 2",
        "--model local --set indirect=path",
        "--turntable 2 --max-error 1%",
    ] {
        let words = [&["render", "missing.glb"][..], &wrong.split(' ').collect::<Vec<_>>()].concat();
        let run = etalon(folder.path(), &words, &[]);
        assert!(!run.stderr.contains("loading"), "{wrong}: {run:?}");
        of_a_value(run);
    }
    for device in ["nothing", "99"] {
        let run = etalon(folder.path(), &["render", "missing.glb", "--device", device], &[]);
        assert!(!run.stderr.contains("no such file"), "{run:?}");
        run.failed(2, "Vulkan offers");
    }
    for wrong in [
        "render study:nothing",
        "render study:pool --time 1",
        "plan study:pool --variant 1",
        "plan missing.glb --max-error 1%",
        "eval nothing x=1",
        "plot nothing --over x=0..1",
        "plot fresnel_dielectric --over theta=0..90 cos_in=0.5 n=1.5 kappa=0",
        "plot fresnel_dielectric --over cos_in=0..1 --each nn=1.3,1.7 n=1.5 kappa=0",
        "plot fresnel_dielectric --over n=1..2 --each n=1.3,1.7 cos_in=1 kappa=0",
        "plot fresnel_dielectric --over n=1..2 n=1.5 cos_in=1 kappa=0",
        "verify --function nothing",
        "eval critical_angle n_in=10",
        "diff a.png b.png --max NaN",
        "diff - -",
        "diff a.png b.png -o a.png",
    ] {
        of_a_value(etalon(folder.path(), &wrong.split(' ').collect::<Vec<_>>(), &[]));
    }
}

/// It is refused, and not because a word of the test is none of the program's any more.
#[track_caller]
fn of_a_value(run: Run) {
    let run = run.failed(2, "");
    for said in ["unexpected argument", "unrecognized subcommand"] {
        assert!(!run.stderr.contains(said), "{run:?}");
    }
}

#[test]
fn missing_images_are_an_error_or_a_checker() {
    let folder = folder();
    triangle(folder.path(), |json| {
        json["images"] = json!([{ "uri": "gone.png" }]);
        json["textures"] = json!([{ "source": 0 }]);
        json["materials"] = json!([{ "emissiveTexture": { "index": 0 }, "emissiveFactor": [1, 1, 1] }]);
        json["meshes"][0]["primitives"][0]["material"] = json!(0);
    });
    let render = |missing: &[&str]| {
        let words = [&["render", "scene.glb", "-o", "out.png"], &SMALL[..], missing].concat();
        etalon(folder.path(), &words, &HASTY)
    };
    for refused in [&[][..], &["--missing", "error"]] {
        render(refused).failed(1, "image 0 \"gone.png\": gone.png: no such file or folder; --missing checker");
        assert!(!folder.path().join("out.png").exists());
    }
    let run = render(&["--missing", "checker"]).succeeded();
    let warning =
        "image 0 \"gone.png\" cannot be read (gone.png: no such file or folder): a checker stands in its place";
    assert!(run.stderr.contains(warning), "{run:?}");
    assert!(folder.path().join("out.png").exists());
    etalon(folder.path(), &["plan", "scene.glb"], &[]).failed(1, "gone.png");
    etalon(folder.path(), &["plan", "scene.glb", "--missing", "checker"], &[]).succeeded();
    render(&["--missing", "nothing"]).failed(2, "nothing");
}

#[test]
fn a_scene_alone_opens_the_window() {
    let folder = folder();
    std::fs::write(folder.path().join("notes"), "").expect("a file");
    let nothing = [("DISPLAY", ""), ("WAYLAND_DISPLAY", ""), ("WAYLAND_SOCKET", "")];
    let window = if cfg!(feature = "window") { "opening a window" } else { "this build has no window" };
    for scene in [&["scene.glb"][..], &["study:pool"], &["-q", "scene.glb"], &["--color", "never", "scene.glb"]] {
        let run = etalon(folder.path(), scene, &nothing);
        assert!(run.stderr.contains(window), "{run:?}");
        run.failed(1, "etalon render SCENE");
    }
    etalon(folder.path(), &["https://example.org/a.glb"], &nothing).failed(1, "etalon render SCENE");
    etalon(folder.path(), &["scenery"], &nothing).failed(2, "unrecognized subcommand");
}

#[test]
fn messages_of_other_libraries_are_printed_on_request() {
    let messages = |words: &[&str]| {
        let words = [&["etalon"][..], words, &["devices"]].concat();
        etalon_cli::arguments::parse(words.into_iter().map(Into::into).collect()).expect("a command").messages()
    };
    let window = "winit::platform_impl::linux::x11::monitor";
    assert!(!messages(&[]).would_enable(window, &tracing::Level::WARN));
    assert!(messages(&[]).would_enable(window, &tracing::Level::ERROR));
    assert!(messages(&["-v"]).would_enable(window, &tracing::Level::WARN));
    for own in ["etalon::frame", "etalon_cli::render", "etalon_viewer"] {
        assert!(messages(&[]).would_enable(own, &tracing::Level::WARN), "{own}");
        assert!(!messages(&["-q"]).would_enable(own, &tracing::Level::WARN), "{own}");
    }
}

#[test]
fn a_scene_comes_from_standard_input_and_a_picture_goes_to_standard_output() {
    let folder = folder();
    let at = folder.path();
    let scene = std::fs::read(at.join("scene.glb")).expect("a file");
    let file = [&["render", "scene.glb", "-o", "file.png"], &SMALL[..]].concat();
    etalon(at, &file, &[]).succeeded();
    let picture = std::fs::read(at.join("file.png")).expect("a picture");
    let (bytes, run) = fed(at, &[&["render", "-", "-o", "-"], &SMALL[..]].concat(), &scene);
    assert!(run.code == Some(0) && bytes == picture, "{run:?}");
    let (bytes, run) = fed(at, &[&["render", "-", "-o", "also.png", "-o", "-"], &SMALL[..]].concat(), &scene);
    assert!(run.code == Some(0) && bytes == picture && std::fs::read(at.join("also.png")).is_ok_and(|b| b == picture));
    let drawn = |output: &[&str]| fed(at, &[&["render", "-"], output, &SMALL[..]].concat(), &scene);
    assert_eq!(drawn(&["-o", "also.exr", "-o", "unnamed", "--format", "png"]).1.code, Some(0));
    assert!(std::fs::read(at.join("unnamed")).is_ok_and(|bytes| bytes == picture));
    let (bytes, run) = drawn(&["-o", "-", "--format", "exr"]);
    assert!(run.code == Some(0) && std::fs::read(at.join("also.exr")).is_ok_and(|radiance| radiance == bytes));
    let (_, run) = fed(at, &[&["plan", "-", "--json"], &SMALL[..]].concat(), &scene);
    let plan: Value = serde_json::from_str(&run.stdout).expect("JSON");
    assert_eq!(plan["schema"], "etalon.plan/1");
    let (_, run) = fed(at, &["diff", "file.png", "-", "--max", "0"], &picture);
    assert_eq!((run.code, run.stdout.as_str()), (Some(0), "flip 0\n"), "{run:?}");
    fed(at, &[&["render", "-"], &SMALL[..]].concat(), &scene).1.failed(2, "name the output");
    fed(at, &[&["render", "-", "-o", "a.png"], &SMALL[..]].concat(), b"nonsense").1.failed(1, "loading standard input");
    fed(at, &["diff", "-", "file.png"], b"nonsense").1.failed(1, "reading standard input");
    let openjd = [&["render", "-", "-o", "-", "--progress", "openjd"], &SMALL[..]].concat();
    assert_eq!(fed(at, &openjd, &scene).1.code, Some(2));
    assert!(!at.join("-").exists() && !at.join("-.png").exists());
}

#[test]
fn no_picture_replaces_one_of_another_scene_unasked() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    for name in ["a", "b"] {
        triangle(&at.join(name), |_| ());
    }
    let draw = |more: &[&str]| etalon(at, &[&["render"], more, &SMALL].concat(), &[]);
    draw(&["a/scene.glb"]).succeeded();
    // The same scene again, with other settings and by another path.
    draw(&["./a/../a/scene.glb", "--env", "none"]).succeeded();
    let first = std::fs::read(at.join("scene.png")).expect("a picture");
    draw(&["b/scene.glb"]).failed(1, "scene.png exists and may be a picture of another scene");
    draw(&["b/scene.glb", "--turntable", "1"]).failed(1, "may be a picture of another scene");
    assert_eq!(std::fs::read(at.join("scene.png")).expect("a picture"), first);
    draw(&["b/scene.glb", "-o", "scene.png"]).succeeded();
    // Now nobody knows whose it is.
    draw(&["a/scene.glb"]).failed(1, "-o scene.png replaces it");
    let frames = ["--turntable", "2"];
    draw(&[&["a/scene.glb"], &frames[..]].concat()).succeeded();
    draw(&[&["a/scene.glb", "--env", "none"], &frames[..]].concat()).succeeded();
    draw(&[&["b/scene.glb"], &frames[..]].concat()).failed(1, "scene.0000.png exists");
}

#[test]
fn no_picture_replaces_a_texture_of_its_scene() {
    let folder = folder();
    let at = folder.path();
    // Every picture of this scene is named like one of its textures.
    etalon(at, &[&["render", "scene.glb", "-o", "paint.0000.png"], &SMALL[..]].concat(), &HASTY).succeeded();
    let paint = std::fs::read(at.join("paint.0000.png")).expect("a picture");
    triangle(at, |json| {
        json["images"] = json!([{ "uri": "paint.0000.png" }]);
        json["textures"] = json!([{ "source": 0 }]);
        json["materials"] = json!([{ "emissiveTexture": { "index": 0 }, "emissiveFactor": [1, 1, 1] }]);
        json["meshes"][0]["primitives"][0]["material"] = json!(0);
    });
    std::fs::write(at.join("scene.mtl"), "newmtl paint\nmap_Kd paint.0000.png\nmap_Bump -bm 0.5 dents.png\n")
        .expect("a library");
    let object = "mtllib scene.mtl\nusemtl paint\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    std::fs::write(at.join("scene.obj"), object).expect("a scene");
    for scene in ["scene.glb", "scene.obj"] {
        for (outputs, named) in [
            (&["-o", "paint.0000.png"][..], "--output paint.0000.png: the scene names this file"),
            (&["-o", "./paint.0000.png", "--shard", "1/2"], "--output ./paint.0000.png"),
            (&["-o", "paint.{frame:04}.png", "--turntable", "2"], "--output paint.0000.png"),
            (&["-o", "out.png", "--report", "paint.0000.png"], "--report paint.0000.png"),
        ] {
            etalon(at, &[&["render", scene], outputs, &SMALL].concat(), &HASTY).failed(2, named);
        }
    }
    // Files that a scene names, read or not, and a buffer beside it.
    let mut b = Builder::new();
    let position = b.triangle();
    let mesh = b.mesh(json!({ "attributes": { "POSITION": position } }));
    b.root(json!({ "mesh": mesh }));
    b.save_gltf(at, "my%20mesh.bin");
    let glb = b.glb();
    std::fs::write(at.join("my mesh.bin"), &glb[glb.len() - 36..]).expect("a buffer");
    for (scene, named) in [("scene.obj", "scene.mtl"), ("scene.obj", "dents.png"), ("scene.gltf", "my mesh.bin")] {
        let arguments = ["render", scene, "-o", "out.png", "--report", named];
        let said = format!("--report {named}: the scene names this file; choose another name");
        etalon(at, &[&arguments, &SMALL[..]].concat(), &HASTY).failed(2, &said);
    }
    assert_eq!(std::fs::read(at.join("paint.0000.png")).expect("a picture"), paint);
}

#[test]
fn the_last_line_says_what_was_drawn() {
    let folder = folder();
    let draw = |arguments: &[&str]| {
        let all = [&["render"], arguments, &["--size", "32x18", "--device", "cpu", "-o", "a.png"]].concat();
        let run = etalon(folder.path(), &all, &HASTY).succeeded();
        assert_eq!(run.stdout, "a.png\n");
        run.stderr.lines().last().unwrap_or_default().to_owned()
    };
    let line = draw(&["scene.glb"]);
    assert!(
        line.starts_with("32x18, 4 samples per pixel, ") && line.ends_with(" s, lit by the built-in studio"),
        "{line}"
    );
    let line = draw(&["scene.glb", "--env", "none", "--set", "samples=1"]);
    assert!(line.starts_with("32x18, 1 sample per pixel, ") && line.ends_with("lit by nothing"), "{line}");
    let line = draw(&["study:lamps", "--set", "samples=1"]);
    let named =
        study::load("lamps").expect("a scene").lights.iter().any(|light| line.contains(&format!("\"{}\"", light.name)));
    assert!(named && !line.contains("studio"), "{line}");
    let line = draw(&["study:cornell", "--model", "global", "--set", "samples=4"]);
    assert!(line.contains("estimated error ") && line.contains(" %, lit by "), "{line}");
    assert!(line.contains("emissive surfaces"), "{line}");
    for quiet in [&["-q"][..], &["--progress", "json"], &["--progress", "never"]] {
        assert!(!draw(&[&["scene.glb"], quiet].concat()).contains("lit by"), "{quiet:?}");
    }
}

#[test]
fn outputs_are_short_until_more_is_asked_for() {
    let folder = folder();
    let at = folder.path();
    let verify = ["verify", "--device", "cpu", "--function", "refract", "--cases", "1000"];
    let short = etalon(at, &verify, &[]).succeeded().stdout;
    assert!(short.lines().count() == 1 && short.contains("bounds hold"), "{short}");
    let whole = etalon(at, &[&verify[..], &["-v"]].concat(), &[]).succeeded().stdout;
    assert!(whole.lines().count() > 5 && whole.contains("worst input") && whole.ends_with(&short), "{whole}");
    // A vector whose expected value is wrong breaks the bounds of two tiers.
    std::fs::write(at.join("fresnel_dielectric.csv"), "cos_in,n,=F\n1,1.5,0.5\n").expect("a file");
    let broken = etalon(at, &["verify", "--device", "cpu", "--vectors", "fresnel_dielectric.csv"], &[]);
    assert_eq!(broken.code, Some(1), "{broken:?}");
    assert!(broken.stdout.contains("FAILS") && !broken.stdout.contains("fast"), "{broken:?}");
    for (name, color) in [("a.png", "#000000"), ("b.png", "#808080")] {
        let draw = ["render", "scene.glb", "-q", "--env", "none", "--background", color, "-o", name];
        etalon(at, &[&draw[..], &SMALL].concat(), &[]).succeeded();
    }
    let short = etalon(at, &["diff", "a.png", "b.png"], &[]).succeeded().stdout;
    let value = short.trim_end().strip_prefix("flip 0.").unwrap_or_else(|| panic!("{short}"));
    assert!((3..=6).contains(&value.len()), "{short}");
    let whole = etalon(at, &["diff", "a.png", "b.png", "-v"], &[]).succeeded().stdout;
    assert!(whole.contains("32x18") && whole.contains("largest error") && whole.len() > short.len(), "{whole}");
}

#[test]
fn a_folder_tells_which_extensions_its_files_need() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let uses = |place: &str, used: &[&str], required: &[&str]| {
        triangle(&at.join(place), |json| {
            json["extensionsUsed"] = json!(used);
            json["extensionsRequired"] = json!(required);
        });
    };
    uses("all/plain", &[], &[]);
    uses("all/drawn", &["KHR_materials_ior", "KHR_materials_sheen"], &["KHR_materials_ior"]);
    uses("all/deep/ignored", &["KHR_materials_ior", "EXT_nothing"], &[]);
    uses("all/deep/refused", &["EXT_nothing"], &["EXT_nothing"]);
    std::fs::write(at.join("all/broken.glb"), "nonsense").expect("a file");
    std::fs::write(at.join("all/readme.txt"), "no scene").expect("a file");
    let plan = |more: &[&str]| etalon(at, &[&["plan", "all"], more].concat(), &[]);
    let json: Value = serde_json::from_str(&plan(&["--json"]).succeeded().stdout).expect("JSON");
    assert_eq!((&json["schema"], &json["files"]), (&json!("etalon.extensions/1"), &json!(5)));
    let row = |name: &str, used: u32, required: u32, state: &str| json!({ "name": name, "used": used, "required": required, "state": state });
    let rows = [
        row("EXT_nothing", 2, 1, "refused"),
        row("KHR_materials_ior", 2, 1, "drawn"),
        row("KHR_materials_sheen", 1, 0, "drawn"),
    ];
    assert_eq!(json["extensions"], json!(rows));
    let failures = json["failures"].as_array().expect("a list");
    assert_eq!(failures.len(), 2, "{json}");
    let said = |path: &str, words: &str| {
        failures.iter().any(|f| f["path"] == path && f["error"].as_str().is_some_and(|error| error.contains(words)))
    };
    assert!(said("all/broken.glb", "GLB"), "{json}");
    assert!(said("all/deep/refused/scene.glb", "requires the extension EXT_nothing"), "{json}");
    let text = plan(&[]).succeeded().stdout;
    assert!(text.contains("KHR_materials_sheen") && text.contains("3 of 5 files can be read"), "{text}");
    assert!(text.contains("loading all/deep/refused/scene.glb: the file requires"), "{text}");
    plan(&["--model", "global"]).failed(2, "this is a folder");
    std::fs::create_dir(at.join("none")).expect("a folder");
    etalon(at, &["plan", "none"], &[]).failed(1, "there is no .gltf or .glb file");
}

/// Whether this process ignores SIGINT, by the mask of ignored signals where the system tells it.
#[cfg(unix)]
fn ignores_interrupts() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask & 2 != 0)
}

#[cfg(unix)]
#[test]
fn ctrl_c_keeps_the_picture_where_asked() {
    let folder = folder();
    let at = folder.path();
    let interrupted = |name: &str, more: &[&str]| {
        let draw = [
            "render",
            "study:cornell",
            "--size",
            "128x72",
            "--model",
            "global",
            "--set",
            "samples=4096",
            "--device",
            "cpu",
        ];
        let mut child = program::command(at)
            .args([&draw[..], &["-o", name], more].concat())
            .stdout(Stdio::null())
            .stderr(std::fs::File::create(at.join("stderr")).expect("a file"))
            .spawn()
            .expect("the program starts");
        let begun = Instant::now();
        // A picture so far exists once the first estimate of its error is printed.
        while !std::fs::read_to_string(at.join("stderr")).expect("a file").contains("samples, estimated error") {
            assert!(begun.elapsed() < Duration::from_secs(120), "nothing is drawn");
            assert_eq!(child.try_wait().expect("its state"), None, "it has ended");
            std::thread::sleep(Duration::from_millis(50));
        }
        Command::new("sh").args(["-c", &format!("kill -INT {}", child.id())]).status().expect("a shell");
        let status = child.wait().expect("it ends");
        let code = status.code().or_else(|| std::os::unix::process::ExitStatusExt::signal(&status).map(|s| 128 + s));
        assert_eq!(code, Some(130), "{name}");
        std::fs::read_to_string(at.join("stderr")).expect("a file")
    };
    // A job in a shell's background ignores SIGINT, and so do its children: only a program that listens hears it.
    if !ignores_interrupts() {
        interrupted("lost.png", &[]);
        assert!(!at.join("lost.png").exists());
    }
    let said = interrupted("kept.png", &["--keep", "--report", "kept.json"]);
    assert_eq!(image::open(at.join("kept.png")).expect("a whole picture").to_rgba8().dimensions(), (128, 72));
    let report: Value = serde_json::from_slice(&std::fs::read(at.join("kept.json")).expect("a report")).expect("JSON");
    let samples = report["sampling"]["samples"].as_u64().expect("a number");
    assert!(
        (2..4096).contains(&samples) && said.contains(&format!(", {samples} samples per pixel")),
        "{samples}: {said}"
    );
    // What is left beside the outputs: no part of a file.
    let parts = std::fs::read_dir(at)
        .expect("a folder")
        .filter(|e| e.as_ref().is_ok_and(|e| e.path().extension().is_some_and(|x| x == "part")));
    assert_eq!(parts.count(), 0);
}
