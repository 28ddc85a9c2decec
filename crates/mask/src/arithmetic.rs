//! Inexact arithmetic within what Vulkan allows: SPIR-V in which divisions, roots, exponentials, logarithms and
//! trigonometric functions are off by a number of units in the last place.
//!
//! Read the Vulkan specification, appendix Vulkan Environment for SPIR-V, section Precision and Operation of SPIR-V
//! Instructions: 2.5 ulp for division, 2 for `inversesqrt`, whose reciprocal is `sqrt`, 3 + 2|x| for `exp2`, 3 for
//! `log2` outside of 0.5 to 2.

use std::collections::HashSet;

use rspirv::binary::Assemble as _;
use rspirv::dr::{Builder, Instruction, Operand};
use rspirv::spirv::{GlslStd450Op, Op, Word};
use serde::Deserialize;

use crate::rewrite::{extended_set, float_size, loaded};

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
    /// Of the trigonometric functions and their inverses; 4096 is what Vulkan allows arc functions, and half of the
    /// 2^-11 that it allows sines and cosines near 1.
    pub(crate) angle: i32,
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
                    Some(
                        GlslStd450Op::Sin
                        | GlslStd450Op::Cos
                        | GlslStd450Op::Tan
                        | GlslStd450Op::Asin
                        | GlslStd450Op::Acos
                        | GlslStd450Op::Atan
                        | GlslStd450Op::Atan2,
                    ) => self.angle,
                    _ => 0,
                }
            }
            _ => 0,
        }
    }

    /// The module with inexact results; `None` if it is no module, or has no such result.
    pub(crate) fn rewritten(self, words: &[Word]) -> Option<Vec<Word>> {
        let (mut builder, modes) = loaded(words)?;
        let module = builder.module_ref();
        let extended = extended_set(module);
        let mut found = Vec::new();
        for (f, function) in module.functions.iter().enumerate() {
            for (b, block) in function.blocks.iter().enumerate() {
                for (i, instruction) in block.instructions.iter().enumerate() {
                    let ulps = self.of(instruction, extended);
                    let (Some(kind), Some(result)) = (instruction.result_type, instruction.result_id) else { continue };
                    if let (true, Some(size)) = (ulps != 0, float_size(module, kind)) {
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
