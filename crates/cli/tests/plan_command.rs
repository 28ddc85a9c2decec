//! `etalon plan` says beforehand what `etalon render` then does: the same effects with the same reasons, the same
//! passes in the same order, the same pipelines with the same constants, and no buffer or image that does not come to
//! be.

#[path = "support/program.rs"]
mod program;

use program::{HASTY, etalon};
use serde_json::Value;

const COMMON: [&str; 4] = ["--size", "48x27", "--device", "cpu"];

fn planned(folder: &std::path::Path, arguments: &[&str]) -> (Value, String) {
    let all = [&["plan"], arguments, &COMMON, &["--json"]].concat();
    let text = etalon(folder, &all, &HASTY).succeeded().stdout;
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
        etalon(at, &render, &HASTY).succeeded();
        let report = std::fs::read(at.join("report.json")).expect("a report");
        let report: Value = serde_json::from_slice(&report).expect("JSON");
        for part in ["schema", "samples", "passes", "pipelines", "unread"] {
            assert_eq!(plan[part], report["plan"][part], "{arguments:?}: {part}");
        }
        // Pixels are counted where nothing is drawn.
        let mut effects = plan["effects"].clone();
        for effect in effects.as_array_mut().expect("a list") {
            effect["evidence"].as_object_mut().expect("an object").remove("pixels");
        }
        assert_eq!(effects, report["plan"]["effects"], "{arguments:?}");
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
    let text = etalon(folder.path(), &all, &HASTY).succeeded().stdout;
    for said in ["refraction", "has transmission 1", "effects are not needed", "reflection and refraction", "MB"] {
        assert!(text.contains(said), "\"{said}\" is not in {text}");
    }
    assert!(text.contains("warning: quadrature=left changes nothing"), "{text}");
    // What the scene does not need, and the programs, are asked for.
    let asked = ["clear coat", "interact "];
    assert!(asked.iter().all(|said| !text.contains(said)), "{text}");
    let whole = etalon(folder.path(), &[&all[..], &["-v"]].concat(), &HASTY).succeeded().stdout;
    assert!(asked.iter().all(|said| whole.contains(said)) && whole.contains("not loaded: "), "{whole}");
    assert!(!folder.path().join("pool.png").exists());
}

/// Evidence from a camera: pixels of what calls for an effect, and surfaces on the lines of sight.
#[test]
fn a_plan_knows_what_the_camera_sees() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let plan = planned(at, &["study:nested"]).0;
    let effect = |plan: &Value, name: &str| {
        let all = plan["effects"].as_array().expect("a list");
        all.iter().find(|effect| effect["name"] == name).expect("an effect").clone()
    };
    let pixels = |plan: &Value, name: &str| {
        let pixels = effect(plan, name)["evidence"]["pixels"].as_str().expect("pixels").to_owned();
        pixels.parse::<u64>().expect("a number")
    };
    let glass = pixels(&plan, "refraction");
    assert!(glass > 100 && glass < 48 * 27, "{glass}");
    assert!(effect(&plan, "refraction")["reason"].as_str().expect("a reason").ends_with("closed mesh"), "{plan}");
    let expected = &plan["expected"];
    let most = expected["interfaces"].as_u64().expect("a number");
    assert!(most > 8, "{most}");
    assert_eq!(expected["ray_rounds"], 8);
    let lost = |rung: &str| expected["lost"][rung].as_f64().expect("a share");
    assert!(lost("1") > lost("4") && lost("4") > 0.5 && lost("32") == 0.0, "{expected}");
    let warned = |plan: &Value, said: &str| {
        plan["warnings"].as_array().expect("a list").iter().any(|w| w.as_str().is_some_and(|w| w.contains(said)))
    };
    assert!(warned(&plan, &format!("up to {most} transparent surfaces: interfaces=8 loses up to")), "{plan}");
    let enough = planned(at, &["study:nested", "--set", "interfaces=16"]).0;
    assert!(!warned(&enough, "transparent surfaces") && enough["expected"]["ray_rounds"] == most);
    // From behind, nothing of it is seen.
    let away = ["study:nested", "--eye", "0,50,0", "--target", "0,100,0", "--up", "1,0,0"];
    assert_eq!(pixels(&planned(at, &away).0, "refraction"), 0);
}

#[test]
fn what_is_left_out_has_a_price() {
    let folder = tempfile::tempdir().expect("a folder");
    let plan = planned(folder.path(), &["study:radiance", "--set", "shadows=off", "--plan", "explain-cost"]).0;
    let costs = plan["costs"].as_array().expect("a list");
    let of = |name: &str| costs.iter().find(|cost| cost["effect"] == name).expect("a price");
    // What changes nothing alone has no price.
    let effects = plan["effects"].as_array().expect("a list").iter();
    let priced = |name: &Value| costs.iter().any(|cost| cost["effect"] == *name);
    let without: Vec<_> = effects
        .filter(|effect| effect["state"] != "used" && !priced(&effect["name"]))
        .map(|e| e["name"].clone())
        .collect();
    let mut alone = vec!["heterogeneous media", "quadrature", "prefiltered environment"];
    alone.extend(["emissive surfaces as lights", "analytic area lights", "light hierarchy", "path guiding"]);
    alone.extend(["caustics of punctual lights", "dispersion", "denoising"]);
    assert_eq!(without, alone);
    assert!(of("material layers")["bytes"].as_i64() > Some(48 * 27 * 8), "{costs:?}");
    assert!(of("order-independent transparency")["pipelines"].as_i64() > Some(1), "{costs:?}");
    assert!(of("reflection")["spirv_bytes"].as_i64() > Some(10_000), "{costs:?}");
    assert!(costs.iter().all(|cost| cost["frame_ms"].is_f64()), "{costs:?}");
    let by = |cost: &Value| {
        ["path tracing", "spectral rendering"].iter().any(|name| cost["effect"] == *name) || cost["by"] == "forced on"
    };
    assert!(costs.iter().all(by), "{costs:?}");
    assert_eq!(of("path tracing")["by"], "shadows=ray, reflection=ray, refraction=ray, indirect=path");
    let lean = planned(folder.path(), &["study:radiance"]).0;
    assert!(lean.get("costs").is_none());
    // What a knob drops is planned with another rung.
    let arguments = ["study:metals", "--set", "shadows=off", "--plan", "explain-cost"];
    let plan = planned(folder.path(), &arguments).0;
    let shadows = plan["costs"].as_array().expect("a list").iter().find(|cost| cost["effect"] == "shadows");
    assert_eq!(shadows.expect("a price")["by"], "shadows=ray");
}

#[test]
fn everything_can_be_planned() {
    let folder = tempfile::tempdir().expect("a folder");
    let plan = |extent: &str| planned(folder.path(), &["study:radiance", "--plan", extent]).0;
    let (lean, full) = (plan("scene"), plan("full"));
    let count = |plan: &Value, state: &str| {
        plan["effects"].as_array().expect("a list").iter().filter(|effect| effect["state"] == state).count()
    };
    assert!(count(&lean, "not needed") > 10);
    // Bodies that touch are another picture, and so are dispersion and a denoised one. Light samples, by a hierarchy or
    // not, have other roundings.
    assert_eq!(count(&full, "not needed"), 6);
    let reasons = full["effects"].to_string();
    assert!(reasons.contains("asked for, although no visible material uses it"), "{reasons}");
    assert!(full["pipelines"].as_array().expect("a list").len() > lean["pipelines"].as_array().expect("a list").len());
}

#[test]
fn what_cannot_be_planned_is_an_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let failed = |arguments: &[&str], code, said| {
        etalon(folder.path(), &[&["plan"], arguments].concat(), &[]).failed(code, said);
    };
    failed(&["missing.glb"], 1, "missing.glb");
    failed(&["study:etalon", "--set", "gloss=1"], 2, "no knob is called \"gloss\"");
    failed(&["study:etalon", "--camera", "nobody"], 2, "nobody");
    failed(&["study:etalon", "--set", "interfaces=0"], 2, "interfaces=0 contradicts refraction=ray");
    failed(&["study:etalon", "--set", "samples=5"], 2, "the nearest is 4");
}

#[test]
fn what_a_scene_calls_for_needs_no_device() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let none = [("VK_DRIVER_FILES", "/nonexistent.json"), ("VK_ICD_FILENAMES", "/nonexistent.json")];
    for scene in ["study:etalon", "study:pool", "study:haze", "study:cornell", "study:nested"] {
        let size = ["--size", "48x27", "--json"];
        let text = etalon(at, &[&["plan", scene], &size[..]].concat(), &none).succeeded().stdout;
        let without: Value = serde_json::from_str(&text).expect("JSON");
        let mut with = planned(at, &[scene]).0;
        for effect in with["effects"].as_array_mut().expect("a list") {
            effect["evidence"].as_object_mut().expect("an object").remove("pixels");
        }
        for part in ["schema", "effects", "samples", "unread"] {
            assert_eq!(without[part], with[part], "{scene}: {part}");
        }
        let warnings = without["warnings"].as_array().expect("a list");
        let told = |warning: &&Value| warning.as_str().is_some_and(|text| text.contains("Vulkan"));
        assert_eq!(warnings.iter().filter(told).count(), 1, "{scene}: {warnings:?}");
        let others: Vec<&Value> = warnings.iter().filter(|warning| !told(warning)).collect();
        assert_eq!(others, with["warnings"].as_array().expect("a list").iter().collect::<Vec<_>>(), "{scene}");
        assert!(without["pipelines"].as_array().is_some_and(Vec::is_empty), "{scene}");
    }
    // Where a device is asked for by name, a plan without it is none.
    etalon(at, &["plan", "study:cornell", "--device", "cpu"], &none).failed(1, "Vulkan");
}
