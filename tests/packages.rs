//! What the crates promise those who depend on them, read from cargo: no window and no command line below the program,
//! and the oldest compiler that a crate states is enough for all that it is built from.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use etalon_testing::document::says;
use serde_json::Value;

fn cargo(arguments: &[&str]) -> Vec<u8> {
    let output = Command::new(env!("CARGO"))
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "cargo {arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    output.stdout
}

/// Of the packages that this machine builds with: manifests of other platforms' may not be here.
fn metadata() -> Value {
    let about = Command::new("rustc").arg("-vV").output().expect("rustc runs").stdout;
    let about = String::from_utf8(about).expect("text");
    let host = about.lines().find_map(|line| line.strip_prefix("host: ")).expect("a host");
    let arguments = ["metadata", "--format-version=1", "--locked", "--offline", "--filter-platform", host];
    serde_json::from_slice(&cargo(&arguments)).expect("JSON")
}

/// Names and versions of what a crate with its default features is built from, itself among them.
fn built_from(package: &str, edges: &str) -> BTreeSet<(String, String)> {
    let tree = cargo(&["tree", "--package", package, "--edges", edges, "--prefix", "none", "--offline", "--locked"]);
    let line = |line: &str| {
        let (name, rest) = line.split_once(" v")?;
        Some((name.to_owned(), rest.split(' ').next().unwrap_or_default().to_owned()))
    };
    String::from_utf8(tree).expect("text").lines().filter_map(line).collect()
}

fn text<'v>(package: &'v Value, key: &str) -> &'v str {
    package[key].as_str().unwrap_or_default()
}

fn own(metadata: &Value) -> BTreeSet<&str> {
    metadata["workspace_members"].as_array().expect("members").iter().filter_map(Value::as_str).collect()
}

/// `1.88` as numbers; a part that is not there is 0.
fn version(text: &str) -> [u32; 3] {
    let mut parts = text.split('.').map(|part| part.parse().expect("a number"));
    std::array::from_fn(|_| parts.next().unwrap_or(0))
}

#[test]
fn dependencies_are_content_with_the_oldest_compiler_that_a_crate_states() {
    let metadata = metadata();
    let own = own(&metadata);
    let packages = metadata["packages"].as_array().expect("packages");
    let needs: BTreeMap<(&str, &str), &str> =
        packages.iter().map(|p| ((text(p, "name"), text(p, "version")), text(p, "rust_version"))).collect();
    let mut wrong = Vec::new();
    for package in packages.iter().filter(|p| own.contains(text(p, "id"))) {
        let (name, stated) = (text(package, "name"), text(package, "rust_version"));
        for (dependency, number) in built_from(name, "normal,build") {
            let needed = needs.get(&(dependency.as_str(), number.as_str())).copied().unwrap_or_default();
            if !needed.is_empty() && version(needed) > version(stated) {
                wrong.push(format!("{name} states Rust {stated}, {dependency} {number} needs {needed}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_crate_says_what_it_is() {
    let metadata = metadata();
    let own = own(&metadata);
    for package in metadata["packages"].as_array().expect("packages").iter().filter(|p| own.contains(text(p, "id"))) {
        let name = text(package, "name");
        for key in ["description", "license", "rust_version"] {
            assert!(!text(package, key).is_empty(), "{name} has no {key}");
        }
    }
}

/// Arrows from each crate to those that it uses, as a Mermaid diagram; an arrow that a path of other arrows implies is
/// left out.
fn diagram(crates: &BTreeMap<&str, (&str, BTreeSet<&str>)>) -> String {
    fn reaches(crates: &BTreeMap<&str, (&str, BTreeSet<&str>)>, from: &str, to: &str) -> bool {
        crates[from].1.iter().any(|next| *next == to || reaches(crates, next, to))
    }
    let mut text = String::from("```mermaid\nflowchart TD\n");
    for (name, (_, used)) in crates {
        for to in used.iter().filter(|to| !used.iter().any(|other| reaches(crates, other, to))) {
            text += &format!("    {name} --> {to}\n");
        }
    }
    text + "```\n"
}

/// The table and the diagram of docs/tour.md: a crate stands below those that it uses.
#[test]
fn the_tour_shows_the_crates() {
    let metadata = metadata();
    let own = own(&metadata);
    let mut crates: BTreeMap<&str, (&str, BTreeSet<&str>)> = BTreeMap::new();
    for package in metadata["packages"].as_array().expect("packages").iter().filter(|p| own.contains(text(p, "id"))) {
        let used = package["dependencies"].as_array().expect("dependencies").iter();
        let used = used.filter(|d| d["path"].is_string() && d["kind"] != "dev").map(|d| text(d, "name")).collect();
        crates.insert(text(package, "name"), (text(package, "description"), used));
    }
    let mut table = String::from("| crate | what it is | uses |\n|---|---|---|\n");
    let mut placed = BTreeSet::new();
    while placed.len() < crates.len() {
        let ready: Vec<&str> = crates
            .iter()
            .filter(|(name, (_, used))| !placed.contains(*name) && used.is_subset(&placed))
            .map(|(name, _)| *name)
            .collect();
        assert!(!ready.is_empty(), "crates use each other in a circle");
        for name in ready {
            let (about, used) = &crates[name];
            let used: Vec<String> = used.iter().map(|used| format!("`{used}`")).collect();
            table += &format!("| `{name}` | {about} | {} |\n", used.join(" "));
            placed.insert(name);
        }
    }
    let tour = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/tour.md");
    says(&tour, "crates", &table);
    says(&tour, "crate diagram", &diagram(&crates));
}

#[test]
fn crates_bring_nothing_of_what_lies_above_them() {
    let above = ["clap", "egui", "winit", "indicatif", "maud"];
    let no_vulkan = [&above[..], &["ash"]].concat();
    let rules: [(&str, &[&str], &str); 5] = [
        ("etalon", &above, "ash"),
        ("etalon-vulkan", &above, "ash"),
        ("etalon-scene", &no_vulkan, "gltf"),
        ("etalon-image", &no_vulkan, "exr"),
        ("etalon-optics", &no_vulkan, "glam"),
    ];
    for (package, not, there) in rules {
        let all: BTreeSet<String> = built_from(package, "normal").into_iter().map(|(name, _)| name).collect();
        assert!(all.contains(there), "{package}: {all:?}");
        for name in not {
            assert!(!all.contains(*name), "{package} brings {name}");
        }
    }
}
