// The sums of samples: one, or two with independent random numbers. Each is that of its complete blocks and of the unfinished one.
// Where to read: docs/decisions/shards.md (blocks of samples).
#ifndef SAMPLE_SUMS_GLSL
#define SAMPLE_SUMS_GLSL

layout(pass, rgba32f) readonly uniform image2D total_a;
layout(pass, rgba32f) readonly uniform image2D open_a;
layout(pass, rgba32f) readonly uniform image2D total_b;
layout(pass, rgba32f) readonly uniform image2D open_b;

// Bits of the images that hold a sum: an image without one is bound to a substitute.
const uint HAS_TOTAL_A = 1;
const uint HAS_OPEN_A = 2;
const uint HAS_TOTAL_B = 4;
const uint HAS_OPEN_B = 8;

vec4 sum_a(ivec2 pixel, uint has) {
    vec4 a = (has & HAS_TOTAL_A) != 0 ? imageLoad(total_a, pixel) : vec4(0.0);
    if ((has & HAS_OPEN_A) != 0) a += imageLoad(open_a, pixel);
    return a;
}

vec4 sum_b(ivec2 pixel, uint has) {
    vec4 b = (has & HAS_TOTAL_B) != 0 ? imageLoad(total_b, pixel) : vec4(0.0);
    if ((has & HAS_OPEN_B) != 0) b += imageLoad(open_b, pixel);
    return b;
}
#endif
