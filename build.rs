//! The shaders' recipe: GLSL under `shaders/` becomes SPIR-V 1.6 and plain Rust that describes it.
//!
//! 1. `shaders/pass/NAME.comp`, or `NAME.vert` with `NAME.frag`, is one program. Each stage is compiled twice by glslang
//!    (crate shaderc): without optimisation for reflection, which needs the names, and with it for shipping.
//! 2. rspirv reads the bindings, their access (`readonly`/`writeonly` survive as NonWritable/NonReadable), push
//!    constants, specialization constants, vertex inputs and local size.
//! 3. Every function of `shaders/lib/` tagged `@eq` gets a probe, a program that evaluates it (`build/equations.rs`), and
//!    its SPIR-V is held to a contract (`build/contract.rs`).
//! 4. `shaders.rs` gets, per program, a `Program` and a struct with one named field per binding, so that a forgotten
//!    binding does not compile, and `const` asserts that hold `src/share.rs` to the layout of `shaders/share/`.
//!
//! Errors are printed as `file:line: message` by the compiler itself.

#[path = "build/compile.rs"]
mod compile;
#[path = "build/contract.rs"]
mod contract;
#[path = "build/equations.rs"]
mod equations;
#[path = "build/reflect.rs"]
mod reflect;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs, process};

use compile::{Recipe, Result, Stage, files, stem};
use reflect::{Binding, Names, declared, local_size, stage_flag};
use rspirv::spirv::{Decoration, Op};

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=build");
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
    let mut programs: BTreeMap<String, Vec<Stage>> = BTreeMap::new();
    let without = env::var(WITHOUT).unwrap_or_default();
    let without: Vec<String> = without.split(',').filter(|name| !name.is_empty()).map(str::to_owned).collect();
    known_names(root, &without)?;
    let whole = without.is_empty();
    let recipe = Recipe::new(root, without)?;
    for path in files(&root.join("pass"))? {
        let stage = recipe.file(&path)?;
        if whole {
            contract::decorations(&stage.path, &stage.module, &stage.words)?;
        }
        programs.entry(stem(&path)).or_default().push(stage);
    }
    let shared = shared_structs(&root.join("share"))?;
    let mut code = generate(&programs, &shared)?;
    code += &probes(&recipe, &programs, whole)?;
    fs::write(out_dir.join("shaders.rs"), code).map_err(|e| format!("writing shaders.rs: {e}"))
}

/// Refuses names to build without that no shader has.
fn known_names(root: &Path, without: &[String]) -> Result<()> {
    let mut text = String::new();
    for folder in ["lib", "pass"] {
        for path in files(&root.join(folder))? {
            text += &fs::read_to_string(&path).map_err(|e| format!("reading {}: {e}", path.display()))?;
        }
    }
    let known = |name: &str| ["bool", "uint"].iter().any(|kind| text.contains(&format!("const {kind} {name} = ")));
    match without.iter().find(|name| !known(name)) {
        Some(name) => Err(format!("{WITHOUT}: no shader has a constant {name}")),
        None => Ok(()),
    }
}

/// The table of equations, each with its probe. All probes bind the same two buffers: `src/shader.rs` has one struct.
///
/// Each function says how it reaches pictures: a pass calls it, or `@host`, or `@lab` a function that a pass calls. What
/// neither a pass nor a probe reaches is an error, where the `whole` of the shaders is built.
fn probes(recipe: &Recipe, programs: &BTreeMap<String, Vec<Stage>>, whole: bool) -> Result<String> {
    let library = equations::library(&recipe.root.join("lib"))?;
    let called: BTreeMap<&String, BTreeSet<String>> =
        programs.iter().map(|(name, stages)| (name, contract::called(stages))).collect();
    let mut reached: BTreeSet<String> = called.values().flatten().cloned().collect();
    let mut table = String::new();
    for equation in &library.equations {
        let name = format!("probe/{}", equation.name);
        let stage = recipe.source(shaderc::ShaderKind::Compute, name.clone(), &equation.probe)?;
        let facts = contract::check(&name, &stage.module, &stage.words, &library.functions)?;
        let program = program_literal(&name, std::slice::from_ref(&stage))?;
        reached.extend(contract::called(std::slice::from_ref(&stage)));
        let users_of = |function: &String| -> Vec<String> {
            called.iter().filter(|(_, names)| names.contains(function)).map(|(p, _)| (*p).clone()).collect()
        };
        let users = users_of(&equation.function);
        let (host, lab) = (&equation.host, &equation.lab);
        let ways = [!users.is_empty(), host.is_some(), lab.is_some()];
        let place = format!("shaders/lib/{}.glsl:{}: {}", equation.subject, equation.line, equation.name);
        if whole && ways.iter().filter(|way| **way).count() != 1 {
            let passes = users.join(", ");
            return Err(format!(
                "{place}: one of a pass that calls it ({passes}), `@host` and `@lab` says how it reaches pictures"
            ));
        }
        let drawn_by = lab.as_ref().map_or_else(Vec::new, |(draws, _)| users_of(draws));
        if whole && lab.is_some() && drawn_by.is_empty() {
            return Err(format!("{place}: `@lab` names a function that no pass calls"));
        }
        let equations::Equation { name, ids, formula, subject, line, inputs, whole, outputs, .. } = equation;
        let [fast, stable, compensated] = facts.builtins.each_ref().map(contract::list);
        table += &format!(
            "    Probe {{
        name: {name:?}, subject: {subject:?}, line: {line}, formula: {formula:?},
        ids: {}, inputs: {}, whole: {}, outputs: {}, builtins: [{fast}, {stable}, {compensated}], loop_heads: {}, passes: {},
        host: {host:?}, lab: {lab:?}, drawn_by: {},
        program: {{ static PROGRAM: Program = {program}; &PROGRAM }},
    }},\n",
            contract::list(ids),
            contract::list(inputs),
            contract::list(whole),
            contract::list(outputs),
            facts.heads,
            contract::list(&users),
            contract::list(&drawn_by),
        );
    }
    let unreached: Vec<_> = library.functions.keys().filter(|name| !reached.contains(*name)).cloned().collect();
    if whole && !unreached.is_empty() {
        return Err(format!("shaders/lib: neither a pass nor an equation reaches {}", unreached.join(", ")));
    }
    Ok(format!("/// Every tagged equation, by file and place.\npub static PROBES: &[Probe] = &[\n{table}];\n"))
}

/// Names of the structs that `src/share.rs` must repeat.
fn shared_structs(folder: &Path) -> Result<BTreeSet<String>> {
    let mut found = BTreeSet::new();
    for path in files(folder)? {
        let source = fs::read_to_string(&path).map_err(|e| format!("reading {}: {e}", path.display()))?;
        for line in source.lines() {
            if let Some(rest) = line.strip_prefix("struct ") {
                found.insert(rest.trim_end_matches(['{', ' ']).to_owned());
            }
        }
    }
    Ok(found)
}

// ---------------------------------------------------------------------------------------------------------------------
// Rust out of it

fn generate(programs: &BTreeMap<String, Vec<Stage>>, shared: &BTreeSet<String>) -> Result<String> {
    let mut code = String::from("// Written by build.rs from shaders/; not edited.\n");
    let mut layouts: BTreeMap<String, String> = BTreeMap::new();
    for (name, stages) in programs {
        program(&mut code, name, stages)?;
        for stage in stages {
            layout_asserts(&mut layouts, shared, &Names::new(&stage.module), &stage.path)?;
        }
    }
    if let Some(missing) = shared.iter().find(|name| !layouts.contains_key(*name)) {
        return Err(format!("shaders/share: struct {missing} is used by no shader"));
    }
    code.extend(layouts.into_values());
    let list = programs.keys().fold(String::new(), |list, name| list + &format!("&{name}::PROGRAM, "));
    writeln!(code, "/// Every program, by name.\npub static PROGRAMS: &[&Program] = &[{list}];")
        .map_err(|e| e.to_string())?;
    Ok(code)
}

/// A `Program` as a Rust expression.
fn program_literal(name: &str, stages: &[Stage]) -> Result<String> {
    let all = declared(stages)?;
    let mut table = String::new();
    for Binding { name, slot, kind, access, stages } in all.bindings.values() {
        let flags: Vec<_> = stages.iter().map(|s| format!("vk::ShaderStageFlags::{s}.as_raw()")).collect();
        let flags = flags.join(" | ");
        table += &format!(
            "            Binding {{ name: \"{name}\", slot: {slot}, kind: BindingKind::{kind}, access: Access::{access}, \
             stages: vk::ShaderStageFlags::from_raw({flags}) }},\n"
        );
    }
    let mut vertex = String::new();
    for (location, (input, components)) in &all.inputs {
        vertex += &format!(
            "            VertexInput {{ name: \"{input}\", location: {location}, components: {components} }},\n"
        );
    }
    let mut constants = String::new();
    for (id, (constant, ty, _)) in &all.constants {
        let float = *ty == "f32";
        constants += &format!("            Constant {{ id: {id}, name: \"{constant}\", float: {float} }},\n");
    }
    let mut stage_table = String::new();
    for stage in stages {
        let words = stage.words.iter().map(|w| format!("{w:#x}")).collect::<Vec<_>>().join(",");
        stage_table += &format!(
            "            Stage {{ flag: vk::ShaderStageFlags::{}, words: &[{words}] }},\n",
            stage_flag(stage.kind)
        );
    }
    let [x, y, z] = local_size(&stages[0].module);
    Ok(format!(
        "Program {{
        name: \"{name}\",
        stages: &[
{stage_table}        ],
        bindings: &[
{table}        ],
        inputs: &[
{vertex}        ],
        constants: &[
{constants}        ],
        push_bytes: {},
        local_size: [{x}, {y}, {z}],
    }}",
        all.push
    ))
}

fn program(code: &mut String, name: &str, stages: &[Stage]) -> Result<()> {
    let compute = stages.len() == 1 && stages[0].kind == shaderc::ShaderKind::Compute;
    let raster = stages.iter().any(|s| s.kind == shaderc::ShaderKind::Vertex)
        && stages.iter().any(|s| s.kind == shaderc::ShaderKind::Fragment)
        && stages.len() == 2;
    if !compute && !raster {
        return Err(format!("shaders/pass/{name}: a program is one .comp, or a .vert with a .frag"));
    }
    let all = declared(stages)?;
    let mut fields = String::new();
    let mut resources = String::new();
    for Binding { name, kind, access, .. } in all.bindings.values() {
        let ty = match *kind {
            "UniformBuffer" | "StorageBuffer" | "StorageTexelBuffer" => "&'a Buffer",
            "SampledImage" => "Sampled<'a>",
            _ => "&'a Image",
        };
        fields += &format!("        /// {kind}, {access}.\n        pub {name}: {ty},\n");
        resources += &format!("                Resource::from(self.{name}),\n");
    }
    let mut spec_fields = String::new();
    let mut spec_defaults = String::new();
    let mut spec_words = String::new();
    for (id, (constant, ty, default)) in &all.constants {
        spec_fields += &format!("        /// Specialization constant {id}.\n        pub {constant}: {ty},\n");
        spec_defaults += &format!("                {constant}: {default},\n");
        let bits = match *ty {
            "f32" => format!("self.{constant}.to_bits()"),
            "u32" => format!("self.{constant}"),
            _ => format!("self.{constant} as u32"),
        };
        spec_words += &format!("                ({id}, {bits}),\n");
    }
    let literal = program_literal(name, stages)?;
    let life = if all.bindings.is_empty() { "" } else { "<'a>" };
    write!(
        code,
        "/// `shaders/pass/{name}`.
#[allow(clippy::derivable_impls, missing_docs, reason = \"generated\")]
pub mod {name} {{
    use super::*;
    /// The program.
    pub static PROGRAM: Program = {literal};
    /// One field per binding.
    #[derive(Clone, Copy)]
    pub struct Bind{life} {{
{fields}    }}
    impl<'a> Bindings<'a> for Bind{life} {{
        fn program(&self) -> &'static Program {{
            &PROGRAM
        }}
        fn resources(&self) -> Vec<Resource<'a>> {{
            vec![
{resources}            ]
        }}
    }}
    /// Specialization constants; the defaults are the shader's.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Constants {{
{spec_fields}    }}
    impl Default for Constants {{
        fn default() -> Self {{
            Self {{
{spec_defaults}            }}
        }}
    }}
    impl Constants {{
        /// (id, 32-bit value) pairs for the pipeline.
        pub fn words(&self) -> Vec<(u32, u32)> {{
            vec![
{spec_words}            ]
        }}
    }}
}}
"
    )
    .map_err(|e| e.to_string())
}

/// `const` asserts that a struct of `src/share.rs` has the size and member offsets of its GLSL twin.
fn layout_asserts(
    layouts: &mut BTreeMap<String, String>,
    shared: &BTreeSet<String>,
    names: &Names,
    path: &str,
) -> Result<()> {
    for (&id, line) in names.types.iter().filter(|(_, line)| line.class.opcode == Op::TypeStruct) {
        let name = names.name(id);
        if !shared.contains(name) || !names.member_decorations.contains_key(&(id, 0, Decoration::Offset)) {
            continue;
        }
        let mut asserts = String::new();
        let size = names.size(id)?;
        asserts += &format!(
            "const _: () = assert!(size_of::<crate::share::{name}>() == {size}, \"size of {name} differs: GLSL {size}\");\n"
        );
        for member in 0..line.operands.len() as u32 {
            let field = names.members.get(&(id, member)).copied().unwrap_or("");
            let offset = names.offset(id, member)?;
            asserts += &format!(
                "const _: () = assert!(std::mem::offset_of!(crate::share::{name}, {field}) == {offset}, \"offset of {name}.{field} differs: GLSL {offset}\");\n"
            );
        }
        match layouts.get(name) {
            Some(known) if *known != asserts => {
                return Err(format!("{path}: struct {name} is laid out differently than in another shader"));
            }
            _ => drop(layouts.insert(name.to_owned(), asserts)),
        }
    }
    Ok(())
}
