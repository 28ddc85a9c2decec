//! Devices that one does not own: the one here, lowered to what files describe or to what passports say, draws the same
//! picture or is refused for what it lacks.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use etalon::gpu::specialized;
use etalon::shader::PROGRAMS;
use etalon_mask::{Description, Mask};

#[path = "support/program.rs"]
mod program;

use program::{HASTY, Run, etalon};

fn descriptions() -> Vec<PathBuf> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders = [here.join("tests/devices"), here.join("../passport/passports")];
    let files = folders.iter().flat_map(|folder| std::fs::read_dir(folder).expect("a folder of descriptions"));
    let mut files: Vec<PathBuf> = files.map(|file| file.expect("a file").path()).collect();
    files.sort();
    files
}

/// The program on a device that a file describes.
struct Masked<'a> {
    folder: &'a Path,
    variables: Vec<(&'static str, String)>,
}

impl<'a> Masked<'a> {
    fn new(folder: &'a Path, file: &Path) -> Self {
        let mask = Mask::in_folder(folder).expect("the layer is built");
        Self { folder, variables: mask.variables(file).into() }
    }

    fn run(&self, arguments: &[&str]) -> Run {
        let own = self.variables.iter().map(|(name, value)| (*name, value.as_str()));
        let all: Vec<(&str, &str)> = HASTY.into_iter().chain(own).collect();
        etalon(self.folder, arguments, &all)
    }
}

/// Asserts that two pictures have the same radiance in every pixel.
#[track_caller]
fn assert_same_radiance(folder: &Path, [a, b]: [&str; 2], what: &str) {
    let diff = etalon(folder, &["diff", "--metric", "mae", a, b], &[]).succeeded();
    assert_eq!(diff.stdout, "mae 0\n", "{what}");
    assert_all_finite(&diff, what);
}

/// What is not finite is left out of a metric, so that NaN would look like no difference.
#[track_caller]
fn assert_all_finite(diff: &Run, what: &str) {
    assert!(!diff.stderr.contains("left out"), "{what}: {diff:?}");
}

/// Shadow maps; paths past textures. Nothing that fragments see is textured: lavapipe 22.3 chooses other mip levels
/// where places of textures lie in storage buffers (docs/decisions/helper-invocations.md).
const PICTURES: [[&str; 3]; 2] = [["study:cornell", "--model", "local"], ["study:metals", "--model", "global"]];

#[test]
fn a_device_that_can_draw_draws_the_same_bits() {
    let folder = tempfile::tempdir().expect("a folder");
    let render = |[scene, model, name]: [&'static str; 3], to: &'static str| {
        ["render", scene, model, name, "--size", "48x27", "--validate", "-o", to]
    };
    for picture in PICTURES {
        etalon(folder.path(), &render(picture, "here.exr"), &HASTY).succeeded();
        for file in descriptions() {
            let description = Description::read(&file).expect("a description");
            if !description.refused.is_empty() {
                continue;
            }
            let masked = Masked::new(folder.path(), &file);
            masked.run(&render(picture, "there.exr")).succeeded();
            assert_same_radiance(
                folder.path(),
                ["here.exr", "there.exr"],
                &format!("{}: {picture:?}", description.name),
            );
        }
    }
}

#[test]
fn a_device_that_cannot_draw_is_refused_for_all_that_it_lacks() {
    let folder = tempfile::tempdir().expect("a folder");
    for file in descriptions() {
        let description = Description::read(&file).expect("a description");
        let masked = Masked::new(folder.path(), &file);
        let Some(first) = description.refused.first() else { continue };
        let run = masked.run(&["render", "study:cornell", "--size", "8x8", "-o", "x.png"]);
        for said in &description.refused {
            assert!(run.stderr.contains(said), "{}: \"{said}\" is not in {run:?}", description.name);
        }
        run.failed(1, first);
        assert!(!folder.path().join("x.png").exists(), "{}", description.name);
    }
}

#[test]
fn rays_need_addition_within_subgroups_and_shadow_maps_do_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("lonely.json");
    std::fs::write(&file, r#"{ "name": "Invocations by themselves", "without_subgroup_arithmetic": true }"#)
        .expect("a file");
    let masked = Masked::new(folder.path(), &file);
    let render = |model| ["render", "study:cornell", "--model", model, "--size", "8x8", "-o", "x.png"];
    masked.run(&render("local")).succeeded();
    masked.run(&render("global")).failed(1, "addition within subgroups");
}

/// A passport of a lowered device says what it lacks, and is a description of it.
#[test]
fn a_passport_of_a_described_device_is_its_description() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/devices/swiftshader.json");
    let masked = Masked::new(folder.path(), &file);
    // Sampled capabilities alone, without the time of measurements.
    let arguments = ["passport", "--only", "arithmetic", "-o", "card.json"];
    let run = masked.run(&arguments).succeeded();
    assert!(run.stdout.contains("promises are held") && run.stdout.contains("card.json: written"), "{run:?}");
    let wanted = Description::read(&file).expect("a description");
    let found = Description::read(&folder.path().join("card.json")).expect("a passport");
    for (wanted, found) in [
        (&wanted.without_features, &found.without_features),
        (&wanted.without_extensions, &found.without_extensions),
        (&wanted.without_formats["R16G16B16A16_SNORM"], &found.without_formats["R16G16B16A16_SNORM"]),
    ] {
        assert!(wanted.iter().all(|lack| found.contains(lack)), "{wanted:?} are not all in {found:?}");
    }
    for (limit, most) in &wanted.limits {
        assert!(found.limits[limit] <= *most, "{limit}");
    }
    let checked = etalon(folder.path(), &["passport", "--check", "card.json", "-v"], &[]).succeeded();
    assert!(checked.stdout.contains("held    a * b keeps Vulkan's bound"), "{checked:?}");
    std::fs::write(folder.path().join("other.json"), "{}").expect("a file");
    etalon(folder.path(), &["passport", "--check", "other.json"], &[]).failed(1, "other.json: reading a passport");
}

/// The program on the device here with a fault.
fn with_fault(folder: &Path, fault: &str, arguments: &[&str]) -> Run {
    let file = folder.join("fault.json");
    std::fs::write(&file, fault).expect("a written file");
    let _ = std::fs::remove_file(file.with_extension("lost"));
    Masked::new(folder, &file).run(arguments)
}

#[test]
fn a_lost_device_is_tried_once_more_in_short_submissions() {
    let folder = tempfile::tempdir().expect("a folder");
    let render = |to: &'static str| ["render", "study:metals", "--model", "global", "--size", "48x27", "-o", to];
    etalon(folder.path(), &render("whole.exr"), &HASTY).succeeded();
    // Before, while and after the picture is drawn.
    for lost in [2, 6, 9] {
        let fault = format!("{{ \"lost_at_submission\": {lost} }}");
        let run = with_fault(folder.path(), &fault, &render("again.exr")).succeeded();
        assert!(run.stderr.contains("once more, in short submissions"), "{lost}: {run:?}");
        assert_same_radiance(folder.path(), ["whole.exr", "again.exr"], &format!("lost at {lost}"));
    }
}

/// So are frames that are not there yet, and parts.
#[test]
fn sequences_and_parts_are_tried_once_more_too() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let common = ["render", "study:metals", "--model", "local", "--size", "48x27"];
    let file = |name: &str| std::fs::read(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
    let frames = |to: &'static str| [&common[..], &["--turntable", "3", "-o", to]].concat();
    etalon(folder, &frames("whole{frame}.exr"), &HASTY).succeeded();
    let arguments = [frames("again{frame}.exr"), vec!["--report", "frames.json"]].concat();
    let run = with_fault(folder, r#"{ "lost_at_submission": 24 }"#, &arguments).succeeded();
    assert!(run.stderr.contains("what is missing is drawn once more, in short submissions"), "{run:?}");
    assert_eq!(run.stdout, "again0.exr\nagain1.exr\nagain2.exr\n", "each once");
    let report: serde_json::Value = serde_json::from_slice(&file("frames.json")).expect("JSON");
    let frames = report["pictures"].as_array().expect("pictures");
    let drawn_before = |frame: &&serde_json::Value| frame["found"] == false && frame["draw_ms"] == 0.0;
    assert_eq!(frames.iter().filter(drawn_before).count(), 1, "the first one is not drawn again: {report}");
    for frame in 0..3 {
        assert!(file(&format!("whole{frame}.exr")) == file(&format!("again{frame}.exr")), "frame {frame}");
    }
    let part = |to: &'static str| [&common[..], &["--shard", "1/2", "-o", to]].concat();
    etalon(folder, &part("whole.exr"), &HASTY).succeeded();
    let run = with_fault(folder, r#"{ "lost_at_submission": 4 }"#, &part("again.exr")).succeeded();
    assert!(run.stderr.contains("the picture is drawn once more, in short submissions"), "{run:?}");
    // The header names the worker and its time.
    assert_same_radiance(folder, ["whole.exr", "again.exr"], "a part");
}

/// Short submissions are cut by their measured pace; a clock that stands still, or runs a million times too fast,
/// changes no bit.
#[test]
fn timestamps_may_be_wrong() {
    let folder = tempfile::tempdir().expect("a folder");
    let render = |to: &'static str| ["render", "study:cornell", "--model", "global", "--size", "64x36", "-o", to];
    etalon(folder.path(), &render("here.exr"), &HASTY).succeeded();
    for factor in [0, 1_000_000] {
        // A lost device is what makes submissions short on a CPU.
        let fault = format!("{{ \"timestamp_factor\": {factor}, \"lost_at_submission\": 1 }}");
        let run = with_fault(folder.path(), &fault, &render("there.exr")).succeeded();
        assert!(run.stderr.contains("in short submissions"), "{run:?}");
        assert_same_radiance(folder.path(), ["here.exr", "there.exr"], &format!("times {factor}"));
    }
}

/// What the layer makes of every shader is SPIR-V that a driver may get.
#[test]
fn rewritten_shaders_are_valid() {
    // Of Debian's package spirv-tools, which ./x installs.
    let has_validator = Command::new("spirv-val").arg("--version").output().is_ok();
    if !has_validator {
        eprintln!("spirv-val is not here: shaders are rewritten and not validated");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let described = |text: &str| {
        std::fs::write(folder.path().join("x.json"), text).expect("a file");
        Description::read(&folder.path().join("x.json")).expect("a description")
    };
    let reverses = described(r#"{ "reverses": true }"#);
    let all = described(
        r#"{ "reverses": true, "contracts": true,
            "inexact": { "division": 2, "root": 3, "inverse_root": 1, "power": 2, "angle": 4096 } }"#,
    );
    let (mut reversed, mut checked) = (0, 0);
    for program in PROGRAMS {
        for stage in program.stages {
            // Everything that can be switched on.
            let constants: Vec<(u32, u32)> = program.constants.iter().map(|constant| (constant.id, 1)).collect();
            let words = specialized(stage.words, &constants);
            let is_reversed = reverses.rewritten(&words).is_some();
            assert!(!is_reversed || program.stages.len() == 1, "{}: a raster stage has no workgroups", program.name);
            reversed += usize::from(is_reversed);
            let Some(words) = all.rewritten(&words) else { continue };
            checked += 1;
            if !has_validator {
                continue;
            }
            let file = folder.path().join("x.spv");
            let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
            std::fs::write(&file, bytes).expect("a file");
            let arguments = ["--target-env", "vulkan1.3", "--scalar-block-layout"];
            let run = Command::new("spirv-val").args(arguments).arg(&file).output().expect("spirv-val of spirv-tools");
            assert!(run.status.success(), "{}: {}", program.name, String::from_utf8_lossy(&run.stdout));
        }
    }
    assert!(reversed > 20 && checked > 25, "{reversed} reversed, {checked} checked");
}

/// What the driver has compiled is kept for later processes, and given back to it as it was or not at all.
#[test]
fn compiled_pipelines_are_kept_in_a_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("keeps.json");
    std::fs::write(&file, r#"{ "keeps_pipelines": true }"#).expect("a file");
    let masked = Masked::new(folder.path(), &file);
    let draw = |masked: &Masked<'_>| {
        let _ = std::fs::remove_file(file.with_extension("noted"));
        masked.run(&["render", "study:cornell", "--model", "local", "--size", "8x8", "-o", "x.png"]).succeeded();
        std::fs::read(file.with_extension("noted")).unwrap_or_default()
    };
    let kept = || -> Vec<PathBuf> {
        let files = std::fs::read_dir(folder.path().join("cache/etalon/pipelines")).into_iter().flatten();
        files.map(|file| file.expect("a file").path()).collect()
    };
    assert_eq!(draw(&masked), Vec::<u8>::new(), "there was none");
    let [own] = kept().try_into().expect("one file");
    let whole = std::fs::read(&own).expect("the file");
    assert_eq!(draw(&masked), whole[16..], "all behind the hash");
    assert_eq!(std::fs::read(&own).expect("the file"), whole);
    // One that was damaged is not used, and is replaced.
    for damaged in [whole[..whole.len() / 2].to_vec(), [&whole[..99], &[0], &whole[100..]].concat(), Vec::new()] {
        std::fs::write(&own, damaged).expect("written");
        assert_eq!(draw(&masked), Vec::<u8>::new());
        assert_eq!(std::fs::read(&own).expect("the file"), whole);
    }
    // Where no file can be, the picture is drawn all the same.
    std::fs::remove_file(&own).expect("removed");
    std::fs::create_dir(&own).expect("a folder");
    assert_eq!(draw(&masked), Vec::<u8>::new());
    // A driver that keeps nothing has no file.
    std::fs::remove_dir(&own).expect("removed");
    std::fs::write(&file, "{}").expect("a file");
    assert_eq!(draw(&masked), Vec::<u8>::new());
    assert_eq!(kept(), Vec::<PathBuf>::new());
}

#[test]
fn want_of_device_memory_is_an_error_and_leaves_no_file() {
    let folder = tempfile::tempdir().expect("a folder");
    for allocation in [1, 2, 4] {
        let fault = format!("{{ \"no_memory_from_allocation\": {allocation} }}");
        let run = with_fault(folder.path(), &fault, &["render", "study:metals", "--size", "48x27", "-o", "x.png"]);
        run.failed(1, "memory");
        assert!(!folder.path().join("x.png").exists(), "allocation {allocation}");
    }
}

/// Errors of arithmetic: of quotients, and of roots and powers.
const INEXACT: [(&str, &str); 4] = [
    ("quotients", "\"division\": 2"),
    ("quotients", "\"division\": -2"),
    ("roots and powers", "\"root\": 3, \"inverse_root\": 1, \"power\": 2"),
    ("roots and powers", "\"root\": -3, \"inverse_root\": -1, \"power\": -2"),
];

/// Outputs whose errors exceed their bounds: function, output, tier and bound, with the largest error in parts of the
/// bound for each kind of operation.
fn exceeded(folder: &Path) -> BTreeMap<[String; 4], BTreeMap<&'static str, f64>> {
    let mut all: BTreeMap<[String; 4], BTreeMap<&'static str, f64>> = BTreeMap::new();
    for (operations, inexact) in INEXACT {
        let fault = format!("{{ \"inexact\": {{ {inexact} }} }}");
        let run = with_fault(folder, &fault, &["verify", "--json", "--cases", "10000"]);
        let document: serde_json::Value = serde_json::from_str(&run.stdout).expect("JSON");
        for row in document["outputs"].as_array().expect("outputs") {
            // JSON has no infinity: it is a string.
            let of_bound = match &row["worst"]["of_bound"] {
                serde_json::Value::String(_) => f64::INFINITY,
                ratio => ratio.as_f64().unwrap_or_else(|| panic!("no ratio to the bound: {row}")),
            };
            let Some(bound) = row["bound"].as_str() else { continue };
            let text = |key: &str| row[key].as_str().unwrap_or_default().to_owned();
            let name = [text("function"), text("name"), text("tier"), bound.to_owned()];
            let worst = all.entry(name).or_default().entry(operations).or_default();
            *worst = worst.max(of_bound);
        }
    }
    all.retain(|_, worst| worst.values().any(|&worst| worst > 1.0));
    all
}

/// docs/inexact.md lists the bounds that inexact arithmetic breaks, and no other is broken.
#[test]
fn the_page_lists_the_bounds_that_inexact_arithmetic_breaks() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/inexact.md");
    let page = std::fs::read_to_string(&path).expect("docs/inexact.md");
    let (head, rest) = page.split_once("<!-- generated: inexact arithmetic -->\n").expect("a generated table");
    let (_, tail) = rest.split_once("<!-- end -->").expect("its end");
    let rows: String = exceeded(folder.path())
        .into_iter()
        .map(|([function, output, tier, bound], worst)| {
            let of = |kind: &str| worst.get(kind).filter(|&&x| x > 1.0).map_or(String::new(), |x| format!("{x:.2}"));
            let [a, b] = ["quotients", "roots and powers"].map(of);
            format!("| `{function}` | {output} | {tier} | {} | {a} | {b} |\n", bound.replace('|', "\\|"))
        })
        .collect();
    let table = format!(
        "\n| function | output | tier | bound | quotients off | roots and powers off |\n|---|---|---|---|---|---|\n{rows}\n"
    );
    let new = format!("{head}<!-- generated: inexact arithmetic -->\n{table}<!-- end -->{tail}");
    if std::env::var_os("ETALON_BLESS").is_some() {
        std::fs::write(&path, new).expect("a written file");
        return;
    }
    assert!(rows.lines().count() > 100, "the errors have no effect");
    // Which bounds are exceeded, not by how much: that is a figure of this machine.
    let words = |page: &str| page.replace(|c: char| c.is_ascii_digit(), "");
    assert!(words(&page) == words(&new), "docs/inexact.md is old: run ETALON_BLESS=1 ./x test --test devices");
}

/// Compilers of GPUs fuse products and sums where the source does not forbid it, and their sines and arc tangents are
/// coarse: every bound holds.
#[test]
fn contraction_and_coarse_angles_break_no_bound() {
    let folder = tempfile::tempdir().expect("a folder");
    let fault = r#"{ "contracts": true, "inexact": { "angle": 4096 } }"#;
    with_fault(folder.path(), fault, &["verify", "--cases", "10000"]).succeeded();
    // What the passport finds on that device: it fuses all but what is `precise`.
    let arguments = ["passport", "--only", "arithmetic", "-o", "card.json"];
    with_fault(folder.path(), r#"{ "contracts": true }"#, &arguments).succeeded();
    let card = std::fs::read_to_string(folder.path().join("card.json")).expect("a passport");
    let card: serde_json::Value = serde_json::from_str(&card).expect("JSON");
    let shares = ["fused", "precise_fused", "fma_fused"].map(|share| card["arithmetic"][share].as_f64());
    assert_eq!(shares, [Some(1.0), Some(0.0), Some(1.0)]);
}

/// Quotients, roots and products that are off change no decision that is seen: once 60/60 < 1 repeated a texture a
/// texel too late, (1 − F₀)/(1 − F₀) < 1 missed total internal reflection, and one minus a mean of ones that was fused
/// was no 0, so that open surfaces had light from any side (mean FLIP 0.031, 0.0018 and 0.0034).
#[test]
fn inexact_arithmetic_is_not_seen() {
    let folder = tempfile::tempdir().expect("a folder");
    let pictures = [
        ["study:nested", "recursive", "160x90"],
        ["study:blend", "global", "160x90"],
        ["study:materials", "recursive", "64x36"],
    ];
    for [scene, model, size] in pictures {
        let render = |to: &'static str| ["render", scene, "--model", model, "--size", size, "-o", to];
        etalon(folder.path(), &render("exact.png"), &HASTY).succeeded();
        let moved = |sign: &str| {
            format!(
                "\"inexact\": {{ \"division\": {sign}2, \"root\": {sign}3, \"power\": {sign}2, \"angle\": {sign}4096 }}"
            )
        };
        for fault in [moved(""), moved("-"), "\"contracts\": true".to_owned()] {
            with_fault(folder.path(), &format!("{{ {fault} }}"), &render("inexact.png")).succeeded();
            let arguments = ["diff", "--metric", "flip", "exact.png", "inexact.png"];
            let diff = etalon(folder.path(), &arguments, &[]).succeeded();
            assert_all_finite(&diff, &fault);
            let flip: f64 = diff.stdout.trim().trim_start_matches("flip ").parse().expect("a number");
            assert!(flip < 1e-3, "{scene}, {fault}: {flip}");
        }
    }
}

/// Memory that is full of NaN, workgroups in the reverse order, and lavapipe's narrower vectors with other subgroups:
/// what is read was written, and no sum depends on who came first or is beside whom.
#[test]
fn neither_old_memory_nor_order_nor_the_width_of_vectors_is_seen() {
    let folder = tempfile::tempdir().expect("a folder");
    for [scene, model] in [["study:blend", "local"], ["study:pool", "recursive"], ["study:cornell", "global"]] {
        let render = |to: &'static str| ["render", scene, "--model", model, "--size", "48x27", "-o", to];
        etalon(folder.path(), &render("usual.exr"), &HASTY).succeeded();
        let same = |what: &str| {
            assert_same_radiance(folder.path(), ["usual.exr", "other.exr"], &format!("{scene}, {model}: {what}"));
        };
        with_fault(folder.path(), "{ \"dirty_memory\": true }", &render("other.exr")).succeeded();
        same("dirty memory");
        with_fault(folder.path(), "{ \"reverses\": true }", &render("other.exr")).succeeded();
        same("workgroups in the reverse order");
        // Mesa's cache does not tell code for wide vectors from code for narrow ones.
        let narrow = [("LP_NATIVE_VECTOR_WIDTH", "128"), ("MESA_SHADER_CACHE_DISABLE", "true")];
        let narrow: Vec<_> = HASTY.into_iter().chain(narrow).collect();
        etalon(folder.path(), &render("other.exr"), &narrow).succeeded();
        same("vectors of four");
    }
}
