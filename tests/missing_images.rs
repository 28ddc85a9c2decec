//! Images that are missing or broken: the file is refused, or a checker stands in each one's place with a warning.
#![allow(clippy::unwrap_used, reason = "a test may stop where it stands")]

use std::path::Path;

use etalon::scene::{self, AmbientLight, Image, LoadOptions, MissingImages, Prune, REPLACED, Scene, Source};
use etalon_testing::gltf_builder::{Builder, png};
use serde_json::{Value, json};

const CHECKER: LoadOptions = LoadOptions {
    time: None,
    prune: Prune::Nothing,
    scene: None,
    variant: None,
    missing: MissingImages::Checker,
    animation: None,
    hide: Vec::new(),
    only: Vec::new(),
    key_light: None,
};

/// A triangle whose material has a sound base colour image, and this one as emission.
fn with_image(image: impl FnOnce(&mut Builder) -> Value) -> Builder {
    let mut b = Builder::new();
    let positions = b.triangle();
    let uvs = b.floats("VEC2", &[0.0, 1.0, 1.0, 1.0, 0.0, 0.0]);
    let view = b.view(&png(2, 1, [9, 8, 7, 255]), None);
    b.push("images", json!({ "bufferView": view, "mimeType": "image/png" }));
    let image = image(&mut b);
    b.push("images", image);
    for source in 0..2 {
        b.push("textures", json!({ "source": source }));
    }
    b.push(
        "materials",
        json!({
            "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } },
            "emissiveTexture": { "index": 1 }, "emissiveFactor": [1, 1, 1],
        }),
    );
    let attributes = json!({ "POSITION": positions, "TEXCOORD_0": uvs });
    let mesh = b.mesh(json!({ "attributes": attributes, "material": 0 }));
    b.root(json!({ "mesh": mesh }));
    b
}

/// An image in a format.
fn encoded(format: image::ImageFormat) -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    let picture = image::RgbImage::from_fn(40, 40, |x, y| image::Rgb([x as u8, y as u8, (x * y) as u8]));
    picture.write_to(&mut out, format).unwrap();
    out.into_inner()
}

/// Images that cannot be read, and a part of the cause.
fn broken() -> Vec<(&'static str, Vec<u8>, &'static str)> {
    let cut = |format| {
        let mut bytes = encoded(format);
        bytes.truncate(bytes.len() / 2);
        bytes
    };
    let mut flipped = encoded(image::ImageFormat::Png);
    let middle = flipped.len() / 2;
    flipped[middle] ^= 0x55;
    vec![
        ("a PNG that ends early", cut(image::ImageFormat::Png), "the picture cannot be decoded"),
        ("a PNG with a wrong byte", flipped, "the picture cannot be decoded"),
        (
            "a JPEG that is its header",
            encoded(image::ImageFormat::Jpeg)[..30].to_vec(),
            "the picture cannot be decoded",
        ),
        ("a WebP that ends early", cut(image::ImageFormat::WebP), "the picture cannot be decoded"),
        ("a KTX2 file that ends early", b"\xabKTX 20\xbb\r\n\x1a\n and so on".to_vec(), "the KTX2 header ends early"),
        ("a GIF as PNG", b"GIF89a\x01\0\x01\0\0\0\0;".to_vec(), "the data is not PNG, JPEG, WebP or KTX2"),
        ("nothing", Vec::new(), "the data is not PNG, JPEG, WebP or KTX2"),
    ]
}

fn texel(image: &Image, x: u32, y: u32) -> [u8; 4] {
    let at = 4 * (y * image.width + x) as usize;
    image.rgba[at..at + 4].try_into().unwrap()
}

/// Eight by eight squares of eight texels a side, in two colours, the first of them in the corner.
#[track_caller]
fn assert_checker(image: &Image, colors: [[u8; 4]; 2]) {
    assert_eq!([image.width, image.height], [64, 64]);
    for (x, y) in (0..64).flat_map(|y| (0..64).map(move |x| (x, y))) {
        assert_eq!(texel(image, x, y), colors[((x / 8 + y / 8) % 2) as usize], "{x}, {y}");
    }
}

const COLORS: [[u8; 4]; 2] = [[255, 0, 255, 255], [0, 0, 0, 255]];

/// Refused with image and cause; or read with one warning of both.
fn check(path: &Path, what: &str, image: &str, cause: &str) -> Scene {
    let refused = scene::load(path, &LoadOptions::default()).expect_err(what);
    let said = format!("{refused:#}");
    assert!(said.contains(&format!("{image}: ")) && said.contains(cause) && !said.contains('\n'), "{what}: {said}");
    let scene = scene::load(path, &CHECKER).unwrap_or_else(|error| panic!("{what}: {error:#}"));
    let [warning] = &scene.warnings[..] else { panic!("{what}: {:?}", scene.warnings) };
    let starts = format!("{image} cannot be read (");
    let is_whole = warning.contains(&starts) && warning.contains(cause) && warning.ends_with(&format!("): {REPLACED}"));
    assert!(is_whole && !warning.contains('\n'), "{what}: {warning}");
    eprintln!("{warning}");
    scene
}

#[test]
fn checkers_stand_in_for_images_of_gltf_files() {
    let folder = tempfile::tempdir().unwrap();
    for (what, bytes, cause) in broken() {
        let b = with_image(|b| {
            let view = b.view(&bytes, None);
            json!({ "bufferView": view, "mimeType": "image/png", "name": "leaf" })
        });
        let mut scene = check(&b.save_glb(folder.path()), what, "image 1 \"leaf\"", cause);
        let material = &scene.materials[0];
        let [base, emissive] = [material.base_color_texture, material.emissive_texture].map(|t| t.unwrap().image);
        assert_eq!(texel(&scene.images[base], 1, 0), [9, 8, 7, 255], "{what}");
        assert_checker(&scene.images.swap_remove(emissive), COLORS);
        // The same bytes in a file of their own.
        std::fs::write(folder.path().join("leaf 1.png"), &bytes).unwrap();
        let b = with_image(|_| json!({ "uri": "leaf%201.png" }));
        check(&b.save_glb(folder.path()), what, "image 1 \"leaf%201.png\"", cause);
    }
    let missing = with_image(|_| json!({ "uri": "gone.png" }));
    check(&missing.save_glb(folder.path()), "a missing file", "image 1 \"gone.png\"", "no such file");
}

/// The two images of a file, of which the second is not read.
#[test]
fn a_broken_image_that_nothing_needs_is_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = with_image(|_| json!({ "uri": "gone.png" }));
    b.json["materials"][0].as_object_mut().unwrap().remove("emissiveTexture");
    let path = b.save_glb(folder.path());
    for prune in [Prune::Nothing, Prune::Unused(AmbientLight::Present)] {
        assert!(scene::load(&path, &LoadOptions { prune, ..LoadOptions::default() }).is_err());
        let scene = scene::load(&path, &LoadOptions { prune, ..CHECKER }).unwrap();
        assert_eq!(scene.images.len(), 1);
        let [warning] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
        assert!(warning.ends_with("; nothing that is drawn needs it") && warning.contains("gone.png"), "{warning}");
    }
}

/// Colours are magenta; factors are kept or halved; normals do not turn away.
#[test]
fn a_checker_is_one_of_what_the_image_was_for() {
    let folder = tempfile::tempdir().unwrap();
    let data = [[255; 4], [128, 128, 128, 255]];
    let normals = [[128, 128, 255, 255], [166, 128, 249, 255]];
    for (material, colors) in [
        (json!({ "pbrMetallicRoughness": { "metallicRoughnessTexture": { "index": 1 } } }), data),
        (json!({ "normalTexture": { "index": 1 } }), normals),
        (json!({ "normalTexture": { "index": 1 }, "occlusionTexture": { "index": 1 } }), data),
        (json!({ "occlusionTexture": { "index": 1 }, "emissiveTexture": { "index": 1 } }), COLORS),
    ] {
        let mut b = with_image(|_| json!({ "uri": "gone.png" }));
        b.json["materials"][0] = material;
        let scene = scene::load(&b.save_glb(folder.path()), &CHECKER).unwrap();
        assert_eq!(scene.images.len(), 1);
        assert_checker(&scene.images[0], colors);
    }
    let [x, y, z] = [166.0, 128.0, 249.0].map(|byte: f64| byte / 127.5 - 1.0);
    assert!((x * x + y * y + z * z - 1.0).abs() < 0.01, "a unit normal");
}

#[test]
fn moments_of_an_animated_scene_share_a_checker() {
    let folder = tempfile::tempdir().unwrap();
    let path = with_image(|_| json!({ "uri": "gone.png" })).save_glb(folder.path());
    let mut source = Source::open(&path, CHECKER).unwrap();
    let [first, second] = [Some(0.0), Some(1.0)].map(|time| source.at(time).unwrap());
    assert_eq!(first.images[1].rgba.mark(), second.images[1].rgba.mark());
    assert_checker(&second.images[1], COLORS);
}

#[test]
fn checkers_stand_in_for_images_of_obj_files() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    let triangle = "mtllib m.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";
    write("scene.obj", triangle.as_bytes());
    write("sound.png", &png(64, 64, [255, 0, 255, 255]));
    let path = folder.path().join("scene.obj");
    let named = |name: &str| format!("the texture {}", folder.path().join(name).display());
    for (what, bytes, cause) in broken() {
        write("broken.png", &bytes);
        write("m.mtl", b"newmtl m\nmap_Kd broken.png\n");
        let scene = check(&path, what, &named("broken.png"), cause);
        assert_checker(&scene.images[0], COLORS);
    }
    write("m.mtl", b"newmtl m\nmap_Kd gone.png\n");
    assert_checker(&check(&path, "colour", &named("gone.png"), "no such file").images[0], COLORS);
    write("m.mtl", b"newmtl m\nnorm gone.png\n");
    check(&path, "normals", &named("gone.png"), "no such file");
    // Opacity is of squares, too, and nothing is cut out.
    write("m.mtl", b"newmtl m\nmap_Kd sound.png\nmap_d gone.png\n");
    let scene = check(&path, "opacity", &named("gone.png"), "no such file");
    assert_checker(&scene.images[0], [[255, 0, 255, 255], [255, 0, 255, 128]]);
    write("m.mtl", b"newmtl m\nmap_Kd gone.png\nmap_d sound.png\n");
    let scene = check(&path, "colour under opacity", &named("gone.png"), "no such file");
    assert_checker(&scene.images[0], [[255, 0, 255, 170], [0, 0, 0, 170]]);
}
