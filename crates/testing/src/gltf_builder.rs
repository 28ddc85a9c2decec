//! Builder of small glTF files for tests: hand-written JSON and one buffer, as GLB or as JSON with a data URI.

#![allow(clippy::unwrap_used, reason = "a test may stop where it stands")]

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

/// Component type i8.
pub const BYTE: u32 = 5120;
/// Component type u8.
pub const UNSIGNED_BYTE: u32 = 5121;
/// Component type i16.
pub const SHORT: u32 = 5122;
/// Component type u16.
pub const UNSIGNED_SHORT: u32 = 5123;
/// Component type u32.
pub const UNSIGNED_INT: u32 = 5125;
/// Component type f32.
pub const FLOAT: u32 = 5126;

/// A glTF file under construction.
#[derive(Clone)]
pub struct Builder {
    /// The JSON so far.
    pub json: Value,
    /// Content of the one buffer.
    pub bytes: Vec<u8>,
}

/// Little-endian bytes of floats.
pub fn f32s(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Little-endian bytes of 16-bit integers; cast signed ones to u16.
pub fn u16s(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

impl Default for Builder {
    fn default() -> Self {
        Self::new()
    }
}

impl Builder {
    /// A file with an asset and nothing else.
    pub fn new() -> Self {
        Self { json: json!({ "asset": { "version": "2.0" } }), bytes: Vec::new() }
    }

    /// Appends a value to a top-level list and returns its index.
    pub fn push(&mut self, list: &str, value: Value) -> usize {
        if self.json[list].is_null() {
            self.json[list] = json!([]);
        }
        let list = self.json[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    /// Adds a buffer view of new bytes and returns its index.
    pub fn view(&mut self, bytes: &[u8], stride: Option<usize>) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut view = json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() });
        if let Some(stride) = stride {
            view["byteStride"] = stride.into();
        }
        self.bytes.extend(bytes);
        self.push("bufferViews", view)
    }

    /// Adds an accessor for new bytes and returns its index.
    pub fn accessor(&mut self, bytes: &[u8], component: u32, shape: &str, count: usize) -> usize {
        let view = self.view(bytes, None);
        self.push("accessors", json!({ "bufferView": view, "componentType": component, "type": shape, "count": count }))
    }

    /// Adds an accessor of packed floats; their number is a multiple of the shape's width.
    pub fn floats(&mut self, shape: &str, values: &[f32]) -> usize {
        let width = match shape {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        self.accessor(&f32s(values), FLOAT, shape, values.len() / width)
    }

    /// Adds an accessor of indices.
    pub fn indices(&mut self, values: &[u16]) -> usize {
        self.accessor(&u16s(values), UNSIGNED_SHORT, "SCALAR", values.len())
    }

    /// Adds a mesh of one primitive.
    pub fn mesh(&mut self, primitive: Value) -> usize {
        self.push("meshes", json!({ "primitives": [primitive] }))
    }

    /// Adds a node as a root of scene 0.
    pub fn root(&mut self, node: Value) -> usize {
        let node = self.push("nodes", node);
        if self.json["scenes"].is_null() {
            self.json["scenes"] = json!([{ "nodes": [] }]);
        }
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(node.into());
        node
    }

    /// Adds the triangle (0,0,0), (1,0,0), (0,1,0) as an accessor of positions.
    pub fn triangle(&mut self) -> usize {
        self.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    }

    fn finished_json(&self, uri: Option<String>) -> Vec<u8> {
        let mut json = self.json.clone();
        if json.is_object() && json["buffers"].is_null() && !self.bytes.is_empty() {
            json["buffers"] = json!([{ "byteLength": self.bytes.len() }]);
            if let Some(uri) = uri {
                json["buffers"][0]["uri"] = uri.into();
            }
        }
        serde_json::to_vec(&json).unwrap()
    }

    /// The file as GLB.
    pub fn glb(&self) -> Vec<u8> {
        let mut json = self.finished_json(None);
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut binary = self.bytes.clone();
        binary.resize(binary.len().next_multiple_of(4), 0);
        let mut out = b"glTF\x02\0\0\0".to_vec();
        let total = 12 + 8 + json.len() + if binary.is_empty() { 0 } else { 8 + binary.len() };
        out.extend((total as u32).to_le_bytes());
        out.extend((json.len() as u32).to_le_bytes());
        out.extend(b"JSON");
        out.extend(json);
        if !binary.is_empty() {
            out.extend((binary.len() as u32).to_le_bytes());
            out.extend(b"BIN\0");
            out.extend(binary);
        }
        out
    }

    /// Writes the file into a folder as GLB.
    pub fn save_glb(&self, folder: &Path) -> PathBuf {
        let path = folder.join("scene.glb");
        std::fs::write(&path, self.glb()).unwrap();
        path
    }

    /// Writes the JSON into a folder; the caller provides the buffer at `uri`.
    pub fn save_gltf(&self, folder: &Path, uri: &str) -> PathBuf {
        let path = folder.join("scene.gltf");
        std::fs::write(&path, self.finished_json(Some(uri.to_owned()))).unwrap();
        path
    }

    /// The buffer as a data URI.
    pub fn data_uri(&self) -> String {
        format!("data:application/octet-stream;base64,{}", base64(&self.bytes))
    }
}

/// Base64 of bytes.
pub fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::new();
    for chunk in bytes.chunks(3) {
        let bits = chunk.iter().fold(0_u32, |b, &x| b << 8 | u32::from(x)) << (8 * (3 - chunk.len()));
        for i in 0..4 {
            let digit = ALPHABET[(bits >> (18 - 6 * i) & 63) as usize] as char;
            out.push(if i <= chunk.len() { digit } else { '=' });
        }
    }
    out
}

/// A PNG of one colour.
pub fn png(width: u32, height: u32, rgba: [u8; 4]) -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    image::RgbaImage::from_pixel(width, height, image::Rgba(rgba)).write_to(&mut out, image::ImageFormat::Png).unwrap();
    out.into_inner()
}
