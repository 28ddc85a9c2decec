// The film: the mean of all samples, from one sum, or from two sums with independent random numbers.
// Where to read: lib/sample_sums.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/sample_sums.glsl"

layout(pass, rgba32f) writeonly uniform image2D film;
layout(push_constant) uniform Push { float scale; uint has; };

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(film)))) return;
    imageStore(film, pixel, (sum_a(pixel, has) + sum_b(pixel, has)) * scale);
}
