//! The order of the renderer's rooms, read from its sources: who may know whom. What crates may know of each other
//! cargo says.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use etalon_testing::document::says;

/// What each module of the renderer may name with `crate::`; the crates below it are re-exported by these names.
const MAY_USE: &[(&str, &[&str])] = &[
    ("share", &["scene"]),
    ("shader", &["gpu", "share"]),
    ("transport", &["transport", "scene", "image", "optics", "share"]),
    ("lecture", &[]),
    ("plan", &["plan", "scene", "transport"]),
    ("prepare", &["prepare", "plan", "scene", "transport"]),
    (
        "upload",
        &["upload", "gpu", "scene", "transport", "plan", "prepare", "image", "optics", "shader", "share", "spectra"],
    ),
    ("pass", &["pass", "upload", "gpu", "scene", "plan", "prepare", "shader", "share"]),
    (
        "frame",
        &["frame", "pass", "upload", "gpu", "scene", "transport", "plan", "prepare", "image", "share", "spectra"],
    ),
    ("open", &["frame", "gpu", "image", "plan", "prepare", "scene", "study", "transport"]),
];

/// Modules that know Vulkan.
const KNOW_VULKAN: &[&str] = &["pass", "upload", "frame", "shader"];

fn sources(folder: &Path, all: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder of sources") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, all);
        } else if path.extension().is_some_and(|e| e == "rs") {
            all.push(path);
        }
    }
}

/// Every source with its top-level module and its lines without comments.
fn modules() -> Vec<(String, PathBuf, Vec<String>)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut all = Vec::new();
    sources(&root, &mut all);
    assert!(all.len() > 30, "the sources are somewhere else");
    all.into_iter()
        .map(|path| {
            let inside = path.strip_prefix(&root).expect("inside");
            let module = inside.iter().next().expect("a name").to_string_lossy().trim_end_matches(".rs").to_owned();
            let text = std::fs::read_to_string(&path).expect("a source");
            let lines = text.lines().map(|line| line.split("//").next().unwrap_or_default().to_owned()).collect();
            (module, path, lines)
        })
        .collect()
}

/// Names right after `crate::` in a line, also inside braces: `crate::{a, b::c}`.
fn crate_names(text: &str) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    let word = |s: &str| s.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    for (at, _) in text.match_indices("crate::") {
        // `$crate::` and `pub(crate)` do not match; `othercrate::` would have a word before it.
        if text[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_') {
            continue;
        }
        let rest = &text[at + "crate::".len()..];
        if let Some(list) = rest.strip_prefix('{') {
            let mut depth = 0;
            let mut start = true;
            for (i, c) in list.char_indices() {
                match c {
                    '{' => depth += 1,
                    '}' if depth == 0 => break,
                    '}' => depth -= 1,
                    ',' if depth == 0 => start = true,
                    _ if start && !c.is_whitespace() => {
                        names.insert(word(&list[i..]));
                        start = false;
                    }
                    _ => {}
                }
            }
        } else {
            names.insert(word(rest));
        }
    }
    names
}

#[test]
fn names_after_crate_are_found() {
    let found = crate_names("use crate::gpu::{Buffer, Device}; crate::{scene::Light, plan, pass::{a, b}}; crate::x");
    assert_eq!(found.into_iter().collect::<Vec<_>>(), ["gpu", "pass", "plan", "scene", "x"]);
}

#[test]
fn modules_know_only_what_lies_below_them() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut wrong = Vec::new();
    let mut seen = 0;
    for (module, path, lines) in modules() {
        if module == "lib" {
            continue;
        }
        let Some((_, allowed)) = MAY_USE.iter().find(|(name, _)| *name == module) else {
            wrong.push(format!("{}: the module `{module}` has no place in the order", path.display()));
            continue;
        };
        let text = lines.join("\n");
        // `super` as often as the module is deep is `crate` by another name.
        let depth = path.strip_prefix(&root).expect("inside").iter().filter(|part| *part != "mod.rs").count();
        if text.contains(&"super::".repeat(depth)) {
            wrong.push(format!("{}: `{module}` reaches the top by super", path.display()));
        }
        for name in crate_names(&text) {
            seen += 1;
            if !allowed.contains(&name.as_str()) {
                wrong.push(format!("{}: `{module}` names crate::{name}", path.display()));
            }
        }
    }
    assert!(seen > 40, "only {seen} names found");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_tour_shows_the_order_of_modules() {
    let mut table = String::from("| module | uses |\n|---|---|\n");
    for (module, uses) in MAY_USE {
        let others: Vec<String> = uses.iter().filter(|name| *name != module).map(|name| format!("`{name}`")).collect();
        table += &format!("| `{module}` | {} |\n", others.join(" "));
    }
    says(&Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/tour.md"), "modules", &table);
}

#[test]
fn plain_data_knows_no_vulkan() {
    for (module, path, lines) in modules() {
        if KNOW_VULKAN.contains(&module.as_str()) {
            continue;
        }
        for (number, line) in lines.iter().enumerate() {
            // The root gives the layer its name, `gpu`.
            let words = ["ash::", "vk::", "gpu_allocator", "etalon_vulkan"];
            let names = words.iter().filter(|word| module != "lib" || **word != "etalon_vulkan").any(|word| {
                line.match_indices(word).any(|(at, _)| !line[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_'))
            });
            assert!(!names, "{}:{}: {line}", path.display(), number + 1);
        }
    }
}

/// Types of one name in two crates: data and its place on the device, truth and what is judged by it, source and what
/// it becomes. No further one may join them.
const OF_ONE_NAME: &[&str] = &[
    "Binding", "Column", "Compiled", "Display", "Drawn", "Equation", "Facts", "Format", "Grid", "Hit", "Image",
    "Instance", "Part", "Place", "Point", "Price", "Program", "Ray", "Shared", "Source", "Stage", "View", "ViewArgs",
];

#[test]
fn no_further_type_name_means_two_things() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut all = Vec::new();
    sources(&root.join("src"), &mut all);
    for entry in std::fs::read_dir(root.join("crates")).expect("the crates") {
        sources(&entry.expect("a crate").path().join("src"), &mut all);
    }
    let mut found: std::collections::BTreeMap<String, BTreeSet<String>> = std::collections::BTreeMap::new();
    for path in all {
        let text = std::fs::read_to_string(&path).expect("a source");
        for line in text.lines() {
            let line =
                ["pub(crate) ", "pub(super) ", "pub "].iter().find_map(|word| line.strip_prefix(word)).unwrap_or(line);
            let Some(rest) = ["struct ", "enum ", "trait "].iter().find_map(|word| line.strip_prefix(word)) else {
                continue;
            };
            let name: String = rest.chars().take_while(|c| c.is_alphanumeric()).collect();
            found.entry(name).or_default().insert(path.strip_prefix(root).expect("inside").display().to_string());
        }
    }
    assert!(found.len() > 400, "{} types", found.len());
    found.retain(|name, places| places.len() > 1 && !OF_ONE_NAME.contains(&name.as_str()));
    assert!(found.is_empty(), "types of one name: {found:#?}");
}
