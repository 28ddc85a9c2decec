//! Counting of loop heads, for devices that end loops after so many of them (docs/decisions/lavapipe.md).
//!
//! Shaders read `loop_heads` (shaders/lib/loops.glsl) to end on their own account before the device does, and say so. The counting is
//! no part of their algorithms, so it is written into the SPIR-V here, at the head of every loop.

use std::ops::Range;

use spirv::{Op, StorageClass};

use super::specialize::{BOUND, HEADER, instructions, op};

/// The variable that shaders call `loop_heads`: the only scalar of shared memory in any of them.
struct Counter {
    uint: u32,
    variable: u32,
    /// Where it is declared.
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

/// `words` with `loop_heads` as a variable of each invocation, which every loop adds 1 to at its head. Unless `counts`, or where
/// nothing reads it, it is 0 and costs nothing.
///
/// # Panics
/// When a module that counts has more than one function: the optimiser of the build leaves one.
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
                // Name and string come before the variables, and hold no id by chance: only the tail is searched.
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
