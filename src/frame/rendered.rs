//! What a picture comes with: counts, work, times, error estimates, and the sums that processes exchange.

use std::collections::BTreeMap;

use super::{Counts, Picture};
use crate::gpu::PassTime;
use crate::image::halves::SampleError;
use crate::share;

/// A rendered picture.
pub struct Rendered {
    /// RGBA8, sRGB-encoded, rows from the top.
    pub display: Vec<u8>,
    /// Whether `display` has transparency.
    pub has_alpha: bool,
    /// Pixels with NaN, infinite or negative values, counted before any clamp.
    pub counts: Counts,
    /// Pixels whose list of transparent fragments was too long for one invocation, in the worst sample: the farthest
    /// fragments were dropped.
    pub dropped: u32,
    /// Work counts of the rays, summed over the samples.
    pub work: Work,
    /// GPU time per pass, summed over the samples, in the order of the frame.
    pub passes: Vec<PassTime>,
    /// Samples of each pixel.
    pub samples: u32,
    /// Error estimates from the two halves of the samples, at powers of two and at the end; for path tracing only.
    pub errors: Vec<SampleError>,
}

/// Progress of a picture.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    /// Samples drawn.
    pub done: u32,
    /// Total number of samples, unless the target error stops earlier.
    pub of: u32,
    /// Error estimate of the picture after this sample, when one was made.
    pub error: Option<SampleError>,
}

/// Work counts of a picture: the same on every device with the same BVH traversal.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Work {
    /// Reflection rays.
    pub reflection: u64,
    /// Refraction rays.
    pub refraction: u64,
    /// Shadow rays.
    pub shadow: u64,
    /// Rays of path tracing.
    pub indirect: u64,
    /// Visited BVH nodes.
    pub node_visits: u64,
    /// Ray/triangle tests.
    pub triangle_tests: u64,
    /// Exits from closed dielectric meshes that the path had not entered.
    pub unmatched_exits: u64,
    /// Estimates of paths with NaN or infinite radiance, which were discarded.
    pub not_finite: u64,
    /// The first discarded estimate.
    pub first_not_finite: Option<NotFinite>,
    /// Surfaces at which the loop over lights stopped early, because the driver would have ended it.
    pub lights_cut_off: u64,
    /// Light of truncated paths, summed over all pixels of all frames: the truncated share of a pixel's light, in parts
    /// of 65536.
    pub lost: u64,
    /// Share of a pixel's light in truncated paths: the mean over all pixels of the picture.
    pub mean_lost: f64,
    /// Share of a pixel's light in truncated paths: the largest of all pixels.
    pub most_lost: f32,
}

/// Place of a NaN or infinite radiance.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct NotFinite {
    /// Column and row of the pixel.
    pub pixel: [u32; 2],
    /// Index into the scene's materials.
    pub material: u32,
    /// Index of the surface along the path, counted from 1.
    pub event: u32,
}

impl Work {
    pub(super) fn add(&mut self, counts: &share::WorkCounts) {
        let sum = |[low, high]: [u32; 2]| u64::from(high) << 32 | u64::from(low);
        self.reflection += sum(counts.reflection);
        self.refraction += sum(counts.refraction);
        self.shadow += sum(counts.shadow);
        self.indirect += sum(counts.indirect);
        self.node_visits += sum(counts.node_visits);
        self.triangle_tests += sum(counts.triangle_tests);
        self.unmatched_exits += sum(counts.unmatched_exits);
        self.lights_cut_off += sum(counts.lights_cut_off);
        self.lost += sum(counts.lost);
        self.not_finite += u64::from(counts.not_finite);
        if self.first_not_finite.is_none() && counts.not_finite > 0 {
            self.first_not_finite = Some(NotFinite {
                pixel: [counts.not_finite_pixel & 0xffff, counts.not_finite_pixel >> 16],
                material: counts.not_finite_material,
                event: counts.not_finite_event,
            });
        }
        self.most_lost = self.most_lost.max(f32::from_bits(counts.most_lost));
    }

    /// The counts with `mean_lost` for a picture of this size and number of frames.
    #[must_use]
    pub fn of(mut self, [width, height]: [u32; 2], frames: u32) -> Self {
        self.mean_lost = self.lost as f64 / 65536.0 / (f64::from(width) * f64::from(height) * f64::from(frames));
        self
    }

    /// The sum of two counts.
    #[must_use]
    pub fn with(self, other: &Self) -> Self {
        Self {
            reflection: self.reflection + other.reflection,
            refraction: self.refraction + other.refraction,
            shadow: self.shadow + other.shadow,
            indirect: self.indirect + other.indirect,
            node_visits: self.node_visits + other.node_visits,
            triangle_tests: self.triangle_tests + other.triangle_tests,
            unmatched_exits: self.unmatched_exits + other.unmatched_exits,
            not_finite: self.not_finite + other.not_finite,
            first_not_finite: self.first_not_finite.or(other.first_not_finite),
            lights_cut_off: self.lights_cut_off + other.lights_cut_off,
            lost: self.lost + other.lost,
            mean_lost: 0.0,
            most_lost: self.most_lost.max(other.most_lost),
        }
    }
}

/// Sums of samples, as processes that render one picture together exchange them.
#[derive(Debug, Clone)]
pub struct Sums {
    /// First sample, and one past the last.
    pub samples: [u32; 2],
    /// Sums of the samples: one, or one each of even and odd samples; then the sums of
    /// [`Settings::parts`](super::Settings::parts).
    pub sums: Vec<Picture>,
    /// Work counts of the rays.
    pub work: Work,
    /// As [`Rendered::dropped`].
    pub dropped: u32,
}

/// Pass times summed by name, in order of first appearance.
#[derive(Clone, Default)]
pub(super) struct Times {
    order: Vec<String>,
    sums: BTreeMap<String, f64>,
}

impl Times {
    pub(super) fn add(&mut self, passes: Vec<PassTime>) {
        for PassTime { name, ms } in passes {
            if !self.sums.contains_key(&name) {
                self.order.push(name.clone());
            }
            *self.sums.entry(name).or_default() += ms;
        }
    }

    pub(super) fn list(self) -> Vec<PassTime> {
        self.order.into_iter().map(|name| PassTime { ms: self.sums[&name], name }).collect()
    }
}
