//! Arithmetic as inexact as Vulkan allows: SPIR-V in which divisions, roots, exponentials and logarithms are off by a
//! number of units in the last place.
//!
//! Read the Vulkan specification, appendix Vulkan Environment for SPIR-V, section Precision and Operation of SPIR-V
//! Instructions: 2.5 ulp for division, 2 for `inversesqrt`, whose reciprocal is `sqrt`, 3 + 2|x| for `exp2`, 3 for
//! `log2` outside of 0.5 to 2.

use std::collections::HashSet;

use rspirv::binary::Assemble as _;
use rspirv::dr::{Builder, Instruction, Operand, load_words};
use rspirv::spirv::{ExecutionMode, GlslStd450Op, Op, Word};
use serde::Deserialize;

/// Units in the last place that are added to the magnitude of results; negative ones are taken away.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Inexact {
    /// Of quotients; at most 2 in a device that rounds correctly.
    pub(crate) division: i32,
    /// Of `inversesqrt`; at most 1.
    pub(crate) inverse_root: i32,
    /// Of `sqrt`; at most 3.
    pub(crate) root: i32,
    /// Of `exp`, `exp2`, `log`, `log2` and `pow`; at most 2.
    pub(crate) power: i32,
}

impl Inexact {
    /// The units of an instruction's result.
    fn of(self, instruction: &Instruction, extended: Option<Word>) -> i32 {
        match instruction.class.opcode {
            Op::FDiv => self.division,
            Op::ExtInst if extended.map(Operand::IdRef).as_ref() == instruction.operands.first() => {
                let Some(Operand::LiteralExtInstInteger(number)) = instruction.operands.get(1) else { return 0 };
                match GlslStd450Op::from_u32(*number) {
                    Some(GlslStd450Op::InverseSqrt) => self.inverse_root,
                    Some(GlslStd450Op::Sqrt) => self.root,
                    Some(
                        GlslStd450Op::Exp
                        | GlslStd450Op::Exp2
                        | GlslStd450Op::Log
                        | GlslStd450Op::Log2
                        | GlslStd450Op::Pow,
                    ) => self.power,
                    _ => 0,
                }
            }
            _ => 0,
        }
    }

    /// The module with inexact results; `None` if it is no module, or has no such result.
    pub(crate) fn rewritten(self, words: &[Word]) -> Option<Vec<Word>> {
        let (words, modes) = without_modes_by_id(words);
        let mut builder = Builder::new_from_module(load_words(words).ok()?);
        let module = builder.module_ref();
        let imports = &module.ext_inst_imports;
        let is_glsl =
            |import: &&Instruction| import.operands.first() == Some(&Operand::LiteralString("GLSL.std.450".to_owned()));
        let extended = imports.iter().find(is_glsl).and_then(|import| import.result_id);
        // Sizes of the types of floats: 1 for a scalar.
        let floats: Vec<Word> = module
            .types_global_values
            .iter()
            .filter(|i| i.class.opcode == Op::TypeFloat && i.operands.first() == Some(&Operand::LiteralBit32(32)))
            .filter_map(|i| i.result_id)
            .collect();
        let size_of = |kind: Word| -> Option<u32> {
            if floats.contains(&kind) {
                return Some(1);
            }
            let vector = module.types_global_values.iter().find(|i| i.result_id == Some(kind))?;
            match (vector.class.opcode, vector.operands.as_slice()) {
                (Op::TypeVector, [Operand::IdRef(of), Operand::LiteralBit32(size)]) if floats.contains(of) => {
                    Some(*size)
                }
                _ => None,
            }
        };
        let mut found = Vec::new();
        for (f, function) in module.functions.iter().enumerate() {
            for (b, block) in function.blocks.iter().enumerate() {
                for (i, instruction) in block.instructions.iter().enumerate() {
                    let ulps = self.of(instruction, extended);
                    let (Some(kind), Some(result)) = (instruction.result_type, instruction.result_id) else { continue };
                    if let (true, Some(size)) = (ulps != 0, size_of(kind)) {
                        found.push(([f, b, i], [kind, result], ulps, size));
                    }
                }
            }
        }
        if found.is_empty() {
            return None;
        }
        let changes: Vec<_> = found
            .into_iter()
            .map(|(place, result, ulps, size)| {
                let raw = builder.id();
                (place, result[1], raw, moved_by(&mut builder, raw, result, ulps, size))
            })
            .collect();
        let mut module = builder.module();
        module.execution_modes.extend(modes);
        // A bit pattern is no sum that could be contracted.
        let results: HashSet<Operand> = changes.iter().map(|(_, result, ..)| Operand::IdRef(*result)).collect();
        let is_of_result = |a: &Instruction| a.operands.first().is_some_and(|id| results.contains(id));
        module.annotations.retain(|a| a.class.opcode != Op::Decorate || !is_of_result(a));
        // From the end, so that earlier places stay.
        for ([f, b, i], _, raw, after) in changes.into_iter().rev() {
            let block = &mut module.functions[f].blocks[b].instructions;
            block[i].result_id = Some(raw);
            block.splice(i + 1..i + 1, after);
        }
        Some(module.assemble())
    }
}

/// Instructions that give `result`, of type `kind`: `raw` moved by `ulps`. Only numbers with an exponent between the
/// least and the greatest are moved: no zero, infinity, NaN.
fn moved_by(builder: &mut Builder, raw: Word, [kind, result]: [Word; 2], ulps: i32, size: u32) -> [Instruction; 7] {
    let (uint, boolean) = (builder.type_int(32, 0), builder.type_bool());
    let (words, bools) = match size {
        1 => (uint, boolean),
        size => (builder.type_vector(uint, size), builder.type_vector(boolean, size)),
    };
    let [exponent, least, range, off, none] = [0x7f80_0000, 0x0080_0000, 0x7f00_0000, ulps as u32, 0].map(|value| {
        let one = builder.constant_bit32(uint, value);
        if size == 1 { one } else { builder.constant_composite(words, vec![one; size as usize]) }
    });
    let [bits, masked, above, ordinary, by, sum] = [(); 6].map(|()| builder.id());
    let make = |op, kind, result, operands: &[Word]| {
        Instruction::new(op, Some(kind), Some(result), operands.iter().copied().map(Operand::IdRef).collect())
    };
    [
        make(Op::Bitcast, words, bits, &[raw]),
        make(Op::BitwiseAnd, words, masked, &[bits, exponent]),
        make(Op::ISub, words, above, &[masked, least]),
        make(Op::ULessThan, bools, ordinary, &[above, range]),
        make(Op::Select, words, by, &[ordinary, off, none]),
        make(Op::IAdd, words, sum, &[bits, by]),
        make(Op::Bitcast, kind, result, &[sum]),
    ]
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
