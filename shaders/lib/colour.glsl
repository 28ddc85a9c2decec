// From scene-linear Rec. 709 radiance to display values (lecture C4). Twins: src/image/tone.rs.
#ifndef COLOUR_GLSL
#define COLOUR_GLSL

// IEC 61966-2-1; `x` in [0, 1].
float srgb_encode(float x) {
    return x <= 0.0031308 ? 12.92 * x : min(1.055 * pow(x, 1.0 / 2.4) - 0.055, 1.0);
}

vec3 tone_reinhard(vec3 x) {
    return x / (1.0 + x);
}

// Stephen Hill's fit of the ACES reference rendering and sRGB output transforms.
vec3 tone_aces(vec3 x) {
    const mat3 aces_from_linear = mat3(0.59719, 0.07600, 0.02840, 0.35458, 0.90834, 0.13383, 0.04823, 0.01566, 0.83777);
    const mat3 linear_from_aces = mat3(1.60475, -0.10208, -0.00327, -0.53108, 1.10813, -0.07276, -0.07367, -0.00605, 1.07602);
    vec3 v = aces_from_linear * x;
    v = (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081);
    return linear_from_aces * v;
}

// AgX (Troy Sobotka) with the sixth-order fit of its sigmoid by Benjamin Wrensch; display-linear result.
vec3 tone_agx(vec3 x) {
    const mat3 inset = mat3(
        0.842479062253094, 0.0423282422610123, 0.0423756549057051,
        0.0784335999999992, 0.878468636469772, 0.0784336,
        0.0792237451477643, 0.0791661274605434, 0.879142973793104);
    const mat3 outset = mat3(
        1.19687900512017, -0.0528968517574562, -0.0529716355144438,
        -0.0980208811401368, 1.15190312990417, -0.0980434501171241,
        -0.0990297440797205, -0.0989611768448433, 1.15107367264116);
    const float min_ev = -12.47393;
    const float max_ev = 4.026069;
    vec3 v = (clamp(log2(max(inset * x, 1e-10)), min_ev, max_ev) - min_ev) / (max_ev - min_ev);
    vec3 v2 = v * v;
    vec3 v4 = v2 * v2;
    v = 15.5 * v4 * v2 - 40.14 * v4 * v + 31.96 * v4 - 6.868 * v2 * v + 0.4298 * v2 + 0.1191 * v - 0.00232;
    v = max(outset * v, 0.0);
    // The fit ends in display values of gamma 2.2; the transfer function is applied by the caller.
    return pow(v, vec3(2.2));
}

// Khronos PBR Neutral (specification of 2024).
vec3 tone_khronos_neutral(vec3 x) {
    const float start = 0.8 - 0.04;
    const float desaturation = 0.15;
    float low = min(x.r, min(x.g, x.b));
    float offset = low < 0.08 ? low - 6.25 * low * low : 0.04;
    x -= offset;
    float peak = max(x.r, max(x.g, x.b));
    if (peak < start) return x;
    float d = 1.0 - start;
    float new_peak = 1.0 - d * d / (peak + d - start);
    x *= new_peak / peak;
    float g = 1.0 - 1.0 / (desaturation * (peak - new_peak) + 1.0);
    return mix(x, vec3(new_peak), g);
}

// `curve`: 0 linear, 1 reinhard, 2 aces, 3 agx, 4 khronos-neutral. Result in [0, 1], display-linear.
vec3 tone(uint curve, vec3 x) {
    // Cut where a half float ends: a curve that divides would make NaN, shown black, of the brightest pixels.
    x = clamp(x, 0.0, 65504.0);
    if (curve == 1) x = tone_reinhard(x);
    if (curve == 2) x = tone_aces(x);
    if (curve == 3) x = tone_agx(x);
    if (curve == 4) x = tone_khronos_neutral(x);
    return clamp(x, 0.0, 1.0);
}
#endif
