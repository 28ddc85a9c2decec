//! Image difference metrics: FLIP, SSIM, PSNR, mean squared error and relative mean squared error.
//!
//! Read Andersson et al., "FLIP: A Difference Evaluator for Alternating Images", HPG 2020; Wang et al., "Image Quality
//! Assessment: From Error Visibility to Structural Similarity", 2004. Two display pictures are compared in display
//! values 0..=1, two scene-linear pictures in radiance; other pairs are refused. The first picture is the reference. A
//! pixel with a non-finite sample in either picture is excluded from all values and counted.

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use rayon::prelude::*;
use serde::Serialize;
use strum::{EnumMessage, IntoStaticStr, VariantArray};

use super::png::Display;
use super::{Picture, exr, file, png, tone};

/// A metric of the difference of two pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, EnumMessage, IntoStaticStr, VariantArray, Serialize)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum Metric {
    /// Mean of the FLIP error, 0..=1: what an eye sees when it flips between the two (Andersson et al. 2020).
    #[default]
    Flip,
    /// Mean squared error.
    Mse,
    /// Root of the mean squared error.
    Rmse,
    /// Mean absolute error.
    Mae,
    /// Mean of squared error over squared reference plus 0.01.
    Relmse,
    /// Peak signal-to-noise ratio in dB; grows with likeness, infinite for equal pictures.
    Psnr,
    /// Structural similarity, -1..=1; grows with likeness, 1 for equal pictures (Wang et al. 2004).
    Ssim,
}

impl Metric {
    /// All metrics.
    pub const ALL: &[Self] = Self::VARIANTS;

    /// Name on the command line and in JSON.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Whether a larger value means more alike.
    pub fn grows_with_likeness(self) -> bool {
        matches!(self, Self::Psnr | Self::Ssim)
    }

    /// Whether `value` is good enough for `limit`: at most it, or at least it for psnr and ssim.
    pub fn within(self, value: f64, limit: f64) -> bool {
        if self.grows_with_likeness() { value >= limit } else { value <= limit }
    }
}

/// A scene-linear or a display picture.
#[derive(Debug, Clone, PartialEq)]
pub enum AnyPicture {
    /// Scene-linear radiance, from OpenEXR.
    Linear(Picture),
    /// Display values, from PNG, JPEG or WebP.
    Display(Display),
}

impl AnyPicture {
    /// Reads a picture; the contents decide, not the extension.
    pub fn load(path: &Path) -> Result<Self> {
        Self::decode(&file::read(path)?).with_context(|| format!("reading {}", path.display()))
    }

    /// Decodes the contents of a file: OpenEXR, PNG, JPEG or WebP.
    pub fn decode(bytes: &[u8]) -> Result<Self> {
        if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
            exr::decode_exr(bytes).map(Self::Linear)
        } else {
            png::decode_display(bytes).map(Self::Display)
        }
    }

    /// Width and height in pixels.
    pub fn size(&self) -> (u32, u32) {
        match self {
            Self::Linear(picture) => (picture.width, picture.height),
            Self::Display(picture) => (picture.width, picture.height),
        }
    }

    /// Name of the values that are compared: `radiance` or `display`.
    pub fn space(&self) -> &'static str {
        match self {
            Self::Linear(_) => "radiance",
            Self::Display(_) => "display",
        }
    }

    /// Pixels as f64 with premultiplied alpha.
    fn values(&self) -> Vec<[f64; 4]> {
        match self {
            Self::Linear(picture) => picture.rgba.iter().map(|pixel| pixel.map(f64::from)).collect(),
            Self::Display(picture) => picture
                .rgba
                .iter()
                .map(|pixel| {
                    let [r, g, b, a] = pixel.map(|byte| f64::from(byte) / 255.0);
                    [r * a, g * a, b * a, a]
                })
                .collect(),
        }
    }
}

/// Result of a comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// The metric.
    pub metric: Metric,
    /// Value of the metric; positive infinity for psnr of equal pictures.
    pub value: f64,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Values that were compared: `radiance` or `display`.
    pub space: &'static str,
    /// Pixels of the first and the second picture with a NaN or infinite sample; they are left out of the value.
    pub non_finite: [u64; 2],
    /// Error of every pixel, rows from the top: FLIP's for flip, else the largest absolute difference of a channel.
    /// 0 where a pixel was left out.
    pub map: Vec<f32>,
    /// Column and row of the pixel with the largest error of the map.
    pub worst: [u32; 2],
    /// Error of that pixel.
    pub worst_error: f64,
}

/// Compares two pictures of the same size and kind.
///
/// Colours are premultiplied by alpha. mse, rmse, mae, relmse and psnr are means over pixels and over the three
/// colours, and over alpha too where it is not 1 everywhere. psnr takes 1 as the peak of display values and the largest
/// colour of the first picture as the peak of radiance. flip and ssim work on display values over middle grey: radiance
/// is cut to 0..=1 and sRGB-encoded for them without a tone curve, and flip sees eight bits a channel at 67 pixels per
/// degree. ssim is the mean over R, G and B of the mean over all complete 11x11 Gaussian windows around a pixel that
/// counts.
pub fn compare(metric: Metric, a: &AnyPicture, b: &AnyPicture) -> Result<Comparison> {
    let (width, height) = a.size();
    ensure!(
        a.size() == b.size(),
        "the pictures have different sizes, {width}x{height} and {}x{}",
        b.size().0,
        b.size().1
    );
    if a.space() != b.space() {
        bail!("cannot compare a picture of radiance (EXR) with one of display values (PNG, JPEG, WebP)");
    }
    ensure!(width > 0 && height > 0, "the pictures have no pixels");
    let (mut first, mut second) = (a.values(), b.values());
    let mut non_finite = [0u64; 2];
    let mut left_out = Vec::with_capacity(first.len());
    for (x, y) in first.iter_mut().zip(&mut second) {
        let bad = [x.iter().any(|s| !s.is_finite()), y.iter().any(|s| !s.is_finite())];
        non_finite[0] += u64::from(bad[0]);
        non_finite[1] += u64::from(bad[1]);
        left_out.push(bad[0] || bad[1]);
        if bad[0] || bad[1] {
            // Equal and black on both sides: sums over pixels get nothing, and windows of ssim and flip stay finite.
            (*x, *y) = ([0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]);
        }
    }
    let counted = left_out.iter().filter(|&&is_out| !is_out).count();
    ensure!(counted > 0, "no pixel is finite in both pictures");
    let linear = a.space() == "radiance";
    let (value, map) = match metric {
        Metric::Flip => {
            let mut map = flip_map(width, height, &shown(&first, linear), &shown(&second, linear));
            // Flip spreads the errors of the neighbours.
            map.iter_mut().zip(&left_out).filter(|(_, is_out)| **is_out).for_each(|(error, _)| *error = 0.0);
            let sum: f64 = map.iter().map(|&error| f64::from(error)).sum();
            (sum / counted as f64, map)
        }
        Metric::Ssim => {
            let size = [width as usize, height as usize];
            let value = ssim(size, [&shown(&first, linear), &shown(&second, linear)], &left_out)?;
            (value, absolute_map(&first, &second))
        }
        _ => (pointwise(metric, &first, &second, counted, linear), absolute_map(&first, &second)),
    };
    let mut worst = (0usize, f32::NEG_INFINITY);
    for (index, &error) in map.iter().enumerate() {
        if error > worst.1 {
            worst = (index, error);
        }
    }
    Ok(Comparison {
        metric,
        value,
        width,
        height,
        space: a.space(),
        non_finite,
        map,
        worst: [(worst.0 % width as usize) as u32, (worst.0 / width as usize) as u32],
        worst_error: f64::from(worst.1),
    })
}

/// mse and its relatives over finite pixels; the others are zero on both sides and add nothing.
fn pointwise(metric: Metric, a: &[[f64; 4]], b: &[[f64; 4]], counted: usize, linear: bool) -> f64 {
    let opaque = a.iter().chain(b).all(|pixel| pixel[3] == 1.0);
    let channels = if opaque { 3 } else { 4 };
    let term = |x: f64, y: f64| match metric {
        Metric::Mae => (x - y).abs(),
        Metric::Relmse => (x - y) * (x - y) / (x * x + 0.01),
        _ => (x - y) * (x - y),
    };
    // In blocks, so that the running total never dwarfs the terms that are added to it.
    let sums: Vec<f64> = a
        .chunks(4096)
        .zip(b.chunks(4096))
        .map(|(a, b)| a.iter().zip(b).map(|(x, y)| (0..channels).map(|c| term(x[c], y[c])).sum::<f64>()).sum())
        .collect();
    let mean = sums.iter().sum::<f64>() / (counted * channels) as f64;
    match metric {
        Metric::Rmse => mean.sqrt(),
        Metric::Psnr => {
            let peak = if linear { a.iter().flat_map(|p| &p[..3]).fold(0.0, |top: f64, &x| top.max(x)) } else { 1.0 };
            if mean == 0.0 { f64::INFINITY } else { 10.0 * (peak * peak / mean).log10() }
        }
        _ => mean,
    }
}

fn absolute_map(a: &[[f64; 4]], b: &[[f64; 4]]) -> Vec<f32> {
    let largest = |x: &[f64; 4], y: &[f64; 4]| (0..4).map(|c| (x[c] - y[c]).abs()).fold(0.0, f64::max) as f32;
    a.iter().zip(b).map(|(x, y)| largest(x, y)).collect()
}

/// Display values 0..=1 over middle grey, which is the display value 1/2.
fn shown(pixels: &[[f64; 4]], linear: bool) -> Vec<[f64; 3]> {
    let grey = if linear { tone::srgb_decode(0.5) } else { 0.5 };
    let show = |pixel: &[f64; 4]| {
        let behind = (1.0 - pixel[3]).clamp(0.0, 1.0) * grey;
        [0, 1, 2].map(|c| {
            let value = pixel[c] + behind;
            if linear { tone::srgb_encode(value) } else { value.clamp(0.0, 1.0) }
        })
    };
    pixels.par_iter().map(show).collect()
}

fn flip_map(width: u32, height: u32, a: &[[f64; 3]], b: &[[f64; 3]]) -> Vec<f32> {
    let picture = |pixels: &[[f64; 3]]| {
        let bytes: Vec<u8> = pixels.iter().flatten().map(|&value| tone::quantise(value)).collect();
        nv_flip::FlipImageRgb8::with_data(width, height, &bytes)
    };
    nv_flip::flip(picture(a), picture(b), nv_flip::DEFAULT_PIXELS_PER_DEGREE).to_vec()
}

/// Side of the window of SSIM.
const WINDOW: usize = 11;

/// Mean structural similarity: Wang et al. 2004 with their window (11x11, standard deviation 1.5), K1 = 0.01,
/// K2 = 0.03, range 1, over the windows that lie inside the picture and whose middle is not left out.
fn ssim([width, height]: [usize; 2], [a, b]: [&[[f64; 3]]; 2], left_out: &[bool]) -> Result<f64> {
    ensure!(
        width >= WINDOW && height >= WINDOW,
        "ssim needs pictures of at least {WINDOW}x{WINDOW} pixels, these have {width}x{height}"
    );
    let mut kernel = [0.0; WINDOW];
    for (index, weight) in kernel.iter_mut().enumerate() {
        let distance = index as f64 - (WINDOW / 2) as f64;
        *weight = (-distance * distance / (2.0 * 1.5 * 1.5)).exp();
    }
    let sum: f64 = kernel.iter().sum();
    kernel.iter_mut().for_each(|weight| *weight /= sum);

    let (across, down) = (width - WINDOW + 1, height - WINDOW + 1);
    let is_counted = |top: usize, left: usize| !left_out[(top + WINDOW / 2) * width + left + WINDOW / 2];
    let counted: usize = (0..down).map(|top| (0..across).filter(|&left| is_counted(top, left)).count()).sum();
    ensure!(counted > 0, "the pixel in the middle of every window of ssim is NaN or infinite");
    let (c1, c2) = (0.01 * 0.01, 0.03 * 0.03);
    // Row sums of a, b, a², b², ab first, then columns: the window is a product of two.
    type Five = [f64; 5];
    let add = |sum: &mut Five, weight: f64, terms: &Five| {
        sum.iter_mut().zip(terms).for_each(|(sum, term)| *sum += weight * term);
    };
    let channel = |c: usize| -> f64 {
        let filtered: Vec<Vec<Five>> = (0..height)
            .into_par_iter()
            .map(|row| {
                let terms: Vec<Five> = (row * width..(row + 1) * width)
                    .map(|at| {
                        let (x, y) = (a[at][c], b[at][c]);
                        [x, y, x * x, y * y, x * y]
                    })
                    .collect();
                (0..across)
                    .map(|left| {
                        let mut sum = [0.0; 5];
                        kernel.iter().zip(&terms[left..]).for_each(|(weight, terms)| add(&mut sum, *weight, terms));
                        sum
                    })
                    .collect()
            })
            .collect();
        let rows: Vec<f64> = (0..down)
            .into_par_iter()
            .map(|top| {
                (0..across)
                    .filter(|&left| is_counted(top, left))
                    .map(|left| {
                        let mut sum = [0.0; 5];
                        kernel
                            .iter()
                            .zip(&filtered[top..])
                            .for_each(|(weight, row)| add(&mut sum, *weight, &row[left]));
                        let [ma, mb, aa, bb, ab] = sum;
                        let (va, vb, cov) = (aa - ma * ma, bb - mb * mb, ab - ma * mb);
                        (2.0 * ma * mb + c1) * (2.0 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2))
                    })
                    .sum()
            })
            .collect();
        rows.iter().sum::<f64>() / counted as f64
    };
    Ok((0..3).map(channel).sum::<f64>() / 3.0)
}

/// The map of a comparison as opaque RGBA bytes: FLIP's errors in magma (0 black, 1 pale yellow), others in grey where
/// white is a difference of 1 or more.
pub fn map_rgba(comparison: &Comparison) -> Vec<u8> {
    let index = |error: f32| tone::quantise(f64::from(error));
    if comparison.metric == Metric::Flip {
        let magma = nv_flip::magma_lut().to_vec();
        let colour = |&error: &f32| {
            let at = usize::from(index(error)) * 3;
            [magma[at], magma[at + 1], magma[at + 2], 255]
        };
        comparison.map.iter().flat_map(colour).collect()
    } else {
        comparison.map.iter().flat_map(|&error| [index(error), index(error), index(error), 255]).collect()
    }
}
