//! glTF extensions: which ones are supported, and which ones a file names.

use std::path::Path;

use anyhow::{Context as _, Result};
use serde::Deserialize;

use super::contents;
use super::glb::json_of;
use super::lobe::LOBES;

/// Supported extensions, without those of [`LOBES`].
const SUPPORTED_EXTENSIONS: &[&str] = &[
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_clearcoat",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_materials_volume_scatter",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_basisu",
    "KHR_texture_transform",
];

/// Whether an extension is read and drawn, so that `extensionsRequired` may name it.
#[must_use]
pub fn is_supported(name: &str) -> bool {
    SUPPORTED_EXTENSIONS.contains(&name) || LOBES.iter().any(|lobe| lobe.extension == name)
}

/// The extensions that a glTF file names.
#[derive(Debug, Clone, Default, PartialEq, Eq, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Named {
    /// Extensions that the file uses, whether or not it can be read without them.
    pub extensions_used: Vec<String>,
    /// Extensions without which the file cannot be read.
    pub extensions_required: Vec<String>,
}

/// The extensions that a `.gltf` or `.glb` file names. Nothing else of the file is checked.
///
/// # Errors
/// One sentence with the file and the cause: it cannot be read, or its JSON is none.
pub fn named(path: &Path) -> Result<Named> {
    let read = || -> Result<Named> {
        let bytes = contents(path)?;
        serde_json::from_slice(json_of(&bytes, path)?).context("the JSON cannot be read")
    };
    read().with_context(|| format!("loading {}", path.display()))
}
