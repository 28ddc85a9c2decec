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
use etalon::plan::{Refused, Setting};

/// An error as one sentence, with the options of the command line in place of the settings of the library.
#[must_use]
pub fn told(error: &anyhow::Error) -> String {
    let cause = |cause: &(dyn std::error::Error + 'static)| match cause.downcast_ref::<Refused>() {
        Some(Refused { setting, why }) => {
            let option = match setting {
                Setting::Knob => "--set",
                Setting::Size => "--size",
                Setting::Background => "--background",
                Setting::Part => "--aov",
                Setting::MaxError => "--max-error",
            };
            format!("{option} {why}")
        }
        None => cause.to_string(),
    };
    error.chain().map(cause).collect::<Vec<_>>().join(": ")
}

/// One line to stdout. A reader that has closed the pipe has seen enough: that is no error.
fn print(line: &str) -> Result<()> {
    match writeln!(io::stdout().lock(), "{line}") {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.context("writing to stdout"),
    }
}
