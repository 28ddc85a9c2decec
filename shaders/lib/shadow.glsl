// Shadows of punctual lights: shadow rays, transparent shadows, and shadow maps with percentage-closer filtering.
// A shadow ray stops at opaque surfaces. Transparent surfaces attenuate and colour the light on a straight line (lecture
// R5); this is an approximation, since refraction would focus the light elsewhere. Shadow maps hold opaque surfaces alone.
// Where to read: RTR 4, sections 7.4 and 7.5; Reeves, Salesin and Cook 1987 (percentage-closer filtering);
// docs/decisions/shadow-maps.md. Assumes: bvh space, metres; unit normals.
#ifndef SHADOW_GLSL
#define SHADOW_GLSL
#include "lib/hit.glsl"
#include "lib/layers.glsl"
#include "lib/light_table.glsl"
#include "lib/media.glsl"

layout(constant) const uint SHADOWS = 0;     // rung of the knob `shadows`
const uint SHADOW_OFF = 0;
const uint SHADOW_MAP = 1;
const uint SHADOW_RAY = 2;
layout(constant) const bool FILTERS = false; // some surface of the scene is masked, blended or transmissive
layout(constant) const uint ABSORPTION = 0;
const uint ABSORPTION_OFF = 0;
const uint ABSORPTION_NOMINAL = 1; // by the nominal thickness
const uint ABSORPTION_PATH = 2;    // along the ray

// The shadow maps of all lights in one image (src/pass/shadow_map.rs).
layout(scene) uniform sampler2D shadow_depth;
// Relative rounding error of the numbers that a map lookup depends on; derived at map_visibility.
const float SHADOW_ROUNDINGS = 32.0 / 16777216.0;

uint shadow_rays = 0;
uint lights_cut_off = 0; // surfaces whose loop over lights ended early, at the limit of loop iterations

// Fresnel reflectance of a dielectric between two media for undeflected light, with the film over it. The angle counts in
// the thinner medium, so a straight line has no total internal reflection. Equal
// indices reflect nothing without a film; Schlick's curve would.
vec3 straight_reflectance(Surface s, float cos_v, float n1, float n2) {
    float thinner = min(n1, n2);
    float denser = max(n1, n2);
    float ratio = denser / thinner;
    float r0 = nested_f0(1.0, ratio);
    float share = schlick_weight(cos_v);
    if (FRESNEL == FRESNEL_EXACT) share = clamp((fresnel_dielectric(cos_v, ratio).F - r0) / max(1.0 - r0, 1e-6), 0.0, 1.0);
    vec3 f0 = s.f0_dielectric;
    float f90 = s.f90_dielectric;
    between_media(f0, f90, s.ior, thinner, denser);
    vec3 f = n1 == n2 ? vec3(0.0) : f0 + (vec3(f90) - f0) * share;
    if (IRIDESCENCE) f = under_film(s, film_of(s, cos_v, thinner), f, denser, nested_f0(1.0, s.ior));
    return f;
}

// Colour of transmitted light. A solid is entered and left, and each interface takes the square root of it.
vec3 tint_through(vec3 base, bool sheet, bool front, vec3 nominal_depth) {
    vec3 tint = sheet ? base : sqrt(base);
    if (ABSORPTION != ABSORPTION_OFF) {
        bool nominal = sheet || (ABSORPTION == ABSORPTION_NOMINAL && front);
        tint *= nominal ? exp(-nominal_depth) : vec3(1.0);
    }
    return tint;
}

// What lights shine through, at the end of a ray or in the G-buffer.
vec3 passes_roughly(HitSurface hit) {
    vec3 tint = ROUGH_TRANSMISSION ? tint_through(hit.s.base, true, hit.front, hit.sigma_thickness * hit.thickness) : vec3(0.0);
    return passes_roughly(hit.s, hit.sheet, tint, hit.transmits);
}

// Transmittance of one surface for light along `direction`; updates the list of media. Where the light is that of the whole
// environment, `ambient`, what the interfaces reflect counts as passing: as much of it arrives from the other side, so that
// in uniform light a body without colour and absorption hides nothing.
vec3 filtered(HitPoint point, vec3 direction, bool ambient, inout uvec4 media) {
    HitSurface hit = hit_surface(point, direction, 0.0, FILTERING_SLOTS);
    float cos_v = abs(dot(point.n_smooth, direction));
    uvec4 after = media;
    float n1 = 1.0;
    float n2 = hit.s.ior;
    if (!point.sheet && hit.transmission > 0.0) {
        after = hit.front ? entered(media, hit.medium) : left(media, hit.medium);
        n1 = index_of(present_medium(media));
        n2 = index_of(present_medium(after));
        if (present_medium(media) == present_medium(after)) {
            media = after;
            return vec3(1.0);
        }
    }
    media = after;
    vec3 tint = tint_through(hit.s.base, point.sheet, hit.front, hit.sigma_thickness * hit.thickness);
    float transmits = hit.transmits * (1.0 - hit.s.metallic);
    vec3 reflected = ambient ? vec3(0.0) : straight_reflectance(hit.s, cos_v, n1, n2);
    float under = CLEARCOAT && !ambient ? 1.0 - fresnel_of_coat(hit.s, cos_v) : 1.0;
    vec3 passes = straight_transmittance(tint, transmits, reflected, under, left_to_base(hit.s));
    return blend(vec3(1.0), passes, hit.coverage);
}

// A known hit with its barycentric coordinates recomputed.
Hit hit_again(vec3 origin, vec3 direction, float t, uint triangle) {
    ShearedTriangle s = sheared_from(triangle_at(triangle), origin, ray_shear(direction));
    float inverse = 1.0 / s.det;
    return Hit(t, triangle, s.weights.y * inverse, s.weights.z * inverse);
}

// Which of the six shadow maps along ±x, ±y, ±z covers direction d from the light.
int cube_face(vec3 d) {
    vec3 a = abs(d);
    int axis = a.x >= max(a.y, a.z) ? 0 : a.y >= a.z ? 1 : 2;
    return 2 * axis + (d[axis] < 0.0 ? 1 : 0);
}

// Shadow map lookup: the share of light `index` that reaches p, in bvh space. n is the normal of p's surface on the side of
// the light; to_light leads to the light or is its direction; p was computed from numbers as large as `size`.
//
// Percentage-closer filtering. The four texels whose centres lie around p, less than a texel away across and down, are
// compared, and the results are interpolated. Depth d is reversed: nearer to the light is larger. In texels and d, a plane
// is a plane.
//
// Bias. No surface that contains p, or that meets another one at p, may shadow p. Let c be the centre of a texel.
// 1. A plane through p has the depth d_c = d_p + g·(c − p) there, g its slope. The rest of a convex object lies behind it.
//    So p is lit where d_c is no less than the stored depth.
// 2. At a concave edge another surface meets the plane and may be in front of it at c: a plane of slope h, which has passed
//    p's depth somewhere between p and c. Its depth at p, d' + h·(p − c), is not in front of p's: d_p ≥ d' − (|h_x| +
//    |h_y|). So the map stores d' less its change over a texel (pass/shadow_map.frag), and p is lit where d_p is no less
//    than the stored depth.
// 3. The more favourable comparison counts: max(d_c, d_p) ≥ stored. Both shift along a surface by up to one texel across
//    and down. So the edge of a shadow is within two texels (each way) of its true place, also where surfaces touch. A
//    surface that bends twice within a texel cannot be distinguished from an edge.
//
// Rounding errors, in units of 2^-24.
// 4. p is the middle of a pixel, with an error along the viewing ray. A triangle's depth 1/z is interpolated to some 4
//    roundings of its largest visible value, 1/z_n: an error of 4 z/z_n of z. Along the normal it is multiplied by the
//    cosine of the angle, which is at most h/z, the plane's distance over p's. 4 h z/z_n ≤ 4 z/cos, with the cosine of the
//    frustum's corner: 8 of |p_rel|.
// 5. The map's depth has such an error too: 8 of the distance to a light near the scene, 8 of the scene's extent for
//    others, and as much again for the products here.
// 6. All of it is an offset along n, with 32 times `size`: half of that is needed, the other half is spare.
//
// Vertex rounding. Rasterisers round vertices to fractions of a pixel, and most interpolate depth between the rounded ones
// (View::snap). Then p has the depth of a point that far beside it, and is off the plane by at most that. The map already
// stores less by the change over a whole texel.
float map_visibility(vec3 p, vec3 n, vec3 to_light, uint index, float size) {
    Light light = light_at(index);
    int first = int(light.first_map) + (light.maps > 1.0 ? cube_face(-to_light) * SHADOW_MAP_TEXELS : 0);
    vec4 square = imageLoad(lights, first);
    vec4 row_u = imageLoad(lights, first + 1);
    vec4 row_v = imageLoad(lights, first + 2);
    vec4 row_d = imageLoad(lights, first + 3);
    vec4 row_w = imageLoad(lights, first + 4);
    float distance = light.infinite_far > 0.0 ? vector_length(to_light) : 0.0;
    float snap = trace_terms.snap.x + trace_terms.snap.y * size;
    vec4 q = vec4(p + n * (trace_terms.offset + snap + (size + distance) * SHADOW_ROUNDINGS), 1.0);
    float w = dot(row_w, q);
    vec3 at = vec3(dot(row_u, q), dot(row_v, q), dot(row_d, q)) / w;
    // Gradients in space of the coordinates across, down and depth, times w. On the plane, ∇d = g_x ∇u + g_y ∇v + a
    // multiple of n.
    vec3 grad_u = row_u.xyz - at.x * row_w.xyz;
    vec3 grad_v = row_v.xyz - at.y * row_w.xyz;
    vec3 grad_d = row_d.xyz - at.z * row_w.xyz;
    vec3 v_n = cross(grad_v, n);
    float area = dot(grad_u, v_n);
    vec2 slope = area != 0.0 ? vec2(dot(grad_d, v_n), dot(grad_d, cross(n, grad_u))) / area : vec2(0.0);
    // Clamped to the map's border: beyond it is no light.
    at.xy = clamp(at.xy, square.xy + 1.0, square.xy + square.z - 1.0);
    vec2 corner = floor(at.xy - 0.5) + 1.0;
    vec2 share = at.xy - 0.5 - floor(at.xy - 0.5);
    vec4 stored = textureGather(shadow_depth, corner / vec2(textureSize(shadow_depth, 0)));
    // In the order of textureGather: lower left, lower right, upper right, upper left.
    vec4 across = corner.x + vec4(-0.5, 0.5, 0.5, -0.5) - at.x;
    vec4 down = corner.y + vec4(0.5, 0.5, -0.5, -0.5) - at.y;
    vec4 plane = at.z + max(slope.x * across + slope.y * down, 0.0);
    vec4 lit = vec4(greaterThanEqual(plane, stored));
    return blend(blend(lit.w, lit.z, share.x), blend(lit.x, lit.y, share.x), share.y);
}

// Visibility by a shadow ray. p is in bvh space, n the normal of its triangle, source_face its coplanar group, v points to
// the viewer, `media` are those on the light's side. The light is at p + to_light, or in that direction where t_max is
// larger than 1; `ambient` as in `filtered`. Who uses `to_light` afterwards takes it from here, and no second copy is kept.
vec3 visibility(vec3 p, vec3 n, vec3 v, uint source_face, uvec4 media, inout vec3 to_light, float t_max, bool ambient, bool wanted) {
    vec3 origin = ray_origin(p, n, v);
    // Four roundings before the light, so that a surface touching it does not occlude it.
    float end = t_max == 1.0 ? 1.0 - 4.0 / 16777216.0 : t_max;
    shadow_rays += wanted ? 1u : 0u;
    vec3 through = vec3(wanted ? 1.0 : 0.0);
    if (!FILTERS) {
        bool blocked = trace(origin, to_light, source_face, FROM_ORIGIN, wanted ? end : -1.0, OPAQUE, true).triangle != NO_TRIANGLE;
        return blocked ? vec3(0.0) : through;
    }
    // Transparent shadows: the surfaces that filter light are collected four at a time, nearest first.
    Hit last = FROM_ORIGIN;
    bool goes_on = wanted;
    do {
        Filters filters;
        // What a traversal makes of its ray is not kept for the next one: AMD's compiler would hold some 25 registers while
        // filters are evaluated.
        origin = found_anew(origin, floatBitsToUint(last.t));
        to_light = found_anew(to_light, floatBitsToUint(last.t));
        bool blocked = trace_to_light(origin, to_light, source_face, last, goes_on ? end : -1.0, filters);
        through = blocked ? vec3(0.0) : through;
        goes_on = goes_on && !blocked && filters.triangles.w != NO_TRIANGLE;
        bool found = !blocked && filters.triangles.x != NO_TRIANGLE;
        do {
            if (found) {
                float length_of_direction = vector_length(to_light);
                uint medium = present_medium(media);
                if (ABSORPTION == ABSORPTION_PATH && medium != 0) {
                    through *= absorbed(medium, origin + to_light * last.t, to_light / length_of_direction, (filters.t.x - last.t) * length_of_direction);
                }
                // After the medium: else the triangle would be kept while that is integrated.
                Hit hit = hit_again(origin, to_light, filters.t.x, filters.triangles.x);
                through *= filtered(hit_point_of(hit, origin, to_light), to_light / length_of_direction, ambient, media);
                last = hit;
            }
            filters = Filters(vec4(filters.t.yzw, LARGEST), uvec4(filters.triangles.yzw, NO_TRIANGLE));
            found = found && filters.triangles.x != NO_TRIANGLE;
        } while (found);
        goes_on = goes_on && largest_component(through) > 0.0;
    } while (goes_on);
    uint medium = present_medium(media);
    if (ABSORPTION == ABSORPTION_PATH && medium != 0 && t_max == 1.0) {
        float length_of_direction = vector_length(to_light);
        through *= absorbed(medium, origin + to_light * last.t, to_light / length_of_direction, (1.0 - last.t) * length_of_direction);
    }
    return through;
}

// The shadow terminator. Interpolated normals turn away from a light later than their triangles, which then shadow
// themselves in steps. The light fades out towards where the triangle turns away (Chiang, Li and Burley, Taming the Shadow
// Terminator, SIGGRAPH 2019 Talks).
float terminator(vec3 n_smooth, vec3 n, vec3 l) {
    float cos_n = dot(n, l);
    float both = dot(n_smooth, l) * dot(n_smooth, n);
    float g = both > 0.0 ? min(cos_n / both, 1.0) : 0.0;
    return cos_n > 0.0 ? ((1.0 - g) * g + 1.0) * g : 0.0;
}
#endif
