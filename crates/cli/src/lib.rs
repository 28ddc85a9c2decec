//! The subcommands of the program `etalon`, one module each, with what all of them share: error sentences and lines on
//! stdout.

pub mod arguments;
mod budget;
mod choices;
pub mod cost;
pub mod desktop;
pub mod devices;
pub mod diff;
pub mod documents;
pub mod eval;
pub mod exit_codes;
pub mod exposure;
pub mod extensions;
pub mod farm;
mod heading;
pub mod icon;
mod interrupt;
pub mod lists;
pub mod merge;
pub mod options;
pub mod passport;
pub mod picture;
pub mod plan;
pub mod plot;
pub mod progress;
pub mod render;
pub mod report;
pub mod sequence;
pub mod setup;
mod shard;
mod summary;
pub mod verify;
#[cfg(feature = "window")]
pub mod view;
#[cfg(not(feature = "window"))]
#[path = "no_view.rs"]
pub mod view;

use std::io::{self, Write as _};

use anyhow::{Context as _, Result};
use etalon::gpu::{DeviceChoice, NotOpened, is_lost};
use etalon::plan::{Refused, Setting};
use etalon::scene::UnreadableImage;

/// Formats an error chain as one sentence. Settings of the library are named as command-line options; where a part of
/// Vulkan is missing, the sentence names the Debian packages that provide it.
#[must_use]
pub fn told(error: &anyhow::Error) -> String {
    let cause = |cause: &(dyn std::error::Error + 'static)| {
        if let Some(Refused { setting, why }) = cause.downcast_ref() {
            let option = match setting {
                Setting::Knob => "--set",
                Setting::Size => "--size",
                Setting::Background => "--background",
                Setting::BackgroundBlur => "--background-blur",
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
    let mut sentence = error.chain().map(cause).collect::<Vec<_>>().join(": ");
    if error.downcast_ref::<UnreadableImage>().is_some() {
        sentence += "; --missing checker draws a checker in its place";
    }
    sentence
}

/// Whether the same command may succeed later or on another machine: the device was lost, or a disk is full.
/// Render-farm engines retry such tasks.
#[must_use]
pub fn is_worth_another_try(error: &anyhow::Error) -> bool {
    is_lost(error) || etalon::image::file::is_full(error)
}

/// A wrong value of an option, or options that contradict each other: exit code 2.
#[derive(Debug)]
pub struct WrongUsage(String);

impl std::fmt::Display for WrongUsage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for WrongUsage {}

/// Whether the command line is wrong: exit code 2. So are settings that the plan or the device refuses, but for an
/// error that was not reached with all samples, and devices that do not exist.
#[must_use]
pub fn is_wrong_usage(error: &anyhow::Error) -> bool {
    let is_refused = |refused: &Refused| refused.setting != Setting::MaxError;
    let is_unknown = |error: &NotOpened| matches!(error, NotOpened::NoneLike { choice, .. } if is_certain(choice));
    error.is::<WrongUsage>()
        || error.downcast_ref().is_some_and(is_refused)
        || error.downcast_ref().is_some_and(is_unknown)
}

/// Whether one device is asked for, by name or index.
pub(crate) fn is_certain(choice: &DeviceChoice) -> bool {
    matches!(choice, DeviceChoice::Name(_) | DeviceChoice::Index(_))
}

/// Marks the error of a check of options as wrong usage. Such checks need neither files nor a device.
pub(crate) fn usage<T>(checked: Result<T>) -> Result<T> {
    checked.map_err(|error| WrongUsage(told(&error)).into())
}

/// Debian packages that provide what is missing; `None` for every other error.
fn packages(error: &NotOpened) -> Option<&'static str> {
    match error {
        NotOpened::NoLoader(_) => Some("libvulkan1, mesa-vulkan-drivers"),
        NotOpened::NoDevice => Some("mesa-vulkan-drivers"),
        NotOpened::NoValidation => Some("vulkan-validationlayers"),
        _ => None,
    }
}

/// Prints the `openjd_fail` message of Open Job Description with the error text.
pub fn fail_openjd(text: &str) {
    // A closed pipe is ignored: the exit code reports the failure anyway.
    drop(print(&format!("openjd_fail: {}", text.replace('\n', " "))));
}

/// Prints one line to stdout.
fn print(line: &str) -> Result<()> {
    print_bytes(format!("{line}\n").as_bytes())
}

/// Writes bytes to stdout. A closed pipe (EPIPE) is no error: the reader has read enough.
fn print_bytes(bytes: &[u8]) -> Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.context("writing to stdout"),
    }
}
