//! Pictures: reading, writing, tone mapping and comparison.
//!
//! A render results in a [`Picture`] of scene-linear radiance. [`exr`] stores it without loss, [`tone`] maps it to
//! display values, and [`png`] stores those. [`decode`] reads pictures of other programs, [`metric`] compares two
//! pictures, and [`mod@file`] writes files atomically. Nothing here uses Vulkan. Colours are linear Rec. 709 unless
//! they are display values.

pub mod decode;
pub mod exr;
pub mod file;
pub mod halves;
pub mod meter;
pub mod metric;
pub mod png;
pub mod tone;

use serde::Serialize;

/// Largest picture to read or write, in pixels: 16384 x 8192, the largest environment map in common use.
///
/// With the limit, a damaged header cannot request more memory than the machine has.
pub const MAX_PIXELS: u64 = 1 << 27;

/// A scene-linear picture.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Picture {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// `width * height` pixels with premultiplied alpha, rows from the top: Rec. 709 radiance times coverage, then
    /// coverage 0..=1.
    pub rgba: Vec<[f32; 4]>,
}

/// Arbitrary output variable: a further quantity per pixel, stored beside the radiance in an EXR.
#[derive(Debug, Clone, PartialEq)]
pub struct Aov {
    /// Prefix of its channels in the file: `normal` gives `normal.X`, `normal.Y`, `normal.Z`.
    pub name: String,
    /// Channel names in sample order: `["R", "G", "B"]`, `["X", "Y", "Z"]`, `["Z"]`, `["id"]`.
    pub channels: Vec<String>,
    /// `width * height * channels.len()` samples, rows from the top, channels interleaved.
    pub samples: AovData,
}

/// Samples of an [`Aov`].
#[derive(Debug, Clone, PartialEq)]
pub enum AovData {
    /// Continuous quantities.
    F32(Vec<f32>),
    /// Identifiers and counts.
    U32(Vec<u32>),
}

impl AovData {
    /// Number of samples over all pixels and channels.
    pub fn len(&self) -> usize {
        match self {
            Self::F32(samples) => samples.len(),
            Self::U32(samples) => samples.len(),
        }
    }

    /// Whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Statistics of a picture's samples before any clamping: `image` of the report.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Statistics {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// NaN samples among the three colours and coverage.
    pub nan: u64,
    /// Infinite samples among the three colours and coverage.
    pub inf: u64,
    /// Finite samples below zero among the three colours and coverage.
    pub negative: u64,
    /// Smallest finite colour sample; 0 when there is none.
    pub min: f64,
    /// Largest finite colour sample; 0 when there is none.
    pub max: f64,
    /// Mean of the finite colour samples; 0 when there is none.
    pub mean: f64,
}

impl Picture {
    /// A picture of constant colour.
    pub fn filled(width: u32, height: u32, rgba: [f32; 4]) -> Self {
        Self { width, height, rgba: vec![rgba; width as usize * height as usize] }
    }

    /// Counts and extremes of the samples, in one pass, with sums in f64.
    pub fn statistics(&self) -> Statistics {
        let mut found = Statistics {
            width: self.width,
            height: self.height,
            nan: 0,
            inf: 0,
            negative: 0,
            min: f64::INFINITY,
            max: f64::NEG_INFINITY,
            mean: 0.0,
        };
        let mut finite = 0u64;
        for pixel in &self.rgba {
            for (channel, &sample) in pixel.iter().enumerate() {
                if sample.is_nan() {
                    found.nan += 1;
                } else if sample.is_infinite() {
                    found.inf += 1;
                } else {
                    found.negative += u64::from(sample < 0.0);
                    if channel < 3 {
                        let sample = f64::from(sample);
                        finite += 1;
                        found.min = found.min.min(sample);
                        found.max = found.max.max(sample);
                        found.mean += sample;
                    }
                }
            }
        }
        if finite == 0 {
            (found.min, found.max) = (0.0, 0.0);
        } else {
            found.mean /= finite as f64;
        }
        found
    }
}
