// What light comes from. Shaders read it as texels of four words.
#ifndef SHARE_EMITTERS_GLSL
#define SHARE_EMITTERS_GLSL
struct Emitter {
    uint first;        // word of its share of all 32-bit words
    float probability; // size of that share
    uint kind;         // EMITTER_...
    uint place;        // of the light in its table, or of the triangle among the leaves
};
const uint EMITTER_KIND = 3; // what `kind` says without flags
const uint EMITTER_PUNCTUAL = 0;
const uint EMITTER_TRIANGLE = 1;
const uint EMITTER_ENVIRONMENT = 2;
const uint EMITTER_NONE = 3; // nothing after all
const uint EMITTER_TWO_SIDED = 4;
#endif
