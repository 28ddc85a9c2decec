// The ray tree of recursive ray tracing (Whitted): its branches, and how a surface splits a ray into them (lecture F4, F5, R6).
// At each surface a ray splits into reflection (coat, base) and refraction or transmission. The branches of a pixel are
// followed depth first with an explicit stack, the last one first, and summed in that order. Rough lobes send one ray each,
// sampled by the VNDF. A program that follows branches says where they wait: `has_room`, `push`, `look`.
// Where to read: Whitted 1980; pbrt 4, sections 9.3 to 9.7; docs/decisions/rays.md. Assumes: bvh space, metres; radiance
// divided by the square of the index of refraction.
#ifndef RAY_TREE_GLSL
#define RAY_TREE_GLSL
#include "lib/boundary.glsl"
#include "lib/lighting.glsl"
#include "lib/primary.glsl"
#include "lib/random.glsl"
#include "lib/work_count.glsl"

layout(constant) const bool MASKED_HITS = false; // some surface is alpha-tested
layout(constant) const uint PENDING = 1;         // greatest number of waiting branches
// Which branches are added: 0 all, 1 those that the first surface reflected, 2 those that it transmitted. All branches are
// traced in any case: the order of the branches and their random numbers depend on all earlier ones.
layout(constant) const uint FIRST_EVENT = 0;
// A branch of smaller throughput is not followed. The sum of these losses is counted.
const float FAINTEST = 1.0 / 512.0;

// The event that created a ray.
const uint BY_REFLECTION = 0;
const uint BY_REFRACTION = 1; // or transmitted undeflected

struct Branch {
    vec3 origin;      // bvh space
    vec3 direction;
    uint source_face; // coplanar group of the triangle that it leaves
    vec3 throughput;
    uvec4 media;
    float from;       // surfaces up to this t are not hit
    float width;      // diameter of the ray cone at its origin, for the mip level of textures
    float spread;     // growth of the diameter per metre
    uint events;      // surfaces met before | event << 8 | only transmitted so far << 9 | first event << 10
};
const uint ONLY_TRANSMITTED = 0x200u;

// What the tree of one pixel has gathered.
vec3 sum = vec3(0.0);
vec3 around = vec3(0.0); // sum of the lookups of the environment
float escaped = 0.0; // share of the pixel that shows the background through transparent surfaces
float lost = 0.0;
uint first_event = 0; // of the current branch, in the values of FIRST_EVENT; 0 at the primary surface

// Whether one more branch may wait.
bool has_room();
// Lets a branch wait: the last one is followed first.
void push(Branch branch);
// Adds the environment's radiance around a direction, over `width` radians, to `around`.
void look(vec3 direction, vec3 throughput, float width);

vec3 wanted(uint events, vec3 light) {
    return FIRST_EVENT == 0 || events >> 10 == FIRST_EVENT ? light : vec3(0.0);
}

// Angle over which a branch sees the environment: that of its cone which rough lobes have added, less with more samples, which
// share it. So few samples see the whole lobe (filtered importance sampling, Křivánek and Colbert 2008), as in textures. 0
// without rough lobes: what is clear stays clear.
float width_by_lobes(Branch ray) {
    float of_pixel = camera.orthographic != 0 ? 0.0 : trace_terms.pixel_angle;
    return ROUGH ? (ray.spread - of_pixel) * exp2(trace_terms.lod_bias) : 0.0;
}

void send(Branch branch) {
    if (FIRST_EVENT != 0) branch.events |= (first_event == 0 ? 1 + (branch.events >> 8 & 1u) : first_event) << 10;
    float weight = largest(branch.throughput);
    bool follows = (branch.events & 0xffu) <= trace_terms.interfaces && weight >= FAINTEST && has_room();
    if (weight > 0.0 && follows) push(branch);
    // A branch that is not followed gets the environment's radiance: a better estimate than black.
    if (weight > 0.0 && !follows) {
        lost += weight;
        look(branch.direction, wanted(branch.events, branch.throughput), width_by_lobes(branch));
    }
}

// The ray from the eye to the primary surface, whose branches are the first ones.
Branch ray_to_primary(HitSurface hit) {
    Branch ray;
    ray.origin = vec3(0.0);
    ray.direction = -hit.s.v;
    ray.source_face = 0xffffffffu;
    ray.throughput = left_at_eye(hit.s);
    ray.media = trace_terms.camera_media;
    ray.from = 0.0;
    ray.width = 0.0;
    ray.spread = camera.orthographic != 0 ? 0.0 : trace_terms.pixel_angle;
    ray.events = ONLY_TRANSMITTED;
    return ray;
}

// Diameter of the ray cone at the primary surface.
float cone_at_primary(HitSurface hit) {
    return camera.orthographic != 0 ? trace_terms.pixel_angle : trace_terms.pixel_angle * length(hit.s.p_rel);
}

bool is_reflected(Branch ray) {
    return (ray.events >> 8 & 1u) == BY_REFLECTION;
}

// The nearest surface along a branch, past the holes of alpha-tested surfaces. NO_TRIANGLE where there is none, or with
// goes_on false; otherwise `point` is its point.
Hit trace_branch(Branch ray, bool goes_on, out HitPoint point) {
    Hit found = Hit(COINCIDENT_INTERFACES ? ray.from : 0.0, NO_TRIANGLE, 0.0, 0.0);
    bool hole;
    do {
        found = trace(ray.origin, ray.direction, ray.source_face, found, goes_on ? LARGEST : -1.0, OPAQUE | FILTER, false);
        bool at_surface = goes_on && found.triangle != NO_TRIANGLE;
        if (at_surface) point = hit_point_of(found, ray.origin, ray.direction);
        hole = MASKED_HITS && at_surface && loop_iterations < LOOP_BUDGET && hit_is_hole(point);
    } while (hole);
    return found;
}

// What is left of a branch's throughput at the surface that it meets, t away; t = 0 where it meets none.
vec3 throughput_after(Branch ray, float t) {
    uint medium = present_medium(ray.media);
    return ABSORPTION == ABSORPTION_PATH && medium != 0 ? ray.throughput * absorbed(medium, ray.origin, ray.direction, t) : ray.throughput;
}

// Light of a branch that meets no surface.
void leave_scene(Branch ray) {
    bool direct = (ray.events & ONLY_TRANSMITTED) != 0;
    bool clear = direct && !SKY;
    if (BLURRED_BACKGROUND && direct) {
        sum += wanted(ray.events, ray.throughput) * background_radiance(ray.direction);
    } else if (!clear) {
        look(ray.direction, wanted(ray.events, ray.throughput), width_by_lobes(ray));
    }
    escaped += clear ? (ray.throughput.r + ray.throughput.g + ray.throughput.b) * (1.0 / 3.0) : 0.0;
}

// Whether the base's reflection is traced by a ray. Inside a solid there is no environment to look up.
bool mirrored_by_ray(HitSurface hit, Boundary boundary) {
    return hit.s.base_traced || (boundary.solid && boundary.medium_in != 0);
}

// The surface that a branch meets, as lights shade it.
Surface surface_for_lights(HitSurface hit, Boundary boundary, uint leaf) {
    Surface s = hit.s;
    if (TRANSMISSIVE && !boundary.solid) seen_from(s, index_of(boundary.medium_in));
    s.lobe = lobe_reflectance(s);
    keep_diffuse(s, 1.0 - hit.transmits);
    s.passes = passes_roughly(hit);
    // Single-sided surfaces emit on their front alone, as for light samples.
    if (!hit.front && (hit_material(leaf) & ONE_SIDED_TRIANGLE) != 0) s.emissive = vec3(0.0);
    // Light traced by a ray is not looked up as well.
    s.base_traced = mirrored_by_ray(hit, boundary);
    return s;
}

// Every light: hits are outside of the light tiles.
LightRange all_lights() {
    return LightRange(0, DIRECTIONAL_LIGHTS + LIGHT_SAMPLES + LOCAL_LIGHTS + SKY_RAYS, 0, 0);
}

// Flag in the event number that gives coats random numbers of their own.
const uint COAT_EVENT = 0x80000000u;

// Splits a ray along `ray.direction` at a surface into its branches. `event` counts the pixel's rays so far, for their
// random numbers.
void split(HitSurface hit, Boundary boundary, Branch ray, float cone, uvec2 pixel, uint event) {
    Surface s = hit.s;
    vec3 direction = ray.direction;
    unmatched_exits += boundary.unmatched_exit ? 1u : 0u;
    Branch next;
    next.source_face = s.face;
    next.media = ray.media;
    next.width = cone;
    next.spread = ray.spread;
    next.throughput = vec3(0.0);
    next.from = 0.0;
    uint count = (ray.events & 0xffu) + 1;
    uint only_through = ray.events & ONLY_TRANSMITTED;

    // 1. Undeflected: past the uncovered part, and through an interface suppressed by priority.
    next.origin = ray_origin(s.p_bvh, boundary.touches_opaque ? hit.n : -hit.n, vec3(0.0));
    next.direction = direction;
    next.media = boundary.suppressed_by_priority ? boundary.media_out : ray.media;
    next.events = (boundary.suppressed_by_priority && !boundary.touches_opaque ? count - 1 : count) | BY_REFRACTION << 8 | only_through;
    next.throughput = boundary.suppressed_by_priority ? ray.throughput : ray.throughput * (1.0 - hit.coverage);
    next.from = boundary.touches_opaque ? boundary.opaque_at : 0.0;
    if (boundary.suppressed_by_priority || hit.coverage < 1.0) send(next);
    next.from = 0.0;
    vec3 weight = boundary.suppressed_by_priority || s.unlit ? vec3(0.0) : ray.throughput * hit.coverage;

    // 2. Reflection by the clear coat.
    Layers b = layers_at(hit, boundary);
    next.origin = ray_origin(s.p_bvh, hit.n, s.v);
    next.media = ray.media;
    if (CLEARCOAT) {
        vec2 u = vec2(0.0);
        if (ROUGH) u = random_point(pixel, event | COAT_EVENT, trace_terms.seed, trace_terms.sample_index, trace_terms.samples);
        LobeSample coat = sample_coat(b, event_half_vector(b, true, u));
        next.direction = coat.direction;
        next.events = count | BY_REFLECTION << 8;
        next.throughput = s.coat_traced ? weight * coat.weight : vec3(0.0);
        next.spread = ray.spread + (ROUGH && !b.coat_delta ? s.clearcoat_alpha : 0.0);
        send(next);
        weight *= b.under;
    }
    // 3. Reflection by the base.
    vec2 u = vec2(0.0);
    if (ROUGH) u = random_point(pixel, event, trace_terms.seed, trace_terms.sample_index, trace_terms.samples);
    vec3 h = event_half_vector(b, false, u);
    FacetFresnel fresnel = fresnel_at_facet(b, h);
    LobeSample mirrored = sample_base(b, h, fresnel);
    next.direction = mirrored.direction;
    next.events = count | BY_REFLECTION << 8;
    next.throughput = mirrored_by_ray(hit, boundary) ? weight * mirrored.weight : vec3(0.0);
    next.spread = ray.spread + (ROUGH && !b.delta ? max(s.alpha, s.alpha_along) : 0.0);
    send(next);
    // 4. Refraction, or transmission through a thin-walled surface.
    if (TRANSMISSIVE) {
        LobeSample through = sample_transmission(b, h, fresnel);
        next.origin = ray_origin(s.p_bvh, -hit.n, vec3(0.0));
        next.media = boundary.solid ? boundary.media_out : ray.media;
        next.direction = through.direction;
        next.events = count | BY_REFRACTION << 8 | only_through;
        next.throughput = weight * through.weight;
        send(next);
    }
}
#endif
