//! Build-time shader compilation and SPIR-V reflection: GLSL in a folder `shaders/` becomes SPIR-V 1.6 and Rust code
//! that describes it.
//!
//! 1. `shaders/pass/NAME.comp`, or `NAME.vert` with `NAME.frag`, is one program. glslang (crate shaderc) compiles each
//!    stage twice: without optimisation for reflection, which needs the names, and with optimisation for shipping.
//! 2. rspirv reads the bindings, their access (`readonly`/`writeonly` survive as NonWritable/NonReadable), push
//!    constants, specialization constants, vertex inputs and local size.
//! 3. Every function of `shaders/lib/` tagged `@eq` gets a probe, a program that evaluates it (`src/equations.rs`), and
//!    its SPIR-V is checked (`src/contract.rs`).
//! 4. `shaders.rs` gets a module per library file and per program, with specialization and push constants as structs
//!    (`src/generate.rs`). Bindings are named fields, so that a missing binding is a compile error. `share.rs` gets the
//!    structs of `shaders/share/`. `src/interface.rs` assigns the numbers.
//!
//! Errors are printed as `file:line: message` by the compiler itself.

mod cache;
mod compact;
mod compile;
mod contract;
mod equations;
mod files;
mod generate;
mod inlined;
mod interface;
mod optimise;
mod reflect;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use cache::Cache;
use compile::Recipe;
use files::{Result, files, stem};
pub use inlined::{Share, by_function};

/// Compiles and reflects the shaders under `shaders`, and writes `shaders.rs`, `share.rs` and the SPIR-V of each stage
/// into `out_dir`. Code guarded by the specialization constants `without` is removed.
///
/// # Errors
/// Compiler messages as `file:line: message`, or the fault of a declaration.
pub fn build(shaders: &Path, out_dir: &Path, without: &[String]) -> Result<(), String> {
    let cache = Cache::beside(out_dir);
    let recipe = Recipe::new(shaders, without.to_vec(), cache.clone())?;
    if let Some(name) = without.iter().find(|name| recipe.interface.owner("constant", name).is_none()) {
        return Err(format!("no shader has a constant {name}"));
    }
    let mut work: Vec<_> = programs(shaders)?.into_iter().collect();
    // The longest first, so that none is left over at the end.
    work.sort_by_cached_key(|(_, paths)| paths.iter().map(|path| size_with_includes(shaders, path)).sum::<u64>());
    let programs = compile::on_all_cores(
        work,
        || Recipe::new(shaders, without.to_vec(), cache.clone()),
        |recipe, paths| {
            let program = recipe.program(&paths)?;
            for stage in program.stages.iter().filter(|_| without.is_empty()) {
                contract::decorations(&stage.path, &stage.module, &stage.words)?;
            }
            Ok(program)
        },
    )?;
    let mut code = generate::Programs::of(&recipe.interface, &programs)?.rust()?;
    programs.iter().try_for_each(|(name, program)| generate::write_spirv(out_dir, name, program))?;
    code += &generate::probes(&recipe, &programs, without.is_empty(), out_dir)?;
    cache.trim();
    let write =
        |name: &str, text: String| fs::write(out_dir.join(name), text).map_err(|e| format!("writing {name}: {e}"));
    write("shaders.rs", code)?;
    write("share.rs", generate::share(&recipe, &programs)?)
}

/// What becomes of each stage when every call is inlined, by the name of its file: its functions, the entry point
/// first.
///
/// # Errors
/// The errors of [`build`].
pub fn inlined(shaders: &Path) -> Result<BTreeMap<String, Vec<Share>>, String> {
    let recipe = Recipe::new(shaders, Vec::new(), Cache::default())?;
    let mut stages = BTreeMap::new();
    for paths in programs(shaders)?.into_values() {
        for (path, module) in paths.iter().zip(recipe.plain_program(&paths)?) {
            let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
            stages.insert(name, inlined::shares(&module));
        }
    }
    Ok(stages)
}

/// A binding of a program: set, name, slot, and kind and access in the names of the generated Rust.
pub type Binding = (u32, String, u32, &'static str, &'static str);

/// A program compiled separately.
pub struct Compiled {
    /// SPIR-V of each stage.
    pub stages: Vec<Vec<u32>>,
    /// Bindings by set and slot.
    pub bindings: Vec<Binding>,
    /// Specialization constants by id.
    pub constants: Vec<(u32, String)>,
    /// Vertex inputs: location, components.
    pub inputs: Vec<(u32, u32)>,
    /// Size of the push constants in bytes.
    pub push_bytes: u32,
    /// Size of a workgroup in invocations.
    pub local_size: [u32; 3],
}

/// Compiles the program `name` under `shaders`.
///
/// # Errors
/// The errors of [`build`].
pub fn program(shaders: &Path, name: &str) -> Result<Compiled, String> {
    let stages = Recipe::new(shaders, Vec::new(), Cache::default())?.program(&sources(shaders, name)?)?.stages;
    let all = reflect::declared(&stages)?;
    let binding = |b: &reflect::Binding| (b.set, b.name.clone(), b.slot, b.kind, b.access);
    Ok(Compiled {
        bindings: all.bindings.values().map(binding).collect(),
        constants: all.constants.iter().map(|(id, (name, ..))| (*id, name.clone())).collect(),
        inputs: all.inputs.iter().map(|(location, (_, components))| (*location, *components)).collect(),
        push_bytes: all.push_bytes(),
        local_size: reflect::local_size(&stages[0].module),
        stages: stages.into_iter().map(|stage| stage.words).collect(),
    })
}

/// Source files of the program `name`: its stages and all their includes.
///
/// # Errors
/// The folder cannot be read.
pub fn parts(shaders: &Path, name: &str) -> Result<BTreeSet<PathBuf>, String> {
    let mut parts = BTreeSet::new();
    sources(shaders, name)?.into_iter().for_each(|path| include(shaders, path, &mut parts));
    Ok(parts)
}

/// The stage files of every program under `shaders`.
fn programs(shaders: &Path) -> Result<BTreeMap<String, Vec<PathBuf>>> {
    let mut programs: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for path in files(&shaders.join("pass"))? {
        programs.entry(stem(&path)).or_default().push(path);
    }
    if programs.is_empty() {
        return Err(format!("{}: there are no shaders", shaders.join("pass").display()));
    }
    Ok(programs)
}

/// Stage files of a program, in the order of the stages.
fn sources(shaders: &Path, name: &str) -> Result<Vec<PathBuf>> {
    let all = files(&shaders.join("pass"))?;
    Ok(all.into_iter().filter(|path| stem(path) == name).collect())
}

/// Bytes of a stage's file and of all that it includes.
fn size_with_includes(shaders: &Path, path: &Path) -> u64 {
    let mut parts = BTreeSet::new();
    include(shaders, path.to_owned(), &mut parts);
    parts.iter().filter_map(|part| fs::metadata(part).ok()).map(|of| of.len()).sum()
}

fn include(shaders: &Path, path: PathBuf, parts: &mut BTreeSet<PathBuf>) {
    let text = fs::read_to_string(&path).unwrap_or_default();
    if !parts.insert(path) {
        return;
    }
    for line in text.lines() {
        if let Some(name) = line.strip_prefix("#include \"").and_then(|rest| rest.split('"').next()) {
            include(shaders, shaders.join(name), parts);
        }
    }
}
