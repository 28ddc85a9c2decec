// Radiance that a surface sends to the eye: emitted, from punctual lights, and from the environment.
#ifndef LIGHTING_GLSL
#define LIGHTING_GLSL
#include "lib/encode.glsl"
#include "lib/light.glsl"
#include "lib/snell.glsl"
#include "lib/surface.glsl"
#include "share/environment.glsl"

layout(constant_id = 13) const uint DIRECTIONAL_LIGHTS = 0; // lights [0, this) of the table
layout(constant_id = 14) const uint LOCAL_LIGHTS = 0;       // point and spot lights after them; 0 where tiles list them
layout(constant_id = 15) const uint TILE_WORDS = 0;         // words of a tile's bit mask; 0 without lists
layout(constant_id = 16) const bool AMBIENT = false;        // irradiance of the environment on diffuse surfaces
layout(constant_id = 17) const bool REFLECTION = false;     // the prefiltered environment in specular ones
const uint TILE = 16;                                       // pixels a side

// Four texels per light: position (or direction to it), unused | colour, 1 / range² | axis, spot scale | spot offset.
layout(set = 0, binding = 20, rgba32f) readonly uniform imageBuffer lights;
layout(set = 0, binding = 21, r32ui) readonly uniform uimageBuffer tile_lights;
layout(scalar, set = 0, binding = 22) uniform Environment { EnvironmentTerms environment; };
layout(set = 0, binding = 23) uniform sampler2D prefiltered;
layout(set = 0, binding = 24) uniform sampler2D reflectance;

vec3 local_light(Surface s, uint index) {
    vec4 place = imageLoad(lights, int(index * 4));
    vec4 color = imageLoad(lights, int(index * 4 + 1));
    vec4 axis = imageLoad(lights, int(index * 4 + 2));
    float spot_offset = imageLoad(lights, int(index * 4 + 3)).x;
    vec3 to_light = place.xyz - s.p_rel;
    float r2 = dot(to_light, to_light);
    vec3 l = to_light * inversesqrt(max(r2, 1e-30));
    float falloff = point_falloff(r2, color.w) * spot_share(-dot(axis.xyz, l), axis.w, spot_offset);
    return reflected(s, l) * color.rgb * falloff;
}

// Evaluations of loop heads so far: lavapipe ends all loops of an invocation in silence after 65,535 of them.
uint loop_heads = 0;

vec3 punctual_light(Surface s, ivec2 pixel, uint tiles_across) {
    vec3 sum = vec3(0.0);
    loop_heads += DIRECTIONAL_LIGHTS + LOCAL_LIGHTS + 2;
    for (uint i = 0; i < DIRECTIONAL_LIGHTS; i++) {
        sum += reflected(s, imageLoad(lights, int(i * 4)).xyz) * imageLoad(lights, int(i * 4 + 1)).rgb;
    }
    for (uint i = 0; i < LOCAL_LIGHTS; i++) sum += local_light(s, DIRECTIONAL_LIGHTS + i);
    if (TILE_WORDS > 0) {
        // Lights of the tile as a bit mask, in ascending order whatever built it. Empty words are skipped in a loop of
        // their own: lavapipe goes through a loop's body at least once, and a light is a long body.
        int tile = int((uint(pixel.y) / TILE * tiles_across + uint(pixel.x) / TILE) * TILE_WORDS);
        uint word = 0;
        uint bits = imageLoad(tile_lights, tile).x;
        while (true) {
            loop_heads += 2;
            while (bits == 0 && word + 1 < TILE_WORDS) {
                loop_heads++;
                word++;
                bits = imageLoad(tile_lights, tile + int(word)).x;
            }
            if (bits == 0) break;
            uint bit = uint(findLSB(bits));
            bits &= bits - 1;
            sum += local_light(s, DIRECTIONAL_LIGHTS + word * 32 + bit);
        }
    }
    return sum;
}

vec3 into_environment(vec3 d) {
    return turned(d, environment.cos_rotation, environment.sin_rotation);
}

// Level of the prefiltered map whose texels are 1/16 of the lobe: α = 16 / width (pass/prefilter.comp).
float prefiltered_level(float alpha) {
    float first = environment.width * alpha * 0.0625;
    return first >= 2.0 ? min(log2(first), environment.levels - 1.0) : first * 0.5;
}

vec3 prefiltered_radiance(vec3 direction, float alpha) {
    vec2 at = equirectangular_from_direction(into_environment(direction));
    return textureLod(prefiltered, at, prefiltered_level(alpha)).rgb * environment.intensity;
}

// Irradiance from nine spherical-harmonic coefficients.
vec3 environment_irradiance(vec3 n) {
    vec3 d = into_environment(n);
    vec3 e = environment.irradiance[0] * 0.282095;
    e += (environment.irradiance[1] * d.y + environment.irradiance[2] * d.z + environment.irradiance[3] * d.x) * 0.488603;
    e += (environment.irradiance[4] * (d.x * d.y) + environment.irradiance[5] * (d.y * d.z) + environment.irradiance[7] * (d.x * d.z)) * 1.092548;
    e += environment.irradiance[6] * (0.315392 * (3.0 * d.z * d.z - 1.0));
    e += environment.irradiance[8] * (0.546274 * (d.x * d.x - d.y * d.y));
    return max(e, 0.0) * environment.intensity;
}

// Light from all around: irradiance on the diffuse part, the prefiltered map in the mirror direction times the
// directional reflectance of the lobe (split sum, Karis 2013) on the specular part.
vec3 environment_light(Surface s) {
    float cos_v = clamp(dot(s.n, s.v), 0.0, 1.0);
    vec3 r = reflect_ray(-s.v, s.n).R;
    vec2 ab = textureLod(reflectance, vec2(cos_v, s.roughness), 0.0).rg;
    vec3 result = vec3(0.0);
    if (AMBIENT) {
        float enters = 1.0 - largest(s.f0_dielectric * ab.x + s.f90_dielectric * ab.y);
        result += s.diffuse * (INV_PI * enters) * environment_irradiance(s.n);
    }
    if (REFLECTION) result += (s.f0 * ab.x + s.f90 * ab.y) * s.compensation * prefiltered_radiance(r, s.alpha);
    if (CLEARCOAT) {
        vec3 coat_r = reflect_ray(-s.v, s.n_coat).R;
        vec2 coat_at = vec2(clamp(dot(s.n_coat, s.v), 0.0, 1.0), s.clearcoat_roughness);
        vec2 coat = textureLod(reflectance, coat_at, 0.0).rg;
        result *= under_coat(s);
        if (REFLECTION) result += s.clearcoat * (0.04 * coat.x + coat.y) * prefiltered_radiance(coat_r, s.clearcoat_alpha);
    }
    return result * s.occlusion;
}

vec3 radiance_to_eye(Surface s, ivec2 pixel, uint tiles_across) {
    if (BRDF == 3) {
        vec2 ab = textureLod(reflectance, vec2(clamp(dot(s.n, s.v), 0.0, 1.0), s.roughness), 0.0).rg;
        s.compensation = ggx_compensation(s.f0, ab.x + ab.y);
    }
    vec3 result = punctual_light(s, pixel, tiles_across);
    if (AMBIENT || REFLECTION) result += environment_light(s);
    result += CLEARCOAT ? s.emissive * under_coat(s) : s.emissive;
    return s.unlit ? s.base : result;
}
#endif
