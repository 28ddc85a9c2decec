// Path tracing in steps, 1 of 4: traces the ray of each path to its next vertex.
// Where to read: lib/path_steps.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 64) in;
#include "lib/add_work.glsl"
#include "lib/path_steps.glsl"

void main() {
    uint entry = own_entry();
    bool alive = (entry & TERMINATED) == 0;
    if (alive) {
        uvec4 a = origins[entry];
        vec3 direction = uintBitsToFloat(directions[entry].xyz);
        float from = KEEPS_T_MIN ? t_mins[entry] : 0.0;
        Hit hit = trace(uintBitsToFloat(a.xyz), direction, a.w, Hit(from, NO_TRIANGLE, 0.0, 0.0), LARGEST, OPAQUE | FILTER, false);
        hits[entry] = uvec4(floatBitsToUint(hit.t), hit.triangle, floatBitsToUint(hit.u), floatBitsToUint(hit.v));
    }
    ADD_WORK(indirect, alive ? 1u : 0u)
    ADD_WORK(node_visits, node_visits)
    ADD_WORK(triangle_tests, triangle_tests)
}
