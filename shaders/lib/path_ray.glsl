// The state of a path between two vertices, and its random numbers by dimension.
// Where to read: pbrt 4, sections 15.3 (state of a wavefront path tracer) and 8.3 (dimensions of a sample). Assumes: bvh
// space, metres.
#ifndef PATH_RAY_GLSL
#define PATH_RAY_GLSL
#include "lib/random.glsl"
#include "lib/trace.glsl"

struct Path {
    vec3 origin;       // bvh space
    uint source_face;  // coplanar group of the triangle that the ray leaves
    vec3 direction;
    float pdf;         // of the direction, at the last vertex for MIS; 0 where no light sample could have found the same light
    vec3 throughput;
    uint state;        // surfaces met | PATH_... | with PATH_GUIDING, as a half: density over density without guiding
    uvec4 media;
    // Length of the path from its last vertex for MIS to `origin`. Once the path has PATH_ESCAPED_TO_BACKGROUND, this
    // member holds the share of the background instead (radiance_of).
    float distance_since_vertex;
    float t_min;       // surfaces up to this t are not hit
    vec3 sum;          // radiance gathered so far
};
const uint PATH_ALIVE = 0x100u;
const uint PATH_TRANSPARENT_SO_FAR = 0x200u;     // only transmitted or passed by so far: the background is directly visible
const uint PATH_UNSCATTERED = 0x400u;            // not deflected since the eye
const uint PATH_NON_SPECULAR = 0x800u;           // some surface has scattered it (diffuse or rough lobe)
const uint PATH_ESCAPED_TO_BACKGROUND = 0x1000u; // it left the scene with PATH_TRANSPARENT_SO_FAR
const uint PATH_SURFACES = 0xffu;

float guiding_pdf_ratio(Path p) {
    return unpackHalf2x16(p.state).y;
}

// Dimensions: pairs of random numbers of one vertex.
const uint DIMENSION_PAIRS = 4;
const uint DIMENSION_EVENT = 0;
const uint DIMENSION_DIRECTION = 1;
const uint DIMENSION_LIGHT = 2;
const uint DIMENSION_PIXEL = 3;  // of the camera ray alone, before the first vertex
const uint DIMENSION_PHOTON = 3; // of a vertex's successor: its number is one more

uvec2 dimension_words(uvec2 pixel, uint surface, uint draw) {
    return random_words(pixel, surface * DIMENSION_PAIRS + draw, trace_terms.seed, trace_terms.sample_index, trace_terms.samples);
}

// The point numbered `i` of `count` in one dimension pair: neighbours in the sequence, which fill the square evenly
// together (stratification).
uvec2 dimension_words_of(uvec2 pixel, uint surface, uint draw, uint i, uint count) {
    uint index = trace_terms.sample_index * count + i;
    return random_words(pixel, surface * DIMENSION_PAIRS + draw, trace_terms.seed, index, trace_terms.samples * count);
}

// The film's value for a terminated path. If it escaped to the background, `distance_since_vertex` is the background's
// share: it may exceed 1 for one path, but its mean is a share.
vec4 radiance_of(Path p) {
    return vec4(p.sum, (p.state & PATH_ESCAPED_TO_BACKGROUND) != 0 ? 1.0 - p.distance_since_vertex : 1.0);
}
#endif
