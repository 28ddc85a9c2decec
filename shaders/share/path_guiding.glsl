// The guiding distribution of path guiding: a grid whose cells list bounding spheres.
// Where to read: docs/decisions/paths.md. Assumes: bvh space, metres.
#ifndef SHARE_PATH_GUIDING_GLSL
#define SHARE_PATH_GUIDING_GLSL
struct GuidingGrid {
    vec3 corner;            // in bvh space
    float cells_per_metre;
    uvec3 cells;            // number of cells along x, y and z
    uint last_ball;
};

struct GuidingSphere {
    vec3 middle;       // in bvh space
    uint radius_share; // halves: radius in units of a cell, and probability of the sphere in its cell
};

const int GUIDING_GRID_TEXELS = 2; // texels of a GuidingGrid
// A cell is a word: index of its first sphere << GUIDING_COUNT_BITS | number of spheres.
const uint GUIDING_COUNT_BITS = 4;
#endif
