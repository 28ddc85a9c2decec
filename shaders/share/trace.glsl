// Parameters of rays and paths: bvh space, the BVH, random numbers, media around the camera.
// Rays use a space of their own ("bvh" space): world axes, metres, origin at the middle of the scene, the same for every
// camera. p_bvh = p_rel + bvh_from_rel.
#ifndef SHARE_TRACE_GLSL
#define SHARE_TRACE_GLSL
// Of what the scene's surfaces face, in W/m²: an ambient cube, whose sides count by the squares of the direction's components,
// with slopes by the place in bvh space and by the share that is occluded.
struct OccluderRadiosity {
    mat3 along;    // columns: seen along an axis
    mat3 against;  // and in the opposite direction
    mat3 by_place; // slopes in W/m³
    vec3 by_share; // slope by the share that is occluded
};

struct TraceTerms {
    vec3 bvh_from_rel;
    float offset;         // distance in metres by which rays start off a surface (lib/trace.glsl, ray_origin)
    vec3 grid_middle;     // origin of the grid of 16-bit nodes: box coordinates count grid_unit from here
    uint nodes;           // in one list; also the index of its sentinel
    vec3 grid_unit;
    uint seed;            // of random numbers
    uvec4 camera_media;   // the media the eye is in (lib/media.glsl)
    float pixel_angle;    // angle of a pixel: its width at distance 1; in an orthographic view its width everywhere
    float lod_bias;
    vec2 snap;            // greatest error of a point rebuilt from depth, from vertex rounding: metres, and part of its distance
    uint sample_index;
    uint samples;         // of a pixel in one sum, rounded up to a power of two (lib/random.glsl)
    uint interfaces;      // greatest number of surfaces that a path may meet
    uint first_emitter;   // texel of the first emitter, behind the triangles of the BVH (lib/emitters.glsl)
    OccluderRadiosity occluder_radiosity;
};
#endif
