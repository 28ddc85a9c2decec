// Where what is seen through a body lies on the screen: one bend at the surface that is entered, the nominal thickness
// walked along the bent ray, and from there straight on.
#ifndef BENT_VIEW_GLSL
#define BENT_VIEW_GLSL
#include "lib/camera.glsl"
#include "lib/snell.glsl"

// Pixels from the one that looks along the unit `direction` at p_rel to the one that sees the exit point. In a parallel
// view that is thickness · sin(α − β); a slab whose faces are `thickness` apart shifts by 1/cosβ more.
vec2 bent_shift(Camera camera, ivec2 pixel, vec3 p_rel, vec3 direction, vec3 n, float ior, float thickness) {
    vec3 exit = p_rel + refract_ray(direction, n, ior).T * thickness;
    vec4 clip = camera.clip_from_rel * vec4(exit, 1.0);
    vec2 at = (clip.xy / clip.w + 1.0) * (0.5 * vec2(camera.size));
    vec2 shift = at - (vec2(pixel) + 0.5);
    // A body that the eye touches may end behind it: what is straight ahead.
    bool before = clip.w > camera.near || camera.orthographic != 0;
    return before ? clamp(shift, -65536.0, 65536.0) : vec2(0.0);
}
#endif
