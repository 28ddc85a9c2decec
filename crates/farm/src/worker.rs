//! What a process tells of itself.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

/// Who drew something, where, and when.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct FarmWorker {
    /// The machine's name.
    pub host: String,
    /// Number of the process.
    pub process: u32,
    /// Seconds since 1970, when it began …
    pub began: f64,
    /// … and when it had done.
    pub ended: f64,
    /// Device, driver and its version.
    pub device: [String; 3],
    /// Seconds before its first sample: opening, reading, compiling, uploading.
    pub prepared_s: f64,
}

fn since_1970(time: SystemTime) -> f64 {
    time.duration_since(UNIX_EPOCH).unwrap_or(Duration::ZERO).as_secs_f64()
}

impl FarmWorker {
    /// This process, which began so long ago.
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
