//! `etalon view` in a build without the feature `window`.

use std::process::ExitCode;

use anyhow::{Result, bail};
use clap::{ArgMatches, Args};

/// Open a window that shows the scene (not in this build)
#[derive(Debug, Clone, Args)]
pub struct ViewArgs {
    #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<String>,
}

impl ViewArgs {
    /// Nothing more is known from the matches.
    pub(super) fn complete(&mut self, _: &ArgMatches) {}
}

/// Reports how to get a build with a window.
///
/// # Errors
/// Always.
pub fn run(args: &ViewArgs) -> Result<ExitCode> {
    let arguments = args.arguments.join(" ");
    bail!(
        "view {arguments}: this build has no window (cargo feature `window`); `./x run view {arguments}` builds one, and \
         `etalon render SCENE` writes a picture"
    )
}
