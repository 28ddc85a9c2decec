// Tone mapping: film to display. Counts invalid values, applies exposure, tone curve and the sRGB encoding (lecture C4).
// The film has premultiplied alpha: radiance is divided by alpha before the tone curve. Where to read: RTR 4, section 8.2;
// docs/colour.md.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/colour.glsl"

layout(constant) const uint CURVE = 0;
layout(constant) const bool DESATURATES = false; // colours outside the gamut of Rec. 709 lose saturation, not luminance
layout(pass, rgba32f) readonly uniform image2D film;
layout(pass, scalar) writeonly buffer Display { uint display[]; };
layout(pass, scalar) buffer Counts { uint nan; uint inf; uint negative; uint ran; };
// `background` is display-linear and lies behind pixels of coverage below 1; with its alpha 0 the picture stays
// transparent.
layout(push_constant, scalar) uniform Push { vec4 background; float exposure; float scale; uint canary; };

const uint INFINITY_BITS = 0x7f800000u;

uint byte_from(float x) {
    return uint(floor(x * 255.0 + 0.5));
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    ivec2 size = imageSize(film);
    if (any(greaterThanEqual(pixel, size))) return;
    // Shows the host that the device has run the dispatch.
    if (pixel == ivec2(0)) ran = canary;
    vec4 value = imageLoad(film, pixel) * scale;
    // Counted before anything clamps: max(NaN, 0) is 0. By bits: a compiler may assume that NaN and infinity do not occur,
    // and remove a comparison.
    uvec4 bits = floatBitsToUint(value) & 0x7fffffffu;
    if (any(greaterThan(bits, uvec4(INFINITY_BITS)))) atomicAdd(nan, 1u);
    if (any(equal(bits, uvec4(INFINITY_BITS)))) atomicAdd(inf, 1u);
    // In spectral rendering even white has rounding errors.
    float rounding = DESATURATES ? -1e-4 * max(value.r, max(value.g, value.b)) : 0.0;
    if (any(lessThan(value, vec4(rounding)))) atomicAdd(negative, 1u);
    float alpha = clamp(value.a, 0.0, 1.0);
    vec3 linear = alpha > 0.0 ? tone(CURVE, (DESATURATES ? desaturated(value.rgb) : value.rgb) / alpha * exposure) : vec3(0.0);
    if (background.a > 0.0) {
        linear = mix(background.rgb, linear, alpha);
        alpha = 1.0;
    }
    uvec4 bytes = uvec4(byte_from(srgb_encode(linear.r)), byte_from(srgb_encode(linear.g)), byte_from(srgb_encode(linear.b)),
                        byte_from(alpha));
    display[pixel.y * size.x + pixel.x] = bytes.r | bytes.g << 8 | bytes.b << 16 | bytes.a << 24;
}
