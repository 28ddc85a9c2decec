// Reflection and refraction in steps, 4 of 6: lights the surface that the last branch of each ray tree has met.
// Where to read: lib/interact_steps.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 64) in;
#include "lib/interact_steps.glsl"

void main() {
    uint place = place_in_queue();
    if (place < steps[this_step].met.count) {
        tree = queues[MET * trees_at_once + place];
        uvec4 known = trees[tree_word(TREE_PIXEL)];
        waiting = known.y;
        Branch ray = last_branch();
        Hit found = tree_hit();
        HitSurface hit = surface_met(ray, found, ray.width + ray.spread * found.t, EVERY_SLOT);
        Boundary boundary = boundary_at(hit, ray.media, ray.direction);
        if (!boundary.suppressed_by_priority) {
            Surface s = surface_for_lights(hit, boundary, found.triangle);
            vec3 light = radiance_to_eye(s, unpacked_pixel(known.x), known.z, 0, all_lights(), true);
            // Read again, so that no register holds it while shadow rays are traced.
            waiting = found_anew(waiting, shadow_rays);
            ray = last_branch();
            vec3 weight = wanted(ray.events, ray.throughput * hit.coverage);
            read_sum();
            sum += weight * light;
            write_sum();
            if (samples_cut_off > 0) {
                read_around();
                lost += largest(ray.throughput);
                write_around();
            }
        }
    }
    if (FIRST_EVENT == 0) count_rays(0, 0, 0.0, 0.0);
}
