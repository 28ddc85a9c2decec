//! How far a picture is from a reference that has an error of its own, and what two pictures along the same paths would differ by
//! without noise.

use anyhow::Result;
use palette::color_difference::Ciede2000;
use palette::{IntoColor, Lab, Srgb};
use rayon::prelude::*;

use super::table::{Errors, Interval, WorstPixel};
use etalon::image::Picture;
use etalon::image::metric::{AnyPicture, Comparison, Metric, compare};
use etalon::image::png::Display;
use etalon::image::tone::{self, ToneMap};

/// Added to squares that are divided by, as everywhere.
const FLOOR: f64 = 0.01;

/// Squares of which a spread can be told.
const FEWEST: usize = 16;

/// What errors are errors against.
pub struct Truth {
    /// Radiance.
    pub film: Picture,
    /// The mean of one half of its samples.
    pub half: Picture,
    /// Both as they would be shown, with the other half.
    pub shown: ShownReference,
    /// As it is shown.
    pub display: Display,
}

/// Squared differences of a pixel's colours over the squares of the reference's.
fn relative(x: [f32; 4], y: [f32; 4], reference: [f32; 4]) -> f64 {
    let term = |c: usize| {
        let (x, y, r) = (f64::from(x[c]), f64::from(y[c]), f64::from(reference[c]));
        x * y / (r * r + FLOOR)
    };
    (term(0) + term(1) + term(2)) / 3.0
}

fn minus(a: [f32; 4], b: [f32; 4]) -> [f32; 4] {
    std::array::from_fn(|c| a[c] - b[c])
}

impl Truth {
    /// Errors of a picture, and FLIP's map of them.
    ///
    /// With T what the reference R = T + e converges to, (X − R)² is (X − T)² + e² in the mean, and its spread that of 2(X − T)e;
    /// e² is what the reference's halves tell.
    ///
    /// # Errors
    /// When the pictures cannot be compared.
    pub fn errors(&self, film: &Picture, display: &Display) -> Result<(Errors, Comparison)> {
        let flip =
            compare(Metric::Flip, &AnyPicture::Display(self.display.clone()), &AnyPicture::Display(display.clone()))?;
        let mut sorted = flip.map.clone();
        sorted.sort_by(f32::total_cmp);
        let p95 = sorted.get(sorted.len() * 95 / 100).copied().unwrap_or_default();
        let n = film.rgba.len() as f64;
        let (mut raw, mut own, mut spread, mut squares) = (0.0, 0.0, 0.0, 0.0);
        for ((x, r), half) in film.rgba.iter().zip(&self.film.rgba).zip(&self.half.rgba) {
            if [x, r, half].iter().any(|pixel| pixel.iter().any(|value| !value.is_finite())) {
                continue;
            }
            let (d, e) = (minus(*x, *r), minus(*half, *r));
            let (d2, e2) = (relative(d, d, *r), relative(e, e, *r));
            raw += d2;
            own += e2;
            spread += 4.0 * d2 * e2;
            squares += d[..3].iter().map(|d| f64::from(*d).powi(2)).sum::<f64>();
        }
        let deviation = spread.sqrt() / n;
        let errors = Errors {
            flip_mean: flip.value,
            flip_p95: f64::from(p95),
            relmse: Interval::around((raw - own) / n, deviation),
            rmse: (squares / (3.0 * n)).sqrt(),
            delta_e_mean: delta_e(&self.display, display),
            worst_pixel: WorstPixel { x: flip.worst[0], y: flip.worst[1], error: flip.worst_error },
        };
        Ok((errors, flip))
    }
}

/// Mean CIEDE2000 of two displayed pictures.
fn delta_e(a: &Display, b: &Display) -> f64 {
    let lab = |pixel: &[u8; 4]| -> Lab { Srgb::new(pixel[0], pixel[1], pixel[2]).into_format::<f32>().into_color() };
    let one = |(a, b): (&[u8; 4], &[u8; 4])| if a == b { 0.0 } else { f64::from(lab(a).difference(lab(b))) };
    let sum: f64 = a
        .rgba
        .par_chunks(4096)
        .zip(b.rgba.par_chunks(4096))
        .map(|(a, b)| a.iter().zip(b).map(one).sum::<f64>())
        .collect::<Vec<_>>()
        .iter()
        .sum();
    sum / a.rgba.len().max(1) as f64
}

/// Displayed values 0 to 1 of a half of a picture's samples, channel by channel.
pub type Shown = Vec<[f32; 3]>;

/// What a display shows of radiance.
#[must_use]
pub fn shown(picture: &Picture, tonemap: ToneMap, exposure: f32) -> Shown {
    let scale = f64::from(exposure).exp2();
    let one = |pixel: &[f32; 4]| {
        let curve = tonemap.apply([0, 1, 2].map(|c| f64::from(pixel[c]) * scale));
        curve.map(|light| tone::srgb_encode(light.clamp(0.0, 1.0)) as f32)
    };
    picture.rgba.par_iter().map(one).collect()
}

/// The mean squared difference of displayed values of what two pictures converge to, in squares of `side` by `side` pixels. Their
/// halves A and B share no random numbers, so that the product of both differences is the square without noise in the mean; the
/// spread over the squares says how well that is known. Displayed values are bounded: single pixels that are far too bright count as
/// much as others. Larger squares have less noise, and see no difference that is finer than they are.
#[must_use]
pub fn without_noise(a: &[Shown; 2], b: &[Shown; 2], width: usize, side: usize) -> Interval {
    let across = width / side;
    let down = a[0].len() / width.max(1) / side;
    let mean = |half: usize, x: usize, y: usize, c: usize| -> f64 {
        let rows = y * side..(y + 1) * side;
        let all = rows.flat_map(|row| row * width + x * side..row * width + (x + 1) * side);
        let sum: f64 = all.map(|i| f64::from(a[half][i][c]) - f64::from(b[half][i][c])).sum();
        sum / (side * side) as f64
    };
    let products: Vec<f64> = (0..across * down)
        .into_par_iter()
        .map(|i| {
            let (x, y) = (i % across, i / across);
            (0..3).map(|c| mean(0, x, y, c) * mean(1, x, y, c)).sum::<f64>() / 3.0
        })
        .collect();
    let n = products.len().max(1) as f64;
    let middle = products.iter().sum::<f64>() / n;
    if products.len() < FEWEST {
        // Of displayed values no mean square is above 1: nothing is known.
        return Interval::around(middle, 1.0);
    }
    let spread = products.iter().map(|p| (p - middle) * (p - middle)).sum::<f64>() / (n - 1.0);
    Interval::around(middle, (spread / n).sqrt())
}

/// The same, as fine as noise allows, with the side of the squares.
#[must_use]
pub fn told_apart(a: &[Shown; 2], b: &[Shown; 2], width: usize) -> (Interval, u32) {
    let fine = without_noise(a, b, width, 1);
    let coarse = [4, 16].map(|side| (without_noise(a, b, width, side), side as u32));
    // What is told apart by finer squares is told better.
    let told = coarse.into_iter().find(|(found, _)| found.surely() > 0.0).filter(|_| fine.surely() <= 0.0);
    told.unwrap_or((fine, 1))
}

/// A reference as it would be shown: from all of its samples, and from each half of them.
pub struct ShownReference {
    /// All.
    pub film: Shown,
    /// Halves.
    pub halves: [Shown; 2],
}

/// How much more the mean squared error of displayed values is of `x` than of `b` against what a reference converges to: about two
/// standard errors either way.
///
/// Against the truth t it is x² − b² − 2(x − b)t in the mean, linear in t: the reference's noise adds no square to it. A tone curve is
/// not straight, so that what is shown of n samples is t + c/n in the mean: F has c/n, the halves r₁ and r₂ have 2c/n, and
/// 2F − (r₁ + r₂)/2 has nothing of it (the jackknife). What noise is left is that of (x − b)(r₁ + r₂), which r₁ − r₂ tells, the
/// halves being independent; and what the jackknife took away is added to the interval, since c/n is the first term alone.
#[must_use]
pub fn more_error(x: &Display, b: &Display, reference: &ShownReference) -> Interval {
    let (mut more, mut spread, mut curve) = (0.0, 0.0, 0.0);
    let ShownReference { film, halves: [r1, r2] } = reference;
    for (i, (x, b)) in x.rgba.iter().zip(&b.rgba).enumerate() {
        for c in 0..3 {
            let [x, b] = [x[c], b[c]].map(|byte| f64::from(byte) / 255.0);
            let [f, r1, r2] = [film, r1, r2].map(|shown| f64::from(shown[i][c]));
            more += x * x - b * b - (x - b) * (4.0 * f - r1 - r2);
            spread += ((x - b) * (r1 - r2)).powi(2);
            curve += 2.0 * (x - b) * (f - 0.5 * (r1 + r2));
        }
    }
    // The colours of a pixel have their noise in common: as if one of them told that of all three.
    let n = 3.0 * x.rgba.len().max(1) as f64;
    Interval::around(more / n, (3.0 * spread).sqrt() / n + 0.5 * curve.abs() / n)
}

/// Mean squared difference of displayed values 0 to 1.
#[must_use]
pub fn display_mse(a: &Display, b: &Display) -> f64 {
    let square = |(a, b): (&[u8; 4], &[u8; 4])| {
        (0..3).map(|c| ((f64::from(a[c]) - f64::from(b[c])) / 255.0).powi(2)).sum::<f64>() / 3.0
    };
    a.rgba.iter().zip(&b.rgba).map(square).sum::<f64>() / a.rgba.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uniform in −1 … 1.
    fn noise(index: usize) -> f32 {
        let mut x = (index as u64).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) >> 40) as f32 / (1_u64 << 23) as f32 - 1.0
    }

    fn picture(value: impl Fn(usize) -> f32) -> Picture {
        let rgba = (0..64 * 64)
            .map(|i| {
                let v = value(i);
                [v, v, v, 1.0]
            })
            .collect();
        Picture { width: 64, height: 64, rgba }
    }

    fn shown(p: &Picture) -> Display {
        let rgba = p
            .rgba
            .iter()
            .map(|p| {
                let v = (p[0].clamp(0.0, 1.0) * 255.0) as u8;
                [v, v, v, 255]
            })
            .collect();
        Display { width: p.width, height: p.height, rgba }
    }

    #[test]
    fn a_noisy_reference_takes_nothing_from_an_error() {
        let (a, b) = (picture(|i| 0.5 + 0.02 * noise(i)), picture(|i| 0.5 + 0.02 * noise(i + 100_000)));
        let film = picture(|i| 0.5 * (a.rgba[i][0] + b.rgba[i][0]));
        let truth = Truth {
            display: shown(&film),
            film,
            half: a,
            shown: ShownReference { film: Vec::new(), halves: [Vec::new(), Vec::new()] },
        };
        // Off by 0.05 everywhere: 0.0025 / (0.25 + 0.01).
        let off = picture(|_| 0.55);
        let (errors, _) = truth.errors(&off, &shown(&off)).unwrap();
        let expected = 0.0025 / 0.26;
        assert!(errors.relmse.low < expected && expected < errors.relmse.high, "{errors:?}");
        assert!((errors.relmse.median / expected - 1.0).abs() < 0.05, "{errors:?}");
        let right = picture(|_| 0.5);
        let (errors, _) = truth.errors(&right, &shown(&right)).unwrap();
        assert!(errors.relmse.median.abs() < 3e-4, "{errors:?}");
    }

    #[test]
    fn a_noisy_reference_says_which_is_nearer_or_that_it_cannot() {
        // Bytes 128 and 140; the truth is 0.55, 140.25 / 255.
        let flat = |byte: u8| Display { width: 64, height: 64, rgba: vec![[byte, byte, byte, 255]; 64 * 64] };
        let half = |seed: usize, noise_of: f32| -> Shown {
            (0..64 * 64).map(|i| [0.55 + noise_of * noise(i + seed * 100_000); 3]).collect()
        };
        let square = |byte: f64| (byte / 255.0 - 0.55).powi(2);
        let expected = square(128.0) - square(140.0);
        let of = |r1: Shown, r2: Shown| {
            let film = r1.iter().zip(&r2).map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))).collect();
            ShownReference { film, halves: [r1, r2] }
        };
        let found = more_error(&flat(128), &flat(140), &of(half(1, 0.2), half(2, 0.2)));
        assert!(found.low < expected && expected < found.high && found.surely() > 0.0, "{found:?} {expected}");
        // Two that are as far off: nothing is sure, whatever noise says.
        let found = more_error(&flat(137), &flat(143), &of(half(3, 0.2), half(4, 0.2)));
        assert!(found.low < 0.0 && found.high > 0.0, "{found:?}");
        // The intervals cover the truth in about 95 of 100 draws.
        let covers = |seed: usize| {
            let found = more_error(&flat(128), &flat(140), &of(half(2 * seed, 0.3), half(2 * seed + 1, 0.3)));
            found.low <= expected && expected <= found.high
        };
        let covered = (10..110).filter(|&seed| covers(seed)).count();
        assert!(covered >= 90, "{covered} of 100");
    }

    /// A curve that bends, x², shows the noise of a reference as brightness, and its halves show twice of it.
    #[test]
    fn what_a_curve_makes_of_noise_is_taken_away() {
        let flat = |byte: u8| Display { width: 64, height: 64, rgba: vec![[byte, byte, byte, 255]; 64 * 64] };
        // In pairs of which the mean has no noise, so that what the curve makes of it is all there is.
        let sign = |i: usize| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let half = |seed: usize| -> Vec<f32> {
            (0..64 * 64).map(|i| 0.7 + 0.3 * sign(i) * noise(i / 2 + seed * 100_000)).collect()
        };
        let (a, b) = (half(1), half(2));
        let shown = |value: &dyn Fn(usize) -> f32| -> Shown { (0..64 * 64).map(|i| [value(i).powi(2); 3]).collect() };
        let film = shown(&|i| 0.5 * (a[i] + b[i]));
        let reference = ShownReference { film, halves: [shown(&|i| a[i]), shown(&|i| b[i])] };
        let (x, base) = (140.0 / 255.0, 128.0 / 255.0);
        let expected = x * x - base * base - 2.0 * (x - base) * 0.49;
        let found = more_error(&flat(140), &flat(128), &reference);
        assert!(found.low < expected && expected < found.high, "{found:?} {expected}");
        // The film shows half of 0.3² / 3 too much in the mean: taken for the truth it would be ten times this bound off.
        let bent = 2.0 * (x - base) * 0.5 * 0.03;
        assert!((found.median - expected).abs() < 0.1 * bent, "{found:?} {expected} {bent}");
    }

    #[test]
    fn differences_of_noisy_pictures_are_those_of_their_means() {
        let half = |seed: usize, off: f32| -> Shown {
            (0..64 * 64).map(|i| [0.5 + off + 0.2 * noise(i + seed * 100_000); 3]).collect()
        };
        let (a, same) = ([half(1, 0.0), half(2, 0.0)], [half(3, 0.0), half(4, 0.0)]);
        let nothing = without_noise(&a, &same, 64, 1);
        assert!(nothing.low < 0.0 && nothing.high > 0.0 && nothing.high < 2e-3, "{nothing:?}");
        let other = [half(3, 0.05), half(4, 0.05)];
        let found = without_noise(&a, &other, 64, 1);
        assert!(found.low < 0.0025 && 0.0025 < found.high && found.low > 0.0, "{found:?}");
        // Too little for pixels, but not for squares.
        let little = [half(3, 0.02), half(4, 0.02)];
        let (found, side) = told_apart(&a, &little, 64);
        assert!(side > 1 && found.median > 2e-4 && found.median < 6e-4, "{side} {found:?}");
        assert_eq!(told_apart(&a, &other, 64).1, 1);
        let (found, _) = told_apart(&a, &same, 64);
        assert!(found.surely() < 0.0, "{found:?}");
    }

    #[test]
    fn what_is_shown_is_bounded() {
        let bright = Picture { width: 1, height: 1, rgba: vec![[1e6, 0.25, -1.0, 1.0]] };
        let [[r, g, b]] = super::shown(&bright, ToneMap::Linear, 1.0)[..] else { panic!("one pixel") };
        assert!(r == 1.0 && b == 0.0 && (f64::from(g) - tone::srgb_encode(0.5)).abs() < 1e-6, "{r} {g} {b}");
    }
}
