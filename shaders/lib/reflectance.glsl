// What lobes reflect in all directions together, out of a table.
#ifndef REFLECTANCE_GLSL
#define REFLECTANCE_GLSL

layout(scene) uniform sampler2D reflectance;

// By the cosine with the normal and perceptual roughness: two numbers of the base's lobe, two of a lobe over it.
vec4 reflectance_texel(float cos_v, float roughness) {
    vec2 side = vec2(textureSize(reflectance, 0));
    return textureLod(reflectance, (vec2(clamp(cos_v, 0.0, 1.0), roughness) * (side - 1.0) + 0.5) / side, 0.0);
}

// F0 and F90 factors of the directional albedo of a lobe, by Schlick's curve (split sum, Karis 2013): the table's first and last
// texels are 0 and 1.
vec2 reflectance_of_lobe(float cos_v, float roughness) {
    return reflectance_texel(cos_v, roughness).rg;
}
#endif
