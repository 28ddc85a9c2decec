// Stream compaction, step 3 of 3: scatters the surviving paths into the next queue, in order.
// Where to read: Harris, Sengupta and Owens, GPU Gems 3, chapter 39 (2007); lib/queue.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
#include "lib/queue.glsl"

layout(pass, scalar) readonly buffer Queue { uint queue[]; };
layout(pass, scalar) readonly buffer Sizes { QueueSize size; };
layout(pass, scalar) readonly buffer Chunks { uint chunks[]; };
layout(pass, scalar) writeonly buffer NextQueue { uint next_queue[]; };

void main() {
    uint chunk = listed_tile(gl_WorkGroupID) * 64 + gl_LocalInvocationID.x;
    if (chunk * CHUNK >= size.paths.count) return;
    uint next = chunks[chunk];
    for (uint i = 0; i < CHUNK; i++) {
        uint place = chunk * CHUNK + i;
        uint entry = place < size.paths.count ? queue[place] : TERMINATED;
        if ((entry & TERMINATED) == 0) {
            next_queue[next] = entry;
            next++;
        }
    }
}
