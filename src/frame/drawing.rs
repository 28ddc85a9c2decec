//! A picture in progress: which samples are drawn, and what was counted so far.

use super::rendered::{Times, Work};
use crate::image::halves::SampleError;
use crate::upload::view::View;

/// A picture in progress.
pub struct Drawing {
    /// Whether [`Device::interrupt`](crate::gpu::Device::interrupt) may abandon a sample before it is added to the sum;
    /// the next step draws it again.
    pub interruptible: bool,
    pub(super) view: View,
    /// Index of the next sample, and of its next band.
    pub(super) next: [u32; 2],
    pub(super) count: u32,
    /// First sample of the drawing; `end` is one past the last.
    pub(super) from: u32,
    pub(super) end: u32,
    /// Whether the drawing is a part whose sums another process continues.
    pub(super) is_part: bool,
    pub(super) times: Times,
    pub(super) dropped: u32,
    pub(super) work: Work,
    pub(super) errors: Vec<SampleError>,
    pub(super) enough: bool,
}

impl Drawing {
    pub(super) fn new(view: View, count: u32) -> Self {
        Self {
            interruptible: false,
            view,
            next: [0, 0],
            count,
            from: 0,
            end: count,
            is_part: false,
            times: Times::default(),
            dropped: 0,
            work: Work::default(),
            errors: Vec::new(),
            enough: false,
        }
    }

    /// Number of completed samples.
    #[must_use]
    pub fn samples(&self) -> u32 {
        self.next[0]
    }

    /// Samples per pixel of the complete picture.
    #[must_use]
    pub fn of(&self) -> u32 {
        self.count
    }

    /// Whether all bands of the last sample are complete, and there is a sample.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.next[1] == 0 && self.next[0] > 0
    }

    /// Whether the drawing is complete.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.enough || self.next[0] == self.end
    }
}
