// Ray-traced ambient occlusion: light of the environment on a surface, with the visibility of the environment.
// 1. Irradiance. Directions l are drawn from the environment's radiance and from the sphere, once for all pixels
//    (src/transport/sky_directions.rs), with weights w = L/p. Σ w cos θ V / Σ w cos θ is the share of the irradiance that
//    arrives; it multiplies the irradiance without occluders. The ratio is 1 where nothing occludes, whatever the
//    directions are, and neighbouring pixels have no noise between them.
// 2. Lobes. Rays sampled by the VNDF give the share of the lobe that sees the environment; it multiplies the prefiltered
//    radiance (split sum).
// 3. Interreflection. An occluded direction sees another surface. It is taken to have the same albedo ρ and the same
//    irradiance E as this one, as inside a concavity: E = V E₀ + (1 − V) ρ E, so E = V E₀ / (1 − ρ (1 − V)).
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

vec3 visibility_of_environment(Surface s, vec3 direction, bool wanted) {
    return visibility(s.p_bvh, s.n_triangle, s.v, s.face, s.media, direction, LARGEST, wanted);
}

struct VisibleIrradiance {
    vec3 share;    // of the irradiance that arrives
    vec3 occluded; // sum of the occluded directions, weighted by their cosines
};

// Directions between the triangle's plane and that of the interpolated normal count
// nowhere: a smooth convex mesh does not occlude itself.
VisibleIrradiance visible_irradiance(Surface s) {
    vec3 seen = vec3(0.0);
    vec3 all = vec3(0.0);
    vec3 occluded = vec3(0.0);
    for (uint i = 0; i < OCCLUSION_RAYS && loop_iterations < LOOP_BUDGET; i++) {
        SkyDirection sky = sky_directions[trace_terms.sample_index * OCCLUSION_RAYS + i];
        float cos_l = dot(s.n_triangle, sky.direction) > 0.0 ? max(dot(s.n, sky.direction), 0.0) : 0.0;
        vec3 weight = light_of_environment(sky.weight) * cos_l;
        vec3 visible = visibility_of_environment(s, sky.direction, cos_l > 0.0);
        seen += weight * visible;
        all += weight;
        occluded += sky.direction * (cos_l * (1.0 - mean(visible)));
    }
    return VisibleIrradiance(mix(vec3(1.0), seen / max(all, vec3(1e-30)), greaterThan(all, vec3(0.0))), occluded);
}

// Share of a specular lobe that sees the environment, by the weights of its directions. An anisotropic lobe counts as a
// round one of the α across.
vec3 visible_lobe(Surface s, vec3 n, float alpha, uint event) {
    vec3 seen = vec3(0.0);
    float all = 0.0;
    for (uint i = 0; i < LOBE_RAYS && loop_iterations < LOOP_BUDGET; i++) {
        uint index = trace_terms.sample_index * LOBE_RAYS + i;
        vec3 h = half_vector(n, s.v, alpha, random_point(uvec2(0), event, trace_terms.seed, index));
        vec3 r = reflect_ray(-s.v, h).R;
        float weight = unshadowed(n, s.v, r, s.n_triangle, alpha);
        seen += weight * visibility_of_environment(s, r, weight > 0.0);
        all += weight;
    }
    return all > 0.0 ? seen / all : vec3(1.0);
}

// Irradiance E of a surface and E' of what occludes it, by an exchange between the two: E = V E₀ + q E' and E' = V E₀' + q E
// with q = ρ (1 − V). E₀ and E₀' are the irradiance without occluders. Here and
// below every step is precise: a driver's compiler turns x (1 − a) + y a into an interpolation of its own, in one of two
// ways, by what else stands in the program.
vec3 exchanged_irradiance(vec3 irradiance, vec3 other, vec3 visible, vec3 albedo) {
    precise vec3 occluded = 1.0 - visible;
    precise vec3 given_back = min(albedo, 0.98) * occluded;
    precise vec3 kept = 1.0 - given_back * given_back;
    precise vec3 both = irradiance + other * given_back;
    precise vec3 arriving = both * visible;
    return arriving / kept;
}

// The radiance in a lobe of which the share `visible` sees the environment.
vec3 partly_occluded(vec3 open, vec3 beside, vec3 visible) {
    precise vec3 seen = open * visible;
    precise vec3 occluded = beside * (1.0 - visible);
    precise vec3 sum = seen + occluded;
    return sum;
}

vec3 occluded_environment_light(Surface s) {
    BaseAlbedo albedo = albedo_of_base(s, lobe_reflectance(s));
    // The albedo of diffuse reflection, by an irradiance of 1, and that of the lobes.
    precise vec3 diffuse = scattered_radiance(s, albedo, vec3(1.0)) * PI;
    precise vec3 all = diffuse + albedo.base;
    vec3 here = environment_irradiance(s.n);
    VisibleIrradiance seen = visible_irradiance(s);
    float occluded = dot(seen.occluded, seen.occluded);
    // What occludes faces this surface.
    vec3 there = environment_irradiance(occluded > 0.0 ? -seen.occluded * inversesqrt(occluded) : s.n);
    vec3 irradiance = exchanged_irradiance(here, there, seen.share, all);
    // The radiance of what occludes.
    precise vec3 given_back = min(all, 0.98) * exchanged_irradiance(there, here, seen.share, all);
    precise vec3 beside = given_back * INV_PI;
    vec3 mirrored = vec3(0.0);
    vec3 coat_mirrored = vec3(0.0);
    if (REFLECTION && !s.base_traced) mirrored = radiance_in_base_lobe(s);
    if (CLEARCOAT && REFLECTION && !s.coat_traced) coat_mirrored = prefiltered_radiance(reflect_ray(-s.v, s.n_coat).R, s.clearcoat_alpha);
    if (REFLECTION && LOBE_RAYS > 0) {
        // First the base, then the coat, in a loop: the code that traces exists once.
        for (uint i = 0; i < (CLEARCOAT ? 2u : 1u); i++) {
            bool coat = CLEARCOAT && i == 1;
            if (coat ? !s.coat_traced : !s.base_traced) {
                vec3 visible = visible_lobe(s, coat ? s.n_coat : s.n, coat ? s.clearcoat_alpha : s.alpha, coat ? COAT_LOBE_EVENT : BASE_LOBE_EVENT);
                if (coat) coat_mirrored = partly_occluded(coat_mirrored, beside, visible);
                else mirrored = partly_occluded(mirrored, beside, visible);
            }
        }
    }
    return environment_light_of(s, albedo, irradiance, mirrored, coat_mirrored);
}
#endif
