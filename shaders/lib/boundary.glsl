// Interfaces between media that a ray meets: nested dielectrics, coincident interfaces, and the layers of the surface.
// A closed dielectric mesh (a solid) separates the medium before from the medium behind. Of overlapping solids the one of
// highest priority is present (lib/media.glsl). Surfaces of solids that touch each other or something opaque are crossed as
// one interface.
// Where to read: Schmidt and Budge, Journal of Graphics Tools 7(2) 2002; docs/decisions/rays.md. Assumes: bvh space
// (share/trace.glsl), metres.
#ifndef BOUNDARY_GLSL
#define BOUNDARY_GLSL
#include "lib/hit.glsl"
#include "lib/layers.glsl"
#include "lib/media.glsl"
#include "lib/shadow.glsl"

layout(constant) const bool COINCIDENT_INTERFACES = false;     // some transparent solid touches another surface

// What a surface separates, for a ray in the media `media`.
struct Boundary {
    bool sheet;  // thin-walled: transmits light and encloses no medium
    bool solid;  // interface of a closed dielectric mesh
    bool suppressed_by_priority; // a solid of higher priority is present on both sides: the interface does nothing
    bool unmatched_exit;  // an exit without an entry: the mesh is open, or another one intersects it
    bool touches_opaque; // an opaque surface coincides with it: that one is hit next, from the medium before
    float opaque_at; // t of that opaque surface on a ray that starts before the interface
    uint medium_in;   // the present medium before the interface
    uint medium_out;  // and the one behind it
    uvec4 media_out; // all media behind it, as entries of lib/media.glsl
};

// Coincident interfaces. Where solids touch, there is one interface from one medium to the other. Where something opaque
// touches a solid, there is no interface at all. A ray that continues starts `offset` behind a surface, so every surface
// within that distance has to be crossed here. They are searched along the ray, starting before the surface. The search
// reaches the full offset behind it down to a cosine of 1/16, and less beyond.
void cross_coincident_interfaces(inout Boundary r, HitSurface hit, vec3 direction) {
    vec3 origin = ray_origin(hit.s.p_bvh, hit.n, vec3(0.0));
    float cos_v = max(-dot(hit.n, direction), 1e-6);
    float end = trace_terms.offset / cos_v + trace_terms.offset / max(cos_v, 1.0 / 16.0);
    Hit last = FROM_ORIGIN;
    bool goes_on = r.solid;
    do {
        last = trace(origin, direction, hit.s.face, last, goes_on ? end : -1.0, OPAQUE | FILTER, false);
        goes_on = goes_on && last.triangle != NO_TRIANGLE;
        if (goes_on) {
            uint material = hit_material(last.triangle);
            Material m = material_at(material & MATERIAL_OF_TRIANGLE);
            if (m.transmission > 0.0 && (material & SHEET_TRIANGLE) == 0) {
                bool front = dot(hit_normal(last.triangle), direction) <= 0.0;
                r.media_out = front ? entered(r.media_out, m.medium) : left(r.media_out, m.medium);
            } else if (hit_class(last.triangle) == OPAQUE) {
                r.touches_opaque = true;
                // Four ULP before the opaque surface: the interfaces crossed lie there or before.
                r.opaque_at = intBitsToFloat(floatBitsToInt(last.t) - 4);
                goes_on = false;
            }
        }
    } while (goes_on);
}

// `direction` is the direction of the ray.
Boundary boundary_at(HitSurface hit, uvec4 media, vec3 direction) {
    Boundary r;
    uint medium = hit.medium;
    bool transmissive = TRANSMISSIVE && hit.transmission > 0.0;
    r.sheet = transmissive && hit.sheet;
    r.solid = transmissive && !r.sheet;
    r.media_out = hit.front ? entered(media, medium) : left(media, medium);
    r.unmatched_exit = r.solid && !hit.front && !inside(media, medium);
    r.medium_in = r.unmatched_exit ? medium : present_medium(media);
    r.touches_opaque = false;
    r.opaque_at = 0.0;
    if (COINCIDENT_INTERFACES) cross_coincident_interfaces(r, hit, direction);
    if (r.touches_opaque) r.media_out = media;
    r.medium_out = r.touches_opaque ? r.medium_in : present_medium(r.media_out);
    r.suppressed_by_priority = r.solid && r.medium_in == r.medium_out;
    return r;
}

// The layers of a surface that a ray hits, for light that passes straight on: without energy compensation. The base is a delta lobe for a
// roughness up to MIN_ROUGHNESS, and between media of equal index, where nothing is refracted or scattered.
Layers passing_layers_at(HitSurface hit, Boundary boundary) {
    Layers b;
    b.s = hit.s;
    keep_diffuse(b.s, 1.0 - hit.transmits);
    b.between = true;
    b.solid = boundary.solid;
    b.sheet = boundary.sheet;
    b.n1 = index_of(boundary.medium_in);
    b.n2 = boundary.solid ? index_of(boundary.medium_out) : b.s.ior;
    if (TRANSMISSIVE && !boundary.solid) seen_from(b.s, b.n1);
    b.delta = !ROUGH || (b.s.roughness <= MIN_ROUGHNESS && !is_anisotropic(b.s)) || (b.solid && b.n1 == b.n2);
    b.coat_delta = !ROUGH || b.s.clearcoat_roughness <= MIN_ROUGHNESS;
    b.cos_v = max(cosine(b.s.n, b.s.v), 1e-4);
    FacetFresnel f = fresnel_below_coat(b, b.cos_v);
    b.f_dielectric = f.dielectric;
    b.f_base = f.base;
    b.total = f.total;
    b.enters = 1.0 - largest(b.f_dielectric);
    b.left = left_to_base(b.s);
    b.through_share = diffuse_through_share(b.s);
    b.under = left_under_coat(b.s, ROUGH && BRDF == BRDF_GGX_MULTI && !b.coat_delta);
    b.tint = vec3(0.0);
    b.transmits = 0.0;
    if (TRANSMISSIVE) {
        b.tint = tint_through(hit.s.base, boundary.sheet, hit.front, hit.sigma_thickness * hit.thickness);
        b.transmits = hit.transmits * (1.0 - hit.s.metallic);
    }
    b.base_apart = false;
    b.from_behind = false;
    b.shares = vec4(0.0);
    return b;
}

// The same with the energy compensation of a rough base, and what that base leaves to the layer below.
Layers layers_at(HitSurface hit, Boundary boundary) {
    Layers b = passing_layers_at(hit, boundary);
    if (!b.delta) b.s.lobe = lobe_reflectance(b.s);
    if (ROUGH && BRDF == BRDF_GGX_MULTI && !b.delta) {
        // The albedo of an interface is that between its two media, by its reflectance at the viewer's angle: all that its lobe
        // scatters under total reflection, which the albedo in air would leave to the layer below once more.
        vec3 scattered = b.f_dielectric * compensation(b.s) * (b.s.lobe.x + b.s.lobe.y);
        b.enters = b.solid ? 1.0 - min(largest(scattered), 1.0) : ground_share(albedo_of_base(b.s));
    }
    return b;
}
#endif
