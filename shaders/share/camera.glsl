// The camera of the raster, lighting and ray passes.
// Positions on the device are relative to the eye ("rel" space): world axes, metres, origin at the eye. So f32 keeps its
// precision wherever the scene lies (numerics.md 33, 39). Where to read: RTR 4, section 4.7 (projections, reversed depth).
#ifndef SHARE_CAMERA_GLSL
#define SHARE_CAMERA_GLSL
struct Camera {
    mat4 clip_from_rel;  // reversed depth: 1 at `near`, 0 at infinity (perspective) or at `far` (orthographic)
    vec3 right;          // rel displacement for ndc x = 1: at depth 1 (perspective) or at any depth (orthographic)
    float near;
    vec3 up;             // rel displacement for ndc y = −1, the upper edge of the picture
    float far;           // orthographic only
    vec3 forward;        // unit view direction
    uint orthographic;
    vec2 jitter;         // sub-pixel offset of this sample, in pixels
    uvec2 size;          // pixels
    uvec2 tiles;         // of the 8x8 tiles of the picture, row by row: index of the first one drawn, and stride to the next
};
#endif
