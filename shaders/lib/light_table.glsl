// The table of lights.
#ifndef LIGHT_TABLE_GLSL
#define LIGHT_TABLE_GLSL

#include "share/light.glsl"

layout(scene, rgba32f) readonly uniform imageBuffer lights;

// Texels of a struct Light. After all lights the shadow maps: first texel across and down and texels a side, then the rows that lead from bvh space to
// texels across and down of the image, depth, and 1, all times w (lib/shadow.glsl).
const int LIGHT_TEXELS = 6;
const int SHADOW_MAP_TEXELS = 5;
const uint SHAPE_NONE = 0;
const uint SHAPE_SPHERE = 1;
const uint SHAPE_DISK = 2;
const uint SHAPE_RECTANGLE = 3;

uvec4 light_words(uint index, int i) {
    return floatBitsToUint(imageLoad(lights, int(index) * LIGHT_TEXELS + i));
}

// @texels Light light_at(light_words)
#endif
