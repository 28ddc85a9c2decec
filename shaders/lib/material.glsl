// The table of materials as texels of four words: lavapipe fetches a texel in one go and a word of a storage buffer in
// eight. Words as in share/scene.glsl.
#ifndef MATERIAL_GLSL
#define MATERIAL_GLSL
#include "share/scene.glsl"

layout(set = 0, binding = 33, rgba32ui) readonly uniform uimageBuffer material_texels;
const int MATERIAL_TEXELS = 9;

vec4 material_texel(uint id, int i) {
    return uintBitsToFloat(imageLoad(material_texels, int(id) * MATERIAL_TEXELS + i));
}

Material material_at(uint id) {
    vec4 t0 = material_texel(id, 0);
    vec4 t1 = material_texel(id, 1);
    vec4 t2 = material_texel(id, 2);
    vec4 t3 = material_texel(id, 3);
    vec4 t4 = material_texel(id, 4);
    vec4 t5 = material_texel(id, 5);
    vec4 t6 = material_texel(id, 6);
    vec4 t7 = material_texel(id, 7);
    vec4 t8 = material_texel(id, 8);
    return Material(t0, t1.xyz, t1.w, t2.xyz, t2.w, t3.xyz, t3.w, t4.x, t4.y, t4.z, t4.w, t5.x, t5.y, t5.z,
                    floatBitsToUint(t5.w), t6.xyz, floatBitsToUint(t6.w), t7.xyz, t7.w, t8.xyz, floatBitsToUint(t8.w));
}

vec3 material_emissive(uint id) {
    return material_texel(id, 1).xyz;
}

uint material_flags(uint id) {
    return floatBitsToUint(material_texel(id, 5).w);
}

float material_ior(uint id) {
    return material_texel(id, 4).x;
}

vec3 material_sigma(uint id) {
    return material_texel(id, 6).xyz;
}

// Of its grid of σ (lib/sigma_grid.glsl) the first texel + 1; 0 where none is marched.
uint material_grid(uint id) {
    return imageLoad(material_texels, int(id) * MATERIAL_TEXELS + 8).w;
}
#endif
