// Wavefront path tracing: makes the first queue, one camera ray through each pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
#include "lib/path_begin.glsl"
#include "lib/path_state.glsl"
#include "lib/queue.glsl"

layout(pass, scalar) writeonly buffer Queue { uint queue[]; };
layout(push_constant) uniform Push { uint places; uint stride; };

void main() {
    uint place = listed_tile(gl_WorkGroupID) * 64 + gl_LocalInvocationID.x;
    if (place >= places) return;
    uvec2 pixel = pixel_at(place, stride);
    bool inside = all(lessThan(pixel, camera.size));
    uint index = pixel.y * camera.size.x + pixel.x;
    queue[place] = inside ? index : TERMINATED;
    if (inside) store_path(path_through(pixel), index);
}
