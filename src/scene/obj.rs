//! Wavefront OBJ with MTL into a [`Scene`].

use std::path::Path;

use anyhow::{Result, bail};

use super::Scene;

/// Reads an `.obj` file.
pub(crate) fn load(_path: &Path) -> Result<Scene> {
    bail!("OBJ files are not read yet")
}
