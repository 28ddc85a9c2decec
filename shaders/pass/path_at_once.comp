// Path tracing without queues: all bounces of two paths in one invocation, without path states in memory.
// Tests compare the wavefront version with this one: both films are equal to the last bit. Where to read:
// docs/decisions/paths.md.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 64) in;
#include "lib/path_pair.glsl"
#include "lib/path_begin.glsl"
#include "lib/work_tile.glsl"

layout(pass, rgba32f) writeonly uniform image2D radiance;
layout(push_constant) uniform Push { uint places; uint stride; };

void main() {
    uint lane = gl_LocalInvocationID.x;
    uint place = listed_tile(gl_WorkGroupID) * 128 + (lane >> 3) * 16 + (lane & 7u);
    uvec2 pixel_a = pixel_at(place, stride);
    uvec2 pixel_b = pixel_at(place + 8, stride);
    bool inside_a = place < places && all(lessThan(pixel_a, camera.size));
    bool inside_b = place + 8 < places && all(lessThan(pixel_b, camera.size));
    Path a = path_through(pixel_a);
    Path b = path_through(pixel_b);
    if (!inside_a) a.state = 0;
    if (!inside_b) b.state = 0;
    // One more iteration after both paths have terminated: where lanes leave a loop at different times, lavapipe loses what
    // the last iteration of the finished lanes assigned.
    bool more;
    do {
        more = ((a.state | b.state) & PATH_ALIVE) != 0 && loop_iterations < LOOP_BUDGET;
        bounce(a, b, pixel_a, pixel_b);
    } while (more);
    if (inside_a) imageStore(radiance, ivec2(pixel_a), radiance_of(a));
    if (inside_b) imageStore(radiance, ivec2(pixel_b), radiance_of(b));
    count_paths(path_rays, lost, most_lost);
}
