// Reflection and refraction by recursive ray tracing (Whitted), from the primary surfaces of the G-buffer.
// At each surface a ray splits into reflection (coat, base) and refraction or transmission: a tree of branches. They are
// followed depth first with an explicit stack, the last one first, and summed in that order (lecture F4, F5, R6). Rough
// lobes send one ray each, sampled by the VNDF. Only tiles of the classification are dispatched.
// Where to read: Whitted 1980; pbrt 4, sections 9.3 to 9.7; docs/decisions/rays.md. Assumes: bvh space, metres; radiance
// divided by the square of the index of refraction.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/boundary.glsl"
#include "lib/encode.glsl"
#include "lib/lighting.glsl"
#include "lib/primary.glsl"
#include "lib/random.glsl"
#include "lib/work_count.glsl"
#include "lib/work_tile.glsl"

layout(pass, rgba32f) uniform image2D radiance;
layout(pass, scalar) readonly buffer RayTiles { uint ray_tiles[]; };
layout(pass, scalar) readonly buffer Sizes { WorkSize rays_size; } work;

layout(constant) const bool MASKED_HITS = false; // some surface is alpha-tested
layout(constant) const uint PENDING = 1;         // greatest number of waiting branches
// Which branches are added: 0 all, 1 those that the first surface reflected, 2 those that it transmitted. All branches are
// traced in any case: the order of the branches and their random numbers depend on all earlier ones.
layout(constant) const uint FIRST_EVENT = 0;
// On GPUs: a branch goes to the stack at once, and a lookup of the environment is made where it arises.
// Otherwise both wait in registers (docs/decisions/architectures.md). The sums are the same, in the same order.
layout(constant) const bool BRANCHES_IN_MEMORY = false;
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
// Branches that the current surface has sent, the last one first, in registers. An indexed array is in memory, which
// lavapipe writes word by word and lane by lane, and most surfaces send one or two. The last branch is followed next; the
// others wait in the stack `pending`.
const int MOST_SENT = 4;
Branch sent[MOST_SENT];
uint sent_now = 0;
Branch pending[PENDING];
uint waiting = 0;
// Lookups of the environment still to be made, in order, with their weights: those of the first surface wait for those of
// the second.
const int MOST_LOOKS = 2 * MOST_SENT;
vec3 looks_at[MOST_LOOKS];
vec3 looks_with[MOST_LOOKS];
uint looks = 0;
vec3 sum = vec3(0.0);
vec3 around = vec3(0.0); // sum of the lookups of the environment
float escaped = 0.0; // share of the pixel that shows the background through transparent surfaces
float lost = 0.0;
uint reflection_rays = 0;
uint refraction_rays = 0;
uint first_event = 0; // of the current branch, in the values of FIRST_EVENT; 0 at the primary surface

vec3 wanted(uint events, vec3 light) {
    return FIRST_EVENT == 0 || events >> 10 == FIRST_EVENT ? light : vec3(0.0);
}

void look(vec3 direction, vec3 throughput) {
    if (BRANCHES_IN_MEMORY) {
        around += throughput * (ENVIRONMENT ? environment_radiance(direction) : vec3(0.0));
        return;
    }
    for (int i = 0; i < MOST_LOOKS; i++) {
        looks_at[i] = i == looks ? direction : looks_at[i];
        looks_with[i] = i == looks ? throughput : looks_with[i];
    }
    looks++;
}

// Makes all pending lookups in one place of the code: a sampled image is a call that spills every register.
void see_environment() {
    do {
        vec3 seen = ENVIRONMENT ? environment_radiance(looks_at[0]) : vec3(0.0);
        around += looks > 0 ? looks_with[0] * seen : vec3(0.0);
        for (int i = 0; i < MOST_LOOKS - 1; i++) {
            looks_at[i] = looks_at[i + 1];
            looks_with[i] = looks_with[i + 1];
        }
        looks -= looks > 0 ? 1 : 0;
    } while (looks > 0);
}

void send(Branch branch) {
    if (FIRST_EVENT != 0) branch.events |= (first_event == 0 ? 1 + (branch.events >> 8 & 1u) : first_event) << 10;
    float weight = largest(branch.throughput);
    bool follows = (branch.events & 0xffu) <= trace_terms.interfaces && weight >= FAINTEST && waiting + sent_now < PENDING;
    if (weight > 0.0 && follows && BRANCHES_IN_MEMORY) {
        pending[waiting] = branch;
        waiting++;
    } else if (weight > 0.0 && follows) {
        for (int i = MOST_SENT - 1; i > 0; i--) sent[i] = sent[i - 1];
        sent[0] = branch;
        sent_now++;
    }
    // A branch that is not followed gets the environment's radiance: a better estimate than black.
    if (weight > 0.0 && !follows) {
        lost += weight;
        look(branch.direction, wanted(branch.events, branch.throughput));
    }
}

// The next branch: the last one sent, or the last one that waits.
Branch next_branch() {
    if (BRANCHES_IN_MEMORY) {
        waiting -= waiting > 0 ? 1 : 0;
        return pending[waiting];
    }
    do {
        bool waits = sent_now > 1;
        Branch oldest = sent[1];
        for (int i = 2; i < MOST_SENT; i++) {
            if (sent_now > i) oldest = sent[i];
        }
        if (waits) pending[min(waiting, PENDING - 1)] = oldest;
        waiting += waits ? 1 : 0;
        sent_now -= waits ? 1 : 0;
    } while (sent_now > 1);
    bool from_memory = sent_now == 0;
    waiting -= from_memory && waiting > 0 ? 1 : 0;
    Branch next = pending[min(waiting, PENDING - 1)];
    if (!from_memory) next = sent[0];
    sent_now = 0;
    return next;
}

// Whether the base's reflection is traced by a ray. Inside a solid there is no environment to look up.
bool mirrored_by_ray(HitSurface hit, Boundary boundary) {
    return hit.s.base_traced || (boundary.solid && boundary.medium_in != 0);
}

// Flag in the event number that gives coats random numbers of their own.
const uint COAT_EVENT = 0x80000000u;

// Splits a ray along `ray.direction` at a surface into its branches.
void split(HitSurface hit, Boundary boundary, Branch ray, float cone, uvec2 pixel) {
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
    uint only_through = ray.events & 0x200u;

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
    uint event = reflection_rays + refraction_rays;
    next.origin = ray_origin(s.p_bvh, hit.n, s.v);
    next.media = ray.media;
    if (CLEARCOAT) {
        vec2 u = vec2(0.0);
        if (ROUGH) u = random_point(pixel, event | COAT_EVENT, trace_terms.seed, trace_terms.sample_index);
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
    if (ROUGH) u = random_point(pixel, event, trace_terms.seed, trace_terms.sample_index);
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

void main() {
    uint place = listed_tile(gl_WorkGroupID);
    if (place >= work.rays_size.count) return;
    ivec2 pixel = first_pixel(ray_tiles[place]) + ivec2(gl_LocalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(pixel), camera.size))) return;
    // 1. The primary surface, from the G-buffer, and its branches.
    Primary primary = primary_surface(pixel, true);
    if (!primary.drawn) return;
    HitSurface hit = primary.hit;
    Branch ray;
    ray.origin = vec3(0.0);
    ray.direction = -hit.s.v;
    ray.throughput = left_at_eye(hit.s);
    ray.media = trace_terms.camera_media;
    ray.width = 0.0;
    ray.spread = camera.orthographic != 0 ? 0.0 : trace_terms.pixel_angle;
    ray.events = 0x200u;
    float cone = camera.orthographic != 0 ? trace_terms.pixel_angle : trace_terms.pixel_angle * length(hit.s.p_rel);

    Boundary boundary = boundary_at(hit, ray.media, ray.direction);
    split(hit, boundary, ray, cone, uvec2(pixel));
    bool more = sent_now > 0 || waiting > 0;
    do {
        // 2. Follow the next branch to its hit.
        bool goes_on = more;
        ray = next_branch();
        if (FIRST_EVENT != 0) first_event = ray.events >> 10;
        // Passes the holes of alpha-tested surfaces.
        Hit found = Hit(COINCIDENT_INTERFACES ? ray.from : 0.0, NO_TRIANGLE, 0.0, 0.0);
        HitPoint point;
        bool at_surface;
        bool hole;
        do {
            found = trace(ray.origin, ray.direction, ray.source_face, found, goes_on ? LARGEST : -1.0, OPAQUE | FILTER, false);
            at_surface = goes_on && found.triangle != NO_TRIANGLE;
            if (at_surface) point = hit_point_of(found, ray.origin, ray.direction);
            hole = MASKED_HITS && at_surface && loop_iterations < LOOP_BUDGET && hit_is_hole(point);
        } while (hole);
        // Values that live after the loop are assigned under the lane's condition: lavapipe continues to run lanes that
        // have finished, and their results are meaningless.
        if (goes_on) {
            bool reflected_ray = (ray.events >> 8 & 1u) == BY_REFLECTION;
            reflection_rays += reflected_ray ? 1u : 0u;
            refraction_rays += reflected_ray ? 0u : 1u;
            uint medium = present_medium(ray.media);
            if (ABSORPTION == ABSORPTION_PATH && medium != 0) ray.throughput *= absorbed(medium, ray.origin, ray.direction, at_surface ? found.t : 0.0);
            // 3. Light the hit and split the branch there, or look up the environment.
            if (at_surface) {
                cone = ray.width + ray.spread * found.t;
                hit = hit_surface(point, ray.direction, cone * exp2(trace_terms.lod_bias));
                hit.s.media = ray.media;
                boundary = boundary_at(hit, ray.media, ray.direction);
                Surface s = hit.s;
                if (TRANSMISSIVE && !boundary.solid) seen_from(s, index_of(boundary.medium_in));
                compensate(s);
                keep_diffuse(s, 1.0 - hit.transmits);
                // Single-sided surfaces emit on their front alone, as for light samples.
                if (!hit.front && (hit_material(found.triangle) & ONE_SIDED_TRIANGLE) != 0) s.emissive = vec3(0.0);
                // Light traced by a ray is not looked up as well.
                s.base_traced = mirrored_by_ray(hit, boundary);
                LightRange all = LightRange(0, DIRECTIONAL_LIGHTS + LIGHT_SAMPLES + LOCAL_LIGHTS, 0, 0);
                vec3 weight = wanted(ray.events, ray.throughput * hit.coverage);
                bool lit = !boundary.suppressed_by_priority;
                uint surface = reflection_rays + refraction_rays;
                split(hit, boundary, ray, cone, uvec2(pixel));
                if (lit) sum += weight * radiance_to_eye(s, pixel, surface, 0, all, true);
                // Without its light samples the surface is too dark.
                lost += samples_cut_off > 0 ? largest(ray.throughput) : 0.0;
                samples_cut_off = 0;
            } else {
                bool direct = (ray.events & 0x200u) != 0;
                bool clear = direct && !SKY;
                if (BLURRED_BACKGROUND && direct) {
                    sum += wanted(ray.events, ray.throughput) * background_radiance(ray.direction);
                } else if (!clear) {
                    look(ray.direction, wanted(ray.events, ray.throughput));
                }
                escaped += clear ? (ray.throughput.r + ray.throughput.g + ray.throughput.b) * (1.0 / 3.0) : 0.0;
            }
        }
        if (!BRANCHES_IN_MEMORY && (goes_on || looks > 0)) see_environment();
        more = sent_now > 0 || waiting > 0;
        more = more && loop_iterations < LOOP_BUDGET;
    } while (more);
    // 4. At the limit of loop iterations the waiting branches are dropped and counted.
    for (int i = 0; i < MOST_SENT; i++) lost += sent_now > i ? largest(sent[i].throughput) : 0.0;
    while (waiting > 0) {
        waiting--;
        lost += largest(pending[waiting].throughput);
    }
    vec4 before = imageLoad(radiance, pixel);
    imageStore(radiance, pixel, vec4(before.rgb + (sum + around), before.a * (1.0 - min(escaped, 1.0))));
    if (FIRST_EVENT == 0) count_rays(reflection_rays, refraction_rays, lost, lost);
}
