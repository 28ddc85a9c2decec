//! Tone curves and the sRGB transfer against values worked out by hand, and the properties every curve has.

use etalon_image::tone::{AGX_IN, AGX_OUT, ToneMap, quantise, srgb_decode, srgb_encode};

fn near(got: f64, expected: f64, bound: f64) {
    assert!((got - expected).abs() <= bound, "{got} is not {expected}");
}

#[test]
fn names_on_the_command_line() {
    let names: Vec<&str> = ToneMap::ALL.iter().map(|curve| curve.name()).collect();
    assert_eq!(names, ["linear", "reinhard", "aces", "agx", "khronos-neutral"]);
}

#[test]
fn known_values() {
    assert_eq!(ToneMap::Linear.apply([0.25, 2.0, 1.0]), [0.25, 1.0, 1.0]);
    assert_eq!(ToneMap::Reinhard.apply([1.0, 3.0, 0.0]), [0.5, 0.75, 0.0]);
    // Rows of both matrices add up to 1, so grey 1 gives 1.024488063 / 1.654761.
    let grey = ToneMap::Aces.apply([1.0; 3]);
    near(grey[0], 0.619115, 2e-5);
    near(grey[2], 0.619115, 2e-5);
    // 0.5 - 0.04 lies under the compression; 1 - 0.04 becomes 1 - 0.24² / 0.44.
    near(ToneMap::KhronosNeutral.apply([0.5; 3])[1], 0.46, 1e-15);
    near(ToneMap::KhronosNeutral.apply([1.0; 3])[1], 1.0 - 0.0576 / 0.44, 1e-15);
    // Black in one channel: no offset, and the colour stays as it is.
    assert_eq!(ToneMap::KhronosNeutral.apply([0.7, 0.2, 0.0]), [0.7, 0.2, 0.0]);
    // AgX: the upper end of its range is the sum of the polynomial, 0.99858, to the power 2.2.
    let top = ToneMap::Agx.apply([1e4; 3]);
    let sum: f64 = 15.5 - 40.14 + 31.96 - 6.868 + 0.4298 + 0.1191 - 0.00232;
    near(top[0], sum.powf(2.2), 2e-3);
}

#[test]
fn every_curve_is_monotone_on_grey_and_stays_in_range() {
    for curve in ToneMap::ALL {
        assert_eq!(curve.apply([0.0; 3]), [0.0; 3], "{curve:?} of black");
        let mut before = [0.0; 3];
        for step in 0..20_000 {
            let x = 2f64.powf(f64::from(step) / 20_000.0 * 36.0 - 20.0);
            let now = curve.apply([x; 3]);
            for c in 0..3 {
                assert!((0.0..=1.0).contains(&now[c]), "{curve:?} of {x}: {now:?}");
                // AgX is a fit with rounding at its ends.
                assert!(now[c] >= before[c] - 1e-12, "{curve:?} falls at {x}");
            }
            before = now;
        }
    }
}

#[test]
fn no_input_gives_nan() {
    let hard = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0, 0.0, -0.0, f64::MAX, f64::MIN_POSITIVE, 5e-324, 1.0];
    for curve in ToneMap::ALL {
        for r in hard {
            for g in hard {
                for b in hard {
                    let out = curve.apply([r, g, b]);
                    assert!(out.iter().all(|x| (0.0..=1.0).contains(x)), "{curve:?} of {r} {g} {b}: {out:?}");
                }
            }
        }
        assert!(curve.apply([f64::INFINITY; 3])[0] > 0.98, "{curve:?} of infinity");
        assert_eq!(curve.apply([f64::NAN, -3.0, f64::NEG_INFINITY]), [0.0; 3]);
    }
}

#[test]
fn khronos_neutral_keeps_base_colours() {
    // Under the compression a colour only loses its offset, at most 0.04 and the same in every channel.
    for step in 0..=76 {
        let x = f64::from(step) / 100.0;
        let out = ToneMap::KhronosNeutral.apply([x, x * 0.5 + 0.04, 0.04 + x * 0.25]);
        let low = x.min(0.04 + x * 0.25);
        let offset = if low < 0.08 { low - 6.25 * low * low } else { 0.04 };
        near(out[0], x - offset, 1e-12);
        assert!(offset <= 0.04);
    }
}

#[test]
fn srgb_transfer() {
    near(srgb_encode(0.0031308), 0.04045, 1e-6);
    near(srgb_encode(0.5), 0.7353569830524495, 1e-12);
    near(srgb_decode(0.5), 0.21404114048223255, 1e-12);
    assert_eq!((srgb_encode(0.0), srgb_encode(-1.0), srgb_encode(f64::NAN)), (0.0, 0.0, 0.0));
    near(srgb_encode(1.0), 1.0, 1e-15);
    near(srgb_encode(f64::INFINITY), 1.0, 1e-15);
    for byte in 0..=255u8 {
        assert_eq!(quantise(srgb_encode(srgb_decode(f64::from(byte) / 255.0))), byte);
    }
    // Halves go up.
    assert_eq!((quantise(0.5 / 255.0), quantise(0.499 / 255.0), quantise(127.5 / 255.0)), (1, 0, 128));
    assert_eq!((quantise(-1.0), quantise(2.0), quantise(f64::NAN)), (0, 255, 0));
    assert_eq!(ToneMap::Linear.to_display([0.21404114048223255, 0.0, 9.0]), [128, 0, 255]);
}

#[test]
fn agx_matrices_undo_each_other() {
    for (row, out) in AGX_OUT.iter().enumerate() {
        let product = [0, 1, 2].map(|c| (0..3).map(|k| out[k] * AGX_IN[k][c]).sum::<f64>());
        product.iter().enumerate().for_each(|(c, &got)| near(got, if row == c { 1.0 } else { 0.0 }, 1e-6));
    }
}
