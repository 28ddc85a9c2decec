// Accumulation: adds one sample of every pixel to the film; the last sample divides by their number.
// The film holds scene-linear radiance with premultiplied alpha (coverage). In spectral rendering a sample is the sum of
// its bands in X, Y, Z. Where to read: pbrt 4, section 5.4 (film).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/spectrum.glsl"

layout(pass, rgba32f) readonly uniform image2D radiance;
layout(pass, rgba32f) uniform image2D film;
layout(push_constant, scalar) uniform Push { uint first; float scale; float bands; mat3 rgb_from_xyz; };

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(film)))) return;
    vec4 sum = imageLoad(radiance, pixel);
    if (SPECTRAL) sum = vec4(rgb_from_xyz * sum.rgb, sum.a / bands);
    if (first == 0) sum += imageLoad(film, pixel);
    imageStore(film, pixel, sum * scale);
}
