//! Removal of `gl_PrimitiveID` from SPIR-V, for devices without the feature geometryShader (MoltenVK, SwiftShader).
//!
//! Read the SPIR-V specification, section BuiltIn (`PrimitiveId` in fragment shaders needs the capability `Geometry`).

use std::ops::Range;

use spirv::{BuiltIn, Capability, Decoration, Op};

use super::specialize::{BOUND, HEADER, instructions, op};

/// `words` with 0 for `gl_PrimitiveID` in a fragment shader, and without the capability `Geometry`.
#[must_use]
pub fn without_primitive_ids(words: &[u32]) -> Vec<u32> {
    let places = instructions(words, HEADER);
    let is = |of: &[u32]| of[1..] == [Decoration::BuiltIn as u32, BuiltIn::PrimitiveId as u32];
    let decorated = places.iter().filter(|at| op(words, at) == Some(Op::Decorate));
    let Some(variable) = decorated.map(|at| &words[at.start + 1..at.end]).find(|of| is(of)).map(|of| of[0]) else {
        return words.to_vec();
    };
    let mut out = words[..HEADER].to_vec();
    let zero = words[BOUND];
    out[BOUND] += 1;
    for at in &places {
        let instruction = &words[at.clone()];
        match op(words, at) {
            Some(Op::Capability) if instruction[1] == Capability::Geometry as u32 => {}
            Some(Op::EntryPoint) => {
                let kept: Vec<u32> = instruction[3..].iter().copied().filter(|&word| word != variable).collect();
                out.push((3 + kept.len() as u32) << 16 | Op::EntryPoint as u32);
                out.extend(&instruction[1..3]);
                out.extend(kept);
            }
            Some(Op::Name | Op::Decorate) if instruction[1] == variable => {}
            Some(Op::Variable) if instruction[2] == variable => {
                let is_pointer =
                    |of: &Range<usize>| op(words, of) == Some(Op::TypePointer) && words[of.start + 1] == instruction[1];
                let pointer = places.iter().find(|of| is_pointer(of)).expect("a variable has a type");
                out.extend([4 << 16 | Op::Constant as u32, words[pointer.start + 3], zero, 0]);
            }
            Some(Op::Load) if instruction[3] == variable => {
                out.extend([4 << 16 | Op::CopyObject as u32, instruction[1], instruction[2], zero]);
            }
            _ => out.extend_from_slice(instruction),
        }
    }
    out
}
