//! `etalon plan FOLDER`: the glTF extensions that the files below a folder need, and what fails.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, ensure};
use comfy_table::{ContentArrangement, Table, presets};
use serde::Serialize;

use super::print;
use etalon::scene::LoadOptions;
use etalon::scene::extensions::{is_supported, named};

/// The document of `plan --json FOLDER`, schema `etalon.extensions/1`.
#[derive(Debug, Serialize)]
struct Collection {
    schema: &'static str,
    folder: String,
    /// Number of glTF files below the folder.
    files: usize,
    extensions: Vec<Extension>,
    failures: Vec<Failure>,
}

/// An extension that some file names.
#[derive(Debug, Serialize)]
struct Extension {
    name: String,
    /// Number of files that use it, with those that require it.
    used: usize,
    /// Number of files that cannot be read without it.
    required: usize,
    state: State,
}

/// What happens to files with an extension.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum State {
    /// It is read and drawn.
    Drawn,
    /// It is not supported: files are read without it, with a warning.
    Ignored,
    /// It is not supported, and files that require it are refused.
    Refused,
}

impl State {
    fn words(self, required: usize) -> String {
        match self {
            Self::Drawn => "drawn".to_owned(),
            Self::Ignored => "ignored with a warning".to_owned(),
            Self::Refused => format!("refused where required ({required}), else ignored with a warning"),
        }
    }
}

/// A file that cannot be read.
#[derive(Debug, Serialize)]
struct Failure {
    path: String,
    error: String,
}

/// The glTF files below a folder, by path. Links to folders are not followed: they may lead back.
fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        let place = || format!("reading the folder {}", folder.display());
        for entry in std::fs::read_dir(&folder).with_context(place)? {
            let entry = entry.with_context(place)?;
            let path = entry.path();
            let is_gltf =
                |extension: &std::ffi::OsStr| ["gltf", "glb"].iter().any(|known| extension.eq_ignore_ascii_case(known));
            if entry.file_type().with_context(place)?.is_dir() {
                folders.push(path);
            } else if path.is_file() && path.extension().is_some_and(is_gltf) {
                found.push(path);
            }
        }
    }
    found.sort();
    Ok(found)
}

impl Collection {
    /// Reads every file, one after another: a large one may take most of the memory.
    fn of(folder: &Path) -> Result<Self> {
        let paths = files(folder)?;
        ensure!(!paths.is_empty(), "{}: there is no .gltf or .glb file in this folder", folder.display());
        let mut counts: BTreeMap<String, [usize; 2]> = BTreeMap::new();
        let mut failures = Vec::new();
        for path in &paths {
            // A file that names nothing readable fails below, with the same sentence as in `render`.
            let names = named(path).unwrap_or_default();
            let required = names.extensions_required;
            let mut all = [names.extensions_used, required.clone()].concat();
            all.sort();
            all.dedup();
            for name in all {
                let is_required = required.contains(&name);
                let [used, needed] = counts.entry(name).or_default();
                *used += 1;
                *needed += usize::from(is_required);
            }
            if let Err(error) = etalon::scene::load(path, &LoadOptions::default()) {
                failures.push(Failure { path: path.display().to_string(), error: super::told(&error) });
            }
        }
        let extension = |(name, [used, required]): (String, [usize; 2])| {
            let state = match (is_supported(&name), required) {
                (true, _) => State::Drawn,
                (false, 0) => State::Ignored,
                (false, _) => State::Refused,
            };
            Extension { name, used, required, state }
        };
        Ok(Self {
            schema: "etalon.extensions/1",
            folder: folder.display().to_string(),
            files: paths.len(),
            extensions: counts.into_iter().map(extension).collect(),
            failures,
        })
    }

    fn text(&self) -> String {
        let mut table = Table::new();
        table.load_preset(presets::NOTHING).set_content_arrangement(ContentArrangement::Dynamic);
        table.set_header(["extension", "files that use it", "that require it", "in Etalon"]);
        for extension in &self.extensions {
            let Extension { name, used, required, state } = extension;
            table.add_row([name.clone(), used.to_string(), required.to_string(), state.words(*required)]);
        }
        let table =
            if self.extensions.is_empty() { "no file names an extension".to_owned() } else { table.to_string() };
        let failures: String = self.failures.iter().map(|failure| format!("{}\n", failure.error)).collect();
        let (files, failed) = (self.files, self.failures.len());
        format!("{table}\n\n{failures}{} of {files} files can be read", files - failed)
    }
}

/// Prints the extensions and the failures of the glTF files below a folder.
pub(super) fn run(folder: &Path, json: bool) -> Result<()> {
    let collection = Collection::of(folder)?;
    print(&if json { serde_json::to_string_pretty(&collection)? } else { collection.text() })
}
