// A path between two surfaces, and its random numbers.
#ifndef PATH_RAY_GLSL
#define PATH_RAY_GLSL
#include "lib/random.glsl"
#include "lib/trace.glsl"

struct Path {
    vec3 origin;      // bvh space
    uint source_face;        // the flat face it leaves
    vec3 direction;
    float pdf;        // of the direction at the surface that spread it last; 0 where no place on an emitter could have been drawn instead
    vec3 throughput;
    uint state;       // surfaces met | PATH_... | PATH_GUIDING: density with which it went where it did over that without aims, as a half
    uvec4 media;
    float distance_since_vertex;  // since that surface
    float t_min;      // nothing up to here is met
    vec3 sum;         // light so far
};
const uint PATH_ALIVE = 0x100u;
const uint PATH_TRANSPARENT_SO_FAR = 0x200u;    // only let through so far
const uint PATH_UNSCATTERED = 0x400u; // nothing has happened to it since the eye
const uint PATH_NON_SPECULAR = 0x800u;   // some surface has spread it
const uint PATH_ESCAPED_TO_BACKGROUND = 0x1000u;    // nothing lay behind all that it went through
const uint PATH_SURFACES = 0xffu;

float guiding_pdf_ratio(Path p) {
    return unpackHalf2x16(p.state).y;
}

// Pairs of random numbers of one surface.
const uint DIMENSION_PAIRS = 4;
const uint DIMENSION_EVENT = 0;
const uint DIMENSION_DIRECTION = 1;
const uint DIMENSION_LIGHT = 2;
const uint DIMENSION_PIXEL = 3;

uvec2 dimension_words(uvec2 pixel, uint surface, uint draw) {
    return random_words(pixel, surface * DIMENSION_PAIRS + draw, trace_terms.seed, trace_terms.sample_index);
}

// Of several points of one draw the one numbered `i` of `count`: neighbours in the sequence, which fill the square evenly together.
uvec2 dimension_words_of(uvec2 pixel, uint surface, uint draw, uint i, uint count) {
    return random_words(pixel, surface * DIMENSION_PAIRS + draw, trace_terms.seed, trace_terms.sample_index * count + i);
}

// What the film gets of a path that is through. Where nothing lay behind what it went through, `travelled` is what that has left
// of the background: for one path this may be more than 1, in the mean it is a share.
vec4 radiance_of(Path p) {
    return vec4(p.sum, (p.state & PATH_ESCAPED_TO_BACKGROUND) != 0 ? 1.0 - p.distance_since_vertex : 1.0);
}
#endif
