//! `etalon devices`: lists the Vulkan devices, the features that each lacks, and the device that Etalon uses by
//! default.

use std::process::ExitCode;

use anyhow::Result;
use clap::Args;
use serde::Serialize;

use super::print;
use etalon::gpu::{Candidate, candidates};

/// List the Vulkan devices, the features that they lack, and the device used by default
#[derive(Debug, Clone, Args)]
#[command(after_help = "Examples:\n    etalon devices\n    etalon devices --json")]
pub struct DevicesArgs {
    /// Print one JSON document
    #[arg(long)]
    pub json: bool,
}

#[derive(Serialize)]
struct DevicesJson<'a> {
    schema: &'static str,
    devices: &'a [Candidate],
    /// Index of the device used by default; `None` where every device lacks something.
    used: Option<usize>,
}

/// Runs the command.
///
/// # Errors
/// When there is no Vulkan loader.
pub fn run(args: &DevicesArgs) -> Result<ExitCode> {
    let devices = candidates()?;
    let used =
        (0..devices.len()).filter(|&i| devices[i].missing.is_empty()).min_by_key(|&i| (devices[i].info.rank(), i));
    if args.json {
        let document = DevicesJson { schema: "etalon.devices/1", devices: &devices, used };
        print(&serde_json::to_string_pretty(&document)?)?;
    } else {
        for (index, device) in devices.iter().enumerate() {
            let mark = if used == Some(index) { "*" } else { " " };
            let info = &device.info;
            print(&format!("{mark} {index}  {}  ({}, {}, Vulkan {})", info.name, info.kind, info.driver, info.api))?;
            for missing in &device.missing {
                print(&format!("       lacks {missing}"))?;
            }
        }
        if used.is_none() {
            print("there is no usable Vulkan device; on Debian, mesa-vulkan-drivers provides a software device")?;
        }
    }
    Ok(if used.is_some() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
