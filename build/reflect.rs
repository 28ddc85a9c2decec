//! What compiled shaders declare, by rspirv: bindings with their access (`readonly`/`writeonly` survive as NonWritable/NonReadable),
//! specialization constants, vertex inputs, push constants and local size.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Decoration, Dim, ExecutionMode, Op, StorageClass};

use super::compile::{Result, Stage};

#[derive(Clone, PartialEq)]
pub(crate) struct Binding {
    pub(crate) name: String,
    pub(crate) slot: u32,
    pub(crate) kind: &'static str,
    pub(crate) access: &'static str,
    pub(crate) stages: BTreeSet<&'static str>,
}

/// Decorations and names of a module by id, so that a lookup is one map access.
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

    /// Whether every member of a block carries the decoration: how glslang writes `readonly buffer`.
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

    pub(crate) fn offset(&self, block: u32, member: u32) -> Result<u32> {
        self.member_decorations
            .get(&(block, member, Decoration::Offset))
            .and_then(|values| values.first().copied())
            .ok_or_else(|| format!("{}: member {member} has no offset", self.name(block)))
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

pub(crate) fn snake(name: &str) -> String {
    let mut out = String::new();
    for (i, c) in name.chars().enumerate() {
        if c.is_uppercase() && i > 0 {
            out.push('_');
        }
        out.extend(c.to_lowercase());
    }
    out
}

pub(crate) fn stage_flag(kind: shaderc::ShaderKind) -> &'static str {
    match kind {
        shaderc::ShaderKind::Vertex => "VERTEX",
        shaderc::ShaderKind::Fragment => "FRAGMENT",
        _ => "COMPUTE",
    }
}

/// Specialization constants: id → (name, Rust type, default as a Rust literal).
pub(crate) fn constants(names: &Names) -> Result<BTreeMap<u32, (String, &'static str, String)>> {
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

pub(crate) fn push_bytes(names: &Names) -> Result<u32> {
    let mut variables = names.module.types_global_values.iter().filter(|line| line.class.opcode == Op::Variable);
    let block = variables.find(|line| matches!(line.operands[0], Operand::StorageClass(StorageClass::PushConstant)));
    block.map_or(Ok(0), |line| names.size(word(&names.types[&line.result_type.unwrap_or(0)].operands[1])))
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

/// What the stages of one program declare together.
pub(crate) struct Declared {
    pub(crate) bindings: BTreeMap<u32, Binding>,
    pub(crate) constants: BTreeMap<u32, (String, &'static str, String)>,
    pub(crate) inputs: BTreeMap<u32, (String, u32)>,
    pub(crate) push: u32,
}

pub(crate) fn declared(stages: &[Stage]) -> Result<Declared> {
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
