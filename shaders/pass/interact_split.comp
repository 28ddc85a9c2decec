// Reflection and refraction in steps, 6 of 6: splits the last branch of each ray tree at the surface that it has met.
// Where to read: lib/interact_steps.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 64) in;
#include "lib/interact_steps.glsl"

void main() {
    uint place = place_in_queue();
    bool is_met = place < steps[this_step].met.count;
    if (is_met) {
        tree = queues[MET * trees_at_once + place];
        uvec4 known = trees[tree_word(TREE_PIXEL)];
        waiting = known.y;
        Branch ray = last_branch();
        if (FIRST_EVENT != 0) first_event = ray.events >> 10;
        Hit found = tree_hit();
        float cone = ray.width + ray.spread * found.t;
        HitSurface hit = surface_met(ray, found, cone, SPLITTING_SLOTS);
        Boundary boundary = boundary_at(hit, ray.media, ray.direction);
        waiting--;
        read_around();
        split(hit, boundary, ray, cone, uvec2(unpacked_pixel(known.x)), known.z);
        write_around();
        trees[tree_word(TREE_PIXEL)].y = waiting;
    }
    APPEND_TO_NEXT_STEP(is_met)
    if (FIRST_EVENT == 0) count_rays(0, 0, 0.0, 0.0);
}
