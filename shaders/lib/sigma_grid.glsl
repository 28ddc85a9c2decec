// Heterogeneous media: absorption σ on a grid in object space, integrated along a ray by ray marching (lecture A2).
// The optical depth is a quadrature (left, midpoint or Simpson) of trilinear grid values along a straight segment. Where to
// read: pbrt 4, sections 11.2 and 11.4 (media); docs/decisions/absorption.md. Assumes: bvh space, σ in 1/m.
#ifndef SIGMA_GRID_GLSL
#define SIGMA_GRID_GLSL
#include "lib/medium.glsl"
#include "lib/spectrum.glsl"
#include "lib/trace.glsl"
#include "share/sigma_grid.glsl"

layout(constant) const uint MARCH_STEPS = 0;        // steps of each segment, a multiple of 4; 0: no heterogeneous medium is marched
layout(constant) const uint QUADRATURE = QUADRATURE_MIDPOINT;
layout(constant) const bool MARCH_COLOURS = false;  // some grid has values for red, green and blue

layout(scene, rgba32f) readonly uniform imageBuffer sigma_grids;

uvec4 sigma_words(uint first, int i) {
    return floatBitsToUint(imageLoad(sigma_grids, int(first) + i));
}

// @texels SigmaGrid sigma_grid_at(sigma_words)
// @texels SigmaCell sigma_cell_at(sigma_words)

float sigma_in_cell(int texel, int next_layer, vec3 share) {
    SigmaCell low = sigma_cell_at(uint(texel));
    SigmaCell high = sigma_cell_at(uint(texel + next_layer));
    // Interpolated as a + (b − a) t, which is a to the last bit where a = b.
    vec2 first_y = low.first_y + (high.first_y - low.first_y) * share.z;
    vec2 second_y = low.second_y + (high.second_y - low.second_y) * share.z;
    vec2 along = first_y + (second_y - first_y) * share.y;
    return along.x + (along.y - along.x) * share.x;
}

// σ at a position in the grid, trilinear; outside, the values of the edge continue.
vec3 sigma_at(SigmaGrid grid, vec3 place) {
    vec3 at = clamp(place, vec3(0.0), grid.last);
    vec3 cell = min(floor(at), max(grid.last - 1.0, 0.0));
    ivec3 i = ivec3(cell);
    ivec2 cells = max(ivec2(grid.last.xy), 1);
    int layer = cells.x * cells.y;
    int texel = int(grid.first) + i.z * layer + i.y * cells.x + i.x;
    int next_layer = grid.last.z > 0.0 ? layer : 0;
    float red = sigma_in_cell(texel, next_layer, at - cell);
    if (!MARCH_COLOURS) return vec3(red);
    int channel = int(grid.channel);
    return sum_of_rgb(vec3(red, sigma_in_cell(texel + channel, next_layer, at - cell),
                           sigma_in_cell(texel + 2 * channel, next_layer, at - cell)));
}

void add_sigma(inout vec3 sum, inout vec3 rest, vec3 sigma) {
    add_absorption(sum.x, rest.x, sigma.x);
    if (MARCH_COLOURS) {
        add_absorption(sum.y, rest.y, sigma.y);
        add_absorption(sum.z, rest.z, sigma.z);
    }
}

// The mean of σ over a length d from p along a unit direction: quadrature by MARCH_STEPS steps of the rule QUADRATURE
// (lecture A2, divided by d). The number of steps does not depend on the length. `at` is the grid's first texel.
vec3 mean_sigma(uint at, vec3 p, vec3 direction, float d) {
    SigmaGrid grid = sigma_grid_at(at);
    vec4 from = vec4(p, 1.0);
    vec3 start = vec3(dot(grid.x_row, from), dot(grid.y_row, from), dot(grid.z_row, from));
    uint steps = loop_iterations < LOOP_BUDGET ? MARCH_STEPS : 4u;
    vec3 along = direction * (d / float(steps));
    vec3 stride = vec3(dot(grid.x_row.xyz, along), dot(grid.y_row.xyz, along), dot(grid.z_row.xyz, along));
    vec4 w = quadrature_weights(QUADRATURE);
    vec3 sum = vec3(0.0);
    vec3 rest = vec3(0.0);
    // Simpson's rule reads both ends and the middle of a step, so it goes by half steps, whose weights alternate. Four points
    // an iteration: lavapipe ends all loops of an invocation after 65,535.
    bool both = w.x != 0.0 && w.y != 0.0;
    float spacing = both ? 0.5 : 1.0;
    float offset = w.x != 0.0 ? 0.0 : 0.5;
    vec2 weights = both ? w.xy : vec2(w.x + w.y);
    uint points = both ? 2u * steps : steps;
    for (uint i = 0u; i < points; i += 4u) {
        vec4 n = (float(i) + vec4(0.0, 1.0, 2.0, 3.0)) * spacing + offset;
        add_sigma(sum, rest, weights.x * sigma_at(grid, start + stride * n.x));
        add_sigma(sum, rest, weights.y * sigma_at(grid, start + stride * n.y));
        add_sigma(sum, rest, weights.x * sigma_at(grid, start + stride * n.z));
        add_sigma(sum, rest, weights.y * sigma_at(grid, start + stride * n.w));
    }
    // The end of the last step, and less the start of the first.
    for (uint end = 0u; w.z != 0.0 && end < 2u; end++) {
        add_sigma(sum, rest, (end == 0u ? w.z : -w.z) * sigma_at(grid, start + stride * (end == 0u ? float(steps) : 0.0)));
    }
    vec3 mean = (sum + rest) / (w.w * float(steps));
    return MARCH_COLOURS ? mean : mean.xxx;
}
#endif
