// Ray-traced ambient occlusion: light of the environment on a surface, with the visibility of the environment.
// 1. Irradiance. Directions l are drawn from the environment's radiance and from the sphere, once for all pixels
//    (src/transport/sky_directions.rs), with weights w = L/p. Σ w cos θ V / Σ w cos θ is the share of the irradiance that
//    arrives; it multiplies the irradiance without occluders. The ratio is 1 where nothing occludes, whatever the
//    directions are, and neighbouring pixels have no noise between them.
// 2. Lobes. Rays sampled by the VNDF give the share of the lobe that sees the environment; it multiplies the prefiltered
//    radiance (split sum).
// 3. Interreflection. What occludes the share O of the directions is taken to face this surface, to have the same albedo ρ,
//    and to have the same share occluded by this surface, as inside a concavity: E = V E₀ + ρ O E', E' = (1 − O) E₀' + ρ O E.
// Where to read: RTR 4, section 11.3 (ambient occlusion, interreflections); Stewart and Langer 1997 (concavities).
// Assumes: bvh space, metres; a compensated surface.
#ifndef AMBIENT_OCCLUSION_GLSL
#define AMBIENT_OCCLUSION_GLSL
#include "lib/environment_light.glsl"
#include "lib/loops.glsl"
#include "lib/random.glsl"
#include "lib/shadow.glsl"
#include "share/sky_direction.glsl"

layout(constant) const uint OCCLUSION_RAYS = 1; // for each sample of a pixel
layout(constant) const uint LOBE_RAYS = 1;      // in each specular lobe; 0: lobes are not occluded

layout(pass, scalar) readonly buffer SkyDirections { SkyDirection sky_directions[]; };

// Events of the random numbers, after those of reflection and refraction. All pixels have the same numbers.
const uint BASE_LOBE_EVENT = 0x400u;
const uint COAT_LOBE_EVENT = 0x401u;

struct Seen {
    vec3 irradiance;         // share of the irradiance that arrives
    vec3 occluded_share;     // of the directions, by cosine and solid angle
    vec3 occluded_direction; // sum of the occluded directions
    vec3 base_lobe;          // share of each specular lobe that sees the environment, by the weights of its directions
    vec3 coat_lobe;
};

// One ray after the other, first for the irradiance, then in the lobe of the base, then in that of the coat: the code that
// traces exists once. Directions between the triangle's plane and that of the interpolated normal count nowhere: a smooth
// convex mesh does not occlude itself. An anisotropic lobe counts as a round one of the α across.
Seen seen_of_environment(Surface s) {
    vec3 seen = vec3(0.0);
    vec3 all = vec3(0.0);
    vec3 occluded = vec3(0.0);
    vec3 occluded_direction = vec3(0.0);
    float hemisphere = 0.0;
    vec3 seen_in_base = vec3(0.0);
    vec3 seen_in_coat = vec3(0.0);
    float all_in_base = 0.0;
    float all_in_coat = 0.0;
    const uint rays = OCCLUSION_RAYS + (REFLECTION ? LOBE_RAYS * (CLEARCOAT ? 2u : 1u) : 0u);
    for (uint i = 0; i < rays && loop_iterations < LOOP_BUDGET; i++) {
        bool in_lobe = REFLECTION && LOBE_RAYS > 0 && i >= OCCLUSION_RAYS;
        bool coat = CLEARCOAT && in_lobe && i >= OCCLUSION_RAYS + LOBE_RAYS;
        vec3 direction;
        vec3 weight;
        float projected;
        if (in_lobe) {
            if (coat ? s.coat_traced : s.base_traced) continue;
            uint index = trace_terms.sample_index * LOBE_RAYS + (i - OCCLUSION_RAYS) % LOBE_RAYS;
            vec3 n = coat ? s.n_coat : s.n;
            float alpha = coat ? s.clearcoat_alpha : s.alpha;
            uint event = coat ? COAT_LOBE_EVENT : BASE_LOBE_EVENT;
            vec3 h = half_vector(n, s.v, alpha, random_point(uvec2(0), event, trace_terms.seed, index));
            direction = reflect_ray(-s.v, h).R;
            projected = unshadowed(n, s.v, direction, s.n_triangle, alpha);
            weight = vec3(projected);
        } else {
            SkyDirection sky = sky_directions[trace_terms.sample_index * OCCLUSION_RAYS + i];
            direction = sky.direction;
            float cos_l = dot(s.n_triangle, direction) > 0.0 ? max(dot(s.n, direction), 0.0) : 0.0;
            weight = light_of_environment(sky.weight) * cos_l;
            projected = cos_l * sky.solid_angle;
        }
        vec3 visible = visibility(s.p_bvh, s.n_triangle, s.v, s.face, s.media, direction, LARGEST, projected > 0.0);
        if (coat) {
            seen_in_coat += weight * visible;
            all_in_coat += projected;
        } else if (in_lobe) {
            seen_in_base += weight * visible;
            all_in_base += projected;
        } else {
            seen += weight * visible;
            all += weight;
            hemisphere += projected;
            // The mean of zeros is 0; one minus the mean of ones may be 1e-7, where products and sums are fused.
            vec3 hidden = 1.0 - visible;
            occluded += projected * hidden;
            occluded_direction += direction * (projected * mean(hidden));
        }
    }
    Seen r;
    r.irradiance = mix(vec3(1.0), seen / max(all, vec3(1e-30)), greaterThan(all, vec3(0.0)));
    r.occluded_share = occluded / max(hemisphere, 1e-30);
    r.occluded_direction = occluded_direction;
    r.base_lobe = all_in_base > 0.0 ? seen_in_base / all_in_base : vec3(1.0);
    r.coat_lobe = all_in_coat > 0.0 ? seen_in_coat / all_in_coat : vec3(1.0);
    return r;
}

// Irradiance of a surface and of what occludes it, in this order or the other: of each the irradiance that arrives, `here`
// and `there`, and the share `given_back` of the other's. E = E₁ + q E' and E' = E₂ + q E, so E = (E₁ + q E₂)/(1 − q²). Here
// and below every step is precise: a driver's compiler turns x (1 − a) + y a into an interpolation of its own, in one of two
// ways, by what else stands in the program.
vec3 exchanged_irradiance(vec3 here, vec3 there, vec3 given_back) {
    precise vec3 kept = 1.0 - given_back * given_back;
    precise vec3 both = here + there * given_back;
    return both / kept;
}

// The radiance in a lobe of which the share `visible` sees the environment.
vec3 partly_occluded(vec3 open, vec3 beside, vec3 visible) {
    precise vec3 seen = open * visible;
    precise vec3 occluded = beside * (1.0 - visible);
    precise vec3 sum = seen + occluded;
    return sum;
}

vec3 occluded_environment_light(Surface s) {
    LayerAlbedo albedo = layer_albedo(s);
    // The albedo of diffuse reflection, by an irradiance of 1, and that of the lobes.
    precise vec3 diffuse = scattered_radiance(s, albedo.base, vec3(1.0)) * PI;
    precise vec3 all = diffuse + albedo.base.base;
    Seen seen = seen_of_environment(s);
    precise vec3 here = environment_irradiance(s.n) * seen.irradiance;
    // What occludes faces this surface, and is taken to be as open.
    float size2 = dot(seen.occluded_direction, seen.occluded_direction);
    precise vec3 there = environment_irradiance(size2 > 0.0 ? -seen.occluded_direction * inversesqrt(size2) : s.n) * (1.0 - seen.occluded_share);
    precise vec3 kept = min(all, 0.98);
    precise vec3 given_back = kept * seen.occluded_share;
    vec3 irradiance = exchanged_irradiance(here, there, given_back);
    // The radiance of what occludes.
    precise vec3 beside = kept * exchanged_irradiance(there, here, given_back) * INV_PI;
    vec3 mirrored = vec3(0.0);
    vec3 coat_mirrored = vec3(0.0);
    if (REFLECTION && !s.base_traced) mirrored = radiance_in_base_lobe(s);
    if (CLEARCOAT && REFLECTION && !s.coat_traced) coat_mirrored = prefiltered_radiance(reflect_ray(-s.v, s.n_coat).R, s.clearcoat_alpha);
    if (REFLECTION && LOBE_RAYS > 0) {
        if (!s.base_traced) mirrored = partly_occluded(mirrored, beside, seen.base_lobe);
        if (CLEARCOAT && !s.coat_traced) coat_mirrored = partly_occluded(coat_mirrored, beside, seen.coat_lobe);
    }
    return environment_light_of(s, albedo, irradiance, mirrored, coat_mirrored);
}
#endif
