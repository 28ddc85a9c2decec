// Denoising, 2 of 3: the mean of the variances around each pixel.
// Where to read: lib/nl_means.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/nl_means.glsl"

layout(pass, rgba32f) readonly uniform image2D guide_a;
layout(pass, rgba32f) uniform image2D guide_b;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    ivec2 last = imageSize(guide_b) - 1;
    if (any(greaterThan(pixel, last))) return;
    float sum = 0.0;
    float count = 0.0;
    for (int y = -NL_VARIANCE_REACH; y <= NL_VARIANCE_REACH; y++) {
        for (int x = -NL_VARIANCE_REACH; x <= NL_VARIANCE_REACH; x++) {
            float variance = imageLoad(guide_a, clamp(pixel + ivec2(x, y), ivec2(0), last)).a;
            bool counts = variance != NL_NOT_FINITE;
            sum += counts ? variance : 0.0;
            count += counts ? 1.0 : 0.0;
        }
    }
    imageStore(guide_b, pixel, vec4(imageLoad(guide_b, pixel).rgb, sum / max(count, 1.0)));
}
