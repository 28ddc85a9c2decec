// Reflection models (lecture B1, B4, B5, B6). N, L, V, H are unit vectors; α = roughness².
#ifndef BRDF_GLSL
#define BRDF_GLSL
#include "lib/constants.glsl"

// GGX distribution of microfacet normals, D = (α / (cos²θ_h α² + sin²θ_h))² / π (Walter et al. 2007). sin²θ_h comes from
// the cross product with H − N, which is exact where H is near N: 1 − cos² loses everything there (numerics.md 9, 20).
float ggx_distribution(vec3 n, vec3 h, float alpha) {
    float cos_h = dot(n, h);
    if (cos_h <= 0.0) return 0.0;
    vec3 s = cross(n, h - n);
    float k = alpha / (cos_h * cos_h * alpha * alpha + dot(s, s));
    return k * k * INV_PI;
}

// Height-correlated Smith visibility G₂ / (4 cosθ_l cosθ_v) (Heitz 2014), in a form without division by the cosines
// (numerics.md 23).
float ggx_visibility(float cos_l, float cos_v, float alpha) {
    float a2 = alpha * alpha;
    float rest = (1.0 - alpha) * (1.0 + alpha);
    float l = cos_v * sqrt(a2 + rest * cos_l * cos_l);
    float v = cos_l * sqrt(a2 + rest * cos_v * cos_v);
    return 0.5 / max(l + v, 1e-30);
}

// Shininess whose Blinn–Phong lobe has the width of a GGX lobe (Walter et al. 2007): α² = 2 / (shine + 2).
float shine_from_alpha(float alpha) {
    return max(2.0 / (alpha * alpha) - 2.0, 0.0);
}
#endif
