// Adds one sample of every pixel to the film; the last one divides by their number.
#version 460
layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, rgba32f) readonly uniform image2D radiance;
layout(set = 0, binding = 1, rgba32f) uniform image2D film;
layout(push_constant) uniform Push { uint first; float scale; };

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(film)))) return;
    vec4 sum = imageLoad(radiance, pixel);
    if (first == 0) sum += imageLoad(film, pixel);
    imageStore(film, pixel, sum * scale);
}
