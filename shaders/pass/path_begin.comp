// The first queue of paths, one through each pixel, and a picture without light.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
#include "lib/path_begin.glsl"
#include "lib/path_state.glsl"
#include "lib/queue.glsl"

layout(set = 0, binding = 10, rgba32f) writeonly uniform image2D radiance;
layout(set = 0, binding = 53, r32ui) writeonly uniform uimageBuffer queue;
layout(push_constant) uniform Push { uint places; uint stride; };

void main() {
    uint place = listed_tile(gl_WorkGroupID) * 64 + gl_LocalInvocationID.x;
    if (place >= places) return;
    uvec2 pixel = pixel_at(place, stride);
    bool inside = all(lessThan(pixel, camera.size));
    uint index = pixel.y * camera.size.x + pixel.x;
    imageStore(queue, int(place), uvec4(inside ? index : ENDED));
    if (inside) {
        store_path(path_through(pixel), index, camera.size.x * camera.size.y);
        imageStore(radiance, ivec2(pixel), vec4(0.0, 0.0, 0.0, 1.0));
    }
}
