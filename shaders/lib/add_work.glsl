// Work counters of passes: 64-bit sums over all invocations, each stored as two 32-bit words (share/work.glsl).
// Where to read: Vulkan specification, "Group Operations" (subgroups), and the atomic memory functions of GLSL 4.6.
// Assumes: the sum over one subgroup fits into 32 bits.
#ifndef ADD_WORK_GLSL
#define ADD_WORK_GLSL
#include "share/work.glsl"

layout(scene, scalar) buffer WorkDone { WorkCounts counts; };

// One atomic addition per subgroup. The value that the atomic returns shows whether the low word overflowed.
#define ADD_WORK(member, value) \
    { \
        uint total = subgroupAdd(value); \
        if (subgroupElect() && total > 0) { \
            uint old = atomicAdd(counts.member[0], total); \
            if (old + total < old) atomicAdd(counts.member[1], 1u); \
        } \
    }
#endif
