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
