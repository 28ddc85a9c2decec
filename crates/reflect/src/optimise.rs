//! SPIRV-Tools' optimiser. Where the program `spirv-opt` is installed, each function is optimised before it is inlined,
//! which takes half the time: all copies of a function gain from one. shaderc's own optimiser has no choice of passes,
//! and is used elsewhere.
//!
//! docs/decisions/shaderc.md, "Functions first", has the figures.

use std::io::Write as _;
use std::process::{Command, Stdio};

use super::files::Result;

/// Passes before those of `-O`, which begins with inlining. They bring each function into the form of static single
/// assignment; after inlining that is most of an optimiser's time.
const OF_FUNCTIONS: [&str; 14] = [
    "--wrap-opkill",
    "--eliminate-dead-branches",
    "--merge-return",
    "--private-to-local",
    "--eliminate-local-single-block",
    "--eliminate-local-single-store",
    "--scalar-replacement=100",
    "--convert-local-access-chains",
    "--eliminate-local-single-block",
    "--eliminate-local-single-store",
    "--ssa-rewrite",
    "--eliminate-dead-code-aggressive",
    "--simplify-instructions",
    "--eliminate-dead-code-aggressive",
];

/// Which optimiser there is.
pub(crate) enum Optimiser {
    /// The program `spirv-opt`, with what it says about its version.
    Program(String),
    /// shaderc's own.
    OfCompiler,
}

impl Optimiser {
    pub(crate) fn installed() -> Self {
        let version = Command::new("spirv-opt").arg("--version").output();
        match version.ok().filter(|known| known.status.success()) {
            Some(known) => Self::Program(String::from_utf8_lossy(&known.stdout).into_owned()),
            None => Self::OfCompiler,
        }
    }

    /// What distinguishes its code from another one's.
    pub(crate) fn version(&self) -> &str {
        match self {
            Self::Program(version) => version,
            Self::OfCompiler => "",
        }
    }

    /// How far shaderc optimises what it hands on.
    pub(crate) fn level_of_compiler(&self) -> shaderc::OptimizationLevel {
        match self {
            Self::Program(_) => shaderc::OptimizationLevel::Zero,
            Self::OfCompiler => shaderc::OptimizationLevel::Performance,
        }
    }

    /// The module as it ships.
    pub(crate) fn optimised(&self, name: &str, words: Vec<u32>) -> Result<Vec<u32>> {
        if let Self::OfCompiler = self {
            return Ok(words);
        }
        let fails = |cause: &dyn std::fmt::Display| format!("{name}: optimising by spirv-opt: {cause}");
        let mut running = Command::new("spirv-opt")
            .args(["--target-env=vulkan1.3", "--scalar-block-layout", "--strip-debug"])
            .args(OF_FUNCTIONS)
            .args(["-O", "-", "-o", "-"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| fails(&e))?;
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_ne_bytes()).collect();
        // It reads all before it writes; where it has ended early, its message says why.
        let written = running.stdin.take().map_or(Ok(()), |mut input| input.write_all(&bytes));
        let done = running.wait_with_output().map_err(|e| fails(&e))?;
        if !done.status.success() {
            return Err(fails(&String::from_utf8_lossy(&done.stderr)));
        }
        written.map_err(|e| fails(&e))?;
        let (chunks, rest) = done.stdout.as_chunks();
        match rest {
            [] => Ok(chunks.iter().map(|word| u32::from_ne_bytes(*word)).collect()),
            _ => Err(fails(&"its output is not made of words")),
        }
    }
}
