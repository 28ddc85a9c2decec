// Stream compaction, step 2 of 3: exclusive prefix sum (scan) over the counts of the chunks, by one workgroup.
// A chunk's prefix sum is the position of its first survivor in the next queue; the total is the length of that queue,
// which sets its indirect dispatches. Where to read: Harris, Sengupta and Owens, GPU Gems 3, chapter 39 (2007);
// lib/queue.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 256) in;
#include "lib/queue.glsl"

layout(pass, scalar) readonly buffer Sizes { QueueSize size; };
layout(pass, scalar) buffer Chunks { uint chunks[]; };
layout(pass, scalar) writeonly buffer NextSizes { QueueSize next_size; };

shared uint sums[256];

void main() {
    uint lane = gl_LocalInvocationID.x;
    uint all_chunks = (size.paths.count + CHUNK - 1) / CHUNK;
    uint share = (all_chunks + 255) / 256;
    uint first = min(lane * share, all_chunks);
    uint end = min(first + share, all_chunks);
    uint sum = 0;
    for (uint i = first; i < end; i++) sum += chunks[i];
    sums[lane] = sum;
    barrier();
    uint before = 0;
    for (uint i = 0; i < lane; i++) before += sums[i];
    for (uint i = first; i < end; i++) {
        uint here = chunks[i];
        chunks[i] = before;
        before += here;
    }
    if (lane == 255) {
        uint groups = (before + PATHS_IN_GROUP - 1) / PATHS_IN_GROUP;
        uint chunk_groups = ((before + CHUNK - 1) / CHUNK + 63) / 64;
        next_size.paths = WorkSize(min(groups, ROW), (groups + ROW - 1) / ROW, 1, before);
        next_size.chunks = WorkSize(min(chunk_groups, ROW), (chunk_groups + ROW - 1) / ROW, 1, 0);
    }
}
