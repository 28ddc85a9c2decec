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

// Node of the light hierarchy: bounds of the emitters below it. Siblings are neighbours.
struct LightNode {
    vec3 centre;     // of a bounding sphere, bvh space
    float radius;
    uint axis;       // of the cone of the emitters' axes: octahedral encoding, 2x16 bits
    uint cosines;    // halves, rounded down: cosine of the half angle of that cone; of the angle to an axis up to which emitters emit
    float intensity; // largest radiant intensity towards any direction, as a share of all
    uint link;       // LIGHT_LEAF, LIGHT_TWO_SIDED and the index of an emitter or of the first child
};
const uint LIGHT_LEAF = 0x80000000u;
const uint LIGHT_TWO_SIDED = 0x40000000u; // some emitter below emits on both sides
const uint LIGHT_INDEX = 0x3fffffffu;
#endif
