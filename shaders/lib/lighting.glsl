// Radiance that a surface sends to the eye: emitted, from punctual lights, and from the environment.
#ifndef LIGHTING_GLSL
#define LIGHTING_GLSL
#include "lib/encode.glsl"
#include "lib/environment.glsl"
#include "lib/punctual.glsl"
#include "lib/reflectance.glsl"
#include "lib/shadow.glsl"
#include "lib/snell.glsl"
#include "lib/surface.glsl"

layout(constant_id = 14) const uint LOCAL_LIGHTS = 0;       // point and spot lights after them; 0 where tiles list them
layout(constant_id = 15) const uint TILE_WORDS = 0;         // words of a tile's bit mask; 0 without lists
layout(constant_id = 16) const bool AMBIENT = false;        // irradiance of the environment on diffuse surfaces
layout(constant_id = 17) const bool REFLECTION = false;     // the prefiltered environment in specular ones
const uint TILE = 16;                                       // pixels a side

layout(set = 0, binding = 21, r32ui) readonly uniform uimageBuffer tile_lights;
layout(set = 0, binding = 23) uniform sampler2D prefiltered;

// Reflected radiance over irradiance below which a light with a shadow is not looked for, and not shown either: the far
// ends of lobes on polished surfaces, a ten-thousandth of what a grey one reflects.
const float FAINTEST_LOBE = 1.0 / 131072.0;

// Light `index` of the table on a surface, as far as it is visible from there.
vec3 light_on(Surface s, uint index) {
    PunctualLight light = punctual_light_at(index, s.p_rel);
    vec3 result = reflected(s, light.l) * light.arriving;
    if (SHADOWS != 0) {
        result *= terminator(s.n, s.n_triangle, light.l);
        bool wanted = largest(result) > FAINTEST_LOBE * largest(light.arriving);
        if (SHADOWS == SHADOW_MAP) {
            float share = map_visibility(s.p_bvh, s.n_triangle, light.to_light, index, largest_component(s.p_rel));
            return wanted ? result * share : vec3(0.0);
        }
        result *= visibility(s.p_bvh, s.n_triangle, s.v, s.face, s.media, light.to_light,
                             light.directional ? LARGEST : 1.0, wanted);
    }
    return result;
}

// The part of the lights that one dispatch goes through: indices of the table, and words of the tiles' masks.
struct LightRange {
    uint first;
    uint end;
    uint first_word;
    uint end_word;
};

// Loop heads after which no further light is begun.
layout(constant_id = 27) const uint LIGHT_BUDGET = 0xffffffffu;

vec3 punctual_light(Surface s, ivec2 pixel, uint tiles_across, LightRange range) {
    vec3 sum = vec3(0.0);
    if (DIRECTIONAL_LIGHTS + LOCAL_LIGHTS + TILE_WORDS == 0) return sum;
    // Lights of the tile as a bit mask, in ascending order whatever built it. Empty words are skipped in a loop of
    // their own: lavapipe goes through a loop's body at least once, and a light is a long body.
    int tile = int((uint(pixel.y) / TILE * tiles_across + uint(pixel.x) / TILE) * TILE_WORDS);
    uint next = range.first;
    uint word = range.first_word;
    uint bits = TILE_WORDS > 0 && word < range.end_word ? imageLoad(tile_lights, tile + int(word)).x : 0u;
    while (true) {
        loop_heads++;
        bool listed = next >= range.end;
        if (TILE_WORDS > 0) {
            loop_heads++;
            while (listed && bits == 0 && word + 1 < range.end_word) {
                loop_heads++;
                word++;
                bits = imageLoad(tile_lights, tile + int(word)).x;
            }
        }
        bool out_of_steps = loop_heads > LIGHT_BUDGET && !(listed && bits == 0);
        lights_cut_off += out_of_steps ? 1u : 0u;
        if (out_of_steps || (listed && bits == 0)) break;
        uint index = listed ? DIRECTIONAL_LIGHTS + word * 32 + uint(findLSB(bits)) : next;
        bits = listed ? bits & (bits - 1) : bits;
        next += listed ? 0 : 1;
        sum += light_on(s, index);
    }
    return sum;
}

// Level of the prefiltered map whose texels are 1/16 of the lobe: α = 16 / width (pass/prefilter.comp).
float prefiltered_level(float alpha) {
    float first = environment.width * alpha * 0.0625;
    return first >= 2.0 ? min(log2(first), environment.levels - 1.0) : first * 0.5;
}

vec3 prefiltered_radiance(vec3 direction, float alpha) {
    vec2 at = equirectangular_from_direction(into_environment(direction));
    return light_of_environment(textureLod(prefiltered, at, prefiltered_level(alpha)).rgb);
}

// Irradiance from nine spherical-harmonic coefficients.
vec3 environment_irradiance(vec3 n) {
    vec3 d = into_environment(n);
    vec3 e = environment.irradiance[0] * 0.282095;
    e += (environment.irradiance[1] * d.y + environment.irradiance[2] * d.z + environment.irradiance[3] * d.x) * 0.488603;
    e += (environment.irradiance[4] * (d.x * d.y) + environment.irradiance[5] * (d.y * d.z) + environment.irradiance[7] * (d.x * d.z)) * 1.092548;
    e += environment.irradiance[6] * (0.315392 * (3.0 * d.z * d.z - 1.0));
    e += environment.irradiance[8] * (0.546274 * (d.x * d.x - d.y * d.y));
    return light_of_environment(max(e, 0.0));
}

// Directional reflectance of the lobe: what the base sends to the eye of the light in the mirror direction (split sum,
// Karis 2013).
vec3 mirrored_by_base(Surface s) {
    vec2 ab = lobe_reflectance(s);
    return (s.f0 * ab.x + s.f90 * ab.y) * s.compensation;
}

float mirrored_by_coat(Surface s) {
    vec2 coat = reflectance_of_lobe(dot(s.n_coat, s.v), s.clearcoat_roughness);
    return s.clearcoat * (0.04 * coat.x + coat.y);
}

// Light from all around: irradiance on the diffuse part, the prefiltered map in the mirror direction on the specular
// part.
vec3 environment_light(Surface s) {
    vec3 r = reflect_ray(-s.v, s.n).R;
    vec2 ab = lobe_reflectance(s);
    vec3 result = vec3(0.0);
    if (AMBIENT) {
        float enters = 1.0 - largest(s.f0_dielectric * ab.x + s.f90_dielectric * ab.y);
        result += s.diffuse * diffuse_brdf(enters) * environment_irradiance(s.n);
    }
    if (REFLECTION && !s.base_traced) result += mirrored_by_base(s) * prefiltered_radiance(r, s.alpha);
    if (CLEARCOAT) {
        vec3 coat_r = reflect_ray(-s.v, s.n_coat).R;
        result *= under_coat(s);
        if (REFLECTION && !s.coat_traced) result += mirrored_by_coat(s) * prefiltered_radiance(coat_r, s.clearcoat_alpha);
    }
    return result * s.occlusion;
}

// Light from `range`, and with `all_around` what does not come from lights as well; of a surface that is compensated.
vec3 radiance_to_eye(Surface s, ivec2 pixel, uint tiles_across, LightRange range, bool all_around) {
    vec3 result = punctual_light(s, pixel, tiles_across, range);
    vec3 around = CLEARCOAT ? s.emissive * under_coat(s) : s.emissive;
    if (AMBIENT || REFLECTION) around += environment_light(s);
    result += all_around ? around : vec3(0.0);
    return s.unlit ? all_around ? s.base : vec3(0.0) : result;
}
#endif
