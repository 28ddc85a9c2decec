// Wavefront path tracing: one bounce of all paths in a queue, two per invocation.
// Radiance is added to the path's sum; entries of terminated paths are marked, and stream compaction removes them
// (queue_count.comp, queue_scan.comp, queue_next.comp). Where to read: pbrt 4, chapter 15; docs/decisions/paths.md.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 64) in;
// A kernel of CPUs alone (lib/layers.glsl).
#define ONE_KERNEL
#include "lib/path_pair.glsl"
#include "lib/path_state.glsl"
#include "lib/queue.glsl"

layout(pass, rgba32f) writeonly uniform image2D radiance;
layout(pass, scalar) buffer Queue { uint queue[]; };
layout(pass, scalar) readonly buffer Sizes { QueueSize size; };
layout(push_constant) uniform Push { uint width; };

void end_of(Path p, uint place, uint pixel) {
    if ((p.state & PATH_ALIVE) != 0) {
        store_path(p, pixel);
    } else {
        queue[place] = pixel | TERMINATED;
        imageStore(radiance, ivec2(pixel % width, pixel / width), radiance_of(p));
    }
}

void main() {
    // Neighbouring groups of eight entries: lanes that run together are neighbours in the picture.
    uint lane = gl_LocalInvocationID.x;
    uint place = listed_tile(gl_WorkGroupID) * PATHS_IN_GROUP + (lane >> 3) * 16 + (lane & 7u);
    uint entry_a = place < size.paths.count ? queue[place] : TERMINATED;
    uint entry_b = place + 8 < size.paths.count ? queue[place + 8] : TERMINATED;
    bool alive_a = (entry_a & TERMINATED) == 0;
    bool alive_b = (entry_b & TERMINATED) == 0;
    uint pixel_a = alive_a ? entry_a : 0u;
    uint pixel_b = alive_b ? entry_b : 0u;
    Path a = path_of(pixel_a);
    Path b = path_of(pixel_b);
    if (!alive_a) a.state = 0;
    if (!alive_b) b.state = 0;
    bounce(a, b, uvec2(pixel_a % width, pixel_a / width), uvec2(pixel_b % width, pixel_b / width));
    if (alive_a) end_of(a, place, pixel_a);
    if (alive_b) end_of(b, place + 8, pixel_b);
    count_paths(path_rays, lost, most_lost);
}
