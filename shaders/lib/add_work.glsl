// Work that passes count: sums of 64 bits over all invocations, as pairs of words.
#ifndef ADD_WORK_GLSL
#define ADD_WORK_GLSL
#include "share/work.glsl"

layout(scene, scalar) buffer WorkDone { WorkCounts counts; };

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
#endif
