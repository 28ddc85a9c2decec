//! The state of time slicing beside a window (`turns.rs`): milliseconds per workgroup of each dispatch, and requests to interrupt.

use std::collections::HashMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use anyhow::Result;

/// A device's part of it.
#[derive(Debug)]
pub(super) struct Turns {
    /// A window shares the queue: nothing that is submitted takes long.
    pub(super) taken: bool,
    /// Milliseconds of a group of invocations in the last dispatch of each name, where turns are taken.
    pub(super) paces: Mutex<HashMap<String, f64>>,
    /// Dispatches that were drawn in more than one piece.
    pub(super) cut: AtomicU64,
    /// Somebody wants what is drawn to be given up, and whoever draws it agrees.
    pub(super) interrupted: AtomicBool,
    pub(super) interruptible: AtomicBool,
}

impl Turns {
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

/// Why a frame was not drawn to its end: somebody wants another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the frame was given up for another")]
pub struct Interrupted;
