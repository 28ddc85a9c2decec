// Reflection and refraction in steps, 5 of 6: lights the surface that the last branch of each ray tree has met by the
// environment, with visibility. It takes the place of the environment's part of the kernel before.
// Where to read: lib/interact_steps.glsl; lib/ambient_occlusion.glsl.
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
        sky_list = list_of(uvec2(unpacked_pixel(known.x)));
        Branch ray = last_branch();
        Hit found = tree_hit();
        HitSurface hit = surface_met(ray, found, ray.width + ray.spread * found.t, EVERY_SLOT);
        Boundary boundary = boundary_at(hit, ray.media, ray.direction);
        if (!boundary.suppressed_by_priority) {
            Surface s = surface_for_lights(hit, boundary, found.triangle);
            LayersAtHit layers = layers_at_hit(s);
            vec3 light = environment_light_at_hit(s, layers, shown_to(s));
            // Read again, so that no register holds it while rays are traced.
            waiting = found_anew(waiting, shadow_rays);
            ray = last_branch();
            vec3 weight = wanted(ray.events, ray.throughput * hit.coverage);
            read_sum();
            precise vec3 around_here = weight * light;
            precise vec3 with_it = sum + around_here;
            sum = with_it;
            write_sum();
        }
    }
    if (FIRST_EVENT == 0) count_rays(0, 0, 0.0, 0.0);
}
