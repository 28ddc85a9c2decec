// Tiles of 16x16 pixels that have lists of the lights that reach them.
#ifndef LIGHT_TILE_GLSL
#define LIGHT_TILE_GLSL
const uint TILE = 16; // pixels a side
#endif
