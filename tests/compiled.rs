//! What a driver's compiler makes of the kernels of all study scenes: at most 128 vector registers, none of them
//! spilled, no array in memory, and every figure is within a tenth of the one in tests/compiled.json.
//!
//! It runs on devices and drivers that the file names; Mesa's RADV needs no GPU for it
//! (docs/decisions/architectures.md). `ETALON_BLESS=1` writes the figures of the device into the file.

use std::collections::BTreeMap;
use std::path::Path;

use etalon::frame::{Renderer, Settings};
use etalon::gpu::{Compiled, Footprint};
use etalon::plan::{Knobs, Model};
use etalon::scene::environment::Environment;
use etalon::study;
use etalon_testing::gpu::{Gpu, studio_of};

/// The largest figure of each kind over all scenes and models, of subgroups the smallest; by program and stage.
type Figures = BTreeMap<String, Footprint>;

fn joined(a: Footprint, b: Footprint) -> Footprint {
    Footprint {
        registers: a.registers.max(b.registers),
        spilled: a.spilled.max(b.spilled),
        scratch_bytes: a.scratch_bytes.max(b.scratch_bytes),
        shared_bytes: a.shared_bytes.max(b.shared_bytes),
        code_bytes: a.code_bytes.max(b.code_bytes),
        subgroups: a.subgroups.min(b.subgroups),
    }
}

fn figures(gpu: &Gpu) -> Figures {
    let mut all = Figures::new();
    let studio = Environment::studio();
    for name in study::NAMES {
        let scene = study::load(name).expect("a scene");
        let share = studio_of(&scene);
        for model in [Model::Local, Model::Recursive, Model::Global] {
            let settings = Settings {
                size: [320, 180],
                knobs: Knobs::of(model),
                environment_intensity: share.unwrap_or(1.0),
                ..Settings::default()
            };
            let environment = share.map(|_| &studio);
            let mut renderer = Renderer::new(&gpu.device, scene.clone(), environment, settings).expect("a renderer");
            let passes = renderer.passes(&scene.cameras[0]).expect("passes");
            for (program, constants) in passes.iter().flat_map(|pass| &pass.pipelines) {
                for compiled in gpu.device.compiled(program, constants).expect("statistics") {
                    let Some(of) = Compiled::footprint(&compiled) else { continue };
                    let name = format!("{} {}", program.name, compiled.stage);
                    all.entry(name).and_modify(|known| *known = joined(*known, of)).or_insert(of);
                }
            }
        }
    }
    all
}

/// Registers of a SIMD unit on which a kernel may have 128.
const REGISTER_FILE: u64 = 1024;

/// No kernel keeps registers or arrays in memory, none has more than 40 KB of code, where a cache of instructions holds
/// 32 (marching through the grid of study:haze takes a fifth of that), and none has more than 128 registers. A SIMD
/// unit with more than 1,024 (RDNA 3) hands them out in larger steps: what its subgroups have in all shows it.
fn check_size(device: &str, figures: &Figures) {
    let too_large = |of: &Footprint| {
        let crowds = of.registers > 128 && of.registers * of.subgroups <= REGISTER_FILE;
        crowds || of.spilled > 0 || of.scratch_bytes > 0 || of.code_bytes > 40 << 10
    };
    let large: Vec<_> = figures.iter().filter(|(_, of)| too_large(of)).collect();
    assert!(large.is_empty(), "{device}: of many registers, spilled, in memory or of much code: {large:#?}");
}

#[test]
fn kernels_of_all_known_drivers_stay_in_registers() {
    let known: BTreeMap<String, Figures> = serde_json::from_str(include_str!("compiled.json")).expect("figures");
    assert!(known.len() > 5, "figures of {} drivers", known.len());
    known.iter().for_each(|(device, figures)| check_size(device, figures));
}

#[test]
fn compiled_kernels_are_as_they_were() {
    let Some(gpu) = Gpu::that_tells_compiled() else {
        eprintln!("skipped: no driver here reports what its compiler made");
        return;
    };
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/compiled.json");
    let text = std::fs::read_to_string(&path).expect("tests/compiled.json");
    let mut known: BTreeMap<String, Figures> = serde_json::from_str(&text).expect("figures");
    let device = format!("{}, {}", gpu.device.info().name, gpu.device.info().driver);
    let is_blessing = std::env::var_os("ETALON_BLESS").is_some();
    if !is_blessing && !known.contains_key(&device) {
        eprintln!("skipped: tests/compiled.json has no figures of {device}");
        return;
    }
    let now = figures(&gpu);
    assert!(now.len() > 15, "{device}: figures of {} programs", now.len());
    check_size(&device, &now);
    if is_blessing {
        known.insert(device, now);
        std::fs::write(&path, serde_json::to_string_pretty(&known).expect("JSON") + "\n").expect("a written file");
        return;
    }
    let before = &known[&device];
    assert_eq!(before.keys().collect::<Vec<_>>(), now.keys().collect::<Vec<_>>(), "programs of {device}");
    for (name, of) in before {
        let words = |of: &Footprint| {
            [of.registers, of.scratch_bytes, of.shared_bytes, of.code_bytes, of.subgroups].map(|word| word as f64)
        };
        for (a, b) in words(of).into_iter().zip(words(&now[name])) {
            assert!((a - b).abs() <= 0.1 * a, "{device}: {name} was {of:?} and is {:?}", now[name]);
        }
    }
}
