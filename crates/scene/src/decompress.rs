//! Compressed geometry of a glTF file becomes plain buffer views, before anything reads or validates it.
//!
//! Read EXT_meshopt_compression, KHR_meshopt_compression (a later vertex stream and a colour filter) and
//! KHR_draco_mesh_compression. The decoders are crates (docs/decisions/compression.md); this file checks what the JSON
//! says about their output, bounds it, and writes buffers, views and accessors that hold it.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};

use anyhow::{Context, Result, anyhow, bail, ensure};
use draco_core::{DataType, DecodeLimits, DecoderBuffer, FaceIndex, Mesh, MeshDecoder, PointAttribute, PointIndex};
use gltf::json::accessor::{ComponentType, GenericComponentType};
use gltf::json::validation::{Checked, USize64};
use gltf::json::{self, Accessor, Buffer, Index, Root, buffer};
use meshoptimizer_rs::{Workspace, codec as meshopt};
use rayon::prelude::*;
use serde::Deserialize;
use serde_json::{Map, Value};

use super::document::view_of;

/// Largest number of bytes that all compressed geometry of one file may decode to.
pub(crate) const MAX_DECODED_BYTES: u64 = 2 << 30;

/// Names of the meshopt extension: the vendor's, and Khronos's with the newer vertex stream.
const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
const DRACO: &str = "KHR_draco_mesh_compression";

/// The extension of a buffer view that holds a meshopt stream.
#[derive(Debug, Clone, Deserialize)]
#[serde(rename_all = "camelCase")]
struct MeshoptView {
    buffer: usize,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    byte_stride: usize,
    count: usize,
    mode: String,
    #[serde(default = "no_filter")]
    filter: String,
}

fn no_filter() -> String {
    "NONE".to_owned()
}

/// The extension of a primitive that holds a Draco mesh.
#[derive(Debug, Clone, Deserialize)]
#[serde(rename_all = "camelCase")]
struct DracoPrimitive {
    buffer_view: usize,
    /// Unique id of the Draco attribute, by glTF's semantic.
    attributes: BTreeMap<String, u32>,
}

fn meshopt_of(others: &Map<String, Value>) -> Option<(&'static str, &Value)> {
    MESHOPT.iter().find_map(|name| others.get(*name).map(|value| (*name, value)))
}

/// Whether a buffer only stands for data that compressed views hold: a file without fallback data need not have its
/// bytes.
pub(crate) fn is_fallback(buffer: &Buffer) -> bool {
    let of = buffer.extensions.as_ref().and_then(|extensions| meshopt_of(&extensions.others));
    of.is_some_and(|(_, value)| value.get("fallback").and_then(Value::as_bool).unwrap_or(false))
}

/// Decodes all compressed geometry of the file. Afterwards no view or primitive has a compression extension.
pub(crate) fn decompress(root: &mut Root, buffers: &mut Vec<Cow<'_, [u8]>>) -> Result<()> {
    let mut left = MAX_DECODED_BYTES;
    meshopt_views(root, buffers, &mut left)?;
    draco_primitives(root, buffers, &mut left)
}

/// Appends a buffer of these bytes.
fn append(root: &mut Root, buffers: &mut Vec<Cow<'_, [u8]>>, bytes: Vec<u8>) -> Index<Buffer> {
    root.buffers.push(Buffer {
        byte_length: USize64(bytes.len() as u64),
        name: None,
        uri: None,
        extensions: None,
        extras: json::Extras::default(),
    });
    buffers.push(Cow::Owned(bytes));
    Index::new((root.buffers.len() - 1) as u32)
}

/// Takes the decoded size of a stream from what is left of the limit.
fn take(left: &mut u64, bytes: u64) -> Result<()> {
    *left = left.checked_sub(bytes).with_context(|| {
        format!("its decoded size of {bytes} bytes makes all decoded geometry larger than {MAX_DECODED_BYTES} bytes")
    })?;
    Ok(())
}

fn meshopt_views(root: &mut Root, buffers: &mut Vec<Cow<'_, [u8]>>, left: &mut u64) -> Result<()> {
    let mut jobs = Vec::new();
    for (index, view) in root.buffer_views.iter_mut().enumerate() {
        let Some(extensions) = &mut view.extensions else { continue };
        let Some((name, value)) = meshopt_of(&extensions.others) else { continue };
        let place = || format!("buffer view {index}: {name}");
        let stream = MeshoptView::deserialize(value).with_context(place)?;
        let size = (stream.count as u64).checked_mul(stream.byte_stride as u64);
        let size = size.with_context(|| format!("{}: its decoded size is past 2^64", place()))?;
        ensure!(
            size == view.byte_length.0,
            "{}: {} elements of {} bytes are not the view's {} bytes",
            place(),
            stream.count,
            stream.byte_stride,
            view.byte_length.0
        );
        take(left, size).with_context(place)?;
        jobs.push((index, name, stream));
        extensions.others.retain(|name, _| !MESHOPT.contains(&name.as_str()));
    }
    let decoded: Vec<Vec<u8>> = jobs
        .par_iter()
        .map(|(index, name, stream)| {
            let decode = || {
                let source =
                    buffers.get(stream.buffer).with_context(|| format!("there is no buffer {}", stream.buffer))?;
                let of = format!("buffer {}", stream.buffer);
                let source = view_of("its stream", &of, source, stream.byte_offset, stream.byte_length)?;
                meshopt_stream(stream, source)
            };
            decode().with_context(|| format!("buffer view {index}: {name}"))
        })
        .collect::<Result<_>>()?;
    for ((index, _, stream), bytes) in jobs.into_iter().zip(decoded) {
        let buffer = append(root, buffers, bytes);
        let view = &mut root.buffer_views[index];
        view.buffer = buffer;
        view.byte_offset = None;
        // Only attributes are strided; the stride of indices is that of the accessor.
        if stream.mode == "ATTRIBUTES" {
            view.byte_stride = Some(buffer::Stride(stream.byte_stride));
        }
    }
    Ok(())
}

/// Decodes a stream of `count` elements of `byte_stride` bytes.
fn meshopt_stream(stream: &MeshoptView, source: &[u8]) -> Result<Vec<u8>> {
    let mut workspace = Workspace::default();
    let (count, stride) = (stream.count, stream.byte_stride);
    let decoded = match stream.mode.as_str() {
        "ATTRIBUTES" => {
            let possible = stride > 0 && stride <= 256 && stride.is_multiple_of(4);
            ensure!(possible, "a stride of {stride} bytes is not possible");
            meshopt::decode_vertex_buffer(count, stride, source, &mut workspace)
        }
        "TRIANGLES" => meshopt::decode_index_buffer(count, stride, source, &mut workspace),
        "INDICES" => meshopt::decode_index_sequence(count, stride, source, &mut workspace),
        other => bail!("its mode \"{other}\" is unknown"),
    };
    let mut bytes = decoded.map_err(|error| anyhow!("its stream cannot be decoded: {error}"))?;
    let filtered = match stream.filter.as_str() {
        "NONE" => Ok(()),
        "OCTAHEDRAL" => meshopt::decode_filter_oct(&mut bytes, count, stride, &mut workspace),
        "QUATERNION" => meshopt::decode_filter_quat(&mut bytes, count, stride, &mut workspace),
        "EXPONENTIAL" => meshopt::decode_filter_exp(&mut bytes, count, stride, &mut workspace),
        "COLOR" => meshopt::decode_filter_color(&mut bytes, count, stride, &mut workspace),
        other => bail!("its filter \"{other}\" is unknown"),
    };
    filtered.map_err(|error| anyhow!("its filter {}: {error}", stream.filter))?;
    Ok(bytes)
}

fn draco_primitives(root: &mut Root, buffers: &mut Vec<Cow<'_, [u8]>>, left: &mut u64) -> Result<()> {
    let mut jobs = Vec::new();
    for (m, mesh) in root.meshes.iter_mut().enumerate() {
        for (p, primitive) in mesh.primitives.iter_mut().enumerate() {
            let Some(value) = primitive.extensions.as_mut().and_then(|e| e.others.remove(DRACO)) else { continue };
            let place = format!("mesh {m} primitive {p}: {DRACO}");
            let stream = DracoPrimitive::deserialize(value).with_context(|| place.clone())?;
            jobs.push((m, p, stream, place));
        }
    }
    // Accessors may be shared by primitives only if they share the compressed data.
    let mut owners: HashMap<usize, usize> = HashMap::new();
    for (m, p, stream, place) in jobs {
        let decoded = draco_mesh(root, buffers, stream.buffer_view, left).with_context(|| place.clone())?;
        let points = decoded.num_points();
        let mut own = |accessor: usize| match owners.insert(accessor, stream.buffer_view) {
            Some(other) if other != stream.buffer_view => {
                bail!("accessor {accessor} belongs to the compressed buffer views {other} and {}", stream.buffer_view)
            }
            _ => Ok(()),
        };
        let named: Vec<(String, usize)> = root.meshes[m].primitives[p]
            .attributes
            .iter()
            .map(|(semantic, accessor)| (semantic.to_string(), accessor.value()))
            .collect();
        for (semantic, accessor) in named {
            let Some(&id) = stream.attributes.get(&semantic) else { continue };
            let place = || format!("{place}: {semantic}");
            let attribute = decoded.attribute_by_unique_id(id);
            let attribute = attribute.with_context(|| format!("{}: the data has no attribute {id}", place()))?;
            own(accessor).with_context(place)?;
            let bytes = draco_attribute(root, accessor, attribute, points).with_context(place)?;
            fill(root, buffers, accessor, points, bytes).with_context(place)?;
        }
        let corners: Vec<u32> = (0..decoded.num_faces())
            .flat_map(|face| decoded.face(FaceIndex(face as u32)).map(|point| point.0))
            .collect();
        let accessor = match root.meshes[m].primitives[p].indices {
            Some(accessor) => accessor.value(),
            None => {
                root.accessors.push(index_accessor());
                root.accessors.len() - 1
            }
        };
        own(accessor).with_context(|| place.clone())?;
        let primitive = &mut root.meshes[m].primitives[p];
        primitive.indices = Some(Index::new(accessor as u32));
        // Strips are stored as the triangles that they stand for.
        primitive.mode = Checked::Valid(json::mesh::Mode::Triangles);
        let into =
            root.accessors.get_mut(accessor).with_context(|| format!("{place}: there is no accessor {accessor}"))?;
        *into = Accessor { name: into.name.take(), ..index_accessor() };
        let count = corners.len();
        fill(root, buffers, accessor, count, bytemuck::cast_slice(&corners).to_vec()).with_context(|| place.clone())?;
    }
    Ok(())
}

fn draco_mesh(root: &Root, buffers: &[Cow<'_, [u8]>], view: usize, left: &mut u64) -> Result<Mesh> {
    let json = root.buffer_views.get(view).with_context(|| format!("there is no buffer view {view}"))?;
    let buffer = json.buffer.value();
    let source = buffers.get(buffer).with_context(|| format!("buffer view {view}: there is no buffer {buffer}"))?;
    let (what, of) = (format!("buffer view {view}"), format!("buffer {buffer}"));
    let source = view_of(&what, &of, source, json.byte_offset.unwrap_or_default().0, json.byte_length.0)?;
    let (mesh, bytes) = draco_stream(source, *left)?;
    take(left, bytes)?;
    Ok(mesh)
}

/// Decodes a Draco mesh of at most `limit` bytes; also returns its size in bytes.
fn draco_stream(source: &[u8], limit: u64) -> Result<(Mesh, u64)> {
    let face = size_of::<[u32; 3]>() as u64;
    let limits = DecodeLimits::default()
        .with_max_points(limit / face)
        .with_max_faces(limit / face)
        .with_max_decoded_bytes(limit);
    let mut mesh = Mesh::new();
    MeshDecoder::new()
        .decode(&mut DecoderBuffer::new(source).with_limits(limits), &mut mesh)
        .map_err(|error| anyhow!("the Draco data cannot be decoded: {error}"))?;
    // What glTF's accessors will hold: a value for each point, whatever the stream shares.
    let points = mesh.num_points() as u64;
    let attributes: u64 = (0..mesh.num_attributes()).map(|id| mesh.attribute(id).byte_stride().unsigned_abs()).sum();
    let bytes = points.saturating_mul(attributes).saturating_add(mesh.num_faces() as u64 * face);
    Ok((mesh, bytes))
}

/// The values of an attribute, one for each point, in the accessor's component type.
fn draco_attribute(root: &Root, accessor: usize, attribute: &PointAttribute, points: usize) -> Result<Vec<u8>> {
    let json = root.accessors.get(accessor).with_context(|| format!("there is no accessor {accessor}"))?;
    let (Checked::Valid(GenericComponentType(component)), Checked::Valid(shape)) = (&json.component_type, &json.type_)
    else {
        bail!("accessor {accessor} has an unknown component type or shape");
    };
    let width = shape.multiplicity();
    ensure!(
        usize::from(attribute.num_components()) == width,
        "accessor {accessor} has {width} components, the Draco attribute {}",
        attribute.num_components()
    );
    let stored = match attribute.data_type() {
        DataType::Int8 => ComponentType::I8,
        DataType::Uint8 => ComponentType::U8,
        DataType::Int16 => ComponentType::I16,
        DataType::Uint16 => ComponentType::U16,
        DataType::Uint32 => ComponentType::U32,
        DataType::Float32 => ComponentType::F32,
        other => bail!("accessor {accessor}: values of type {other:?} are not possible in glTF"),
    };
    if stored != *component {
        ensure!(
            *component == ComponentType::F32 && !attribute.normalized(),
            "accessor {accessor} has components of type {component:?}, the Draco attribute {stored:?}"
        );
        return Ok(bytemuck::cast_slice(&attribute.read_f32s(points, width)).to_vec());
    }
    draco_values(attribute, width * component.size(), points)
}

/// The bytes of an attribute's values, `size` for each point.
fn draco_values(attribute: &PointAttribute, size: usize, points: usize) -> Result<Vec<u8>> {
    let stride = usize::try_from(attribute.byte_stride()).context("its stride is negative")?;
    let data = attribute.buffer().data();
    let mut bytes = Vec::with_capacity(points * size);
    for point in 0..points {
        let value = attribute.mapped_index(PointIndex(point as u32)).0 as usize;
        let at = value.checked_mul(stride);
        let found = at.and_then(|at| data.get(at..at.checked_add(size)?));
        bytes.extend_from_slice(found.with_context(|| format!("point {point} has no value"))?);
    }
    Ok(bytes)
}

/// An accessor of triangle corners without data.
fn index_accessor() -> Accessor {
    Accessor {
        buffer_view: None,
        byte_offset: None,
        count: USize64(0),
        component_type: Checked::Valid(GenericComponentType(ComponentType::U32)),
        extensions: None,
        extras: json::Extras::default(),
        type_: Checked::Valid(json::accessor::Type::Scalar),
        min: None,
        max: None,
        name: None,
        normalized: false,
        sparse: None,
    }
}

/// Gives an accessor tightly packed data of its own.
fn fill(
    root: &mut Root,
    buffers: &mut Vec<Cow<'_, [u8]>>,
    accessor: usize,
    count: usize,
    bytes: Vec<u8>,
) -> Result<()> {
    let byte_length = USize64(bytes.len() as u64);
    let buffer = append(root, buffers, bytes);
    root.buffer_views.push(buffer::View {
        buffer,
        byte_length,
        byte_offset: None,
        byte_stride: None,
        name: None,
        target: None,
        extensions: None,
        extras: json::Extras::default(),
    });
    let view = Index::new(u32::try_from(root.buffer_views.len() - 1)?);
    let into = &mut root.accessors[accessor];
    into.buffer_view = Some(view);
    into.byte_offset = None;
    into.count = USize64(count as u64);
    into.sparse = None;
    Ok(())
}

/// The decoders of untrusted streams by themselves, for fuzzing (crates/scene/fuzz).
pub mod streams {
    use anyhow::Result;

    use super::{MeshoptView, draco_stream, draco_values, meshopt_stream};

    /// Decodes a meshopt stream of `count` elements of `byte_stride` bytes, with the names of mode and filter that glTF
    /// has.
    ///
    /// # Errors
    /// When the stream, the stride, the mode or the filter is not possible.
    pub fn meshopt(mode: &str, filter: &str, count: usize, byte_stride: usize, source: &[u8]) -> Result<Vec<u8>> {
        let stream = MeshoptView {
            buffer: 0,
            byte_offset: 0,
            byte_length: source.len() as u64,
            byte_stride,
            count,
            mode: mode.to_owned(),
            filter: filter.to_owned(),
        };
        meshopt_stream(&stream, source)
    }

    /// Decodes a Draco mesh of at most `limit` bytes with the values of all its attributes; returns its size in bytes.
    ///
    /// # Errors
    /// When the stream is not possible, or too large.
    pub fn draco(source: &[u8], limit: u64) -> Result<u64> {
        let (mesh, bytes) = draco_stream(source, limit)?;
        anyhow::ensure!(bytes <= limit, "the mesh has {bytes} bytes");
        for id in 0..mesh.num_attributes() {
            let attribute = mesh.attribute(id);
            draco_values(attribute, attribute.byte_stride().unsigned_abs() as usize, mesh.num_points())?;
        }
        Ok(bytes)
    }

    /// Decodes a KTX2 file with Basis Universal data; returns width and height.
    ///
    /// # Errors
    /// When the file is not possible.
    pub fn ktx2(source: &[u8]) -> Result<[u32; 2]> {
        crate::pictures::decode_ktx2(String::new(), source).map(|image| [image.width, image.height])
    }
}
