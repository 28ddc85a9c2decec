// Evaluations of loop heads: lavapipe ends all loops of an invocation in silence after 65,535 of them
// (docs/decisions/lavapipe.md).
#ifndef LOOPS_GLSL
#define LOOPS_GLSL

// Those so far by this invocation. No shader counts: crates/vulkan/src/loops.rs writes the counting into the SPIR-V of devices that need it.
// What such a device gets is a variable of the invocation; it is shared memory here because the optimiser of the build leaves reads of that where
// they stand.
shared uint loop_iterations;
// Those it may spend. Eight pixels share the 65,535, and the longest of them counts in every loop: 40,000 of one's own leaves them
// room.
layout(constant) const uint LOOP_BUDGET = 40000;
#endif
