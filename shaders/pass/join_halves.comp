// The film of two halves whose random numbers have nothing in common: the mean of all samples.
#version 460
layout(local_size_x = 8, local_size_y = 8) in;
layout(pass, rgba32f) readonly uniform image2D half_a;
layout(pass, rgba32f) readonly uniform image2D half_b;
layout(pass, rgba32f) writeonly uniform image2D film;
layout(push_constant) uniform Push { float scale; };

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(film)))) return;
    imageStore(film, pixel, (imageLoad(half_a, pixel) + imageLoad(half_b, pixel)) * scale);
}
