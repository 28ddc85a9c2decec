// Absorption that varies inside a body (lecture A2): its σ is a grid in the space of its object, summed along straight
// segments.
#ifndef SIGMA_GRID_GLSL
#define SIGMA_GRID_GLSL
#include "lib/medium.glsl"
#include "lib/spectrum.glsl"
#include "lib/trace.glsl"

layout(constant) const uint MARCH_STEPS = 0;        // of each segment, a multiple of 4; 0: no grid is marched
layout(constant) const uint QUADRATURE = QUADRATURE_MIDPOINT;
layout(constant) const bool MARCH_COLOURS = false;  // some grid has values for red, green and blue

// Per grid five texels: three rows that lead from bvh space to places in the grid, 0 at the first point of an axis, 1 at
// the next; places of the last points, and the first texel of the values; texels per channel, 0 where all are one.
// Then for each pair of neighbours along x and y, layer by layer: the values at both x of the first y and of the second.
// Two fetches make a trilinear value so, where a texel a point would take eight.
layout(scene, rgba32f) readonly uniform imageBuffer sigma_grids;

struct SigmaGrid {
    vec3 last;
    int first;
    int channel;
};

float sigma_in_cell(int texel, int next_layer, vec3 share) {
    vec4 low = imageLoad(sigma_grids, texel);
    vec4 high = imageLoad(sigma_grids, texel + next_layer);
    // As a + (b − a) t, which is a to the last bit where b is.
    vec4 across = low + (high - low) * share.z;
    vec2 along = across.xy + (across.zw - across.xy) * share.y;
    return along.x + (along.y - along.x) * share.x;
}

// σ at a place in the grid, trilinear; outside its edge goes on.
vec3 sigma_at(SigmaGrid grid, vec3 place) {
    vec3 at = clamp(place, vec3(0.0), grid.last);
    vec3 cell = min(floor(at), max(grid.last - 1.0, 0.0));
    ivec3 i = ivec3(cell);
    ivec2 cells = max(ivec2(grid.last.xy), 1);
    int layer = cells.x * cells.y;
    int texel = grid.first + i.z * layer + i.y * cells.x + i.x;
    int next_layer = grid.last.z > 0.0 ? layer : 0;
    float red = sigma_in_cell(texel, next_layer, at - cell);
    if (!MARCH_COLOURS) return vec3(red);
    return sum_of_rgb(vec3(red, sigma_in_cell(texel + grid.channel, next_layer, at - cell),
                           sigma_in_cell(texel + 2 * grid.channel, next_layer, at - cell)));
}

void add_sigma(inout vec3 sum, inout vec3 rest, vec3 sigma) {
    add_absorption(sum.x, rest.x, sigma.x);
    if (MARCH_COLOURS) {
        add_absorption(sum.y, rest.y, sigma.y);
        add_absorption(sum.z, rest.z, sigma.z);
    }
}

// The mean of σ over a length d from p along a unit direction, by MARCH_STEPS steps of QUADRATURE: lecture A2 divided by d.
// A segment's steps do not depend on its length. `at` is the grid's first texel.
vec3 mean_sigma(uint at, vec3 p, vec3 direction, float d) {
    vec4 rows[3] = vec4[3](imageLoad(sigma_grids, int(at)), imageLoad(sigma_grids, int(at) + 1), imageLoad(sigma_grids, int(at) + 2));
    vec4 last_first = imageLoad(sigma_grids, int(at) + 3);
    SigmaGrid grid = SigmaGrid(last_first.xyz, int(last_first.w), int(imageLoad(sigma_grids, int(at) + 4).x));
    vec4 from = vec4(p, 1.0);
    vec3 start = vec3(dot(rows[0], from), dot(rows[1], from), dot(rows[2], from));
    uint steps = loop_heads < LOOP_BUDGET ? MARCH_STEPS : 4u;
    vec3 along = direction * (d / float(steps));
    vec3 stride = vec3(dot(rows[0].xyz, along), dot(rows[1].xyz, along), dot(rows[2].xyz, along));
    vec4 w = quadrature_weights(QUADRATURE);
    vec3 sum = vec3(0.0);
    vec3 rest = vec3(0.0);
    for (uint i = 0u; i < steps; i += 4u) {
        vec4 n = float(i) + vec4(0.0, 1.0, 2.0, 3.0);
        if (w.x != 0.0) {
            add_sigma(sum, rest, w.x * sigma_at(grid, start + stride * n.x));
            add_sigma(sum, rest, w.x * sigma_at(grid, start + stride * n.y));
            add_sigma(sum, rest, w.x * sigma_at(grid, start + stride * n.z));
            add_sigma(sum, rest, w.x * sigma_at(grid, start + stride * n.w));
        }
        if (w.y != 0.0) {
            add_sigma(sum, rest, w.y * sigma_at(grid, start + stride * (n.x + 0.5)));
            add_sigma(sum, rest, w.y * sigma_at(grid, start + stride * (n.y + 0.5)));
            add_sigma(sum, rest, w.y * sigma_at(grid, start + stride * (n.z + 0.5)));
            add_sigma(sum, rest, w.y * sigma_at(grid, start + stride * (n.w + 0.5)));
        }
    }
    if (w.z != 0.0) {
        add_sigma(sum, rest, w.z * sigma_at(grid, start + stride * float(steps)));
        add_sigma(sum, rest, -w.z * sigma_at(grid, start));
    }
    vec3 mean = (sum + rest) / (w.w * float(steps));
    return MARCH_COLOURS ? mean : mean.xxx;
}
#endif
