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

/// One line to stdout. A reader that has closed the pipe has seen enough: that is no error.
fn print(line: &str) -> Result<()> {
    match writeln!(io::stdout().lock(), "{line}") {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.context("writing to stdout"),
    }
}
