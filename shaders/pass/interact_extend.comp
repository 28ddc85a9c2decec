// Reflection and refraction in steps, 2 of 6: traces the last branch of each ray tree. One that leaves the scene ends here.
// Where to read: lib/interact_steps.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 64) in;
#include "lib/interact_steps.glsl"

void main() {
    uint place = place_in_queue();
    bool grows = place < steps[this_step].growing.count;
    bool at_surface = false;
    bool by_reflection = false;
    if (grows) {
        tree = queues[queue_start(GROWING, this_step) + place];
        uvec4 known = trees[tree_word(TREE_PIXEL)];
        waiting = known.y;
        Branch ray = last_branch();
        by_reflection = is_reflected(ray);
        // A pair of surfaces could pass a ray to each other for ever.
        bool is_last = known.z >= MOST_RAYS;
        HitPoint point;
        Hit found = trace_branch(ray, !is_last, point);
        at_surface = found.triangle != NO_TRIANGLE;
        ray.throughput = throughput_after(ray, at_surface ? found.t : 0.0);
        if (at_surface) {
            trees[tree_word(TREE_HIT)] = uvec4(floatBitsToUint(found.t), found.triangle, floatBitsToUint(found.u), floatBitsToUint(found.v));
            if (ABSORPTION == ABSORPTION_PATH) {
                branches[branch_word(waiting - 1, BRANCH_THROUGHPUT)].xyz = floatBitsToUint(ray.throughput);
            }
        } else {
            read_sum();
            read_around();
            if (is_last) {
                for (; waiting > 0; waiting--) lost += largest(last_branch().throughput);
            } else {
                leave_scene(ray);
                waiting--;
            }
            write_sum();
            write_around();
        }
        trees[tree_word(TREE_PIXEL)] = uvec4(known.x, waiting, known.z + 1u, 0u);
    }
    APPEND_TO_QUEUE(steps[this_step].met, queues, MET * trees_at_once, at_surface, tree)
    APPEND_TO_NEXT_STEP(grows && !at_surface)
    if (FIRST_EVENT == 0) count_rays(grows && by_reflection ? 1u : 0u, grows && !by_reflection ? 1u : 0u, 0.0, 0.0);
}
