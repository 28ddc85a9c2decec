// Histogram of pixel brightness in whole stops from -8 to 7, relative to middle grey.
#version 460
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 8, local_size_y = 8) in;
layout(pass, rgba32f) readonly uniform image2D film;
layout(pass, scalar) buffer Histogram { uint counts[16]; };
layout(push_constant) uniform Push { float grey; };

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(film)))) return;
    float luminance = dot(imageLoad(film, pixel).rgb, vec3(0.2126, 0.7152, 0.0722));
    if (luminance > 0.0) atomicAdd(counts[clamp(int(floor(log2(luminance / grey))) + 8, 0, 15)], 1u);
}
