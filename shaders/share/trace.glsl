// What rays need to know of the scene.
// Rays live in a space of their own ("bvh"): world axes, metres, origin at the middle of the scene, the same for every
// camera. p_bvh = p_rel + bvh_from_rel.
#ifndef SHARE_TRACE_GLSL
#define SHARE_TRACE_GLSL
struct TraceTerms {
    vec3 bvh_from_rel;
    float offset;         // how far rays start off a surface, in metres (lib/trace.glsl, ray_origin)
    vec3 grid_middle;     // of the boxes of 16-bit nodes: their coordinates count grid_unit from here
    uint nodes;           // in one list, which is also the place of its sentinel
    vec3 grid_unit;
    uint seed;            // of random numbers
    uvec4 camera_media;   // the media the eye is in (lib/media.glsl)
    float pixel_angle;    // what a pixel covers at distance 1, or everywhere where the camera is orthographic
    float lod_bias;
    vec2 snap;            // how far a point rebuilt from depth may lie off its surface because vertices are rounded: metres, and parts of its distance
    uint sample_index;
    uint interfaces;      // surfaces that a path may meet
};
#endif
