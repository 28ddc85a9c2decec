//! The order of the modules, read from the sources: who may know whom. A module below does not know the ones above it,
//! `ash` stays out of everything that is plain data, and `unsafe` stays in one room.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// What each top-level module may name with `crate::`.
const MAY_USE: &[(&str, &[&str])] = &[
    ("image", &["image"]),
    ("spectra", &["spectra", "optics"]),
    ("scene", &["scene", "image", "spectra", "optics", "share"]),
    ("study", &["study", "scene", "spectra", "optics"]),
    ("plan", &["plan", "scene"]),
    ("prepare", &["prepare", "plan", "scene"]),
    ("optics", &["optics"]),
    ("verify", &["verify", "optics", "shader", "gpu"]),
    ("share", &["share"]),
    ("gpu", &["gpu"]),
    ("shader", &["shader", "gpu", "share"]),
    ("pass", &["pass", "gpu", "scene", "plan", "prepare", "image", "optics", "shader", "share", "spectra"]),
    ("frame", &["frame", "pass", "gpu", "scene", "plan", "prepare", "image", "share", "spectra"]),
    ("cost", &["cost", "frame", "gpu", "plan", "prepare", "scene", "image"]),
    (
        "viewer",
        &["viewer", "cost", "frame", "pass", "gpu", "plan", "scene", "image", "optics", "spectra", "shader", "share"],
    ),
    (
        "cli",
        &[
            "cli", "viewer", "cost", "verify", "optics", "spectra", "frame", "pass", "gpu", "scene", "plan", "prepare",
            "image", "study", "share", "shader",
        ],
    ),
];

/// Modules that may name `ash`.
const KNOW_VULKAN: &[&str] = &["gpu", "pass", "frame", "shader"];

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
    let mut wrong = Vec::new();
    let mut seen = 0;
    for (module, path, lines) in modules() {
        if ["lib", "main"].contains(&module.as_str()) {
            continue;
        }
        let Some((_, allowed)) = MAY_USE.iter().find(|(name, _)| *name == module) else {
            wrong.push(format!("{}: the module `{module}` has no place in the order", path.display()));
            continue;
        };
        for name in crate_names(&lines.join("\n")) {
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
fn plain_data_knows_no_vulkan() {
    for (module, path, lines) in modules() {
        if KNOW_VULKAN.contains(&module.as_str()) {
            continue;
        }
        for (number, line) in lines.iter().enumerate() {
            let names = ["ash::", "vk::", "gpu_allocator"].iter().any(|word| {
                line.match_indices(word).any(|(at, _)| !line[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_'))
            });
            assert!(!names, "{}:{}: {line}", path.display(), number + 1);
        }
    }
}

#[test]
fn unsafe_is_in_one_room() {
    let mut blocks = 0;
    for (module, path, lines) in modules() {
        for (number, line) in lines.iter().enumerate() {
            let has = line.split(|c: char| !(c.is_alphanumeric() || c == '_')).any(|word| word == "unsafe");
            assert!(!has || module == "gpu", "{}:{}: {line}", path.display(), number + 1);
            blocks += usize::from(has);
        }
    }
    assert!(blocks > 20, "only {blocks} found: the search is broken");
}
