//! The commands of the program, one module each.

mod budget;
mod choices;
pub mod cost;
pub mod devices;
pub mod diff;
pub mod options;
pub mod plan;
mod progress;
pub mod render;
pub mod report;
pub mod setup;
pub mod unbuilt;
pub mod verify;
#[cfg(feature = "window")]
pub mod view;
#[cfg(not(feature = "window"))]
#[path = "no_view.rs"]
pub mod view;

use std::io::{self, Write as _};

use anyhow::{Context as _, Result};
use etalon::gpu::NotOpened;
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

/// Debian's packages that mend it.
fn packages(error: &NotOpened) -> Option<&'static str> {
    match error {
        NotOpened::NoLoader(_) => Some("libvulkan1, mesa-vulkan-drivers"),
        NotOpened::NoDevice => Some("mesa-vulkan-drivers"),
        NotOpened::NoValidation => Some("vulkan-validationlayers"),
        _ => None,
    }
}

/// One line to stdout. A reader that has closed the pipe has seen enough: that is no error.
fn print(line: &str) -> Result<()> {
    match writeln!(io::stdout().lock(), "{line}") {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.context("writing to stdout"),
    }
}
