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

vec3 visibility_of_environment(Surface s, vec3 direction, bool wanted) {
    return visibility(s.p_bvh, s.n_triangle, s.v, s.face, s.media, direction, LARGEST, wanted);
}

struct VisibleIrradiance {
    vec3 share;              // of the irradiance that arrives
    vec3 occluded_share;     // of the directions, by cosine and solid angle
    vec3 occluded_direction; // sum of the occluded directions
};

// Directions between the triangle's plane and that of the interpolated normal count nowhere: a smooth convex mesh does not
// occlude itself.
VisibleIrradiance visible_irradiance(Surface s) {
    vec3 seen = vec3(0.0);
    vec3 all = vec3(0.0);
    vec3 occluded = vec3(0.0);
    vec3 occluded_direction = vec3(0.0);
    float hemisphere = 0.0;
    // Apart from the rays of the lobes: in one loop with them lavapipe evaluates for every ray what either needs, and the pass takes 3
    // to 6 % longer.
    for (uint i = 0; i < OCCLUSION_RAYS && loop_iterations < LOOP_BUDGET; i++) {
        SkyDirection sky = sky_directions[trace_terms.sample_index * OCCLUSION_RAYS + i];
        float cos_l = dot(s.n_triangle, sky.direction) > 0.0 ? max(dot(s.n, sky.direction), 0.0) : 0.0;
        vec3 weight = light_of_environment(sky.weight) * cos_l;
        vec3 visible = visibility_of_environment(s, sky.direction, cos_l > 0.0);
        seen += weight * visible;
        all += weight;
        float projected = cos_l * sky.solid_angle;
        hemisphere += projected;
        // The mean of zeros is 0; one minus the mean of ones may be 1e-7, where products and sums are fused.
        vec3 hidden = 1.0 - visible;
        occluded += projected * hidden;
        occluded_direction += sky.direction * (projected * mean(hidden));
    }
    VisibleIrradiance r;
    r.share = mix(vec3(1.0), seen / max(all, vec3(1e-30)), greaterThan(all, vec3(0.0)));
    r.occluded_share = occluded / max(hemisphere, 1e-30);
    r.occluded_direction = occluded_direction;
    return r;
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

// All that needs the layers is evaluated before rays are traced, and light is summed as soon as it is known: what is kept until later
// takes registers from the rays.
vec3 occluded_environment_light(Surface s) {
    EnvironmentFactors factors = environment_factors(s, layer_albedo(s, albedo_of_base(s)));
    precise vec3 kept = min(factors.albedo, 0.98);
    vec3 mirrored = vec3(0.0);
    vec3 coat_mirrored = vec3(0.0);
    if (REFLECTION && !s.base_traced) mirrored = radiance_in_base_lobe(s);
    if (CLEARCOAT && REFLECTION && !s.coat_traced) coat_mirrored = radiance_in_coat_lobe(s);
    VisibleIrradiance seen = visible_irradiance(s);
    precise vec3 here = environment_irradiance(s.n) * seen.share;
    // What occludes faces this surface, and is taken to be as open.
    float size2 = dot(seen.occluded_direction, seen.occluded_direction);
    precise vec3 there = environment_irradiance(size2 > 0.0 ? -seen.occluded_direction * inversesqrt(size2) : s.n) * (1.0 - seen.occluded_share);
    precise vec3 given_back = kept * seen.occluded_share;
    vec3 result = diffuse_environment_light(factors, exchanged_irradiance(here, there, given_back));
    if (!REFLECTION) return result;
    // The radiance of what occludes.
    precise vec3 beside = kept * exchanged_irradiance(there, here, given_back) * INV_PI;
    if (LOBE_RAYS > 0) {
        // First the base, then the coat, in a loop: the code that traces lobes exists once.
        for (uint i = 0; i < (CLEARCOAT ? 2u : 1u); i++) {
            bool coat = CLEARCOAT && i == 1;
            if (coat ? !s.coat_traced : !s.base_traced) {
                vec3 visible = visible_lobe(s, coat ? s.n_coat : s.n, coat ? s.clearcoat_alpha : s.alpha, coat ? COAT_LOBE_EVENT : BASE_LOBE_EVENT);
                if (coat) coat_mirrored = partly_occluded(coat_mirrored, beside, visible);
                else mirrored = partly_occluded(mirrored, beside, visible);
            }
        }
    }
    result += factors.base_lobe * mirrored;
    if (CLEARCOAT) result += factors.coat_lobe * coat_mirrored;
    return result;
}
#endif
