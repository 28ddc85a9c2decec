//! Counting of loop iterations in SPIR-V, for devices that end loops after a fixed number (docs/decisions/lavapipe.md).
//!
//! Read the SPIR-V specification, sections Structured Control Flow and `OpLoopMerge`. Shaders read `loop_iterations`
//! (shaders/lib/loops.glsl) to end before the device does, and report it. The count is no part of their algorithms, so
//! this file inserts it into the header block of every loop.

use std::ops::Range;

use spirv::{Op, StorageClass};

use super::specialize::{BOUND, HEADER, instructions, op};

/// The variable `loop_iterations` of the shaders: the only scalar in shared memory of any shader.
struct Counter {
    uint: u32,
    variable: u32,
    /// The instruction that declares the variable.
    declared: Range<usize>,
}

impl Counter {
    fn of(words: &[u32], places: &[Range<usize>]) -> Option<Self> {
        let find = |operation, test: &dyn Fn(&[u32]) -> bool| {
            let mut found = places.iter().filter(|at| op(words, at) == Some(operation));
            found.find(|at| test(&words[at.start + 1..at.end])).cloned()
        };
        let uint = words[find(Op::TypeInt, &|of| of[1..] == [32, 0])?.start + 1];
        let shared = StorageClass::Workgroup as u32;
        let pointer = words[find(Op::TypePointer, &|of| of[1..] == [shared, uint])?.start + 1];
        let declared = find(Op::Variable, &|of| of[0] == pointer)?;
        Some(Self { uint, variable: words[declared.start + 2], declared })
    }
}

/// `words` with `loop_iterations` as a private variable of each invocation, which every loop header increments. It is
/// the constant 0 and free where `counts` is false or no instruction reads it.
///
/// # Panics
/// When a module that counts has more than one function: the build's optimiser leaves one.
#[must_use]
pub fn with_loops_counted(words: &[u32], counts: bool) -> Vec<u32> {
    let places = instructions(words, HEADER);
    let Some(counter) = Counter::of(words, &places) else { return words.to_vec() };
    let reads = |at: &Range<usize>| op(words, at) == Some(Op::Load) && words[at.start + 3] == counter.variable;
    let counts = counts && places.iter().any(reads);
    let mut out = words[..HEADER].to_vec();
    let mut new_id = || {
        out[BOUND] += 1;
        out[BOUND] - 1
    };
    let [pointer, zero, one] = [new_id(), new_id(), new_id()];
    let (uint, variable) = (counter.uint, counter.variable);
    let function = StorageClass::Function as u32;
    let functions = places.iter().filter(|at| op(words, at) == Some(Op::Function)).count();
    assert!(!counts || functions == 1, "a program has one function");
    let mut declared = false;
    for at in &places {
        let instruction = &words[at.clone()];
        match op(words, at) {
            Some(Op::EntryPoint) => {
                // Only the words after name and string are searched: a word of the string could equal the id by chance.
                let kept: Vec<u32> = instruction[3..].iter().copied().filter(|&word| word != variable).collect();
                out.push((3 + kept.len() as u32) << 16 | Op::EntryPoint as u32);
                out.extend(&instruction[1..3]);
                out.extend(kept);
            }
            Some(Op::Name | Op::Decorate) if instruction[1] == variable => {}
            _ if *at == counter.declared => {
                out.extend([4 << 16 | Op::Constant as u32, uint, zero, 0]);
                if counts {
                    out.extend([4 << 16 | Op::Constant as u32, uint, one, 1]);
                    out.extend([4 << 16 | Op::TypePointer as u32, pointer, function, uint]);
                }
            }
            // Variables come first in the first block of their function.
            Some(Op::Label) if counts && !declared => {
                declared = true;
                out.extend(instruction);
                out.extend([5 << 16 | Op::Variable as u32, pointer, variable, function, zero]);
            }
            Some(Op::Load) if !counts && reads(at) => {
                out.extend([4 << 16 | Op::CopyObject as u32, instruction[1], instruction[2], zero]);
            }
            Some(Op::LoopMerge) if counts => {
                let [before, after] = [out[BOUND], out[BOUND] + 1];
                out[BOUND] += 2;
                out.extend([4 << 16 | Op::Load as u32, uint, before, variable]);
                out.extend([5 << 16 | Op::IAdd as u32, uint, after, before, one]);
                out.extend([3 << 16 | Op::Store as u32, variable, after]);
                out.extend(instruction);
            }
            _ => out.extend_from_slice(instruction),
        }
    }
    out
}
