// What a ray meets at a surface that may separate two media, and how much is reflected there.
#ifndef BOUNDARY_GLSL
#define BOUNDARY_GLSL
#include "lib/hit.glsl"
#include "lib/media.glsl"
#include "lib/shadow.glsl"

layout(constant) const bool TRANSMISSIVE = false; // some material lets light through
layout(constant) const bool TOUCHING = false;     // some transparent body lies against another surface

// What a surface separates, for a ray that comes through `media`.
struct Boundary {
    bool sheet;  // transmits light and encloses nothing
    bool solid;  // the surface of a transparent body
    bool hidden; // a body of higher priority displaces it: nothing changes here
    bool stray;  // left without having been entered: the shell is open, or another one crosses it
    bool against; // something opaque lies against it: it is met next, as if it were in the medium before
    float opaque_at; // where, along the ray from before the boundary
    uint here;   // the medium before
    uint there;  // and behind
    uvec4 beyond; // all media behind
};

// Where bodies touch there is one boundary, from the one to the other, and where something opaque lies against a body there
// is none: what is within the offset behind a surface is crossed with it, since a ray that goes on starts behind it. Looked
// for along the ray from before the surface: as deep as the offset behind it down to a cosine of 1/16, less deep beyond.
void cross_what_touches(inout Boundary r, HitSurface hit, vec3 direction) {
    vec3 origin = ray_origin(hit.s.p_bvh, hit.n, vec3(0.0));
    float cos_v = max(-dot(hit.n, direction), 1e-6);
    float end = trace_terms.offset / cos_v + trace_terms.offset / max(cos_v, 1.0 / 16.0);
    Hit last = FROM_ORIGIN;
    bool goes_on = r.solid;
    do {
        loop_heads++;
        last = trace(origin, direction, hit.s.face, last, goes_on ? end : -1.0, OPAQUE | FILTER, false);
        goes_on = goes_on && last.triangle != NO_TRIANGLE;
        if (goes_on) {
            uint material = hit_material(last.triangle);
            Material m = material_at(material & 0xffffu);
            if (m.transmission > 0.0 && (material & SHEET_TRIANGLE) == 0) {
                bool front = dot(hit_normal(last.triangle), direction) <= 0.0;
                r.beyond = front ? entered(r.beyond, m.medium) : left(r.beyond, m.medium);
            } else if (hit_class(last.triangle) == OPAQUE) {
                r.against = true;
                // A few roundings before it: what is crossed lies there or before.
                r.opaque_at = intBitsToFloat(floatBitsToInt(last.t) - 4);
                goes_on = false;
            }
        }
    } while (goes_on);
}

// `direction` is the ray's.
Boundary boundary_at(HitSurface hit, uvec4 media, vec3 direction) {
    Boundary r;
    uint medium = hit.medium;
    bool transmissive = TRANSMISSIVE && hit.transmission > 0.0;
    r.sheet = transmissive && hit.sheet;
    r.solid = transmissive && !r.sheet;
    r.beyond = hit.front ? entered(media, medium) : left(media, medium);
    r.stray = r.solid && !hit.front && !inside(media, medium);
    r.here = r.stray ? medium : present_medium(media);
    r.against = false;
    r.opaque_at = 0.0;
    if (TOUCHING) cross_what_touches(r, hit, direction);
    if (r.against) r.beyond = media;
    r.there = r.against ? r.here : present_medium(r.beyond);
    r.hidden = r.solid && r.here == r.there;
    return r;
}

// Reflectance of the dielectric part of a surface for light between media of index n1 and n2. What tints it in air
// (KHR_materials_specular) tints it between two media. `total`: nothing passes.
vec3 reflectance_between(Surface s, bool solid, float n1, float n2, float cos_h, out bool total) {
    float share = boundary_share(cos_h, n1, n2);
    float in_air = nested_f0(1.0, s.ior);
    vec3 f0 = solid ? s.f0_dielectric * (in_air > 0.0 ? nested_f0(n1, n2) / in_air : 0.0) : s.f0_dielectric;
    total = solid && share >= 1.0;
    return total ? vec3(1.0) : f0 + (vec3(s.f90_dielectric) - f0) * share;
}

// Colour of what goes through a surface: a solid is entered and left, and each takes the root of it.
vec3 tint_through(HitSurface hit, bool sheet) {
    vec3 tint = sheet ? hit.s.base : sqrt(hit.s.base);
    if (ABSORPTION != 0) {
        bool nominal = sheet || (ABSORPTION == 1 && hit.front);
        tint *= nominal ? exp(-hit.sigma_thickness * hit.thickness) : vec3(1.0);
    }
    return tint;
}
#endif
