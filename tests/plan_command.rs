//! `etalon plan` says beforehand what `etalon render` then does: the same effects with the same reasons, the same passes in
//! the same order, the same pipelines with the same constants, and no buffer or image that does not come to be.

#[path = "support/program.rs"]
mod program;

use program::etalon;
use serde_json::Value;

const COMMON: [&str; 4] = ["--size", "48x27", "--device", "cpu"];

fn planned(folder: &std::path::Path, arguments: &[&str]) -> (Value, String) {
    let all = [&["plan"], arguments, &COMMON, &["--json"]].concat();
    let text = etalon(folder, &all, &[]).succeeded().stdout;
    (serde_json::from_str(&text).expect("JSON"), text)
}

#[test]
fn a_plan_is_what_is_then_done() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    // Once for the cache of prefiltered environments: what lies there takes no pipeline.
    let first = planned(at, &["study:etalon"]).0;
    let has = |plan: &Value, name| plan["pipelines"].as_array().expect("a list").iter().any(|p| p["name"] == name);
    assert!(has(&first, "prefilter") && !has(&planned(at, &["study:etalon"]).0, "prefilter"));
    for arguments in [
        &["study:etalon", "--set", "samples=1"][..],
        &["study:etalon", "--model", "local"],
        &["study:materials", "--set", "lobes=1", "--set", "brdf=ggx-multi"],
        &["study:materials", "--set", "reflection=screen"],
        &["study:blend", "--set", "samples=1"],
        &["study:lamps", "--set", "shadows=map"],
        &["study:haze", "--set", "absorption=march:4", "--set", "samples=1"],
    ] {
        let (plan, text) = planned(at, arguments);
        let render = [&["render"], arguments, &COMMON, &["-o", "out.png", "--report", "report.json"]].concat();
        etalon(at, &render, &[]).succeeded();
        let report = std::fs::read(at.join("report.json")).expect("a report");
        let report: Value = serde_json::from_slice(&report).expect("JSON");
        for part in ["schema", "effects", "samples", "passes", "pipelines"] {
            assert_eq!(plan[part], report["plan"][part], "{arguments:?}: {part}");
        }
        let buffers = |of: &Value| of["buffers"].as_array().cloned().expect("a list");
        let (before, after) = (buffers(&plan), buffers(&report["plan"]));
        assert!(before.len() > 10, "{arguments:?}");
        for made in before {
            assert!(after.contains(&made), "{arguments:?}: {made}");
        }
        assert_eq!(planned(at, arguments).1, text, "{arguments:?}: a second time the same");
    }
}

#[test]
fn a_plan_can_be_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let all = [&["plan", "study:pool", "--set", "quadrature=left"][..], &COMMON].concat();
    let text = etalon(folder.path(), &all, &[]).succeeded().stdout;
    for said in ["refraction", "has transmission 1", "not called for", "reflection and refraction", "interact", "MB"] {
        assert!(text.contains(said), "\"{said}\" is not in {text}");
    }
    assert!(text.contains("warning: quadrature=left changes nothing"), "{text}");
    assert!(!folder.path().join("pool.png").exists());
}

#[test]
fn what_cannot_be_planned_is_an_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let failed = |arguments: &[&str], said| {
        etalon(folder.path(), &[&["plan"], arguments].concat(), &[]).failed(1, said);
    };
    failed(&["missing.glb"], "missing.glb");
    failed(&["study:etalon", "--set", "gloss=1"], "no knob is called \"gloss\"");
    failed(&["study:etalon", "--camera", "nobody"], "nobody");
}
