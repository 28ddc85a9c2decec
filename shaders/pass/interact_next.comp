// Reflection and refraction in steps: the sizes of the queues of the last step become those of the first one.
// Where to read: lib/interact_steps.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 1) in;
#include "lib/interact_steps.glsl"

void main() {
    const WorkSize none = WorkSize(0u, 1u, 1u, 0u);
    steps[0] = steps[STEPS];
    for (uint i = 1; i <= STEPS; i++) steps[i] = StepSizes(none, none, none);
}
