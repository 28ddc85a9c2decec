//! What the plan saves, and whether what it leaves out costs anything: five scenes with the plan of what they call for
//! and with that of everything, in turns; and for each effect the program as it is beside one built without the
//! effect's code, on a scene that does not call for it.
//!
//! `./x bench --bench price [-- saved | timed | counted] [EFFECT ...]`: builds the program once for each effect, half
//! an hour in all. Times of one program scatter by 5 % from process to process on a shared machine; `counted` takes
//! instructions instead, which valgrind counts to a ten-thousandth.
#![allow(missing_docs, clippy::print_stdout, reason = "a program whose figures go to standard output")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use anyhow::{Context as _, Result, ensure};
use serde_json::Value;

/// Pairs of runs.
const PAIRS: usize = 9;
/// Pictures of each run; the first is the start.
const PICTURES: &str = "8";

/// An effect, the constants that guard its code, and a scene that does not call for it.
const EFFECTS: &[(&str, &str, &[&str])] = &[
    ("emissive textures", "HAS_EMISSIVE", &["study:metals"]),
    ("clear coat and layers", "CLEARCOAT,HAS_LAYERS", &["study:metals"]),
    ("conductors with n and kappa", "CONDUCTORS", &["study:cornell"]),
    ("alpha test in rays", "MASKED_HITS,MASKED", &["study:metals"]),
    ("transparent shadows", "FILTERS", &["study:metals"]),
    ("transmission", "TRANSMISSIVE,STORED_TRANSMISSION", &["study:metals"]),
    ("absorption and media that vary", "ABSORPTION,MARCH_STEPS", &["study:metals"]),
    ("coincident interfaces", "COINCIDENT_INTERFACES", &["study:etalon"]),
    ("glossy reflection", "ROUGH", &["study:nested"]),
    ("reflection", "MIRROR_RAYS", &["study:lamps", "--set", "reflection=environment"]),
    ("shadows", "SHADOWS", &["study:lamps", "--set", "shadows=off"]),
    ("tiled light culling", "TILE_WORDS", &["study:cornell"]),
    ("light from all around", "AMBIENT,REFLECTION", &["study:cornell", "--env", "none"]),
    ("spectral rendering", "SPECTRAL", &["study:metals"]),
    ("rough transmission", "ROUGH_TRANSMISSION", &["study:metals", "--model", "global"]),
    ("analytic area lights", "AREA_EMITTERS", &["study:lamps", "--model", "global"]),
    ("path guiding", "PATH_GUIDING", &["study:metals", "--model", "global"]),
    (
        "all of a local model's scene",
        "CLEARCOAT,HAS_LAYERS,STORED_LAYERS,CONDUCTORS,MASKED_HITS,FILTERS,TRANSMISSIVE,STORED_TRANSMISSION,ABSORPTION,MARCH_STEPS,\
         COINCIDENT_INTERFACES,ROUGH,MIRROR_RAYS,SHADOWS,TILE_WORDS",
        &["study:radiance"],
    ),
];

/// Where the programs are built: none of them ever lies where the real one does.
fn target() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("target/price")
}

fn build(without: &str) -> Result<()> {
    let mut cargo = Command::new(std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned()));
    cargo.args(["build", "--release", "--quiet", "--offline", "--bin", "etalon", "--target-dir"]);
    cargo.arg(target());
    match without {
        "" => cargo.env_remove("ETALON_WITHOUT"),
        names => cargo.env("ETALON_WITHOUT", names),
    };
    ensure!(cargo.status().context("running cargo")?.success(), "building without {without}");
    Ok(())
}

/// Scenes that call for little, for some things and for much.
const SCENES: [&str; 5] = ["study:radiance", "study:metals", "study:cornell", "study:blend", "study:etalon"];

/// One run: milliseconds of the process and the least of a picture's passes, pipelines, bytes of SPIR-V and of buffers
/// and images.
struct Run {
    process: f64,
    passes: f64,
    pipelines: u64,
    spirv: u64,
    memory: u64,
}

fn run(program: &Path, scene: &[&str], folder: &Path, cold: bool) -> Result<Run> {
    let report = folder.join("report.json");
    let mut command = Command::new(program);
    command.arg("-q").arg("render").args(scene).args(["--size", "640x360", "--set", "samples=1", "--report"]);
    command.arg(&report).arg("-o").arg(folder.join("out.png"));
    if cold {
        command.env("MESA_SHADER_CACHE_DISABLE", "true");
    } else {
        command.args(["--repeat", PICTURES]);
    }
    let start = Instant::now();
    let output = command.output().context("running a program")?;
    let process = start.elapsed().as_secs_f64() * 1e3;
    ensure!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&std::fs::read(&report)?)?;
    let passes = report["passes"].as_array().context("passes")?.iter();
    let passes = passes.filter_map(|pass| pass["gpu_ms"]["min"].as_f64()).sum();
    let number = |value: &Value| value.as_u64().context("a number");
    Ok(Run {
        process,
        passes,
        pipelines: number(&report["pipelines"]["count"])?,
        spirv: number(&report["pipelines"]["spirv_bytes"])?,
        memory: report["plan"]["buffers"]
            .as_array()
            .context("buffers")?
            .iter()
            // Each repeated picture is read back through a buffer of its own, which is not part of the plan.
            .filter(|b| b["name"] != "film read back")
            .filter_map(|b| b["bytes"].as_u64())
            .sum(),
    })
}

/// The plan of what a scene calls for beside that of everything.
fn saved(program: &Path, folder: &Path) -> Result<()> {
    println!(
        "plan=scene / plan=full: medians of {PAIRS} pairs; the start is a process that draws once, with a cold driver"
    );
    println!(
        "{:16} {:>20} {:>20} {:>10} {:>16} {:>16}",
        "scene", "start, ms", "a sample, ms", "pipelines", "SPIR-V, KB", "memory, MB"
    );
    for scene in SCENES {
        let mut all: [Vec<(Run, Run)>; 2] = [Vec::new(), Vec::new()];
        for i in 0..=PAIRS {
            for j in [i % 2, 1 - i % 2] {
                let arguments = [scene, "--plan", ["scene", "full"][j]];
                let runs = (run(program, &arguments, folder, false)?, run(program, &arguments, folder, true)?);
                if i > 0 {
                    all[j].push(runs);
                }
            }
        }
        let median =
            |of: &dyn Fn(&(Run, Run)) -> f64| all.each_ref().map(|runs| spread(runs.iter().map(of).collect())[1]);
        let pair = |[scene, full]: [f64; 2], digits: usize| format!("{scene:.digits$} / {full:.digits$}");
        println!(
            "{scene:16} {:>20} {:>20} {:>10} {:>16} {:>16}",
            pair(median(&|(_, cold)| cold.process), 0),
            pair(median(&|(warm, _)| warm.passes), 1),
            pair(median(&|(warm, _)| warm.pipelines as f64), 0),
            pair(median(&|(warm, _)| warm.spirv as f64 / 1e3), 0),
            pair(median(&|(warm, _)| warm.memory as f64 / 1e6), 1),
        );
    }
    println!();
    Ok(())
}

/// Median, and the middle half's ends.
fn spread(mut ratios: Vec<f64>) -> [f64; 3] {
    ratios.sort_by(f64::total_cmp);
    [ratios.len() / 4, ratios.len() / 2, ratios.len() * 3 / 4].map(|i| ratios[i])
}

/// Millions of instructions of a program that draws so many pictures, counted by valgrind on one thread; other load
/// does not touch them.
fn instructions(program: &Path, scene: &[&str], picture: &Path, pictures: u32, cold: bool) -> Result<f64> {
    let mut command = Command::new("valgrind");
    command.args(["--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null"]).arg(program);
    command.args(["-q", "render"]).args(scene).args(["--size", "192x108", "--set", "samples=1", "-o"]).arg(picture);
    command.args(["--repeat", &pictures.to_string()]).env("LP_NUM_THREADS", "1");
    if cold {
        command.env("MESA_SHADER_CACHE_DISABLE", "true");
    }
    let output = command.output().context("running valgrind")?;
    let said = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "{said}");
    let total = said.lines().find_map(|line| line.split_once("refs:")).context("valgrind tells no instructions")?;
    Ok(total.1.trim().replace(',', "").parse::<f64>()? / 1e6)
}

/// Those of a picture and of a start with a cold driver; and the picture.
fn count(program: &Path, scene: &[&str], folder: &Path) -> Result<([f64; 2], Vec<u8>)> {
    let [warm_out, cold_out] = ["warm.exr", "cold.exr"].map(|name| folder.join(name));
    let warm = || -> Result<f64> {
        // The first run fills the driver's cache.
        instructions(program, scene, &warm_out, 1, false)?;
        let [one, five] = [1, 5].map(|pictures| instructions(program, scene, &warm_out, pictures, false));
        Ok((five? - one?) / 4.0)
    };
    let cold = || instructions(program, scene, &cold_out, 1, true);
    let (warm, cold) = std::thread::scope(|scope| {
        let cold = scope.spawn(cold);
        (warm(), cold.join().expect("a thread that counts"))
    });
    Ok(([warm?, cold?], std::fs::read(&warm_out)?))
}

/// Instructions of each effect's scene, beside those of a program without its code.
fn counted(whole: &Path, folder: &Path, wanted: impl Fn(&str) -> bool) -> Result<()> {
    println!("instructions with the code that nothing calls for, over without it, 192x108; millions of them");
    println!("{:32} {:>28} {:>28}", "effect", "a picture", "start, cold driver");
    let mut known = BTreeMap::new();
    for (effect, constants, scene) in EFFECTS.iter().filter(|(effect, ..)| wanted(effect)) {
        build(constants)?;
        if !known.contains_key(scene) {
            known.insert(*scene, count(whole, scene, folder)?);
        }
        let (with, picture) = &known[scene];
        let (without, same) = count(&target().join("release/etalon"), scene, folder)?;
        ensure!(*picture == same, "{effect}: the scene calls for it, its picture is another without");
        let shown = |k: usize| format!("{:.4} ({:.1}, {:.1})", with[k] / without[k], with[k], without[k]);
        println!("{effect:32} {:>28} {:>28}", shown(0), shown(1));
    }
    Ok(())
}

fn main() -> Result<()> {
    let mut wanted: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    let modes = ["saved", "timed", "counted"];
    let mode = wanted.first().filter(|first| modes.contains(&first.as_str())).cloned();
    if mode.is_some() {
        wanted.remove(0);
    }
    let does = |what: &str| mode.as_deref().is_none_or(|mode| mode == what);
    let asked = |effect: &str| wanted.is_empty() || wanted.iter().any(|name| effect.contains(name.as_str()));
    let folder = tempfile::tempdir()?;
    let built = target().join("release/etalon");
    let keep = |name: &str| -> Result<PathBuf> {
        let path = folder.path().join(name);
        std::fs::copy(&built, &path)?;
        Ok(path)
    };
    build("")?;
    let whole = keep("whole")?;
    if does("saved") && wanted.is_empty() {
        saved(&whole, folder.path())?;
    }
    if mode.as_deref() == Some("counted") {
        return counted(&whole, folder.path(), asked);
    }
    if !does("timed") {
        return Ok(());
    }
    println!("with the code that nothing calls for, over without it: the least of {PAIRS} runs (middle half of pairs)");
    println!("{:32} {:>24} {:>24} {:>16}", "effect", "passes of a picture", "start, cold driver", "SPIR-V, bytes");
    for (effect, constants, scene) in EFFECTS.iter().filter(|(effect, ..)| asked(effect)) {
        build(constants)?;
        let without = keep("without")?;
        let (mut pictures, mut starts) = (Vec::new(), Vec::new());
        let mut bytes = [0; 2];
        for i in 0..=PAIRS {
            // Which one is first changes from pair to pair.
            let order = if i % 2 == 0 { [&whole, &without] } else { [&without, &whole] };
            let mut runs = [None, None];
            for program in order {
                let warm = run(program, scene, folder.path(), false)?;
                let cold = run(program, scene, folder.path(), true)?;
                runs[usize::from(program == &without)] = Some((warm, cold));
            }
            let [Some((warm, cold)), Some((warm_without, cold_without))] = runs else { continue };
            bytes = [warm.spirv, warm_without.spirv];
            // The first pair fills caches.
            if i > 0 {
                pictures.push([warm.passes, warm_without.passes]);
                starts.push([cold.process, cold_without.process]);
            }
        }
        // What else goes on only adds to a run: the least of each is nearest to what it takes.
        let shown = |pairs: Vec<[f64; 2]>| {
            let [with, without] = [0, 1].map(|k| pairs.iter().map(|pair| pair[k]).fold(f64::MAX, f64::min));
            let [low, _, high] = spread(pairs.iter().map(|[with, without]| with / without).collect());
            format!("{:.3} ({low:.3} … {high:.3})", with / without)
        };
        println!("{effect:32} {:>24} {:>24} {:>8} {:>7}", shown(pictures), shown(starts), bytes[0], bytes[1]);
    }
    Ok(())
}
