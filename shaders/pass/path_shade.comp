// Path tracing in steps, 3 of 4: shades the vertex of each path, and appends the paths that go on to the next queue.
// The order of the next queue varies from run to run. Each path adds to its own pixel alone, so the film does not.
// Where to read: lib/path_steps.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 64) in;
#include "lib/path_shadow_ray.glsl"

uint entry; // of the queue

// What path_sample.comp has stored. Where the path met nothing, that is of an earlier vertex, and shade_vertex makes no use
// of it.
float emission_weight(Path p, Hit found, vec3 n) {
    return uintBitsToFloat(origins[entry].w);
}

LightSample first_light(Path p, vec3 origin, uvec2 pixel) {
    return stored_light(entry);
}

PhotonSample photon_near(Path p, vec3 p_bvh, vec3 n, uvec2 pixel, bool wanted) {
    PhotonSample photon = stored_photon(entry);
    if (!wanted) photon.arriving = vec3(0.0);
    return photon;
}

uvec4 media_before(Path p) {
    return KEEPS_MEDIA ? media[found_anew(entry, bounce)] : p.media;
}

void main() {
    entry = own_entry();
    bool alive = (entry & TERMINATED) == 0;
    bool goes_on = false;
    if (alive) {
        // The sum is read when it is needed: until then it would take registers.
        Path p = path_without_sum(entry);
        p.distance_since_vertex = uintBitsToFloat(sums[entry].w);
        uvec4 hit = hits[entry];
        ShadowRay shadow_ray;
        Hit found = Hit(uintBitsToFloat(hit.x), hit.y, uintBitsToFloat(hit.z), uintBitsToFloat(hit.w));
        vec3 gathered = shade_vertex(p, found, pixel_of(entry), true, shadow_ray);
        p.sum = uintBitsToFloat(sums[entry].xyz) + gathered;
        store_path(p, entry);
        if (EMITTERS > 0) store_shadow_ray(shadow_ray, entry);
        goes_on = (p.state & PATH_ALIVE) != 0;
    }
    APPEND_TO_QUEUE(sizes[bounce + 1], queues, ((bounce + 1) & 1u) * places, goes_on, entry)
    count_paths(0, lost, most_lost);
}
