// Sheen (KHR_materials_sheen): cloth, whose fibres stand off the surface and glow at its edges. Estevez and Kulla, "Production friendly
// microfacet sheen BRDF", 2017. The twin in f64, which also makes the table: crates/scene/src/lobe/sheen.rs.
#ifndef SHEEN_GLSL
#define SHEEN_GLSL
#include "lib/constants.glsl"
#include "lib/frame.glsl"
#include "lib/reflectance.glsl"
#include "lib/surface.glsl"

// The fit to the masking of fibres, between the numbers of α = 0 and of α = 1.
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

// Of a white sheen, by the cosine with the normal: its directional albedo E, and the part of light from all around that comes in lower
// than that, each by its own E: ∫ 2x E(x) dx from 0. The table has the root of the cosine, as most of E lies at the horizon.
vec2 sheen_albedo(Surface s, float cos_n) {
    return min(reflectance_texel(sqrt(clamp(cos_n, 0.0, 1.0)), max(s.sheen.a, LEAST_SHEEN_ROUGHNESS)).ba, 1.0);
}

// What sheen leaves to the base, of light from a direction or to one. For a pair of directions it is the lesser of the two.
float left_by_sheen(Surface s, float cos_n) {
    return 1.0 - largest(s.sheen.rgb) * sheen_albedo(s, cos_n).x;
}

// The same of light that is the same from all around, for what scatters it evenly: E falls from the horizon up, so that light from above
// the viewer's angle is scaled by the viewer's E and light from below it by its own.
float left_by_sheen_of_all(Surface s, float cos_v) {
    vec2 e = sheen_albedo(s, cos_v);
    return 1.0 - largest(s.sheen.rgb) * (e.x * (1.0 - cos_v * cos_v) + e.y);
}

// The lobe for light from l, times cosθ. Below a roughness of 0.26, and less than 3° above the horizon, the fit sends more than it
// receives (E up to 2.9): there it is scaled to what it receives.
vec3 sheen_lobe(Surface s, vec3 l, float cos_l, float cos_v) {
    float roughness = max(s.sheen.a, LEAST_SHEEN_ROUGHNESS);
    float alpha = roughness * roughness;
    HalfAngle h = half_angle(s.n, l, s.v);
    float low_l = max(cos_l, 1e-4);
    float d = (2.0 + 1.0 / alpha) * pow(h.sin2_h, 0.5 / alpha) * (0.5 * INV_PI);
    float v = 1.0 / ((1.0 + sheen_lambda(low_l, alpha) + sheen_lambda(cos_v, alpha)) * 4.0 * low_l * cos_v);
    float most = max(reflectance_texel(sqrt(cos_v), roughness).b, 1.0);
    return s.sheen.rgb * (d * v * cos_l / most);
}
#endif
