// Sheen (KHR_materials_sheen): the lobe of cloth, whose fibres reflect at grazing angles.
// Where to read: Estevez and Kulla, "Production friendly microfacet sheen BRDF", 2017; RTR 4, section 9.10 (cloth). The f64
// twin, which also makes the table: crates/scene/src/lobe/sheen.rs. Assumes: unit vectors, perceptual roughness; α =
// roughness².
#ifndef SHEEN_GLSL
#define SHEEN_GLSL
#include "lib/constants.glsl"
#include "lib/frame.glsl"
#include "lib/reflectance.glsl"
#include "lib/surface.glsl"

// The fit of Estevez and Kulla to the masking function Λ, interpolated between α = 0 and α = 1.
float sheen_lambda(float cos_n, float alpha) {
    float t = (1.0 - alpha) * (1.0 - alpha);
    float a = mix(21.5473, 25.3245, t);
    float b = mix(3.82987, 3.32435, t);
    float c = mix(0.19823, 0.16801, t);
    float d = mix(-1.97760, -1.27393, t);
    float e = mix(-4.32054, -4.85967, t);
    float x = cos_n < 0.5 ? cos_n : 1.0 - cos_n;
    float l = a / (1.0 + b * pow(x, c)) + d * x + e;
    float half_way = a / (1.0 + b * pow(0.5, c)) + d * 0.5 + e;
    return exp(cos_n < 0.5 ? l : 2.0 * half_way - l);
}

// By the cosine with the normal, for a white sheen. x: the directional albedo E. y: the part of a uniform environment's
// light that arrives below that angle, weighted by E at its own angle, ∫ 2x E(x) dx from 0. The table is over the square
// root of the cosine, as most of E lies at the horizon.
vec2 sheen_albedo(Surface s, float cos_n) {
    return min(reflectance_texel(sqrt(clamp(cos_n, 0.0, 1.0)), max(s.sheen.a, LEAST_SHEEN_ROUGHNESS)).ba, 1.0);
}

// Energy left to the base under sheen, for one direction. For a pair of directions the smaller value counts.
float left_by_sheen(Surface s, float cos_n) {
    return 1.0 - largest(s.sheen.rgb) * sheen_albedo(s, cos_n).x;
}

// The same for a uniform environment above a diffuse base layer. E falls from the horizon upwards. So light from above the
// viewer's angle is scaled by the viewer's E, and light from below it by its own.
float left_by_sheen_of_all(Surface s, float cos_v) {
    vec2 e = sheen_albedo(s, cos_v);
    return 1.0 - largest(s.sheen.rgb) * (e.x * (1.0 - cos_v * cos_v) + e.y);
}

// The lobe at a half vector, times cosθ_l. For a roughness below 0.26 and less than 3° above the horizon, the fit sends more
// than it receives (E up to 2.9); there it is scaled to conserve energy.
vec3 sheen_lobe(Surface s, float sin2_h, float cos_l, float cos_v) {
    float roughness = max(s.sheen.a, LEAST_SHEEN_ROUGHNESS);
    float alpha = roughness * roughness;
    float low_l = max(cos_l, 1e-4);
    float d = (2.0 + 1.0 / alpha) * pow(sin2_h, 0.5 / alpha) * (0.5 * INV_PI);
    float v = 1.0 / ((1.0 + sheen_lambda(low_l, alpha) + sheen_lambda(cos_v, alpha)) * 4.0 * low_l * cos_v);
    float most = max(reflectance_texel(sqrt(cos_v), roughness).b, 1.0);
    return s.sheen.rgb * (d * v * cos_l / most);
}
#endif
