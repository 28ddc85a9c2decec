// The tree of boxes over the scene, and its triangles. Shaders read them as texels of four words.
#ifndef SHARE_BVH_GLSL
#define SHARE_BVH_GLSL

// A reference to a node is its index, one to a leaf is negative: ~(first triangle << LEAF_BITS | how many − 1).
const int LEAF_BITS = 3;

// Of a list: `word` is a leaf, or where to go on when the box is missed.
struct GridNode {
    ivec3 slabs; // of each axis the box's centre << SLAB_BITS | half extent, in steps of a grid over the scene
    int word;
};
const int SLAB_BITS = 16;

struct FloatNode {
    vec3 center;
    int word;
    vec3 half_extent;
    uint pad;
};

// Of the tree that is walked with a stack: the boxes of both children, and what they are, a node or a leaf.
struct StackNode {
    vec3 left_center;
    int left;
    vec3 left_half_extent;
    int right;
    vec3 right_center;
    uint pad_center;
    vec3 right_half_extent;
    uint pad_half_extent;
};

// In the order of the leaves; corners run counter-clockwise around the front, whatever mirrored the object.
struct BvhTriangle {
    vec3 a;
    uint stops;   // OPAQUE or FILTER
    vec3 b;
    uint face;    // the flat face that it is part of
    vec3 c;
    float picked; // probability per area with which paths draw it as a light; 0 where it is none
};
#endif
