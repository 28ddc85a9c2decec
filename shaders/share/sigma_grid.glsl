// Grids of σ. Shaders read them as texels of four floats.
#ifndef SHARE_SIGMA_GRID_GLSL
#define SHARE_SIGMA_GRID_GLSL

// Each is followed by its cells: channel by channel, layer by layer, row by row.
struct SigmaGrid {
    vec4 x_row;    // rows that lead from bvh space to places in the grid: 0 at the first point of an axis, 1 at the next
    vec4 y_row;
    vec4 z_row;
    vec3 last;     // places of the last points
    float first;   // texel of its cells
    float channel; // texels of each channel; 0 where all are one
    vec3 pad;
};

// The values at both x of the first y and of the second, in one layer. Two fetches make a trilinear value so, where a texel a
// point would take eight.
struct SigmaCell {
    vec2 first_y;
    vec2 second_y;
};
#endif
