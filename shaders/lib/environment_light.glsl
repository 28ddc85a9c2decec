// Light of the environment on the layers of a surface, from its irradiance and from the radiance in its lobes' directions.
// Where to read: RTR 4, sections 10.5 and 10.6 (environment lighting, split sum). Assumes: a surface whose `lobe` is known.
#ifndef ENVIRONMENT_LIGHT_GLSL
#define ENVIRONMENT_LIGHT_GLSL
#include "lib/environment.glsl"
#include "lib/layers.glsl"

layout(constant) const bool AMBIENT = false;        // ambient light: the environment's irradiance on diffuse surfaces
layout(constant) const bool REFLECTION = false;     // the prefiltered environment in specular lobes

// What the layers of a surface make of the environment's light: radiance to the eye per irradiance, and per radiance that arrives in a
// lobe.
struct EnvironmentFactors {
    vec3 scattered;
    vec3 base_lobe;
    float coat_lobe;
    vec3 through; // radiance to the eye per irradiance from behind
};

EnvironmentFactors environment_factors(Surface s, LayerAlbedo albedo) {
    precise vec3 scattered = scattered_per_irradiance(s, albedo.base);
    EnvironmentFactors f = EnvironmentFactors(vec3(0.0), vec3(0.0), 0.0, vec3(0.0));
    float left = s.occlusion;
    if (CLEARCOAT) {
        left *= albedo.under_coat;
        if (REFLECTION && !s.coat_traced) f.coat_lobe = albedo.coat * s.occlusion;
    }
    precise vec3 scattered_here = scattered * left;
    if (AMBIENT) f.scattered = scattered_here;
    if (AMBIENT && DIFFUSE_TRANSMISSION) f.through = transmitted_per_irradiance(s, albedo.base) * left;
    if (REFLECTION && !s.base_traced) f.base_lobe = albedo.base.base * left;
    return f;
}

// Light on the diffuse base layer and on the lobes of extensions, from the viewer's side and from behind.
vec3 diffuse_environment_light(EnvironmentFactors f, vec3 irradiance, vec3 behind) {
    precise vec3 result = vec3(0.0);
    if (AMBIENT) result += f.scattered * irradiance;
    if (AMBIENT && DIFFUSE_TRANSMISSION) result += f.through * behind;
    return result;
}

// Narrow lobes that make up an anisotropic one.
const uint LOBE_PARTS = 16;

vec3 radiance_in_round_base_lobe(Surface s) {
    RoundLobe lobe = round_lobe(s.n, s.v, s.roughness, s.alpha, vec2(mean(f0_of(s)), f90_of(s)) * s.lobe);
    return prefiltered_radiance(lobe.direction, lobe.alpha);
}

// The radiance of the environment in the lobe of the base. An anisotropic lobe is the sum of round ones, of the α across it,
// around half vectors spread along its wide direction: variances add, so these have α² = α_t² − α_b² along and 0 across.
vec3 radiance_in_base_lobe(Surface s) {
    vec3 result = radiance_in_round_base_lobe(s);
    if (ANISOTROPY) {
        if (is_anisotropic(s)) {
            vec2 alphas = vec2(sqrt(max(s.alpha_along * s.alpha_along - s.alpha * s.alpha, 0.0)), SMALLEST_ALPHA);
            vec3 sum = vec3(0.0);
            float weights = 0.0;
            for (uint i = 0; i < LOBE_PARTS; i++) {
                vec3 r = reflect_ray(-s.v, anisotropic_half_vector(s, alphas, half_turn_point(i, LOBE_PARTS))).R;
                vec3 to = in_lobe_frame(s, r);
                float weight = to.z > 0.0 ? anisotropic_g2_over_g1(in_lobe_frame(s, s.v), to, base_alphas(s)) : 0.0;
                sum += weight * prefiltered_radiance(r, s.alpha);
                weights += weight;
            }
            result = weights > 0.0 ? sum / weights : result;
        }
    }
    return result;
}

vec3 radiance_in_coat_lobe(Surface s) {
    vec2 parts = vec2(COAT_F0, 1.0) * reflectance_of_lobe(dot(s.n_coat, s.v), s.clearcoat_roughness);
    RoundLobe lobe = round_lobe(s.n_coat, s.v, s.clearcoat_roughness, s.clearcoat_alpha, parts);
    return prefiltered_radiance(lobe.direction, lobe.alpha);
}

// Without visibility: the irradiance, and the prefiltered map in the mean directions of the lobes.
vec3 environment_light(Surface s, LayerAlbedo albedo) {
    EnvironmentFactors factors = environment_factors(s, albedo);
    vec3 irradiance = AMBIENT ? environment_irradiance(s.n) : vec3(0.0);
    vec3 behind = AMBIENT && DIFFUSE_TRANSMISSION ? environment_irradiance(-s.n) : vec3(0.0);
    vec3 result = diffuse_environment_light(factors, irradiance, behind);
    if (REFLECTION && !s.base_traced) result += factors.base_lobe * radiance_in_base_lobe(s);
    if (CLEARCOAT && REFLECTION && !s.coat_traced) result += factors.coat_lobe * radiance_in_coat_lobe(s);
    return result;
}
#endif
