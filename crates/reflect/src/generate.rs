//! Rust code generation from shader declarations: a module per file of `shaders/lib/` with its declarations, a module
//! per program with its bindings, and the structs of `shaders/share/`.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use super::compile::{Program, Recipe, on_all_cores};
use super::contract;
use super::equations;
use super::files::{Result, files};
use super::interface::{File, Interface, SETS, Shared};
use super::reflect::{
    Binding, Declared, Names, Stage, Struct, all_constants, declared, local_size, stage_flag, structs,
};
use rspirv::spirv::Op;

/// A program with its declarations.
pub(crate) struct Reflected<'p> {
    program: &'p Program,
    all: Declared,
}

/// All programs with their joint declarations.
pub(crate) struct Programs<'p> {
    interface: &'p Interface,
    programs: BTreeMap<&'p str, Reflected<'p>>,
    /// Kind of each binding, by file and name; for shared sets, by set.
    kinds: BTreeMap<(String, String), &'static str>,
    /// Type and default of each constant.
    constants: BTreeMap<String, (&'static str, String)>,
    /// Bindings of each shared set, joined over all programs that read them.
    shared: BTreeMap<&'static str, BTreeMap<u32, Binding>>,
}

impl<'p> Programs<'p> {
    pub(crate) fn of(interface: &'p Interface, programs: &'p BTreeMap<String, Program>) -> Result<Self> {
        let mut all = Self {
            interface,
            programs: BTreeMap::new(),
            kinds: BTreeMap::new(),
            constants: BTreeMap::new(),
            shared: SETS[1..].iter().map(|(set, _)| (*set, BTreeMap::new())).collect(),
        };
        for (name, program) in programs {
            let declared = declared(&program.stages)?;
            for binding in declared.bindings.values() {
                let set = interface.set_of(&binding.name);
                let owner = match binding.set {
                    0 => program.slots[&binding.name].1.clone(),
                    _ => set.to_owned(),
                };
                all.kinds.insert((owner, binding.name.clone()), binding.kind);
                if binding.set > 0
                    && let Some(shared) = all.shared.get_mut(set)
                {
                    let known = shared.entry(binding.slot).or_insert_with(|| binding.clone());
                    known.stages.extend(&binding.stages);
                    if known.kind != binding.kind {
                        return Err(format!("{name}: {} is of another kind than elsewhere", binding.name));
                    }
                }
            }
            for stage in &program.stages {
                all.constants.extend(all_constants(&Names::new(&stage.module))?);
            }
            all.programs.insert(name, Reflected { program, all: declared });
        }
        Ok(all)
    }

    /// Compile-time check that a program stays within the device limits that Etalon requires
    /// (crates/vulkan/src/limits.rs).
    fn within_limits(&self, name: &str, declared: &Declared) -> Result<String> {
        let own = declared.bindings.values().filter(|b| b.set == 0);
        let held = |count: usize, what: &str, limit: &str| {
            format!(
                "const _: () = assert!({count} <= limits::{limit}, \"{name}: {count} {what}, more than devices need have\");\n"
            )
        };
        let mut code = match own.clone().count() {
            0 => String::new(),
            count => held(count, "push descriptors", "PUSH_DESCRIPTORS"),
        };
        // A set counts with all its bindings, including those that the program does not read.
        let sets = shared_sets(self.interface, declared)?;
        let shared: Vec<&Binding> = sets.iter().flat_map(|set| self.shared[set].values()).collect();
        for stage in ["VERTEX", "FRAGMENT", "COMPUTE"] {
            let all = || own.clone().chain(shared.iter().copied()).filter(|b| b.stages.contains(stage));
            for (kinds, limit, what) in [
                (&["StorageImage", "StorageTexelBuffer"][..], "STORAGE_IMAGES", "storage images"),
                (&["StorageBuffer"][..], "STORAGE_BUFFERS", "storage buffers"),
                (
                    &["StorageBuffer", "StorageTexelBuffer"][..],
                    "STORAGE_BUFFERS_AND_TABLES",
                    "storage buffers and tables",
                ),
                (&["UniformBuffer"][..], "UNIFORM_BUFFERS", "uniform buffers"),
                (&["SampledImage"][..], "SAMPLED_IMAGES", "sampled images"),
            ] {
                match all().filter(|b| kinds.contains(&b.kind)).count() {
                    0 => {}
                    count => code += &held(count, &format!("{what} in stage {stage}"), limit),
                }
            }
        }
        Ok(code)
    }

    pub(crate) fn rust(&self) -> Result<String> {
        let mut code = String::from("// Written by the build from shaders/; not edited.\n");
        for (name, reflected) in &self.programs {
            code += &self.within_limits(name, &reflected.all)?;
        }
        for (set, bindings) in &self.shared {
            let table: String = bindings.values().map(binding_literal).collect();
            code += &format!(
                "/// Layout of the descriptor set `{set}`.\npub static {}: SetLayout = SetLayout {{ name: \"{set}\", bindings: &[\n{table}] }};\n",
                set.to_uppercase(),
            );
        }
        code += "/// The declarations of each file of `shaders/lib/`.\npub mod lib {\n    use super::*;\n";
        let mut groups = Vec::new();
        for file in self.interface.files.iter().filter(|file| file.folder == "lib") {
            self.group(&mut code, file, &mut groups)?;
        }
        code += "}\n/// The specialization constants of `shaders/lib/`, file by file.\n#[derive(Clone, Copy, Debug, PartialEq, Default)]\npub struct Library {\n";
        for (stem, about) in &groups {
            code += &format!("    /// {about}\n    pub {stem}: lib::{stem}::Constants,\n");
        }
        code += "}\n";
        for (name, reflected) in &self.programs {
            self.program(&mut code, name, reflected)?;
        }
        let list: String = self.programs.keys().map(|name| format!("&{name}::PROGRAM, ")).collect();
        code += &format!("/// Every program, by name.\npub static PROGRAMS: &[&Program] = &[{list}];\n");
        Ok(code)
    }

    /// The module of a library file.
    fn group(&self, code: &mut String, file: &File, groups: &mut Vec<(String, String)>) -> Result<()> {
        let mut body = file.shared.iter().map(shared_constant).collect::<String>();
        let mut has_constants = false;
        let (mut fields, mut defaults, mut words) = (String::new(), String::new(), String::new());
        for d in file.declarations.iter().filter(|d| d.kind == "constant") {
            let name = d.name.to_lowercase();
            let Some((ty, default)) = self.constants.get(&name) else {
                return Err(format!("shaders/lib/{}.glsl: no program has the constant {}", file.stem, d.name));
            };
            has_constants = true;
            let about = if d.about.is_empty() { format!("`{}`.", d.name) } else { sentence(&d.about) };
            fields += &format!("        /// {about}\n        pub {name}: {ty},\n");
            defaults += &format!("            {name}: {default},\n");
            let id = self.interface.constant(&d.name);
            words += &format!("            ({id}, {}),\n", bits(ty, &format!("self.{name}")));
        }
        if has_constants {
            body += &format!(
                "    /// Specialization constants; the defaults are the shader's.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Constants {{\n{fields}    }}
    #[allow(clippy::derivable_impls, reason = \"generated\")]
    impl Default for Constants {{ fn default() -> Self {{ Self {{\n{defaults}        }} }} }}
    impl Specialization for Constants {{ fn words(&self) -> Vec<(u32, u32)> {{ vec![\n{words}        ] }} }}\n"
            );
            groups.push((file.stem.clone(), file.about.clone()));
        }
        // Pages have the names of their textures; `PAGES` lists them.
        for (set, name) in [("pass", "Bind"), ("scene", "Scene"), ("paths", "Paths")] {
            let mut names: Vec<&str> = Vec::new();
            for d in file.declarations.iter().filter(|d| d.kind == set && !d.name.contains("_as_")) {
                names.push(&d.name);
            }
            if names.is_empty() {
                continue;
            }
            let (mut fields, mut entries) = (String::new(), String::new());
            for own in names {
                let owner = if set == "pass" { file.stem.clone() } else { set.to_owned() };
                let Some(kind) = self.kinds.get(&(owner, own.to_owned())) else {
                    return Err(format!("shaders/lib/{}.glsl: no program reads the binding {own}", file.stem));
                };
                fields += &format!("        /// {kind}.\n        pub {own}: {},\n", resource_type(kind));
                if set != "pass" {
                    let slot = self.interface.slot(own);
                    entries += &format!("            ({slot}, Resource::from(self.{own})),\n");
                }
            }
            body += &format!(
                "    /// Bindings of this file in the descriptor set `{set}`.\n    #[derive(Clone, Copy)]\n    pub struct {name}<'a> {{\n{fields}    }}\n"
            );
            if set != "pass" {
                body += &format!(
                    "    impl<'a> {name}<'a> {{\n        /// The slot and the resource of each binding.\n        #[must_use]\n        pub fn entries(&self) -> Vec<(u32, Resource<'a>)> {{ vec![\n{entries}        ] }}\n    }}\n"
                );
            }
        }
        if !body.is_empty() {
            *code += &format!(
                "    /// {}\n    pub mod {} {{\n    #[allow(unused_imports, reason = \"generated\")]\n    use super::*;\n{body}    }}\n",
                file.about, file.stem
            );
        }
        Ok(())
    }

    fn program(&self, code: &mut String, name: &str, reflected: &Reflected) -> Result<()> {
        let Reflected { program, all } = reflected;
        let stages = &program.stages;
        let compute = stages.len() == 1 && stages[0].kind == shaderc::ShaderKind::Compute;
        let raster = stages.iter().any(|s| s.kind == shaderc::ShaderKind::Vertex)
            && stages.iter().any(|s| s.kind == shaderc::ShaderKind::Fragment)
            && stages.len() == 2;
        if !compute && !raster {
            return Err(format!("shaders/pass/{name}: a program is one .comp, or a .vert with a .frag"));
        }
        // Files of the program itself are named by their paths, library files by their stems.
        let is_own = |owner: &str| owner.contains('/');
        let (mut groups, mut fields, mut resources) = (BTreeSet::new(), String::new(), String::new());
        for Binding { name, kind, access, .. } in all.bindings.values().filter(|b| b.set == 0) {
            let owner = &program.slots[name].1;
            if is_own(owner) {
                fields += &format!("        /// {kind}, {access}.\n        pub {name}: {},\n", resource_type(kind));
                resources += &format!("                Resource::from(self.{name}),\n");
            } else {
                groups.insert(owner.clone());
                resources += &format!("                Resource::from(self.{owner}.{name}),\n");
            }
        }
        for group in &groups {
            fields +=
                &format!("        /// `shaders/lib/{group}.glsl`.\n        pub {group}: lib::{group}::Bind<'a>,\n");
        }
        let (mut own, mut defaults, mut words, mut library) = (String::new(), String::new(), String::new(), false);
        for (id, (constant, ty, _)) in &all.constants {
            let upper = constant.to_uppercase();
            let owner = self.interface.owner("constant", &upper);
            let place = match owner.filter(|file| file.folder == "lib") {
                Some(file) => {
                    library = true;
                    format!("self.library.{}.{constant}", file.stem)
                }
                None => format!("self.{constant}"),
            };
            words += &format!("                ({id}, {}),\n", bits(ty, &place));
        }
        for file in self.interface.files.iter().filter(|file| file.folder == "pass" && file.stem == *name) {
            for d in file.declarations.iter().filter(|d| d.kind == "constant") {
                let constant = d.name.to_lowercase();
                let Some((ty, default)) = self.constants.get(&constant) else { continue };
                let about = if d.about.is_empty() { format!("`{}`.", d.name) } else { sentence(&d.about) };
                own += &format!("        /// {about}\n        pub {constant}: {ty},\n");
                defaults += &format!("                {constant}: {default},\n");
            }
        }
        if library {
            own += "        /// Specialization constants of the library.\n        pub library: Library,\n";
            defaults += "                library: Library::default(),\n";
        }
        let push = match all.push.last() {
            None => "    /// The program has no push constants.\n    pub type Push = ();\n".to_owned(),
            Some(_) => all.push.iter().map(|s| rust_struct(s, &BTreeMap::new())).collect(),
        };
        let life = if fields.is_empty() { "" } else { "<'a>" };
        let literal = literal(self.interface, name, program, all)?;
        write!(
            code,
            "/// `shaders/pass/{name}`.
#[allow(clippy::derivable_impls, missing_docs, reason = \"generated\")]
pub mod {name} {{
    use super::*;
    /// The program.
    pub static PROGRAM: Program = {literal};
    /// Bindings of the program's own descriptor set.
    #[derive(Clone, Copy)]
    pub struct Bind{life} {{
{fields}    }}
    impl<'a> Bindings<'a> for Bind{life} {{
        type Constants = Constants;
        type Push = Push;
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
{own}    }}
    impl Default for Constants {{
        fn default() -> Self {{
            Self {{
{defaults}            }}
        }}
    }}
    impl Specialization for Constants {{
        fn words(&self) -> Vec<(u32, u32)> {{
            vec![
{words}            ]
        }}
    }}
{push}}}
"
        )
        .map_err(|e| e.to_string())
    }
}

fn resource_type(kind: &str) -> &'static str {
    match kind {
        "UniformBuffer" | "StorageBuffer" | "StorageTexelBuffer" => "&'a Buffer",
        "SampledImage" => "Sampled<'a>",
        _ => "&'a Image",
    }
}

fn bits(ty: &str, value: &str) -> String {
    match ty {
        "f32" => format!("{value}.to_bits()"),
        "u32" => value.to_owned(),
        _ => format!("{value} as u32"),
    }
}

/// Converts a comment to a doc sentence.
fn sentence(text: &str) -> String {
    let mut chars = text.chars();
    let first = chars.next().map(|c| c.to_uppercase().to_string()).unwrap_or_default();
    let end = if text.ends_with(['.', ':']) { "" } else { "." };
    format!("{first}{}{end}", chars.as_str())
}

fn shared_constant(Shared { name, ty, value, about }: &Shared) -> String {
    let about = if about.is_empty() { format!("`{name}`.") } else { sentence(about) };
    format!("    /// {about}\n    pub const {name}: {ty} = {value};\n")
}

/// A struct with compile-time checks of its member offsets.
fn rust_struct(Struct { name, members, size }: &Struct, about: &BTreeMap<String, String>) -> String {
    let mut text = about.get("").map(|text| format!("    /// {text}\n")).unwrap_or_default();
    text += &format!(
        "    #[repr(C)]\n    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]\n    pub struct {name} {{\n"
    );
    for member in members {
        let about = about.get(&member.name).cloned().unwrap_or_else(|| format!("`{}`.", member.name));
        text += &format!("        /// {about}\n        pub {}: {},\n", member.name, member.ty);
    }
    text += &format!("    }}\n    const _: () = assert!(size_of::<{name}>() == {size});\n");
    for member in members {
        text += &format!(
            "    const _: () = assert!(std::mem::offset_of!({name}, {}) == {});\n",
            member.name, member.offset
        );
    }
    text
}

fn binding_literal(Binding { name, slot, kind, access, stages, .. }: &Binding) -> String {
    let flags: Vec<_> = stages.iter().map(|s| format!("vk::ShaderStageFlags::{s}.as_raw()")).collect();
    let flags = flags.join(" | ");
    format!(
        "            Binding {{ name: \"{name}\", slot: {slot}, kind: BindingKind::{kind}, access: Access::{access}, \
         stages: vk::ShaderStageFlags::from_raw({flags}) }},\n"
    )
}

/// The shared sets of a program, in the order of their numbers, without gaps.
fn shared_sets(interface: &Interface, all: &Declared) -> Result<Vec<&'static str>> {
    let last = all.bindings.values().map(|b| b.set).max().unwrap_or(0);
    let mut sets = Vec::new();
    for number in 1..=last {
        let of_number = all.bindings.values().filter(|b| b.set == number);
        let read: BTreeSet<_> = of_number.map(|b| interface.set_of(&b.name)).collect();
        match read.into_iter().collect::<Vec<_>>()[..] {
            [set] => sets.push(set),
            // A set before another one is bound, whether or not the program reads it.
            [] if number == 1 => sets.push(SETS[1].0),
            ref read => return Err(format!("a program reads the sets {read:?}, of which there is one at a time")),
        }
    }
    Ok(sets)
}

/// Name of the file with a stage's SPIR-V, beside the generated code.
fn spirv_file(program: &str, stage: &Stage) -> String {
    format!("{}.{}.spv", program.replace('/', "."), stage_flag(stage.kind).to_lowercase())
}

/// Writes the SPIR-V of a program's stages, in the host's byte order. The code includes it as bytes: numbers in its
/// text, 16 MB in all, took every check and build some 3 s more.
pub(crate) fn write_spirv(folder: &Path, name: &str, program: &Program) -> Result<()> {
    for stage in &program.stages {
        let path = folder.join(spirv_file(name, stage));
        let bytes: Vec<u8> = stage.words.iter().flat_map(|word| word.to_ne_bytes()).collect();
        fs::write(&path, bytes).map_err(|e| format!("writing {}: {e}", path.display()))?;
    }
    Ok(())
}

/// A `Program` as a Rust expression.
pub(crate) fn literal(interface: &Interface, name: &str, program: &Program, all: &Declared) -> Result<String> {
    let of_set = |set: u32| all.bindings.values().filter(move |b| b.set == set);
    let table: String = of_set(0).map(binding_literal).collect();
    let mut shared = String::new();
    for (set, number) in shared_sets(interface, all)?.into_iter().zip(1..) {
        let used: String = of_set(number).map(binding_literal).collect();
        let layout = set.to_uppercase();
        shared += &format!("            SharedSet {{ layout: &{layout}, used: &[\n{used}            ] }},\n");
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
    for stage in &program.stages {
        stage_table += &format!(
            "            Stage {{ flag: vk::ShaderStageFlags::{}, words: &bytemuck::must_cast::<_, [u32; {}]>(*include_bytes!({:?})) }},\n",
            stage_flag(stage.kind),
            stage.words.len(),
            spirv_file(name, stage),
        );
    }
    let [x, y, z] = local_size(&program.stages[0].module);
    Ok(format!(
        "Program {{
        name: \"{name}\",
        stages: &[
{stage_table}        ],
        bindings: &[
{table}        ],
        sets: &[
{shared}        ],
        inputs: &[
{vertex}        ],
        constants: &[
{constants}        ],
        push_bytes: {},
        local_size: [{x}, {y}, {z}],
    }}",
        all.push_bytes()
    ))
}

/// The table of equations, each with its probe. All probes bind the same two buffers, so `src/shader.rs` has one
/// struct.
///  Each function states how pictures use it: a pass calls it, or it has `@host`, or `@lab` with a function that a pass
///  calls.
/// When all shaders are built (`whole`), a function that neither a pass nor a probe reaches is an error.
pub(crate) fn probes(
    recipe: &Recipe,
    programs: &BTreeMap<String, Program>,
    whole: bool,
    folder: &Path,
) -> Result<String> {
    let library = equations::library(&recipe.root.join("lib"))?;
    let work = library.equations.iter().map(|equation| (equation.name.clone(), equation));
    let compiled = on_all_cores(
        work,
        || Recipe::new(&recipe.root, Vec::new(), recipe.cache.clone()),
        |recipe, equation| {
            let name = format!("probe/{}", equation.name);
            let program = recipe.source(shaderc::ShaderKind::Compute, name.clone(), &equation.probe)?;
            write_spirv(folder, &name, &program)?;
            let stage = &program.stages[0];
            let facts = contract::check(&name, &stage.module, &stage.words, &library.functions)?;
            let literal = literal(&recipe.interface, &name, &program, &declared(&program.stages)?)?;
            Ok((literal, facts, contract::called(&program.stages)))
        },
    )?;
    let called: BTreeMap<&String, BTreeSet<String>> =
        programs.iter().map(|(name, program)| (name, contract::called(&program.stages))).collect();
    let probed = compiled.values().flat_map(|(_, _, called)| called);
    let reached: BTreeSet<&String> = called.values().flatten().chain(probed).collect();
    let mut table = String::new();
    for equation in &library.equations {
        let (literal, facts, _) = &compiled[&equation.name];
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
        ids: {}, inputs: {}, whole: {}, outputs: {}, builtins: [{fast}, {stable}, {compensated}], loop_heads: {},
        passes: {},
        host: {host:?}, lab: {lab:?}, drawn_by: {},
        program: {{ static PROGRAM: Program = {literal}; &PROGRAM }},
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
    let unreached: Vec<_> = library.functions.keys().filter(|name| !reached.contains(name)).cloned().collect();
    if whole && !unreached.is_empty() {
        return Err(format!("shaders/lib: neither a pass nor an equation reaches {}", unreached.join(", ")));
    }
    if table.is_empty() {
        return Ok(String::new());
    }
    Ok(format!("/// Every tagged equation, by file and line.\npub static PROBES: &[Probe] = &[\n{table}];\n"))
}

/// `shaders/share/` in Rust: structs with their memory layout, and constants.
pub(crate) fn share(recipe: &Recipe, programs: &BTreeMap<String, Program>) -> Result<String> {
    let mut found: BTreeMap<String, Struct> = BTreeMap::new();
    for stage in programs.values().flat_map(|program| &program.stages) {
        let names = Names::new(&stage.module);
        for (&id, line) in names.types.iter().filter(|(_, line)| line.class.opcode == Op::TypeStruct) {
            if line.operands.is_empty() {
                continue;
            }
            // A struct without a Rust type does not belong to `share/`.
            for one in structs(&names, id).unwrap_or_default() {
                // The buffer and register versions of a struct are interchangeable: layouts are scalar.
                found.insert(one.name.clone(), one);
            }
        }
    }
    let mut code = String::from("// Written by the build from shaders/share/; not edited.\n");
    for path in files(&recipe.root.join("share"))? {
        let text = fs::read_to_string(&path).map_err(|e| format!("reading {}: {e}", path.display()))?;
        let mut about: Option<(String, BTreeMap<String, String>)> = None;
        for line in text.lines() {
            if let Some(rest) = line.strip_prefix("struct ") {
                let name = rest.trim_end_matches(['{', ' ']).to_owned();
                let of = format!("`shaders/{}`.", path.strip_prefix(&recipe.root).unwrap_or(&path).display());
                about = Some((name, BTreeMap::from([(String::new(), of)])));
            } else if line.starts_with("};") {
                let Some((name, about)) = about.take() else { continue };
                let known = match found.remove(&name) {
                    None => recipe.interface.with_all_members(&name)?,
                    known => known,
                };
                let known = known.ok_or_else(|| format!("shaders/share: struct {name} is used by no shader"))?;
                code += &rust_struct(&known, &about);
            } else if let Some((_, members)) = &mut about
                && let Some((code, comment)) = line.split_once("//")
                && let Some(name) =
                    code.trim().trim_end_matches(';').split(['[', ';']).next().and_then(|c| c.rsplit(' ').next())
            {
                members.insert(name.to_owned(), sentence(comment.trim()));
            }
        }
    }
    for file in recipe.interface.files.iter().filter(|file| file.folder == "share") {
        code.extend(file.shared.iter().map(shared_constant));
    }
    Ok(code)
}
