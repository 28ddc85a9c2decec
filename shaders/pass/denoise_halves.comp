// Denoising, 1 of 3: the means of even and odd samples, as they are and as they are compared, with the variance of each pixel.
// Where to read: lib/nl_means.glsl; docs/decisions/shards.md (blocks of samples).
#version 460
#extension GL_GOOGLE_include_directive : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/nl_means.glsl"

layout(pass, rgba32f) readonly uniform image2D total_a;
layout(pass, rgba32f) readonly uniform image2D open_a;
layout(pass, rgba32f) readonly uniform image2D total_b;
layout(pass, rgba32f) readonly uniform image2D open_b;
layout(pass, rgba32f) writeonly uniform image2D mean_a;
layout(pass, rgba32f) writeonly uniform image2D mean_b;
layout(pass, rgba32f) writeonly uniform image2D guide_a;
layout(pass, rgba32f) writeonly uniform image2D guide_b;
// Whether each image holds a sum: an image without one is bound to a substitute.
layout(push_constant) uniform Push { float scale_a; float scale_b; uint has_total_a; uint has_open_a; uint has_total_b; uint has_open_b; };

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(mean_a)))) return;
    vec4 a = has_total_a != 0 ? imageLoad(total_a, pixel) : vec4(0.0);
    if (has_open_a != 0) a += imageLoad(open_a, pixel);
    vec4 b = has_total_b != 0 ? imageLoad(total_b, pixel) : vec4(0.0);
    if (has_open_b != 0) b += imageLoad(open_b, pixel);
    a *= scale_a;
    b *= scale_b;
    bool counts = nl_is_finite(a.rgb) && nl_is_finite(b.rgb);
    vec3 compared_a = counts ? as_compared(a.rgb) : vec3(0.0);
    vec3 compared_b = counts ? as_compared(b.rgb) : vec3(0.0);
    imageStore(mean_a, pixel, a);
    imageStore(mean_b, pixel, b);
    imageStore(guide_a, pixel, vec4(compared_a, counts ? variance_of_halves(compared_a, compared_b) : NL_NOT_FINITE));
    imageStore(guide_b, pixel, vec4(compared_b, 0.0));
}
