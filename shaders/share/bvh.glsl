// The bounding volume hierarchy (BVH) of the scene: nodes of its three layouts, and triangles, as texels of four words.
// Where to read: Smits 1998 (skip pointers); pbrt 4, section 7.3; docs/decisions/rays.md. Assumes: bvh space
// (share/trace.glsl), metres.
#ifndef SHARE_BVH_GLSL
#define SHARE_BVH_GLSL

// A reference to a node is its index. A reference to a leaf is negative: ~(first triangle << LEAF_BITS | number of
// triangles − 1).
const int LEAF_BITS = 3;

// Nodes for stackless traversal, in depth-first order: `word` is a leaf, or the skip pointer, the next node if the box is
// missed.
struct GridNode {
    ivec3 slabs; // per axis the box's centre << SLAB_BITS | half extent, in steps of a grid over the scene
    int word;
};
const int SLAB_BITS = 16;

struct FloatNode {
    vec3 center;
    int word;
    vec3 half_extent;
    uint pad;
};

// Node for traversal with a short stack: boxes and references (a node or a leaf) of both children.
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

// Triangles in the order of the leaves. Corners run counter-clockwise around the front, also where the object is mirrored.
struct BvhTriangle {
    vec3 a;
    uint stops;   // OPAQUE or FILTER
    vec3 b;
    uint face;    // coplanar group of the triangle
    vec3 c;
    // Light sampling on it, 0 where it is no emitter: bits of its density per area; with the light hierarchy, the way from
    // the root, one bit for each node with the first one lowest, below a 1.
    uint picked;
};
#endif
