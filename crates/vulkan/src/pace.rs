//! State of time-sliced submission (`time_slices.rs`): what passes took, and requests to interrupt.

use std::collections::HashMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use anyhow::Result;

/// Target duration of a short submission in milliseconds, for devices beside a window and those that were lost.
const SHORT_MS: f64 = 10.0;
/// The same for other GPUs: operating systems reset a GPU whose submission takes seconds (2 s on Windows, 10 s with
/// amdgpu).
const USUAL_MS: f64 = 100.0;

/// Name of buffers that live for one frame; the device does not list them.
pub(super) const OF_FRAME: &str = "of one frame";

/// A device's state of time-sliced submission.
#[derive(Debug)]
pub(super) struct SliceTimes {
    /// Whether a window shares the queue.
    pub(super) beside_window: bool,
    /// Target duration of a submission in milliseconds; `None` where a frame is one submission, but for repeated
    /// dispatches: on a software device without a window, which no operating system resets.
    pub(super) slice_ms: Option<f64>,
    /// What passes took, by name.
    pub(super) paces: Mutex<HashMap<String, PassPace>>,
    /// Number of dispatches that were split into more than one piece.
    pub(super) cut: AtomicU64,
    /// Number of submissions that the host waited for.
    pub(super) turns: AtomicU64,
    /// A caller has requested that the frame be abandoned; it takes effect while `interruptible` is set, too.
    pub(super) interrupted: AtomicBool,
    pub(super) interruptible: AtomicBool,
}

/// What passes of one name took.
#[derive(Debug, Clone, Default)]
pub(super) struct PassPace {
    /// Milliseconds per workgroup of a dispatch, the mean of the last one that had workgroups; 0 before.
    pub(super) per_group_ms: f64,
    /// Milliseconds of each occurrence in the last frame that had it.
    pub(super) last_ms: Vec<f64>,
    /// Of repeated dispatches.
    pub(super) repeated: RepeatedPace,
}

/// What repeated dispatches of one name took.
#[derive(Debug, Clone, Default)]
pub(super) struct RepeatedPace {
    /// Milliseconds per workgroup of each; `None` before it had any.
    pub(super) per_group_ms: Vec<Option<f64>>,
    /// How often they were repeated in the last frame.
    pub(super) often: usize,
}

impl RepeatedPace {
    /// Sets the milliseconds per workgroup of dispatch `i`.
    pub(super) fn set(&mut self, i: usize, ms: f64) {
        self.per_group_ms.resize(self.per_group_ms.len().max(i + 1), None);
        self.per_group_ms[i] = Some(ms);
    }

    /// Makes all slower by a factor: together they took longer than was possible.
    pub(super) fn slow_down(&mut self, factor: f64) {
        self.per_group_ms.iter_mut().flatten().for_each(|ms| *ms *= factor);
    }
}

impl SliceTimes {
    pub(super) fn new(beside_window: bool, short: bool, is_software: bool) -> Self {
        Self {
            beside_window,
            slice_ms: match (short, is_software) {
                (true, _) => Some(SHORT_MS),
                (false, false) => Some(USUAL_MS),
                (false, true) => None,
            },
            paces: Mutex::default(),
            cut: AtomicU64::new(0),
            turns: AtomicU64::new(0),
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
