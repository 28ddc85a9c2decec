// What the raster and lighting passes know of the camera.
// Positions on the device are relative to the eye ("rel"): world axes, origin at the eye, so that f32 keeps its
// precision wherever the scene lies (numerics.md 33, 39).
#ifndef SHARE_CAMERA_GLSL
#define SHARE_CAMERA_GLSL
struct Camera {
    mat4 clip_from_rel;  // reversed depth: 1 at `near`, 0 at infinity (perspective) or at `far` (orthographic)
    vec3 right;          // rel displacement for ndc x = 1, at depth 1 (perspective) or at any depth (orthographic)
    float near;
    vec3 up;             // the same for ndc y = −1, that is the picture's upper edge
    float far;           // orthographic only
    vec3 forward;        // unit view direction
    uint orthographic;
    vec2 jitter;         // sub-pixel offset of this sample, in pixels
    uvec2 size;          // pixels
    uvec2 tiles;         // of the picture's tiles of 8x8 pixels, row by row: the first that is drawn, and how far on the next one is
};
#endif
