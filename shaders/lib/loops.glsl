// A limit on loop iterations: lavapipe ends all loops of an invocation silently after 65,535 of them.
// Where to read: docs/decisions/lavapipe.md.
#ifndef LOOPS_GLSL
#define LOOPS_GLSL

// Loop iterations of this invocation so far. No shader counts them: crates/vulkan/src/loops.rs inserts the counting into
// the SPIR-V for devices that need it. Such a device gets a private variable. Here it is shared memory, because the build's
// optimiser does not remove reads of that.
shared uint loop_iterations;
// Loop iterations that one invocation may use. Eight pixels share the 65,535, and in every loop the longest of them counts:
// 40,000 of its own leave room for the others.
layout(constant) const uint LOOP_BUDGET = 40000;
#endif
