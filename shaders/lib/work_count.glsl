// Work that a pass did, exactly and whatever the order: sums in 64 bits as pairs of words.
#ifndef WORK_COUNT_GLSL
#define WORK_COUNT_GLSL
#include "lib/add_work.glsl"
#include "lib/shadow.glsl"

// Boundaries that were left without having been entered.
uint unmatched_exits = 0;

// `lost` of all pixels of the invocation, and of the worst.
void count_rays(uint reflection, uint refraction, float lost, float most_lost) {
    ADD_WORK(reflection, reflection)
    ADD_WORK(refraction, refraction)
    ADD_WORK(shadow, shadow_rays)
    ADD_WORK(node_visits, node_visits)
    ADD_WORK(triangle_tests, triangle_tests)
    ADD_WORK(unmatched_exits, unmatched_exits)
    ADD_WORK(lights_cut_off, lights_cut_off)
    // Steps of 2^-16, rounded up: what is counted is not less than what was lost.
    ADD_WORK(lost, lost > 0.0 ? uint(min(lost, 1e3) * 65536.0) + 1u : 0u)
    uint most = subgroupMax(floatBitsToUint(most_lost));
    if (subgroupElect() && most > 0) atomicMax(counts.most_lost, most);
}

void count_paths(uint rays, float lost, float most_lost) {
    ADD_WORK(indirect, rays)
    count_rays(0, 0, lost, most_lost);
}
#endif
