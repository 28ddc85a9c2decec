//! The viewer in a real window on a display of its own, moved by synthetic hands: what it shows is what `render` draws,
//! by the command that it copies, bit by bit.

#[path = "support/program.rs"]
mod program;
#[path = "support/x11.rs"]
mod x11;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::Duration;

use anyhow::{Result, bail};
use etalon::frame::Settings;
use etalon::gpu::{Device, Replacement};
use etalon::optics::SplitMix64;
use etalon::plan::{KNOBS, Knobs, Model};
use etalon::scene::{Camera, Scene};
use etalon::study;
use etalon_mask::Mask;
use etalon_testing::gltf_builder::{Builder, FLOAT, f32s};
use etalon_testing::gpu::Gpu;
use etalon_viewer::shared::{Loaded, OpenRequest, RenderRequest, RenderState, SceneSource, SharedState, Viewpoint};
use etalon_viewer::worker::Worker;
use serde_json::json;
use x11::{Display, Viewer};

const C: u32 = 0x63;
const F: u32 = 0x66;
const Z: u32 = 0x7a;
const P: u32 = 0x70;
const V: u32 = 0x76;
const SPACE: u32 = 0x20;
const FULL_STOP: u32 = 0x2e;
const DOWN: u32 = 0xff54;
const LEFT: u32 = 0xff51;
const RIGHT: u32 = 0xff53;
const ESCAPE: u32 = 0xff1b;
const CONTROL: u32 = 0xffe3;
const ALT: u32 = 0xffe9;
const RETURN: u32 = 0xff0d;
const G: u32 = 0x67;
const H: u32 = 0x68;
const S: u32 = 0x73;
const Y: u32 = 0x79;
const ONE: u32 = 0x31;
const TWO: u32 = 0x32;

/// What a command draws, RGB.
fn drawn(folder: &Path, command: &str) -> Shown {
    let words: Vec<&str> = command.split_whitespace().skip(1).collect();
    program::etalon(folder, &words, &[]).succeeded();
    let picture = image::open(folder.join("picture.png")).expect("a picture").to_rgb8();
    let size = [picture.width(), picture.height()];
    (size, picture.pixels().map(|p| p.0).collect())
}

/// A picture's size and texels.
type Shown = ([u32; 2], Vec<[u8; 3]>);

/// Waits until the window shows what its own command draws; `is_shown` is asked of the window and of that picture.
/// Returns the command and the picture. The command is copied again where the window does not follow: the scene is
/// still read, panels find their size, or keys of before are on their way to a slow window.
#[track_caller]
fn until_shown(
    viewer: &mut Viewer<'_>,
    folder: &Path,
    is_shown: impl Fn(&Shown, &Shown) -> bool,
) -> (String, Vec<[u8; 3]>) {
    // A wheel is smoothed over some pictures.
    std::thread::sleep(Duration::from_secs(1));
    viewer.until("a picture that the copied command draws", |viewer| {
        viewer.key(C, None);
        let command = viewer.line();
        assert!(command.starts_with("etalon render "), "{command}");
        viewer.key(ESCAPE, None);
        let expected = drawn(folder, &command);
        let soon = (0..200).any(|_| {
            std::thread::sleep(Duration::from_millis(30));
            viewer.pixels().is_some_and(|window| is_shown(&window, &expected))
        });
        if !soon {
            eprintln!("not shown yet: `{command}`");
        }
        soon.then_some((command, expected.1))
    })
}

/// Waits for a window that is all picture; returns the command.
#[track_caller]
fn shows_its_command(viewer: &mut Viewer<'_>, folder: &Path) -> String {
    let is_all = |(window, pixels): &Shown, (size, expected): &Shown| {
        // A narrow window keeps the sides of what a camera of the file shows: the picture is in its middle.
        let above = (window[1].saturating_sub(size[1]) / 2 * window[0]) as usize;
        let other = pixels.iter().skip(above).zip(expected).filter(|(a, b)| a != b).count();
        window[0] == size[0] && window[1] >= size[1] && other == 0
    };
    until_shown(viewer, folder, is_all).0
}

const OBJ: &str = "mtllib two.mtl\nv -1 0 0\nv 1 0 0\nv 0 1.5 0\nv 0 0 -1\nusemtl red\nf 1 2 3\nf 2 4 3\nf 4 1 3\n";
const MTL: &str = "newmtl red\nKd 0.7 0.1 0.1\nKs 0 0 0\n";

#[test]
fn the_window_shows_what_render_draws() {
    let Some(display) = Display::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let mut viewer = Viewer::open(&display, folder, &["study:cornell", "--size", "320x180", "--bare", "--validate"]);
    let first = shows_its_command(&mut viewer, folder);
    assert!(!first.contains("--eye"), "the scene's own camera: {first}");

    viewer.drag(1, [160, 90], [200, 110]);
    viewer.click(4, [160, 90]);
    let moved = shows_its_command(&mut viewer, folder);
    assert!(moved.contains("--eye"), "{moved}");
    viewer.key(Z, Some(CONTROL));
    assert_eq!(shows_its_command(&mut viewer, folder), first, "taken back");

    let mut random = SplitMix64::new(7);
    for _ in 0..200 {
        viewer.resize([random.between(160.0, 500.0) as u32, random.between(120.0, 400.0) as u32]);
    }
    viewer.resize([333, 211]);
    let resized = shows_its_command(&mut viewer, folder);
    assert!(resized.contains("--size 333x187"), "all of what the camera shows: {resized}");

    for (name, text) in [("two.obj", OBJ), ("two.mtl", MTL), ("broken.glb", "glTF?")] {
        std::fs::write(folder.join(name), text).expect("a file");
    }
    viewer.drop_file(&folder.join("two.obj"));
    viewer.until("the second file", |viewer| viewer.title().contains("two").then_some(()));
    viewer.key(F, None);
    let second = shows_its_command(&mut viewer, folder);
    assert!(second.contains("two.obj") && second.contains("--eye"), "{second}");
    // A file that changes is read again, from where it was seen.
    let red = viewer.pixels().expect("a window").1;
    std::fs::write(folder.join("two.mtl"), MTL.replace("0.7 0.1 0.1", "0.1 0.7 0.2")).expect("a file");
    viewer.until("another colour", |viewer| (viewer.pixels()?.1 != red).then_some(()));
    assert_eq!(shows_its_command(&mut viewer, folder), second, "another picture, the same view");
    viewer.drop_file(&folder.join("broken.glb"));
    let shown = viewer.pixels().expect("a window").1;
    viewer.until("a message", |viewer| (viewer.pixels()?.1 != shown).then_some(()));
    assert_eq!(shows_its_command(&mut viewer, folder), second, "the old picture stays");

    // Panels make room for themselves, and give it back.
    viewer.resize([900, 500]);
    shows_its_command(&mut viewer, folder);
    viewer.key(P, None);
    viewer.key(C, None);
    let beside = viewer.line();
    assert!(!beside.contains("--size 900x500"), "{beside}");
    viewer.key(ESCAPE, None);
    viewer.key(P, None);
    shows_its_command(&mut viewer, folder);

    // Once hidden and shown again.
    viewer.hide();
    std::thread::sleep(Duration::from_millis(300));
    viewer.unhide();
    shows_its_command(&mut viewer, folder);
    // Nothing happens, nothing is drawn: a third of a core was busy here once.
    // A machine that does other things may need a while to get there.
    let two_seconds = || {
        let before = viewer.cpu();
        std::thread::sleep(Duration::from_secs(2));
        viewer.cpu() - before
    };
    let busy: Vec<Duration> =
        (0..5).map(|_| two_seconds()).take_while(|&busy| busy >= Duration::from_millis(200)).collect();
    assert!(busy.len() < 5, "{busy:?} of two seconds each");

    let (code, words) = viewer.close();
    assert_eq!(code, Some(0), "{words}");
    assert!(!words.contains("Validation") && !words.contains("panicked"), "{words}");
}

/// Half of the requests for the window's next picture come to nothing, in every way that a window lives with: it shows
/// its picture.
#[test]
fn a_window_outlives_what_befalls_its_swapchain() {
    let Some(display) = Display::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let file = folder.join("faults.json");
    let faults = ["NOT_READY", "TIMEOUT", "OUT_OF_DATE", "SURFACE_LOST"];
    let turns: Vec<&str> = faults.iter().flat_map(|fault| ["PICTURE", fault]).collect();
    let faults = json!({ "acquire": turns });
    std::fs::write(&file, faults.to_string()).expect("a file");
    let mask = Mask::in_folder(folder).expect("the layer is built");
    let variables = mask.variables(&file);
    let variables = variables.each_ref().map(|(name, value)| (*name, value.as_str()));
    let arguments = ["study:cornell", "--size", "320x180", "--bare"];
    let mut viewer = Viewer::open_with(&display, folder, &arguments, &variables);
    shows_its_command(&mut viewer, folder);
    viewer.resize([300, 211]);
    viewer.drag(1, [160, 90], [200, 110]);
    shows_its_command(&mut viewer, folder);
    let (code, words) = viewer.close();
    assert_eq!(code, Some(0), "{words}");
    assert!(!words.contains("panicked"), "{words}");
    let noted = std::fs::read_to_string(file.with_extension("noted")).expect("faults");
    for fault in ["NOT_READY", "TIMEOUT", "ERROR_OUT_OF_DATE_KHR", "ERROR_SURFACE_LOST_KHR"] {
        assert!(noted.contains(fault), "{fault}: {noted}");
    }
}

/// A triangle that goes to the right for two seconds, seen by a camera of the file that goes with it for one.
fn animated(folder: &Path) -> PathBuf {
    let mut b = Builder::new();
    let positions = b.accessor(&f32s(&[-1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.5, 0.0]), FLOAT, "VEC3", 3);
    let mesh = b.push("meshes", json!({ "primitives": [{ "attributes": { "POSITION": positions }, "material": 0 }] }));
    b.push("materials", json!({ "pbrMetallicRoughness": { "metallicFactor": 0.0 } }));
    b.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }));
    b.push("nodes", json!({ "mesh": mesh }));
    b.push("nodes", json!({ "camera": 0, "name": "eye", "translation": [0, 0.5, 6] }));
    let times = b.accessor(&f32s(&[0.0, 2.0]), FLOAT, "SCALAR", 2);
    let short = b.accessor(&f32s(&[0.0, 1.0]), FLOAT, "SCALAR", 2);
    let places = b.accessor(&f32s(&[0.0, 0.0, 0.0, 2.0, 0.0, 0.0]), FLOAT, "VEC3", 2);
    let eyes = b.accessor(&f32s(&[0.0, 0.5, 6.0, 1.0, 0.5, 5.0]), FLOAT, "VEC3", 2);
    let channel =
        |sampler: usize, node: usize| json!({ "sampler": sampler, "target": { "node": node, "path": "translation" } });
    b.push(
        "animations",
        json!({
            "samplers": [{ "input": times, "output": places }, { "input": short, "output": eyes }],
            "channels": [channel(0, 0), channel(1, 1)],
        }),
    );
    b.json["scenes"] = json!([{ "nodes": [0, 1] }]);
    b.save_glb(folder)
}

/// Time, by keys: the window is at a time that its command says, and the file's camera goes with it. Then a wipe
/// between two settings: left of the line is what one command draws, right of it what the other does.
#[test]
fn time_passes_and_settings_are_compared() {
    let Some(display) = Display::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let file = animated(folder);
    let file = file.file_name().and_then(|name| name.to_str()).expect("a name");
    let mut viewer = Viewer::open(&display, folder, &[file, "--size", "320x180", "--bare", "--validate"]);
    let at_rest = shows_its_command(&mut viewer, folder);
    assert!(!at_rest.contains("--time") && !at_rest.contains("--eye"), "{at_rest}");
    (0..12).for_each(|_| viewer.key(FULL_STOP, None));
    until_its_command(&mut viewer, "half a second", |command| command.contains("--time 0.5 "));
    let half = shows_its_command(&mut viewer, folder);
    assert!(half.contains("--time 0.5 ") && !half.contains("--eye"), "{half}");
    viewer.click(4, [160, 90]);
    viewer.key(SPACE, None);
    std::thread::sleep(Duration::from_millis(700));
    viewer.key(SPACE, None);
    let played = shows_its_command(&mut viewer, folder);
    let time =
        played.split_whitespace().skip_while(|word| *word != "--time").nth(1).and_then(|t| t.parse::<f64>().ok());
    assert!(time.is_some_and(|time| time != 0.5 && time <= 2.0) && played.contains("--eye"), "{played}");

    viewer.key(V, None);
    let knob = KNOBS.iter().position(|knob| knob.name == "indirect").expect("a knob");
    (0..=knob).for_each(|_| viewer.key(DOWN, None));
    // From the model's ambient occlusion by sixteen rays over four rays and plain ambient light to none.
    (0..3).for_each(|_| viewer.key(LEFT, None));
    viewer.key(ESCAPE, None);
    viewer.key(C, None);
    let right = viewer.line();
    viewer.key(ESCAPE, None);
    let expected = played.replace("-o picture.png", "--set indirect=off -o picture.png");
    assert_eq!(right, expected, "the command of the side that is edited");
    let (size, expected_left) = drawn(folder, &played);
    let (_, expected_right) = drawn(folder, &right);
    // The first rows and the last are covered by figures.
    let rows = 30..80;
    let differ = |found: &[[u8; 3]], expected: &[[u8; 3]], columns: std::ops::Range<u32>| {
        let places = rows.clone().flat_map(|y| columns.clone().map(move |x| (y * size[0] + x) as usize));
        places.filter(|&at| found[at] != expected[at]).count()
    };
    viewer.until("both sides", |viewer| {
        let (window, found) = viewer.pixels()?;
        let both = [differ(&found, &expected_left, 0..145), differ(&found, &expected_right, 175..320)];
        eprintln!("{window:?} {both:?}");
        (window == size && both == [0, 0]).then_some(())
    });
    assert!(differ(&expected_left, &expected_right, 175..320) > 0, "both are the same");
    let (code, words) = viewer.close();
    assert_eq!(code, Some(0), "{words}");
    assert!(!words.contains("Validation Error") && !words.contains("panicked"), "{words}");
}

/// Every knob by the keys of the window, rung by rung, with validation: the command says so, and some pictures are
/// compared.
#[test]
fn every_knob_turns_in_the_window() {
    let Some(display) = Display::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    // As on a screen of one and a half points a pixel.
    let scale = [("WINIT_X11_SCALE_FACTOR", "1.5")];
    let arguments = ["study:cornell", "--size", "200x130", "--bare", "--validate", "--set", "samples=1"];
    let mut viewer = Viewer::open_with(&display, folder, &arguments, &scale);
    shows_its_command(&mut viewer, folder);
    for knob in KNOBS {
        viewer.key(DOWN, None);
        let mut seen = Vec::new();
        for _ in knob.rungs {
            viewer.key(RIGHT, None);
            viewer.key(C, None);
            let command = viewer.line();
            let begin = format!("{}=", knob.name);
            let rung = command.split_whitespace().find_map(|word| word.strip_prefix(&begin)).unwrap_or("the model's");
            if !seen.contains(&rung.to_owned()) {
                seen.push(rung.to_owned());
            }
        }
        // Some rungs go with others alone.
        let turns =
            knob.rungs.iter().filter(|rung| Knobs::of(Model::Recursive).with(knob.name, rung).is_some()).count();
        assert!(seen.len() > 1 || turns < 2, "{}: {seen:?}", knob.name);
        if ["shadows", "fresnel", "brdf", "reflection", "interfaces", "arithmetic"].contains(&knob.name) {
            shows_its_command(&mut viewer, folder);
        }
    }
    shows_its_command(&mut viewer, folder);
    let (code, words) = viewer.close();
    assert_eq!(code, Some(0), "{words}");
    assert!(!words.contains("Validation Error") && !words.contains("panicked"), "{words}");
}

#[test]
fn without_a_display_there_is_a_sentence() {
    let folder = tempfile::tempdir().expect("a folder");
    let nothing = [("DISPLAY", ""), ("WAYLAND_DISPLAY", ""), ("WAYLAND_SOCKET", "")];
    let run = program::etalon(folder.path(), &["view", "study:cornell"], &nothing);
    run.failed(1, "etalon render SCENE");
}

fn scene() -> Scene {
    study::load("etalon").expect("a scene")
}

struct Study;

impl SceneSource for Study {
    fn open(&mut self, _: OpenRequest<'_>, _: &Arc<Device>) -> Result<Loaded> {
        let scene = scene();
        let camera = scene.cameras[0].clone();
        Ok(Loaded::new(scene, camera))
    }

    fn moment(&mut self, _: OpenRequest<'_>) -> Result<(Scene, Camera)> {
        bail!("nothing moves")
    }
}

/// The thread that draws, without a window: every rung of every knob one after the other, each wanted while the one
/// before is under way. What it shows in the end is what a renderer of those rungs draws.
#[test]
fn every_knob_turns_while_pictures_are_drawn() {
    let gpu = Gpu::hasty();
    let size = [64, 36];
    let settings = |knobs: &Knobs| Settings { size, knobs: knobs.clone(), ..Settings::default() };
    let shared = Arc::new(SharedState::new(RenderRequest::new(settings(&Knobs::of(Model::Local)))));
    let (to, woken) = channel();
    let thread = {
        let (device, shared) = (gpu.device.clone(), shared.clone());
        std::thread::spawn(move || {
            Worker::run(device, shared, Box::new(Study), Arc::new(move || to.send(()).unwrap_or_default()))
        })
    };
    let mut turned = 0;
    for knob in KNOBS.iter().filter(|knob| !["samples", "colour"].contains(&knob.name)) {
        for (base, rung) in
            [Model::Local, Model::Recursive].into_iter().flat_map(|m| knob.rungs.iter().map(move |r| (m, r)))
        {
            let Some(knobs) = Knobs::of(base).with(knob.name, rung) else { continue };
            shared.want(|wanted| wanted.settings = settings(&knobs));
            // Sometimes it is done before the next, sometimes not.
            if turned % 3 == 0 {
                woken.recv_timeout(Duration::from_secs(60)).expect("something is shown");
            }
            turned += 1;
        }
    }
    assert!(turned > 60, "{turned} rungs");
    // What cannot be drawn quickly is small while it moves, and whole once it rests. It is small at once where the time
    // of a pixel is known of a picture that had to be compiled.
    let last = settings(&Knobs::of(Model::Recursive));
    let last = Settings { size: [480, 270], ..last };
    shared.want(|wanted| (wanted.settings, wanted.moving) = (last.clone(), true));
    let wait = |what: &str, is_there: &dyn Fn(&RenderState) -> bool| {
        let begun = std::time::Instant::now();
        loop {
            let seen = shared.seen();
            if is_there(&seen) {
                return seen;
            }
            assert!(begun.elapsed() < Duration::from_secs(120), "{what}: {:?}", seen.error);
            let _ = woken.recv_timeout(Duration::from_millis(200));
        }
    };
    wait("moving", &|seen| seen.shown().is_some_and(|shown| shown.moving && shown.size != size));
    // By now it is known how long a pixel takes.
    let mut aside = scene().cameras[0].clone();
    aside.world_from_camera.translation.x += 0.1;
    shared.want(|wanted| wanted.from = Viewpoint::Free(aside));
    let small = wait("small", &|seen| {
        seen.shown().is_some_and(|shown| shown.moving && shown.size[0] < 480 && shown.size != size)
    });
    assert_eq!(small.shown().expect("a picture").samples, [1, 1]);
    shared.want(|wanted| (wanted.from, wanted.moving, wanted.surfaces) = (Viewpoint::Own, false, true));
    let seen = wait("whole", &|seen| seen.now().is_some_and(|surfaces| surfaces.size == [480, 270]));
    assert_eq!(seen.shown().map(|shown| shown.samples), Some([4, 4]));
    let found: Vec<[u32; 4]> =
        seen.now().expect("surfaces").radiance[0].iter().map(|pixel| pixel.map(f32::to_bits)).collect();
    assert!(found == etalon_testing::gpu::bits(&gpu.film(&scene(), last)), "another picture");
    assert_eq!(seen.error, None);
    // Other code draws another picture, and what was built the same again.
    let before = seen.shown().expect("a picture").clone();
    let program = &etalon::shader::tonemap::PROGRAM;
    let mut words = program.stages[0].words.to_vec();
    let factor = words.iter().position(|&word| word == 12.92_f32.to_bits()).expect("the slope of sRGB in the dark");
    words[factor] = 30.0_f32.to_bits();
    let code = Arc::new(vec![Replacement { program: program.name, stage: 0, words }]);
    shared.want(|wanted| wanted.code = code);
    let is_new =
        |seen: &RenderState, version| seen.shown().is_some_and(|shown| shown.is_done() && shown.version > version);
    let other = wait("other code", &|seen| is_new(seen, before.version)).shown().expect("a picture").clone();
    assert!(other.rgba != before.rgba, "the same picture by other code");
    shared.want(|wanted| wanted.code = Arc::default());
    let again = wait("the code before", &|seen| is_new(seen, other.version));
    assert!(again.shown().expect("a picture").rgba == before.rgba, "another picture by the same code");
    shared.want(|wanted| wanted.quit = true);
    thread.join().expect("the thread ends");
}

/// Two triangles, left and right, with a variant that swaps their materials.
fn two_triangles(folder: &Path) -> PathBuf {
    let mut b = Builder::new();
    let positions = b.accessor(&f32s(&[-1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.5, 0.0]), FLOAT, "VEC3", 3);
    for (colour, other) in [([0.8, 0.1, 0.1, 1.0], 1), ([0.1, 0.2, 0.8, 1.0], 0)] {
        let material = 1 - other;
        let variants = json!({ "mappings": [{ "material": other, "variants": [0] }] });
        b.push("materials", json!({ "pbrMetallicRoughness": { "baseColorFactor": colour, "metallicFactor": 0.0 } }));
        b.push(
            "meshes",
            json!({ "primitives": [{
                "attributes": { "POSITION": positions },
                "material": material,
                "extensions": { "KHR_materials_variants": variants },
            }] }),
        );
    }
    b.push("nodes", json!({ "mesh": 0, "name": "left", "translation": [-1.2, 0, 0] }));
    b.push("nodes", json!({ "mesh": 1, "name": "right", "translation": [1.2, 0, 0] }));
    b.json["extensionsUsed"] = json!(["KHR_materials_variants"]);
    b.json["extensions"] = json!({ "KHR_materials_variants": { "variants": [{ "name": "swapped" }] } });
    b.json["scenes"] = json!([{ "nodes": [0, 1] }]);
    b.save_glb(folder)
}

/// Waits for a picture beside panels; returns the command and the picture.
#[track_caller]
fn shows_beside_panels(viewer: &mut Viewer<'_>, folder: &Path) -> (String, Vec<[u8; 3]>) {
    let is_beside = |(window, pixels): &Shown, (size, expected): &Shown| {
        let row = |y: u32, width: u32, of: &[[u8; 3]]| {
            let from = (y * width) as usize;
            of[from..from + size[0] as usize].to_vec()
        };
        let is_at = |above: u32| (0..size[1]).all(|y| row(above + y, window[0], pixels) == row(y, size[0], expected));
        // It begins at the left, below the bar.
        window[1].checked_sub(size[1]).is_some_and(|rows| (0..=rows).any(is_at))
    };
    until_shown(viewer, folder, is_beside)
}

/// Copies the command until it is as expected: a scene that is read again takes its time.
#[track_caller]
fn until_its_command(viewer: &mut Viewer<'_>, what: &str, is_there: impl Fn(&str) -> bool) {
    viewer.until(what, |viewer| {
        viewer.key(C, None);
        let command = viewer.line();
        viewer.key(ESCAPE, None);
        std::thread::sleep(Duration::from_millis(300));
        is_there(&command).then_some(())
    });
}

/// Beside panels, in windows of several sizes and scales, with a camera of the file.
#[test]
fn the_picture_beside_panels_is_that_of_its_command() {
    let Some(display) = Display::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    std::fs::create_dir_all(folder.join("config/etalon")).expect("a folder");
    let preferences = json!({ "overlays": { "gizmo": false } });
    std::fs::write(folder.join("config/etalon/viewer.json"), preferences.to_string()).expect("a file");
    for (size, scale) in [("900x600", "1"), ("1280x720", "1"), ("1920x1080", "1"), ("1800x1100", "2")] {
        let arguments = ["study:cornell", "--size", size, "--model", "local", "--set", "samples=1", "--validate"];
        let scale = [("WINIT_X11_SCALE_FACTOR", scale)];
        let mut viewer = Viewer::open_with(&display, folder, &arguments, &scale);
        let (command, _) = shows_beside_panels(&mut viewer, folder);
        assert!(!command.contains("--eye"), "{command}");
        let (code, words) = viewer.close();
        assert_eq!(code, Some(0), "{words}");
        assert!(!words.contains("Validation Error") && !words.contains("panicked"), "{words}");
    }
}

/// What a user does with panels, by mouse and keys: each step is in the command that draws the picture.
#[test]
fn nodes_are_hidden_views_chosen_and_pictures_saved() {
    let Some(display) = Display::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let file = two_triangles(folder);
    let file = file.file_name().and_then(|name| name.to_str()).expect("a name").to_owned();
    // Without the axes in the corner, the picture is nothing but the picture.
    let preferences = json!({ "overlays": { "gizmo": false }, "saved_in": folder });
    std::fs::create_dir_all(folder.join("config/etalon")).expect("a folder");
    std::fs::write(folder.join("config/etalon/viewer.json"), preferences.to_string()).expect("a file");
    // With one sample, a picture that is shown is finished: `render` writes into the folder that the viewer watches,
    // and a scene that is read again is drawn again.
    let arguments = [&file, "--size", "900x600", "--set", "samples=1", "--validate"];
    let mut viewer = Viewer::open(&display, folder, &arguments);
    // Until the scene has been read, the command leaves the view to `render`, which draws the same.
    until_its_command(&mut viewer, "a view", |command| command.contains("--eye"));
    let (first, both) = shows_beside_panels(&mut viewer, folder);
    assert!(first.contains("--eye") && !first.contains("--hide"), "{first}");

    // The left triangle is selected by a click, and hidden.
    viewer.click(1, [180, 340]);
    // The box around it is orange, and smoothed.
    let is_marked = |[r, g, b]: &[u8; 3]| *r > 200 && (110..200).contains(g) && *b < 110;
    // The bar above has orange words.
    viewer.until("a selection", |viewer| viewer.pixels()?.1[900 * 30..].iter().any(is_marked).then_some(()));
    viewer.key(H, None);
    until_its_command(&mut viewer, "a hidden node", |command| command.contains("--hide left"));
    let (hidden, one) = shows_beside_panels(&mut viewer, folder);
    assert!(hidden.contains("--hide left") && one != both, "{hidden}");
    viewer.key(Z, Some(CONTROL));
    until_its_command(&mut viewer, "no hidden node", |command| !command.contains("--hide"));
    let (undone, again) = shows_beside_panels(&mut viewer, folder);
    assert!(undone == first && again == both, "{undone}");
    viewer.key(Y, Some(CONTROL));
    until_its_command(&mut viewer, "a node that is hidden again", |command| command.contains("--hide left"));
    let (redone, _) = shows_beside_panels(&mut viewer, folder);
    assert_eq!(redone, hidden);
    viewer.key(H, Some(ALT));
    until_its_command(&mut viewer, "all nodes", |command| !command.contains("--hide"));
    let (all, _) = shows_beside_panels(&mut viewer, folder);
    assert_eq!(all, first, "all are shown, from where one was");
    viewer.key(TWO, Some(CONTROL));
    until_its_command(&mut viewer, "another view", |command| command != first);
    viewer.key(ONE, Some(CONTROL));
    until_its_command(&mut viewer, "the view from the front, as at first", |command| command == first);

    // Saved under the name that the dialog proposes, as it is shown.
    viewer.key(S, Some(CONTROL));
    std::thread::sleep(Duration::from_secs(1));
    viewer.key(RETURN, None);
    let saved = folder.join(file.replace(".glb", ".png"));
    viewer.until("a saved picture", |_| saved.is_file().then_some(()));
    std::thread::sleep(Duration::from_millis(500));
    let (size, expected) = drawn(folder, &first);
    let found = image::open(&saved).expect("a picture").to_rgb8();
    let other = found.pixels().zip(&expected).filter(|(a, b)| a.0 != **b).count();
    assert_eq!((found.dimensions().into(), other), (size, 0), "size and pixels that differ from what is shown");

    // Both sides of a comparison are saved, though the left one was drawn before there were two.
    std::fs::remove_file(&saved).expect("a file");
    std::thread::sleep(Duration::from_secs(1));
    viewer.key(V, None);
    viewer.key(S, Some(CONTROL));
    std::thread::sleep(Duration::from_secs(1));
    viewer.key(RETURN, None);
    viewer.until("a saved comparison", |_| saved.is_file().then_some(()));

    // A panel that is closed stays closed, and the window has its size of before.
    viewer.resize([1000, 640]);
    std::thread::sleep(Duration::from_secs(1));
    let (code, words) = viewer.close();
    assert_eq!(code, Some(0), "{words}");
    assert!(!words.contains("Validation Error") && !words.contains("panicked"), "{words}");
    let mut viewer = Viewer::open(&display, folder, &[&file, "--set", "samples=1"]);
    viewer.until("the size of before", |viewer| (viewer.pixels()?.0 == [1000, 640]).then_some(()));
    shows_beside_panels(&mut viewer, folder);
    // Small pictures of recent files.
    let small = std::fs::read_dir(folder.join("cache/etalon/small")).expect("a folder").count();
    assert_eq!(small, 1);
    let (code, words) = viewer.close();
    assert_eq!(code, Some(0), "{words}");

    // What is transparent is squares of grey in the window, and transparent in the file. Values of the command line
    // that sliders do not reach stay as they are.
    std::fs::remove_file(&saved).expect("a file");
    let more = ["--background", "transparent", "--env-rotation", "270.25", "--exposure", "0.123"];
    let arguments = [&[file.as_str(), "--set", "samples=1"], &more[..]].concat();
    let mut viewer = Viewer::open(&display, folder, &arguments);
    until_its_command(&mut viewer, "a view", |command| command.contains("--eye"));
    let squares = |[r, g, b]: [u8; 3]| r == g && g == b && (r == 102 || r == 153);
    viewer.until("squares of grey", |viewer| {
        let (_, pixels) = viewer.pixels()?;
        (pixels.into_iter().filter(|pixel| squares(*pixel)).count() > 10_000).then_some(())
    });
    viewer.key(C, None);
    let command = viewer.line();
    assert!(more.chunks(2).all(|option| command.contains(&option.join(" "))), "{command}");
    viewer.key(S, Some(CONTROL));
    std::thread::sleep(Duration::from_secs(1));
    viewer.key(RETURN, None);
    viewer.until("a saved picture", |_| saved.is_file().then_some(()));
    std::thread::sleep(Duration::from_millis(500));
    drawn(folder, &command);
    let [saved, rendered] = [saved, folder.join("picture.png")].map(|path| image::open(path).expect("a picture"));
    let found = [&saved, &rendered].map(|picture| (picture.width(), picture.height(), picture.color()));
    assert!(saved.color().has_alpha() && saved == rendered, "{found:?} are not equal: `{command}`");
    let (code, words) = viewer.close();
    assert_eq!(code, Some(0), "{words}");
}

/// An idle window is idle, and a thousand interactions or more leave nothing behind.
#[test]
fn many_interactions_leave_nothing_behind() {
    let Some(display) = Display::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let arguments = ["study:cornell", "--size", "640x360", "--model", "local", "--set", "samples=1"];
    let mut viewer = Viewer::open(&display, folder, &arguments);
    shows_beside_panels_once(&mut viewer);
    let mut random = SplitMix64::new(11);
    let mut act = |viewer: &mut Viewer<'_>, count: usize| {
        let tabs = [[430, 35], [480, 35], [530, 35], [430, 200], [480, 200], [530, 200]];
        for i in 0..count {
            match i % 5 {
                0 => viewer.click(1, tabs[random.between(0.0, 5.99) as usize]),
                1 => viewer.key(G, None),
                2 => viewer.point([random.between(0.0, 300.0) as i16, random.between(60.0, 300.0) as i16]),
                3 => viewer.click(4 + (i as u8 / 5) % 2, [150, 180]),
                _ => viewer.key(DOWN, None),
            }
            if i % 50 == 0 {
                std::thread::sleep(Duration::from_millis(40));
            }
        }
        std::thread::sleep(Duration::from_secs(2));
    };
    // Memory grows while some panel or picture is shown for the first time, and how many rounds that takes depends on
    // the machine. What each interaction leaves behind makes it grow in every round.
    let (count, rounds) = (500, 6);
    act(&mut viewer, count);
    let mut found = vec![viewer.resident()];
    let quiet = (0..rounds).any(|_| {
        act(&mut viewer, count);
        let (most, now) = (found.iter().copied().max().unwrap_or_default(), viewer.resident());
        found.push(now);
        now < most + count as u64
    });
    eprintln!("KiB after rounds of {count} interactions: {found:?}");
    assert!(quiet, "each round of {count} interactions takes more than a KiB for each: {found:?} KiB");
    viewer.key(ESCAPE, None);
    std::thread::sleep(Duration::from_secs(5));
    // A machine that does other things may need a while to get there.
    let ten_seconds = || {
        let before = viewer.cpu();
        std::thread::sleep(Duration::from_secs(10));
        viewer.cpu() - before
    };
    let busy: Vec<Duration> =
        (0..3).map(|_| ten_seconds()).take_while(|&busy| busy > Duration::from_millis(20)).collect();
    assert!(busy.len() < 3, "{busy:?} of ten idle seconds each");
    let (code, words) = viewer.close();
    assert_eq!(code, Some(0), "{words}");
}

/// Waits for the first picture.
fn shows_beside_panels_once(viewer: &mut Viewer<'_>) {
    viewer.until("a picture", |viewer| {
        let (window, pixels) = viewer.pixels()?;
        let colours: std::collections::BTreeSet<[u8; 3]> =
            (60..window[1] - 60).map(|y| pixels[(y * window[0] + 100) as usize]).collect();
        (colours.len() > 20).then_some(())
    });
}

/// The time from the start of the program until the window shows something, a picture or a sign of work.
#[test]
fn the_first_sign_comes_soon() {
    let Some(display) = Display::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let mut viewer = Viewer::open(&display, folder.path(), &["study:pool", "--size", "900x600"]);
    let begun = std::time::Instant::now();
    viewer.until("a sign", |viewer| {
        let (_, pixels) = viewer.pixels()?;
        (pixels.iter().any(|pixel| *pixel != pixels[0])).then_some(())
    });
    // A time is no claim of a test: it is printed, and said where it is measured.
    eprintln!("first sign {:.3} s after the window", begun.elapsed().as_secs_f64());
}
