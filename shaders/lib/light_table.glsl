// The table of lights.
#ifndef LIGHT_TABLE_GLSL
#define LIGHT_TABLE_GLSL

layout(scene, rgba32f) readonly uniform imageBuffer lights;

// Position (or direction to it), range | colour, 1 / range² | axis, spot scale | spot offset, shape, its radius or half its height |
// half its side across | of its shadow maps the first texel, how many there are, and whether their depth is told from the light.
// After all lights the shadow maps: first texel across and down and texels a side, then the rows that lead from bvh space to
// texels across and down of the image, depth, and 1, all times w (lib/shadow.glsl).
const int LIGHT_TEXELS = 6;
const int SHADOW_MAP_TEXELS = 5;
const uint SHAPE_NONE = 0;
const uint SHAPE_SPHERE = 1;
const uint SHAPE_DISK = 2;
const uint SHAPE_RECTANGLE = 3;
#endif
