//! The parts of a glTF file: the chunks of a GLB file, or its JSON.
//!
//! Read glTF 2.0 section 4 (GLB).

use std::path::Path;

use anyhow::{Context, Result, ensure};

/// The JSON and binary chunks of a GLB file, or the JSON of a `.gltf` file alone.
pub(crate) struct Parts<'a> {
    pub(crate) json: &'a [u8],
    pub(crate) binary: Option<&'a [u8]>,
}

impl<'a> Parts<'a> {
    pub(crate) fn of(bytes: &'a [u8], path: &Path) -> Result<Self> {
        let is_glb = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb"));
        let parts = if is_glb || bytes.starts_with(b"glTF") {
            split_glb(bytes)?
        } else {
            Parts { json: bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes), binary: None }
        };
        ensure!(
            parts.json.trim_ascii_start().starts_with(b"{"),
            "the JSON cannot be read as glTF 2.0: it does not begin with an object"
        );
        Ok(parts)
    }
}

/// The JSON of a file, before any of it is checked.
pub(crate) fn json_of<'a>(bytes: &'a [u8], path: &Path) -> Result<&'a [u8]> {
    Ok(Parts::of(bytes, path)?.json)
}

/// Little-endian word at `at`; `None` past the end.
fn word(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..at.checked_add(4)?)?.try_into().ok().map(u32::from_le_bytes)
}

fn split_glb(bytes: &[u8]) -> Result<Parts<'_>> {
    ensure!(bytes.starts_with(b"glTF"), "it is no GLB file: its header \"glTF\" is missing");
    let version = word(bytes, 4).context("the GLB header ends early")?;
    ensure!(version == 2, "the GLB header says version {version}; only version 2 is supported");
    let length = word(bytes, 8).context("the GLB header ends early")?;
    ensure!(
        length as usize == bytes.len(),
        "the GLB header says {length} bytes, but the file has {} bytes",
        bytes.len()
    );
    let mut at = 12;
    let (mut json, mut binary) = (None, None);
    while at < bytes.len() {
        let number = usize::from(json.is_some()) + usize::from(binary.is_some());
        let size = word(bytes, at).with_context(|| format!("the header of GLB chunk {number} ends early"))? as usize;
        let kind = word(bytes, at + 4).with_context(|| format!("the header of GLB chunk {number} ends early"))?;
        let data = bytes.get(at + 8..).and_then(|rest| rest.get(..size)).with_context(|| {
            format!(
                "GLB chunk {number} claims {size} bytes, but the file has {} left",
                bytes.len().saturating_sub(at + 8)
            )
        })?;
        match &kind.to_le_bytes() {
            b"JSON" if json.is_none() => json = Some(data),
            b"BIN\0" if json.is_some() && binary.is_none() => binary = Some(data),
            // glTF 2.0 section 4.4: readers skip chunks of unknown types.
            _ => ensure!(json.is_some(), "the first GLB chunk is not JSON"),
        }
        at += 8 + size;
    }
    Ok(Parts { json: json.context("the GLB file has no JSON chunk")?, binary })
}
