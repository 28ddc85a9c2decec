//! State of time-sliced submission (`time_slices.rs`): milliseconds per workgroup of each dispatch, and requests to
//! interrupt.

use std::collections::HashMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use anyhow::Result;

/// A device's state of time-sliced submission.
#[derive(Debug)]
pub(super) struct SliceTimes {
    /// Whether submission is time-sliced: a window shares the queue, so every submission is short.
    pub(super) taken: bool,
    /// Milliseconds per workgroup in the last dispatch of each pass name, under time-sliced submission.
    pub(super) paces: Mutex<HashMap<String, f64>>,
    /// Number of dispatches that were split into more than one piece.
    pub(super) cut: AtomicU64,
    /// A caller has requested that the frame be abandoned; it takes effect while `interruptible` is set, too.
    pub(super) interrupted: AtomicBool,
    pub(super) interruptible: AtomicBool,
}

impl SliceTimes {
    pub(super) fn new(taken: bool) -> Self {
        Self {
            taken,
            paces: Mutex::default(),
            cut: AtomicU64::new(0),
            interrupted: AtomicBool::new(false),
            interruptible: AtomicBool::new(false),
        }
    }

    pub(super) fn go_on(&self) -> Result<()> {
        let is_over = self.interruptible.load(Ordering::Relaxed) && self.interrupted.load(Ordering::Relaxed);
        if is_over { Err(Interrupted.into()) } else { Ok(()) }
    }
}

/// The error of a frame that was abandoned because another frame was requested.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the frame was given up for another")]
pub struct Interrupted;
