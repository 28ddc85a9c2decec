//! The commands of the program, one module each.

mod budget;
mod choices;
pub mod cost;
pub mod devices;
pub mod diff;
pub mod farm;
pub mod merge;
pub mod options;
pub mod picture;
pub mod plan;
pub mod progress;
pub mod render;
pub mod report;
pub mod sequence;
pub mod setup;
mod shard;
pub mod verify;
#[cfg(feature = "window")]
pub mod view;
#[cfg(not(feature = "window"))]
#[path = "no_view.rs"]
pub mod view;

use std::io::{self, Write as _};

use anyhow::{Context as _, Result};
use etalon::gpu::{NotOpened, is_lost};
use etalon::plan::{Refused, Setting};

/// An error as one sentence, with the options of the command line in place of the settings of the library, and with the packages
/// that bring what is missing.
#[must_use]
pub fn told(error: &anyhow::Error) -> String {
    let cause = |cause: &(dyn std::error::Error + 'static)| {
        if let Some(Refused { setting, why }) = cause.downcast_ref() {
            let option = match setting {
                Setting::Knob => "--set",
                Setting::Size => "--size",
                Setting::Background => "--background",
                Setting::Part => "--aov",
                Setting::MaxError => "--max-error",
            };
            return format!("{option} {why}");
        }
        match cause.downcast_ref::<NotOpened>().and_then(packages) {
            Some(packages) => format!("{cause} (Debian: {packages})"),
            None => cause.to_string(),
        }
    };
    error.chain().map(cause).collect::<Vec<_>>().join(": ")
}

/// Whether the same may succeed later, or elsewhere: the device was lost, a disk is full. Engines try such work again.
#[must_use]
pub fn is_worth_another_try(error: &anyhow::Error) -> bool {
    is_lost(error) || etalon::image::file::is_full(error)
}

/// Debian's packages that mend it.
fn packages(error: &NotOpened) -> Option<&'static str> {
    match error {
        NotOpened::NoLoader(_) => Some("libvulkan1, mesa-vulkan-drivers"),
        NotOpened::NoDevice => Some("mesa-vulkan-drivers"),
        NotOpened::NoValidation => Some("vulkan-validationlayers"),
        _ => None,
    }
}

/// Tells an engine of Open Job Description why there is no picture.
pub fn fail_openjd(text: &str) {
    // The exit code follows in any case: a closed pipe is no error here.
    drop(print(&format!("openjd_fail: {}", text.replace('\n', " "))));
}

/// One line to stdout. A reader that has closed the pipe has seen enough: that is no error.
fn print(line: &str) -> Result<()> {
    match writeln!(io::stdout().lock(), "{line}") {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.context("writing to stdout"),
    }
}
