//! The display pass against crates/image/src/tone.rs: a film is put on the device as it is, so that the curves meet
//! every radiance they may ever meet, and the bytes that come back are compared with the f64 twins. NaN, infinity and
//! negative values are counted before anything clamps, and none of them disturbs its neighbours.

use ash::vk;
use etalon::frame::{Background, NEUTRAL_GREY, Settings};
use etalon::gpu::{Buffer, Frame, Image, ImageDesc};
use etalon::image::tone::{ToneMap, ViewTransform, desaturated, quantise, srgb_decode, srgb_encode};
use etalon::optics::SplitMix64;
use etalon::pass::tonemap::{Counts, Display, tonemap};
use etalon::scene::LightKind;
use etalon::study::shape::Shape;
use etalon_testing::gpu::{Gpu, settings};
use etalon_testing::made::{Made, lambert, unlit};
use glam::{DAffine3, DVec3};

const CURVES: [ToneMap; 5] = [ToneMap::Linear, ToneMap::Reinhard, ToneMap::Aces, ToneMap::Agx, ToneMap::KhronosNeutral];

/// What the pass makes of a film of `width` pixels a row.
fn display(
    gpu: &Gpu,
    rgba: &[[f32; 4]],
    width: u32,
    curve: ToneMap,
    exposure: f32,
    background: [f32; 4],
) -> (Vec<[u8; 4]>, Counts) {
    shown(gpu, rgba, width, curve, exposure, background, false)
}

/// The same, with or without colours outside of Rec. 709.
fn shown(
    gpu: &Gpu,
    rgba: &[[f32; 4]],
    width: u32,
    curve: ToneMap,
    exposure: f32,
    background: [f32; 4],
    desaturates: bool,
) -> (Vec<[u8; 4]>, Counts) {
    let height = rgba.len() as u32 / width;
    let desc = ImageDesc::flat(vk::Format::R32G32B32A32_SFLOAT, width, height, vk::ImageUsageFlags::STORAGE);
    let film = Image::new(&gpu.device, "film of a test", desc).expect("an image");
    let staging = Buffer::with_data(&gpu.device, "staging of a test", rgba).expect("a buffer");
    let target = Display::new(&gpu.device, [width, height]).expect("a display");
    let mut frame = Frame::new(&gpu.device);
    frame.upload("upload film", &staging, &film, 0, &[0]);
    tonemap(&mut frame, (&film, 1.0), &target, curve as u32, exposure, background, desaturates).expect("the pass");
    frame.finish().expect("a frame");
    let bytes = target.pixels.read(|all| all[..rgba.len() * 4].as_chunks::<4>().0.to_vec());
    (bytes, target.counts().expect("the device runs"))
}

/// A display value within `slack` of the middle between two bytes may be rounded either way.
fn is_right(got: u8, display: f64, slack: f64) -> bool {
    let low = quantise((display - slack).max(0.0));
    let high = quantise((display + slack).min(1.0));
    (low..=high).contains(&got)
}

#[test]
fn a_device_that_runs_nothing_is_an_error() {
    let gpu = Gpu::open();
    let target = Display::new(&gpu.device, [4, 4]).expect("a display");
    let mut frame = Frame::new(&gpu.device);
    frame.fill("what memory may hold", &target.pixels, 0);
    frame.finish().expect("a frame");
    let said = target.counts().expect_err("no pass has written it").to_string();
    assert!(said.ends_with("runs nothing: what it was given is not done"), "{said}");
}

#[test]
fn every_curve_shows_the_bytes_of_its_twin() {
    let gpu = Gpu::open();
    let mut random = SplitMix64::new(11);
    // Radiances from 2^-24 to 1e38 (2^126.2) in all colours: a third greys, the rest of any saturation, some channels
    // zero. Half of them stay below 2^16, where the curves still bend.
    let film: Vec<[f32; 4]> = (0..64 * 256)
        .map(|i| {
            let top = if i % 2 == 0 { 15.99 } else { 126.2 };
            let level = random.between(-24.0, top);
            let channel = |r: &mut SplitMix64| match i % 3 {
                0 => level.exp2() as f32,
                1 => (level + r.between(-3.0, 0.0)).exp2() as f32,
                _ => (r.between(-24.0, top)).exp2() as f32 * (r.unit() > 0.1) as u32 as f32,
            };
            [channel(&mut random), channel(&mut random), channel(&mut random), 1.0]
        })
        .collect();
    for curve in CURVES {
        let (bytes, counts) = display(&gpu, &film, 64, curve, 0.0, [0.0; 4]);
        assert_eq!(counts, Counts::default());
        let (mut off, mut most) = (0, 0);
        for (rgba, got) in film.iter().zip(&bytes) {
            assert_eq!(got[3], 255);
            let want = curve.apply([0, 1, 2].map(|c| f64::from(rgba[c]))).map(srgb_encode);
            for c in 0..3 {
                let byte = quantise(want[c]);
                off += usize::from(byte != got[c]);
                most = most.max(byte.abs_diff(got[c]));
                // What f32 does to a display value: pow is good to 33 ulps on lavapipe (numerics.md, 2), 2e-6, beside a
                // few roundings; AgX's polynomial has coefficients to 40 and the outset another 1.2, 50 · 2^-24 · a
                // few. A byte can then differ only where the exact value lies that close to a rounding boundary, and
                // only by one.
                let slack = if curve == ToneMap::Agx { 1e-5 } else { 3e-6 };
                assert!(is_right(got[c], want[c], slack), "{curve:?}: {rgba:?} shows {got:?}, twin {want:?}");
            }
        }
        eprintln!("{curve:?}: {off} of {} bytes differ, by at most {most}", film.len() * 3);
        assert!(off * 1000 < film.len() * 3, "{curve:?}: {off} bytes on rounding boundaries");
    }
}

#[test]
fn exposure_is_a_power_of_two_before_the_curve() {
    let gpu = Gpu::open();
    let film: Vec<[f32; 4]> = (0..256).map(|i| [i as f32 / 64.0, i as f32 / 128.0, 0.1, 1.0]).collect();
    for curve in CURVES {
        for stops in [-3.0_f32, 2.0] {
            let exposed: Vec<_> =
                film.iter().map(|p| [p[0] * stops.exp2(), p[1] * stops.exp2(), p[2] * stops.exp2(), 1.0]).collect();
            let (a, _) = display(&gpu, &film, 16, curve, stops, [0.0; 4]);
            let (b, _) = display(&gpu, &exposed, 16, curve, 0.0, [0.0; 4]);
            assert_eq!(a, b, "{curve:?} at {stops} stops");
        }
    }
}

#[test]
fn what_is_no_radiance_is_counted_and_shown_as_black_or_white() {
    let gpu = Gpu::open();
    let nan = f32::NAN;
    let inf = f32::INFINITY;
    let mut film = vec![[0.5_f32, 0.5, 0.5, 1.0]; 64];
    film[3] = [nan, 0.5, 0.5, 1.0];
    film[9] = [nan, nan, inf, 1.0];
    film[17] = [0.5, inf, 0.5, 1.0];
    film[22] = [0.5, -1.0, 0.5, 1.0];
    film[30] = [0.5, 0.5, 0.5, nan];
    film[41] = [-inf, 0.5, 0.5, 1.0];
    film[50] = [-0.0, 0.0, 0.0, 1.0];
    for curve in CURVES {
        let (bytes, counts) = display(&gpu, &film, 8, curve, 0.0, [0.0; 4]);
        assert_eq!(counts, Counts { nan: 3, inf: 3, negative: 2 }, "{curve:?}");
        let plain = bytes[0];
        for (i, pixel) in bytes.iter().enumerate() {
            if ![3, 9, 17, 22, 30, 41, 50].contains(&i) {
                assert_eq!(*pixel, plain, "{curve:?}: pixel {i} was disturbed");
            }
        }
        if curve == ToneMap::Linear {
            assert_eq!(bytes[3], [0, plain[1], plain[2], 255], "NaN is black");
            assert_eq!(bytes[17], [plain[0], 255, plain[2], 255], "infinity is white");
            assert_eq!(bytes[22], [plain[0], 0, plain[2], 255], "negative is black");
        }
    }
}

#[test]
fn coverage_is_laid_over_the_background_after_the_curve() {
    let gpu = Gpu::open();
    let film: Vec<[f32; 4]> = (0..=255)
        .map(|i| {
            let alpha = i as f32 / 255.0;
            // Premultiplied.
            [0.8 * alpha, 0.4 * alpha, 0.1 * alpha, alpha]
        })
        .collect();
    let behind = [0.2_f32, 0.5, 0.9];
    for curve in CURVES {
        let (bytes, _) = display(&gpu, &film, 16, curve, 0.0, [behind[0], behind[1], behind[2], 1.0]);
        let shown = curve.apply([0.8, 0.4, 0.1]);
        for (rgba, got) in film.iter().zip(&bytes) {
            let alpha = f64::from(rgba[3]);
            for c in 0..3 {
                let want = srgb_encode(f64::from(behind[c]) * (1.0 - alpha) + shown[c] * alpha);
                assert!(is_right(got[c], want, 1e-4), "{curve:?}: {rgba:?} shows {got:?}, want {want}");
            }
            assert_eq!(got[3], 255);
        }
        let (bytes, _) = display(&gpu, &film, 16, curve, 0.0, [0.0; 4]);
        for (i, got) in bytes.iter().enumerate() {
            assert_eq!(usize::from(got[3]), i, "alpha");
        }
    }
}

#[test]
fn a_whole_render_shows_the_twin_s_bytes_over_its_background() {
    let gpu = Gpu::open();
    let color = [0.9_f32, 0.35, 0.02];
    let mut made = Made::new("patch");
    made.add(Shape::panel(2.0, 8.0), unlit(color), DAffine3::IDENTITY);
    made.front(2.0);
    for curve in CURVES {
        for (background, corner) in [
            (Background::Default, [NEUTRAL_GREY[0], NEUTRAL_GREY[1], NEUTRAL_GREY[2], 255]),
            (Background::Color([0x33, 0x66, 0x99]), [0x33, 0x66, 0x99, 255]),
            (Background::Transparent, [0; 4]),
        ] {
            let settings = Settings { tonemap: curve, exposure: 1.5, background, ..settings([64, 32]) };
            let (rendered, film) = gpu.shot(&made.0, None, settings);
            let pixel = |i: usize| &rendered.display[i * 4..i * 4 + 4];
            let want = curve.to_display(color.map(|c| f64::from(c) * 1.5_f64.exp2()));
            assert_eq!(pixel(64 * 16 + 32), [want[0], want[1], want[2], 255], "{curve:?}");
            assert_eq!(pixel(0), corner, "{curve:?}, {background:?}");
            assert_eq!(rendered.has_alpha, background == Background::Transparent);
            if let Background::Color(bytes) = background {
                let behind = bytes.map(|b| srgb_decode(f64::from(b) / 255.0) as f32);
                assert_eq!(film.rgba[0], [behind[0], behind[1], behind[2], 1.0], "the film has it in linear light");
            }
        }
    }
}

#[test]
fn light_beyond_f32_is_counted_as_infinite() {
    let gpu = Gpu::open();
    let mut made = Made::new("overflow");
    made.add(Shape::panel(8.0, 4.0), lambert([1.0; 3]), DAffine3::IDENTITY);
    // 1e38 cd at 1 cm is 1e42 lx.
    let kind = LightKind::Point { position: DVec3::new(0.0, 0.0, 0.01), range: None };
    made.light([1e38; 3], kind);
    made.front(1.0);
    for tonemap in CURVES {
        let mut renderer = gpu.renderer(&made.0, None, Settings { tonemap, ..settings([64, 36]) });
        let rendered = renderer.render(&made.0.cameras[0], &mut |_| ()).expect("a picture");
        let film = renderer.film().expect("the film");
        let infinite = film.rgba.iter().filter(|p| p.iter().any(|v| v.is_infinite())).count();
        let nan = film.rgba.iter().filter(|p| p.iter().any(|v| v.is_nan())).count();
        eprintln!("{tonemap:?}: {:?}", rendered.counts);
        assert!(infinite > 10);
        assert_eq!((rendered.counts.inf, rendered.counts.nan), (infinite as u32, nan as u32));
        assert_eq!(nan, 0, "too much light is infinite, not nothing");
        let white: Vec<_> =
            film.rgba.iter().zip(rendered.display.chunks(4)).filter(|(f, _)| f[0].is_infinite()).collect();
        // 65504 / 65505 of Reinhard is the last to reach the byte: 1.5e-5 below 1, half a byte is 2e-3.
        assert!(white.iter().all(|(_, bytes)| **bytes == [255; 4]), "{tonemap:?}: {:?}", white[0].1);
    }
}

#[test]
fn what_lies_behind_is_what_the_twin_has_there() {
    let gpu = Gpu::open();
    let mut random = SplitMix64::new(11);
    let film: Vec<[f32; 4]> = (0..64 * 16)
        .map(|i| {
            let alpha = [0.0, 1.0, random.between(0.0, 1.0)][i % 3];
            let [r, g, b] = [0; 3].map(|_| (alpha * random.between(0.0, 3.0)) as f32);
            [r, g, b, alpha as f32]
        })
        .collect();
    for (curve, exposure) in CURVES.into_iter().zip([0.0, 1.0, -1.0, 0.5, 0.0]) {
        let behind = [0.2, 0.5, 0.7];
        let [r, g, b] = behind.map(|x| x as f32);
        let (bytes, _) = display(&gpu, &film, 64, curve, exposure, [r, g, b, 1.0]);
        let twin = ViewTransform { curve, exposure, background: Some(behind) };
        for (pixel, got) in film.iter().zip(bytes) {
            let expected = twin.shown(*pixel);
            assert!((0..3).all(|k| is_right(got[k], expected[k], 1e-3)), "{curve:?} {pixel:?}: {got:?}, {expected:?}");
        }
    }
}

#[test]
fn colours_outside_of_the_gamut_keep_their_luminance() {
    let gpu = Gpu::open();
    let mut random = SplitMix64::new(5);
    let film: Vec<[f32; 4]> = (0..64 * 16)
        .map(|_| {
            let [r, g, b] = [0; 3].map(|_| random.between(-0.3, 0.9) as f32);
            [r, g, b, 1.0]
        })
        .collect();
    let (bytes, counts) = shown(&gpu, &film, 64, ToneMap::Linear, 0.0, [0.0; 4], true);
    let most = |pixel: &[f32; 4]| pixel[..3].iter().copied().fold(f32::MIN, f32::max);
    let outside = film.iter().filter(|pixel| pixel[..3].iter().any(|&x| x < -1e-4 * most(pixel))).count();
    assert_eq!(counts.negative as usize, outside);
    assert!(outside > 300);
    for (pixel, got) in film.iter().zip(bytes) {
        let rgb = [0, 1, 2].map(|k| f64::from(pixel[k]));
        let expected = desaturated(rgb);
        let luminance = |[r, g, b]: [f64; 3]| 0.2126 * r + 0.7152 * g + 0.0722 * b;
        assert!((luminance(expected) - luminance(rgb).max(0.0)).abs() < 1e-12, "{rgb:?}");
        for k in 0..3 {
            let display = srgb_encode(expected[k].min(1.0));
            assert!(is_right(got[k], display, 1e-3), "{pixel:?}: {got:?}, expected {expected:?}");
        }
    }
}
