//! Whether an effect that a scene does not call for costs anything: the program as it is beside one built without the code
//! of that effect, in turns. Prints ratios of time, and the SPIR-V that the driver is given.
//!
//! `./x bench --bench price [EFFECT ...]`: builds the program once for each effect, some minutes.
#![allow(missing_docs, clippy::print_stdout, reason = "a program whose figures go to standard output")]

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use anyhow::{Context as _, Result, ensure};
use serde_json::Value;

/// Pairs of runs.
const PAIRS: usize = 5;
/// Pictures of each run; the first is the start.
const PICTURES: &str = "8";

/// An effect, the constants that guard its code, and a scene that does not call for it.
const EFFECTS: &[(&str, &str, &[&str])] = &[
    ("emissive textures", "HAS_EMISSIVE", &["study:metals"]),
    ("clear coat and layers", "CLEARCOAT,HAS_LAYERS", &["study:metals"]),
    ("metals by n and kappa", "CONDUCTORS", &["study:cornell"]),
    ("holes before rays", "MASKED_HITS,MASKED", &["study:metals"]),
    ("light through surfaces", "FILTERS", &["study:metals"]),
    ("transmission", "TRANSMISSIVE,HAS_TRANSMISSION", &["study:metals"]),
    ("absorption and media that vary", "ABSORPTION,MARCH_STEPS", &["study:metals"]),
    ("bodies that touch", "TOUCHING", &["study:etalon"]),
    ("rays by lobes", "ROUGH", &["study:cornell"]),
    ("mirrors", "MIRROR_RAYS", &["study:lamps", "--set", "reflection=environment"]),
    ("shadows", "SHADOWS", &["study:lamps", "--set", "shadows=off"]),
    ("light lists per tile", "TILE_WORDS", &["study:cornell"]),
    ("light from all around", "AMBIENT,REFLECTION", &["study:cornell", "--env", "none"]),
    (
        "all of a local model's scene",
        "CLEARCOAT,HAS_LAYERS,CONDUCTORS,MASKED_HITS,FILTERS,TRANSMISSIVE,HAS_TRANSMISSION,ABSORPTION,MARCH_STEPS,\
         TOUCHING,ROUGH,MIRROR_RAYS,SHADOWS,TILE_WORDS",
        &["study:radiance"],
    ),
];

fn build(without: &str) -> Result<()> {
    let mut cargo = Command::new(std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned()));
    cargo.args(["build", "--release", "--quiet", "--offline", "--bin", "etalon"]);
    match without {
        "" => cargo.env_remove("ETALON_WITHOUT"),
        names => cargo.env("ETALON_WITHOUT", names),
    };
    ensure!(cargo.status().context("running cargo")?.success(), "building without {without}");
    Ok(())
}

/// One run: milliseconds of the process, of a picture's passes, and bytes of SPIR-V.
struct Run {
    process: f64,
    passes: f64,
    spirv: u64,
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
    let passes = passes.filter_map(|pass| pass["gpu_ms"]["median"].as_f64()).sum();
    Ok(Run { process, passes, spirv: report["pipelines"]["spirv_bytes"].as_u64().context("bytes")? })
}

/// Median, and the middle half's ends.
fn spread(mut ratios: Vec<f64>) -> [f64; 3] {
    ratios.sort_by(f64::total_cmp);
    [ratios.len() / 4, ratios.len() / 2, ratios.len() * 3 / 4].map(|i| ratios[i])
}

fn main() -> Result<()> {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    let folder = tempfile::tempdir()?;
    let built = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/release/etalon");
    let keep = |name: &str| -> Result<PathBuf> {
        let path = folder.path().join(name);
        std::fs::copy(&built, &path)?;
        Ok(path)
    };
    build("")?;
    let whole = keep("whole")?;
    println!("with the code that nothing calls for, over without it: median (middle half) of {PAIRS} pairs");
    println!("{:32} {:>24} {:>24} {:>16}", "effect", "passes of a picture", "start, cold driver", "SPIR-V, bytes");
    for (effect, constants, scene) in EFFECTS {
        if !wanted.is_empty() && !wanted.iter().any(|name| effect.contains(name.as_str())) {
            continue;
        }
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
                pictures.push(warm.passes / warm_without.passes);
                starts.push(cold.process / cold_without.process);
            }
        }
        let shown = |ratios| {
            let [low, middle, high] = spread(ratios);
            format!("{middle:.3} ({low:.3} … {high:.3})")
        };
        println!("{effect:32} {:>24} {:>24} {:>8} {:>7}", shown(pictures), shown(starts), bytes[0], bytes[1]);
    }
    build("")
}
