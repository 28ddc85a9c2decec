//! Container of a glTF file: GLB chunks, JSON, buffers and URIs.
//!
//! Read glTF 2.0 sections 2.8 (URIs), 3.6.1 (buffers) and 4 (GLB). After [`Document::open`] every index in the JSON
//! that the `gltf` crate knows of is in range, every buffer has the length that the JSON states, and compressed
//! geometry is decoded. The node hierarchy is not checked yet.

use std::{
    borrow::Cow,
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, anyhow, bail, ensure};
use gltf::json::{
    self, Root,
    validation::{Checked, Error as Flaw, Validate},
};

use super::decompress::{decompress, is_fallback};
use super::extensions::is_supported;
use super::lenient::{self, PointerChannel};
use super::names::by_name_or_index;

/// A glTF file with its buffers in memory.
pub(crate) struct Document<'a> {
    /// The JSON with checked indices.
    pub(crate) root: Root,
    /// One byte string per buffer, exactly `byteLength` long.
    pub(crate) buffers: Vec<Cow<'a, [u8]>>,
    /// Base folder of relative URIs.
    pub(crate) folder: PathBuf,
    /// Channels of animations that name their property by a JSON pointer.
    pub(crate) pointers: Vec<PointerChannel>,
}

/// The JSON and binary chunks of a GLB file, or the JSON of a `.gltf` file alone.
struct Parts<'a> {
    json: &'a [u8],
    binary: Option<&'a [u8]>,
}

impl<'a> Parts<'a> {
    fn of(bytes: &'a [u8], path: &Path) -> Result<Self> {
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

impl<'a> Document<'a> {
    /// Parses and checks `bytes`, and reads every buffer the file names.
    pub(crate) fn open(bytes: &'a [u8], path: &Path, warnings: &mut Vec<String>) -> Result<Self> {
        let parts = Parts::of(bytes, path)?;
        let (mut root, pointers) = match json::deserialize::from_slice(parts.json) {
            Ok(root) => (root, Vec::new()),
            Err(error) => lenient::read(parts.json, warnings)
                .map_err(|_| anyhow!("the JSON cannot be read as glTF 2.0: {error}"))?,
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
        Ok(Self { root, buffers, folder, pointers })
    }

    /// Gives each primitive its material of a variant (KHR_materials_variants), by name or index.
    pub(crate) fn choose_variant(&mut self, wanted: &str) -> Result<()> {
        let root = &mut self.root;
        let variants = root.extensions.as_ref().and_then(|extensions| extensions.khr_materials_variants.as_ref());
        let names: Vec<&str> = variants.iter().flat_map(|all| &all.variants).map(|one| one.name.as_str()).collect();
        let found = by_name_or_index("variant", wanted, &names.iter().map(|name| Some(*name)).collect::<Vec<_>>())?;
        let materials = root.materials.len();
        for (m, mesh) in root.meshes.iter_mut().enumerate() {
            for (p, primitive) in mesh.primitives.iter_mut().enumerate() {
                let mappings = primitive.extensions.as_ref().and_then(|e| e.khr_materials_variants.as_ref());
                let mut mappings = mappings.map_or(&[][..], |all| &all.mappings).iter();
                let Some(mapping) = mappings.find(|mapping| mapping.variants.contains(&(found as u32))) else {
                    continue;
                };
                ensure!(
                    (mapping.material as usize) < materials,
                    "mesh {m} primitive {p}: the variant \"{}\" names material {}, but the file has {materials}",
                    names[found],
                    mapping.material
                );
                primitive.material = Some(json::Index::new(mapping.material));
            }
        }
        Ok(())
    }

    /// The document with its buffers copied, without borrows.
    pub(crate) fn into_owned(self) -> Document<'static> {
        let Self { root, buffers, folder, pointers } = self;
        let buffers = buffers.into_iter().map(|buffer| Cow::Owned(buffer.into_owned())).collect();
        Document { root, buffers, folder, pointers }
    }

    /// The bytes of a buffer view and its stride.
    pub(crate) fn view(&self, index: usize) -> Result<(&[u8], Option<usize>)> {
        let view = self.root.buffer_views.get(index).with_context(|| {
            format!("buffer view {index} does not exist; the file has {}", self.root.buffer_views.len())
        })?;
        let buffer = view.buffer.value();
        let bytes =
            self.buffers.get(buffer).with_context(|| format!("buffer view {index}: there is no buffer {buffer}"))?;
        let (what, of) = (format!("buffer view {index}"), format!("buffer {buffer}"));
        let bytes = view_of(&what, &of, bytes, view.byte_offset.unwrap_or_default().0, view.byte_length.0)?;
        let stride = view.byte_stride.map(|s| s.0).filter(|&s| s != 0);
        Ok((bytes, stride))
    }

    /// The content of a URI: `data:` or a path relative to the file.
    pub(crate) fn resolve(&self, uri: &str) -> Result<Vec<u8>> {
        resolve(uri, &self.folder)
    }
}

/// The `length` bytes from byte `start` on; `what` spans them, `of` has the bytes.
pub(crate) fn view_of<'b>(what: &str, of: &str, bytes: &'b [u8], start: u64, length: u64) -> Result<&'b [u8]> {
    let end = start.checked_add(length).filter(|&end| end <= bytes.len() as u64).with_context(|| {
        format!("{what} spans {length} bytes from byte {start} of {of}, which has {} bytes", bytes.len())
    })?;
    Ok(&bytes[start as usize..end as usize])
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

/// A URI shortened for messages: `data:` URIs can be megabytes.
pub(crate) fn short_uri(uri: &str) -> String {
    if uri.chars().count() <= 80 { uri.to_owned() } else { format!("{}…", uri.chars().take(60).collect::<String>()) }
}

fn resolve(uri: &str, folder: &Path) -> Result<Vec<u8>> {
    if let Some(data) = uri.strip_prefix("data:") {
        return decode_data_uri(data).with_context(|| format!("the URI \"{}\"", short_uri(uri)));
    }
    if let Some((scheme, _)) = uri.split_once(':')
        && scheme.starts_with(|c: char| c.is_ascii_alphabetic())
        && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    {
        bail!("the URI \"{}\" has the scheme \"{scheme}\"; only data: and relative files are read", short_uri(uri));
    }
    let relative = percent_encoding::percent_decode_str(uri)
        .decode_utf8()
        .with_context(|| format!("the URI \"{}\" is not UTF-8", short_uri(uri)))?;
    ensure!(
        !Path::new(relative.as_ref()).has_root(),
        "the URI \"{}\" is an absolute path; only relative ones are read",
        short_uri(uri)
    );
    let path = folder.join(relative.as_ref());
    fs::read(&path).map_err(|error| anyhow!("{}: {}", path.display(), etalon_image::file::cause(&error)))
}

fn decode_data_uri(data: &str) -> Result<Vec<u8>> {
    let (head, body) = data.split_once(',').context("there is no comma before the data")?;
    if head.ends_with(";base64") {
        if body.contains('%') {
            let plain: Vec<u8> = percent_encoding::percent_decode_str(body).collect();
            return decode_base64(&plain);
        }
        decode_base64(body.as_bytes())
    } else {
        Ok(percent_encoding::percent_decode_str(body).collect())
    }
}

/// Decodes Base64 of RFC 4648, standard or URL alphabet, padding optional.
fn decode_base64(text: &[u8]) -> Result<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len() / 4 * 3 + 3);
    let (mut bits, mut count) = (0_u32, 0_u32);
    let end = text.iter().rposition(|&b| b != b'=').map_or(0, |i| i + 1);
    for &byte in &text[..end] {
        let value = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            b'\r' | b'\n' | b' ' | b'\t' => continue,
            _ => bail!("byte {byte:#04x} is not base64"),
        };
        bits = bits << 6 | u32::from(value);
        count += 6;
        if count >= 8 {
            count -= 8;
            out.push((bits >> count) as u8);
        }
    }
    ensure!(count < 6, "the base64 data ends within a byte");
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_matches_the_vectors_of_rfc_4648() {
        for (plain, coded) in
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy"), ("fo", "Zm8")]
        {
            assert_eq!(decode_base64(coded.as_bytes()).unwrap(), plain.as_bytes(), "{coded}");
        }
        assert_eq!(decode_base64(b"-_+/").unwrap(), [0xfb, 0xff, 0xbf]);
        assert!(decode_base64(b"Z").is_err());
        assert!(decode_base64(b"Zm9*").is_err());
    }

    #[test]
    fn plain_data_uris_are_percent_decoded() {
        assert_eq!(decode_data_uri("text/plain,a%20b").unwrap(), b"a b");
        assert!(decode_data_uri("text/plain").is_err());
    }

    #[test]
    fn a_uri_with_a_scheme_is_refused() {
        let error = format!("{:#}", resolve("https://example.org/a.bin", Path::new("")).unwrap_err());
        assert!(error.contains("https"), "{error}");
        assert!(format!("{:#}", resolve("/etc/hostname", Path::new("")).unwrap_err()).contains("absolute"));
    }
}
