// Path tracing, one bounce of two paths in one invocation: the form for CPUs.
// While one ray waits for memory the other computes, and the code of a bounce exists once.
// Where to read: docs/decisions/architectures.md; lib/path.glsl.
#ifndef PATH_PAIR_GLSL
#define PATH_PAIR_GLSL
#include "lib/path.glsl"

float emission_weight(Path p, Hit found, vec3 n) {
    return weight_of_emission(p, found, n);
}

LightSample first_light(Path p, vec3 origin, uvec2 pixel) {
    return draw_first_light(p, origin, pixel);
}

uvec4 media_before(Path p) {
    return p.media;
}

PhotonSample photon_near(Path p, vec3 p_bvh, vec3 n, uvec2 pixel, bool wanted) {
    return draw_photon(p, p_bvh, n, pixel, wanted);
}

// One bounce of two paths: their rays are traced in pairs, their surfaces shaded one after the other, so that the code
// exists once.
void bounce(inout Path a, inout Path b, uvec2 pixel_a, uvec2 pixel_b) {
    // 1. Extend both paths to their next vertices.
    bool alive_a = (a.state & PATH_ALIVE) != 0;
    bool alive_b = (b.state & PATH_ALIVE) != 0;
    HitPair found = trace_pair(PairedRay(a.origin, a.direction, a.source_face, COINCIDENT_INTERFACES ? a.t_min : 0.0, alive_a ? LARGEST : -1.0),
                               PairedRay(b.origin, b.direction, b.source_face, COINCIDENT_INTERFACES ? b.t_min : 0.0, alive_b ? LARGEST : -1.0),
                               OPAQUE | FILTER, false);
    path_rays += (alive_a ? 1u : 0u) + (alive_b ? 1u : 0u);
    vec3 gathered_a = vec3(0.0);
    vec3 gathered_b = vec3(0.0);
    ShadowRay shadow_a, shadow_b;
    // 2. Shade both vertices.
    for (int i = 0; i < 2; i++) {
        Path p = a;
        Hit hit = found.a;
        uvec2 pixel = pixel_a;
        bool alive = alive_a;
        if (i == 1) {
            p = b;
            hit = found.b;
            pixel = pixel_b;
            alive = alive_b;
        }
        ShadowRay shadow_ray;
        vec3 now = shade_vertex(p, hit, pixel, alive, shadow_ray);
        if (i == 0) {
            if (alive_a) a = p;
            shadow_a = shadow_ray;
            gathered_a = now;
        } else {
            if (alive_b) b = p;
            shadow_b = shadow_ray;
            gathered_b = now;
        }
    }
    if (alive_a) a.sum += gathered_a;
    if (alive_b) b.sum += gathered_b;
    // 3. Trace both shadow rays.
    if (EMITTERS > 0) {
        if (!alive_a) shadow_a.t_max = -1.0;
        if (!alive_b) shadow_b.t_max = -1.0;
        shadow_rays += (shadow_a.t_max > 0.0 ? 1u : 0u) + (shadow_b.t_max > 0.0 ? 1u : 0u);
        vec3 arrives_a = vec3(shadow_a.t_max > 0.0 ? 1.0 : 0.0);
        vec3 arrives_b = vec3(shadow_b.t_max > 0.0 ? 1.0 : 0.0);
        if (FILTERS) {
            for (int i = 0; i < 2; i++) {
                ShadowRay shadow_ray = shadow_a;
                if (i == 1) shadow_ray = shadow_b;
                vec3 arrives = shadow_ray_transmittance(shadow_ray);
                if (i == 0) arrives_a = arrives;
                if (i == 1) arrives_b = arrives;
            }
        } else {
            HitPair blocked = trace_pair(PairedRay(shadow_a.origin, shadow_a.to_light, shadow_a.source_face, 0.0, shadow_ray_t_max(shadow_a)),
                                         PairedRay(shadow_b.origin, shadow_b.to_light, shadow_b.source_face, 0.0, shadow_ray_t_max(shadow_b)),
                                         OPAQUE | FILTER, true);
            arrives_a *= blocked.a.triangle == NO_TRIANGLE ? unoccluded_transmittance(shadow_a) : vec3(0.0);
            arrives_b *= blocked.b.triangle == NO_TRIANGLE ? unoccluded_transmittance(shadow_b) : vec3(0.0);
        }
        if (alive_a) a.sum += shadow_a.contribution * arrives_a;
        if (alive_b) b.sum += shadow_b.contribution * arrives_b;
    }
}
#endif
