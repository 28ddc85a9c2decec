//! Record of a process: host, device and times.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

/// The process that drew a part or a sequence.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct FarmWorker {
    /// Host name.
    pub host: String,
    /// Process id.
    pub process: u32,
    /// Start in seconds since 1970.
    pub began: f64,
    /// End in seconds since 1970.
    pub ended: f64,
    /// Device, driver and driver version.
    pub device: [String; 3],
    /// Seconds before the first sample: opening, reading, compiling, uploading.
    pub prepared_s: f64,
}

fn since_1970(time: SystemTime) -> f64 {
    time.duration_since(UNIX_EPOCH).unwrap_or(Duration::ZERO).as_secs_f64()
}

impl FarmWorker {
    /// The record of this process, which has been running for `running` and needed `prepared` before its first sample.
    #[must_use]
    pub fn here(device: [String; 3], running: Duration, prepared: Duration) -> Self {
        let name = std::fs::read_to_string("/proc/sys/kernel/hostname").ok().or_else(|| std::env::var("HOSTNAME").ok());
        let now = since_1970(SystemTime::now());
        Self {
            host: name.map_or_else(|| "unknown".to_owned(), |name| name.trim().to_owned()),
            process: std::process::id(),
            began: now - running.as_secs_f64(),
            ended: now,
            device,
            prepared_s: prepared.as_secs_f64(),
        }
    }
}
