// Queues of paths: pixels in order, of which those that are through are taken out after each bounce.
#ifndef QUEUE_GLSL
#define QUEUE_GLSL
#include "lib/work_tile.glsl"

// What follows the pixel of an entry that is through.
const uint ENDED = 0x80000000u;

// Sizes of the dispatches over a queue.
struct QueueSize {
    WorkSize paths;  // two paths in each invocation; `count` is that of entries
    WorkSize chunks; // an invocation for each chunk of entries
};
const uint PATHS_IN_GROUP = 128;
const uint CHUNK = 16;
#endif
