// Denoising, 1 of 3: the means of even and odd samples, their log radiance, and the variance of each pixel.
// Where to read: lib/nl_means.glsl; lib/sample_sums.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/nl_means.glsl"
#include "lib/sample_sums.glsl"

layout(pass, rgba32f) writeonly uniform image2D mean_a;
layout(pass, rgba32f) writeonly uniform image2D mean_b;
layout(pass, rgba32f) writeonly uniform image2D guide_a;
layout(pass, rgba32f) writeonly uniform image2D guide_b;
layout(push_constant) uniform Push { float scale_a; float scale_b; uint has; };

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(mean_a)))) return;
    vec4 a = sum_a(pixel, has) * scale_a;
    vec4 b = sum_b(pixel, has) * scale_b;
    bool counts = nl_is_finite(a.rgb) && nl_is_finite(b.rgb);
    vec3 log_a = counts ? log_radiance(a.rgb) : vec3(0.0);
    vec3 log_b = counts ? log_radiance(b.rgb) : vec3(0.0);
    imageStore(mean_a, pixel, a);
    imageStore(mean_b, pixel, b);
    imageStore(guide_a, pixel, vec4(log_a, counts ? variance_of_halves(log_a, log_b) : NL_NOT_FINITE));
    imageStore(guide_b, pixel, vec4(log_b, 0.0));
}
