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

// On CPUs:
const uint PATHS_IN_GROUP = 128; // two per invocation
const uint CHUNK = 16; // entries that one invocation counts and scatters
#endif
