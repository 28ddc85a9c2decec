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

#[path = "build/contract.rs"]
mod contract;
#[path = "build/equations.rs"]
mod equations;

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs, process};

use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Decoration, Dim, ExecutionMode, Op, StorageClass};

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

type Result<T> = std::result::Result<T, String>;

fn run() -> Result<()> {
    let root = Path::new("shaders");
    known_names(root)?;
    let out_dir = PathBuf::from(env::var("OUT_DIR").map_err(|e| e.to_string())?);
    let mut programs: BTreeMap<String, Vec<Stage>> = BTreeMap::new();
    let compiler = shaderc::Compiler::new().map_err(|e| format!("shaderc: {e}"))?;
    for path in files(&root.join("pass"))? {
        let stage = compile(&compiler, root, &path)?;
        if env::var(WITHOUT).is_err() {
            contract::decorations(&stage.path, &stage.module, &stage.words)?;
        }
        programs.entry(stem(&path)).or_default().push(stage);
    }
    let shared = shared_structs(&root.join("share"))?;
    let mut code = generate(&programs, &shared)?;
    code += &probes(&compiler, root, &programs)?;
    fs::write(out_dir.join("shaders.rs"), code).map_err(|e| format!("writing shaders.rs: {e}"))
}

fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).map_err(|e| format!("reading {}: {e}", folder.display()))?;
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| entry.ok().map(|entry| entry.path())).collect();
    paths.sort();
    Ok(paths)
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// One compiled shader: what it declares, and the words that ship.
struct Stage {
    kind: shaderc::ShaderKind,
    module: Module,
    words: Vec<u32>,
    path: String,
}

fn compile(compiler: &shaderc::Compiler, root: &Path, path: &Path) -> Result<Stage> {
    let kind = match path.extension().and_then(|e| e.to_str()) {
        Some("vert") => shaderc::ShaderKind::Vertex,
        Some("frag") => shaderc::ShaderKind::Fragment,
        Some("comp") => shaderc::ShaderKind::Compute,
        _ => return Err(format!("{}: expected .vert, .frag or .comp", path.display())),
    };
    let source = fs::read_to_string(path).map_err(|e| format!("reading {}: {e}", path.display()))?;
    compile_source(compiler, root, kind, path.display().to_string(), &source)
}

fn compile_source(
    compiler: &shaderc::Compiler,
    root: &Path,
    kind: shaderc::ShaderKind,
    name: String,
    source: &str,
) -> Result<Stage> {
    let without = env::var(WITHOUT).unwrap_or_default();
    let build = |level, version, without: &str| -> Result<Vec<u32>> {
        let without: Vec<&str> = without.split(',').filter(|name| !name.is_empty()).collect();
        let mut options = shaderc::CompileOptions::new().map_err(|e| format!("shaderc: {e}"))?;
        options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_3 as u32);
        options.set_target_spirv(version);
        options.set_optimization_level(level);
        options.set_warnings_as_errors();
        // Includes are written from `shaders/`: one rule, whatever file includes.
        options.set_include_callback(|wanted, _, from, _| {
            let resolved = root.join(wanted);
            let content = fs::read_to_string(&resolved).map_err(|e| format!("{from} includes \"{wanted}\": {e}"))?;
            let content = ruled_out(&content, &without);
            Ok(shaderc::ResolvedInclude { resolved_name: resolved.display().to_string(), content })
        });
        let artifact = compiler
            .compile_into_spirv(&ruled_out(source, &without), kind, &name, "main", Some(&options))
            .map_err(|e| match e {
            shaderc::Error::CompilationError(_, log) => log,
            other => format!("{name}: {other}"),
        })?;
        Ok(artifact.as_binary().to_vec())
    };
    // rspirv 0.13 cannot load SPIR-V 1.6's OpExecutionModeId; the declarations are the same in 1.5.
    let module = rspirv::dr::load_words(build(shaderc::OptimizationLevel::Zero, shaderc::SpirvVersion::V1_5, "")?)
        .map_err(|e| format!("{name}: reflection: {e:?}"))?;
    let words = build(shaderc::OptimizationLevel::Performance, shaderc::SpirvVersion::V1_6, &without)?;
    Ok(Stage { kind, module, words, path: name })
}

/// Refuses names to build without that no shader has.
fn known_names(root: &Path) -> Result<()> {
    let without = env::var(WITHOUT).unwrap_or_default();
    let mut text = String::new();
    for folder in ["lib", "pass"] {
        for path in files(&root.join(folder))? {
            text += &fs::read_to_string(&path).map_err(|e| format!("reading {}: {e}", path.display()))?;
        }
    }
    let known = |name: &str| ["bool", "uint"].iter().any(|kind| text.contains(&format!("const {kind} {name} = ")));
    match without.split(',').find(|name| !name.is_empty() && !known(name)) {
        Some(name) => Err(format!("{WITHOUT}: no shader has a constant {name}")),
        None => Ok(()),
    }
}

/// Shader text in which some specialization constants are ordinary ones, false or 0: the compiler leaves out what they guard.
fn ruled_out(source: &str, without: &[&str]) -> String {
    let line = |line: &str| {
        let (_, rest) = line.split_once(") const ").filter(|_| line.starts_with("layout(constant_id"))?;
        let (kind, name) = rest.split_once(" = ")?.0.split_once(' ')?;
        let value = if kind == "bool" { "false" } else { "0" };
        without.contains(&name).then(|| format!("const {kind} {name} = {value};"))
    };
    source.lines().map(|text| line(text).unwrap_or_else(|| text.to_owned()) + "\n").collect()
}

/// The table of equations, each with its probe. All probes bind the same two buffers: `src/shader.rs` has one struct.
fn probes(compiler: &shaderc::Compiler, root: &Path, programs: &BTreeMap<String, Vec<Stage>>) -> Result<String> {
    let library = equations::library(&root.join("lib"))?;
    let mut table = String::new();
    for equation in &library.equations {
        let name = format!("probe/{}", equation.name);
        let stage = compile_source(compiler, root, shaderc::ShaderKind::Compute, name.clone(), &equation.probe)?;
        let facts = contract::check(&name, &stage.module, &stage.words, &library.functions)?;
        let program = program_literal(&name, std::slice::from_ref(&stage))?;
        let users: Vec<String> = programs
            .iter()
            .filter(|(_, stages)| contract::calls(stages, &equation.function))
            .map(|(p, _)| p.clone())
            .collect();
        let equations::Equation { name, ids, formula, subject, line, inputs, outputs, .. } = equation;
        let [fast, stable, compensated] = facts.builtins.each_ref().map(contract::list);
        table += &format!(
            "    Probe {{
        name: {name:?}, subject: {subject:?}, line: {line}, formula: {formula:?},
        ids: {}, inputs: {}, outputs: {}, builtins: [{fast}, {stable}, {compensated}], loop_heads: {}, passes: {},
        program: {{ static PROGRAM: Program = {program}; &PROGRAM }},
    }},\n",
            contract::list(ids),
            contract::list(inputs),
            contract::list(outputs),
            facts.heads,
            contract::list(&users),
        );
    }
    Ok(format!("/// Every tagged equation, by file and place.\npub static PROBES: &[Probe] = &[\n{table}];\n"))
}

// ---------------------------------------------------------------------------------------------------------------------
// Reflection

#[derive(Clone, PartialEq)]
struct Binding {
    name: String,
    slot: u32,
    kind: &'static str,
    access: &'static str,
    stages: BTreeSet<&'static str>,
}

/// Decorations and names of a module by id, so that a lookup is one map access.
struct Names<'m> {
    module: &'m Module,
    names: HashMap<u32, &'m str>,
    members: HashMap<(u32, u32), &'m str>,
    decorations: HashMap<(u32, Decoration), Vec<u32>>,
    member_decorations: HashMap<(u32, u32, Decoration), Vec<u32>>,
    types: HashMap<u32, &'m Instruction>,
}

fn word(operand: &Operand) -> u32 {
    match operand {
        Operand::IdRef(v) | Operand::LiteralBit32(v) => *v,
        _ => 0,
    }
}

fn text(operand: &Operand) -> &str {
    match operand {
        Operand::LiteralString(s) => s,
        _ => "",
    }
}

impl<'m> Names<'m> {
    fn new(module: &'m Module) -> Self {
        let mut all = Self {
            module,
            names: HashMap::new(),
            members: HashMap::new(),
            decorations: HashMap::new(),
            member_decorations: HashMap::new(),
            types: HashMap::new(),
        };
        for line in &module.debug_names {
            match line.class.opcode {
                Op::Name => drop(all.names.insert(word(&line.operands[0]), text(&line.operands[1]))),
                Op::MemberName => {
                    all.members.insert((word(&line.operands[0]), word(&line.operands[1])), text(&line.operands[2]));
                }
                _ => {}
            }
        }
        for line in &module.annotations {
            let values = |from: usize| line.operands[from..].iter().map(word).collect::<Vec<_>>();
            match (line.class.opcode, &line.operands[..]) {
                (Op::Decorate, [target, Operand::Decoration(decoration), ..]) => {
                    all.decorations.insert((word(target), *decoration), values(2));
                }
                (Op::MemberDecorate, [target, index, Operand::Decoration(decoration), ..]) => {
                    all.member_decorations.insert((word(target), word(index), *decoration), values(3));
                }
                _ => {}
            }
        }
        for line in &module.types_global_values {
            if let Some(id) = line.result_id {
                all.types.insert(id, line);
            }
        }
        all
    }

    fn name(&self, id: u32) -> &'m str {
        self.names.get(&id).copied().unwrap_or("")
    }

    fn decorated(&self, id: u32, decoration: Decoration) -> Option<u32> {
        self.decorations.get(&(id, decoration)).map(|values| values.first().copied().unwrap_or(0))
    }

    /// Whether every member of a block carries the decoration: how glslang writes `readonly buffer`.
    fn all_members(&self, block: u32, decoration: Decoration) -> bool {
        let count = self.types[&block].operands.len() as u32;
        (0..count).all(|i| self.member_decorations.contains_key(&(block, i, decoration)))
    }

    fn constant(&self, id: u32) -> u32 {
        self.types.get(&id).and_then(|line| line.operands.first()).map_or(0, word)
    }

    /// Size in bytes under the scalar layout.
    fn size(&self, id: u32) -> Result<u32> {
        let line = self.types[&id];
        Ok(match line.class.opcode {
            Op::TypeInt | Op::TypeFloat => word(&line.operands[0]) / 8,
            Op::TypeVector => self.size(word(&line.operands[0]))? * word(&line.operands[1]),
            Op::TypeMatrix => self.size(word(&line.operands[0]))? * word(&line.operands[1]),
            Op::TypeArray => {
                let stride = self.decorated(id, Decoration::ArrayStride);
                let element = self.size(word(&line.operands[0]))?;
                stride.unwrap_or(element) * self.constant(word(&line.operands[1]))
            }
            Op::TypeRuntimeArray => 0,
            Op::TypeStruct => match line.operands.len() as u32 {
                0 => 0,
                count => {
                    let last = count - 1;
                    let offset = self.offset(id, last)?;
                    offset + self.size(word(&line.operands[last as usize]))?
                }
            },
            other => return Err(format!("no size for {other:?}")),
        })
    }

    fn offset(&self, block: u32, member: u32) -> Result<u32> {
        self.member_decorations
            .get(&(block, member, Decoration::Offset))
            .and_then(|values| values.first().copied())
            .ok_or_else(|| format!("{}: member {member} has no offset", self.name(block)))
    }
}

fn access(readable: bool, writable: bool) -> &'static str {
    match (readable, writable) {
        (true, false) => "StorageRead",
        (false, true) => "StorageWrite",
        _ => "StorageReadWrite",
    }
}

fn bindings(stage: &Stage, names: &Names) -> Result<Vec<Binding>> {
    let stage_name = stage_flag(stage.kind);
    let mut found = Vec::new();
    for variable in names.module.types_global_values.iter().filter(|line| line.class.opcode == Op::Variable) {
        let Some(id) = variable.result_id else { continue };
        let Some(slot) = names.decorated(id, Decoration::Binding) else { continue };
        if names.decorated(id, Decoration::DescriptorSet) != Some(0) {
            return Err(format!("{}: {}: only set 0 is used (push descriptors)", stage.path, names.name(id)));
        }
        let pointee = word(&names.types[&variable.result_type.unwrap_or(0)].operands[1]);
        let ty = names.types[&pointee];
        let class = match &variable.operands[0] {
            Operand::StorageClass(class) => *class,
            _ => StorageClass::UniformConstant,
        };
        let mut name = names.name(id).to_owned();
        let mut readable = names.decorated(id, Decoration::NonReadable).is_none();
        let mut writable = names.decorated(id, Decoration::NonWritable).is_none();
        let (kind, access) = match (class, ty.class.opcode) {
            (StorageClass::Uniform, _) => ("UniformBuffer", "UniformRead"),
            (StorageClass::StorageBuffer, _) => {
                readable &= !names.all_members(pointee, Decoration::NonReadable);
                writable &= !names.all_members(pointee, Decoration::NonWritable);
                ("StorageBuffer", access(readable, writable))
            }
            (_, Op::TypeSampledImage) => ("SampledImage", "Sampled"),
            (_, Op::TypeImage) => {
                let buffer = matches!(ty.operands[1], Operand::Dim(Dim::DimBuffer));
                match (buffer, word(&ty.operands[5])) {
                    (true, 2) => ("StorageTexelBuffer", access(readable, writable)),
                    (false, 2) => ("StorageImage", access(readable, writable)),
                    _ => return Err(format!("{}: {name}: separate images are not used", stage.path)),
                }
            }
            _ => return Err(format!("{}: {name}: unknown kind of binding", stage.path)),
        };
        if name.is_empty() {
            // A block without an instance name is known by its own.
            name = snake(names.name(pointee));
        }
        // NAME_as_FORMAT is the binding NAME, read in another format.
        if let Some((of, _)) = name.split_once("_as_") {
            name = of.to_owned();
        }
        found.push(Binding { name, slot, kind, access, stages: BTreeSet::from([stage_name]) });
    }
    Ok(found)
}

fn snake(name: &str) -> String {
    let mut out = String::new();
    for (i, c) in name.chars().enumerate() {
        if c.is_uppercase() && i > 0 {
            out.push('_');
        }
        out.extend(c.to_lowercase());
    }
    out
}

fn stage_flag(kind: shaderc::ShaderKind) -> &'static str {
    match kind {
        shaderc::ShaderKind::Vertex => "VERTEX",
        shaderc::ShaderKind::Fragment => "FRAGMENT",
        _ => "COMPUTE",
    }
}

/// Specialization constants: id → (name, Rust type, default as a Rust literal).
fn constants(names: &Names) -> Result<BTreeMap<u32, (String, &'static str, String)>> {
    let mut found = BTreeMap::new();
    for line in &names.module.types_global_values {
        let Some(id) = line.result_id else { continue };
        let Some(spec) = names.decorated(id, Decoration::SpecId) else { continue };
        let name = names.name(id).to_lowercase();
        let (ty, default) = match line.class.opcode {
            Op::SpecConstantTrue => ("bool", "true".to_owned()),
            Op::SpecConstantFalse => ("bool", "false".to_owned()),
            Op::SpecConstant => {
                let ty = names.types[&line.result_type.unwrap_or(0)];
                let bits = word(&line.operands[0]);
                match ty.class.opcode {
                    Op::TypeFloat => ("f32", format!("f32::from_bits({bits})")),
                    _ if word(&ty.operands[1]) == 1 => ("i32", format!("{}", bits as i32)),
                    _ => ("u32", format!("{bits}")),
                }
            }
            other => return Err(format!("specialization constant {name}: {other:?}")),
        };
        found.insert(spec, (name, ty, default));
    }
    Ok(found)
}

/// Vertex inputs: location → (name, number of f32 components).
fn vertex_inputs(stage: &Stage, names: &Names) -> Result<BTreeMap<u32, (String, u32)>> {
    let mut found = BTreeMap::new();
    for line in names.module.types_global_values.iter().filter(|line| line.class.opcode == Op::Variable) {
        let Some(id) = line.result_id else { continue };
        if !matches!(line.operands[0], Operand::StorageClass(StorageClass::Input)) {
            continue;
        }
        if names.decorated(id, Decoration::BuiltIn).is_some() {
            continue;
        }
        let Some(location) = names.decorated(id, Decoration::Location) else { continue };
        let ty = names.types[&word(&names.types[&line.result_type.unwrap_or(0)].operands[1])];
        let components = match ty.class.opcode {
            Op::TypeFloat => 1,
            Op::TypeVector => word(&ty.operands[1]),
            other => return Err(format!("{}: vertex input {}: {other:?}", stage.path, names.name(id))),
        };
        found.insert(location, (names.name(id).to_owned(), components));
    }
    Ok(found)
}

fn push_bytes(names: &Names) -> Result<u32> {
    let mut variables = names.module.types_global_values.iter().filter(|line| line.class.opcode == Op::Variable);
    let block = variables.find(|line| matches!(line.operands[0], Operand::StorageClass(StorageClass::PushConstant)));
    block.map_or(Ok(0), |line| names.size(word(&names.types[&line.result_type.unwrap_or(0)].operands[1])))
}

fn local_size(module: &Module) -> [u32; 3] {
    module
        .execution_modes
        .iter()
        .find_map(|line| match &line.operands[..] {
            [_, Operand::ExecutionMode(ExecutionMode::LocalSize), x, y, z] => Some([word(x), word(y), word(z)]),
            _ => None,
        })
        .unwrap_or([1; 3])
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

/// What the stages of one program declare together.
struct Declared {
    bindings: BTreeMap<u32, Binding>,
    constants: BTreeMap<u32, (String, &'static str, String)>,
    inputs: BTreeMap<u32, (String, u32)>,
    push: u32,
}

fn declared(stages: &[Stage]) -> Result<Declared> {
    let mut all = Declared { bindings: BTreeMap::new(), constants: BTreeMap::new(), inputs: BTreeMap::new(), push: 0 };
    for stage in stages {
        let names = Names::new(&stage.module);
        for binding in bindings(stage, &names)? {
            match all.bindings.get_mut(&binding.slot) {
                Some(known)
                    if (&known.name, known.kind, known.access) == (&binding.name, binding.kind, binding.access) =>
                {
                    known.stages.extend(binding.stages);
                }
                Some(known) => {
                    return Err(format!(
                        "{}: binding {} is `{}` here and `{}` in another stage, or of another kind or access",
                        stage.path, binding.slot, binding.name, known.name
                    ));
                }
                None => drop(all.bindings.insert(binding.slot, binding)),
            }
        }
        all.constants.extend(constants(&names).map_err(|e| format!("{}: {e}", stage.path))?);
        all.push = all.push.max(push_bytes(&names)?);
        if stage.kind == shaderc::ShaderKind::Vertex {
            all.inputs = vertex_inputs(stage, &names)?;
        }
    }
    Ok(all)
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
