// What paths aim at, for each cell of a grid.
#ifndef SHARE_PATH_GUIDING_GLSL
#define SHARE_PATH_GUIDING_GLSL
struct GuidingGrid {
    vec3 corner;            // in bvh space
    float cells_per_metre;
    uvec3 cells;            // along x, y and z
    uint last_ball;
};

struct GuidingSphere {
    vec3 middle;       // in bvh space
    uint radius_share; // halves: radius in cells, and share of its cell's aims
};

const int GUIDING_GRID_TEXELS = 2; // texels of a GuidingGrid
// A cell is a word: its first ball << GUIDING_COUNT_BITS | how many it has.
const uint GUIDING_COUNT_BITS = 4;
#endif
