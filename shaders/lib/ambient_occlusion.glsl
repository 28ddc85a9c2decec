// Ray-traced ambient occlusion: light of the environment on a surface, with visibility, and of what occludes it.
// 1. Irradiance. Directions l are the middles of regions of the environment: a median cut
//    (src/transport/sky_directions.rs), with the regions' power as weights w. Σ w cos θ V / Σ w cos θ is the share of the
//    irradiance that arrives; it multiplies the irradiance without occluders. The ratio is 1 where nothing occludes,
//    whatever the directions are. The pixels of a small square have different ones (interleaved sampling): with the same
//    in all pixels, what occludes throws a faint hard shadow for each direction.
// 2. Lobes. Rays sampled by the VNDF give the share of the environment's light that arrives in the lobe; it multiplies the
//    prefiltered radiance (split sum).
// 3. Interreflection. What occludes sends the light of lamps and of the environment: a radiosity B that the host has found for
//    the whole scene, by place and direction (src/transport/occluders.rs). With O the share that is occluded,
//    E = V E₀ + O B.
// 4. Light from behind, which a surface transmits diffusely, in the same way with the environment's power for shares: without
//    an environment there is none.
// Where to read: RTR 4, section 11.3 (ambient occlusion, interreflections); Goral et al. 1984 (radiosity); Keller and
// Heidrich 2001 (interleaved sampling).
// Assumes: bvh space, metres; a surface whose `lobe` is known.
#ifndef AMBIENT_OCCLUSION_GLSL
#define AMBIENT_OCCLUSION_GLSL
#include "lib/environment_light.glsl"
#include "lib/loops.glsl"
#include "lib/random.glsl"
#include "lib/shadow.glsl"
#include "share/sky_direction.glsl"

layout(constant) const uint OCCLUSION_RAYS = 1;    // of a surface, for each sample of a pixel
layout(constant) const uint SAMPLE_DIRECTIONS = 1; // in all lists: those of primary surfaces, then those of others
layout(constant) const uint FIRST_DIRECTION = 0;   // of the surface's
layout(constant) const uint PATTERN_SIDE = 1;      // of the square of pixels with different directions: 1, 2 or 4
layout(constant) const uint LOBE_RAYS = 1;         // in each specular lobe; 0: lobes are not occluded

layout(scene, scalar) readonly buffer SkyDirections { SkyDirection sky_directions[]; };

// Events of the random numbers, after those of reflection and refraction. All pixels have the same numbers in their lobes.
const uint BASE_LOBE_EVENT = 0x400u;
const uint COAT_LOBE_EVENT = 0x401u;
const uint LIST_EVENT = 0x402u;

// What the directions so far have shown: sums that are shares at the end.
struct SkyShown {
    vec3 seen;             // light that arrives
    vec3 all;              // and without occluders
    float hemisphere;      // by cosine and solid angle
    float occluded;        // of it
    vec3 occluders;        // part of the occluders' radiosity that depends on direction
    vec3 seen_behind;      // on the other side, where the surface transmits diffusely
    vec3 all_behind;
};
const SkyShown NOTHING_SHOWN = SkyShown(vec3(0.0), vec3(0.0), 0.0, 0.0, vec3(0.0), vec3(0.0), vec3(0.0));

// One of the directions, as a surface has it.
struct SkyRay {
    SkyDirection sky;
    float side;  // 1 the viewer's, -1 the other one
    float cos_l; // 0 where it is not wanted
};

// Which of the lists of directions the surfaces of the pixel have: programs with such rays set it. No argument of the functions
// below, for glslang would need more than 24 GB (lib/arithmetic.glsl).
uint sky_list = 0;

// Each square has them in an order of its own: with one order for all a mesh would show in half shadows.
uint list_of(uvec2 pixel) {
    uvec2 square = pixel / PATTERN_SIDE;
    uvec2 place = pixel % PATTERN_SIDE;
    uint order = hash(uvec3(square, LIST_EVENT));
    return (place.y * PATTERN_SIDE + place.x) ^ (order & (PATTERN_SIDE * PATTERN_SIDE - 1u));
}

// Direction `i` of a surface. Those between the triangle's plane and that of the interpolated normal count nowhere: a smooth
// convex mesh does not occlude itself.
SkyRay sky_ray(Surface s, uint i) {
    SkyRay r;
    r.sky = sky_directions[trace_terms.sample_index * SAMPLE_DIRECTIONS + FIRST_DIRECTION + sky_list * OCCLUSION_RAYS + i];
    bool shines_through = DIFFUSE_TRANSMISSION && largest(s.diffuse_through) > 0.0;
    r.side = shines_through && dot(s.n_triangle, r.sky.direction) < 0.0 ? -1.0 : 1.0;
    r.cos_l = !s.unlit && dot(s.n_triangle, r.sky.direction) * r.side > 0.0 ? max(dot(s.n, r.sky.direction) * r.side, 0.0) : 0.0;
    return r;
}

// On which side the ray leaves the surface.
vec3 free_side(Surface s, SkyRay r) {
    return DIFFUSE_TRANSMISSION && r.side < 0.0 ? reflect(s.v, s.n_triangle) : s.v;
}

// m v: a matrix product is not precise, whatever holds its result.
vec3 by_axes(mat3 m, vec3 v) {
    precise vec3 x = m[0] * v[0];
    precise vec3 y = m[1] * v[1];
    precise vec3 z = m[2] * v[2];
    precise vec3 sum = x + y + z;
    return sum;
}

// The ambient cube of the radiosity of occluders, for the mean squares of the positive and negative components of directions. Here
// and below every step is precise: a driver's compiler turns x (1 − a) + y a into an interpolation of its own, in one of two
// ways, by what else stands in the program.
vec3 ambient_cube(vec3 along, vec3 against) {
    precise vec3 by_along = by_axes(trace_terms.occluder_radiosity.along, along);
    precise vec3 by_against = by_axes(trace_terms.occluder_radiosity.against, against);
    precise vec3 sum = by_along + by_against;
    return sum;
}

// In direction d, times its weight.
vec3 ambient_cube(vec3 d, float weight) {
    vec3 positive = max(d, 0.0);
    vec3 negative = min(d, 0.0);
    precise vec3 along = positive * positive;
    precise vec3 against = negative * negative;
    precise vec3 weighted = ambient_cube(along, against) * weight;
    return weighted;
}

void show(inout SkyShown shown, SkyRay r, vec3 visible) {
    vec3 weight = light_of_environment(r.sky.weight) * r.cos_l;
    float projected = r.cos_l * r.sky.solid_angle;
    if (DIFFUSE_TRANSMISSION && r.side < 0.0) {
        shown.seen_behind += weight * visible;
        shown.all_behind += weight;
        weight = vec3(0.0);
        projected = 0.0;
    }
    shown.seen += weight * visible;
    shown.all += weight;
    shown.hemisphere += projected;
    // The mean of zeros is 0; one minus the mean of ones may be 1e-7, where products and sums are fused.
    vec3 hidden = 1.0 - visible;
    precise float occluded = projected * mean(hidden);
    shown.occluded += occluded;
    shown.occluders += ambient_cube(r.sky.direction, occluded);
}

// Apart from the rays of the lobes: in one loop with them lavapipe evaluates for every ray what either needs, and the pass
// takes 3 to 6 % longer.
SkyShown shown_to(Surface s) {
    SkyShown shown = NOTHING_SHOWN;
    for (uint i = 0; i < OCCLUSION_RAYS && loop_iterations < LOOP_BUDGET; i++) {
        SkyRay r = sky_ray(s, i);
        vec3 n = s.n_triangle * r.side;
        vec3 visible = visibility(s.p_bvh, n, free_side(s, r), s.face, s.media, r.sky.direction, LARGEST, true, r.cos_l > 0.0);
        show(shown, r, visible);
    }
    return shown;
}

vec3 share_of(vec3 seen, vec3 all) {
    return mix(vec3(1.0), seen / max(all, vec3(1e-30)), greaterThan(all, vec3(0.0)));
}

// Radiosity of what occludes the share `share` of what a surface at p has around it; `by_direction` is the mean of the ambient cube over
// those directions.
vec3 occluder_radiosity(vec3 p, vec3 by_direction, float share) {
    precise vec3 by_share = trace_terms.occluder_radiosity.by_share * share;
    precise vec3 by_place = by_axes(trace_terms.occluder_radiosity.by_place, p);
    precise vec3 radiosity = by_place + by_share + by_direction;
    return light_of_rgb(max(radiosity, 0.0));
}

// What the directions of a specular lobe have shown to it.
struct LobeShown {
    vec3 open;    // share of the environment's light that arrives
    float hidden; // share of the lobe that is occluded
    vec3 beside;  // radiance of what occludes
};

// The directions have the lobe's weights. Their light is that of the environment in half as wide a lobe around each: with few
// directions the whole lobe is covered (filtered importance sampling, Křivánek and Colbert 2008). An anisotropic lobe counts as a round
// one of the α across.
LobeShown lobe_shown(Surface s, vec3 n, float alpha, uint event) {
    vec3 seen = vec3(0.0);
    vec3 all_light = vec3(0.0);
    vec3 occluders = vec3(0.0);
    float hidden = 0.0;
    float all = 0.0;
    for (uint i = 0; i < LOBE_RAYS && loop_iterations < LOOP_BUDGET; i++) {
        uint index = trace_terms.sample_index * LOBE_RAYS + i;
        // Else the frames that sampling needs would be kept while rays are traced: 16 registers on AMD.
        vec3 around = found_anew(n, i);
        vec3 h = half_vector(around, s.v, alpha, random_point(uvec2(0), event, trace_terms.seed, index, 1));
        vec3 r = reflect_ray(-s.v, h).R;
        float weight = unshadowed(n, s.v, r, s.n_triangle, alpha);
        vec3 visible = visibility(s.p_bvh, s.n_triangle, s.v, s.face, s.media, r, LARGEST, true, weight > 0.0 && !s.unlit);
        vec3 light = prefiltered_radiance(r, 0.5 * alpha) * weight;
        seen += light * visible;
        all_light += light;
        precise float more = weight * (1.0 - mean(visible));
        hidden += more;
        occluders += ambient_cube(r, more);
        all += weight;
    }
    precise float share = hidden / max(all, 1e-30);
    precise vec3 by_direction = occluders / max(hidden, 1e-30);
    vec3 beside = occluder_radiosity(s.p_bvh, by_direction, share) * INV_PI;
    return LobeShown(share_of(seen, all_light), share, beside);
}

// Irradiance from what occludes on the viewer's side.
vec3 irradiance_of_occluders(Surface s, SkyShown shown) {
    precise float share = shown.occluded / max(shown.hemisphere, 1e-30);
    precise vec3 by_direction = shown.occluders / max(shown.occluded, 1e-30);
    precise vec3 irradiance = occluder_radiosity(s.p_bvh, by_direction, share) * share;
    return irradiance;
}

// All directions around −n are taken to be occluded evenly: by the cosine their squares are (1 + n²)/4 for each axis, of which
// about (1 − n)/2 are of positive components.
vec3 radiosity_behind(Surface s, vec3 shut) {
    precise vec3 squares = (1.0 + s.n * s.n) * 0.125;
    precise vec3 along = squares * (1.0 - s.n);
    precise vec3 against = squares * (1.0 + s.n);
    return occluder_radiosity(s.p_bvh, ambient_cube(along, against), mean(shut));
}

// The radiance in a lobe that would be `open` without occluders.
vec3 partly_occluded(vec3 open, LobeShown shown) {
    precise vec3 seen = open * shown.open;
    precise vec3 occluded = shown.beside * shown.hidden;
    precise vec3 sum = seen + occluded;
    return sum;
}

// Radiance to the eye of the light that the directions have shown to a surface, but for its lobes.
vec3 occluded_light(Surface s, EnvironmentFactors factors, SkyShown shown) {
    precise vec3 here = environment_irradiance(s.n) * share_of(shown.seen, shown.all);
    precise vec3 irradiance = here + irradiance_of_occluders(s, shown);
    precise vec3 behind = vec3(0.0);
    if (DIFFUSE_TRANSMISSION) {
        vec3 open = share_of(shown.seen_behind, shown.all_behind);
        precise vec3 shut = 1.0 - open;
        behind = environment_irradiance(-s.n) * open + shut * radiosity_behind(s, shut);
    }
    return diffuse_environment_light(factors, irradiance, behind);
}

// All that needs the layers is evaluated before rays are traced, and light is summed as soon as it is known: what is kept until later
// takes registers from the rays.
vec3 occluded_environment_light(Surface s) {
    EnvironmentFactors factors = environment_factors(s, layer_albedo(s, albedo_of_base(s)));
    vec3 mirrored = vec3(0.0);
    vec3 coat_mirrored = vec3(0.0);
    if (REFLECTION && !s.base_traced) mirrored = radiance_in_base_lobe(s);
    if (CLEARCOAT && REFLECTION && !s.coat_traced) coat_mirrored = radiance_in_coat_lobe(s);
    vec3 result = occluded_light(s, factors, shown_to(s));
    if (!REFLECTION) return result;
    if (LOBE_RAYS > 0) {
        // First the base, then the coat, in a loop: the code that traces lobes exists once.
        for (uint i = 0; i < (CLEARCOAT ? 2u : 1u); i++) {
            bool coat = CLEARCOAT && i == 1;
            if (coat ? !s.coat_traced : !s.base_traced) {
                LobeShown shown = lobe_shown(s, coat ? s.n_coat : s.n, coat ? s.clearcoat_alpha : s.alpha, coat ? COAT_LOBE_EVENT : BASE_LOBE_EVENT);
                if (coat) coat_mirrored = partly_occluded(coat_mirrored, shown);
                else mirrored = partly_occluded(mirrored, shown);
            }
        }
    }
    result += factors.base_lobe * mirrored;
    if (CLEARCOAT) result += factors.coat_lobe * coat_mirrored;
    return result;
}

// What the layers of a surface that a ray meets make of the environment, known before its own rays are traced: the lobes see
// the whole environment.
struct LayersAtHit {
    EnvironmentFactors factors;
    vec3 mirrored; // radiance to the eye of the lobes
};

LayersAtHit layers_at_hit(Surface s) {
    EnvironmentFactors factors = environment_factors(s, layer_albedo(s, albedo_of_base(s)));
    precise vec3 mirrored = vec3(0.0);
    if (REFLECTION && !s.base_traced) mirrored = factors.base_lobe * radiance_in_base_lobe(s);
    if (CLEARCOAT && REFLECTION && !s.coat_traced) mirrored += factors.coat_lobe * radiance_in_coat_lobe(s);
    return LayersAtHit(factors, mirrored);
}

vec3 environment_light_at_hit(Surface s, LayersAtHit layers, SkyShown shown) {
    precise vec3 result = occluded_light(s, layers.factors, shown) + layers.mirrored;
    return s.unlit ? vec3(0.0) : result;
}
#endif
