//! What a program becomes when every call is inlined, as SPIR-V optimisers and drivers do.
//!
//! Read docs/decisions/shaderc.md, Few copies. Build scripts, validation and drivers take their time for these
//! instructions, most of which one choice of specialization constants never runs.

use std::collections::{BTreeMap, HashMap};

use rspirv::dr::{Module, Operand};
use rspirv::spirv::Op;

use crate::reflect::{Names, word};

/// A function of a program, in instructions of unoptimised SPIR-V.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Share {
    /// Name in the source.
    pub function: String,
    /// Copies after inlining; the body of a loop counts once.
    pub copies: usize,
    /// Instructions of one copy, without those of its calls.
    pub own: usize,
    /// Instructions of one copy with all that it calls.
    pub whole: usize,
}

/// The functions that the entry point of a module reaches; the entry point first, then by what they take in all.
pub(crate) fn shares(module: &Module) -> Vec<Share> {
    let names = Names::new(module);
    let mut own: HashMap<u32, usize> = HashMap::new();
    let mut calls: HashMap<u32, Vec<u32>> = HashMap::new();
    for function in &module.functions {
        let Some(id) = function.def.as_ref().and_then(|line| line.result_id) else { continue };
        let lines = || function.blocks.iter().flat_map(|block| &block.instructions);
        own.insert(id, lines().count());
        calls.insert(id, lines().filter(|line| line.class.opcode == Op::FunctionCall).filter_map(called).collect());
    }
    let entry = module.entry_points.first().map_or(0, |line| word(&line.operands[1]));
    let mut copies = HashMap::new();
    count(entry, &calls, &mut copies);
    let mut whole = HashMap::new();
    size(entry, &own, &calls, &mut whole);
    let share = |(&id, &copies): (&u32, &usize)| Share {
        function: names.name(id).split('(').next().unwrap_or_default().to_owned(),
        copies,
        own: own.get(&id).copied().unwrap_or(0),
        whole: whole.get(&id).copied().unwrap_or(0),
    };
    let mut all: Vec<Share> = copies.iter().map(share).collect();
    all.sort_by(|a, b| (b.copies * b.whole, &a.function).cmp(&(a.copies * a.whole, &b.function)));
    all
}

fn called(line: &rspirv::dr::Instruction) -> Option<u32> {
    line.operands.first().and_then(|operand| if let Operand::IdRef(id) = operand { Some(*id) } else { None })
}

fn count(function: u32, calls: &HashMap<u32, Vec<u32>>, copies: &mut HashMap<u32, usize>) {
    *copies.entry(function).or_default() += 1;
    calls.get(&function).into_iter().flatten().for_each(|&callee| count(callee, calls, copies));
}

fn size(
    function: u32,
    own: &HashMap<u32, usize>,
    calls: &HashMap<u32, Vec<u32>>,
    whole: &mut HashMap<u32, usize>,
) -> usize {
    if let Some(&known) = whole.get(&function) {
        return known;
    }
    let callees = calls.get(&function).into_iter().flatten();
    let sum = own.get(&function).copied().unwrap_or(0)
        + callees.map(|&callee| size(callee, own, calls, whole)).sum::<usize>();
    whole.insert(function, sum);
    sum
}

/// Functions of all stages together: name, copies, and instructions without those that they call; the largest first.
#[must_use]
pub fn by_function(stages: &BTreeMap<String, Vec<Share>>) -> Vec<(String, usize, usize)> {
    let mut all: HashMap<&str, (usize, usize)> = HashMap::new();
    for share in stages.values().flatten() {
        let (copies, instructions) = all.entry(&share.function).or_default();
        *copies += share.copies;
        *instructions += share.copies * share.own;
    }
    let mut all: Vec<_> = all.into_iter().map(|(name, (copies, size))| (name.to_owned(), copies, size)).collect();
    all.sort_by(|a, b| (b.2, &a.0).cmp(&(a.2, &b.0)));
    all
}
