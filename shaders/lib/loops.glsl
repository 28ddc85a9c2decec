// Evaluations of loop heads: lavapipe ends all loops of an invocation in silence after 65,535 of them
// (docs/decisions/lavapipe.md).
#ifndef LOOPS_GLSL
#define LOOPS_GLSL

// Those so far by this invocation.
uint loop_heads = 0;
// Those it may spend. Eight pixels share the 65,535, and the longest of them counts in every loop: 40,000 of one's own leaves them
// room.
layout(constant) const uint LOOP_BUDGET = 40000;
#endif
