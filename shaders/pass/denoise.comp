// Denoising, 3 of 3: adds to each pixel what the pixels around it differ by, weighted.
// Where to read: lib/nl_means.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/nl_means.glsl"

layout(pass, rgba32f) readonly uniform image2D mean_a;
layout(pass, rgba32f) readonly uniform image2D mean_b;
layout(pass, rgba32f) readonly uniform image2D guide_a; // alpha: the variance of the pixel's own halves
layout(pass, rgba32f) readonly uniform image2D guide_b; // alpha: the mean of variances around it
layout(pass, rgba32f) uniform image2D film;
layout(push_constant) uniform Push { float share_a; }; // part of all samples that the first half has

ivec2 in_patch(int i) {
    return ivec2(i % 3 - 1, i / 3 - 1);
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    ivec2 last = imageSize(film) - 1;
    if (any(greaterThan(pixel, last))) return;
    vec4 here_a[NL_PATCH];
    vec4 here_b[NL_PATCH];
    for (int i = 0; i < NL_PATCH; i++) {
        ivec2 at = clamp(pixel + in_patch(i), ivec2(0), last);
        here_a[i] = imageLoad(guide_a, at);
        here_b[i] = imageLoad(guide_b, at);
    }
    // Sums of differences from the pixel: one among equals keeps its value to the last bit.
    vec4 own_a = imageLoad(mean_a, pixel);
    vec4 own_b = imageLoad(mean_b, pixel);
    vec3 more_a = vec3(0.0);
    vec3 more_b = vec3(0.0);
    float weights_a = 0.0;
    float weights_b = 0.0;
    for (int y = -NL_REACH; y <= NL_REACH; y++) {
        for (int x = -NL_REACH; x <= NL_REACH; x++) {
            ivec2 other = pixel + ivec2(x, y);
            if (any(lessThan(other, ivec2(0))) || any(greaterThan(other, last))) continue;
            float by_a = 0.0;
            float by_b = 0.0;
            for (int i = 0; i < NL_PATCH; i++) {
                ivec2 at = clamp(other + in_patch(i), ivec2(0), last);
                vec4 there_a = imageLoad(guide_a, at);
                vec4 there_b = imageLoad(guide_b, at);
                by_a += nl_distance(here_a[i].rgb, there_a.rgb, here_b[i].a, there_b.a);
                by_b += nl_distance(here_b[i].rgb, there_b.rgb, here_b[i].a, there_b.a);
            }
            float outlier = nl_outlier_weight(imageLoad(guide_a, other).a, imageLoad(guide_b, other).a);
            // Each half by the other one's distance.
            float weight_a = outlier * nl_weight(by_b / float(NL_PATCH));
            float weight_b = outlier * nl_weight(by_a / float(NL_PATCH));
            vec4 there_a = imageLoad(mean_a, other);
            vec4 there_b = imageLoad(mean_b, other);
            // Radiance is premultiplied by coverage: light stays among pixels of the same.
            bool alike = there_a.a == own_a.a && there_b.a == own_b.a;
            weight_a = alike ? weight_a : 0.0;
            weight_b = alike ? weight_b : 0.0;
            weights_a += weight_a;
            weights_b += weight_b;
            more_a += weight_a > 0.0 ? weight_a * (there_a.rgb - own_a.rgb) : vec3(0.0);
            more_b += weight_b > 0.0 ? weight_b * (there_b.rgb - own_b.rgb) : vec3(0.0);
        }
    }
    // A pixel that is not finite has no weight of its own, and stays as it is.
    if (here_a[NL_PATCH / 2].a == NL_NOT_FINITE) return;
    vec3 more = share_a * (more_a / weights_a) + (1.0 - share_a) * (more_b / weights_b);
    vec4 mean = imageLoad(film, pixel);
    imageStore(film, pixel, vec4(mean.rgb + more, mean.a));
}
