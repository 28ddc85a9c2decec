// Work counters of a pass with rays: exact 64-bit sums, independent of the order of the invocations.
#ifndef WORK_COUNT_GLSL
#define WORK_COUNT_GLSL
#include "lib/add_work.glsl"
#include "lib/shadow.glsl"

// Exits from media without an entry.
uint unmatched_exits = 0;

// `lost` is the sum over all pixels of the invocation, `most_lost` the largest of one pixel.
void count_rays(uint reflection, uint refraction, float lost, float most_lost) {
    ADD_WORK(reflection, reflection)
    ADD_WORK(refraction, refraction)
    ADD_WORK(shadow, shadow_rays)
    ADD_WORK(node_visits, node_visits)
    ADD_WORK(triangle_tests, triangle_tests)
    ADD_WORK(unmatched_exits, unmatched_exits)
    ADD_WORK(lights_cut_off, lights_cut_off)
    // In steps of 2^-16, rounded up: the count is never below the true loss.
    ADD_WORK(lost, lost > 0.0 ? uint(min(lost, 1e3) * 65536.0) + 1u : 0u)
    uint most = subgroupMax(floatBitsToUint(most_lost));
    if (subgroupElect() && most > 0) atomicMax(counts.most_lost, most);
}

void count_paths(uint rays, float lost, float most_lost) {
    ADD_WORK(indirect, rays)
    count_rays(0, 0, lost, most_lost);
}
#endif
