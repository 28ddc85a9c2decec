// The table of lights and of shadow maps, read as texels.
// Where to read: share/light.glsl (members and units). Assumes: positions relative to the eye.
#ifndef LIGHT_TABLE_GLSL
#define LIGHT_TABLE_GLSL

#include "share/light.glsl"

layout(scene, rgba32f) readonly uniform imageBuffer lights;

// Texels of a struct Light. The shadow maps follow after all lights. Each has: first texel across, first texel down, and
// texels per side; then the rows that transform bvh space to texels across and down, depth, and 1, all times w
// (lib/shadow.glsl).
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
