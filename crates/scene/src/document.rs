//! A glTF file in memory, and the bytes of its buffer views.
//!
//! Read glTF 2.0 sections 3.6.1 (buffers) and 5 (schemas), and KHR_materials_variants.

use std::borrow::Cow;
use std::path::PathBuf;

use anyhow::{Context, Result, ensure};
use gltf::json::{self, Root};

use super::names::by_name_or_index;
use super::uri::{file, resolve};

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

/// A channel of KHR_animation_pointer.
#[derive(Debug, Clone)]
pub(crate) struct PointerChannel {
    pub(crate) animation: usize,
    pub(crate) sampler: usize,
    /// JSON pointer to the animated property, such as `/nodes/3/translation`.
    pub(crate) pointer: String,
}

impl<'a> Document<'a> {
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

    /// Files that the document names, of buffers and images.
    pub(crate) fn files(&self) -> Vec<PathBuf> {
        let buffers = self.root.buffers.iter().filter_map(|buffer| buffer.uri.as_ref());
        let all = buffers.chain(self.root.images.iter().filter_map(|image| image.uri.as_ref()));
        all.filter(|uri| !uri.starts_with("data:")).filter_map(|uri| file(uri, &self.folder).ok()).collect()
    }
}

/// The `length` bytes from byte `start` on; `what` spans them, `of` has the bytes.
pub(crate) fn view_of<'b>(what: &str, of: &str, bytes: &'b [u8], start: u64, length: u64) -> Result<&'b [u8]> {
    let end = start.checked_add(length).filter(|&end| end <= bytes.len() as u64).with_context(|| {
        format!("{what} spans {length} bytes from byte {start} of {of}, which has {} bytes", bytes.len())
    })?;
    Ok(&bytes[start as usize..end as usize])
}
