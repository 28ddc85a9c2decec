//! `etalon cost`: a run is whole or goes on, its figures are those that its commands give, and its parts make the
//! whole.

#[path = "support/program.rs"]
mod program;

use std::path::Path;

use etalon::image::png::decode_png_with;
use program::{HASTY, etalon};
use serde_json::Value;

const COMMON: [&str; 8] = ["--size", "40x24", "--device", "cpu", "--reference-samples", "16", "--budget", "20"];

fn run(at: &Path, scene: &str, folder: &str, more: &[&str]) -> Value {
    let all = [&["cost", scene, "-o", folder], &COMMON[..], more].concat();
    etalon(at, &all, &HASTY).succeeded();
    let text = std::fs::read(at.join(folder).join("cost.json")).expect("cost.json");
    serde_json::from_slice(&text).expect("JSON")
}

fn list<'a>(table: &'a Value, name: &str) -> &'a Vec<Value> {
    table[name].as_array().expect("a list")
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

fn named<'a>(table: &'a Value, name: &str) -> &'a Value {
    list(table, "points").iter().find(|point| point["name"] == name).unwrap_or_else(|| panic!("no point {name}"))
}

#[test]
fn a_run_is_what_its_commands_draw() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let table = run(at, "study:lamps", "a", &[]);
    assert_eq!(table["schema"], "etalon.cost/1");
    let points = list(&table, "points");
    let frontier: Vec<&Value> =
        list(&table, "frontier").iter().map(|i| &points[i.as_u64().expect("an index") as usize]).collect();
    assert!(frontier.len() >= 2);
    let (time, error) = (|p: &Value| number(&p["gpu_ms"]["median"]), |p: &Value| number(&p["error"]["median"]));
    for pair in frontier[..frontier.len() - 1].windows(2) {
        assert!(time(pair[0]) <= time(pair[1]) && error(pair[0]) > error(pair[1]));
    }
    assert_eq!(frontier[frontier.len() - 1]["name"], "reference");
    // Each point of the line has less error than all that is quicker, or so little less that noise hides it.
    for point in points.iter().filter(|point| point["name"] != "reference") {
        let overlaps = |known: &Value| number(&known["error"]["low"]) <= number(&point["error"]["high"]);
        let better = |known: &&&Value| time(known) <= 1.02 * time(point) && overlaps(known);
        // Of what is nearer to the reference than its own noise nothing is said.
        let reference = frontier[frontier.len() - 1];
        let is_hidden = number(&point["error"]["low"]) <= error(reference);
        assert!(
            is_hidden || time(point) >= time(reference) || frontier.iter().any(|known| better(&known)),
            "{point} {reference}"
        );
    }
    let recommended = list(&table, "recommended");
    assert!(recommended.iter().map(|r| &r["setting"]).eq(["quick", "balanced", "exact"]), "{recommended:?}");
    // They are presets or found by the search; none of them has more error than a quicker one.
    let of = |r: &Value| &points[r["point"].as_u64().expect("a place") as usize];
    assert!(recommended.iter().map(of).all(|p| p["name"] == "reference" || p["family"] != "local"), "{recommended:?}");
    // The reference's own figure is what its noise hides: after 16 samples more than the errors of settings before it.
    let errors: Vec<f64> = recommended.iter().map(of).filter(|p| p["name"] != "reference").map(error).collect();
    assert!(errors.is_sorted_by(|quicker, slower| quicker >= slower), "{errors:?}");

    // The error is that of the pictures as they are shown, less the reference's noise.
    for name in ["local", "recursive"] {
        let picture = format!("a/pictures/{name}.png");
        let diff = ["diff", "a/pictures/reference.png", &picture, "--metric", "rmse", "--json"];
        let said: Value = serde_json::from_str(&etalon(at, &diff, &[]).succeeded().stdout).expect("JSON");
        let (with_noise, found) = (number(&said["value"]), &named(&table, name)["error"]);
        assert!(number(&found["median"]) < with_noise && with_noise < number(&found["high"]) + 0.05, "{said} {found}");
    }

    // What is printed beside a picture draws it, and the reference has an error of its own.
    assert!(number(&table["reference"]["own_error"]) > 0.0);
    for name in ["reference", "local", "local shadows=ray", "exact fresnel=schlick", "search: quickest"] {
        let point = named(&table, name);
        let command = point["command"].as_str().expect("a command");
        let words: Vec<&str> = command.split(' ').skip(1).collect();
        let said = [&words[..], &["--report", "r.json"]].concat();
        etalon(at, &said, &HASTY).succeeded();
        let report: Value = serde_json::from_slice(&std::fs::read(at.join("r.json")).expect("a report")).expect("JSON");
        assert_eq!(report["outputs"][0]["hash"], point["image"], "{command}");
        for (knob, rung) in point["knobs"].as_object().expect("knobs") {
            assert_eq!(report["knobs"][knob], *rung, "{name}: {knob}");
        }
    }

    // Every figure of the page is in it, and nothing is loaded from anywhere.
    let page = std::fs::read_to_string(at.join("a/report.html")).expect("a page");
    assert!(page.contains("--reference-samples 16 -o FOLDER") && !page.contains("20 s budget"));
    assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>"));
    assert!(!page.contains("http://") && !page.contains("https://") && !page.contains("<link"), "loads something");
    for point in points {
        let name = point["name"].as_str().expect("a name");
        let picture = format!("data-name=\"{}\"", point["picture"].as_str().expect("a name"));
        assert!(page.contains(&picture) || name == "reference", "{name}");
    }
    // The cards describe what each setting loses. `light-sampler` changes only noise, and no card of a picture without
    // paths lists it.
    let settings = page.split("id=\"trust\"").next().expect("a beginning");
    let mostly = ["that error comes from", "adds the most error", "No setting can be recommended"];
    let says_most = mostly.iter().any(|says| settings.contains(says));
    assert!(settings.contains("you lose") && says_most, "{settings:.2000}");
    assert!(!settings.contains("<b>light-sampler="), "{settings:.2000}");
    // The heading of the cards says what the first sentence says.
    let [none, undecided] =
        ["No setting can be recommended", "none of them recommended"].map(|says| settings.contains(says));
    assert_eq!(none, undecided, "{settings:.2000}");
    let csv = std::fs::read_to_string(at.join("a/cost.csv")).expect("cost.csv");
    assert_eq!(csv.lines().count(), points.len() + 1);

    // A knob that the scene does not call for is reported and not priced.
    let knob = |name: &str| list(&table, "knobs").iter().find(|k| k["knob"] == name).expect("a knob");
    assert_eq!(
        (&knob("refraction")["called_for"], &knob("shadows")["called_for"]),
        (&Value::Bool(false), &Value::Bool(true))
    );
    assert!(list(&table, "prices").iter().all(|price| price["knob"] != "refraction"));

    // The table serves budgets of the same picture; nothing is measured again.
    let render = |more: &[&str]| {
        let all = [
            &["render", "study:lamps", "--size", "40x24", "--device", "cpu", "-o", "w.png", "--report", "w.json"],
            more,
        ];
        etalon(at, &all.concat(), &HASTY)
    };
    let budget = |more: &[&str]| -> Value {
        let run = render(more).succeeded();
        assert!(!run.stderr.contains("has not been measured") && run.stderr.contains("simplified"), "{run:?}");
        let report = std::fs::read(at.join("w.json")).expect("a report");
        serde_json::from_slice::<Value>(&report).expect("JSON")["budget"].clone()
    };
    let drawn = || points.iter().filter(|point| point["name"] != "reference");
    let chosen = budget(&["--within", "1000000"]);
    let least = drawn().map(error).fold(f64::INFINITY, f64::min);
    assert_eq!(number(&chosen["error"]["median"]), least);
    let chosen = budget(&["--max-error", "100%"]);
    let quickest = drawn().map(time).fold(f64::INFINITY, f64::min);
    assert_eq!(number(&chosen["gpu_ms"]["median"]), quickest);
    // The picture is the one that was measured.
    assert!((number(&chosen["found_error"]["median"]) - number(&chosen["error"]["median"])).abs() < 1e-9, "{chosen}");
    // What cannot be kept is answered with what comes nearest.
    for (limit, said) in [
        (["--within", "0.0001"], "--within 0.0001: the picture took"),
        (["--max-error", "0.0000001"], "the picture's error is"),
    ] {
        std::fs::remove_file(at.join("w.png")).expect("a picture");
        let run = render(&limit);
        assert!(run.code == Some(1) && run.stderr.contains(said) && at.join("w.png").exists(), "{limit:?} {run:?}");
    }
    render(&["--within", "8", "--set", "samples=1"]).failed(2, "contradicts --model and --set");
    render(&["--within", "8", "--max-error", "2%"]).failed(2, "contradicts --max-error");
    render(&["--within", "soon"]).failed(2, "expected milliseconds");

    // Without cost.json a folder is that of a run that was interrupted: what it has is not drawn again.
    for file in ["cost.json", "points/local-shadows-ray.json", "points/exact-fresnel-schlick.json"] {
        std::fs::remove_file(at.join("a").join(file)).expect("a file");
    }
    let record = at.join("a/points/recursive.json");
    let before = std::fs::read(&record).expect("a record");
    // A picture of another program is judged like one of ours.
    std::fs::copy(at.join("a/pictures/local.png"), at.join("other.png")).expect("a copy");
    let again = run(at, "study:lamps", "a", &["--judge", "other.png"]);
    let other = &list(&again, "others")[0];
    assert_eq!((&other["file"], &other["error"]), (&Value::from("other.png"), &named(&again, "local")["error"]));
    assert_eq!(std::fs::read(&record).expect("a record"), before);
    for point in points {
        let name = point["name"].as_str().expect("a name");
        // What the search finds depends on times.
        if !name.starts_with("search") {
            assert_eq!(named(&again, name)["image"], point["image"], "{name}");
        }
    }
    let other = etalon(at, &[&["cost", "study:radiance", "-o", "a"], &COMMON[..]].concat(), &HASTY);
    other.failed(1, "holds another run");
    // A table of fewer pictures does not replace the one that is kept.
    let few = ["--size", "40x24", "--device", "cpu", "--budget", "3", "-o", "few"];
    etalon(at, &[&["cost", "study:lamps"], &few[..]].concat(), &HASTY).succeeded();
    assert_eq!(number(&budget(&["--within", "1000000"])["error"]["median"]), least);

    // Two tables side by side: of one device everything is the same.
    let said = etalon(at, &["cost", "--beside", "a", "a", "--json"], &[]).succeeded().stdout;
    let rows: Value = serde_json::from_str(&said).expect("JSON");
    let rows = rows.as_array().expect("a list");
    assert_eq!(rows.len(), list(&again, "points").len());
    assert!(rows.iter().all(|row| row["same_work"] == true && row["gpu_ms"][0] == row["gpu_ms"][1]));
    let said = etalon(at, &["cost", "--beside", "a", "a"], &[]).succeeded().stdout;
    assert!(said.contains("local shadows=ray") && said.contains("same"), "{said}");
}

#[test]
fn parts_make_the_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let parts = [
        run(at, "study:golden-bridge", "p1", &["--shard", "1/2", "--exposure", "1.5"]),
        run(at, "study:golden-bridge", "p2", &["--shard", "2/2", "--exposure", "1.5"]),
    ];
    etalon(at, &["cost", "--merge", "p1", "p2", "-o", "all"], &[]).succeeded();
    let table: Value =
        serde_json::from_slice(&std::fs::read(at.join("all/cost.json")).expect("cost.json")).expect("JSON");
    let count = |table: &Value| list(table, "prices").len();
    assert_eq!(count(&table), count(&parts[0]) + count(&parts[1]));
    assert!(count(&parts[0]).abs_diff(count(&parts[1])) <= 3);
    named(&table, "recursive");
    // They are judged as the parts show them: what a part says of its pictures holds for the whole.
    for point in parts.iter().flat_map(|part| list(part, "points")) {
        let name = point["name"].as_str().expect("a name");
        assert_eq!(named(&table, name)["error"], point["error"], "{name}");
    }
    assert!(at.join("all/report.html").exists());
    etalon(at, &["cost", "--merge", "p1", "p2", "-o", "b", "--exposure", "2"], &[]).failed(2, "cannot be used with");
    etalon(at, &["cost", "--merge", "p1", "all/pictures", "-o", "b"], &[]).failed(1, "cost.json");
    etalon(at, &["cost", "--merge", "p2", "-o", "b"], &[]).failed(1, "part 1/2 is missing");
    etalon(at, &["cost", "--merge", "p1", "p1", "-o", "b"], &[]).failed(1, "part 1/2 is given twice");
    assert!(!at.join("b/cost.json").exists());
}

#[test]
fn a_scene_that_calls_for_nothing_has_a_report() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    std::fs::write(at.join("t.mtl"), "newmtl m\nKd 0 0 0\nKe 0.5 0.5 0.5\nillum 0\n").expect("a file");
    std::fs::write(at.join("t.obj"), "mtllib t.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").expect("a file");
    let table = run(at, "t.obj", "a", &["--env", "none"]);
    // Few samples differ at edges: from many, and without paths from those of paths.
    let nothing = |price: &Value| match price["knob"].as_str() {
        Some("samples") => true,
        Some("indirect") => price["error_told"] == false,
        _ => number(&price["flip_between"]) < 0.002,
    };
    let prices = list(&table, "prices");
    assert!(!prices.is_empty() && prices.iter().all(nothing), "{prices:#?}");
    let called: Vec<&Value> =
        list(&table, "knobs").iter().filter(|k| k["called_for"] == true).map(|k| &k["knob"]).collect();
    assert!(!called.is_empty(), "no knob is called for");
    assert!(
        !called.iter().any(|knob| ["shadows", "refraction", "absorption", "light-sampler", "guiding", "caustics"]
            .iter()
            .any(|no| *knob == no)),
        "{called:?}"
    );
}

#[test]
fn one_approximation_has_two_lines_and_a_verdict() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let compare = |scene: &str, wanted: &str, more: &[&str]| {
        etalon(
            at,
            &[&["cost", scene, "--size", "64x36", "--device", "cpu", "--compare", wanted], more].concat(),
            &HASTY,
        )
    };
    let said = compare("study:pool", "fresnel=exact,schlick", &["--set", "samples=1"]).succeeded().stdout;
    let lines: Vec<&str> = said.lines().collect();
    assert!(
        lines.len() == 3 && lines[0].starts_with("fresnel=schlick") && lines[1].starts_with("fresnel=exact"),
        "{said}"
    );
    assert!(lines[2].contains("adds an error of"), "{said}");
    // Where only one of both traces paths, its noise is taken away as in a reference.
    let by_path = ["--model", "recursive", "--json"];
    let json = compare("study:cornell", "indirect=ambient,path", &by_path).succeeded().stdout;
    let json: Value = serde_json::from_str(&json).expect("JSON");
    let error = |end: &str| number(&json["price"]["shown_delta"][end]).sqrt();
    assert!(json["price"]["error_told"] == true && error("low") > 0.04 && error("high") < 0.1, "{json}");
    let transparent = ["--set", "samples=1", "--background", "transparent", "-o", "pair"];
    let said = compare("study:radiance", "absorption=off,path", &transparent).succeeded().stdout;
    assert!(said.contains("bit-identical"), "{said}");
    // The pictures are those that `render` writes: transparent ones have alpha.
    for (rung, words) in [("off", ["--set", "absorption=off"]), ("path", ["--set", "absorption=path"])] {
        let render = ["render", "study:radiance", "--size", "64x36", "--device", "cpu", "-o", "one.png"];
        etalon(at, &[&render, &words[..], &transparent[..4]].concat(), &HASTY).succeeded();
        let [one, pair] = ["one.png".to_owned(), format!("pair/absorption-{rung}.png")]
            .map(|name| decode_png_with(&std::fs::read(at.join(name)).expect("a picture")).expect("a PNG").0.rgba);
        assert!(one == pair && one.iter().any(|pixel| pixel[3] == 0), "{rung}");
    }
    let global = ["--model", "global", "--set", "samples=4", "--json"];
    let json: Value =
        serde_json::from_str(&compare("study:cornell", "interfaces=1,32", &global).succeeded().stdout).expect("JSON");
    assert!(number(&json["price"]["shown_delta"]["low"]) > 0.0, "{json}");
    for (wanted, expected) in [
        ("fresnel", "expected KNOB=A,B"),
        ("fresnel=exact,exact", "both are the same rung"),
        ("gloss=1,2", "no knob is called"),
    ] {
        compare("study:radiance", wanted, &[]).failed(2, expected);
    }
    compare("study:radiance", "reflection=off,ray", &["--model", "global"]).failed(2, "contradicts indirect=path");
}

#[test]
fn a_second_run_goes_on_with_the_reference_of_the_first() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let run = |name: &str| -> Value {
        let all = ["cost", "study:lamps", "-o", name, "--size", "32x18", "--device", "cpu", "--budget", "30"];
        etalon(at, &all, &HASTY).succeeded();
        let text = std::fs::read(at.join(name).join("cost.json")).expect("cost.json");
        serde_json::from_slice(&text).expect("JSON")
    };
    let [first, second] = [run("a"), run("b")];
    let of = |table: &Value| (list(&table["reference"], "rounds").clone(), number(&table["reference"]["samples"]));
    let ((rounds, samples), (more, all)) = (of(&first), of(&second));
    assert!(more.len() >= rounds.len() && more[..rounds.len()] == rounds[..] && all >= samples, "{rounds:?} {more:?}");
    let sum: f64 = more.iter().map(|round| number(&round["samples"])).sum();
    assert_eq!(sum, all);
    // Rounds share no random numbers.
    let mut seeds: Vec<u64> = more.iter().map(|round| round["seed"].as_u64().expect("a seed")).collect();
    seeds.sort_unstable();
    seeds.dedup();
    assert_eq!(seeds.len(), more.len());
    assert!(number(&second["reference"]["own_error"]) <= 1.1 * number(&first["reference"]["own_error"]));
}

#[test]
fn a_budget_that_measures_nothing_says_which_would() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let all = ["cost", "study:pool", "-o", "a", "--size", "1280x720", "--device", "cpu", "--budget", "1"];
    etalon(at, &all, &HASTY).failed(1, "is too small");
    let page = std::fs::read_to_string(at.join("a/report.html")).expect("a page");
    assert!(page.contains("Nothing was measured") && page.contains("--budget"), "{page}");
    assert!(!at.join("a/cost.json").exists());
}

#[test]
fn a_budget_without_time_for_all_pixels_measures_fewer() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let all = ["cost", "study:lamps", "-o", "a", "--size", "4096x2304", "--device", "cpu", "--budget", "30", "--json"];
    let table: Value = serde_json::from_str(&etalon(at, &all, &HASTY).succeeded().stdout).expect("JSON");
    let asked = &table["asked"];
    assert_eq!(asked["size"], serde_json::json!([4096, 2304]));
    let width = table["size"][0].as_u64().expect("a width");
    assert!((160..4096).contains(&width), "{width}");
    let (settings, recommended) = (list(asked, "settings"), list(&table, "recommended"));
    assert_eq!(settings.len(), recommended.len());
    for (at_size, setting) in settings.iter().zip(recommended) {
        let point = &list(&table, "points")[setting["point"].as_u64().expect("a place") as usize];
        let [all, few] = [&at_size["command"], &point["command"]].map(|command| command.as_str().expect("a command"));
        assert!(all.contains("--size 4096x2304"), "{all}");
        assert_eq!(all.replace("4096x2304", &format!("{width}x{}", table["size"][1])), few);
        assert!(number(&at_size["gpu_ms"]["median"]) > number(&point["gpu_ms"]["median"]), "{at_size} {point}");
    }
    assert!(
        list(&table, "warnings").iter().any(|w| w.as_str().is_some_and(|w| w.contains("too small for pictures of")))
    );
    let page = std::fs::read_to_string(at.join("a/report.html")).expect("a page");
    assert!(page.contains("at 4096×2304"), "{page}");
}

#[test]
fn what_contradicts_a_run_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    std::fs::create_dir(at.join("full")).expect("a folder");
    std::fs::write(at.join("full/note.txt"), "mine").expect("a file");
    for (arguments, code, expected) in [
        (&["-o", "a", "--set", "samples=4"][..], 2, "cost chooses the rungs itself"),
        (&["-o", "a", "--model", "global"], 2, "cost chooses the rungs itself"),
        (&["-o", "a", "--max-error", "0.1"], 2, "--max-error"),
        (&["-o", "a", "--reference-samples", "5"], 2, "expected 4, 16"),
        (&["-o", "full"], 1, "is not empty and does not hold a run of cost"),
        (&["-o", "a", "--judge", "none.png"], 1, "none.png"),
    ] {
        let all = [&["cost", "study:radiance", "--device", "cpu", "--size", "8x8"], arguments].concat();
        etalon(at, &all, &[]).failed(code, expected);
    }
    assert!(!at.join("a/cost.json").exists());
    assert_eq!(std::fs::read_to_string(at.join("full/note.txt")).expect("a file"), "mine");
}
