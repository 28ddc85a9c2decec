//! Compiles the shaders of this crate to SPIR-V and generates typed Rust, in the same way as Etalon.

use std::path::{Path, PathBuf};

fn main() -> Result<(), String> {
    println!("cargo:rerun-if-changed=shaders");
    let out_dir = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo names a folder"));
    etalon_reflect::build(Path::new("shaders"), &out_dir, &[])
}
