// Work that a pass did, exactly and whatever the order: sums in 64 bits as pairs of words.
#ifndef WORK_COUNT_GLSL
#define WORK_COUNT_GLSL
#include "lib/shadow.glsl"

// Twin: src/share.rs.
#include "share/work.glsl"

layout(scalar, set = 0, binding = 43) buffer WorkDone { WorkCounts counts; };

// Boundaries that were left without having been entered.
uint stray_interfaces = 0;

// One addition per subgroup; the sum of a subgroup fits into a word. An atomic's old value tells whether the low word
// ran over.
#define ADD_WORK(member, value) \
    { \
        uint total = subgroupAdd(value); \
        if (subgroupElect() && total > 0) { \
            uint old = atomicAdd(counts.member[0], total); \
            if (old + total < old) atomicAdd(counts.member[1], 1u); \
        } \
    }

void count_rays(uint reflection, uint refraction, float lost) {
    ADD_WORK(reflection, reflection)
    ADD_WORK(refraction, refraction)
    ADD_WORK(shadow, shadow_rays)
    ADD_WORK(node_visits, node_visits)
    ADD_WORK(triangle_tests, triangle_tests)
    ADD_WORK(stray_interfaces, stray_interfaces)
    // Steps of 2^-16, rounded up: what is counted is not less than what was lost.
    ADD_WORK(lost, lost > 0.0 ? uint(min(lost, 1e3) * 65536.0) + 1u : 0u)
    uint most = subgroupMax(floatBitsToUint(lost));
    if (subgroupElect() && most > 0) atomicMax(counts.most_lost, most);
}
#endif
