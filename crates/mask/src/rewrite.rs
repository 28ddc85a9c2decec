//! What the rewriters of SPIR-V have in common.

use rspirv::dr::{Builder, Instruction, Module, Operand, load_words};
use rspirv::spirv::{ExecutionMode, Op, Word};

/// A module to be rewritten, and its `OpExecutionModeId` instructions, which are not in it; `None` if it is no module.
pub(crate) fn loaded(words: &[Word]) -> Option<(Builder, Vec<Instruction>)> {
    let (words, modes) = without_modes_by_id(words);
    Some((Builder::new_from_module(load_words(words).ok()?), modes))
}

/// The import of GLSL's extended instructions.
pub(crate) fn extended_set(module: &Module) -> Option<Word> {
    let is_glsl =
        |import: &&Instruction| import.operands.first() == Some(&Operand::LiteralString("GLSL.std.450".to_owned()));
    module.ext_inst_imports.iter().find(is_glsl).and_then(|import| import.result_id)
}

/// Components of a type of 32-bit floats: 1 for a scalar. `None` for any other type.
pub(crate) fn float_size(module: &Module, kind: Word) -> Option<u32> {
    let of = |id: Word| module.types_global_values.iter().find(|i| i.result_id == Some(id));
    let is_float =
        |i: &Instruction| i.class.opcode == Op::TypeFloat && i.operands.first() == Some(&Operand::LiteralBit32(32));
    let found = of(kind)?;
    match (found.class.opcode, found.operands.as_slice()) {
        (Op::TypeVector, [Operand::IdRef(component), Operand::LiteralBit32(size)]) => {
            of(*component).is_some_and(is_float).then_some(*size)
        }
        _ => is_float(found).then_some(1),
    }
}

/// Words of a module without its `OpExecutionModeId` instructions, and these: the loader of rspirv 0.13 refuses them.
fn without_modes_by_id(words: &[Word]) -> (Vec<Word>, Vec<Instruction>) {
    const HEADER: usize = 5;
    let (mut kept, mut modes) = (words[..HEADER.min(words.len())].to_vec(), Vec::new());
    let mut rest = words.get(HEADER..).unwrap_or_default();
    while let Some(&first) = rest.first() {
        let (this, next) = rest.split_at(((first >> 16) as usize).clamp(1, rest.len()));
        match (first & 0xffff == Op::ExecutionModeId as u32, this) {
            (true, [_, entry, mode, ids @ ..]) => {
                let ids = ids.iter().copied().map(Operand::IdRef);
                let mode = ExecutionMode::from_u32(*mode).map(Operand::ExecutionMode);
                let operands = std::iter::once(Operand::IdRef(*entry)).chain(mode).chain(ids).collect();
                modes.push(Instruction::new(Op::ExecutionModeId, None, None, operands));
            }
            _ => kept.extend(this),
        }
        rest = next;
    }
    (kept, modes)
}
