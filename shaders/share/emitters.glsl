// Emitters for light sampling, with their CDF in 32-bit fixed point, as texels of four words.
#ifndef SHARE_EMITTERS_GLSL
#define SHARE_EMITTERS_GLSL
struct Emitter {
    uint first;        // lower end of its bin in the CDF, 32-bit fixed point
    float probability; // selection probability, the size of that bin
    uint kind;         // EMITTER_...
    uint place;        // index of the light in its table, or of the triangle among the leaves
};
const uint EMITTER_KIND = 3; // mask of the kind within `kind`, without flags
const uint EMITTER_PUNCTUAL = 0;
const uint EMITTER_TRIANGLE = 1;
const uint EMITTER_ENVIRONMENT = 2;
const uint EMITTER_NONE = 3; // no light at all
const uint EMITTER_TWO_SIDED = 4;
#endif
