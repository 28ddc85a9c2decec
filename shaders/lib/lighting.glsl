// Direct lighting of a surface: emission, lights with shadows, and the environment (ambient and split sum).
// Punctual lights are taken one by one; tiled light culling limits them to those of the pixel's tile (pass/tiles.comp).
// Emissive surfaces and lights with an area are sampled (next event estimation). Where to read: RTR 4, sections 9.8, 10.5
// and 20.3; pbrt 4, section 13.3. Assumes: world axes, positions relative to the eye, metres.
#ifndef LIGHTING_GLSL
#define LIGHTING_GLSL
#include "lib/ambient_occlusion.glsl"
#include "lib/emitters.glsl"
#include "lib/encode.glsl"
#include "lib/environment_light.glsl"
#include "lib/light_tile.glsl"
#include "lib/punctual.glsl"
#include "lib/layers.glsl"
#include "lib/shadow.glsl"

layout(constant) const uint LOCAL_LIGHTS = 0;       // point and spot lights after the directional ones; 0 where tiles list them
layout(constant) const uint TILE_WORDS = 0;         // 32-bit words of a tile's bit mask; 0 without tiled light culling

layout(pass, scalar) readonly buffer TileLights { uint tile_lights[]; };

// Some light has shadow rays: shadow maps are drawn from points, so light samples have rays beside them.
bool sends_shadow_rays() {
    return SHADOWS == SHADOW_RAY || (LIGHT_SAMPLES > 0 && SHADOWS == SHADOW_MAP);
}

// Ratio of reflected radiance to irradiance below which a shadowed light casts no shadow ray and adds nothing. It cuts the
// tails of lobes on polished surfaces: a grey surface reflects ten thousand times as much.
const float FAINTEST_LOBE = 1.0 / 131072.0;

// Screen-space reflection adds what the picture shows to the smooth lobes of the surfaces in sight.
layout(constant) const bool SCREEN_MIRRORS = false;

// Event of the random numbers of light samples, before the number of the surface: 0 the primary surface, then those that the
// pixel's rays meet, and from FIRST_FRAGMENT on the transparent fragments. Events of base reflection and of ambient
// occlusion are smaller, those of coats larger.
const uint LIGHT_EVENT = 0x800u;
const uint FIRST_FRAGMENT = 0x1000u;

// Light samples from which one is chosen; 1: it is the only one.
layout(constant) const uint LIGHT_CANDIDATES = 1;
// Event of the choice, beside that of the samples.
const uint CHOICE_EVENT = 0x40000000u;
// Part of the target that does not depend on the direction.
const float FROM_ANYWHERE = 0.1;

// What decides how much light a surface makes of a light sample: its diffuse layer, and one round lobe.
struct Receiver {
    vec3 n;         // unit normal
    vec3 v;         // unit vector to the viewer
    float diffuse;  // albedos
    float specular;
    float alpha;
};

// A lobe that a ray samples counts as none: light samples leave it out. The albedo of another one is taken for its reflectance at
// the viewer's angle, because some plans have no table of albedos.
Receiver receiver_of(Surface s) {
    float specular = largest(schlick(f0_of(s), f90_of(s), clamp(dot(s.n, s.v), 0.0, 1.0)));
    return Receiver(s.n, s.v, largest(s.diffuse), s.base_traced ? 0.0 : specular, max(s.alpha, 1e-3));
}

// Of a surface that a ray has met only its triangle counts: on GPUs the kernel that draws its sample has no more.
Receiver receiver_at_hit(vec3 n_triangle) {
    return Receiver(n_triangle, n_triangle, 1.0, 0.0, 1.0);
}

// About the radiance that the receiver makes of irradiance from the unit direction l, times π. It is nowhere 0: light from below, and
// what coats and other lobes make of it, has the right mean, too.
float target_at(Receiver r, vec3 l) {
    precise float diffuse = r.diffuse * max(dot(r.n, l), 0.0);
    precise float anywhere = FROM_ANYWHERE * (r.diffuse + r.specular) + 1e-3;
    precise float target = diffuse + anywhere;
    // The density of the directions of a GGX lobe, D cos θ_h / (4 v·h).
    precise vec3 sum = r.v + l;
    precise float length2 = max(dot(sum, sum), 1e-12);
    precise float to_middle = dot(r.n, sum);
    precise float cos2_h = to_middle * to_middle / length2;
    precise float spread = 1.0 - cos2_h * (1.0 - r.alpha * r.alpha);
    precise float density = r.alpha * r.alpha * to_middle / (2.0 * length2 * spread * spread);
    precise float lobe = r.specular * density;
    precise float whole = target + lobe;
    return dot(r.n, l) > 0.0 && to_middle > 0.0 ? whole : target;
}

// A light sample by next event estimation: one of LIGHT_SAMPLES for each sample of a pixel. `to_light` begins at `origin`,
// where the shadow ray does.
// With several candidates it is one of them (resampled importance sampling, Talbot et al. 2005). Each is drawn by its density
// p and has the weight w = p̂/p. One is chosen in proportion to w, and counts as if it were drawn by p̂/mean(w). The target p̂
// is about the light that the surface sends to the viewer without shadow.
LightSample light_sample(vec3 origin, Receiver receiver, uvec2 pixel, uint surface, uint i) {
    uint event = LIGHT_EVENT + surface;
    uint index = trace_terms.sample_index * LIGHT_SAMPLES + i;
    uint count = trace_terms.samples * LIGHT_SAMPLES;
    precise float u = 0.0;
    if (LIGHT_CANDIDATES > 1) u = unit_float(random_words(pixel, event | CHOICE_EVENT, trace_terms.seed, index, count).x);
    LightSample chosen = NO_LIGHT_SAMPLE;
    precise float weight = 0.0;
    precise float sum = 0.0;
    for (uint j = 0; j < LIGHT_CANDIDATES; j++) {
        uvec2 words = random_words(pixel, event, trace_terms.seed, index * LIGHT_CANDIDATES + j, count * LIGHT_CANDIDATES);
        LightSample drawn = sample_emitter(origin, choose_emitter(origin, words.x), words.y);
        if (LIGHT_CANDIDATES == 1) return drawn;
        precise float of_drawn = largest(drawn.arriving) * target_at(receiver, normalize(drawn.to_light));
        sum += of_drawn;
        // Weighted reservoir sampling (Chao 1982). What is left of the random number is uniform again. The first is chosen
        // whatever its share: on some devices the quotient of equal numbers is not 1.
        precise float share = sum > 0.0 ? of_drawn / sum : 1.0;
        bool is_chosen = j == 0 || u < share;
        precise float left = is_chosen ? u / share : (u - share) / (1.0 - share);
        u = left;
        if (is_chosen) {
            chosen = drawn;
            weight = of_drawn;
        }
    }
    precise float correction = weight > 0.0 ? sum / (weight * float(LIGHT_CANDIDATES)) : 0.0;
    chosen.arriving *= correction;
    return chosen;
}

layout(constant) const bool SAMPLED_APART = false; // another kernel has drawn the first light sample of the surface
// Gives it where it is needed, as the program has it: no register holds it while rays are traced.
LightSample drawn_apart();

// The surfaces are hits of rays: p_rel and p_bvh are the same point.
layout(constant) const bool LIT_AT_HITS = false;

// The layers without the lobes that find emissive surfaces themselves, by a ray or in the picture.
Layers without_mirrors(Layers b, uint surface) {
    bool on_screen = SCREEN_MIRRORS && (surface == 0 || surface == FIRST_FRAGMENT);
    bool is_round = !ANISOTROPY || !is_anisotropic(b.s);
    if (b.s.base_traced || (on_screen && is_round && b.s.roughness <= ROUGHEST_MIRROR)) b.base_apart = true;
    // What emits is seen behind: by the ray that goes on, or clear, in the picture.
    b.s.passes = vec3(0.0);
    if (CLEARCOAT && (b.s.coat_traced || (on_screen && b.s.clearcoat_roughness <= ROUGHEST_MIRROR))) {
        b.coat_delta = true;
        b.under = BRDF == BRDF_GGX_MULTI ? b.under : under_coat(b.s);
    }
    return b;
}

// Rays of ambient occlusion that the loop over lights traces too, last: the code that traces exists once in a kernel.
layout(constant) const uint SKY_RAYS = 0;
// What they have shown to the last surface.
SkyShown sky_shown = NOTHING_SHOWN;

// Radiance that light `index` of the table adds, with its shadow; where `is_sample`, that of a light sample. Where `is_sky`
// it is a ray of ambient occlusion, which adds to `sky_shown` instead.
vec3 light_on(Layers b, uint index, bool is_sample, bool is_sky, uvec2 pixel, uint surface) {
    Surface s = b.s;
    vec3 p_rel = LIT_AT_HITS ? found_anew(s.p_bvh, index) - trace_terms.bvh_from_rel : s.p_rel;
    PunctualLight light = punctual_light_at(is_sample || is_sky ? 0u : index, p_rel);
    if (LIGHT_SAMPLES > 0) {
        if (is_sample) {
            LightSample drawn;
            if (SAMPLED_APART && (LIGHT_SAMPLES == 1 || index == 0)) {
                drawn = drawn_apart();
            } else {
                Receiver receiver = receiver_at_hit(s.n_triangle);
                if (!LIT_AT_HITS) receiver = receiver_of(s);
                drawn = light_sample(ray_origin(s.p_bvh, s.n_triangle, s.v), receiver, pixel, surface, index);
            }
            // Samples without light are evaluated as well: with a selection here the plans of a scene and of everything
            // differed by roundings, in 153 pixels of study:etalon.
            light = PunctualLight(drawn.to_light, normalize(drawn.to_light), drawn.arriving / float(LIGHT_SAMPLES), false);
            if (EMISSIVE_TRIANGLES && drawn.pdf > 0.0) b = without_mirrors(b, surface);
        }
    }
    SkyRay sky;
    if (SKY_RAYS > 0) {
        sky = sky_ray(s, is_sky ? index : 0u);
        if (is_sky) light = PunctualLight(sky.sky.direction, sky.sky.direction, vec3(0.0), true);
    }
    vec3 through = vec3(0.0);
    if (DIFFUSE_TRANSMISSION) through = evaluate_diffuse_transmission(b, light.l).f_cos * light.arriving;
    // Rays of ambient occlusion choose their side themselves.
    bool from_behind = !(SKY_RAYS > 0 && is_sky) && passes_light_from(b.s, light.l);
    if (from_behind) b = seen_through(b);
    vec3 result = evaluate_reflection(b, from_behind ? reflect(light.l, s.n) : light.l).f_cos * light.arriving;
    if (DIFFUSE_TRANSMISSION && largest(through) > 0.0) {
        result = from_behind ? result + through : through;
        from_behind = true;
    }
    if ((DIFFUSE_TRANSMISSION || ROUGH_TRANSMISSION) && from_behind) {
        // Seen from the light, the surface is turned over.
        vec3 front = ray_origin(s.p_bvh, s.n_triangle, s.v);
        s.n = -s.n;
        s.n_triangle = -s.n_triangle;
        s.v = reflect(s.v, s.n);
        if (LIGHT_SAMPLES > 0 && is_sample) light.to_light += front - ray_origin(s.p_bvh, s.n_triangle, s.v);
    }
    if (SKY_RAYS > 0 && is_sky) {
        s.v = free_side(s, sky);
        s.n_triangle *= sky.side;
    }
    if (SHADOWS != 0 || SKY_RAYS > 0) {
        if (SHADOWS != 0) result *= terminator(s.n, s.n_triangle, light.l);
        // NaN is wanted too: the film counts it.
        bool wanted = SHADOWS != 0 && !(largest(result) <= FAINTEST_LOBE * largest(light.arriving));
        if (SKY_RAYS > 0) wanted = is_sky ? sky.cos_l > 0.0 : wanted;
        if (SHADOWS == SHADOW_MAP && !(LIGHT_SAMPLES > 0 && is_sample) && !(SKY_RAYS > 0 && is_sky)) {
            float share = map_visibility(s.p_bvh, s.n_triangle, light.to_light, index, largest_component(p_rel));
            return wanted ? result * share : vec3(0.0);
        }
        // From p_bvh, the point on the triangle: p_rel may come from depth (lib/primary.glsl).
        vec3 to_light = light.to_light;
        if (!LIT_AT_HITS && !light.directional && !is_sample) to_light += p_rel - (s.p_bvh - trace_terms.bvh_from_rel);
        vec3 visible = visibility(s.p_bvh, s.n_triangle, s.v, s.face, s.media, to_light, light.directional ? LARGEST : 1.0, SKY_RAYS > 0 && is_sky, wanted);
        if (SKY_RAYS > 0) {
            if (is_sky) show(sky_shown, sky, visible);
        }
        if (SHADOWS != 0) result *= visible;
    }
    return result;
}

// The lights of one dispatch: indices in the order directional lights, light samples, point and spot lights, rays of ambient
// occlusion; and words of the tiles' bit masks.
struct LightRange {
    uint first;
    uint end;
    uint first_word;
    uint end_word;
};

// What waits while shadow rays are traced (VECTORS_WAIT).
const uint WAITING_LIGHT = 0;   // of the surface so far
const uint WAITING_DIFFUSE = 1; // the albedo of its diffuse base layer
shared vec3 light_waiting[VECTORS_WAIT ? 2u * TRACING_LANES : 1u];

// Loop iterations after which no further light is started.
layout(constant) const uint LIGHT_BUDGET = 0xffffffffu;

// Light samples that no iteration was left for, where no other light is missing.
uint samples_cut_off = 0;

// The light so far, `sum`, with that of the lights in `range`. `surface` is the number of the surface, for the random numbers.
vec3 with_lights(vec3 sum, Layers b, ivec2 pixel, uint surface, uint tiles_across, LightRange range) {
    if (DIRECTIONAL_LIGHTS + LIGHT_SAMPLES + LOCAL_LIGHTS + SKY_RAYS + TILE_WORDS == 0) return sum;
    if (SKY_RAYS > 0) sky_shown = NOTHING_SHOWN;
    if (VECTORS_WAIT) {
        light_waiting[waiting_word(WAITING_LIGHT, 0)] = sum;
        light_waiting[waiting_word(WAITING_DIFFUSE, 0)] = b.s.diffuse;
    }
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
        bool is_sky = SKY_RAYS > 0 && !listed && next >= DIRECTIONAL_LIGHTS + LIGHT_SAMPLES + LOCAL_LIGHTS;
        bool only_samples = is_sky || (LOCAL_LIGHTS + TILE_WORDS == 0 && next >= DIRECTIONAL_LIGHTS);
        lights_cut_off += out_of_steps && !only_samples ? 1u : 0u;
        samples_cut_off += out_of_steps && only_samples ? 1u : 0u;
        if (out_of_steps || (listed && bits == 0)) break;
        bool is_sample = !listed && next >= DIRECTIONAL_LIGHTS && next < DIRECTIONAL_LIGHTS + LIGHT_SAMPLES;
        uint in_group = is_sample ? next - DIRECTIONAL_LIGHTS : next < DIRECTIONAL_LIGHTS ? next : next - LIGHT_SAMPLES;
        if (is_sky) in_group = next - (DIRECTIONAL_LIGHTS + LIGHT_SAMPLES + LOCAL_LIGHTS);
        uint index = listed ? DIRECTIONAL_LIGHTS + word * 32 + uint(findLSB(bits)) : in_group;
        bits = listed ? bits & (bits - 1) : bits;
        next += listed ? 0 : 1;
        b = in_turn(b, index);
        if (VECTORS_WAIT) b.s.diffuse = light_waiting[waiting_word(WAITING_DIFFUSE, index)];
        vec3 light = light_on(b, index, is_sample, is_sky, uvec2(pixel), surface);
        if (VECTORS_WAIT) {
            light_waiting[waiting_word(WAITING_LIGHT, index)] += light;
        } else {
            sum += light;
        }
    }
    return VECTORS_WAIT ? light_waiting[waiting_word(WAITING_LIGHT, next)] : sum;
}

// The environment's light is added apart, with visibility (lib/ambient_occlusion.glsl).
layout(constant) const bool ENVIRONMENT_APART = false;

// Radiance to the eye of a surface whose `lobe` is known, from the lights in `range`; with `all_around` also emission and
// environment.
vec3 radiance_to_eye(Surface s, ivec2 pixel, uint surface, uint tiles_across, LightRange range, bool all_around) {
    LayerAlbedo albedo = layer_albedo(s, albedo_of_base(s));
    // Before the lights: afterwards the albedos would take registers while shadow rays are traced.
    vec3 around = s.emissive * under_coat(s);
    if ((AMBIENT || REFLECTION) && !ENVIRONMENT_APART) around += environment_light(s, albedo);
    if (s.unlit) around = s.base;
    if (!all_around) around = vec3(0.0);
    if (s.unlit) range = LightRange(0, 0, 0, 0);
    return with_lights(around, layers_of(s, albedo), pixel, surface, tiles_across, range);
}
#endif
