//! Runs the program `etalon` as a user would.
#![allow(dead_code, unreachable_pub, reason = "each test program includes this file and uses its own part of it")]

use std::path::{Path, PathBuf};
use std::process::Command;

/// What a run leaves behind.
#[derive(Debug)]
pub struct Run {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Run {
    /// It did what was asked.
    #[track_caller]
    pub fn succeeded(self) -> Self {
        assert_eq!(self.code, Some(0), "{self:?}");
        self
    }

    /// One sentence and this exit code: no panic, no backtrace, nothing on stdout.
    #[track_caller]
    pub fn failed(self, code: i32, said: &str) -> Self {
        assert_eq!(self.code, Some(code), "{self:?}");
        let errors: Vec<_> = self.stderr.lines().filter(|line| line.starts_with("error:")).collect();
        assert_eq!(errors.len(), 1, "one sentence: {self:?}");
        assert!(self.stderr.contains(said), "\"{said}\" is not in {self:?}");
        for word in ["panicked", "backtrace", "RUST_BACKTRACE", ".rs:"] {
            assert!(!self.stderr.contains(word), "{self:?}");
        }
        assert_eq!(self.stdout, "", "{self:?}");
        self
    }
}

/// Where many pipelines draw few pixels, the driver's optimisations and threads cost more than they save; the bits are
/// the same.
pub const HASTY: [(&str, &str); 2] = [("GALLIVM_PERF", "nopt"), ("LP_NUM_THREADS", "0")];

/// Where the driver keeps what it compiled: the same for all tests, whose own caches are theirs alone.
fn cache_of_driver() -> PathBuf {
    let of = |name: &str, below: &str| std::env::var_os(name).map(|folder| PathBuf::from(folder).join(below));
    let found = of("MESA_SHADER_CACHE_DIR", "").or_else(|| of("XDG_CACHE_HOME", "")).or_else(|| of("HOME", ".cache"));
    found.unwrap_or_else(std::env::temp_dir)
}

/// The program in `folder`, with a cache of its own there; what the driver compiled is shared.
pub fn command(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_etalon"));
    command
        .current_dir(folder)
        .env("XDG_CACHE_HOME", folder.join("cache"))
        .env("MESA_SHADER_CACHE_DIR", cache_of_driver())
        .env_remove("RUST_BACKTRACE")
        .env_remove("RUST_LOG");
    command
}

/// Runs it to its end, with these variables beside the machine's.
pub fn etalon(folder: &Path, arguments: &[&str], variables: &[(&str, &str)]) -> Run {
    let run = command(folder).args(arguments).envs(variables.iter().copied()).output();
    let output = run.expect("the program starts");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
    Run { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
}
