//! Specialization constants folded into SPIR-V: constant folding and dead-branch elimination before the driver
//! compiles.
//!
//! Read the Vulkan specification, chapter Pipelines, section Specialization Constants, and the SPIR-V specification,
//! sections Structured Control Flow and Specialization. `VkSpecializationInfo` would set the constants, too, but then
//! the driver reads, inlines and optimises every rung of every knob before it discards most of them: of the 1.06 MB
//! that `interact` had then, a frame used some 6 %, and lavapipe spent 0.48 s on one core creating the pipelines of a
//! frame. One pass over the words takes some milliseconds here and removes the unreachable blocks. The optimiser of
//! SPIRV-Tools does this and more, but takes 0.5 s to load such a module.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use spirv::Op;

/// Words of the module header, before the first instruction.
pub(super) const HEADER: usize = 5;
/// Index of the header word `Bound`: all ids are below it.
pub(super) const BOUND: usize = 3;

/// An instruction, as its range of words.
type Place = Range<usize>;

pub(super) fn op(words: &[u32], at: &Place) -> Option<Op> {
    Op::from_u32(words[at.start] & 0xffff)
}

/// The instructions from word `first` on.
pub(super) fn instructions(words: &[u32], first: usize) -> Vec<Place> {
    let mut places = Vec::with_capacity(words.len() / 4);
    let mut at = first;
    while at < words.len() {
        let length = (words[at] >> 16) as usize;
        places.push(at..at + length);
        at += length;
    }
    places
}

/// A basic block: its instructions without label, merge and terminator.
struct Block {
    label: u32,
    phis: Vec<Place>,
    body: Vec<Place>,
    merge: Option<Place>,
    end: Place,
}

impl Block {
    /// Labels that the block's terminator may branch to.
    fn targets(&self, module: &Module<'_>) -> Vec<u32> {
        let words = &module.words[self.end.clone()];
        match op(module.words, &self.end) {
            Some(Op::Branch) => vec![words[1]],
            Some(Op::BranchConditional) => match module.known[words[1] as usize] {
                Some(condition) => vec![if condition != 0 { words[2] } else { words[3] }],
                None => vec![words[2], words[3]],
            },
            Some(Op::Switch) => {
                let cases = words[3..].as_chunks::<2>().0;
                match module.known[words[1] as usize] {
                    Some(selector) => vec![cases.iter().find(|case| case[0] == selector).map_or(words[2], |c| c[1])],
                    None => std::iter::once(words[2]).chain(cases.iter().map(|case| case[1])).collect(),
                }
            }
            _ => Vec::new(),
        }
    }

    /// The block's merge block, and the continue target of a loop.
    fn merges(&self, words: &[u32]) -> (Option<u32>, Option<u32>) {
        let Some(merge) = &self.merge else { return (None, None) };
        let is_loop = op(words, merge) == Some(Op::LoopMerge);
        (Some(words[merge.start + 1]), is_loop.then(|| words[merge.start + 2]))
    }
}

/// A module with its types and the constant values that are known so far.
struct Module<'a> {
    words: &'a [u32],
    /// The type of each id, indexed by id: ids are small numbers without gaps, and every operand is looked up.
    types: Vec<Type>,
    /// The known 32-bit value of each id.
    known: Vec<Option<u32>>,
    /// Values that are declared undefined before all functions.
    undefined: HashSet<u32>,
}

/// The kind of type that an id declares.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Type {
    None,
    Bool,
    /// A 32-bit number. Only values of this type and of `Bool` are folded.
    Number,
    Other,
}

impl Module<'_> {
    /// The result id of an instruction that has one: the word after the result type.
    fn result(&self, at: &Place) -> Option<u32> {
        let words = &self.words[at.clone()];
        let is_typed = words.len() > 2 && self.types.get(words[1] as usize).is_some_and(|ty| *ty != Type::None);
        is_typed.then(|| words[2])
    }

    /// The folded value of an instruction whose operands are known as far as necessary.
    fn value(&self, operation: Op, operands: &[u32]) -> Option<u32> {
        let known = |i: usize| self.known.get(*operands.get(i)? as usize).copied().flatten();
        let flag = |b: bool| Some(u32::from(b));
        let (a, b) = (known(0), known(1));
        match operation {
            Op::LogicalNot => return flag(a? == 0),
            Op::LogicalAnd if a == Some(0) || b == Some(0) => return Some(0),
            Op::LogicalOr if a == Some(1) || b == Some(1) => return Some(1),
            Op::Select => return known(if a? != 0 { 1 } else { 2 }),
            Op::CopyObject => return a,
            Op::Not => return Some(!a?),
            _ => {}
        }
        let (a, b) = (a?, b?);
        match operation {
            Op::LogicalAnd | Op::BitwiseAnd => Some(a & b),
            Op::LogicalOr | Op::BitwiseOr => Some(a | b),
            Op::LogicalEqual | Op::IEqual => flag(a == b),
            Op::LogicalNotEqual | Op::INotEqual => flag(a != b),
            Op::UGreaterThan => flag(a > b),
            Op::UGreaterThanEqual => flag(a >= b),
            Op::ULessThan => flag(a < b),
            Op::ULessThanEqual => flag(a <= b),
            Op::IAdd => Some(a.wrapping_add(b)),
            Op::ISub => Some(a.wrapping_sub(b)),
            Op::IMul => Some(a.wrapping_mul(b)),
            _ => None,
        }
    }

    /// Folds an instruction and stores its value; whether the value is new.
    fn learn(&mut self, at: &Place, constants: &HashMap<u32, u32>) -> bool {
        let words = &self.words[at.clone()];
        let folds = words.len() > 2 && matches!(self.types.get(words[1] as usize), Some(Type::Bool | Type::Number));
        if !folds {
            return false;
        }
        let id = words[2];
        if self.known[id as usize].is_some() {
            return false;
        }
        let told = constants.get(&id).copied();
        let value = match op(self.words, at) {
            Some(Op::ConstantTrue) => Some(1),
            Some(Op::ConstantFalse) => Some(0),
            Some(Op::Constant) => Some(words[3]),
            Some(Op::SpecConstantTrue) => Some(u32::from(told != Some(0))),
            Some(Op::SpecConstantFalse) => Some(u32::from(told.unwrap_or(0) != 0)),
            Some(Op::SpecConstant) => Some(told.unwrap_or(words[3])),
            Some(Op::SpecConstantOp) => Op::from_u32(words[3]).and_then(|operation| self.value(operation, &words[4..])),
            Some(operation) => self.value(operation, &words[3..]),
            None => None,
        };
        self.known[id as usize] = value;
        value.is_some()
    }
}

/// `words` with specialization constants as ordinary constants, and without unreachable blocks.
///
/// Expressions of constants become constants, too, where they can be folded: where a single one is left, the validation
/// layer optimises and validates the module again for each pipeline.
///
/// `constants` are pairs of id and value; the others keep their defaults. The result computes the same as a driver that
/// specialises `words`. Decided branches become unconditional, and a phi loses the operands of unreachable
/// predecessors; that of a loop whose continue target is unreachable gets an undefined one for it. Nothing else
/// changes.
///
/// # Panics
/// When the words are not SPIR-V, or have constants of other than 32 bits: glslang's output for Etalon's shaders has
/// none.
#[must_use]
pub fn specialized(words: &[u32], constants: &[(u32, u32)]) -> Vec<u32> {
    let places = instructions(words, HEADER);
    let ids = words[BOUND] as usize;
    let mut module = Module { words, types: vec![Type::None; ids], known: vec![None; ids], undefined: HashSet::new() };
    let mut told = HashMap::new();
    let first_function =
        places.iter().position(|at| op(words, at) == Some(Op::Function)).expect("a module has a function");
    for at in &places[..first_function] {
        let operands = &words[at.start + 1..at.end];
        match op(words, at) {
            Some(Op::Decorate) if operands[1] == spirv::Decoration::SpecId as u32 => {
                let value = constants.iter().find(|(id, _)| *id == operands[2]).map(|&(_, value)| value);
                told.extend(value.map(|value| (operands[0], value)));
            }
            Some(Op::TypeBool) => module.types[operands[0] as usize] = Type::Bool,
            Some(Op::TypeInt | Op::TypeFloat) if operands[1] == 32 => module.types[operands[0] as usize] = Type::Number,
            Some(Op::Undef) => {
                module.undefined.insert(operands[1]);
            }
            // Opcodes of type declarations are consecutive.
            Some(ty) if (Op::TypeVoid as u32..=Op::TypeForwardPointer as u32).contains(&(ty as u32)) => {
                module.types[operands[0] as usize] = Type::Other;
            }
            _ => {
                module.learn(at, &told);
            }
        }
    }

    let mut out = words[..HEADER].to_vec();
    let mut bodies = Vec::new();
    let mut undefined = Vec::new();
    let mut removed = vec![false; ids];
    let mut at = first_function;
    while at < places.len() {
        // A function is OpFunction with its parameters, blocks, and OpFunctionEnd.
        let first_block = at + places[at..].iter().take_while(|p| op(words, p) != Some(Op::Label)).count();
        let end =
            first_block + places[first_block..].iter().take_while(|p| op(words, p) != Some(Op::FunctionEnd)).count();
        for place in &places[at..first_block] {
            bodies.extend_from_slice(&words[place.clone()]);
        }
        let mut function = Function::of(&module, &places[first_block..end]);
        function.prune(&mut module);
        function.write(&module, &mut out[BOUND], &mut bodies, &mut undefined, &mut removed);
        bodies.extend_from_slice(&words[places[end].clone()]);
        at = end + 1;
    }

    // Without arithmetic in subgroups the capability is removed: a device that lacks it may still run the module.
    let adds = Op::GroupNonUniformIAdd as u32..=Op::GroupNonUniformLogicalXor as u32;
    let adds = instructions(&bodies, 0).iter().any(|place| adds.contains(&(bodies[place.start] & 0xffff)));
    for place in &places[..first_function] {
        let instruction = &words[place.clone()];
        match op(words, place) {
            Some(Op::Capability) if !adds && instruction[1] == spirv::Capability::GroupNonUniformArithmetic as u32 => {}
            Some(Op::Decorate) if instruction[2] == spirv::Decoration::SpecId as u32 => {}
            Some(Op::Decorate | Op::Name) if removed[instruction[1] as usize] => {}
            Some(Op::SpecConstantTrue | Op::SpecConstantFalse | Op::SpecConstant | Op::SpecConstantOp) => {
                let (ty, id) = (instruction[1], instruction[2]);
                match (module.types[ty as usize], module.known[id as usize]) {
                    (Type::Bool, Some(0)) => out.extend([3 << 16 | Op::ConstantFalse as u32, ty, id]),
                    (Type::Bool, Some(_)) => out.extend([3 << 16 | Op::ConstantTrue as u32, ty, id]),
                    (_, Some(value)) => out.extend([4 << 16 | Op::Constant as u32, ty, id, value]),
                    // An expression that is not folded here; none of Etalon's shaders has one (tests/specialize.rs).
                    (_, None) => {
                        assert_eq!(op(words, place), Some(Op::SpecConstantOp), "constants have 32 bits");
                        out.extend_from_slice(instruction);
                    }
                }
            }
            _ => out.extend_from_slice(instruction),
        }
    }
    out.extend(undefined);
    out.extend(bodies);
    out
}

/// The control-flow graph of a function.
struct Function {
    blocks: Vec<Block>,
    /// Index of each block, by label.
    index: Vec<usize>,
    /// Targets of conditional branches that exit an enclosing construct.
    exits: HashSet<u32>,
    reached: Vec<bool>,
}

impl Function {
    fn of(module: &Module<'_>, places: &[Place]) -> Self {
        let words = module.words;
        let mut blocks: Vec<Block> = Vec::new();
        let mut current: Option<Block> = None;
        for place in places {
            let Some(block) = &mut current else {
                let label = words[place.start + 1];
                current = Some(Block { label, phis: Vec::new(), body: Vec::new(), merge: None, end: place.clone() });
                continue;
            };
            match op(words, place) {
                Some(Op::Phi) => block.phis.push(place.clone()),
                Some(Op::SelectionMerge | Op::LoopMerge) => block.merge = Some(place.clone()),
                Some(
                    Op::Branch
                    | Op::BranchConditional
                    | Op::Switch
                    | Op::Return
                    | Op::ReturnValue
                    | Op::Kill
                    | Op::TerminateInvocation
                    | Op::Unreachable,
                ) => {
                    block.end = place.clone();
                    blocks.extend(current.take());
                }
                other => {
                    assert_ne!(other, Some(Op::Label), "a block ends in one of the branches above");
                    block.body.push(place.clone());
                }
            }
        }
        // A conditional branch without a merge instruction exits a construct: its target must stay that construct's
        // merge block.
        let exits = blocks.iter().filter(|block| block.merge.is_none());
        let exits = exits.filter(|block| op(words, &block.end) == Some(Op::BranchConditional));
        let exits = exits.flat_map(|block| words[block.end.start + 2..block.end.start + 4].iter().copied()).collect();
        let mut index = vec![usize::MAX; module.known.len()];
        for (i, block) in blocks.iter().enumerate() {
            index[block.label as usize] = i;
        }
        let reached = vec![true; blocks.len()];
        Self { blocks, index, exits, reached }
    }

    /// Finds the reachable blocks and folds values until a fixed point is reached.
    fn prune(&mut self, module: &mut Module<'_>) {
        let nothing = HashMap::new();
        loop {
            self.reach(module);
            let mut news = false;
            for (block, _) in self.blocks.iter().zip(&self.reached).filter(|(_, reached)| **reached) {
                for phi in &block.phis {
                    let operands = &module.words[phi.start + 3..phi.end];
                    let mut from = operands.as_chunks::<2>().0.iter().filter(|pair| self.leads(module, pair[1], block));
                    // A phi with one reachable predecessor is a copy of that operand.
                    if let (Some(&[value, _]), None) = (from.next(), from.next())
                        && let Some(value) = module.known[value as usize]
                    {
                        news |= module.known[module.words[phi.start + 2] as usize].replace(value).is_none();
                    }
                }
                for place in &block.body {
                    news |= module.learn(place, &nothing);
                }
            }
            if !news {
                return;
            }
        }
    }

    /// Whether block `from` is reachable and branches to block `to`.
    fn leads(&self, module: &Module<'_>, from: u32, to: &Block) -> bool {
        let from = self.index[from as usize];
        self.reached[from] && self.targets(module, from).contains(&to.label)
    }

    /// Labels that a block branches to. A loop's back edge and a selection with exits from within keep both targets,
    /// because structured control flow needs them.
    fn targets(&self, module: &Module<'_>, block: usize) -> Vec<u32> {
        let block = &self.blocks[block];
        let words = &module.words[block.end.clone()];
        if op(module.words, &block.end) == Some(Op::BranchConditional) {
            if let (Some(merge), None) = block.merges(module.words)
                && self.exits.contains(&merge)
            {
                return vec![words[2], words[3]];
            }
            let goes_back = |label: u32| {
                let target = &self.blocks[self.index[label as usize]];
                target.merges(module.words).1.is_some()
                    && self.index[label as usize] <= self.index[block.label as usize]
            };
            if goes_back(words[2]) || goes_back(words[3]) {
                return vec![words[2], words[3]];
            }
        }
        block.targets(module)
    }

    fn reach(&mut self, module: &Module<'_>) {
        self.reached.fill(false);
        let mut open = vec![0];
        while let Some(i) = open.pop() {
            if !std::mem::replace(&mut self.reached[i], true) {
                open.extend(self.targets(module, i).iter().map(|&label| self.index[label as usize]));
            }
        }
    }

    fn write(
        &self,
        module: &Module<'_>,
        bound: &mut u32,
        out: &mut Vec<u32>,
        undefined: &mut Vec<u32>,
        removed: &mut [bool],
    ) {
        let words = module.words;
        // Structured control flow needs the merge blocks and continue targets of reachable headers, reachable or not.
        let mut named = HashSet::new();
        let mut continued = HashMap::new();
        for i in (0..self.blocks.len()).filter(|&i| self.reached[i]) {
            let block = &self.blocks[i];
            if self.keeps_merge(module, i) {
                let (merge, goes_on) = block.merges(words);
                named.extend(merge);
                continued.extend(goes_on.map(|target| (target, block.label)));
            }
        }
        for (i, block) in self.blocks.iter().enumerate() {
            let label = [2 << 16 | Op::Label as u32, block.label];
            if !self.reached[i] {
                for id in block.phis.iter().chain(&block.body).filter_map(|place| module.result(place)) {
                    removed[id as usize] = true;
                }
                if let Some(header) = continued.get(&block.label) {
                    out.extend(label);
                    out.extend([2 << 16 | Op::Branch as u32, *header]);
                } else if named.contains(&block.label) {
                    out.extend(label);
                    out.push(1 << 16 | Op::Unreachable as u32);
                } else {
                    removed[block.label as usize] = true;
                }
                continue;
            }
            out.extend(label);
            let goes_on = block.merges(words).1.map(|label| self.index[label as usize]).filter(|&i| !self.reached[i]);
            for phi in &block.phis {
                let mut pairs: Vec<u32> = words[phi.start + 3..phi.end]
                    .as_chunks::<2>()
                    .0
                    .iter()
                    .filter(|pair| self.leads(module, pair[1], block))
                    .flatten()
                    .copied()
                    .collect();
                if let Some(unreached) = goes_on {
                    let from = self.blocks[unreached].label;
                    let operands = words[phi.start + 3..phi.end].as_chunks::<2>().0;
                    let is_undefined = |pair: &&[u32; 2]| pair[1] == from && module.undefined.contains(&pair[0]);
                    let value = operands.iter().find(is_undefined).map(|pair| pair[0]).unwrap_or_else(|| {
                        undefined.extend([3 << 16 | Op::Undef as u32, words[phi.start + 1], *bound]);
                        *bound += 1;
                        *bound - 1
                    });
                    pairs.extend([value, from]);
                }
                let (ty, result) = (words[phi.start + 1], words[phi.start + 2]);
                // One reachable predecessor holds for all phis of the block. Drivers make a variable of each phi.
                if let [value, _] = pairs[..] {
                    out.extend([4 << 16 | Op::CopyObject as u32, ty, result, value]);
                } else {
                    out.push((3 + pairs.len() as u32) << 16 | Op::Phi as u32);
                    out.extend([ty, result]);
                    out.extend(pairs);
                }
            }
            for place in &block.body {
                out.extend_from_slice(&words[place.clone()]);
            }
            if let Some(merge) = block.merge.clone().filter(|_| self.keeps_merge(module, i)) {
                out.extend_from_slice(&words[merge]);
            }
            let end = &words[block.end.clone()];
            match (op(words, &block.end), self.targets(module, i).as_slice()) {
                (Some(Op::BranchConditional), &[target]) => out.extend([2 << 16 | Op::Branch as u32, target]),
                (Some(Op::Switch), &[target]) => out.extend([3 << 16 | Op::Switch as u32, end[1], target]),
                _ => out.extend_from_slice(end),
            }
        }
    }

    /// Whether the block keeps its merge instruction. A decided selection loses it; a decided switch keeps it, because
    /// blocks within may exit to its merge block.
    fn keeps_merge(&self, module: &Module<'_>, block: usize) -> bool {
        let is_if = op(module.words, &self.blocks[block].end) == Some(Op::BranchConditional);
        let is_loop = self.blocks[block].merges(module.words).1.is_some();
        is_loop || !is_if || self.targets(module, block).len() > 1
    }
}
