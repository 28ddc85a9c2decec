// Vertex attributes at the corners of triangles, for ray hits, as texels of four words.
// Assumes: world axes; triangles in the order of the BVH's leaves.
#ifndef SHARE_CORNERS_GLSL
#define SHARE_CORNERS_GLSL

struct CornerFrame {
    vec3 normal_a;
    uint material;      // material | ..._TRIANGLE
    vec3 normal_b;
    float scale;        // length in the world of one metre of the object
    vec3 normal_c;
    float uv_per_metre; // density of texture coordinates
};
const uint MATERIAL_OF_TRIANGLE = 0xffffu;
const uint SHEET_TRIANGLE = 0x10000u;
const uint ONE_SIDED_TRIANGLE = 0x20000u;

struct CornerUvs {
    vec2 a;
    vec2 b;
    vec2 c;
    vec2 pad;
};

// Tangents in xyz, handedness in w.
struct CornerTangents {
    vec4 a;
    vec4 b;
    vec4 c;
};

// RGBA as half floats.
struct CornerColors {
    uvec2 a;
    uvec2 b;
    uvec2 c;
    uvec2 pad;
};

// Everything at the corners of one triangle.
struct Corners {
    CornerFrame frame;
    CornerUvs uvs;           // where HIT_UVS
    CornerUvs second_uvs;    // where HIT_SECOND_UVS
    CornerTangents tangents; // where HIT_TANGENTS
    CornerColors colors;     // where HIT_COLORS
};
#endif
