// Nested dielectrics: the list of transparent media that a ray is in, and the present one by priority.
// Solids may overlap, as water does with the wall of its glass. Of the media entered and not left, the one of highest
// priority is present; of several with that priority, the one entered last. In Schmidt and Budge the lowest number wins.
// Coincident interfaces are crossed as one by lib/boundary.glsl.
// Where to read: Schmidt and Budge, Journal of Graphics Tools 7(2) 2002; pbrt 4, chapter 11 (transmittance).
// Assumes: up to four media, the last entered first; outside of all is a vacuum. An entry is (priority + 2^15) << 16 |
// material + 1; 0 is none.
#ifndef MEDIA_GLSL
#define MEDIA_GLSL
#include "lib/material.glsl"
#include "lib/medium.glsl"
#include "lib/sigma_grid.glsl"

uint displacing(uint a, uint b) {
    return b >> 16 > a >> 16 ? b : a;
}

uint present_medium(uvec4 media) {
    return displacing(displacing(displacing(media.x, media.y), media.z), media.w);
}

uvec4 entered(uvec4 media, uint medium) {
    return uvec4(medium, media.xyz);
}

bool inside(uvec4 media, uint medium) {
    return any(equal(media, uvec4(medium)));
}

// The list without this medium's latest entry; unchanged where there is none.
uvec4 left(uvec4 media, uint medium) {
    bool x = media.x == medium;
    bool y = x || media.y == medium;
    bool z = y || media.z == medium;
    bool w = z || media.w == medium;
    return uvec4(x ? media.y : media.x, y ? media.z : media.y, z ? media.w : media.z, w ? 0u : media.w);
}

float index_of(uint medium) {
    return medium == 0 ? 1.0 : material_ior((medium & 0xffffu) - 1);
}

// Transmittance of a medium over a distance, from p along a unit direction (lecture A1, A2).
vec3 absorbed(uint medium, vec3 p, vec3 direction, float distance) {
    vec3 sigma = medium == 0 ? vec3(0.0) : material_sigma((medium & 0xffffu) - 1);
    if (MARCH_STEPS != 0) {
        uint grid = medium == 0 ? 0 : material_grid((medium & 0xffffu) - 1);
        if (grid != 0 && distance > 0.0) sigma += mean_sigma(grid - 1, p, direction, distance);
    }
    return vec3(beer_lambert(1.0, sigma.r, distance).T, beer_lambert(1.0, sigma.g, distance).T,
                beer_lambert(1.0, sigma.b, distance).T);
}
#endif
