// Anisotropy of GGX microfacets (KHR_materials_anisotropy): a lobe with α along one direction of the surface and another
// α across it.
// Where to read: Heitz 2014, section 5.3, and Heitz 2018 (VNDF); Burley 2012; pbrt 4, section 9.6. Twins:
// crates/optics/src/anisotropy.rs. Assumes: unit vectors; `alphas` are α along and across, in (0, 1].
#ifndef ANISOTROPY_GLSL
#define ANISOTROPY_GLSL
#include "lib/brdf.glsl"
#include "lib/frame.glsl"

// The unit direction in the surface of normal n along which the lobe is wide: `texel` in the frame of tangent and bitangent
// (tangent.w is its handedness), turned by the angle of cosine and sine `rotation`.
vec3 anisotropy_direction(vec3 n, vec4 tangent, vec2 texel, vec2 rotation) {
    vec3 t = tangent.xyz - n * dot(n, tangent.xyz);
    float t2 = dot(t, t);
    // Without texture coordinates a mesh has no tangents: any direction in the surface.
    t = t2 > 0.0 ? t * inversesqrt(t2) : orthonormal_basis(n).t;
    vec2 turned = vec2(rotation.x * texel.x - rotation.y * texel.y, rotation.y * texel.x + rotation.x * texel.y);
    vec3 direction = t * turned.x + cross(n, t) * ((tangent.w < 0.0 ? -1.0 : 1.0) * turned.y);
    float size2 = dot(direction, direction);
    return size2 > 0.0 ? direction * inversesqrt(size2) : t;
}

// @eq B1: D = 1/(π α_t α_b (x²/α_t² + y²/α_b² + z²)²) for the half vector (x, y, z) in the frame of the lobe
// @out D
// The anisotropic GGX distribution (Heitz 2014, equation 72). `along2` is x²/(x² + y²). With z² = 1 − sin² all terms are
// positive: D = α_t α_b/(π (sin² (along2 (1 − α_t²) α_b/α_t + (1 − along2) (1 − α_b²) α_t/α_b) + α_t α_b)²). 0 for cosθ_h ≤ 0.
float anisotropic_distribution(float cos_h, float sin2_h, float along2, vec2 alphas) {
    float D;
    if (ARITHMETIC == FAST) {
        vec2 s = vec2(along2, 1.0 - along2) * sin2_h / (alphas * alphas);
        float t = s.x + s.y + cos_h * cos_h;
        D = 1.0 / (PI * alphas.x * alphas.y * t * t);
    } else {
        float product = alphas.x * alphas.y;
        float along = along2 * ((1.0 - alphas.x) * (1.0 + alphas.x)) * (alphas.y / alphas.x);
        float across = (1.0 - along2) * ((1.0 - alphas.y) * (1.0 + alphas.y)) * (alphas.x / alphas.y);
        float whole = sin2_h * (along + across) + product;
        D = product / (whole * whole) * INV_PI;
    }
    return cos_h > 0.0 ? D : 0.0;
}

// @eq B1 N22: cosθ (1 + 2Λ) = √(z² + α_t² x² + α_b² y²)
// @out root
// Smith's masking of a direction w = (x, y, z) in the frame of the lobe: G₁ = 2z/(z + root).
float anisotropic_root(vec3 w, vec2 alphas) {
    vec3 stretched = vec3(alphas * w.xy, w.z);
    return sqrt(dot(stretched, stretched));
}

// @eq B1 N23: Vis = G₂/(4 cosθ_l cosθ_v), height-correlated, for directions l and v in the frame of the lobe
// @out Vis
float anisotropic_visibility(vec3 l, vec3 v, vec2 alphas) {
    return 0.5 / max(v.z * anisotropic_root(l, alphas) + l.z * anisotropic_root(v, alphas), SMALLEST_NORMAL);
}

// @eq B1 N22: G₂/G₁ = (1 + Λ_v)/(1 + Λ_v + Λ_l) = z_l (z_v + root_v)/(z_l root_v + z_v root_l)
// @out share
// Weight of VNDF sampling, for directions v and l in the frame of the lobe. Cosines from 1e-4 on.
float anisotropic_g2_over_g1(vec3 v, vec3 l, vec2 alphas) {
    vec3 from = vec3(v.xy, max(abs(v.z), 1e-4));
    vec3 to = vec3(l.xy, max(abs(l.z), 1e-4));
    float root_v = anisotropic_root(from, alphas);
    return to.z * (from.z + root_v) / (to.z * root_v + from.z * anisotropic_root(to, alphas));
}

// x²/(x² + y²) of a vector in the frame of the lobe.
float share_along(vec3 w) {
    float across2 = dot(w.xy, w.xy);
    return across2 > 0.0 ? w.x * w.x / across2 : 0.5;
}
#endif
