//! Runs the program `etalon` as a user would.
#![allow(dead_code, unreachable_pub, reason = "each test program includes this file and uses its own part of it")]

use std::path::Path;
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

/// In `folder`, with a cache of its own there and these variables beside the machine's.
pub fn etalon(folder: &Path, arguments: &[&str], variables: &[(&str, &str)]) -> Run {
    let output = Command::new(env!("CARGO_BIN_EXE_etalon"))
        .args(arguments)
        .current_dir(folder)
        .env("XDG_CACHE_HOME", folder.join("cache"))
        .env_remove("RUST_BACKTRACE")
        .env_remove("RUST_LOG")
        .envs(variables.iter().copied())
        .output()
        .expect("the program starts");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
    Run { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
}
