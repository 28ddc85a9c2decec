//! The shaders' recipe: GLSL under `shaders/` becomes SPIR-V 1.6 and plain Rust that describes it.
//!
//! 1. `shaders/pass/NAME.comp`, or `NAME.vert` with `NAME.frag`, is one program. Each stage is compiled twice by glslang
//!    (crate shaderc): without optimisation for reflection, which needs the names, and with it for shipping.
//! 2. rspirv reads the bindings, their access (`readonly`/`writeonly` survive as NonWritable/NonReadable), push
//!    constants, specialization constants, vertex inputs and local size.
//! 3. Every function of `shaders/lib/` tagged `@eq` gets a probe, a program that evaluates it (`build/equations.rs`), and
//!    its SPIR-V is held to a contract (`build/contract.rs`).
//! 4. `shaders.rs` gets a module per library file and per program: bindings as named fields, so that a forgotten one does not
//!    compile, specialization and push constants as structs (`build/generate.rs`). `share.rs` gets the structs of
//!    `shaders/share/`. Who declares what and gets which number: `build/interface.rs`.
//!
//! Errors are printed as `file:line: message` by the compiler itself.

#[path = "build/compile.rs"]
mod compile;
#[path = "build/contract.rs"]
mod contract;
#[path = "build/equations.rs"]
mod equations;
#[path = "build/generate.rs"]
mod generate;
#[path = "build/interface.rs"]
mod interface;
#[path = "src/gpu/limits.rs"]
mod limits;
#[path = "build/reflect.rs"]
mod reflect;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::{env, fs, process};

use compile::{Recipe, Result, files, stem};

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=build");
    println!("cargo:rerun-if-changed=src/gpu/limits.rs");
    println!("cargo:rerun-if-changed=shaders");
    println!("cargo:rerun-if-env-changed={WITHOUT}");
    if let Err(message) = run() {
        eprintln!("{message}");
        process::exit(1);
    }
}

/// Names of specialization constants whose code is not built at all: what `./x bench --bench price` compares with.
const WITHOUT: &str = "ETALON_WITHOUT";

fn run() -> Result<()> {
    let root = Path::new("shaders");
    let out_dir = PathBuf::from(env::var("OUT_DIR").map_err(|e| e.to_string())?);
    let without = env::var(WITHOUT).unwrap_or_default();
    let without: Vec<String> = without.split(',').filter(|name| !name.is_empty()).map(str::to_owned).collect();
    let recipe = Recipe::new(root, without.clone())?;
    if let Some(name) = without.iter().find(|name| recipe.interface.owner("constant", name).is_none()) {
        return Err(format!("{WITHOUT}: no shader has a constant {name}"));
    }
    let mut sources: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for path in files(&root.join("pass"))? {
        sources.entry(stem(&path)).or_default().push(path);
    }
    let programs = compile::on_all_cores(
        sources,
        || Recipe::new(root, without.clone()),
        |recipe, paths| {
            let program = recipe.program(&paths)?;
            for stage in program.stages.iter().filter(|_| without.is_empty()) {
                contract::decorations(&stage.path, &stage.module, &stage.words)?;
            }
            Ok(program)
        },
    )?;
    let mut code = generate::Programs::of(&recipe.interface, &programs)?.rust()?;
    code += &generate::probes(&recipe, &programs, without.is_empty())?;
    let write =
        |name: &str, text: String| fs::write(out_dir.join(name), text).map_err(|e| format!("writing {name}: {e}"));
    write("shaders.rs", code)?;
    write("share.rs", generate::share(&recipe, &programs)?)
}
