// Queues of paths: pixels in order, of which those that are through are taken out after each bounce.
#ifndef QUEUE_GLSL
#define QUEUE_GLSL
#include "lib/work_tile.glsl"

// What follows the pixel of an entry that is through.
const uint TERMINATED = 0x80000000u;

const uint PATHS_IN_GROUP = 128; // two in each invocation
const uint CHUNK = 16; // entries that one invocation counts
#endif
