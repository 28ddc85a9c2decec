// Path tracing in steps, 2 of 4: at the vertex of each path, draws the first light sample (next event estimation) and a
// photon, and weights the emission that the path has found there (multiple importance sampling): all that searches lights.
// Where to read: lib/path_steps.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 64) in;
#include "lib/path_shadow_ray.glsl"

void main() {
    uint entry = own_entry();
    if ((entry & TERMINATED) != 0) return;
    uvec4 hit = hits[entry];
    if (hit.y == NO_TRIANGLE) return;
    Path p = path_without_sum(entry);
    Hit found = Hit(uintBitsToFloat(hit.x), hit.y, uintBitsToFloat(hit.z), uintBitsToFloat(hit.w));
    HitPoint point = hit_point_of(found, p.origin, p.direction);
    vec3 n = facing_normal(point, p.direction);
    if (EMITTERS > 0) store_light(draw_first_light(p, ray_origin(point.p, n, -p.direction), pixel_of(entry)), entry);
    // Whether the surface scatters is not known here. Where it does not, few photons are near.
    if (PHOTON_MAP) store_photon(draw_photon(p, point.p, n, pixel_of(entry), true), entry);
    if (EMISSIVE_TRIANGLES) {
        p.distance_since_vertex = uintBitsToFloat(sums[entry].w);
        // The face that the ray left is not needed any more.
        origins[entry].w = floatBitsToUint(weight_of_emission(p, found, n));
    }
}
