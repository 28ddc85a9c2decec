//! Compressed glTF files: meshopt streams, Draco meshes and Basis Universal pictures give what the plain file has.
//!
//! Read docs/decisions/compression.md. Meshes are compressed here by the encoders of the same crates; pictures were
//! compressed once by the reference encoder (Basis Universal 1.15), and what the reference transcoder makes of them
//! stands beside them.

#![allow(clippy::unwrap_used, reason = "a test may stop where it stands")]

use std::path::Path;

use draco_core::{
    DataType, EncoderBuffer, EncoderOptions, FaceIndex, GeometryAttributeType, Mesh as DracoMesh, MeshEncoder,
    PointAttribute, PointIndex,
};
use etalon::scene::{LoadOptions, Mesh, Prune, Scene, load};
use etalon_testing::gltf_builder::{Builder, UNSIGNED_INT, base64, f32s};
use meshoptimizer_rs::Workspace;
use meshoptimizer_rs::codec::{
    ExpMode, IndexEncoding, VertexEncoding, encode_filter_exp, encode_filter_oct, encode_index_buffer,
    encode_index_sequence, encode_vertex_buffer,
};
use serde_json::{Value, json};

/// 8x8 texels (32 x, 32 y, 128, 255 − 16 x) as ETC1S in KTX2.
const ETC1S: &str = "q0tUWCAyMLsNChoKAAAAAAEAAAAIAAAACAAAAAAAAAAAAAAAAQAAAAEAAAABAAAAaAAAADwAAACkAAAAJAAAAMgAAAAAAAAAogAAAAAAAABqAQ\
    AAAAAAAAMAAAAAAAAAAAAAAAAAAAA8AAAAAAAAAAIAOACjAQIAAwMAAAAAAAAAAAAAAAA/AAAAAAAAAAAA/////0AAPw8AAAAAAAAAAP////8f\
    AAAAS1RYd3JpdGVyAEJhc2lzIFVuaXZlcnNhbCAxLjE1AAAGAAUANAAAABUAAAAxAAAAAAAAAAAAAAAAAAAAAgAAAAIAAAABAAAAEcCEAAEAAA\
    AQRAsSBIgBAAAAAAg6X4b4DGBKAAAAAAAAaTZAAKIACAAAAEDIIP2CHZEpB9zY2NgAqErVB6BS/wegVP+HqlT/BwDBRAAAAAAAAJLqv0IBMAFA\
    AAAAAAK5GAERAgQAAABBBF1wglMUACYABAAAAAAQgQA7YQ4=";

/// What the reference transcoder makes of [`ETC1S`].
const ETC1S_TEXELS: &str = "AABR/wAAUfAcHG7eHBxuypAUZ8KQFGeupCh7nKQoe4gcHG7/HBxu8Bwcbt42NojKpCh7wqQoe66kKHuctjqNiDY2iP82NojwNjaI3lNTpcq2Oo\
    3CtjqNrrY6jZzKTqGIU1Ol/1NTpfBTU6XeU1OlyspOocLKTqGuyk6hnMpOoYgUkGf/FJBn8Cike94opHvKi4tawouLWq6Li1qci4taiCike/8o\
    pHvwKKR73jq2jcqoqHfCqKh3rqiod5yoqHeIOraN/zq2jfA6to3eTsqhyqiod8LCwpGuwsKRnMLCkYhOyqH/Tsqh8E7Kod5OyqHKwsKRwsLCka\
    7f366c39+uiA==";

/// The same texels as UASTC, compressed by Zstandard, in KTX2.
const UASTC: &str = "q0tUWCAyMLsNChoKAAAAAAEAAAAIAAAACAAAAAAAAAAAAAAAAQAAAAEAAAACAAAAaAAAACwAAACUAAAAJAAAAAAAAAAAAAAAAAAAAAAAAAC4AA\
    AAAAAAADcAAAAAAAAAQAAAAAAAAAAsAAAAAAAAAAIAKACmAQIAAwMAAAAAAAAAAAAAAAB/AwAAAAAAAAAA/////x8AAABLVFh3cml0ZXIAQmFz\
    aXMgVW5pdmVyc2FsIDEuMTUAACi1L/0gQHUBACQCKBFJVAAD/8cRMlR2mLrc/igRiVR8Af/nE1YAf/3JVnx9/QMAoOihDGm2OQY=";

/// What the reference transcoder makes of [`UASTC`].
const UASTC_TEXELS: &str = "AACD/x8Ag/BBAIPfYQCDz4MAg76hAIOuwQCDnt8Ag44AH4P/Hx+D8EEfg99hH4PPgx+DvqEfg67BH4Oe3x+DjgBBg/8fQYPwQUGD32FBg8+DQY\
    O+oUGDrsFBg57fQYOOAGGD/x9hg/BBYYPfYWGDz4Nhg76hYYOuwWGDnt9hg44Ag4P/H4OD8EGDg99hg4PPg4ODvqGDg67Bg4Oe34ODjgChg/8f\
    oYPwQaGD32Ghg8+DoYO+oaGDrsGhg57foYOOAMGD/x/Bg/BBwYPfYcGDz4PBg76hwYOuwcGDnt/Bg44A34P/H9+D8EHfg99h34PPg9+DvqHfg6\
    7B34Oe39+Djg==";

/// A band of triangles around an axis, with normals and texture coordinates.
struct Band {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    indices: Vec<u32>,
}

const AROUND: u32 = 24;
const UP: u32 = 6;

fn band() -> Band {
    let mut band = Band { positions: vec![], normals: vec![], uvs: vec![], indices: vec![] };
    for y in 0..=UP {
        for x in 0..=AROUND {
            let [u, v] = [x as f32 / AROUND as f32, y as f32 / UP as f32];
            let (sin, cos) = (u * std::f32::consts::TAU).sin_cos();
            let radius = 1.0 + 0.2 * (7.0 * v).sin();
            band.positions.push([radius * cos, 2.0 * v, radius * sin]);
            band.normals.push([cos, 0.0, sin]);
            band.uvs.push([u, v]);
        }
    }
    for y in 0..UP {
        for x in 0..AROUND {
            let a = y * (AROUND + 1) + x;
            let b = a + AROUND + 1;
            band.indices.extend([a, b, a + 1, a + 1, b, b + 1]);
        }
    }
    band
}

/// Loads a built file with nothing left out, so that texture coordinates stay.
fn loaded(builder: &Builder) -> anyhow::Result<Scene> {
    let folder = tempfile::tempdir().unwrap();
    let options = LoadOptions { prune: Prune::Nothing, ..LoadOptions::default() };
    load(&builder.save_glb(folder.path()), &options)
}

fn mesh(builder: &Builder) -> Mesh {
    let scene = loaded(builder).unwrap();
    assert_eq!(scene.warnings, Vec::<String>::new());
    scene.meshes[0].clone()
}

fn u32s(values: &[u32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// A file with one primitive of these accessors.
fn with_primitive(builder: &mut Builder, attributes: Value, indices: usize) {
    let mesh = builder.mesh(json!({ "attributes": attributes, "indices": indices }));
    builder.root(json!({ "mesh": mesh }));
}

fn plain() -> Builder {
    let band = band();
    let mut builder = Builder::new();
    let positions = builder.floats("VEC3", band.positions.as_flattened());
    let normals = builder.floats("VEC3", band.normals.as_flattened());
    let uvs = builder.floats("VEC2", band.uvs.as_flattened());
    let indices = builder.accessor(&u32s(&band.indices), UNSIGNED_INT, "SCALAR", band.indices.len());
    let attributes = json!({ "POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs });
    with_primitive(&mut builder, attributes, indices);
    builder
}

/// Adds a view whose data is only in a compressed stream; its fallback buffer 1 has no bytes.
fn compressed_view(builder: &mut Builder, stream: &[u8], compression: Value) -> usize {
    let source = builder.view(stream, None);
    let at = builder.json["bufferViews"][source]["byteOffset"].clone();
    let mut extension = compression;
    extension["buffer"] = json!(0);
    extension["byteOffset"] = at;
    extension["byteLength"] = json!(stream.len());
    let size = extension["count"].as_u64().unwrap() * extension["byteStride"].as_u64().unwrap();
    builder.push(
        "bufferViews",
        json!({ "buffer": 1, "byteLength": size, "extensions": { "EXT_meshopt_compression": extension } }),
    )
}

/// Declares the buffers and the extension, once all bytes are there.
fn finish_meshopt(builder: &mut Builder) {
    builder.json["buffers"] = json!([
        { "byteLength": builder.bytes.len() },
        { "byteLength": 1 << 20, "extensions": { "EXT_meshopt_compression": { "fallback": true } } },
    ]);
    builder.json["extensionsRequired"] = json!(["EXT_meshopt_compression"]);
    builder.json["extensionsUsed"] = json!(["EXT_meshopt_compression", "KHR_mesh_quantization"]);
}

/// The band by vertex and index streams; with `filters` normals and texture coordinates go through lossy filters.
fn by_meshopt(filters: bool, triangles: bool) -> Builder {
    let (band, mut work) = (band(), Workspace::default());
    let count = band.positions.len();
    let mut builder = Builder::new();
    let encoding = VertexEncoding::new(0, 0).unwrap();
    let mut accessor =
        |builder: &mut Builder, bytes: &[u8], stride: usize, filter: &str, component: u32, shape: &str| {
            let stream = encode_vertex_buffer(bytes, count, stride, encoding, &mut work).unwrap();
            let compression = json!({ "count": count, "byteStride": stride, "mode": "ATTRIBUTES", "filter": filter });
            let view = compressed_view(builder, &stream, compression);
            let normalized = component != 5126;
            builder.push(
            "accessors",
            json!({
                "bufferView": view, "componentType": component, "type": shape, "count": count, "normalized": normalized
            }),
        )
        };
    let positions = accessor(&mut builder, &f32s(band.positions.as_flattened()), 12, "NONE", 5126, "VEC3");
    let (normals, uvs) = if filters {
        let normals: Vec<f32> = band.normals.iter().flat_map(|[x, y, z]| [*x, *y, *z, 0.0]).collect();
        let oct = encode_filter_oct(count, 8, 12, &normals, &mut Workspace::default()).unwrap();
        let uvs = band.uvs.as_flattened();
        let exp = encode_filter_exp(count, 8, 15, uvs, ExpMode::Separate, &mut Workspace::default()).unwrap();
        (
            accessor(&mut builder, &oct, 8, "OCTAHEDRAL", 5122, "VEC3"),
            accessor(&mut builder, &exp, 8, "EXPONENTIAL", 5126, "VEC2"),
        )
    } else {
        (
            accessor(&mut builder, &f32s(band.normals.as_flattened()), 12, "NONE", 5126, "VEC3"),
            accessor(&mut builder, &f32s(band.uvs.as_flattened()), 8, "NONE", 5126, "VEC2"),
        )
    };
    let (mode, stream) = if triangles {
        ("TRIANGLES", encode_index_buffer(&band.indices, IndexEncoding::DEFAULT, &mut Workspace::default()))
    } else {
        ("INDICES", encode_index_sequence(&band.indices, IndexEncoding::DEFAULT, &mut Workspace::default()))
    };
    let count = band.indices.len();
    let view =
        compressed_view(&mut builder, &stream.unwrap(), json!({ "count": count, "byteStride": 4, "mode": mode }));
    let indices = builder.push(
        "accessors",
        json!({ "bufferView": view, "componentType": UNSIGNED_INT, "type": "SCALAR", "count": count }),
    );
    let attributes = json!({ "POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs });
    with_primitive(&mut builder, attributes, indices);
    finish_meshopt(&mut builder);
    builder
}

/// Triangles with their first corner moved to the front that has the smallest index: streams may turn a triangle.
fn turned(indices: &[u32]) -> Vec<[u32; 3]> {
    let turn = |[a, b, c]: [u32; 3]| match a.min(b).min(c) {
        least if least == a => [a, b, c],
        least if least == b => [b, c, a],
        _ => [c, a, b],
    };
    indices.as_chunks::<3>().0.iter().map(|corners| turn(*corners)).collect()
}

fn largest<const N: usize>(a: &[[f32; N]], b: &[[f32; N]]) -> f32 {
    assert_eq!(a.len(), b.len());
    // The largest of numbers does not see NaN.
    assert!(a.as_flattened().iter().chain(b.as_flattened()).all(|x| x.is_finite()));
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn meshopt_streams_give_the_geometry_of_the_plain_file() {
    let plain = mesh(&plain());
    for triangles in [true, false] {
        let got = mesh(&by_meshopt(false, triangles));
        assert_eq!(got.positions[..], plain.positions[..]);
        assert_eq!(got.normals[..], plain.normals[..]);
        assert_eq!(got.uvs[0][..], plain.uvs[0][..]);
        assert_eq!(turned(&got.indices), turned(&plain.indices));
    }
}

#[test]
fn meshopt_filters_stay_within_their_quantisation() {
    let plain = mesh(&plain());
    let got = mesh(&by_meshopt(true, true));
    assert_eq!(got.positions[..], plain.positions[..]);
    // Twelve bits for two coordinates of the octahedron: half a step each, and the mapping stretches by at most √3.
    let bound = 3.0_f32.sqrt() / f32::from(1_u16 << 11);
    assert!(largest(&got.normals, &plain.normals) <= bound, "{}", largest(&got.normals, &plain.normals));
    // Fifteen bits with sign: half a step at the exponent of the value.
    assert!(largest(&got.uvs[0], &plain.uvs[0]) <= 0.5 / f32::from(1_u16 << 13));
}

/// The band as a Draco mesh; `bits` of 0 leave floats as they are.
fn by_draco(sequential: bool, bits: i32) -> Builder {
    let band = band();
    let mut mesh = DracoMesh::new();
    mesh.set_num_points(band.positions.len());
    let mut add = |kind: GeometryAttributeType, width: u8, values: &[f32]| {
        let mut attribute = PointAttribute::new();
        attribute.init(kind, width, DataType::Float32, false, band.positions.len());
        attribute.buffer_mut().write(0, &f32s(values));
        mesh.add_attribute(attribute)
    };
    let ids = [
        add(GeometryAttributeType::Position, 3, band.positions.as_flattened()),
        add(GeometryAttributeType::Normal, 3, band.normals.as_flattened()),
        add(GeometryAttributeType::TexCoord, 2, band.uvs.as_flattened()),
    ];
    mesh.set_num_faces(band.indices.len() / 3);
    for (face, corners) in band.indices.as_chunks::<3>().0.iter().enumerate() {
        mesh.set_face(FaceIndex(face as u32), corners.map(PointIndex));
    }
    let mut options = EncoderOptions::new();
    options.set_encoding_method(i32::from(!sequential));
    for id in ids {
        options.set_attribute_quantization(id, bits);
    }
    let mut encoder = MeshEncoder::new();
    encoder.set_mesh(mesh);
    let mut buffer = EncoderBuffer::new();
    let info = encoder.encode_with_info(&options, &mut buffer).unwrap();
    let unique = |source: i32| info.attributes.iter().find(|a| a.source_attribute_id == source).unwrap().unique_id;

    let mut builder = Builder::new();
    let view = builder.view(buffer.data(), None);
    let points = info.num_encoded_points;
    let mut bare = |component: u32, shape: &str, count: usize| {
        builder.push("accessors", json!({ "componentType": component, "type": shape, "count": count }))
    };
    let accessors = [bare(5126, "VEC3", points), bare(5126, "VEC3", points), bare(5126, "VEC2", points)];
    let indices = bare(UNSIGNED_INT, "SCALAR", band.indices.len());
    let names = ["POSITION", "NORMAL", "TEXCOORD_0"];
    let by_name = |values: [Value; 3]| Value::Object(names.map(str::to_owned).into_iter().zip(values).collect());
    let primitive = json!({
        "attributes": by_name(accessors.map(Value::from)),
        "indices": indices,
        "extensions": { "KHR_draco_mesh_compression": {
            "bufferView": view,
            "attributes": by_name(ids.map(|id| unique(id).into())),
        } },
    });
    let mesh = builder.mesh(primitive);
    builder.root(json!({ "mesh": mesh }));
    builder.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    builder.json["extensionsUsed"] = json!(["KHR_draco_mesh_compression"]);
    builder
}

/// Position, normal and texture coordinates of every corner, triangle by triangle.
fn corners(mesh: &Mesh) -> Vec<[f32; 8]> {
    let corner = |&i: &u32| {
        let (p, n, uv) = (mesh.positions[i as usize], mesh.normals[i as usize], mesh.uvs[0][i as usize]);
        [p[0], p[1], p[2], n[0], n[1], n[2], uv[0], uv[1]]
    };
    mesh.indices.iter().map(corner).collect()
}

/// Largest difference between each corner of `a` and the nearest of `b`.
fn farthest(a: &[[f32; 8]], b: &[[f32; 8]]) -> f32 {
    let distance = |x: &[f32; 8], y: &[f32; 8]| x.iter().zip(y).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max);
    a.iter().map(|x| b.iter().map(|y| distance(x, y)).fold(f32::INFINITY, f32::min)).fold(0.0, f32::max)
}

#[test]
fn draco_meshes_give_the_geometry_of_the_plain_file() {
    let plain = corners(&mesh(&plain()));
    for sequential in [true, false] {
        // Without quantisation floats are stored as they are; the order of points and triangles is the encoder's.
        let exact = corners(&mesh(&by_draco(sequential, 0)));
        assert_eq!(exact.len(), plain.len(), "sequential {sequential}");
        assert_eq!(farthest(&exact, &plain), 0.0, "sequential {sequential}");
        assert_eq!(farthest(&plain, &exact), 0.0, "sequential {sequential}");
        let bits = 14;
        let near = corners(&mesh(&by_draco(sequential, bits)));
        assert_eq!(near.len(), plain.len());
        // Half a step of the largest side, 2.4 m, and the octahedron's stretch for normals.
        let bound = 2.4 / (1 << bits) as f32;
        assert!(farthest(&near, &plain) <= bound, "sequential {sequential}: {}", farthest(&near, &plain));
    }
}

/// A textured triangle whose picture is a KTX2 file.
fn by_basis(picture: &[u8]) -> Builder {
    let mut builder = Builder::new();
    let positions = builder.triangle();
    let uvs = builder.floats("VEC2", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let view = builder.view(picture, None);
    builder.push("images", json!({ "bufferView": view, "mimeType": "image/ktx2" }));
    builder.push("textures", json!({ "extensions": { "KHR_texture_basisu": { "source": 0 } } }));
    builder.push("materials", json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }));
    let attributes = json!({ "POSITION": positions, "TEXCOORD_0": uvs });
    let mesh = builder.mesh(json!({ "attributes": attributes, "material": 0 }));
    builder.root(json!({ "mesh": mesh }));
    builder.json["extensionsRequired"] = json!(["KHR_texture_basisu"]);
    builder.json["extensionsUsed"] = json!(["KHR_texture_basisu"]);
    builder
}

/// Bytes of base64 text.
fn bytes_of(text: &str) -> Vec<u8> {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let digits: Vec<u32> =
        text.bytes().filter_map(|c| ALPHABET.iter().position(|&known| known == c)).map(|d| d as u32).collect();
    let mut bytes = Vec::new();
    for group in digits.chunks(4) {
        let word = (0..4).fold(0, |word, i| word << 6 | group.get(i).copied().unwrap_or(0));
        bytes.extend(&word.to_be_bytes()[1..group.len()]);
    }
    assert_eq!(base64(&bytes), text);
    bytes
}

#[test]
fn basis_universal_pictures_are_those_of_the_reference_transcoder() {
    for (picture, texels) in [(ETC1S, ETC1S_TEXELS), (UASTC, UASTC_TEXELS)] {
        let scene = loaded(&by_basis(&bytes_of(picture))).unwrap();
        assert_eq!([scene.images[0].width, scene.images[0].height], [8, 8]);
        assert_eq!(scene.images[0].rgba[..], bytes_of(texels)[..]);
    }
}

/// The sentence of a file that must not load.
fn refusal(builder: &Builder) -> String {
    format!("{:#}", loaded(builder).map(|_| ()).expect_err("it loads"))
}

#[test]
fn impossible_streams_are_named_with_their_place() {
    let change = |value: Value, key: &str| {
        let mut builder = by_meshopt(false, true);
        let view = builder.json["bufferViews"].as_array().unwrap().len() - 1;
        builder.json["bufferViews"][view]["extensions"]["EXT_meshopt_compression"][key] = value;
        (view, refusal(&builder))
    };
    for (value, key, cause) in [
        (json!("STRIPS"), "mode", "its mode \"STRIPS\" is unknown"),
        (json!("SHARP"), "filter", "its filter \"SHARP\" is unknown"),
        (json!(9), "buffer", "there is no buffer 9"),
        (json!(1 << 30), "byteLength", "its stream spans 1073741824 bytes"),
        (json!(7), "count", "7 elements of 4 bytes are not the view's"),
        (json!(12), "byteLength", "its stream cannot be decoded"),
    ] {
        let (view, said) = change(value, key);
        assert!(said.contains(&format!("buffer view {view}: EXT_meshopt_compression")), "{said}");
        assert!(said.contains(cause), "{said}");
    }

    let mut huge = by_meshopt(false, true);
    let last = huge.json["bufferViews"].as_array().unwrap().len() - 1;
    huge.json["bufferViews"][last]["byteLength"] = json!(4_u64 * 3_000_000_000);
    huge.json["bufferViews"][last]["extensions"]["EXT_meshopt_compression"]["count"] = json!(3_000_000_000_u64);
    let said = refusal(&huge);
    assert!(said.contains("larger than 2147483648 bytes"), "{said}");

    let draco = |key: &str, value: Value| {
        let mut builder = by_draco(false, 14);
        builder.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"][key] = value;
        refusal(&builder)
    };
    for (key, value, cause) in [
        ("bufferView", json!(3), "there is no buffer view 3"),
        ("attributes", json!({ "POSITION": 77 }), "POSITION: the data has no attribute 77"),
        ("attributes", json!({ "POSITION": 2 }), "has 3 components, the Draco attribute 2"),
    ] {
        let said = draco(key, value);
        assert!(said.contains("mesh 0 primitive 0: KHR_draco_mesh_compression"), "{said}");
        assert!(said.contains(cause), "{said}");
    }

    let said = refusal(&by_basis(&bytes_of(UASTC)[..70]));
    assert!(said.contains("image 0") && said.contains("KTX2 header"), "{said}");
    let mut wide = bytes_of(ETC1S);
    wide[20..24].copy_from_slice(&40_000_u32.to_le_bytes());
    let said = refusal(&by_basis(&wide));
    assert!(said.contains("40000x8 texels"), "{said}");
}

/// Every truncation, and bytes changed one by one, give a scene or a sentence.
#[test]
fn broken_streams_end_in_a_scene_or_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("broken.glb");
    let options = LoadOptions { prune: Prune::Nothing, ..LoadOptions::default() };
    let mut refused = 0;
    let mut try_file = |builder: &Builder| {
        std::fs::write(&path, builder.glb()).unwrap();
        refused += u32::from(load(Path::new(&path), &options).is_err());
    };
    let mut files = vec![by_meshopt(true, true), by_meshopt(false, false), by_draco(true, 14), by_draco(false, 11)];
    files.extend([by_basis(&bytes_of(ETC1S)), by_basis(&bytes_of(UASTC))]);
    for file in files {
        let bytes = file.bytes.len();
        for step in 0..300_usize {
            // A linear congruential generator spreads the places over the file.
            let at = step.wrapping_mul(2_654_435_761) % bytes;
            let mut broken = file.clone();
            broken.bytes[at] ^= [0xff, 0x01, 0x80][step % 3];
            try_file(&broken);
            if step % 10 == 0 {
                let mut cut = file.clone();
                cut.bytes[at..].fill(0);
                try_file(&cut);
            }
        }
    }
    assert!(refused > 100, "only {refused} files were refused");
}
