// Balls that paths aim at from the cell of a grid in which they are: where light came from by way of what mirrors or bends it,
// as far as a few photons told (src/scene/caustics.rs).
#ifndef AIMS_GLSL
#define AIMS_GLSL
#include "lib/encode.glsl"
#include "lib/light.glsl"
#include "lib/trace.glsl"

layout(constant) const bool AIMED = false;
// For each cell the place of its first ball times 16, plus how many it has.
layout(scene, scalar) readonly buffer AimCells { uint aim_cells[]; };
// Corner of the grid in bvh space and cells per metre, cells along x, y and z; then a ball each: middle, and in halves its radius
// in cells and its share of its cell's aims.
layout(scene, scalar) readonly buffer AimTable { uvec4 aim_table[]; };

// Of the directions drawn for a diffuse surface (docs/decisions/paths.md).
const float AIMED_SHARE = 0.25;

struct Aims {
    uint first;
    uint count; // 0: none
    float cell; // metres
};

Aims aims_at(vec3 p) {
    uvec4 corner = aim_table[0];
    uvec3 cells = aim_table[1].xyz;
    float per_metre = uintBitsToFloat(corner.w);
    vec3 at = floor((p - uintBitsToFloat(corner.xyz)) * per_metre);
    bool inside = all(greaterThanEqual(at, vec3(0.0))) && all(lessThan(at, vec3(cells)));
    uvec3 c = inside ? uvec3(at) : uvec3(0);
    uint word = aim_cells[c.x + cells.x * (c.y + cells.y * c.z)];
    return Aims(2 + (word >> 4), inside ? word & 15u : 0u, 1.0 / per_metre);
}

// The directions in which a ball is seen: a cone, or a hemisphere from inside.
struct Cone {
    vec3 axis;
    float spread; // 1 − cosine of its half angle
    float share;  // of the cell's aims
};

Cone cone_to(Aims at, uint i, vec3 p) {
    uvec4 ball = aim_table[min(at.first + i, uint(aim_table.length()) - 1u)];
    vec3 to = uintBitsToFloat(ball.xyz) - p;
    vec2 radius_share = unpackHalf2x16(ball.w);
    float radius = radius_share.x * at.cell;
    float square = max(dot(to, to), 1e-30);
    return Cone(to * inversesqrt(square), sphere_cone(radius * radius, square), radius_share.y);
}

// `u.x` chooses among them, and the place in the cone with what is left of it.
vec3 aimed_direction(Aims at, vec3 p, vec2 u) {
    Cone cone = cone_to(at, 0, p);
    float first = 0.0;
    float before = cone.share;
    for (uint i = 1; i < at.count; i++) {
        Cone next = cone_to(at, i, p);
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

// Density of a unit direction among those, per solid angle.
float aimed_pdf(Aims at, vec3 p, vec3 direction) {
    float sum = 0.0;
    for (uint i = 0; i < at.count; i++) {
        Cone cone = cone_to(at, i, p);
        // 1 − cosine as half the square of a difference, which does not cancel.
        vec3 beside = direction - cone.axis;
        bool within = 0.5 * dot(beside, beside) <= cone.spread;
        sum += within ? cone.share / (2.0 * PI * cone.spread) : 0.0;
    }
    return sum;
}
#endif
