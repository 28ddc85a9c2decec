// The primary surface of a pixel as deferred lighting shades it.
// Where to read: RTR 4, section 20.1 (deferred shading). Assumes: positions relative to the eye, and in bvh space for rays.
#ifndef LIT_SURFACE_GLSL
#define LIT_SURFACE_GLSL
#include "lib/primary.glsl"

struct LitSurface {
    bool drawn;
    bool suppressed; // an interface suppressed by priority: it does nothing
    Surface s;       // its `lobe` is known; its diffuse part is what is not transmitted
};

LitSurface lit_surface(ivec2 pixel) {
    Primary primary = primary_surface(pixel, false);
    LitSurface r = LitSurface(primary.drawn, false, primary.hit.s);
    keep_diffuse(r.s, 1.0 - primary.hit.transmits);
    r.s.passes = passes_roughly(primary.hit);
    if (IN_MEDIUM && primary.hit.transmission > 0.0 && !primary.hit.sheet) {
        // As in lib/ray_tree.glsl: inside a solid reflections are traced by rays, and an interface suppressed by priority does
        // nothing.
        r.s.base_traced = true;
        uint medium = material_at(primary.hit.material).medium;
        uvec4 beyond = primary.hit.front ? entered(r.s.media, medium) : left(r.s.media, medium);
        r.suppressed = present_medium(beyond) == present_medium(r.s.media);
    }
    r.s.lobe = lobe_reflectance(r.s);
    return r;
}
#endif
