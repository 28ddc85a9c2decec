// Reflection and refraction in steps, 3 of 6: draws the first light sample at the surface that the last branch of each ray tree
// has met (next event estimation).
// Where to read: lib/interact_steps.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 64) in;
#include "lib/interact_steps.glsl"

void main() {
    uint place = place_in_queue();
    if (place >= steps[this_step].met.count) return;
    tree = queues[MET * trees_at_once + place];
    uvec4 known = trees[tree_word(TREE_PIXEL)];
    waiting = known.y;
    Branch ray = last_branch();
    HitPoint point = hit_point_of(tree_hit(), ray.origin, ray.direction);
    vec3 n = facing_normal(point, ray.direction);
    write_light(light_sample(ray_origin(point.p, n, -ray.direction), receiver_at_hit(n), uvec2(unpacked_pixel(known.x)), known.z, 0));
}
