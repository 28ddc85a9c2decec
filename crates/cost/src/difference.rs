//! Unbiased squared differences of noisy pictures: the error of a picture against a reference that is itself a Monte
//! Carlo estimate, and the difference of two path-traced pictures without their noise.
//!
//! The estimates use pairs of half buffers with independent random numbers; docs/cost.md, "Error", derives them.
//! Metrics: FLIP (Andersson et al. 2020), CIEDE2000, and the relative mean squared error.

use anyhow::{Result, ensure};
use palette::color_difference::Ciede2000;
use palette::{IntoColor, Lab, Srgb};
use rayon::prelude::*;

use super::statistics::{Estimate, Interval, resolved};
use super::table::{Errors, WorstPixel};
use etalon::image::Picture;
use etalon::image::metric::{AnyPicture, Comparison, Metric, compare};
use etalon::image::png::Display;
use etalon::image::tone::ViewTransform;

/// Added to the squared radiance of the reference in the denominator of the relative squared error.
const FLOOR: f64 = 0.01;

/// Least number of pixel blocks for which a variance is estimated.
const FEWEST: usize = 16;
/// Side lengths in pixels of the blocks over which noisy pictures are averaged and compared.
const SIDES: [u32; 3] = [1, 4, 16];

/// The reference that errors are measured against.
pub struct Truth {
    /// Radiance of the reference.
    pub film: Picture,
    /// Half buffer: mean of one half of the samples.
    pub half: Picture,
    /// Estimates of the display values without noise.
    pub shown: ShownReference,
    /// Display values of the reference.
    pub display: Display,
}

/// Product of two differences of a pixel, over the squared radiance of the reference; mean over the channels.
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
    /// Errors of a picture, and the FLIP error map.
    ///
    /// The reference is R = T + e, where T is its limit and e its noise. The expected value of (X − R)² is (X − T)² +
    /// e², and its variance comes from 2(X − T)e. The half buffers of the reference estimate e².
    ///
    /// # Errors
    /// When the pictures cannot be compared.
    pub fn errors(&self, film: &Picture, display: &Display) -> Result<(Errors, Comparison)> {
        let flip =
            compare(Metric::Flip, &AnyPicture::Display(self.display.clone()), &AnyPicture::Display(display.clone()))?;
        let mut sorted = flip.map.clone();
        sorted.sort_by(f32::total_cmp);
        let p95 = sorted.get(sorted.len() * 95 / 100).copied().unwrap_or_default();
        let (mut n, mut raw, mut own, mut spread, mut squares) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for ((x, r), half) in film.rgba.iter().zip(&self.film.rgba).zip(&self.half.rgba) {
            if [x, r, half].iter().any(|pixel| pixel.iter().any(|value| !value.is_finite())) {
                continue;
            }
            n += 1.0;
            let (d, e) = (minus(*x, *r), minus(*half, *r));
            let (d2, e2) = (relative(d, d, *r), relative(e, e, *r));
            raw += d2;
            own += e2;
            spread += 4.0 * d2 * e2;
            squares += d[..3].iter().map(|d| f64::from(*d).powi(2)).sum::<f64>();
        }
        ensure!(n > 0.0, "no pixel is finite in both the picture and the reference");
        let deviation = spread.sqrt() / n;
        let errors = Errors {
            error: self.shown.error_interval(display),
            flip_mean: flip.value,
            flip_p95: f64::from(p95),
            relmse: Estimate { mean: (raw - own) / n, deviation, bias: 0.0 }.interval(),
            rmse: (squares / (3.0 * n)).sqrt(),
            delta_e_mean: delta_e(&self.display, display),
            worst_pixel: WorstPixel { x: flip.worst[0], y: flip.worst[1], error: flip.worst_error },
        };
        Ok((errors, flip))
    }
}

/// Mean CIEDE2000 colour difference of two displayed pictures.
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

/// Display values 0 to 1 of a half buffer, RGB per pixel.
pub type Shown = Vec<[f32; 3]>;

/// Display values of radiance.
#[must_use]
pub fn shown(picture: &Picture, view: &ViewTransform) -> Shown {
    picture.rgba.par_iter().map(|pixel| view.shown(*pixel).map(|value| value as f32)).collect()
}

/// Unbiased estimate of the mean squared difference between the limits of two pictures, in display values averaged over
/// blocks of `side` × `side` pixels.
///
/// The half buffers A and B of each picture share no random numbers, so the expected product of the two differences is
/// the square without noise. The variance over the blocks gives the standard error. Display values are bounded, so that
/// fireflies count no more than other pixels. Larger blocks have less noise, but hide finer differences.
#[must_use]
pub fn unbiased_squared_difference(a: &[Shown; 2], b: &[Shown; 2], width: usize, side: usize) -> Estimate {
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
        // Too few blocks: the deviation is the largest possible mean square of display values, 1.
        return Estimate { mean: middle, deviation: 1.0, bias: 0.0 };
    }
    let spread = products.iter().map(|p| (p - middle) * (p - middle)).sum::<f64>() / (n - 1.0);
    Estimate { mean: middle, deviation: (spread / n).sqrt(), bias: 0.0 }
}

/// [`unbiased_squared_difference`] for several block sizes, the smallest first.
#[must_use]
pub fn in_blocks(a: &[Shown; 2], b: &[Shown; 2], width: usize) -> Vec<(u32, Estimate)> {
    SIDES.map(|side| (side, unbiased_squared_difference(a, b, width, side as usize))).into()
}

/// The smallest block size with a significant difference, or else the smallest block size.
#[must_use]
pub fn significant(squares: &[(u32, Estimate)], standard_errors: f64) -> Option<(u32, Estimate)> {
    squares.iter().find(|(_, found)| found.is_above(standard_errors)).or(squares.first()).copied()
}

/// Display values of a reference without its noise: two estimates with independent random numbers, from its even and
/// odd samples.
///
/// The tone curve is not linear, so the display values of n samples are biased. The bias of twice as many samples is
/// smaller by a factor r. For a smooth curve and noise with finite variance r is 1/2; where few paths carry most of the
/// light, r is closer to 1. The mean brightness of quarters, halves and all of the samples gives r, and the rest of the
/// geometric series is added (Aitken extrapolation; for r = 1/2 it is the jackknife of Quenouille). No series predicts
/// every scene (docs/cost.md has figures of `study:pool`): hence the factor of the bound of the bias.
pub struct ShownReference {
    /// The two estimates.
    estimates: [Shown; 2],
    /// Bound of the remaining bias, as a root mean square over the picture.
    off: f64,
}

/// Range to which r is clamped; for larger r the extrapolated rest would exceed the known values.
const BELIEVED: [f64; 2] = [0.3, 0.85];
/// Change of the mean display value below which r would be rounding noise.
const NO_CURVE: f64 = 1e-5;
/// Largest side in pixels of the blocks in which the change is estimated, and their least number.
const SQUARE: usize = 16;
const SQUARES: usize = 32;
/// Factor of the bias bound. The measured bias was 0.9 (`study:cornell`), 0.5 (`lamps`), 0.6 (`nested`) and 2.2
/// (`pool`, whose water few paths light) times the rest of the series, for 16 samples against 1024 and 4096.
const CAUTION: f64 = 3.0;

/// Sums over pixels and channels for an error and its standard error.
#[derive(Default, Clone, Copy)]
struct SquaredSums {
    value: f64,
    /// Variance of `value` due to the noise of the reference.
    variance: f64,
    /// Squared factors by which the bias of the reference enters `value`.
    weight: f64,
}

impl SquaredSums {
    fn add(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            variance: self.variance + other.variance,
            weight: self.weight + other.weight,
        }
    }

    /// Means over `pixels` pixels: value, standard error and weight. The noise of the three channels of a pixel is
    /// treated as fully correlated.
    fn means(self, pixels: usize) -> [f64; 3] {
        let n = 3.0 * pixels.max(1) as f64;
        [self.value / n, (3.0 * self.variance.max(0.0)).sqrt() / n, self.weight / n]
    }
}

impl ShownReference {
    /// Estimates from the means of consecutive parts of the samples, alternately of even and odd samples; two parts of
    /// each, or another power of two.
    #[must_use]
    pub fn of(parts: &[Picture], view: &ViewTransform) -> Self {
        let pieces = |parts: &[&Picture], side: usize| -> Shown {
            let pieces: Vec<Shown> = parts.chunks(side).map(|piece| shown(&mean_of(piece), view)).collect();
            let mean = |i: usize| {
                std::array::from_fn(|c| pieces.iter().map(|piece| piece[i][c]).sum::<f32>() / pieces.len() as f32)
            };
            (0..pieces[0].len()).into_par_iter().map(mean).collect()
        };
        let all: Vec<&Picture> = parts.iter().collect();
        // For each half buffer: mean display values of its own two halves, and display values of all of it.
        let levels = [0, 1].map(|half| {
            let own: Vec<&Picture> = parts.iter().skip(half).step_by(2).collect();
            [pieces(&own, own.len() / 2), pieces(&own, own.len())]
        });
        let brightness = |shown: &Shown| -> f64 {
            shown.iter().flatten().map(|value| f64::from(*value)).sum::<f64>() / (3 * shown.len().max(1)) as f64
        };
        let of_halves = |level: usize| 0.5 * (brightness(&levels[0][level]) + brightness(&levels[1][level]));
        let [first, second, third] = [of_halves(0), of_halves(1), brightness(&pieces(&all, all.len()))];
        let factor = if (second - first).abs() < NO_CURVE { 0.5 } else { (third - second) / (second - first) };
        let factor = factor.clamp(BELIEVED[0], BELIEVED[1]);
        let rest = (factor / (1.0 - factor)) as f32;
        let estimate = |[before, all]: &[Shown; 2]| -> Shown {
            all.iter().zip(before).map(|(a, b)| std::array::from_fn(|c| a[c] + rest * (a[c] - b[c]))).collect()
        };
        let estimates = [estimate(&levels[0]), estimate(&levels[1])];
        // Change from the halves of a half buffer to the half buffer, squared without noise by means of the other half
        // buffer.
        let side = ((parts[0].rgba.len() / SQUARES) as f64).sqrt() as usize;
        let change = unbiased_squared_difference(
            &[levels[0][1].clone(), levels[1][1].clone()],
            &[levels[0][0].clone(), levels[1][0].clone()],
            parts[0].width as usize,
            side.clamp(1, SQUARE),
        );
        let change = (change.mean + 2.0 * change.deviation).clamp(0.0, 1.0).sqrt();
        Self { estimates, off: CAUTION * change * factor * factor / (1.0 - factor) }
    }

    /// The same with another bias of at most `off`, as a root mean square over the picture.
    #[must_use]
    pub fn also_off(self, off: f64) -> Self {
        Self { off: self.off + off, ..self }
    }

    /// A picture that is taken as exact.
    #[must_use]
    pub fn exact(display: &Display) -> Self {
        let values: Shown = display.rgba.iter().map(values).collect();
        Self { estimates: [values.clone(), values], off: 0.0 }
    }

    /// Means over the picture of `of(pixel, channel, [j₁, j₂], v²)`, where j₁ and j₂ are the estimates and v is the
    /// variance of their noise. Neighbouring pixels have about the same v. With independent random numbers the expected
    /// product of their (j₁ − j₂)² is 4v² for any noise distribution; the square within one pixel would depend on the
    /// distribution. Their numbers are correlated by ρ = −0.1 or so (shaders/lib/random.glsl), which adds 2ρ², some 2
    /// %, to the product, and Σρ² over the neighbours, 2 to 4 %, to the variance of a mean of products of both halves.
    /// Neither is counted.
    fn means(&self, of: impl Fn(usize, usize, [f64; 2], f64) -> SquaredSums + Sync) -> [f64; 3] {
        let [j1, j2] = &self.estimates;
        let square = |i: usize, c: usize| (f64::from(j1[i][c]) - f64::from(j2[i][c])).powi(2);
        let neighbour = |i: usize| if i + 1 < j1.len() { i + 1 } else { i.saturating_sub(1) };
        let pixel = |i: usize| {
            let all = (0..3)
                .map(|c| of(i, c, [j1[i][c], j2[i][c]].map(f64::from), 0.25 * square(i, c) * square(neighbour(i), c)));
            all.fold(SquaredSums::default(), SquaredSums::add)
        };
        // Blocks of fixed size make the sums equal on every machine.
        let pixels: Vec<usize> = (0..j1.len()).collect();
        let pieces: Vec<SquaredSums> = pixels
            .par_chunks(4096)
            .map(|piece| piece.iter().map(|&i| pixel(i)).fold(SquaredSums::default(), SquaredSums::add))
            .collect();
        pieces.into_iter().fold(SquaredSums::default(), SquaredSums::add).means(j1.len())
    }

    /// Unbiased mean squared error of display values 0 to 1 against the limit of the reference.
    ///
    /// With estimates j = t + e of the limit t, the expected value of (x − j₁)(x − j₂) is (x − t)²: independent noise
    /// adds no square. If e has variance v, the product has variance 2(x − t)²v + v², and the expected value of (x −
    /// j₁)(x − j₂)(j₁ − j₂)² is 2(x − t)²v − 2v². If t has a bias of β (root mean square), the root of the mean squared
    /// error is off by at most β (triangle inequality).
    #[must_use]
    pub fn error(&self, x: &Display) -> Estimate {
        let [mean, deviation, _] = self.means(|i, c, [j1, j2], squared| {
            let x = f64::from(x.rgba[i][c]) / 255.0;
            let value = (x - j1) * (x - j2);
            SquaredSums { value, variance: value * (j1 - j2) * (j1 - j2) + 3.0 * squared, weight: 0.0 }
        });
        Estimate { mean, deviation, bias: 2.0 * mean.max(0.0).sqrt() * self.off + self.off * self.off }
    }

    /// Confidence interval of the root mean squared error of display values 0 to 1. Noise moves the square, and a bias
    /// β the root, by at most β (triangle inequality).
    #[must_use]
    pub fn error_interval(&self, x: &Display) -> Interval {
        let Interval { median, low, high } = Estimate { bias: 0.0, ..self.error(x) }.interval().root();
        Interval { median, low: (low - self.off).max(0.0), high: high + self.off }
    }

    /// Unbiased difference of the mean squared errors of `x` and `b`: x² − b² − (x − b)(j₁ + j₂). It is linear in the
    /// reference, so that the noise common to both errors cancels. A bias β of the reference changes it by at most 2β
    /// times the root mean square of x − b (Cauchy–Schwarz inequality).
    #[must_use]
    pub fn more_error(&self, x: &Display, b: &Display) -> Estimate {
        let [mean, deviation, weight] = self.means(|i, c, [j1, j2], _| {
            let [x, b] = [x, b].map(|picture| f64::from(picture.rgba[i][c]) / 255.0);
            let value = x * x - b * b - (x - b) * (j1 + j2);
            SquaredSums { value, variance: ((x - b) * (j1 - j2)).powi(2), weight: (x - b) * (x - b) }
        });
        Estimate { mean, deviation, bias: 2.0 * weight.sqrt() * self.off }
    }

    /// Resolution of the reference: the least root mean squared error of display values that is significant at so many
    /// standard errors.
    #[must_use]
    pub fn resolution(&self, standard_errors: f64) -> f64 {
        let [_, deviation, _] =
            self.means(|_, _, _, squared| SquaredSums { variance: squared, ..SquaredSums::default() });
        resolved(self.off, (standard_errors * deviation).sqrt())
    }
}

/// Mean of pictures of one size.
pub(super) fn mean_of(pictures: &[&Picture]) -> Picture {
    let [width, height] = [pictures[0].width, pictures[0].height];
    let mean =
        |i: usize| std::array::from_fn(|c| pictures.iter().map(|p| p.rgba[i][c]).sum::<f32>() / pictures.len() as f32);
    Picture { width, height, rgba: (0..pictures[0].rgba.len()).into_par_iter().map(mean).collect() }
}

fn values(pixel: &[u8; 4]) -> [f32; 3] {
    [0, 1, 2].map(|c| f32::from(pixel[c]) / 255.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use etalon::image::tone::{ToneMap, srgb_encode};
    use etalon::optics::SplitMix64;

    const PLAIN: ViewTransform = ViewTransform { curve: ToneMap::Linear, exposure: 0.0, background: None };

    /// Uniform random number in [−1, 1).
    fn noise(index: usize) -> f32 {
        SplitMix64::new(index as u64).between(-1.0, 1.0) as f32
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
        let truth = Truth { shown: ShownReference::exact(&shown(&film)), display: shown(&film), film, half: a };
        // An error of 0.05 everywhere: 0.0025 / (0.25 + 0.01).
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
    fn pixels_that_are_not_finite_dilute_no_error() {
        let film = picture(|_| 0.5);
        let exact = ShownReference::exact(&shown(&film));
        let truth = Truth { shown: exact, display: shown(&film), half: film.clone(), film };
        let off = |i: usize| if i.is_multiple_of(4) { f32::NAN } else { 0.75 };
        let (errors, _) = truth.errors(&picture(off), &shown(&picture(|_| 0.75))).unwrap();
        assert!((errors.rmse - 0.25).abs() < 1e-12, "{errors:?}");
        let nothing = picture(|_| f32::NAN);
        assert!(truth.errors(&nothing, &shown(&nothing)).is_err());
    }

    fn flat(byte: u8) -> Display {
        Display { width: 64, height: 64, rgba: vec![[byte, byte, byte, 255]; 64 * 64] }
    }

    /// Two estimates of 0.55 with noise, without a tone curve.
    fn noisy(seed: usize, of: f32) -> ShownReference {
        let half =
            |seed: usize| -> Shown { (0..64 * 64).map(|i| [0.55 + of * noise(i + seed * 100_000); 3]).collect() };
        let [a, b] = [half(2 * seed), half(2 * seed + 1)];
        ShownReference { estimates: [a, b], off: 0.0 }
    }

    fn holds(found: Estimate, truth: f64) -> bool {
        found.interval().low <= truth && truth <= found.interval().high
    }

    #[test]
    fn errors_are_known_as_well_as_the_reference() {
        // Bytes 128 and 140; the truth is 0.55, 140.25 / 255.
        let square = |byte: f64| (byte / 255.0 - 0.55).powi(2);
        let expected = square(128.0) - square(140.0);
        let found = noisy(1, 0.2).more_error(&flat(128), &flat(140));
        assert!(holds(found, expected) && found.is_above(4.0), "{found:?} {expected}");
        // Both pictures have the same error, so the difference must not be significant.
        let found = noisy(2, 0.2).more_error(&flat(137), &flat(143));
        assert!(holds(found, 0.0), "{found:?}");
        // Errors above the resolution are significant.
        let (noise, right) = (noisy(3, 0.2), flat(140));
        assert!(!noise.error(&right).is_above(3.0), "{:?}", noise.error(&right));
        let resolution = noise.resolution(3.0);
        let off = ((0.55 + 1.5 * resolution) * 255.0).round() as u8;
        assert!(noise.error(&flat(off)).is_above(3.0), "{resolution} {:?}", noise.error(&flat(off)));
        assert!((resolution / noisy(3, 0.1).resolution(3.0) - 2.0).abs() < 1e-3);
        // The confidence intervals cover the true value in about 95 of 100 draws.
        let covered = |of: &dyn Fn(ShownReference) -> Estimate, truth: f64| {
            (10..110).filter(|&seed| holds(of(noisy(seed, 0.3)), truth)).count()
        };
        let more = covered(&|reference| reference.more_error(&flat(128), &flat(140)), expected);
        let error = covered(&|reference| reference.error(&flat(128)), square(128.0));
        let none = covered(&|reference| reference.error(&flat(140)), square(140.0));
        assert!(more >= 90 && error >= 90 && none >= 90, "{more}, {error} and {none} of 100");
    }

    /// Where noise and a bias are as large as the error, they add up in the root.
    #[test]
    fn a_bias_widens_the_interval_of_the_root() {
        let reference = || noisy(1, 0.05);
        let alone = reference().error_interval(&flat(140));
        let off = reference().also_off(0.01).error_interval(&flat(140));
        assert!((off.high - alone.high - 0.01).abs() < 1e-12 && off.low == 0.0, "{alone:?} {off:?}");
        assert!(off.high > reference().also_off(0.01).error(&flat(140)).interval().root().high);
        let far = reference().also_off(0.01).error_interval(&flat(200));
        let error = 200.0 / 255.0 - 0.55;
        assert!(far.low < error - 0.009 && error + 0.009 < far.high, "{far:?} {error}");
    }

    /// The sRGB curve is concave: noise darkens display values, and fewer samples darken them more.
    #[test]
    fn what_a_curve_makes_of_noise_is_taken_away() {
        let truth = srgb_encode(0.3);
        let byte = (truth * 255.0).round() as u8;
        let [x, b] = [byte + 6, byte - 6].map(|byte| f64::from(byte) / 255.0);
        let expected = (x - truth).powi(2) - (b - truth).powi(2);
        // Noise with finite variance; and light that one of fifty parts finds, which is clipped by the display.
        let even = |i: usize| 0.3 + 0.25 * noise(i);
        let rare = |i: usize| if noise(i) > 0.96 { 0.05 + 0.25 * 50.0 } else { 0.05 };
        for (name, value) in [("even", &even as &dyn Fn(usize) -> f32), ("rare", &rare)] {
            let parts: Vec<Picture> = (0..8).map(|k| picture(|i| value(i + k * 100_000))).collect();
            let reference = ShownReference::of(&parts, &PLAIN);
            let found = reference.more_error(&flat(byte + 6), &flat(byte - 6));
            assert!(holds(found, expected), "{name}: {found:?} {expected}");
            let error = reference.error(&flat(byte));
            assert!(error.interval().low < 1e-5 && error.interval().high > 0.0, "{name}: {error:?}");
            // The display values of the film itself have a larger bias.
            let film = mean_of(&parts.iter().collect::<Vec<_>>());
            let bent = super::shown(&film, &PLAIN).iter().map(|v| f64::from(v[0]) - truth).sum::<f64>() / 4096.0;
            let off = 2.0 * (x - b) * bent.abs();
            assert!((found.mean - expected).abs() < 0.6 * off || off < 1e-5, "{name}: {found:?} {expected} {off}");
        }
    }

    #[test]
    fn differences_of_noisy_pictures_are_those_of_their_means() {
        let half = |seed: usize, off: f32| -> Shown {
            (0..64 * 64).map(|i| [0.5 + off + 0.2 * noise(i + seed * 100_000); 3]).collect()
        };
        let (a, same) = ([half(1, 0.0), half(2, 0.0)], [half(3, 0.0), half(4, 0.0)]);
        let nothing = unbiased_squared_difference(&a, &same, 64, 1);
        assert!(holds(nothing, 0.0) && nothing.interval().high < 2e-3, "{nothing:?}");
        let other = [half(3, 0.05), half(4, 0.05)];
        let found = unbiased_squared_difference(&a, &other, 64, 1);
        assert!(holds(found, 0.0025) && found.is_above(2.0), "{found:?}");
        // Too small for single pixels, but significant in blocks.
        let little = [half(3, 0.02), half(4, 0.02)];
        let found_in = |b: &[Shown; 2]| significant(&in_blocks(&a, b, 64), 3.0).expect("squares");
        let (side, found) = found_in(&little);
        assert!(side > 1 && found.mean > 2e-4 && found.mean < 6e-4, "{side} {found:?}");
        assert_eq!(found_in(&other).0, 1);
        assert!(!found_in(&same).1.is_above(3.0), "{:?}", found_in(&same));
    }

    #[test]
    fn what_is_shown_is_bounded() {
        let bright = Picture { width: 1, height: 1, rgba: vec![[1e6, 0.25, 0.0, 1.0]] };
        let [[r, g, b]] = super::shown(&bright, &ViewTransform { exposure: 1.0, ..PLAIN })[..] else {
            panic!("one pixel")
        };
        assert!(r == 1.0 && b == 0.0 && (f64::from(g) - srgb_encode(0.5)).abs() < 1e-6, "{r} {g} {b}");
    }
}
