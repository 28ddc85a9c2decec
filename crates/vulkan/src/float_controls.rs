//! Float controls: execution modes that make f32 arithmetic keep signed zeros, infinities and NaN, and round to nearest
//! even.
//!
//! Read the SPIR-V specification, section Execution Modes (`SignedZeroInfNanPreserve`, `RoundingModeRTE`), and the
//! Vulkan specification, `VkPhysicalDeviceFloatControlsProperties`. Without these modes a compiler may assume that no
//! infinities and NaN occur, and may choose the rounding of compensated sums.

use spirv::{Capability, ExecutionMode, Op};

use super::offers::Offers;
use super::specialize::{HEADER, instructions, op};

/// `words` with the execution modes that the device offers, for 32-bit floats.
///
/// # Panics
/// When the module has no entry point.
#[must_use]
pub fn with_float_controls(words: &[u32], offers: &Offers) -> Vec<u32> {
    let wanted = [
        (offers.keeps_specials, Capability::SignedZeroInfNanPreserve, ExecutionMode::SignedZeroInfNanPreserve),
        (offers.rounds_to_even, Capability::RoundingModeRTE, ExecutionMode::RoundingModeRTE),
    ];
    let wanted = || wanted.into_iter().filter(|(offered, ..)| *offered);
    let places = instructions(words, HEADER);
    let entry = places.iter().rfind(|at| op(words, at) == Some(Op::EntryPoint)).expect("a module has an entry point");
    let main = words[entry.start + 2];
    let mut out = words[..HEADER].to_vec();
    for (_, capability, _) in wanted() {
        out.extend([2 << 16 | Op::Capability as u32, capability as u32]);
    }
    out.extend_from_slice(&words[HEADER..entry.end]);
    for (.., mode) in wanted() {
        out.extend([4 << 16 | Op::ExecutionMode as u32, main, mode as u32, 32]);
    }
    out.extend_from_slice(&words[entry.end..]);
    out
}
