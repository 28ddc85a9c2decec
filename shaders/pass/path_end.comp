// Path tracing in steps: the light of all paths into the picture.
// Where to read: lib/path_steps.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
#include "lib/path_begin.glsl"
#include "lib/path_state.glsl"

layout(pass, rgba32f) writeonly uniform image2D radiance;
layout(push_constant) uniform Push { uint places; uint stride; };

void main() {
    uint place = listed_tile(gl_WorkGroupID) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    if (place >= places) return;
    uvec2 pixel = pixel_at(place, stride);
    if (any(greaterThanEqual(pixel, camera.size))) return;
    imageStore(radiance, ivec2(pixel), radiance_of(path_of(pixel.y * camera.size.x + pixel.x)));
}
