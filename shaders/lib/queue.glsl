// Queues of paths for stream compaction: count, prefix sum (scan), scatter.
// On CPUs a queue lists pixels in order. A bounce marks the entries of terminated paths. Three passes remove them and keep the
// order: queue_count.comp counts the survivors of each chunk, queue_scan.comp turns the counts into prefix sums,
// queue_next.comp scatters the survivors.
// Where to read: Harris, Sengupta and Owens, GPU Gems 3, chapter 39 (2007); pbrt 4, chapter 15.
#ifndef QUEUE_GLSL
#define QUEUE_GLSL
#include "lib/work_tile.glsl"

// Flag of an entry whose path has terminated.
const uint TERMINATED = 0x80000000u;

// On GPUs: appends `entry` to a queue that begins at `first` of `queue`, and enlarges its dispatch `size`; every invocation of a
// subgroup comes here. Three atomics per subgroup, in any order. `base` is 0 but in the invocation that added, so the
// maximum passes it to all. Where to read: Vulkan specification, "Group Operations" (subgroups).
#define APPEND_TO_QUEUE(size, queue, first, wanted, entry) \
    { \
        uint before = subgroupExclusiveAdd((wanted) ? 1u : 0u); \
        uint appended = subgroupAdd((wanted) ? 1u : 0u); \
        uint base = 0; \
        if (subgroupElect() && appended > 0) { \
            base = atomicAdd(size.count, appended); \
            uint groups = (base + appended + gl_WorkGroupSize.x - 1) / gl_WorkGroupSize.x; \
            atomicMax(size.x, min(groups, ROW)); \
            atomicMax(size.y, (groups + ROW - 1) / ROW); \
        } \
        base = subgroupMax(base); \
        if (wanted) queue[first + base + before] = entry; \
    }

// On CPUs:
const uint PATHS_IN_GROUP = 128; // two per invocation
const uint CHUNK = 16; // entries that one invocation counts and scatters
#endif
