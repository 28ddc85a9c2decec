// The tables of lobes for the split-sum approximation: directional albedos, its second factor, and the means of lobes, by
// which its first factor is read. Host: src/upload/split_sum.rs. Where to read: Karis 2013; RTR 4, section 10.5.2;
// docs/decisions/split-sum.md. Assumes: cosine with the normal, perceptual roughness.
#ifndef REFLECTANCE_GLSL
#define REFLECTANCE_GLSL
#include "lib/snell.glsl"
#include "share/environment.glsl"

layout(scene) uniform sampler2D reflectance; // the two tables, one below the other

// Place in the first table: the first and last texels are at 0 and 1.
const vec2 TEXEL_OF_LOBE = 1.0 / vec2(LOBE_TABLE_SIDE, 2.0 * LOBE_TABLE_SIDE);
const vec2 TABLE_OF_LOBE = TEXEL_OF_LOBE * (float(LOBE_TABLE_SIDE) - 1.0);
const vec2 MEANS = vec2(0.0, 0.5); // the second table

// Two numbers of the base's lobe (rg), two of a lobe over it (ba; lib/sheen.glsl).
vec4 reflectance_texel(float cos_v, float roughness) {
    return textureLod(reflectance, vec2(cos_v, roughness) * TABLE_OF_LOBE + 0.5 * TEXEL_OF_LOBE, 0.0);
}

// Factors of F0 and F90 in the directional albedo of a GGX lobe, with Schlick's curve (split sum, Karis 2013).
vec2 reflectance_of_lobe(float cos_v, float roughness) {
    return reflectance_texel(cos_v, roughness).rg;
}

// The lobe of the prefiltered map that stands for a GGX lobe seen at an angle.
struct RoundLobe {
    vec3 direction; // of the mean of the lobe's directions
    float alpha;    // with it the lobe of the map has a mean of the same length
};

// For a lobe about the unit normal n, seen from the unit direction v. `parts` are its albedos by F0 and by F90: the second part,
// which the facets that graze v send, has another mean.
RoundLobe round_lobe(vec3 n, vec3 v, float roughness, float alpha, vec2 parts) {
    vec2 at = vec2(dot(n, v), roughness) * TABLE_OF_LOBE + 0.5 * TEXEL_OF_LOBE;
    vec4 means = textureLod(reflectance, at + MEANS, 0.0);
    float grazing = parts.y / max(parts.x + parts.y, 1e-6);
    vec3 direction = blend(reflect_ray(-v, n).R, n, blend(means.r, means.b, grazing));
    return RoundLobe(normalize(direction), min(alpha * blend(means.g, means.a, grazing), 1.0));
}
#endif
