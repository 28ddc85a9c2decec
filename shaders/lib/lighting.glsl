// Direct lighting of a surface: emission, punctual lights with shadows, and the environment (ambient and split sum).
// Tiled light culling limits the lights to those of the pixel's tile (pass/tiles.comp). Where to read: RTR 4, sections 9.8,
// 10.5 and 20.3. Assumes: world axes, positions relative to the eye, metres.
#ifndef LIGHTING_GLSL
#define LIGHTING_GLSL
#include "lib/encode.glsl"
#include "lib/environment_light.glsl"
#include "lib/light_tile.glsl"
#include "lib/punctual.glsl"
#include "lib/layers.glsl"
#include "lib/shadow.glsl"

layout(constant) const uint LOCAL_LIGHTS = 0;       // point and spot lights after the directional ones; 0 where tiles list them
layout(constant) const uint TILE_WORDS = 0;         // 32-bit words of a tile's bit mask; 0 without tiled light culling

layout(pass, scalar) readonly buffer TileLights { uint tile_lights[]; };

// Ratio of reflected radiance to irradiance below which a shadowed light casts no shadow ray and adds nothing. It cuts the
// tails of lobes on polished surfaces: a grey surface reflects ten thousand times as much.
const float FAINTEST_LOBE = 1.0 / 131072.0;

// Radiance that light `index` of the table adds, with its shadow.
vec3 light_on(Layers b, uint index) {
    Surface s = b.s;
    PunctualLight light = punctual_light_at(index, s.p_rel);
    vec3 result = evaluate_reflection(b, light.l).f_cos * light.arriving;
    if (DIFFUSE_TRANSMISSION) {
        // Light from behind: seen from there, the surface is turned over.
        vec3 through = evaluate_diffuse_transmission(b, light.l).f_cos * light.arriving;
        if (largest(through) > 0.0) {
            result = through;
            s.n = -s.n;
            s.n_triangle = -s.n_triangle;
            s.v = reflect(s.v, s.n);
        }
    }
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

// The lights of one dispatch: indices of the table, and words of the tiles' bit masks.
struct LightRange {
    uint first;
    uint end;
    uint first_word;
    uint end_word;
};

// Loop iterations after which no further light is started.
layout(constant) const uint LIGHT_BUDGET = 0xffffffffu;

vec3 punctual_light(Layers b, ivec2 pixel, uint tiles_across, LightRange range) {
    vec3 sum = vec3(0.0);
    if (DIRECTIONAL_LIGHTS + LOCAL_LIGHTS + TILE_WORDS == 0) return sum;
    // The lights of the tile are a bit mask, read in ascending order. A loop of its own skips empty words: lavapipe runs
    // the body of a loop at least once, and the body for a light is long.
    int tile = int((uint(pixel.y) / TILE * tiles_across + uint(pixel.x) / TILE) * TILE_WORDS);
    uint next = range.first;
    uint word = range.first_word;
    uint bits = TILE_WORDS > 0 && word < range.end_word ? tile_lights[tile + int(word)] : 0u;
    while (true) {
        bool listed = next >= range.end;
        if (TILE_WORDS > 0) {
            while (listed && bits == 0 && word + 1 < range.end_word) {
                word++;
                bits = tile_lights[tile + int(word)];
            }
        }
        bool out_of_steps = loop_iterations > LIGHT_BUDGET && !(listed && bits == 0);
        lights_cut_off += out_of_steps ? 1u : 0u;
        if (out_of_steps || (listed && bits == 0)) break;
        uint index = listed ? DIRECTIONAL_LIGHTS + word * 32 + uint(findLSB(bits)) : next;
        bits = listed ? bits & (bits - 1) : bits;
        next += listed ? 0 : 1;
        sum += light_on(b, index);
    }
    return sum;
}

// Radiance to the eye of a compensated surface, from the lights in `range`; with `all_around` also emission and
// environment.
vec3 radiance_to_eye(Surface s, ivec2 pixel, uint tiles_across, LightRange range, bool all_around) {
    vec3 result = punctual_light(layers_of(s), pixel, tiles_across, range);
    vec3 around = CLEARCOAT ? s.emissive * under_coat(s) : s.emissive;
    if (AMBIENT || REFLECTION) around += environment_light(s);
    result += all_around ? around : vec3(0.0);
    return s.unlit ? all_around ? s.base : vec3(0.0) : result;
}
#endif
