// The film: the mean of all samples, from one sum, or from two sums with independent random numbers.
// Each sum is that of its complete blocks and of the unfinished block. Where to read: docs/decisions/shards.md (blocks of
// samples).
#version 460
layout(local_size_x = 8, local_size_y = 8) in;
layout(pass, rgba32f) readonly uniform image2D total_a;
layout(pass, rgba32f) readonly uniform image2D open_a;
layout(pass, rgba32f) readonly uniform image2D total_b;
layout(pass, rgba32f) readonly uniform image2D open_b;
layout(pass, rgba32f) writeonly uniform image2D film;
// Whether each image holds a sum: an image without one is bound to a substitute.
layout(push_constant) uniform Push { float scale; uint has_total_a; uint has_open_a; uint has_total_b; uint has_open_b; };

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(film)))) return;
    vec4 a = has_total_a != 0 ? imageLoad(total_a, pixel) : vec4(0.0);
    if (has_open_a != 0) a += imageLoad(open_a, pixel);
    vec4 b = has_total_b != 0 ? imageLoad(total_b, pixel) : vec4(0.0);
    if (has_open_b != 0) b += imageLoad(open_b, pixel);
    imageStore(film, pixel, (a + b) * scale);
}
