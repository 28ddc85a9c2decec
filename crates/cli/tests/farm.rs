//! Work that is split: what processes draw together is, to the last bit, what one draws, and what is missing, there
//! twice, cut short or of another picture is named.

#[path = "support/program.rs"]
mod program;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use program::{HASTY, Run, etalon};
use serde_json::{Value, json};
use tempfile::TempDir;

fn folder() -> TempDir {
    tempfile::tempdir().expect("a folder")
}

fn run(folder: &Path, line: &str) -> Run {
    let words: Vec<&str> = line.split(' ').filter(|word| !word.is_empty()).collect();
    etalon(folder, &words, &HASTY)
}

fn bytes(path: PathBuf) -> Vec<u8> {
    std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// A white triangle that moves along x, `moves.glb`, from 0 to 1 m within a second.
fn moving(folder: &Path) {
    let mut b = etalon_testing::gltf_builder::Builder::new();
    let position = b.triangle();
    let mesh = b.mesh(json!({ "attributes": { "POSITION": position } }));
    b.root(json!({ "mesh": mesh }));
    let times = b.floats("SCALAR", &[0.0, 1.0]);
    let places = b.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    b.json["animations"] = json!([{
        "samplers": [{ "input": times, "output": places }],
        "channels": [{ "sampler": 0, "target": { "node": 0, "path": "translation" } }],
    }]);
    let path = b.save_glb(folder);
    std::fs::rename(path, folder.join("moves.glb")).expect("a file");
}

/// Draws a picture at once and in parts, in any order, and compares all bytes.
fn same_in_parts(picture: &str, split: &str, of: u32) {
    let folder = folder();
    let at = folder.path();
    run(at, &format!("render {picture} --size 45x27 --validate -o one.exr -o one.png")).succeeded();
    let mut parts = String::new();
    // The last one first, and not in the order of their names.
    for index in (1..=of).rev() {
        let shard = format!("--shard {index}/{of} --split {split} -o {index}.part");
        run(at, &format!("render {picture} --size 45x27 --validate {shard}")).succeeded();
        parts = if index % 2 == 0 { format!("{parts} {index}.part") } else { format!("{index}.part {parts}") };
    }
    run(at, &format!("merge {parts} --validate -o all.exr -o all.png --report all.json")).succeeded();
    for format in ["exr", "png"] {
        let [one, all] = ["one", "all"].map(|name| bytes(at.join(name).with_extension(format)));
        assert!(one == all, "{picture} in {of} by {split}: another {format}");
    }
}

#[test]
fn parts_are_the_picture_of_one_run() {
    for (picture, split, of) in [
        // Paths in halves, more samples than blocks, and a number of parts that divides nothing.
        ("study:cornell --model global --set samples=256", "tiles", 5),
        ("study:cornell --model global --set samples=256", "samples", 5),
        // Denoised as a whole.
        ("study:cornell --model global --set samples=16 --set denoise=nl-means", "tiles", 3),
        // An eye in water, which each part has to find.
        ("study:pool --model recursive --set samples=16", "samples", 2),
        // Rays, parts of the picture and layers of surfaces.
        ("study:etalon --set samples=4 --aov reflection,normal,material", "tiles", 3),
        // Transparent surfaces, and more samples than blocks without halves.
        ("study:blend --model local --set samples=64", "tiles", 2),
        ("study:blend --model local --set samples=64", "samples", 3),
        // Layers of halves, and a background that is no light.
        ("study:cornell --model global --set samples=4 --aov variance,half_a --background #204060", "tiles", 2),
        // Bands of wavelengths, of one sample and of some.
        ("study:metamers --model local --set samples=1 --set colour=spectral:8", "tiles", 2),
        ("study:metamers --model local --set samples=4 --set colour=spectral:8", "samples", 2),
    ] {
        same_in_parts(picture, split, of);
    }
}

#[test]
fn the_error_of_the_whole_is_that_of_one_run() {
    let folder = folder();
    let at = folder.path();
    let picture = "study:cornell --size 40x30 --model global --set samples=16";
    run(at, &format!("render {picture} -o one.png --report one.json")).succeeded();
    for index in [2, 1] {
        run(at, &format!("render {picture} --shard {index}/2 -o {index}.part")).succeeded();
    }
    run(at, "merge 1.part 2.part -o all.exr --report all.json").succeeded();
    let read = |name: &str| -> Value { serde_json::from_slice(&bytes(at.join(name))).expect("JSON") };
    let (one, all) = (read("one.json"), read("all.json"));
    assert_eq!(one["sampling"]["errors"].as_array().and_then(|errors| errors.last()), Some(&all["error"]));
    assert_eq!(one["work"], all["work"]);
    assert_eq!(one["image"], all["image"]);
    assert_eq!(all["workers"].as_array().map(Vec::len), Some(2));
    run(at, "farm report 1.part 2.part all.json -o page.html").succeeded();
    let page = String::from_utf8(bytes(at.join("page.html"))).expect("text");
    assert!(page.contains("part 2 of 2") && !page.contains("Mixed farm"), "{page}");
}

#[test]
fn parts_that_do_not_belong_together_are_named() {
    let folder = folder();
    let at = folder.path();
    let part = |options: &str, index: u32, name: &str| {
        run(at, &format!("render study:cornell --size 24x16 --model local {options} --shard {index}/2 -o {name}"))
            .succeeded();
    };
    part("", 1, "a1");
    part("", 2, "a2");
    part("--seed 3", 2, "b2");
    part("--set brdf=blinn-phong", 2, "c2");
    part("--split samples", 2, "d2");
    run(at, "render study:lamps --size 24x16 --model local --shard 2/2 -o e2").succeeded();
    run(at, "render study:cornell --size 24x16 --model local -o f2.exr").succeeded();
    std::fs::write(at.join("g2"), &bytes(at.join("a2"))[..600]).expect("a file");
    let mut damaged = bytes(at.join("a2"));
    let middle = damaged.len() * 4 / 5;
    damaged[middle] ^= 4;
    std::fs::write(at.join("h2"), damaged).expect("a file");
    // Of another driver: the text that says so is changed, as long as it was.
    let mut other = bytes(at.join("a2"));
    let place = other.windows(8).position(|word| word == b"llvmpipe").expect("the driver's name");
    other[place..place + 8].copy_from_slice(b"ELSEWHER");
    std::fs::write(at.join("i2"), other).expect("a file");
    for (parts, said) in [
        ("a1", "of 2 parts, these are missing: 2"),
        ("a1 a2 a2", "are the same part, 2 of 2"),
        ("a1 b2", "setting seed, 0 and 3"),
        ("a1 c2", "knob brdf, ggx-multi and blinn-phong"),
        ("a1 d2", "two different divisions of the picture: 1 of 2 by tiles"),
        ("a1 e2", "they show two scenes"),
        ("a1 f2.exr", "f2.exr is not a part of a picture"),
        ("a1 g2", "g2 is not a part of a picture, or it is truncated"),
        ("a1 h2", "h2"),
        ("a1 i2", "two devices"),
        ("a1 nowhere", "nowhere"),
    ] {
        let merged = run(at, &format!("merge {parts} -o all.exr"));
        assert_eq!(merged.code, Some(1), "{parts}: {merged:?}");
        merged.failed(1, said);
        assert!(!at.join("all.exr").exists(), "{parts} left a file");
    }
    run(at, "merge a1 a2 -o a1").failed(2, "only .png and .exr");
    run(at, "merge -o all.exr").failed(2, "PART");
    run(at, "merge a1 a2 -o all.exr").succeeded();
}

#[test]
fn what_cannot_be_divided_is_refused() {
    let folder = folder();
    let at = folder.path();
    for (arguments, code, said) in [
        ("--shard 3/2 -o a", 2, "I from 1 to N"),
        ("--shard 1/2", 2, "name the one file"),
        ("--shard 1/2 -o a -o b", 2, "name the one file"),
        ("--split tiles", 2, "--shard"),
        ("--shard 1/2 -o a --repeat 2", 2, "--repeat"),
        ("--shard 1/2 -o a --within 5", 2, "--within"),
        ("--shard 1/2 -o a --report r.json", 2, "--report"),
        ("--shard 1/2 -o a --model global --max-error 5%", 2, "--max-error"),
        ("--shard 1/9 -o a", 1, "fewer tiles"),
        ("--shard 1/2 -o a --split samples --set samples=1", 1, "1 samples are added in 1 blocks"),
        ("--frames 1-2 -o a.png", 2, "need a frame number"),
        ("--frames 1-2 -o {frame:x}.png", 2, "is not a placeholder"),
        ("--frames 5-1", 2, "larger frame to a smaller"),
        ("--frames 1-2", 1, "nothing in study:cornell moves"),
        ("--turntable 0", 2, "--turntable"),
        ("--turntable 2 --fps 0", 2, "--fps"),
        ("--fps 5 --cameras all -o {camera}.png", 2, "--fps"),
        ("--turntable 2 -o a.apng", 2, "made from the pictures"),
        ("--turntable 2 -o {frame}.exr -o a.apng", 2, "made from PNG files"),
        ("--turntable 2 -o {frame}.png -o a.apng --shard 1/2", 2, "needs all frames"),
        ("--cameras nobody -o {camera}.png", 2, "nobody"),
        ("--cameras all -o a.png", 2, "{camera}"),
        ("--turntable 2 --within 5", 2, "--within"),
        ("--fps 5 -o a.png", 2, "--fps"),
        ("--turntable 2 --shard 1/2 --split samples -o {frame}.png", 2, "--split"),
        ("--turntable 3000000000 -o {frame}.png", 2, "--turntable"),
        ("--aov normal,normal -o a.exr", 2, "named twice"),
        ("--shard 1/2 -o a --aov normal,normal", 2, "named twice"),
        // Files that the command reads or writes already.
        ("--report cornell.png", 2, "--report cornell.png"),
        ("--turntable 3 -o a.{frame}.png --report a.1.png", 2, "--report a.1.png"),
        ("--env a.exr -o a.exr", 2, "--output a.exr"),
        ("--env a.exr --shard 1/2 -o a.exr", 2, "--output a.exr"),
        ("--env 1.exr --turntable 3 -o {frame}.exr", 2, "--output 1.exr"),
        ("--env a.exr --turntable 3 --report a.exr", 2, "--report a.exr"),
    ] {
        // 8 tiles.
        run(at, &format!("render study:cornell --size 32x16 {arguments}")).failed(code, said);
    }
    let screen = "render study:metals --size 32x16 --set reflection=screen --shard 1/2 -o a --split tiles";
    run(at, screen).failed(1, "choose --split samples");
    assert_eq!(
        std::fs::read_dir(at).expect("a folder").filter(|e| e.as_ref().is_ok_and(|e| e.file_name() != "cache")).count(),
        0
    );
}

#[test]
fn frames_are_pictures_of_their_time_and_are_drawn_once() {
    let folder = folder();
    let at = folder.path();
    moving(at);
    let view = "moves.glb --size 40x24 --eye 1,0.5,3 --target 1,0.5,0 --env none --model local";
    run(
        at,
        &format!(
            "render {view} --frames 0-4:2,7 --fps 8 -o f{{frame:02}}.png -o f{{frame}}.exr -o all.apng --report r.json"
        ),
    )
    .succeeded();
    for frame in [0, 2, 4, 7] {
        let time = f64::from(frame) / 8.0;
        run(at, &format!("render {view} --time {time} -o one.exr")).succeeded();
        let distance = run(at, &format!("diff one.exr f{frame}.exr --metric mse")).succeeded();
        assert_eq!(distance.stdout, "mse 0\n", "frame {frame}");
    }
    assert_ne!(bytes(at.join("f00.png")), bytes(at.join("f07.png")), "nothing moved");
    let read = || -> Value { serde_json::from_slice(&bytes(at.join("r.json"))).expect("JSON") };
    let found = |report: &Value| -> Vec<bool> {
        let pictures = report["pictures"].as_array().expect("pictures");
        pictures.iter().map(|picture| picture["found"].as_bool().expect("a flag")).collect()
    };
    assert_eq!(found(&read()), [false; 4]);
    let animation =
        image::codecs::png::PngDecoder::new(std::io::Cursor::new(bytes(at.join("all.apng")))).expect("a PNG");
    assert!(animation.is_apng().expect("its chunks"));
    let before: Vec<Vec<u8>> = ["f00.png", "f02.png", "f04.png", "f07.png"].map(|name| bytes(at.join(name))).into();
    // One is cut short, one is of other knobs: those two are drawn again.
    std::fs::write(at.join("f02.png"), &before[1][..before[1].len() / 2]).expect("a file");
    run(at, &format!("render {view} --frames 4 --fps 8 --set samples=16 -o f{{frame:02}}.png")).succeeded();
    let again =
        format!("render {view} --frames 0-4:2,7 --fps 8 -o f{{frame:02}}.png -o f{{frame}}.exr --report r.json");
    run(at, &again).succeeded();
    assert_eq!(found(&read()), [true, false, false, true]);
    let after: Vec<Vec<u8>> = ["f00.png", "f02.png", "f04.png", "f07.png"].map(|name| bytes(at.join(name))).into();
    assert!(before == after, "a frame is another picture");
    // Two processes draw what one did.
    let shares = "--frames 0-4:2,7 --fps 8 -o g{frame:02}.png --report g.json";
    run(at, &format!("render {view} {shares} --shard 2/2")).succeeded();
    run(at, &format!("render {view} {shares} --shard 1/2")).succeeded();
    for frame in ["00", "02", "04", "07"] {
        let [f, g] = ["f", "g"].map(|name| bytes(at.join(format!("{name}{frame}.png"))));
        assert!(f == g, "frame {frame}");
    }
    run(at, "farm report r.json g.json -o page.html").succeeded();
}

#[test]
fn a_turntable_comes_around() {
    let folder = folder();
    let at = folder.path();
    run(at, "render study:cornell --size 32x24 --model local --turntable 4 --frames 0-4 -o t{frame}.exr").succeeded();
    let distance = |a: &str, b: &str| -> f64 {
        let said = run(at, &format!("diff {a} {b} --metric rmse --json")).succeeded().stdout;
        serde_json::from_str::<Value>(&said).expect("JSON")["value"].as_f64().expect("a number")
    };
    // A whole turn is rounded in f64: edges may fall another way in a pixel or two.
    assert!(distance("t0.exr", "t4.exr") < 0.02, "a whole turn is another picture");
    assert!(distance("t0.exr", "t1.exr") > 0.1, "nothing turned");
    run(at, "render study:lamps --size 32x24 --model local --cameras all -o {camera}.png").succeeded();
    // A file of another kind under a name that nobody gave is not replaced.
    std::fs::write(at.join("lamps.front.png"), "mine").expect("a file");
    let unnamed = "render study:lamps --size 32x24 --model local --cameras all";
    run(at, unnamed).failed(1, "may be a picture of another scene");
    std::fs::remove_file(at.join("lamps.front.png")).expect("a file");
    run(at, "render study:lamps --size 32x24 --model local --camera front -o one.png").succeeded();
    assert_eq!(run(at, "diff front.png one.png --metric mse").succeeded().stdout, "mse 0\n");
}

#[cfg(unix)]
#[test]
fn a_part_that_is_told_to_end_keeps_what_it_has() {
    let folder = folder();
    let at = folder.path();
    let picture = "render study:cornell --size 96x64 --model global --set samples=1024";
    run(at, &format!("{picture} -o one.exr")).succeeded();
    let line = format!("{picture} --shard 1/1 -o 1.part --progress openjd");
    let mut ended = None;
    let mut kept = Vec::new();
    for attempt in 0..40 {
        let mut child = program::command(at)
            .args(line.split(' '))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the program starts");
        // A busy machine needs longer until there is something to keep.
        std::thread::sleep(Duration::from_millis(1500 + 100 * attempt));
        Command::new("sh").args(["-c", &format!("kill -TERM {}", child.id())]).status().expect("a shell");
        let told = Instant::now();
        let status = child.wait().expect("it ends");
        assert!(told.elapsed() < Duration::from_secs(20), "no notice is that long");
        ended = status.code();
        match ended {
            Some(143) => {
                if at.join("1.part").exists() {
                    let said = run(at, "merge 1.part -o all.exr").failed(1, "is incomplete").stderr;
                    let samples = said.split_once("it has ").and_then(|(_, rest)| rest.split_once(" of "));
                    kept.push(samples.and_then(|(count, _)| count.parse::<u32>().ok()).expect("a number of samples"));
                }
            }
            Some(0) => break,
            other => panic!("ended with {other:?}"),
        }
    }
    if ended != Some(0) {
        run(at, &line).succeeded();
    }
    assert!(!kept.is_empty() && kept.is_sorted(), "samples that were kept: {kept:?}");
    assert!(kept.len() == 1 || kept.last() > kept.first(), "no part went on: {kept:?}");
    run(at, "merge 1.part -o all.exr").succeeded();
    assert!(bytes(at.join("one.exr")) == bytes(at.join("all.exr")), "a part that went on is another picture");
    // And once more, by somebody else: nothing is drawn, nothing is changed.
    let whole = bytes(at.join("1.part"));
    run(at, &line).succeeded();
    assert!(whole == bytes(at.join("1.part")));
}

#[test]
fn engines_hear_how_far_it_is() {
    let folder = folder();
    let at = folder.path();
    let picture = "render study:cornell --size 32x16 --model global --set samples=4";
    let run_with = |form: &str| run(at, &format!("{picture} -o a.png --progress {form}")).succeeded();
    let openjd = run_with("openjd").stdout;
    assert!(openjd.lines().any(|line| line == "openjd_progress: 100.0"), "{openjd}");
    assert!(openjd.lines().any(|line| line == "openjd_status: drawing"), "{openjd}");
    let told: Vec<Value> = run_with("json").stderr.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
    assert!(told.iter().any(|line| line["progress"] == 1.0), "{told:?}");
    let failed = run(at, "render nothing.glb --progress openjd");
    assert!(failed.stdout.contains("openjd_fail: loading nothing.glb"), "{failed:?}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_worth_another_try() {
    let folder = folder();
    let run = run(folder.path(), "render study:cornell --size 32x16 --model local -o /dev/full.png");
    assert_ne!(run.code, Some(75), "no such file is no full disk: {run:?}");
    // A device that is always full, under a name with an extension.
    std::os::unix::fs::symlink("/dev/full", folder.path().join("full.png")).expect("a link");
    let full = etalon(
        folder.path(),
        &["render", "study:cornell", "--size", "32x16", "--model", "local", "-o", "full.png"],
        &HASTY,
    );
    full.failed(75, "no space left on the disk");
}

#[test]
fn job_files_are_what_their_engines_read() {
    let folder = folder();
    let at = folder.path();
    let still = "study:cornell --model global --set samples=64 -o out.exr";
    for engine in ["openjd", "slurm", "hyperqueue", "flamenco", "opencue", "kubernetes"] {
        let text = run(at, &format!("farm job --engine {engine} --tasks 3 -- {still}")).succeeded().stdout;
        let has = text.contains("render study:cornell --model global --set samples=64") && text.contains("merge");
        assert!(has && text.contains("cornell.parts"), "{engine}: {text}");
        let frames = run(
            at,
            &format!(
                "farm job --engine {engine} --minutes 1 --seconds 20 -- study:cornell --turntable 9 -o t{{frame}}.png"
            ),
        );
        let text = frames.succeeded().stdout;
        assert!(text.contains("--turntable 9") && !text.contains("merge"), "{engine}: {text}");
        assert!(
            ["/3", "defaultTaskCount: 3", "default: 3"].iter().any(|count| text.contains(count)),
            "{engine}: {text}"
        );
    }
    let by_samples = format!("farm job --engine slurm --tasks 4 -- {still} --split samples");
    assert!(run(at, &by_samples).succeeded().stdout.contains("--split samples"));
    for (arguments, code, said) in [
        ("--engine slurm -- study:cornell", 2, "--tasks"),
        ("--engine slurm --minutes 5 -- study:cornell", 2, "--cost DIR"),
        ("--engine nothing --tasks 2 -- study:cornell", 2, "nothing"),
        ("--engine slurm --tasks 2 -- study:cornell --set gloss=1", 2, "no knob is called"),
        ("--engine slurm --tasks 2 -- study:cornell --no-such-option", 2, "--no-such-option"),
        ("--engine slurm --tasks 2 -- study:cornell --shard 1/2", 2, "--shard"),
        ("--engine slurm --tasks 2 -- study:cornell --turntable 5", 2, "name the files"),
        ("--engine slurm --tasks 2 -- study:lamps --cameras all -o {camera}.png", 2, "divided by frames"),
        ("--engine slurm --minutes 1 --cost nowhere -- study:cornell", 1, "nowhere"),
        // What tasks would refuse, or overwrite.
        ("--engine openjd --tasks 4 -- moves.glb --frames 1-4 -o out.png", 2, "need a frame number"),
        ("--engine slurm --tasks 4 -- study:cornell -o c.jpg", 2, "only .png and .exr"),
        ("--engine slurm --tasks 4 -- study:cornell --report r.json -o c.exr", 2, "--report"),
        ("--engine slurm --tasks 4 -- study:cornell --keep -o c.exr", 2, "--keep"),
        ("--engine slurm --tasks 4 --here elsewhere -- study:cornell", 2, "--here"),
    ] {
        run(at, &format!("farm job {arguments}")).failed(code, said);
    }
}
