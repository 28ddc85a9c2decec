// The next queue: the paths that go on, in the order they had.
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
