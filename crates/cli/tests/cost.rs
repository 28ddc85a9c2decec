//! `etalon cost`: a run is whole or goes on, its figures are those that its commands give, and its parts make the whole.

#[path = "support/program.rs"]
mod program;

use std::path::Path;

use program::{HASTY, etalon};
use serde_json::Value;

const COMMON: [&str; 6] = ["--size", "40x24", "--device", "cpu", "--reference-samples", "16"];

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
    assert!(frontier.len() >= 3);
    // Nothing is known to be better than the reference.
    let error = |p: &Value| number(&p["flip_mean"]).max(number(&table["reference"]["own_flip"]));
    for pair in frontier[..frontier.len() - 1].windows(2) {
        assert!(number(&pair[0]["gpu_ms"]["median"]) <= number(&pair[1]["gpu_ms"]["median"]));
        assert!(error(pair[0]) > error(pair[1]));
    }
    let last = frontier[frontier.len() - 1];
    assert!(frontier.iter().all(|point| error(point) >= error(last)));
    let quickest = points.iter().map(|p| number(&p["gpu_ms"]["median"])).fold(f64::INFINITY, f64::min);
    assert_eq!(number(&frontier[0]["gpu_ms"]["median"]), quickest);
    assert_eq!(frontier[frontier.len() - 1]["name"], "reference");

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
    assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>"));
    assert!(!page.contains("http://") && !page.contains("https://") && !page.contains("<link"), "loads something");
    for point in points {
        let name = point["name"].as_str().expect("a name");
        assert!(page.contains(&format!("<h3>{name}</h3>")) || name == "reference", "{name}");
    }
    let csv = std::fs::read_to_string(at.join("a/cost.csv")).expect("cost.csv");
    assert_eq!(csv.lines().count(), points.len() + 1);

    // A knob that the scene does not call for is told and not priced.
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
        assert!(!run.stderr.contains("measuring") && run.stderr.contains("given up"), "{run:?}");
        let report = std::fs::read(at.join("w.json")).expect("a report");
        serde_json::from_slice::<Value>(&report).expect("JSON")["budget"].clone()
    };
    let chosen = budget(&["--within", "1000000"]);
    let least = points.iter().map(|p| number(&p["flip_mean"])).fold(f64::INFINITY, f64::min);
    assert_eq!(number(&chosen["flip_mean"]), least);
    let chosen = budget(&["--max-error", "100%"]);
    assert_eq!((&chosen["point"], number(&chosen["gpu_ms"]["median"])), (&frontier[0]["name"], quickest));
    // The picture is the one that was measured.
    assert!((number(&chosen["found_flip"]) - number(&chosen["flip_mean"])).abs() < 1e-9, "{chosen}");
    render(&["--within", "0.0001"]).failed(1, "the nearest choice is --within");
    render(&["--max-error", "0.0000001"]).failed(1, "the nearest choice is --model global");
    render(&["--within", "8", "--set", "samples=1"]).failed(1, "contradicts --model and --set");
    render(&["--within", "8", "--max-error", "2%"]).failed(1, "contradicts --max-error");
    render(&["--within", "soon"]).failed(1, "expected milliseconds");

    // Without cost.json a folder is that of a run that was interrupted: what it has is not drawn again.
    for file in ["cost.json", "points/local-shadows-ray.json", "points/exact-fresnel-schlick.json"] {
        std::fs::remove_file(at.join("a").join(file)).expect("a file");
    }
    let record = at.join("a/points/recursive.json");
    let before = std::fs::read(&record).expect("a record");
    let again = run(at, "study:lamps", "a", &[]);
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
}

#[test]
fn parts_make_the_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let parts = [
        run(at, "study:golden-bridge", "p1", &["--shard", "1/2"]),
        run(at, "study:golden-bridge", "p2", &["--shard", "2/2"]),
    ];
    etalon(at, &["cost", "--merge", "p1", "p2", "-o", "all"], &[]).succeeded();
    let table: Value =
        serde_json::from_slice(&std::fs::read(at.join("all/cost.json")).expect("cost.json")).expect("JSON");
    let count = |table: &Value| list(table, "prices").len();
    assert_eq!(count(&table), count(&parts[0]) + count(&parts[1]));
    assert!(count(&parts[0]).abs_diff(count(&parts[1])) <= 3);
    named(&table, "recursive");
    assert!(at.join("all/report.html").exists());
    etalon(at, &["cost", "--merge", "p1", "all/pictures", "-o", "b"], &[]).failed(1, "cost.json");
    etalon(at, &["cost", "--merge", "p2", "-o", "b"], &[]).failed(1, "part 1/2 is missing");
    assert!(!at.join("b/cost.json").exists());
}

#[test]
fn a_scene_that_calls_for_nothing_is_told_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    std::fs::write(at.join("t.mtl"), "newmtl m\nKd 0 0 0\nKe 0.5 0.5 0.5\nillum 0\n").expect("a file");
    std::fs::write(at.join("t.obj"), "mtllib t.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").expect("a file");
    let table = run(at, "t.obj", "a", &["--env", "none"]);
    assert!(
        list(&table, "prices").iter().all(|price| price["knob"] == "samples" || number(&price["flip_between"]) < 0.002)
    );
    let called: Vec<&Value> =
        list(&table, "knobs").iter().filter(|k| k["called_for"] == true).map(|k| &k["knob"]).collect();
    assert!(
        !called.iter().any(|knob| ["shadows", "refraction", "absorption", "guiding"].iter().any(|no| *knob == no)),
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
    assert!(lines[2].contains("more error by"), "{said}");
    let said = compare("study:radiance", "absorption=off,path", &["--set", "samples=1"]).succeeded().stdout;
    assert!(said.contains("the same to the last bit"), "{said}");
    let global = ["--model", "global", "--set", "samples=4", "--json"];
    let json: Value =
        serde_json::from_str(&compare("study:cornell", "interfaces=1,32", &global).succeeded().stdout).expect("JSON");
    assert!(number(&json["price"]["shown_delta"]["low"]) > 0.0, "{json}");
    for (wanted, expected) in [
        ("fresnel", "expected KNOB=A,B"),
        ("fresnel=exact,exact", "both are the same rung"),
        ("gloss=1,2", "no knob is called"),
    ] {
        compare("study:radiance", wanted, &[]).failed(1, expected);
    }
    compare("study:radiance", "reflection=off,ray", &["--model", "global"]).failed(1, "contradicts indirect=path");
}

#[test]
fn what_contradicts_a_run_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    std::fs::create_dir(at.join("full")).expect("a folder");
    std::fs::write(at.join("full/note.txt"), "mine").expect("a file");
    for (arguments, expected) in [
        (&["-o", "a", "--set", "samples=4"][..], "cost chooses the rungs itself"),
        (&["-o", "a", "--model", "global"], "cost chooses the rungs itself"),
        (&["-o", "a", "--max-error", "0.1"], "--max-error"),
        (&["-o", "a", "--reference-samples", "5"], "expected 4, 16"),
        (&["-o", "full"], "is not empty and holds no run of cost"),
    ] {
        let all = [&["cost", "study:radiance", "--device", "cpu", "--size", "8x8"], arguments].concat();
        etalon(at, &all, &[]).failed(1, expected);
    }
    assert!(!at.join("a/cost.json").exists());
    assert_eq!(std::fs::read_to_string(at.join("full/note.txt")).expect("a file"), "mine");
}
