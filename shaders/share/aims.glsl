// What paths aim at, for each cell of a grid.
#ifndef SHARE_AIMS_GLSL
#define SHARE_AIMS_GLSL
struct AimGrid {
    vec3 corner;            // in bvh space
    float cells_per_metre;
    uvec3 cells;            // along x, y and z
    uint last_ball;
};

struct AimBall {
    vec3 middle;       // in bvh space
    uint radius_share; // halves: radius in cells, and share of its cell's aims
};

const int AIM_GRID_TEXELS = 2; // texels of an AimGrid
// A cell is a word: its first ball << AIM_COUNT_BITS | how many it has.
const uint AIM_COUNT_BITS = 4;
#endif
