// One bounce of all paths in a queue, two in each invocation: what each meets is added to its pixel, and entries of paths that
// are through are marked.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 64) in;
#include "lib/path.glsl"
#include "lib/path_state.glsl"
#include "lib/queue.glsl"

layout(set = 0, binding = 10, rgba32f) uniform image2D radiance;
layout(set = 0, binding = 53, r32ui) uniform uimageBuffer queue;
layout(scalar, set = 0, binding = 54) readonly buffer Sizes { QueueSize size; };
layout(push_constant) uniform Push { uint width; uint pixels; };

void add(uvec2 pixel, vec4 light) {
    if (light != vec4(0.0)) imageStore(radiance, ivec2(pixel), imageLoad(radiance, ivec2(pixel)) + light);
}

void main() {
    // Neighbouring groups of eight: what runs together lies together in the picture.
    uint lane = gl_LocalInvocationID.x;
    uint place = listed_tile(gl_WorkGroupID) * PATHS_IN_GROUP + (lane >> 3) * 16 + (lane & 7u);
    uint entry_a = place < size.paths.count ? imageLoad(queue, int(place)).x : ENDED;
    uint entry_b = place + 8 < size.paths.count ? imageLoad(queue, int(place + 8)).x : ENDED;
    bool there_a = (entry_a & ENDED) == 0;
    bool there_b = (entry_b & ENDED) == 0;
    uint index_a = there_a ? entry_a : 0u;
    uint index_b = there_b ? entry_b : 0u;
    uvec2 pixel_a = uvec2(index_a % width, index_a / width);
    uvec2 pixel_b = uvec2(index_b % width, index_b / width);
    Path a = path_of(index_a, pixels);
    Path b = path_of(index_b, pixels);
    if (!there_a) a.state = 0;
    if (!there_b) b.state = 0;
    Gathered g = bounce(a, b, pixel_a, pixel_b);
    if (there_a) {
        add(pixel_a, g.a);
        store_path(a, index_a, pixels);
        if ((a.state & PATH_ALIVE) == 0) imageStore(queue, int(place), uvec4(index_a | ENDED));
    }
    if (there_b) {
        add(pixel_b, g.b);
        store_path(b, index_b, pixels);
        if ((b.state & PATH_ALIVE) == 0) imageStore(queue, int(place + 8), uvec4(index_b | ENDED));
    }
    count_paths(path_rays, lost);
}
