//! Ctrl-C as a request to stop soon: the work so far is kept, and a second Ctrl-C ends the program at once.

use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit code after Ctrl-C, as shells define it: 128 and the number of SIGINT.
pub(super) const INTERRUPTED: u8 = 130;

/// Whether Ctrl-C has been pressed. There is one handler for the process, which a second attempt finds installed.
static ASKED: AtomicBool = AtomicBool::new(false);
static INSTALLED: Once = Once::new();

/// Listens for Ctrl-C.
pub(super) struct Interrupt;

impl Interrupt {
    /// Listens for Ctrl-C from now on. The first one prints `says`.
    pub(super) fn listen(says: &'static str) -> Self {
        INSTALLED.call_once(|| {
            let heard = ctrlc::set_handler(move || {
                if ASKED.swap(true, Ordering::Relaxed) {
                    std::process::exit(INTERRUPTED.into());
                }
                tracing::warn!("{says}; press Ctrl-C again to stop at once");
            });
            if let Err(error) = heard {
                tracing::info!("Ctrl-C cannot end the run early: {error}");
            }
        });
        Self
    }

    #[expect(clippy::unused_self, reason = "only who listens may ask")]
    pub(super) fn is_asked(&self) -> bool {
        ASKED.load(Ordering::Relaxed)
    }
}
