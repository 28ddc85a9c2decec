// The film: the mean of all samples, out of one sum of them, or of two whose random numbers have nothing in common; each is the sum of
// its whole blocks and of the block that is under way.
#version 460
layout(local_size_x = 8, local_size_y = 8) in;
layout(pass, rgba32f) readonly uniform image2D total_a;
layout(pass, rgba32f) readonly uniform image2D open_a;
layout(pass, rgba32f) readonly uniform image2D total_b;
layout(pass, rgba32f) readonly uniform image2D open_b;
layout(pass, rgba32f) writeonly uniform image2D film;
// Whether they hold anything: in place of one that does not another is bound.
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
