//! Opening of a glTF file: its JSON is checked, its buffers are read and decompressed.
//!
//! Read glTF 2.0 section 3.6.1 (buffers). After [`open`] every index in the JSON that the `gltf` crate knows of is in
//! range, every buffer has the length that the JSON states, and compressed geometry is decoded. The node hierarchy is
//! not checked yet.

use std::borrow::Cow;
use std::path::Path;

use anyhow::{Context, Result, anyhow, bail, ensure};
use gltf::json::{
    self, Root,
    validation::{Checked, Error as Flaw, Validate},
};

use super::decompress::{decompress, is_fallback};
use super::document::Document;
use super::extensions::is_supported;
use super::glb::Parts;
use super::lenient;
use super::uri::resolve;

/// Parses and checks the bytes of a file, and reads every buffer that it names.
pub(crate) fn open<'a>(bytes: &'a [u8], path: &Path, warnings: &mut Vec<String>) -> Result<Document<'a>> {
    let parts = Parts::of(bytes, path)?;
    let (mut root, pointers) = match Root::from_slice(parts.json) {
        Ok(root) => (root, Vec::new()),
        Err(error) => {
            lenient::read(parts.json, warnings).map_err(|_| anyhow!("the JSON cannot be read as glTF 2.0: {error}"))?
        }
    };
    check_asset(&root, warnings)?;
    check_extensions(&root, warnings)?;
    let folder = path.parent().unwrap_or(Path::new("")).to_owned();
    let mut buffers = root
        .buffers
        .iter()
        .enumerate()
        .map(|(index, buffer)| read_buffer(index, buffer, parts.binary, &folder))
        .collect::<Result<Vec<_>>>()?;
    decompress(&mut root, &mut buffers)?;
    check_references(&root)?;
    Ok(Document { root, buffers, folder, pointers })
}

fn check_asset(root: &Root, warnings: &mut Vec<String>) -> Result<()> {
    let version = &root.asset.version;
    ensure!(
        version.split('.').next() == Some("2"),
        "the file is glTF version \"{version}\"; only version 2.0 is supported"
    );
    if let Some(min) = &root.asset.min_version {
        ensure!(
            ["2.0", "2.1"].contains(&min.as_str()),
            "the file needs a reader of glTF version \"{min}\"; only version 2.0 is supported"
        );
        if min == "2.1" {
            warnings.push("the file asks for glTF 2.1, a draft; it is read as glTF 2.0".to_owned());
        }
    }
    Ok(())
}

fn check_extensions(root: &Root, warnings: &mut Vec<String>) -> Result<()> {
    for name in &root.extensions_required {
        ensure!(is_supported(name), "the file requires the extension {name}, which is not supported");
    }
    for name in &root.extensions_used {
        if !is_supported(name) {
            warnings.push(format!("{name} is not supported and is ignored"));
        }
    }
    Ok(())
}

/// Runs the `gltf` crate's validation, and tolerates what reading does not need.
fn check_references(root: &Root) -> Result<()> {
    // The crate looks up a primitive's POSITION accessor without a bounds check, so this index is checked first.
    let accessors = root.accessors.len();
    for (m, mesh) in root.meshes.iter().enumerate() {
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            for (semantic, accessor) in &primitive.attributes {
                ensure!(
                    accessor.value() < accessors,
                    "meshes[{m}].primitives[{p}].attributes[\"{}\"] names accessor {}, but the file has {accessors}",
                    semantic.to_string(),
                    accessor.value()
                );
            }
        }
    }
    let mut first: Option<(String, Flaw)> = None;
    root.validate(root, json::Path::new, &mut |path, flaw| {
        if first.is_some() {
            return;
        }
        let place = path().0;
        let tolerated = match flaw {
            // `is_supported` has checked `extensionsRequired`.
            Flaw::Unsupported => true,
            // Not needed for reading: min and max of accessors; an accessor without a buffer view holds zeros; a
            // texture may take its image from an extension; an attribute of unknown name is ignored.
            Flaw::Missing => {
                let is_bound = place.ends_with(".min") || place.ends_with(".max");
                let is_zeros = place.starts_with("accessors[") && place.ends_with(".bufferView");
                is_bound || is_zeros || place.ends_with(".source")
            }
            Flaw::Invalid => {
                place.ends_with(".min") || place.ends_with(".max") || place.contains("<invalid semantic name>")
            }
            _ => false,
        };
        if !tolerated {
            first = Some((place, flaw));
        }
    });
    if let Some((place, flaw)) = first {
        let what = match flaw {
            Flaw::IndexOutOfBounds => "names something that does not exist",
            Flaw::Invalid => "has an invalid value",
            Flaw::Missing => "is missing",
            Flaw::Oversize => "is too large for this machine",
            Flaw::Unsupported => "is not supported",
        };
        bail!("{place} {what}");
    }
    for (a, animation) in root.animations.iter().enumerate() {
        for (c, channel) in animation.channels.iter().enumerate() {
            let node = channel.target.node.value();
            ensure!(
                node < root.nodes.len(),
                "animations[{a}].channels[{c}].target.node names node {node}, but the file has {}",
                root.nodes.len()
            );
            ensure!(
                matches!(channel.target.path, Checked::Valid(_)),
                "animations[{a}].channels[{c}].target.path has an invalid value"
            );
        }
    }
    Ok(())
}

fn read_buffer<'a>(
    index: usize,
    buffer: &json::Buffer,
    binary: Option<&'a [u8]>,
    folder: &Path,
) -> Result<Cow<'a, [u8]>> {
    let claimed = buffer.byte_length.0;
    if is_fallback(buffer) {
        return Ok(Cow::Borrowed(&[]));
    }
    let bytes = match (&buffer.uri, binary) {
        (Some(uri), _) => Cow::Owned(resolve(uri, folder).with_context(|| format!("buffer {index}"))?),
        (None, Some(binary)) if index == 0 => Cow::Borrowed(binary),
        (None, _) => bail!("buffer {index} has no URI and the file has no binary chunk for it"),
    };
    ensure!(
        claimed <= bytes.len() as u64,
        "buffer {index} should have {claimed} bytes, but its data has {} bytes",
        bytes.len()
    );
    let claimed = claimed as usize;
    Ok(match bytes {
        Cow::Borrowed(b) => Cow::Borrowed(&b[..claimed]),
        Cow::Owned(mut b) => {
            b.truncate(claimed);
            Cow::Owned(b)
        }
    })
}
