//! Ctrl-C as a request to stop soon: the work so far is kept, and a second Ctrl-C ends the program at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit code after Ctrl-C, as shells define it: 128 and the number of SIGINT.
pub(super) const INTERRUPTED: u8 = 130;

/// Whether Ctrl-C has been pressed.
#[derive(Clone, Default)]
pub(super) struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Listens for Ctrl-C from now on. The first one prints `says`.
    pub(super) fn listen(says: &'static str) -> Self {
        let interrupt = Self::default();
        let stopped = interrupt.0.clone();
        let heard = ctrlc::set_handler(move || {
            if stopped.swap(true, Ordering::Relaxed) {
                std::process::exit(INTERRUPTED.into());
            }
            tracing::warn!("{says}; press Ctrl-C again to stop at once");
        });
        if let Err(error) = heard {
            tracing::info!("Ctrl-C cannot end the run early: {error}");
        }
        interrupt
    }

    pub(super) fn is_asked(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
