// The table of directional albedos of lobes: the second factor of the split-sum approximation.
// Where to read: Karis 2013; RTR 4, section 10.5.2. Assumes: cosine with the normal, perceptual roughness.
#ifndef REFLECTANCE_GLSL
#define REFLECTANCE_GLSL

layout(scene) uniform sampler2D reflectance;

// Texel by cosine and perceptual roughness: two numbers of the base's lobe (rg), two of a lobe over it (ba;
// lib/sheen.glsl).
vec4 reflectance_texel(float cos_v, float roughness) {
    vec2 side = vec2(textureSize(reflectance, 0));
    return textureLod(reflectance, (vec2(clamp(cos_v, 0.0, 1.0), roughness) * (side - 1.0) + 0.5) / side, 0.0);
}

// Factors of F0 and F90 in the directional albedo of a GGX lobe, with Schlick's curve (split sum, Karis 2013). The first
// and last texels of the table are at 0 and 1.
vec2 reflectance_of_lobe(float cos_v, float roughness) {
    return reflectance_texel(cos_v, roughness).rg;
}
#endif
