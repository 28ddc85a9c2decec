// A path between two surfaces, and its random numbers.
#ifndef PATH_RAY_GLSL
#define PATH_RAY_GLSL
#include "lib/random.glsl"
#include "lib/trace.glsl"

struct Path {
    vec3 origin;      // bvh space
    uint self;        // the flat face it leaves
    vec3 direction;
    float pdf;        // of the direction at the surface that spread it last; 0 where no place on an emitter could have been drawn instead
    vec3 throughput;
    uint state;       // surfaces met | PATH_... | AIMED: density with which it went where it did over that without aims, as a half
    uvec4 media;
    float travelled;  // since that surface
    float after;      // nothing up to here is met
    vec3 sum;         // light so far
};
const uint PATH_ALIVE = 0x100u;
const uint PATH_CLEAR = 0x200u;    // only let through so far
const uint PATH_STRAIGHT = 0x400u; // nothing has happened to it since the eye
const uint PATH_SPREAD = 0x800u;   // some surface has spread it
const uint PATH_OPEN = 0x1000u;    // nothing lay behind all that it went through
const uint PATH_SURFACES = 0xffu;

float aimed_before(Path p) {
    return unpackHalf2x16(p.state).y;
}

// Pairs of random numbers of one surface.
const uint DRAWS = 4;
const uint DRAW_EVENT = 0;
const uint DRAW_DIRECTION = 1;
const uint DRAW_LIGHT = 2;
const uint DRAW_PIXEL = 3;

uvec2 draw_words(uvec2 pixel, uint surface, uint draw) {
    return random_words(pixel, surface * DRAWS + draw, trace_terms.seed, trace_terms.sample_index);
}

// Of several points of one draw the one numbered `i` of `count`: neighbours in the sequence, which fill the square evenly together.
uvec2 draw_words_of(uvec2 pixel, uint surface, uint draw, uint i, uint count) {
    return random_words(pixel, surface * DRAWS + draw, trace_terms.seed, trace_terms.sample_index * count + i);
}

// What the film gets of a path that is through. Where nothing lay behind what it went through, `travelled` is what that has left
// of the background: for one path this may be more than 1, in the mean it is a share.
vec4 radiance_of(Path p) {
    return vec4(p.sum, (p.state & PATH_OPEN) != 0 ? 1.0 - p.travelled : 1.0);
}
#endif
