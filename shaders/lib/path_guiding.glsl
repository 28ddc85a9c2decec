// Path guiding: the guiding distribution of a grid cell, cones towards bounding spheres of specular interactions.
// A few photons are traced on the host first (src/transport/photon_guiding.rs). The bounding spheres hold the points where
// these photons were last reflected or refracted by a specular surface before they reached the cell. A fraction of the
// directions at a diffuse surface is sampled in the cones that the spheres subtend.
// Where to read: Jensen 1995 (sampling guided by photons); Vorba et al. 2019 (SIGGRAPH course on path guiding);
// docs/decisions/paths.md. Assumes: bvh space, metres; densities per solid angle.
#ifndef PATH_GUIDING_GLSL
#define PATH_GUIDING_GLSL
#include "lib/encode.glsl"
#include "lib/light.glsl"
#include "lib/trace.glsl"
#include "share/path_guiding.glsl"

layout(constant) const bool PATH_GUIDING = false;
layout(paths, r32ui) readonly uniform uimageBuffer guiding_cells;
layout(paths, rgba32ui) readonly uniform uimageBuffer guiding_spheres; // the grid, then the bounding spheres
// @texels GuidingGrid guiding_grid_at(guiding_spheres)
uvec4 guiding_sphere_texel(uint index, int texel) {
    return imageLoad(guiding_spheres, GUIDING_GRID_TEXELS + int(index) + texel);
}
// @texels GuidingSphere guiding_sphere_at(guiding_sphere_texel)

// Fraction of the directions at a diffuse surface that are guided (docs/decisions/paths.md).
const float GUIDED_FRACTION = 0.25;

struct GuidingCell {
    uint first;
    uint count; // 0: no guiding here
    uint last;  // index of the last sphere of the grid
    float cell; // side of a cell in metres
};

GuidingCell guiding_cell_at(vec3 p) {
    GuidingGrid grid = guiding_grid_at(0);
    vec3 at = floor((p - grid.corner) * grid.cells_per_metre);
    bool inside = all(greaterThanEqual(at, vec3(0.0))) && all(lessThan(at, vec3(grid.cells)));
    uvec3 c = inside ? uvec3(at) : uvec3(0);
    uint word = imageLoad(guiding_cells, int(c.x + grid.cells.x * (c.y + grid.cells.y * c.z))).x;
    uint count = word & ((1u << GUIDING_COUNT_BITS) - 1u);
    return GuidingCell(word >> GUIDING_COUNT_BITS, inside ? count : 0u, grid.last_ball, 1.0 / grid.cells_per_metre);
}

// The cone of directions that a sphere subtends; from inside a hemisphere.
struct Cone {
    vec3 axis;
    float spread; // 1 − cosine of its half angle
    float share;  // probability of the cone in its cell
};

Cone guiding_cone(GuidingCell at, uint i, vec3 p) {
    GuidingSphere ball = guiding_sphere_at(min(at.first + i, at.last));
    vec3 to = ball.middle - p;
    vec2 radius_share = unpackHalf2x16(ball.radius_share);
    float radius = radius_share.x * at.cell;
    float square = max(dot(to, to), 1e-30);
    return Cone(to * inversesqrt(square), sphere_cone(radius * radius, square), radius_share.y);
}

// Samples the guiding distribution: u.x chooses a cone, and its position within the cone's probability is used for the
// direction.
vec3 guided_direction(GuidingCell at, vec3 p, vec2 u) {
    Cone cone = guiding_cone(at, 0, p);
    float first = 0.0;
    float before = cone.share;
    for (uint i = 1; i < at.count; i++) {
        Cone next = guiding_cone(at, i, p);
        bool reached = u.x >= before;
        first = reached ? before : first;
        if (reached) cone = next;
        before += next.share;
    }
    float down = min((u.x - first) / cone.share, 1.0) * cone.spread;
    float across = sqrt(max(down * (2.0 - down), 0.0));
    vec2 turn = cos_sin_of_turns(u.y);
    OrthonormalBasis frame = orthonormal_basis(cone.axis);
    return (frame.t * turn.x + frame.b * turn.y) * across + cone.axis * (1.0 - down);
}

// Density of the guiding distribution for a unit direction, per solid angle.
float guided_pdf(GuidingCell at, vec3 p, vec3 direction) {
    float sum = 0.0;
    for (uint i = 0; i < at.count; i++) {
        Cone cone = guiding_cone(at, i, p);
        // 1 − cosine as half the square of a difference, which does not cancel.
        vec3 beside = direction - cone.axis;
        bool within = 0.5 * dot(beside, beside) <= cone.spread;
        sum += within ? cone.share / (2.0 * PI * cone.spread) : 0.0;
    }
    return sum;
}
#endif
