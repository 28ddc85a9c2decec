// Tiles of tiled light culling: squares of 16x16 pixels, each with a list of the lights that reach it.
// Where to read: RTR 4, section 20.3; docs/decisions/light-lists.md.
#ifndef LIGHT_TILE_GLSL
#define LIGHT_TILE_GLSL
const uint TILE = 16; // pixels per side
#endif
