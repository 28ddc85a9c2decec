//! SPIR-V id compaction: renumbers ids without gaps.
//!
//! Read the SPIR-V specification, 2.3 (physical layout). The optimiser numbers values and removes most of them:
//! `interact` had ids up to 862,000 for about 60,000 results. Drivers keep a table by id, which lavapipe clears for
//! each pipeline.

use std::collections::HashMap;

use rspirv::grammar::{INSTRUCTION_TABLE, Instruction, LogicalOperand, OperandKind, OperandQuantifier};
use rspirv::spirv::{Decoration, ExecutionMode};

use crate::files::Result;

type Grammar = HashMap<u32, &'static Instruction<'static>>;

const HEADER: usize = 5;
const BOUND: usize = 3;

/// `words` with ids from 1 on, in the order of their first occurrence.
pub(crate) fn compacted(mut words: Vec<u32>) -> Result<Vec<u32>> {
    let grammar: Grammar = INSTRUCTION_TABLE.iter().map(|known| (known.opcode as u32, known)).collect();
    let mut numbers: HashMap<u32, u32> = HashMap::new();
    let mut at = HEADER;
    while at < words.len() {
        let length = ((words[at] >> 16) as usize).max(1);
        for place in ids(&grammar, &words[at..at + length])? {
            let next = numbers.len() as u32 + 1;
            let id = &mut words[at + place];
            *id = *numbers.entry(*id).or_insert(next);
        }
        at += length;
    }
    words[BOUND] = numbers.len() as u32 + 1;
    Ok(words)
}

/// Positions of the ids in an instruction.
fn ids(grammar: &Grammar, instruction: &[u32]) -> Result<Vec<usize>> {
    let known = |opcode: u32| grammar.get(&opcode).ok_or_else(|| format!("unknown SPIR-V opcode {opcode}"));
    let mut found = Vec::new();
    let mut at = 1;
    for &LogicalOperand { ref kind, quantifier } in known(instruction[0] & 0xffff)?.operands {
        loop {
            if at >= instruction.len() {
                break;
            }
            match kind {
                OperandKind::IdResultType
                | OperandKind::IdResult
                | OperandKind::IdRef
                | OperandKind::IdScope
                | OperandKind::IdMemorySemantics => {
                    found.push(at);
                    at += 1;
                }
                OperandKind::PairIdRefIdRef => {
                    found.extend([at, at + 1]);
                    at += 2;
                }
                OperandKind::PairLiteralIntegerIdRef => {
                    found.push(at + 1);
                    at += 2;
                }
                OperandKind::LiteralString => {
                    // Up to the word with the terminating 0.
                    while instruction[at].to_le_bytes().iter().all(|&byte| byte != 0) {
                        at += 1;
                    }
                    at += 1;
                }
                // The remaining operands depend on the value of the mask; all are ids.
                OperandKind::ImageOperands => {
                    found.extend(at + 1..instruction.len());
                    at = instruction.len();
                }
                OperandKind::MemoryAccess | OperandKind::LoopControl | OperandKind::LiteralContextDependentNumber => {
                    at = instruction.len();
                }
                OperandKind::Decoration => {
                    let ids_follow = [Decoration::UniformId, Decoration::CounterBuffer].map(|d| d as u32);
                    if ids_follow.contains(&instruction[at]) {
                        return Err("a decoration by ids, which none of ours has".to_owned());
                    }
                    at = instruction.len();
                }
                OperandKind::ExecutionMode => {
                    let by_ids = [ExecutionMode::LocalSizeId, ExecutionMode::SubgroupsPerWorkgroupId].map(|m| m as u32);
                    if by_ids.contains(&instruction[at]) {
                        found.extend(at + 1..instruction.len());
                    }
                    at = instruction.len();
                }
                // The operand is an opcode with its operands, without results: only extraction has literals, after the
                // first operand.
                OperandKind::LiteralSpecConstantOpInteger => {
                    let operands = known(instruction[at])?
                        .operands
                        .iter()
                        .filter(|o| !matches!(o.kind, OperandKind::IdResultType | OperandKind::IdResult));
                    at += 1;
                    for operand in operands {
                        let is_id = operand.kind == OperandKind::IdRef;
                        let many = operand.quantifier == OperandQuantifier::ZeroOrMore;
                        let end = if many { instruction.len() } else { (at + 1).min(instruction.len()) };
                        found.extend((at..end).filter(|_| is_id));
                        at = end;
                    }
                }
                _ => at += 1,
            }
            if quantifier != OperandQuantifier::ZeroOrMore {
                break;
            }
        }
    }
    Ok(found)
}
