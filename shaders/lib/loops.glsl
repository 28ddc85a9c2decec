// Loops: a limit on their iterations, for lavapipe ends all loops of an invocation silently after 65,535 of them; and what is
// computed in each turn.
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

// On GPUs what follows from the constants of a loop is computed in each turn: until a turn needs it, no register holds it. CPUs
// compute it once, and have memory for it.
layout(constant) const bool FINDS_ANEW = false;

// 0 where `of_turn` is below 2^31 and is known only within a turn of a loop. A compiler does not know that it is below, so what
// follows from a value combined with this is computed in each turn, instead of once before the loop.
uint zero_of(uint of_turn) {
    return FINDS_ANEW ? of_turn >> 31 : 0u;
}

// x, found anew in a turn.
uint found_anew(uint x, uint of_turn) {
    return x ^ zero_of(of_turn);
}

float found_anew(float x, uint of_turn) {
    return uintBitsToFloat(floatBitsToUint(x) ^ zero_of(of_turn));
}

vec2 found_anew(vec2 x, uint of_turn) {
    return uintBitsToFloat(floatBitsToUint(x) ^ zero_of(of_turn));
}

vec3 found_anew(vec3 x, uint of_turn) {
    return uintBitsToFloat(floatBitsToUint(x) ^ zero_of(of_turn));
}

vec4 found_anew(vec4 x, uint of_turn) {
    return uintBitsToFloat(floatBitsToUint(x) ^ zero_of(of_turn));
}
#endif
