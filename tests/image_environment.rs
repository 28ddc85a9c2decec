//! Environment maps: lookup, projection onto spherical harmonics, reading, and the built-in studio.

use std::f64::consts::{PI, TAU};

use etalon::image::{Picture, exr};
use etalon::scene::environment::{Environment, direction, irradiance, sh9_basis};
use glam::DVec3;

fn made(width: u32, height: u32, light: impl Fn(DVec3) -> [f64; 3]) -> Environment {
    let radiance = (0..width * height)
        .map(|i| {
            let u = (f64::from(i % width) + 0.5) / f64::from(width);
            let v = (f64::from(i / width) + 0.5) / f64::from(height);
            light(direction(u, v)).map(|x| x as f32)
        })
        .collect();
    Environment { name: "made".into(), width, height, radiance }
}

/// Directions spread evenly over the sphere (spherical Fibonacci).
fn spread(count: usize) -> impl Iterator<Item = DVec3> {
    (0..count).map(move |i| {
        let y = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
        let (sin, cos) = (i as f64 * PI * (3.0 - 5f64.sqrt())).sin_cos();
        let r = (1.0 - y * y).sqrt();
        DVec3::new(r * cos, y, r * sin)
    })
}

fn brute_irradiance(environment: &Environment, n: DVec3, count: usize) -> f64 {
    let sum: f64 = spread(count).map(|d| d.dot(n).max(0.0) * environment.sample(d)[1]).sum();
    sum * 2.0 * TAU / count as f64
}

#[test]
fn lookup_follows_the_convention() {
    // 4x2 texels, red counts them: row 0 is 0 1 2 3, row 1 is 4 5 6 7.
    let radiance = (0..8).map(|i| [i as f32, 0.0, 0.0]).collect();
    let map = Environment { name: "count".into(), width: 4, height: 2, radiance };
    let red = |x: f64, y: f64, z: f64| map.sample(DVec3::new(x, y, z))[0];
    // +X: u = 1/2, between columns 1 and 2; the horizon: between both rows.
    assert!((red(1.0, 0.0, 0.0) - 3.5).abs() < 1e-12);
    // +Z: u = 3/4, between columns 2 and 3.
    assert!((red(0.0, 0.0, 1.0) - 4.5).abs() < 1e-12);
    // -Z: u = 1/4, between columns 0 and 1.
    assert!((red(0.0, 0.0, -1.0) - 2.5).abs() < 1e-12);
    // -X: the seam, between columns 3 and 0, from both sides.
    assert!((red(-1.0, 0.0, 0.0) - 3.5).abs() < 1e-12);
    assert!((red(-1.0, 0.0, -0.0) - 3.5).abs() < 1e-12);
    // Up is the top row, not beyond it: atan2(0, 0) = 0, so u = 1/2.
    assert!((red(0.0, 1.0, 0.0) - 1.5).abs() < 1e-12);
    assert!((red(0.0, -1.0, 0.0) - 5.5).abs() < 1e-12);
    assert!(red(0.0, 1.0 + 1e-12, 0.0).is_finite());
    // A texel's centre gives the texel.
    let d = direction(1.5 / 4.0, 0.5 / 2.0);
    assert!((map.sample(d)[0] - 1.0).abs() < 1e-12);
}

#[test]
fn constant_light_gives_pi_times_radiance() {
    let sh9 = Environment::constant([0.25, 1.0, 7.5]).irradiance_sh9();
    for n in spread(50) {
        let e = irradiance(&sh9, n);
        for (got, radiance) in e.iter().zip([0.25, 1.0, 7.5]) {
            assert!((got - PI * radiance).abs() < 1e-12 * radiance.max(1.0), "{got}");
        }
    }
    let big = made(64, 32, |_| [2.0; 3]);
    assert!((big.mean()[0] - 2.0).abs() < 1e-12);
    assert!(big.irradiance_sh9()[1..].iter().flatten().all(|x| x.abs() < 1e-12));
    assert_eq!(Environment::constant([f32::NAN, -1.0, f32::INFINITY]).radiance[0], [0.0; 3]);
}

#[test]
fn the_closed_form_agrees_with_sums_over_fine_cells() {
    // Each texel of 8x4 cut into 64x64 parts whose harmonics are summed by the midpoint rule.
    let map = made(8, 4, |d| [1.0 + d.x * d.y + 0.5 * d.z, d.y + 1.0, (3.0 * d.x).sin() + 1.0]);
    let mut summed = [[0.0; 3]; 9];
    let (columns, rows) = (8 * 64, 4 * 64);
    for row in 0..rows {
        let latitude = |edge: usize| (0.5 - edge as f64 / rows as f64) * PI;
        let solid = (latitude(row).sin() - latitude(row + 1).sin()) * TAU / columns as f64;
        for column in 0..columns {
            let d = direction((column as f64 + 0.5) / columns as f64, (row as f64 + 0.5) / rows as f64);
            let texel = map.radiance[row / 64 * 8 + column / 64];
            for (sum, y) in summed.iter_mut().zip(sh9_basis(d)) {
                (0..3).for_each(|c| sum[c] += solid * y * f64::from(texel[c]));
            }
        }
    }
    for (exact, sum) in map.irradiance_sh9().iter().flatten().zip(summed.iter().flatten()) {
        assert!((exact - sum).abs() < 2e-4, "{exact} {sum}");
    }
}

#[test]
fn smooth_light_is_exact_up_to_degree_two() {
    // L = 1 + a.d + xy: E(n) = pi + 2 pi / 3 a.n + pi / 4 nx ny.
    let a = DVec3::new(0.2, -0.3, 0.25);
    let map = made(512, 256, |d| [1.0 + a.dot(d) + d.x * d.y; 3]);
    let sh9 = map.irradiance_sh9();
    for n in spread(40) {
        let expected = PI + TAU / 3.0 * a.dot(n) + PI / 4.0 * n.x * n.y;
        assert!((irradiance(&sh9, n)[0] - expected).abs() < 2e-4, "{n}");
        assert!((brute_irradiance(&map, n, 40_000) - expected).abs() < 2e-3, "{n}");
    }
}

#[test]
fn studio_is_balanced_and_smooth() {
    let studio = Environment::studio();
    assert_eq!((studio.width, studio.height, studio.radiance.len()), (512, 256, 512 * 256));
    assert_eq!(studio.radiance, Environment::studio().radiance);
    let mean = studio.mean();
    assert!(mean.iter().all(|m| (0.6..=0.9).contains(m)), "{mean:?}");
    assert!(mean[2] / mean[0] < 1.15 && mean[2] / mean[0] > 0.95, "not neutral: {mean:?}");
    let brightest = studio.radiance.iter().flatten().fold(0.0f32, |top, &x| top.max(x));
    assert!((10.0..=15.0).contains(&brightest), "{brightest}");
    assert!(studio.radiance.iter().flatten().all(|x| x.is_finite() && *x > 0.0));
    // No step between neighbours, the seam included, is more than a fifth of the brightest.
    for row in 0..256usize {
        for column in 0..512usize {
            let here = studio.radiance[row * 512 + column][1];
            let right = studio.radiance[row * 512 + (column + 1) % 512][1];
            let wide = (f64::from(row as u32) + 0.5 - 128.0).abs() < 115.0;
            assert!(!wide || (here - right).abs() < 0.2 * brightest, "column {column} row {row}");
            if row < 255 {
                let below = studio.radiance[(row + 1) * 512 + column][1];
                assert!((here - below).abs() < 0.2 * brightest, "column {column} row {row}");
            }
        }
    }
    // The key comes from the upper left in front, and nine harmonics hold the diffuse light to a few per cent.
    let (left, right) = (DVec3::new(-0.6, 0.6, 0.6).normalize(), DVec3::new(0.6, -0.6, 0.6).normalize());
    let sh9 = studio.irradiance_sh9();
    assert!(irradiance(&sh9, left)[1] > 2.0 * irradiance(&sh9, right)[1]);
    for n in spread(20) {
        let (exact, nine) = (brute_irradiance(&studio, n, 40_000), irradiance(&sh9, n)[1]);
        assert!((exact - nine).abs() < 0.06 * PI * mean[1] * 2.0, "{n}: {exact} {nine}");
        assert!(nine > 0.0);
    }
}

#[test]
fn reading_cleans_and_warns() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sky.exr");
    let mut picture = Picture::filled(4, 3, [1.0, 2.0, 3.0, 1.0]);
    picture.rgba[0][0] = f32::NAN;
    picture.rgba[1] = [f32::INFINITY, -1.0, 5.0, 1.0];
    picture.rgba[2][2] = -0.0;
    exr::write_exr(&path, &picture, &[], &[]).unwrap();
    let (map, warnings) = Environment::load(&path).unwrap();
    assert_eq!(map.radiance[..3], [[0.0, 2.0, 3.0], [0.0, 0.0, 5.0], [1.0, 2.0, 0.0]]);
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    assert!(warnings[0].contains("2 of 12 texels"), "{warnings:?}");
    assert!(warnings[1].contains("4x3 is not two to one"), "{warnings:?}");
}

/// A flat (not run-length coded) Radiance file of one texel value.
fn hdr(size: (u32, u32), rgbe: [u8; 4], header: &str) -> Vec<u8> {
    let mut bytes = format!("#?RADIANCE\n{header}FORMAT=32-bit_rle_rgbe\n\n-Y {} +X {}\n", size.1, size.0).into_bytes();
    (0..size.0 * size.1).for_each(|_| bytes.extend_from_slice(&rgbe));
    bytes
}

#[test]
fn radiance_files() {
    // Mantissa 128, exponent 129: 128 / 256 * 2^(129 - 128) = 1.
    let (map, warnings) = Environment::decode("x.hdr", &hdr((4, 2), [128, 64, 0, 129], "")).unwrap();
    assert_eq!((map.width, map.height, warnings.len()), (4, 2, 0));
    assert_eq!(map.radiance[7], [1.0, 0.5, 0.0]);
    let (map, warnings) = Environment::decode("x.hdr", &hdr((4, 2), [128, 64, 0, 129], "EXPOSURE=4\n")).unwrap();
    assert_eq!((map.radiance[0], warnings.len()), ([0.25, 0.125, 0.0], 1));

    let good = hdr((4, 2), [128, 64, 0, 129], "");
    for length in 0..good.len() {
        assert!(Environment::decode("x.hdr", &good[..length]).is_err(), "{length}");
    }
    let error = format!("{:#}", Environment::decode("x.hdr", &hdr((0, 0), [0; 4], "")).unwrap_err());
    assert!(!error.is_empty());
    let mut huge = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 100000 +X 200000\n".to_vec();
    huge.resize(100, 0);
    let error = format!("{:#}", Environment::decode("x.hdr", &huge).unwrap_err());
    assert!(error.starts_with("200000x100000 pixels are too many"), "{error}");
    let error = format!("{:#}", Environment::decode("x.hdr", b"P6 1 1").unwrap_err());
    assert_eq!(error, "the contents are neither Radiance HDR nor OpenEXR");
    let missing = format!("{:#}", Environment::load("no-such.hdr".as_ref()).unwrap_err());
    assert_eq!(missing, "reading no-such.hdr: no such file or folder");
}

#[test]
fn directions_invert_the_lookup() {
    for (u, v) in [(0.1, 0.2), (0.5, 0.5), (0.93, 0.8)] {
        let d = direction(u, v);
        assert!((d.length() - 1.0).abs() < 1e-15);
        assert!((d.z.atan2(d.x) / TAU + 0.5 - u).abs() < 1e-15 && (0.5 - d.y.asin() / PI - v).abs() < 1e-15);
    }
    assert!((direction(0.75, 0.5) - DVec3::Z).length() < 1e-15);
}
