// What lies at the corners of triangles, for rays. Shaders read it as texels of four words.
#ifndef SHARE_CORNERS_GLSL
#define SHARE_CORNERS_GLSL

struct CornerFrame {
    vec3 normal_a;
    uint material;      // | ..._TRIANGLE
    vec3 normal_b;
    float scale;        // how long a metre of the object is in the world
    vec3 normal_c;
    float uv_per_metre; // how dense texture coordinates are
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

// With their handedness.
struct CornerTangents {
    vec4 a;
    vec4 b;
    vec4 c;
};

// RGBA as halves.
struct CornerColors {
    uvec2 a;
    uvec2 b;
    uvec2 c;
    uvec2 pad;
};

// Of one triangle, in world axes.
struct Corners {
    CornerFrame frame;
    CornerUvs uvs;           // where HIT_UVS
    CornerUvs second_uvs;    // where HIT_SECOND_UVS
    CornerTangents tangents; // where HIT_TANGENTS
    CornerColors colors;     // where HIT_COLORS
};
#endif
