// Reflection and refraction on CPUs: the ray tree of each pixel, one invocation per pixel.
// Only tiles of the classification are dispatched.
// Where to read: lib/ray_tree.glsl; docs/decisions/architectures.md.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 8, local_size_y = 8) in;
// A kernel of CPUs alone (lib/layers.glsl).
#define ONE_KERNEL
#include "lib/ray_tree.glsl"
#include "lib/work_tile.glsl"

layout(pass, rgba32f) uniform image2D radiance;
layout(pass, scalar) readonly buffer RayTiles { uint ray_tiles[]; };
layout(pass, scalar) readonly buffer Sizes { WorkSize rays_size; } work;

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
float looks_wide[MOST_LOOKS];
uint looks = 0;
uint reflection_rays = 0;
uint refraction_rays = 0;

bool has_room() {
    return waiting + sent_now < PENDING;
}

void push(Branch branch) {
    for (int i = MOST_SENT - 1; i > 0; i--) sent[i] = sent[i - 1];
    sent[0] = branch;
    sent_now++;
}

void look(vec3 direction, vec3 throughput, float width) {
    for (int i = 0; i < MOST_LOOKS; i++) {
        looks_at[i] = i == looks ? direction : looks_at[i];
        looks_with[i] = i == looks ? throughput : looks_with[i];
        looks_wide[i] = i == looks ? width : looks_wide[i];
    }
    looks++;
}

// Makes all pending lookups in one place of the code: a sampled image is a call that spills every register.
void see_environment() {
    do {
        vec3 seen = ENVIRONMENT ? environment_radiance(looks_at[0], looks_wide[0]) : vec3(0.0);
        around += looks > 0 ? looks_with[0] * seen : vec3(0.0);
        for (int i = 0; i < MOST_LOOKS - 1; i++) {
            looks_at[i] = looks_at[i + 1];
            looks_with[i] = looks_with[i + 1];
            looks_wide[i] = looks_wide[i + 1];
        }
        looks -= looks > 0 ? 1 : 0;
    } while (looks > 0);
}

// The next branch: the last one sent, or the last one that waits.
Branch next_branch() {
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

LightSample drawn_apart() {
    return NO_LIGHT_SAMPLE;
}

void main() {
    uint place = listed_tile(gl_WorkGroupID);
    if (place >= work.rays_size.count) return;
    ivec2 pixel = unpacked_pixel(ray_tiles[place]) + ivec2(gl_LocalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(pixel), camera.size))) return;
    // 1. The primary surface, from the G-buffer, and its branches.
    sky_list = list_of(uvec2(pixel));
    Primary primary = primary_surface(pixel, true);
    if (!primary.drawn) return;
    HitSurface hit = primary.hit;
    Branch ray = ray_to_primary(hit);
    Boundary boundary = boundary_at(hit, ray.media, ray.direction);
    split(hit, boundary, ray, cone_at_primary(hit), uvec2(pixel), 0);
    bool more = sent_now > 0 || waiting > 0;
    do {
        // 2. Follow the next branch to its hit.
        bool goes_on = more;
        ray = next_branch();
        if (FIRST_EVENT != 0) first_event = ray.events >> 10;
        HitPoint point;
        Hit found = trace_branch(ray, goes_on, point);
        bool at_surface = goes_on && found.triangle != NO_TRIANGLE;
        // Values that live after the loop are assigned under the lane's condition: lavapipe continues to run lanes that
        // have finished, and their results are meaningless.
        if (goes_on) {
            reflection_rays += is_reflected(ray) ? 1u : 0u;
            refraction_rays += is_reflected(ray) ? 0u : 1u;
            ray.throughput = throughput_after(ray, at_surface ? found.t : 0.0);
            // 3. Light the hit and split the branch there, or look up the environment.
            if (at_surface) {
                float cone = ray.width + ray.spread * found.t;
                hit = hit_surface(point, ray.direction, cone * exp2(trace_terms.lod_bias), EVERY_SLOT);
                hit.s.media = ray.media;
                boundary = boundary_at(hit, ray.media, ray.direction);
                Surface s = surface_for_lights(hit, boundary, found.triangle);
                vec3 weight = wanted(ray.events, ray.throughput * hit.coverage);
                bool lit = !boundary.suppressed_by_priority;
                uint surface = reflection_rays + refraction_rays;
                split(hit, boundary, ray, cone, uvec2(pixel), surface);
                if (lit) sum += weight * radiance_to_eye(s, pixel, surface, 0, all_lights(), true);
                if (ENVIRONMENT_APART) {
                    precise vec3 around_here = weight * environment_light_at_hit(s, layers_at_hit(s), sky_shown);
                    precise vec3 with_it = sum + around_here;
                    if (lit) sum = with_it;
                }
                // Without its light samples the surface is too dark.
                lost += samples_cut_off > 0 ? largest(ray.throughput) : 0.0;
                samples_cut_off = 0;
            } else {
                leave_scene(ray);
            }
        }
        if (goes_on || looks > 0) see_environment();
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
