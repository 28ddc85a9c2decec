// How a light lies in the table of lights.
#ifndef LIGHT_TEXELS_GLSL
#define LIGHT_TEXELS_GLSL

// Position (or direction to it), range | colour, 1 / range² | axis, spot scale | spot offset, shape, its radius or half its height |
// half its side across.
const int LIGHT_TEXELS = 5;
const uint SHAPE_NONE = 0;
const uint SHAPE_SPHERE = 1;
const uint SHAPE_DISK = 2;
const uint SHAPE_RECTANGLE = 3;
#endif
