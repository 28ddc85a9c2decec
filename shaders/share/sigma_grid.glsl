// Heterogeneous media: grids of absorption σ, as texels of four floats.
// Assumes: σ in 1/m; positions in units of grid points.
#ifndef SHARE_SIGMA_GRID_GLSL
#define SHARE_SIGMA_GRID_GLSL

// Header of a grid. Its cells follow: channel by channel, layer by layer, row by row.
struct SigmaGrid {
    vec4 x_row;    // rows that transform bvh space to grid positions: 0 at the first point of an axis, 1 at the next
    vec4 y_row;
    vec4 z_row;
    vec3 last;     // positions of the last points
    float first;   // first texel of the cells
    float channel; // texels per channel; 0: all channels are equal
    vec3 pad;
};

// The four values of a cell in one layer: both x at the first y, and at the second. So a trilinear value takes two fetches;
// one texel per point would take eight.
struct SigmaCell {
    vec2 first_y;
    vec2 second_y;
};
#endif
