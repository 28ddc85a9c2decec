//! Workgroups in the reverse order: SPIR-V in which the first workgroup of a dispatch, in each dimension, does the work
//! of the last.
//!
//! Read the Vulkan specification, section Dispatching Commands: no order of workgroups may be relied on. lavapipe runs
//! them one after the other, so work that needs an order would never be noticed. For dispatches that begin at workgroup
//! 0.

use rspirv::binary::Assemble as _;
use rspirv::dr::{Builder, Instruction, Operand};
use rspirv::spirv::{BuiltIn, Decoration, ExecutionMode, Op, StorageClass, Word};

use crate::rewrite::loaded;

/// The module with workgroups in the reverse order; `None` if it is no module, or asks for no place in a dispatch.
pub(crate) fn reversed(words: &[Word]) -> Option<Vec<Word>> {
    let (mut builder, modes) = loaded(words)?;
    let module = builder.module_ref();
    let variable_of = |wanted: BuiltIn| {
        module.annotations.iter().find_map(|a| match a.operands.as_slice() {
            [Operand::IdRef(id), Operand::Decoration(Decoration::BuiltIn), Operand::BuiltIn(found)]
                if *found == wanted =>
            {
                Some(*id)
            }
            _ => None,
        })
    };
    let places = [BuiltIn::WorkgroupId, BuiltIn::GlobalInvocationId].map(variable_of);
    if places == [None, None] {
        return None;
    }
    // Vulkan's shaders have their size as constants; a stage without workgroups has none.
    let sides = modes.iter().find_map(|mode| match mode.operands.as_slice() {
        [_, Operand::ExecutionMode(ExecutionMode::LocalSizeId), sides @ ..] => {
            Some(sides.iter().filter_map(Operand::id_ref_any).collect::<Vec<Word>>())
        }
        _ => None,
    })?;
    let entry = module.entry_points.first()?.operands.get(1)?.id_ref_any()?;
    let known = [BuiltIn::NumWorkgroups, BuiltIn::WorkgroupId].map(variable_of);

    let uint = builder.type_int(32, 0);
    let vector = builder.type_vector(uint, 3);
    let [input, private, private_uint] =
        [(StorageClass::Input, vector), (StorageClass::Private, vector), (StorageClass::Private, uint)]
            .map(|(class, to)| builder.type_pointer(None, class, to));
    let mut interface = Vec::new();
    let [count, group] =
        [(known[0], BuiltIn::NumWorkgroups), (known[1], BuiltIn::WorkgroupId)].map(|(known, builtin)| {
            known.unwrap_or_else(|| {
                let made = builder.variable(input, None, StorageClass::Input, None);
                builder.decorate(made, Decoration::BuiltIn, [Operand::BuiltIn(builtin)]);
                interface.push(made);
                made
            })
        });
    let one = builder.constant_bit32(uint, 1);
    let one = builder.constant_composite(vector, vec![one; 3]);
    let size = builder.constant_composite(vector, sides);
    // What the program reads in place of the variables.
    let others = places.map(|place| {
        place.map(|place| {
            let other = builder.variable(private, None, StorageClass::Private, None);
            interface.push(other);
            (place, other)
        })
    });

    let mut prologue = Vec::new();
    let mut write = |builder: &mut Builder, op, operands: &[Word]| {
        let result = builder.id();
        let operands = operands.iter().copied().map(Operand::IdRef).collect();
        prologue.push(Instruction::new(op, Some(vector), Some(result), operands));
        result
    };
    let (count, group) = (write(&mut builder, Op::Load, &[count]), write(&mut builder, Op::Load, &[group]));
    let last = write(&mut builder, Op::ISub, &[count, one]);
    let mirrored_group = write(&mut builder, Op::ISub, &[last, group]);
    let mut stored = Vec::new();
    if let Some((_, other)) = others[0] {
        stored.push([other, mirrored_group]);
    }
    if let Some((place, other)) = others[1] {
        let global = write(&mut builder, Op::Load, &[place]);
        let first = write(&mut builder, Op::IMul, &[group, size]);
        let local = write(&mut builder, Op::ISub, &[global, first]);
        let mirrored_first = write(&mut builder, Op::IMul, &[mirrored_group, size]);
        stored.push([other, write(&mut builder, Op::IAdd, &[mirrored_first, local])]);
    }
    prologue.extend(
        stored.into_iter().map(|operands| {
            Instruction::new(Op::Store, None, None, operands.into_iter().map(Operand::IdRef).collect())
        }),
    );

    let mut module = builder.module();
    module.execution_modes.extend(modes);
    for function in &mut module.functions {
        for instruction in function.blocks.iter_mut().flat_map(|block| &mut block.instructions) {
            for (place, other) in others.into_iter().flatten() {
                if instruction.operands.first() == Some(&Operand::IdRef(place)) {
                    instruction.operands[0] = Operand::IdRef(other);
                    if instruction.class.opcode == Op::AccessChain {
                        instruction.result_type = Some(private_uint);
                    }
                }
            }
        }
    }
    let is_entry = |function: &&mut rspirv::dr::Function| function.def_id() == Some(entry);
    let block = module.functions.iter_mut().find(is_entry)?.blocks.first_mut()?;
    let at = block.instructions.iter().position(|i| i.class.opcode != Op::Variable)?;
    block.instructions.splice(at..at, prologue);
    module.entry_points[0].operands.extend(interface.into_iter().map(Operand::IdRef));
    Some(module.assemble())
}
