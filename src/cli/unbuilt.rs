//! What the design names and this build does not have: refused with a sentence, never ignored.

use anyhow::{Result, bail};
use clap::Args;

/// Options of `render` to come.
#[derive(Debug, Clone, Args)]
pub struct UnbuiltOptions {
    #[arg(long, hide = true, value_name = "A..B")]
    frames: Option<String>,
    #[arg(long, hide = true, value_name = "N")]
    fps: Option<String>,
    #[arg(long, hide = true, value_name = "I/N")]
    shard: Option<String>,
}

impl UnbuiltOptions {
    /// Refuses whatever was given.
    ///
    /// # Errors
    /// One sentence with the option and its value.
    pub fn refuse(&self) -> Result<()> {
        let all = [("--frames", &self.frames), ("--fps", &self.fps), ("--shard", &self.shard)];
        for (name, value) in all {
            if let Some(value) = value {
                bail!("{name} {value}: this option is not built yet");
            }
        }
        Ok(())
    }
}

/// Anything after the name of a command to come.
#[derive(Debug, Clone, Args)]
pub struct UnbuiltCommand {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    rest: Vec<String>,
}

impl UnbuiltCommand {
    /// Refuses the command.
    ///
    /// # Errors
    /// Always: one sentence.
    pub fn refuse(&self, name: &str) -> Result<std::process::ExitCode> {
        bail!(
            "etalon {name} {}: this command is not built yet; render, plan, cost, verify, diff and devices are",
            self.rest.join(" ")
        )
    }
}
