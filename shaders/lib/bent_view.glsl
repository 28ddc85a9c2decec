// Screen-space refraction: where the exit point of the refracted ray through a transparent solid lies on the screen.
// The ray bends once where it enters the solid, runs the nominal thickness in the bent direction, and is seen straight from
// there.
// Where to read: docs/decisions/screen-space.md; KHR_materials_volume (thickness). Assumes: positions relative to the eye,
// metres.
#ifndef BENT_VIEW_GLSL
#define BENT_VIEW_GLSL
#include "lib/camera.glsl"
#include "lib/snell.glsl"

// Offset in pixels from the pixel that looks along the unit `direction` at p_rel to the pixel that sees the exit point. In
// an orthographic view its length is thickness · sin(α − β); a plane slab whose faces are `thickness` apart shifts by
// 1/cosβ more.
vec2 bent_shift(Camera camera, ivec2 pixel, vec3 p_rel, vec3 direction, vec3 n, float ior, float thickness) {
    vec3 exit = p_rel + refract_ray(direction, n, ior).T * thickness;
    vec4 clip = camera.clip_from_rel * vec4(exit, 1.0);
    vec2 at = (clip.xy / clip.w + 1.0) * (0.5 * vec2(camera.size));
    vec2 shift = at - (vec2(pixel) + 0.5);
    // A solid that touches the eye may end behind it: then no shift.
    bool before = clip.w > camera.near || camera.orthographic != 0;
    return before ? clamp(shift, -65536.0, 65536.0) : vec2(0.0);
}
#endif
