//! Build script: compiles the shaders to SPIR-V and generates typed Rust by `crates/reflect`.

use std::path::{Path, PathBuf};
use std::{env, process};

/// Specialization constants, separated by commas, whose code is not compiled: the baseline of
/// `./x bench --bench price`.
const WITHOUT: &str = "ETALON_WITHOUT";

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=shaders");
    println!("cargo:rerun-if-env-changed={WITHOUT}");
    let without = env::var(WITHOUT).unwrap_or_default();
    let without: Vec<String> = without.split(',').filter(|name| !name.is_empty()).map(str::to_owned).collect();
    let out_dir = PathBuf::from(env::var_os("OUT_DIR").expect("cargo names a folder"));
    if let Err(message) = etalon_reflect::build(Path::new("shaders"), &out_dir, &without) {
        eprintln!("{message}");
        process::exit(1);
    }
}
