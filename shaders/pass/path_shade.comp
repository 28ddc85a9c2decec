// Path tracing in steps, 2 of 3: shades the vertex of each path, and appends the paths that go on to the next queue.
// The order of the next queue varies from run to run. Each path adds to its own pixel alone, so the film does not.
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
    // Three atomics per subgroup. `base` is 0 but in the invocation that added, so the maximum passes it to all.
    uint before = subgroupExclusiveAdd(goes_on ? 1u : 0u);
    uint appended = subgroupAdd(goes_on ? 1u : 0u);
    uint base = 0;
    if (subgroupElect() && appended > 0) {
        base = atomicAdd(sizes[bounce + 1].count, appended);
        uint groups = (base + appended + gl_WorkGroupSize.x - 1) / gl_WorkGroupSize.x;
        atomicMax(sizes[bounce + 1].x, min(groups, ROW));
        atomicMax(sizes[bounce + 1].y, (groups + ROW - 1) / ROW);
    }
    base = subgroupMax(base);
    if (goes_on) queues[((bounce + 1) & 1u) * places + base + before] = entry;
    count_paths(0, lost, most_lost);
}
