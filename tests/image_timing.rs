//! How long the costly parts take; run with `cargo test --release --test image_timing -- --ignored --nocapture`.

use std::time::Instant;

use etalon::image::exr::encode_exr;
use etalon::image::metric::{AnyPicture, Metric, compare};
use etalon::image::png::encode_png;
use etalon::image::tone::ToneMap;
use etalon::scene::environment::Environment;

fn timed<T>(name: &str, work: impl Fn() -> T) -> T {
    let mut best = f64::INFINITY;
    let mut result = work();
    for _ in 0..5 {
        let start = Instant::now();
        result = work();
        best = best.min(start.elapsed().as_secs_f64() * 1e3);
    }
    eprintln!("{name}: {best:.2} ms");
    result
}

#[test]
#[ignore = "measures instead of testing"]
fn timings() {
    let studio = timed("studio 512x256", Environment::studio);
    timed("sh9 of 512x256", || studio.irradiance_sh9());
    let radiance = (0..1024 * 512).map(|i| studio.radiance[(i / 1024 / 2) * 512 + i % 1024 / 2]).collect();
    let large = Environment { name: "large".into(), width: 1024, height: 512, radiance };
    timed("sh9 of 1024x512", || large.irradiance_sh9());

    // A smooth picture with a little noise, which is what a render looks like to a compressor.
    let mut picture = etalon::image::Picture::filled(1280, 720, [0.0; 4]);
    let mut seed = 1u32;
    for (index, pixel) in picture.rgba.iter_mut().enumerate() {
        let (x, y) = (index % 1280, index / 1280);
        let texel = studio.radiance[(y * 256 / 720) * 512 + x * 512 / 1280];
        seed = seed.wrapping_mul(1664525).wrapping_add(1013904223);
        let noise = 1.0 + (seed >> 8) as f32 / 16777216.0 * 0.02;
        *pixel = [texel[0] * noise, texel[1] * noise, texel[2] * noise, 1.0];
    }
    let bytes: Vec<u8> = picture
        .rgba
        .iter()
        .flat_map(|p| {
            let [r, g, b] = ToneMap::KhronosNeutral.to_display([p[0], p[1], p[2]].map(f64::from));
            [r, g, b, 255]
        })
        .collect();
    let png = timed("PNG RGB 1280x720", || encode_png(1280, 720, &bytes, false).unwrap());
    eprintln!("  {} bytes", png.len());
    let png = timed("PNG RGBA 1280x720", || encode_png(1280, 720, &bytes, true).unwrap());
    eprintln!("  {} bytes", png.len());
    let exr = timed("EXR 1280x720", || encode_exr(&picture, &[], &[]).unwrap());
    eprintln!("  {} bytes", exr.len());
    timed("EXR read 1280x720", || etalon::image::exr::decode_exr(&exr).unwrap());
    let any = AnyPicture::Linear(picture);
    for metric in [Metric::Flip, Metric::Mse, Metric::Ssim] {
        timed(metric.name(), || compare(metric, &any, &any).unwrap().value);
    }
}
