//! Shader files, and names derived from file names.

use std::fs;
use std::path::{Path, PathBuf};

/// Errors are one sentence, with file and line if known.
pub(crate) type Result<T, E = String> = std::result::Result<T, E>;

/// Endings of shader files.
const ENDINGS: [&str; 4] = ["glsl", "comp", "vert", "frag"];

/// Shader files of a folder in order, without what editors leave there; empty if the folder does not exist, because
/// passes do not need a library.
pub(crate) fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    if !folder.exists() {
        return Ok(Vec::new());
    }
    let entries = fs::read_dir(folder).map_err(|e| format!("reading {}: {e}", folder.display()))?;
    let is_shader = |path: &PathBuf| {
        let hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
        !hidden && path.extension().is_some_and(|ending| ENDINGS.iter().any(|known| ending == *known))
    };
    let mut paths: Vec<PathBuf> =
        entries.filter_map(|entry| entry.ok().map(|entry| entry.path())).filter(is_shader).collect();
    paths.sort();
    Ok(paths)
}

pub(crate) fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Snake case: `SurfaceTiles` becomes `surface_tiles`.
pub(crate) fn snake(name: &str) -> String {
    let mut out = String::new();
    for (i, c) in name.chars().enumerate() {
        if c.is_uppercase() && i > 0 {
            out.push('_');
        }
        out.extend(c.to_lowercase());
    }
    out
}
