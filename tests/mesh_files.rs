//! STL and PLY files: geometry, orientation, colours, and what is broken.
//!
//! Read docs/scene-input.md.

#![allow(clippy::unwrap_used, reason = "a test may stop where it stands")]

use etalon::scene::{LoadOptions, Scene, load};
use glam::DVec3;

fn loaded(name: &str, bytes: &[u8]) -> anyhow::Result<Scene> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    load(&path, &LoadOptions::default())
}

const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 2.0]];

fn stl_text() -> Vec<u8> {
    let corners: String = TRIANGLE.iter().map(|[x, y, z]| format!("vertex {x} {y} {z}\n")).collect();
    format!("solid t\nfacet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\nendsolid t\n").into_bytes()
}

fn stl_binary() -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend(1_u32.to_le_bytes());
    bytes.extend([0.0_f32; 3].iter().chain(TRIANGLE.as_flattened()).flat_map(|value| value.to_le_bytes()));
    bytes.extend([0, 0]);
    bytes
}

#[test]
fn stl_has_z_up_in_text_and_in_binary() {
    for bytes in [stl_text(), stl_binary()] {
        let scene = loaded("part.stl", &bytes).unwrap();
        assert_eq!((scene.meshes[0].positions.len(), scene.meshes[0].indices.len()), (3, 3));
        let top = scene.instances[0].world_from_object.transform_point3(DVec3::Z * 2.0);
        assert!(top.distance(DVec3::Y * 2.0) < 1e-12, "{top}");
    }
}

fn ply(faces: &str) -> String {
    let count = faces.lines().count();
    format!(
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n\
         property uchar green\nproperty uchar blue\nelement face {count}\nproperty list uchar int vertex_indices\nend_header\n\
         0 0 0 255 0 0\n1 0 0 0 255 0\n1 1 0 0 0 255\n0 1 0 188 188 188\n{faces}"
    )
}

#[test]
fn ply_has_polygons_and_colours() {
    let scene = loaded("square.ply", ply("4 0 1 2 3\n").as_bytes()).unwrap();
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.indices.len(), 6);
    let colour = |position: [f32; 3]| {
        let at = mesh.positions.iter().position(|p| *p == position).unwrap();
        mesh.colors[at]
    };
    assert_eq!(colour([0.0, 0.0, 0.0]), [1.0, 0.0, 0.0, 1.0]);
    // Byte 188 of sRGB is half of linear white.
    assert!((colour([0.0, 1.0, 0.0])[1] - 0.5).abs() < 0.005);
}

#[test]
fn a_cloud_of_points_is_drawn() {
    let scene = loaded("cloud.ply", ply("").as_bytes()).unwrap();
    assert!(scene.meshes[0].indices.len() >= 4 * 8 * 3, "{} indices", scene.meshes[0].indices.len());
}

#[test]
fn broken_files_are_one_sentence() {
    let refusal = |name: &str, bytes: &[u8]| format!("{:#}", loaded(name, bytes).map(|_| ()).expect_err("it loads"));
    assert!(refusal("a.ply", ply("3 0 1 9\n").as_bytes()).contains("face 0 names vertex 9, but there are 4"));
    assert!(refusal("a.ply", b"ply\nformat ascii 1.0\n").contains("it cannot be read as PLY"));
    let mut huge = stl_binary();
    huge[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(refusal("a.stl", &huge).contains("it cannot be read as STL"));
    let options = LoadOptions { variant: Some("x".to_owned()), ..LoadOptions::default() };
    let said = format!("{:#}", load("a.stl".as_ref(), &options).map(|_| ()).expect_err("it loads"));
    assert!(said.contains("only glTF files have scenes and variants"), "{said}");
}
