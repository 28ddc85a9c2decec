// The camera: positions relative to the eye and viewing rays, from pixels and depths.
// Where to read: pbrt 4, chapter 5; RTR 4, chapter 4; Vulkan specification, "Coordinate Transformations". Assumes: rel
// space (share/camera.glsl), metres; reversed depth.
#ifndef CAMERA_GLSL
#define CAMERA_GLSL
#include "share/camera.glsl"

// Normalised device coordinates of this sample's position in a pixel; y points down, as in Vulkan.
vec2 ndc_from_pixel(Camera camera, ivec2 pixel) {
    return (vec2(pixel) + 0.5 + camera.jitter) * (2.0 / vec2(camera.size)) - 1.0;
}

// Distance along the view direction. Reversed infinite depth is near / z: one division, exact to one rounding (numerics.md
// 42).
float view_depth(Camera camera, float depth) {
    return camera.orthographic != 0 ? camera.far - depth * (camera.far - camera.near) : camera.near / depth;
}

vec3 rel_from_pixel(Camera camera, ivec2 pixel, float depth) {
    vec2 ndc = ndc_from_pixel(camera, pixel);
    float z = view_depth(camera, depth);
    vec3 across = camera.right * ndc.x - camera.up * ndc.y;
    return camera.forward * z + across * (camera.orthographic != 0 ? 1.0 : z);
}

// Unit direction of the viewing ray through a pixel.
vec3 view_direction(Camera camera, ivec2 pixel) {
    if (camera.orthographic != 0) return camera.forward;
    vec2 ndc = ndc_from_pixel(camera, pixel);
    return normalize(camera.forward + camera.right * ndc.x - camera.up * ndc.y);
}
#endif
