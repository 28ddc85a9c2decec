//! Figures for the difference of two pictures against values worked out by hand, and the command around them.

use std::path::PathBuf;
use std::process::ExitCode;

use etalon::image::exr::write_exr;
use etalon::image::metric::{AnyPicture, Metric, compare, map_rgba};
use etalon::image::png::{Display, encode_png};
use etalon::image::{Picture, file};
use etalon_cli::diff::{DiffArgs, run};

fn grey(width: u32, height: u32, byte: u8) -> AnyPicture {
    AnyPicture::Display(Display { width, height, rgba: vec![[byte, byte, byte, 255]; (width * height) as usize] })
}

fn linear(width: u32, height: u32, value: f32) -> AnyPicture {
    AnyPicture::Linear(Picture::filled(width, height, [value, value, value, 1.0]))
}

fn near(got: f64, expected: f64) {
    assert!((got - expected).abs() <= 1e-12 * expected.abs().max(1.0), "{got} is not {expected}");
}

#[test]
fn values_worked_out_by_hand() {
    // 51 / 255 = 0.2 and 102 / 255 = 0.4.
    let value = |metric, a: u8, b: u8| compare(metric, &grey(16, 12, a), &grey(16, 12, b)).unwrap().value;
    near(value(Metric::Mse, 0, 51), 0.04);
    near(value(Metric::Rmse, 0, 51), 0.2);
    near(value(Metric::Mae, 0, 51), 0.2);
    near(value(Metric::Relmse, 0, 51), 4.0);
    near(value(Metric::Relmse, 51, 0), 0.8); // 0.04 / (0.04 + 0.01): the first picture is the reference
    near(value(Metric::Psnr, 0, 51), 10.0 * 25f64.log10());
    near(value(Metric::Ssim, 51, 102), 0.1601 / 0.2001);
    assert!(value(Metric::Flip, 0, 255) > 0.9);
    // Radiance: 4 against 1, peak of the first.
    let value = |metric| compare(metric, &linear(3, 2, 4.0), &linear(3, 2, 1.0)).unwrap().value;
    near(value(Metric::Mse), 9.0);
    near(value(Metric::Psnr), 10.0 * (16.0f64 / 9.0).log10());
    // Both are 1 after the cut to 0..=1.
    assert_eq!(value(Metric::Flip), 0.0);
}

#[test]
fn equal_pictures_have_no_difference() {
    for &metric in Metric::ALL {
        for picture in [grey(13, 11, 77), linear(13, 11, 2.5)] {
            let found = compare(metric, &picture, &picture).unwrap();
            match metric {
                Metric::Psnr => assert_eq!(found.value, f64::INFINITY),
                Metric::Ssim => near(found.value, 1.0),
                _ => assert_eq!(found.value, 0.0, "{metric:?}"),
            }
            assert_eq!(found.worst_error, 0.0);
        }
    }
    for size in [(1, 1), (2, 1), (1, 5)] {
        assert_eq!(compare(Metric::Flip, &grey(size.0, size.1, 3), &grey(size.0, size.1, 3)).unwrap().value, 0.0);
    }
}

#[test]
fn ssim_sees_structure() {
    let pattern = |shift: usize| {
        let rgba = (0..40 * 30).map(|i| [if (i % 40 / 2 + i / 40 / 2 + shift) & 1 == 0 { 200 } else { 50 }; 3]);
        let rgba = rgba.map(|[r, g, b]| [r, g, b, 255]).collect();
        AnyPicture::Display(Display { width: 40, height: 30, rgba })
    };
    // Inverted contrast: means agree, the covariance is minus the variance.
    let found = compare(Metric::Ssim, &pattern(0), &pattern(1)).unwrap().value;
    assert!((-1.0..-0.8).contains(&found), "{found}");
    let error = compare(Metric::Ssim, &grey(10, 30, 0), &grey(10, 30, 0)).unwrap_err();
    assert_eq!(error.to_string(), "ssim needs pictures of at least 11x11 pixels, these have 10x30");
}

#[test]
fn alpha_counts_where_there_is_any() {
    let clear = AnyPicture::Display(Display { width: 2, height: 1, rgba: vec![[9, 9, 9, 0]; 2] });
    let black = grey(2, 1, 0);
    // The colour under no coverage is nothing; coverage differs by 1 in one of four channels.
    near(compare(Metric::Mse, &clear, &black).unwrap().value, 0.25);
    assert!(compare(Metric::Flip, &clear, &black).unwrap().value > 0.1);
}

#[test]
fn non_finite_pixels_are_counted_and_left_out() {
    let (mut a, mut b) = (Picture::filled(12, 12, [1.0; 4]), Picture::filled(12, 12, [2.0, 2.0, 2.0, 1.0]));
    a.rgba[5] = [f32::NAN, 0.0, 0.0, 1.0];
    b.rgba[5] = [f32::NAN, 0.0, 0.0, 1.0];
    b.rgba[7] = [0.0, f32::INFINITY, 0.0, 1.0];
    let (a, b) = (AnyPicture::Linear(a), AnyPicture::Linear(b));
    for &metric in Metric::ALL {
        let found = compare(metric, &a, &b).unwrap();
        assert_eq!(found.non_finite, [1, 2]);
        assert!(found.value.is_finite() && found.map.iter().all(|error| error.is_finite()), "{metric:?}");
    }
    // 142 pixels differ by exactly 1, whatever was left out.
    near(compare(Metric::Mse, &a, &b).unwrap().value, 1.0);
    let nothing = linear(2, 2, f32::NAN);
    assert!(compare(Metric::Mse, &nothing, &nothing).is_err());
}

#[test]
fn what_is_left_out_has_no_error_of_its_neighbours() {
    let mut a = Picture::filled(11, 11, [0.2, 0.2, 0.2, 1.0]);
    a.rgba[60][0] = f32::NAN;
    let (a, b) = (AnyPicture::Linear(a), linear(11, 11, 0.6));
    let found = compare(Metric::Flip, &a, &b).unwrap();
    assert!(found.map[60] == 0.0 && found.map[59] > 0.0, "{:?}", &found.map[59..61]);
    near(found.value, found.map.iter().map(|&error| f64::from(error)).sum::<f64>() / 120.0);
    // Pixel 60 is the middle of the only window.
    let error = compare(Metric::Ssim, &a, &b).unwrap_err().to_string();
    assert_eq!(error, "the pixel in the middle of every window of ssim is NaN or infinite");
}

#[test]
fn pictures_that_cannot_be_compared() {
    let error = compare(Metric::Mse, &grey(2, 3, 0), &grey(3, 2, 0)).unwrap_err().to_string();
    assert_eq!(error, "the pictures have different sizes, 2x3 and 3x2");
    let error = compare(Metric::Mse, &grey(2, 2, 0), &linear(2, 2, 0.0)).unwrap_err().to_string();
    assert_eq!(error, "cannot compare a picture of radiance (EXR) with one of display values (PNG, JPEG, WebP)");
}

#[test]
fn the_map_shows_the_worst_pixel() {
    let mut b = Picture::filled(4, 3, [0.0, 0.0, 0.0, 1.0]);
    b.rgba[6] = [0.0, 0.5, 0.0, 1.0];
    let found = compare(Metric::Mae, &linear(4, 3, 0.0), &AnyPicture::Linear(b)).unwrap();
    assert_eq!((found.worst, found.worst_error), ([2, 1], 0.5));
    let map = map_rgba(&found);
    assert_eq!(map[6 * 4..7 * 4], [128, 128, 128, 255]);
    assert_eq!(map[..4], [0, 0, 0, 255]);
    let flip = map_rgba(&compare(Metric::Flip, &grey(8, 8, 0), &grey(8, 8, 0)).unwrap());
    assert_eq!(flip[..4], [0, 0, 4, 255]); // the first entry of magma: 0.0015, 0.0005, 0.0139
}

#[test]
fn the_command_judges() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, byte: u8| -> PathBuf {
        let path = folder.path().join(name);
        file::write(&path, &encode_png(16, 16, &[byte, byte, byte, 255].repeat(256), false).unwrap()).unwrap();
        path
    };
    let (a, b) = (write("a.png", 0), write("b.png", 51));
    let map = folder.path().join("map.png");
    let judge = |metric, max| {
        let (a, b, output) = (a.clone(), b.clone(), Some(map.clone()));
        run(&DiffArgs { a, b, metric, max, output, json: true }, false).unwrap()
    };
    // ExitCode compares only through its debug text.
    let same = |got: ExitCode, expected: ExitCode| assert_eq!(format!("{got:?}"), format!("{expected:?}"));
    same(judge(Metric::Rmse, None), ExitCode::SUCCESS);
    same(judge(Metric::Rmse, Some(0.21)), ExitCode::SUCCESS);
    same(judge(Metric::Rmse, Some(0.19)), ExitCode::FAILURE);
    same(judge(Metric::Psnr, Some(13.0)), ExitCode::SUCCESS);
    same(judge(Metric::Psnr, Some(14.0)), ExitCode::FAILURE);
    assert!(map.exists());
    std::fs::remove_file(&map).unwrap();

    // A NaN fails every limit, even against itself.
    let broken = folder.path().join("nan.exr");
    let mut picture = Picture::filled(4, 4, [1.0; 4]);
    picture.rgba[3][0] = f32::NAN;
    write_exr(&broken, &picture, &[], &[]).unwrap();
    let args =
        DiffArgs { a: broken.clone(), b: broken, metric: Metric::Mse, max: Some(9.0), output: None, json: false };
    same(run(&args, false).unwrap(), ExitCode::FAILURE);

    let args = DiffArgs {
        a: a.clone(),
        b: folder.path().join("no.png"),
        metric: Metric::Mse,
        max: None,
        output: None,
        json: false,
    };
    let error = format!("{:#}", run(&args, false).unwrap_err());
    assert!(error.ends_with("no.png: no such file or folder"), "{error}");
    let args = DiffArgs { a, b, metric: Metric::Mse, max: None, output: Some("map.jpg".into()), json: false };
    assert_eq!(
        run(&args, false).unwrap_err().to_string(),
        "--output map.jpg: the error map can only be written as .png"
    );
}
