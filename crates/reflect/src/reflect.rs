//! SPIR-V reflection by rspirv: bindings with their access (`readonly`/`writeonly` survive as NonWritable/NonReadable),
//! specialization constants, vertex inputs, push constants, structs and local size.
//!
//! Read the SPIR-V specification, chapter 3, for decorations. Names and types come from the unoptimised module;
//! bindings and constants that the shipped module does not read are omitted.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Decoration, Dim, ExecutionMode, Op, StorageClass};

use super::files::{Result, snake};

/// A compiled shader stage: its declarations, and the words that ship.
pub(crate) struct Stage {
    pub(crate) kind: shaderc::ShaderKind,
    pub(crate) module: Module,
    pub(crate) words: Vec<u32>,
    pub(crate) path: String,
}

#[derive(Clone, PartialEq)]
pub(crate) struct Binding {
    pub(crate) name: String,
    pub(crate) set: u32,
    pub(crate) slot: u32,
    pub(crate) kind: &'static str,
    pub(crate) access: &'static str,
    pub(crate) stages: BTreeSet<&'static str>,
}

/// Decorations and names of a module by id, for constant-time look-up.
pub(crate) struct Names<'m> {
    pub(crate) module: &'m Module,
    pub(crate) names: HashMap<u32, &'m str>,
    pub(crate) members: HashMap<(u32, u32), &'m str>,
    pub(crate) decorations: HashMap<(u32, Decoration), Vec<u32>>,
    pub(crate) member_decorations: HashMap<(u32, u32, Decoration), Vec<u32>>,
    pub(crate) types: HashMap<u32, &'m Instruction>,
}

pub(crate) fn word(operand: &Operand) -> u32 {
    match operand {
        Operand::IdRef(v) | Operand::LiteralBit32(v) => *v,
        _ => 0,
    }
}

pub(crate) fn text(operand: &Operand) -> &str {
    match operand {
        Operand::LiteralString(s) => s,
        _ => "",
    }
}

impl<'m> Names<'m> {
    pub(crate) fn new(module: &'m Module) -> Self {
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

    pub(crate) fn name(&self, id: u32) -> &'m str {
        self.names.get(&id).copied().unwrap_or("")
    }

    pub(crate) fn decorated(&self, id: u32, decoration: Decoration) -> Option<u32> {
        self.decorations.get(&(id, decoration)).map(|values| values.first().copied().unwrap_or(0))
    }

    /// Whether every member of a block has the decoration, which is how glslang writes `readonly buffer`.
    pub(crate) fn all_members(&self, block: u32, decoration: Decoration) -> bool {
        let count = self.types[&block].operands.len() as u32;
        (0..count).all(|i| self.member_decorations.contains_key(&(block, i, decoration)))
    }

    pub(crate) fn constant(&self, id: u32) -> u32 {
        self.types.get(&id).and_then(|line| line.operands.first()).map_or(0, word)
    }

    /// Size in bytes under the scalar layout.
    pub(crate) fn size(&self, id: u32) -> Result<u32> {
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

    /// Offset of a member: that of the module, or under the scalar layout if the struct is not in a buffer.
    pub(crate) fn offset(&self, block: u32, member: u32) -> Result<u32> {
        let told = self.member_decorations.get(&(block, member, Decoration::Offset));
        match told.and_then(|values| values.first().copied()) {
            Some(offset) => Ok(offset),
            None => self.types[&block].operands[..member as usize].iter().map(|ty| self.size(word(ty))).sum(),
        }
    }
}

pub(crate) fn access(readable: bool, writable: bool) -> &'static str {
    match (readable, writable) {
        (true, false) => "StorageRead",
        (false, true) => "StorageWrite",
        _ => "StorageReadWrite",
    }
}

pub(crate) fn bindings(stage: &Stage, names: &Names) -> Result<Vec<Binding>> {
    let stage_name = stage_flag(stage.kind);
    let live = Live::of(&stage.words);
    let mut found = Vec::new();
    for variable in names.module.types_global_values.iter().filter(|line| line.class.opcode == Op::Variable) {
        let Some(id) = variable.result_id else { continue };
        let Some(slot) = names.decorated(id, Decoration::Binding) else { continue };
        let set = names.decorated(id, Decoration::DescriptorSet).unwrap_or(0);
        if !live.bindings.contains(&(set, slot)) {
            continue;
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
            // A block without an instance name has the name of its type.
            name = snake(names.name(pointee));
        }
        // NAME_as_FORMAT is the binding NAME, read in another format.
        if let Some((of, _)) = name.split_once("_as_") {
            name = of.to_owned();
        }
        found.push(Binding { name, set, slot, kind, access, stages: BTreeSet::from([stage_name]) });
    }
    Ok(found)
}

/// Declarations that the shipped module uses.
struct Live {
    /// Set and slot of each variable.
    bindings: BTreeSet<(u32, u32)>,
    constants: BTreeSet<u32>,
}

impl Live {
    /// Parsed by hand: rspirv 0.13 cannot load SPIR-V 1.6.
    fn of(words: &[u32]) -> Self {
        let (mut sets, mut slots) = (HashMap::new(), HashMap::new());
        let mut live = Self { bindings: BTreeSet::new(), constants: BTreeSet::new() };
        let mut at = 5;
        while at < words.len() {
            let (op, length) = (words[at] & 0xffff, ((words[at] >> 16) as usize).max(1));
            if op == Op::Decorate as u32 && length > 3 {
                let (target, value) = (words[at + 1], words[at + 3]);
                match words[at + 2] {
                    d if d == Decoration::DescriptorSet as u32 => drop(sets.insert(target, value)),
                    d if d == Decoration::Binding as u32 => drop(slots.insert(target, value)),
                    d if d == Decoration::SpecId as u32 => drop(live.constants.insert(value)),
                    _ => {}
                }
            }
            at += length;
        }
        live.bindings = slots.iter().map(|(id, slot)| (sets.get(id).copied().unwrap_or(0), *slot)).collect();
        live
    }
}

pub(crate) fn stage_flag(kind: shaderc::ShaderKind) -> &'static str {
    match kind {
        shaderc::ShaderKind::Vertex => "VERTEX",
        shaderc::ShaderKind::Fragment => "FRAGMENT",
        _ => "COMPUTE",
    }
}

/// Specialization constants of the shipped module: id → (name, Rust type, default as a Rust literal).
pub(crate) fn constants(stage: &Stage, names: &Names) -> Result<BTreeMap<u32, (String, &'static str, String)>> {
    let live = Live::of(&stage.words);
    let mut found = spec_constants(names)?;
    found.retain(|id, _| live.constants.contains(id));
    Ok(found)
}

/// All specialization constants of the unoptimised module: name → (Rust type, default).
pub(crate) fn all_constants(names: &Names) -> Result<BTreeMap<String, (&'static str, String)>> {
    Ok(spec_constants(names)?.into_values().map(|(name, ty, default)| (name, (ty, default))).collect())
}

fn spec_constants(names: &Names) -> Result<BTreeMap<u32, (String, &'static str, String)>> {
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
pub(crate) fn vertex_inputs(stage: &Stage, names: &Names) -> Result<BTreeMap<u32, (String, u32)>> {
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

/// Type of the push-constant block.
pub(crate) fn push_block(names: &Names) -> Option<u32> {
    let mut variables = names.module.types_global_values.iter().filter(|line| line.class.opcode == Op::Variable);
    let block = variables.find(|line| matches!(line.operands[0], Operand::StorageClass(StorageClass::PushConstant)))?;
    Some(word(&names.types[&block.result_type?].operands[1]))
}

/// A struct member in Rust.
#[derive(Clone, PartialEq)]
pub(crate) struct Member {
    pub(crate) name: String,
    pub(crate) ty: String,
    pub(crate) offset: u32,
}

/// A struct with a memory layout.
#[derive(Clone, PartialEq)]
pub(crate) struct Struct {
    pub(crate) name: String,
    pub(crate) members: Vec<Member>,
    pub(crate) size: u32,
}

/// A struct with its nested structs, the innermost first.
pub(crate) fn structs(names: &Names, id: u32) -> Result<Vec<Struct>> {
    let mut all = Vec::new();
    let mut members = Vec::new();
    for (index, operand) in names.types[&id].operands.iter().enumerate() {
        let (index, ty) = (index as u32, word(operand));
        if names.types[&ty].class.opcode == Op::TypeStruct {
            all.extend(structs(names, ty)?);
        }
        let name = names.members.get(&(id, index)).copied().unwrap_or("").to_owned();
        members.push(Member { name, ty: rust_type(names, ty)?, offset: names.offset(id, index)? });
    }
    all.push(Struct { name: names.name(id).to_owned(), members, size: names.size(id)? });
    Ok(all)
}

fn rust_type(names: &Names, id: u32) -> Result<String> {
    let line = names.types[&id];
    let operand = |i: usize| word(&line.operands[i]);
    Ok(match line.class.opcode {
        Op::TypeFloat => "f32".to_owned(),
        Op::TypeInt => if operand(1) == 1 { "i32" } else { "u32" }.to_owned(),
        Op::TypeVector | Op::TypeMatrix => format!("[{}; {}]", rust_type(names, operand(0))?, operand(1)),
        Op::TypeArray => format!("[{}; {}]", rust_type(names, operand(0))?, names.constant(operand(1))),
        Op::TypeStruct => names.name(id).to_owned(),
        other => return Err(format!("{}: no type of Rust for {other:?}", names.name(id))),
    })
}

pub(crate) fn local_size(module: &Module) -> [u32; 3] {
    module
        .execution_modes
        .iter()
        .find_map(|line| match &line.operands[..] {
            [_, Operand::ExecutionMode(ExecutionMode::LocalSize), x, y, z] => Some([word(x), word(y), word(z)]),
            _ => None,
        })
        .unwrap_or([1; 3])
}

/// Joint declarations of the stages of one program.
pub(crate) struct Declared {
    /// Bindings by set and slot.
    pub(crate) bindings: BTreeMap<(u32, u32), Binding>,
    pub(crate) constants: BTreeMap<u32, (String, &'static str, String)>,
    pub(crate) inputs: BTreeMap<u32, (String, u32)>,
    /// Push constants: nested structs first, the block last.
    pub(crate) push: Vec<Struct>,
}

impl Declared {
    pub(crate) fn push_bytes(&self) -> u32 {
        self.push.last().map_or(0, |block| block.size)
    }
}

pub(crate) fn declared(stages: &[Stage]) -> Result<Declared> {
    let mut all =
        Declared { bindings: BTreeMap::new(), constants: BTreeMap::new(), inputs: BTreeMap::new(), push: Vec::new() };
    for stage in stages {
        let names = Names::new(&stage.module);
        for binding in bindings(stage, &names)? {
            match all.bindings.get_mut(&(binding.set, binding.slot)) {
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
                None => drop(all.bindings.insert((binding.set, binding.slot), binding)),
            }
        }
        all.constants.extend(constants(stage, &names).map_err(|e| format!("{}: {e}", stage.path))?);
        if let Some(block) = push_block(&names) {
            let push = structs(&names, block).map_err(|e| format!("{}: push constants: {e}", stage.path))?;
            if !all.push.is_empty() && all.push != push {
                return Err(format!("{}: other push constants than in another stage", stage.path));
            }
            all.push = push;
        }
        if stage.kind == shaderc::ShaderKind::Vertex {
            all.inputs = vertex_inputs(stage, &names)?;
        }
    }
    Ok(all)
}
