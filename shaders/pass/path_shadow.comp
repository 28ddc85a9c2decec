// Path tracing in steps, 4 of 4: traces the shadow ray of each path, and adds the light that arrives.
// Where to read: lib/path_steps.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 64) in;
#include "lib/path_shadow_ray.glsl"

void main() {
    uint entry = own_entry();
    bool alive = (entry & TERMINATED) == 0;
    if (alive) {
        ShadowRay shadow_ray = shadow_ray_of(entry);
        if (shadow_ray.t_max > 0.0) {
            shadow_rays++;
            sums[entry].xyz = floatBitsToUint(uintBitsToFloat(sums[entry].xyz) + shadow_ray.contribution * arriving(shadow_ray));
        }
    }
    count_paths(0, 0.0, 0.0);
}
