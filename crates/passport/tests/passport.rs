//! A passport of the device here, and what is read of one that was mailed.

use etalon_passport::{Passport, SCHEMA, Scope, Section, measure};
use etalon_testing::gpu::{Gpu, choice};

fn small() -> Scope {
    Scope {
        inputs: 1 << 12,
        cases: 300,
        scenes: vec!["study:cornell".to_owned()],
        size: [32, 18],
        bytes: 1 << 20,
        dispatch_ms: 10.0,
        ..Scope::default()
    }
}

#[test]
fn the_device_here_keeps_what_etalon_relies_on() {
    let gpu = Gpu::open();
    let mut told = Vec::new();
    let mut tell = |step: &str| told.push(step.to_owned());
    let passport = measure(&gpu.device, &choice(), &small(), &mut tell).expect("a passport");
    let broken: Vec<_> = passport.promises.iter().filter(|promise| !promise.held).collect();
    assert!(broken.is_empty() && passport.promises.len() > 20, "{broken:?}");
    assert!(told.iter().any(|step| step == "study:cornell, global"), "{told:?}");
    let of = passport.arithmetic.as_ref().expect("arithmetic");
    // Correctly rounded, and measured as that.
    let sum = of.builtins.iter().find(|errors| errors.name == "a + b").expect("sums");
    assert!(sum.max_ulp <= 0.5 && sum.max_ulp > 0.49, "{sum:?}");
    // `precise` products are never fused anywhere.
    assert_eq!((of.precise_fused, of.half_rounds.as_str()), (0.0, "nearest"));
    // lavapipe interpolates floats by floats; the eight bits of GPUs give 257 weights.
    assert_eq!(of.filter_weights, Some(if gpu.device.is_software() { 1 << 16 } else { 257 }));
    let pictures = passport.pictures.as_ref().expect("pictures");
    assert_eq!((pictures.scenes.len(), pictures.ways.len(), pictures.scenes[0].small.len()), (3, 7, 32));
    let speed = passport.speed.as_ref().expect("speeds");
    assert!(speed.copy > 0.0 && speed.rays.len() == 3 && !speed.lost, "{speed:?}");
    // What is written is what is read.
    let text = passport.to_json().expect("JSON");
    let read = Passport::read(&text).expect("a passport");
    let verdicts = |of: &Passport| of.promises.iter().map(|p| (p.promise.clone(), p.held)).collect::<Vec<_>>();
    assert_eq!((verdicts(&read), &read.capabilities), (verdicts(&passport), &passport.capabilities));
    assert_eq!(read.pictures.map(|of| of.scenes[2].hash.clone()), Some(pictures.scenes[2].hash.clone()));
    assert!(text.lines().count() > 60 && text.len() < 300_000, "{} lines", text.lines().count());
    assert_eq!(gpu.errors(), Vec::<String>::new());
}

#[test]
fn only_what_is_asked_for_is_measured() {
    let gpu = Gpu::open();
    let scope = Scope { sections: vec![Section::Arithmetic], ..small() };
    let passport = measure(&gpu.device, &choice(), &scope, &mut |_| ()).expect("a passport");
    assert!(passport.arithmetic.is_some() && passport.equations.is_none());
    assert!(passport.pictures.is_none() && passport.speed.is_none());
}

/// Passports of other devices, as they were mailed.
fn mailed() -> Vec<(String, String)> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("passports");
    let files = std::fs::read_dir(folder).expect("a folder").map(|file| file.expect("a file").path());
    files.map(|path| (path.display().to_string(), std::fs::read_to_string(path).expect("a file"))).collect()
}

#[test]
fn mailed_passports_are_in_order() {
    let all = mailed();
    assert!(all.len() >= 4, "{}", all.len());
    for (name, text) in all {
        Passport::read(&text).unwrap_or_else(|error| panic!("{name}: {error:#}"));
    }
}

#[test]
fn what_was_changed_is_refused() {
    let (_, text) = mailed().into_iter().find(|(name, _)| name.contains("swiftshader")).expect("SwiftShader's");
    let refused = |change: &dyn Fn(&mut serde_json::Value), said: &str| {
        let mut value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        change(&mut value);
        let error = Passport::read(&value.to_string()).expect_err(said);
        assert!(format!("{error:#}").contains(said), "{error:#}");
    };
    let promises = |value: &serde_json::Value| value["promises"].as_array().expect("a list").clone();
    // A broken promise that is said to be held.
    refused(
        &|value| {
            let broken = promises(value).iter().position(|promise| promise["held"] == false).expect("one is broken");
            value["promises"][broken]["held"] = true.into();
        },
        "the file says otherwise",
    );
    refused(&|value| drop(value["promises"].as_array_mut().expect("a list").pop()), "the file says otherwise");
    refused(
        &|value| {
            let more = promises(value)[0].clone();
            value["promises"].as_array_mut().expect("a list").push(more);
        },
        "without a measurement",
    );
    // An error that is smaller than its verdict says.
    refused(&|value| value["arithmetic"]["builtins"][0]["of_allowed"] = 7.0.into(), "is broken, 7.000");
    // Figures that are not what is said of them, and parts without figures.
    refused(&|value| value["equations"][0]["of_bound"] = 50.0.into(), "is 50 of its bound");
    refused(&|value| value["equations"][0]["held"] = false.into(), "of its bound; the file says otherwise");
    refused(&|value| value["pictures"]["ways"][0]["largest"] = 0.5.into(), "differs by 5.0e-1");
    for [part, list] in [["arithmetic", "builtins"], ["pictures", "scenes"], ["pictures", "ways"]] {
        refused(&|value| value[part][list] = serde_json::json!([]), "a list of measurements is empty");
    }
    refused(&|value| value["equations"] = serde_json::json!([]), "a list of measurements is empty");
    refused(&|value| value["schema"] = "etalon.passport/9".into(), SCHEMA);
    refused(&|value| value["more"] = 1.into(), "unknown field");
    refused(&|value| value["capabilities"]["limits"] = "many".into(), "invalid type");
    assert!(Passport::read("{").is_err() && Passport::read("").is_err());
}

#[test]
fn only_what_is_missing_cannot_be_measured() {
    let (_, text) = mailed().into_iter().find(|(name, _)| name.contains("swiftshader")).expect("SwiftShader's");
    // A file without speeds, and what it says instead of them.
    let read = |said: &[(&str, bool)]| {
        let mut value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        value["speed"] = serde_json::Value::Null;
        let promises = value["promises"].as_array_mut().expect("a list");
        promises.retain(|promise| promise["promise"] != "long dispatches end");
        let promise = |&(part, held): &(&str, bool)| serde_json::json!({ "promise": format!("can be measured: {part}"), "held": held, "figure": "" });
        promises.extend(said.iter().map(promise));
        Passport::read(&value.to_string())
    };
    assert!(read(&[]).is_ok() && read(&[("speed", false)]).is_ok());
    let refused: [&[(&str, bool)]; 4] =
        [&[("speed", true)], &[("pictures", false)], &[("luck", false)], &[("speed", false), ("speed", false)]];
    for said in refused {
        let error = read(said).expect_err("a promise of nothing");
        assert!(format!("{error:#}").contains("no broken promise of a part that is missing"), "{said:?}: {error:#}");
    }
}
