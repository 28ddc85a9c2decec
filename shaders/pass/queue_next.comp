// The next queue: the paths that go on, in the order they had.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
#include "lib/queue.glsl"

layout(set = 0, binding = 0, r32ui) readonly uniform uimageBuffer queue;
layout(scalar, set = 0, binding = 1) readonly buffer Sizes { QueueSize size; };
layout(set = 0, binding = 2, r32ui) readonly uniform uimageBuffer chunks;
layout(set = 0, binding = 3, r32ui) writeonly uniform uimageBuffer next_queue;

void main() {
    uint chunk = listed_tile(gl_WorkGroupID) * 64 + gl_LocalInvocationID.x;
    if (chunk * CHUNK >= size.paths.count) return;
    uint next = imageLoad(chunks, int(chunk)).x;
    for (uint i = 0; i < CHUNK; i++) {
        uint place = chunk * CHUNK + i;
        uint entry = place < size.paths.count ? imageLoad(queue, int(place)).x : ENDED;
        if ((entry & ENDED) == 0) {
            imageStore(next_queue, int(next), uvec4(entry));
            next++;
        }
    }
}
