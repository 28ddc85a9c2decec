//! Pictures on disk: what is written comes back, what is damaged is refused with a sentence, nothing is left behind.

use std::fs;
use std::path::Path;

use etalon_image::exr::{encode_exr, read_channels, read_exr, write_exr};
use etalon_image::png::{decode_display, encode_png, read_display};
use etalon_image::{Aov, AovData, Picture, exr, file};

fn noise(seed: &mut u64) -> u64 {
    *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    *seed >> 33
}

fn hard_picture(width: u32, height: u32) -> Picture {
    let hard = [
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::from_bits(1),
        f32::MIN_POSITIVE,
        f32::MAX,
        -0.0,
        0.1,
        f32::from_bits(0xffc0_0001),
    ];
    let mut seed = 7;
    let mut picture = Picture::filled(width, height, [0.0; 4]);
    for (index, pixel) in picture.rgba.iter_mut().enumerate() {
        *pixel = [0, 1, 2, 3]
            .map(|c| if index % 3 == 0 { hard[(index + c) % hard.len()] } else { noise(&mut seed) as f32 * 1e-9 });
    }
    picture
}

fn bits(picture: &Picture) -> Vec<[u32; 4]> {
    picture.rgba.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

fn some_aovs(pixels: usize) -> Vec<Aov> {
    vec![
        Aov {
            name: "normal".into(),
            channels: ["X", "Y", "Z"].map(String::from).to_vec(),
            samples: AovData::F32((0..pixels * 3).map(|i| i as f32 * 0.5 - 1.0).collect()),
        },
        Aov {
            name: "material".into(),
            channels: vec!["id".into()],
            samples: AovData::U32((0..pixels as u32).map(|i| u32::MAX - i).collect()),
        },
    ]
}

#[test]
fn exr_round_trip_keeps_every_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    // 33 rows: two full blocks of 16 and a rest of 1.
    let picture = hard_picture(37, 33);
    let metadata = [("zebra".to_string(), "last".to_string()), ("command".to_string(), "render \u{e9}".to_string())];
    write_exr(&path, &picture, &some_aovs(37 * 33), &metadata).unwrap();
    let back = read_exr(&path).unwrap();
    assert_eq!((back.width, back.height), (37, 33));
    assert_eq!(bits(&back), bits(&picture));

    let channels = read_channels(&path).unwrap();
    let names: Vec<&str> = channels.list.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["A", "B", "G", "R", "material.id", "normal.X", "normal.Y", "normal.Z"]);
    assert_eq!(channels.list[4].1, AovData::U32((0..37 * 33u32).map(|i| u32::MAX - i).collect()));
    let AovData::F32(y) = &channels.list[6].1 else { panic!("normal.Y is not f32") };
    assert_eq!(y[..2], [-0.5, 1.0]); // samples 1 and 4 of i / 2 - 1
}

#[test]
fn exr_bytes_depend_on_the_input_alone() {
    let picture = hard_picture(20, 40);
    let mut metadata: Vec<(String, String)> =
        (0..12).map(|i| (format!("attribute{i}"), format!("{}", i * i))).collect();
    let first = encode_exr(&picture, &some_aovs(800), &metadata).unwrap();
    metadata.reverse();
    for _ in 0..4 {
        assert_eq!(first, encode_exr(&picture, &some_aovs(800), &metadata).unwrap());
    }
    let text = String::from_utf8_lossy(&first).into_owned();
    assert!(text.find("attribute0\0string\0").unwrap() < text.find("attribute11\0").unwrap());
    // A name longer than 31 bytes needs the flag in the version field.
    let long = [("a".repeat(40), "v".to_string())];
    let bytes = encode_exr(&picture, &[], &long).unwrap();
    assert_eq!(bytes[5] & 4, 4);
    assert_eq!(bits(&exr::decode_exr(&bytes).unwrap()), bits(&picture));
}

#[test]
fn exr_refuses_what_it_cannot_write() {
    let picture = Picture::filled(2, 2, [1.0; 4]);
    let short = Aov { name: "z".into(), channels: vec!["Z".into()], samples: AovData::F32(vec![0.0; 3]) };
    let error = format!("{:#}", encode_exr(&picture, &[short], &[]).unwrap_err());
    assert_eq!(error, "layer z has 3 samples, 2x2 pixels with 1 channels need 4");
    let twice = |name: &str| Aov { name: name.into(), channels: vec!["Z".into()], samples: AovData::U32(vec![0; 4]) };
    assert!(encode_exr(&picture, &[twice("z"), twice("z")], &[]).is_err());
    assert!(encode_exr(&picture, &[twice("ä z")], &[]).is_err());
    assert!(encode_exr(&picture, &[], &[("channels".into(), String::new())]).is_err());
    assert!(encode_exr(&Picture::default(), &[], &[]).is_err());
}

#[test]
fn damaged_files_are_refused_with_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.exr");
    let good = encode_exr(&hard_picture(19, 35), &some_aovs(19 * 35), &[("k".into(), "v".into())]).unwrap();
    for length in (0..good.len() - 1).step_by(7) {
        fs::write(&path, &good[..length]).unwrap();
        let error = format!("{:#}", read_exr(&path).unwrap_err());
        assert!(error.starts_with(&format!("reading {}: ", path.display())) && !error.contains('\n'), "{error}");
    }
    // Changed bytes may still decode; they must never panic or ask for absurd memory.
    let mut seed = 11;
    for round in 0..1500 {
        let mut bytes = good.clone();
        for _ in 0..=round % 3 {
            let near_header = if round % 2 == 0 { 700 } else { bytes.len() as u64 };
            let at = noise(&mut seed) % near_header.min(bytes.len() as u64);
            bytes[at as usize] = noise(&mut seed) as u8;
        }
        let _ = exr::decode_exr(&bytes);
    }
    let rgba: Vec<u8> = (0..64 * 64 * 4).map(|i| (i * 7 % 251) as u8).collect();
    let good = encode_png(64, 64, &rgba, true).unwrap();
    for length in (0..good.len() - 20).step_by(11) {
        assert!(decode_display(&good[..length]).is_err(), "{length} of {} bytes", good.len());
    }
    for _ in 0..500 {
        let mut bytes = good.clone();
        let at = noise(&mut seed) as usize % bytes.len();
        bytes[at] ^= 1 << (noise(&mut seed) % 8);
        let _ = decode_display(&bytes);
    }
}

#[test]
fn png_keeps_bytes_and_says_srgb() {
    let rgba: Vec<u8> = (0..31 * 17 * 4).map(|i| (i * 37 % 256) as u8).collect();
    let with = encode_png(31, 17, &rgba, true).unwrap();
    let flat: Vec<u8> = decode_display(&with).unwrap().rgba.concat();
    assert_eq!(flat, rgba);
    assert!(with.windows(5).any(|window| window == b"sRGB\0"));
    assert_eq!(with, encode_png(31, 17, &rgba, true).unwrap());

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    file::write(&path, &encode_png(31, 17, &rgba, false).unwrap()).unwrap();
    let back = read_display(&path).unwrap();
    assert_eq!((back.width, back.height), (31, 17));
    for (pixel, bytes) in back.rgba.iter().zip(rgba.chunks(4)) {
        assert_eq!(*pixel, [bytes[0], bytes[1], bytes[2], 255]);
    }
    assert!(encode_png(31, 18, &rgba, true).is_err());
}

#[test]
fn a_display_picture_with_too_many_pixels_is_refused() {
    // One bit a pixel, so that the file is small.
    let (width, height) = (16384, 8193);
    let mut bytes = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(::png::ColorType::Grayscale);
    encoder.set_depth(::png::BitDepth::One);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&vec![0; (width / 8 * height) as usize]).unwrap();
    writer.finish().unwrap();
    let error = decode_display(&bytes).unwrap_err().to_string();
    assert_eq!(error, "16384x8193 pixels are too many; 134217728 are the most that are read");
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("the folder is there");
    let mut names: Vec<String> = entries.flatten().map(|e| e.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn a_failed_write_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("nowhere/out.exr");
    let error = format!("{:#}", file::write(&missing, b"x").unwrap_err());
    let parent = folder.path().join("nowhere");
    assert_eq!(error, format!("writing {}: the folder {} does not exist", missing.display(), parent.display()));
    assert!(file::check_writable(&missing).is_err());
    // The target is a folder: renaming over it must not be tried.
    fs::create_dir(folder.path().join("taken.png")).unwrap();
    let taken = folder.path().join("taken.png");
    let error = format!("{:#}", file::write(&taken, b"x").unwrap_err());
    assert_eq!(error, format!("writing {}: it is a folder", taken.display()));
    assert!(file::check_writable(&taken).is_err());
    // A file where a folder should be.
    fs::write(folder.path().join("plain"), b"").unwrap();
    assert!(file::write(&folder.path().join("plain/out.png"), b"x").is_err());
    assert!(file::check_writable(&folder.path().join("plain/out.png")).is_err());
    file::check_writable(&folder.path().join("new.png")).unwrap();
    assert_eq!(names(folder.path()), ["plain", "taken.png"]);
}

#[test]
fn writing_replaces_whole_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.bin");
    file::write(&path, b"first and longer").unwrap();
    file::write(&path, b"second").unwrap();
    file::check_writable(&path).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"second");
    assert_eq!(names(folder.path()), ["out.bin"]);
    // A bare file name has an empty parent, which means the current folder.
    file::check_writable(Path::new("never-created-by-this-test.png")).unwrap();
    assert!(!Path::new("never-created-by-this-test.png").exists());
}

#[cfg(unix)]
#[test]
fn permissions_links_and_devices_are_as_for_ordinary_files() {
    use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
    let folder = tempfile::tempdir().unwrap();
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
    let ordinary = folder.path().join("ordinary");
    fs::write(&ordinary, b"").unwrap();
    let ours = folder.path().join("ours");
    file::write(&ours, b"x").unwrap();
    assert_eq!(mode(&ours), mode(&ordinary));
    fs::set_permissions(&ours, fs::Permissions::from_mode(0o640)).unwrap();
    file::write(&ours, b"y").unwrap();
    assert_eq!(mode(&ours), 0o640);
    let link = folder.path().join("link");
    symlink("ours", &link).unwrap();
    file::write(&link, b"through").unwrap();
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!(fs::read(&ours).unwrap(), b"through");
    // Only a link to the device: should the code ever rename, it is the link that suffers.
    let null = folder.path().join("null");
    symlink("/dev/null", &null).unwrap();
    file::write(&null, b"gone").unwrap();
    assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
}

#[test]
fn hashes_are_stable() {
    // XXH3 128 of the empty input, from the algorithm's own test vectors.
    assert_eq!(file::hash(b""), "99aa06d3014798d86001c324468d497f");
    assert_ne!(file::hash(b"a"), file::hash(b"b"));
}

#[test]
fn statistics_count_before_anything_clamps() {
    let mut picture = Picture::filled(2, 2, [1.0, 2.0, 3.0, 1.0]);
    picture.rgba[1] = [f32::NAN, f32::INFINITY, -1.0, 1.0];
    let found = picture.statistics();
    assert_eq!((found.nan, found.inf, found.negative), (1, 1, 1));
    assert_eq!((found.min, found.max), (-1.0, 3.0));
    assert_eq!(found.mean, 1.7); // (3 * 6 - 1) / 10
}

#[test]
fn exr_files_of_other_programs() {
    use ::exr::prelude::*;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.exr");
    let write = |names: &[&str], encoding: Encoding, half: bool, window: (i32, i32, usize, usize)| {
        let values = |offset: usize| -> Vec<f32> { (0..15 * 9).map(|i| (i + offset) as f32).collect() };
        let list = names.iter().enumerate().filter(|(_, name)| !name.is_empty()).map(|(index, &name)| {
            let samples = values(index * 200);
            let samples = if half {
                FlatSamples::F16(samples.into_iter().map(f16::from_f32).collect())
            } else {
                FlatSamples::F32(samples)
            };
            AnyChannel::new(Text::from(name), samples)
        });
        let channels = AnyChannels::sort(list.collect());
        let layer = Layer::new((15, 9), LayerAttributes::named("main"), encoding, channels);
        let bounds = IntegerBounds::new((window.0, window.1), (window.2, window.3));
        Image::empty(ImageAttributes::new(bounds)).with_layer(layer).write().to_file(&path).unwrap();
    };
    let expected = |i: usize| [i as f32, (i + 200) as f32, (i + 400) as f32, 1.0];
    let compressions = [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
        Compression::PXR24,
    ];
    for compression in compressions {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(8, 4))] {
            for half in [false, true] {
                let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
                write(&["R", "G", "B"], encoding, half, (0, 0, 15, 9));
                let back = read_exr(&path).unwrap();
                assert!((0..15 * 9).all(|i| back.rgba[i] == expected(i)), "{compression:?} {blocks:?} half {half}");
            }
        }
    }
    // Only a layer's channels: they are the picture all the same.
    write(&["View.R", "View.G", "View.B"], Encoding::FAST_LOSSLESS, false, (0, 0, 15, 9));
    assert_eq!(read_exr(&path).unwrap().rgba[7], expected(7));
    // Blender's passes, with the picture after others.
    let passes = ["View.AO.R", "View.AO.G", "View.AO.B", "View.Combined.R", "View.Combined.G", "View.Combined.B"];
    write(&passes, Encoding::FAST_LOSSLESS, false, (0, 0, 15, 9));
    assert_eq!(read_exr(&path).unwrap().rgba[7], [607.0, 807.0, 1007.0, 1.0]);
    write(&["Y", "", ""], Encoding::FAST_LOSSLESS, false, (0, 0, 15, 9));
    assert_eq!(read_exr(&path).unwrap().rgba[7], [7.0, 7.0, 7.0, 1.0]);
    // The display window begins one right of and two below the data, and ends beyond it.
    write(&["R", "G", "B"], Encoding::FAST_LOSSLESS, false, (1, 2, 16, 8));
    let back = read_exr(&path).unwrap();
    assert_eq!((back.width, back.height), (16, 8));
    assert_eq!(back.rgba[0], expected(2 * 15 + 1));
    assert_eq!(back.rgba[15], [0.0; 4]);
    write(&["U", "V", ""], Encoding::FAST_LOSSLESS, false, (0, 0, 15, 9));
    let error = format!("{:#}", read_exr(&path).unwrap_err());
    assert!(error.ends_with("other.exr: there are no channels R, G and B, only U, V"), "{error}");
}
