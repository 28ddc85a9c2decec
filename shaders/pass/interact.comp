// Reflection and refraction: from the primary surfaces of the G-buffer a tree of rays through the scene, over the tiles
// that call for it. At each surface a ray is mirrored (coat, base) and refracted or let through; the branches are
// followed one by one, the last one first, and summed in that order (lecture F4, F5, R6).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/camera.glsl"
#include "lib/surface.glsl"

layout(scalar, set = 0, binding = 0) uniform CameraBlock { Camera camera; };
layout(scalar, set = 0, binding = 2) readonly buffer Instances { Instance instances[]; };
#include "lib/encode.glsl"
#include "lib/lighting.glsl"
#include "lib/primary.glsl"
#include "lib/random.glsl"
#include "lib/work_count.glsl"
#include "lib/work_tile.glsl"

layout(set = 0, binding = 10, rgba32f) uniform image2D radiance;
layout(scalar, set = 0, binding = 11) readonly buffer RayTiles { uint ray_tiles[]; };
layout(scalar, set = 0, binding = 12) readonly buffer Sizes { WorkSize rays_size; } work;
layout(set = 0, binding = 25) uniform sampler2D sky;

layout(constant_id = 50) const bool TRANSMISSIVE = false; // some material lets light through
layout(constant_id = 51) const bool ROUGH = false;      // some surface that sends rays is rough
layout(constant_id = 52) const bool SKY = false;        // the environment is seen behind the scene
layout(constant_id = 53) const bool MASKED_HITS = false; // some surface has holes
layout(constant_id = 54) const uint LOOP_BUDGET = 40000;
layout(constant_id = 55) const uint PENDING = 1;         // branches that can wait at once
const bool ENVIRONMENT = AMBIENT || REFLECTION;
// A branch that would add less than this share of what it meets is not followed. The sum of all that is cut off is
// counted.
const float FAINTEST = 1.0 / 512.0;

// What a ray was sent for.
const uint BY_REFLECTION = 0;
const uint BY_REFRACTION = 1; // or straight through

struct Branch {
    vec3 origin;      // bvh space
    vec3 direction;
    uint self;        // the flat face it leaves
    vec3 throughput;
    uvec4 media;
    float width;      // of the ray at its origin, for the level of textures
    float spread;     // and what it grows by per metre
    uint events;      // surfaces met before | what it was sent for << 8 | only let through so far << 9
};
Branch pending[PENDING];
uint waiting = 0;
vec3 sum = vec3(0.0);
float escaped = 0.0; // share of the pixel where nothing lies behind what is transparent
float lost = 0.0;
uint reflection_rays = 0;
uint refraction_rays = 0;

vec3 environment_seen(vec3 direction) {
    vec2 at = equirectangular_from_direction(into_environment(direction));
    return ENVIRONMENT ? textureLod(sky, at, 0.0).rgb * environment.intensity : vec3(0.0);
}

void send(Branch branch) {
    float weight = largest(branch.throughput);
    bool follows = (branch.events & 0xffu) <= trace_terms.interfaces && weight >= FAINTEST && waiting < PENDING;
    if (weight > 0.0 && follows) pending[min(waiting, PENDING - 1)] = branch;
    waiting += weight > 0.0 && follows ? 1 : 0;
    // What is not followed sees the environment: nearer than nothing to what would have been found.
    if (weight > 0.0 && !follows) {
        lost += weight;
        sum += branch.throughput * environment_seen(branch.direction);
    }
}

// What a surface separates, for a ray that comes through `media`.
struct Boundary {
    bool sheet;  // transmits light and encloses nothing
    bool solid;  // the surface of a transparent body
    bool hidden; // a body of higher priority displaces it: nothing changes here
    bool stray;  // left without having been entered: the shell is open, or another one crosses it
    uint here;   // the medium before
    uint there;  // and behind
    uvec4 beyond; // all media behind
};

Boundary boundary_at(HitSurface hit, uvec4 media) {
    Boundary r;
    Material m = material_at(hit.material);
    uint medium = m.medium;
    bool transmissive = TRANSMISSIVE && m.transmission > 0.0;
    r.sheet = transmissive && hit.sheet;
    r.solid = transmissive && !r.sheet;
    r.beyond = hit.front ? entered(media, medium) : left(media, medium);
    r.stray = r.solid && !hit.front && !inside(media, medium);
    r.here = r.stray ? medium : present_medium(media);
    r.there = present_medium(r.beyond);
    r.hidden = r.solid && r.here == r.there;
    return r;
}

// Sends what a ray along `direction` is split into at a surface.
void split(HitSurface hit, Branch ray, float cone, uvec2 pixel) {
    Surface s = hit.s;
    Boundary boundary = boundary_at(hit, ray.media);
    vec3 direction = ray.direction;
    float n1 = index_of(boundary.here);
    float n2 = boundary.solid ? index_of(boundary.there) : s.ior;
    stray_interfaces += boundary.stray ? 1u : 0u;
    Branch next;
    next.self = s.face;
    next.media = ray.media;
    next.width = cone;
    next.spread = ray.spread;
    next.throughput = vec3(0.0);
    uint count = (ray.events & 0xffu) + 1;
    uint only_through = ray.events & 0x200u;

    // Straight on: past what is not covered, and through a boundary that another medium displaces.
    next.origin = ray_origin(s.p_bvh, -hit.n, vec3(0.0));
    next.direction = direction;
    next.media = boundary.hidden ? boundary.beyond : ray.media;
    next.events = (boundary.hidden ? count - 1 : count) | BY_REFRACTION << 8 | only_through;
    next.throughput = boundary.hidden ? ray.throughput : ray.throughput * (1.0 - hit.coverage);
    if (boundary.hidden || hit.coverage < 1.0) send(next);
    vec3 weight = boundary.hidden || s.unlit ? vec3(0.0) : ray.throughput * hit.coverage;

    // The coat.
    if (CLEARCOAT) {
        vec3 r = reflect_ray(direction, s.n_coat).R;
        next.direction = on_side(r, hit.n);
        next.origin = ray_origin(s.p_bvh, hit.n, s.v);
        next.media = ray.media;
        next.events = count | BY_REFLECTION << 8;
        next.throughput = s.coat_traced ? weight * (1.0 - under_coat(s)) : vec3(0.0);
        send(next);
        weight *= under_coat(s);
    }

    bool rough = ROUGH && s.roughness > MIN_ROUGHNESS;
    vec3 h = s.n;
    if (ROUGH) {
        vec2 u = random_point(pixel, reflection_rays + refraction_rays, trace_terms.sample_index, trace_terms.samples);
        h = rough ? half_vector(s.n, s.v, s.alpha, u) : h;
    }
    float cos_h = clamp(dot(h, s.v), 0.0, 1.0);
    float cos_v = dot(s.n, s.v);
    // What tints the reflectance of the surface in air (KHR_materials_specular) tints that between two media.
    float share = boundary_share(cos_h, n1, n2);
    float in_air = nested_f0(1.0, s.ior);
    vec3 f0 = boundary.solid ? s.f0_dielectric * (in_air > 0.0 ? nested_f0(n1, n2) / in_air : 0.0) : s.f0_dielectric;
    bool total = boundary.solid && share >= 1.0;
    vec3 f_dielectric = total ? vec3(1.0) : f0 + (vec3(s.f90_dielectric) - f0) * share;
    vec3 f = mix(f_dielectric, fresnel_of_metal(s, cos_h), s.metallic);

    // The mirror image.
    vec3 r = reflect_ray(direction, h).R;
    float cos_r = dot(r, s.n);
    bool above = dot(r, hit.n) > 0.0;
    float masking = rough ? (above && cos_r > 0.0 ? unmasked(cos_v, cos_r, s.alpha) : 0.0) : 1.0;
    next.direction = on_side(r, hit.n);
    next.origin = ray_origin(s.p_bvh, hit.n, s.v);
    next.media = ray.media;
    next.events = count | BY_REFLECTION << 8;
    bool mirrors = s.base_traced || (boundary.solid && boundary.here != 0);
    next.throughput = mirrors ? weight * f * s.compensation * masking : vec3(0.0);
    next.spread = ray.spread + (rough ? s.alpha : 0.0);
    send(next);

    // What goes through.
    if (TRANSMISSIVE) {
        Material m = material_at(hit.material);
        Refraction t = refract_ray(direction, h, n2 / n1);
        // Equal indices bend nothing, not even by a rounding.
        vec3 bent_ray = n1 == n2 ? direction : t.T;
        // A sheet scatters as its mirror image does, to the other side.
        vec3 sheet_ray = rough ? r - 2.0 * cos_r * s.n : direction;
        vec3 through = boundary.sheet ? sheet_ray : bent_ray;
        next.direction = rough ? through : -on_side(-through, hit.n);
        bool passes = dot(next.direction, hit.n) < 0.0 && !(boundary.solid && (total || t.tir));
        masking = rough ? unmasked(cos_v, dot(next.direction, s.n), s.alpha) : 1.0;
        if (rough && boundary.sheet) masking = cos_r > 0.0 ? masking : 0.0;
        vec3 tint = boundary.sheet ? s.base : sqrt(s.base);
        if (ABSORPTION != 0) {
            bool nominal = boundary.sheet || (ABSORPTION == 1 && hit.front);
            tint *= nominal ? exp(-m.sigma_thickness * hit.thickness) : vec3(1.0);
        }
        next.origin = ray_origin(s.p_bvh, -hit.n, vec3(0.0));
        next.media = boundary.solid ? boundary.beyond : ray.media;
        next.events = count | BY_REFRACTION << 8 | only_through;
        next.throughput = passes ? weight * tint * (hit.transmits * (1.0 - largest(f_dielectric)) * masking) : vec3(0.0);
        next.spread = ray.spread + (rough ? s.alpha : 0.0);
        send(next);
    }
}

void main() {
    uint place = listed_tile(gl_WorkGroupID);
    if (place >= work.rays_size.count) return;
    ivec2 pixel = first_pixel(ray_tiles[place]) + ivec2(gl_LocalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(pixel), camera.size))) return;
    Primary primary = primary_surface(pixel);
    if (!primary.drawn) return;
    HitSurface hit = primary.hit;
    Branch ray;
    ray.origin = vec3(0.0);
    ray.direction = -hit.s.v;
    ray.throughput = vec3(1.0);
    ray.media = trace_terms.camera_media;
    ray.width = 0.0;
    ray.spread = camera.orthographic != 0 ? 0.0 : trace_terms.pixel_angle;
    ray.events = 0x200u;
    float cone = camera.orthographic != 0 ? trace_terms.pixel_angle : trace_terms.pixel_angle * length(hit.s.p_rel);
    bool at_surface = true;
    bool goes_on;
    do {
        loop_heads++;
        if (at_surface) split(hit, ray, cone, uvec2(pixel));
        goes_on = waiting > 0 && loop_heads < LOOP_BUDGET;
        waiting -= goes_on ? 1 : 0;
        if (goes_on) ray = pending[min(waiting, PENDING - 1)];
        bool reflected_ray = (ray.events >> 8 & 1u) == BY_REFLECTION;
        reflection_rays += goes_on && reflected_ray ? 1u : 0u;
        refraction_rays += goes_on && !reflected_ray ? 1u : 0u;
        // Holes of masks are passed by.
        Hit found = FROM_ORIGIN;
        HitPoint point;
        bool hole;
        do {
            loop_heads++;
            found = trace(ray.origin, ray.direction, ray.self, found, goes_on ? LARGEST : -1.0, OPAQUE | FILTER, false);
            at_surface = goes_on && found.triangle != NO_TRIANGLE;
            if (at_surface) point = hit_point_of(found, ray.origin, ray.direction);
            hole = MASKED_HITS && at_surface && loop_heads < LOOP_BUDGET && hit_coverage(point) == 0.0;
        } while (hole);
        if (goes_on) {
            uint medium = present_medium(ray.media);
            if (ABSORPTION == 2 && medium != 0) ray.throughput *= absorbed(medium, ray.origin, ray.direction, at_surface ? found.t : 0.0);
            if (at_surface) {
                cone = ray.width + ray.spread * found.t;
                hit = hit_surface(point, ray.direction, cone * exp2(trace_terms.lod_bias));
                hit.s.media = ray.media;
                Surface s = hit.s;
                s.diffuse *= 1.0 - hit.transmits;
                LightRange all = LightRange(0, DIRECTIONAL_LIGHTS + LOCAL_LIGHTS, 0, 0);
                if (!boundary_at(hit, ray.media).hidden) sum += ray.throughput * hit.coverage * radiance_to_eye(s, pixel, 0, all, true);
            } else {
                bool clear = (ray.events & 0x200u) != 0 && !SKY;
                sum += clear ? vec3(0.0) : ray.throughput * environment_seen(ray.direction);
                escaped += clear ? (ray.throughput.r + ray.throughput.g + ray.throughput.b) * (1.0 / 3.0) : 0.0;
            }
        }
    } while (goes_on);
    // Out of steps: what waits is not followed.
    while (waiting > 0) {
        waiting--;
        lost += largest(pending[waiting].throughput);
    }
    vec4 before = imageLoad(radiance, pixel);
    imageStore(radiance, pixel, vec4(before.rgb + sum, before.a * (1.0 - min(escaped, 1.0))));
    count_rays(reflection_rays, refraction_rays, lost);
}
