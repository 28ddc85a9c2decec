// Light sampling: emissive triangles and the lights of the table, with their densities (lecture R2–R4).
// One emitter is chosen by a CDF over powers, then a point on it. The CDF is in 32-bit fixed point: a random 32-bit word is
// looked up by binary search, and its position inside the bin becomes the next random number. The environment, which is an
// emitter of path tracing alone, is in lib/light_sampling.glsl.
// With the light hierarchy the emitters that have a place share the last bin. The descent from its root divides the bin
// between two children in proportion to their importance at the shaded point, again and again.
// Where to read: pbrt 4, section 12.6 (light sampling) and appendix A (piecewise constant distributions); Conty Estevez and
// Kulla 2018 (light hierarchy); docs/decisions/paths.md.
// Assumes: points in bvh space, metres; densities per solid angle.
#ifndef EMITTERS_GLSL
#define EMITTERS_GLSL
#include "lib/encode.glsl"
#include "lib/hit.glsl"
#include "lib/punctual.glsl"
#include "lib/random.glsl"
#include "share/emitters.glsl"

layout(constant) const uint EMITTERS = 0;
layout(constant) const uint EMITTER_SEARCH_STEPS = 0;           // binary-search steps over all emitters
layout(constant) const bool PUNCTUAL_EMITTERS = false;   // some emitter is a light of the table
layout(constant) const bool AREA_EMITTERS = false;     // some light of the table is an analytic area light
layout(constant) const bool EMISSIVE_TRIANGLES = false;  // some emitter is an emissive triangle
layout(constant) const bool LIGHT_HIERARCHY = false;     // emitters with a place are chosen by their importance
layout(constant) const uint LIGHT_NODES = 0;             // texel of the hierarchy's root, from the first emitter on
layout(constant) const uint LIGHT_SAMPLES = 0;           // light samples (shadow rays) of each surface

// The tables follow the triangles in their buffer: every pass that sends rays has room for it among its storage images.
uvec4 emitter_texel(uint index, int texel) {
    return imageLoad(bvh_triangles, int(trace_terms.first_emitter + index) + texel);
}
// @texels Emitter emitter_at(emitter_texel)
uvec4 light_node_texel(uint index, int texel) {
    return imageLoad(bvh_triangles, int(trace_terms.first_emitter + LIGHT_NODES + 2u * index) + texel);
}
// @texels LightNode light_node_at(light_node_texel)

// A light sample: light that may arrive at a point from one point on a light.
struct LightSample {
    vec3 to_light; // from the shaded point; a unit vector to a light at infinity
    float t_max;   // end of the shadow ray in units of to_light: 1, or LARGEST
    vec3 arriving; // radiance over density; of punctual lights irradiance perpendicular to to_light over probability
    float pdf;     // per solid angle; 0 for punctual (delta) lights, which BSDF sampling cannot hit
};
const LightSample NO_LIGHT_SAMPLE = LightSample(vec3(0.0), -1.0, vec3(0.0), 0.0);

// Position of a word inside its bin [first, next), in [0, 1): a new uniform number. A bin of size 0 is the only one and
// spans all words.
float remapped_in_bin(uint word, uint first, uint next) {
    uint size = next - first;
    float place = size == 0u ? float(word) * (1.0 / 4294967296.0) : float(word - first) / float(size);
    return min(place, 0.999999940395355);
}

// Probability of a bin: its size over 2^32.
float bin_probability(uint first, uint next) {
    return next == first ? 1.0 : float(next - first) * (1.0 / 4294967296.0);
}

// Twice the area of a triangle, times the unit normal of its front.
vec3 doubled_area_of(uint triangle, out vec3 a, out vec3 ab, out vec3 ac) {
    BvhTriangle t = triangle_at(triangle);
    a = t.a;
    ab = t.b - t.a;
    ac = t.c - t.a;
    return doubled_area(ab, ac);
}

// Radiance that a triangle emits at these barycentric coordinates.
vec3 emission_at(uint triangle, float u, float v) {
    uint material = hit_material(triangle) & MATERIAL_OF_TRIANGLE;
    vec3 radiance = material_emissive(material);
    if ((HIT_TEXTURES & (1u << SLOT_EMISSIVE)) != 0) {
        HitPoint point = hit_point_of(Hit(0.0, triangle, u, v), vec3(0.0), vec3(0.0));
        radiance *= hit_texture_or_white(material, SLOT_EMISSIVE, point.uvs, 0.0).rgb;
    }
    if (SPECTRAL && (material_flags(material) & MATERIAL_EMISSIVE_RGB) != 0) radiance = light_of_rgb(radiance);
    return radiance;
}

float node_importance(LightNode node, vec3 p) {
    vec2 cosines = unpackHalf2x16(node.cosines);
    bool two_sided = (node.link & LIGHT_TWO_SIDED) != 0;
    return light_importance(p - node.centre, node.radius, unit_from_octahedral(unpackSnorm2x16(node.axis)), cosines.x, cosines.y, two_sided, node.intensity);
}

struct HierarchyChoice {
    uint emitter;
    uint first; // its bin in the CDF, a part of the bin of the hierarchy
    uint size;  // 0: no light from the hierarchy reaches the point
};

// Descends the light hierarchy to the emitter of a random word; where `trail` is not 0, to the emitter at its end. The bins
// of both are the same function of the point, so light sampling and the density of a triangle that a path hits agree.
HierarchyChoice descend_light_hierarchy(vec3 p, uint word, uint trail, bool wanted) {
    bool follows = trail != 0;
    HierarchyChoice r;
    r.first = emitter_at(EMITTERS - 1).first;
    // Where the hierarchy has all words, the last one counts as outside: sizes fit 32 bits.
    r.size = r.first == 0u ? 0xffffffffu : 0u - r.first;
    uint link = wanted ? light_node_at(0).link : LIGHT_LEAF;
    // At most 31 steps: src/transport/light_hierarchy.rs, MOST_DEPTH.
    while ((link & LIGHT_LEAF) == 0 && r.size > 0) {
        LightNode one = light_node_at(link & LIGHT_INDEX);
        LightNode other = light_node_at((link & LIGHT_INDEX) + 1u);
        float of_one = node_importance(one, p);
        float of_other = node_importance(other, p);
        // A child that may light the point keeps at least one word of two or more.
        float share = of_one / max(of_one + of_other, 1e-37);
        uint split = max(uint(min(share * float(r.size), 4294967040.0)), of_one > 0.0 ? 1u : 0u);
        uint of_first = of_other > 0.0 ? min(split, r.size - 1u) : of_one > 0.0 ? r.size : 0u;
        bool second = follows ? (trail & 1u) != 0 : word - r.first >= of_first;
        r.first += second ? of_first : 0u;
        r.size = second ? (of_other > 0.0 ? r.size - of_first : 0u) : of_first;
        link = second ? other.link : one.link;
        trail >>= 1;
    }
    r.emitter = link & LIGHT_INDEX;
    return r;
}

// Density per area of light sampling on a triangle, as seen from a point; 0 where the triangle is no emitter.
float light_pdf_area(uint triangle, vec3 from, bool wanted) {
    uint picked = triangle_at(triangle).picked;
    float pdf = uintBitsToFloat(picked);
    if (LIGHT_HIERARCHY) {
        bool is_emitter = wanted && picked != 0;
        HierarchyChoice choice = descend_light_hierarchy(from, 0, picked, is_emitter);
        vec3 a, ab, ac;
        vec3 doubled = doubled_area_of(triangle, a, ab, ac);
        pdf = is_emitter && choice.size > 0 ? bin_probability(choice.first, choice.first + choice.size) * 2.0 / vector_length(doubled) : 0.0;
    }
    return pdf;
}

struct EmitterChoice {
    Emitter emitter;
    float probability;
    float x; // uniform random number for the point on it
};

// Chooses an emitter for a point in bvh space: binary search in the CDF over powers, then the light hierarchy.
EmitterChoice choose_emitter(vec3 p, uint word) {
    uint found = 0;
    for (uint step = EMITTER_SEARCH_STEPS; step > 0; step--) {
        uint next = found + (1u << (step - 1));
        uint first = emitter_at(min(next, EMITTERS - 1)).first;
        found = next < EMITTERS && first <= word ? next : found;
    }
    EmitterChoice r;
    r.emitter = emitter_at(found);
    uint next_first = found + 1 < EMITTERS ? emitter_at(found + 1).first : 0u;
    r.probability = r.emitter.probability;
    r.x = remapped_in_bin(word, r.emitter.first, next_first);
    if (LIGHT_HIERARCHY) {
        bool by_place = found == EMITTERS - 1;
        HierarchyChoice choice = descend_light_hierarchy(p, word, 0, by_place);
        if (by_place) {
            r.emitter = emitter_at(choice.emitter);
            r.emitter.kind = choice.size > 0 ? r.emitter.kind : EMITTER_NONE;
            r.probability = bin_probability(choice.first, choice.first + choice.size);
            r.x = remapped_in_bin(word, choice.first, choice.first + choice.size);
        }
    }
    return r;
}

// A light sample on a chosen emitter, for a point at `origin` in bvh space; `word` is the second random number. None, with
// `arriving` 0, where the emitter is the environment.
LightSample sample_emitter(vec3 origin, EmitterChoice choice, uint word) {
    LightSample r = LightSample(vec3(0.0, 1.0, 0.0), -1.0, vec3(0.0), 0.0);
    uint kind = choice.emitter.kind & EMITTER_KIND;
    // 1. A punctual light, or a point on an analytic area light.
    if (PUNCTUAL_EMITTERS) {
        if (kind == EMITTER_PUNCTUAL) {
            vec3 p_rel = origin - trace_terms.bvh_from_rel;
            PunctualLight light = AREA_EMITTERS ? shaped_light_at(choice.emitter.place, p_rel, vec2(choice.x, unit_float(word)))
                : punctual_light_at(choice.emitter.place, p_rel);
            r = LightSample(light.directional ? light.l : light.to_light, light.directional ? LARGEST : 1.0,
                            light.arriving / choice.probability, 0.0);
        }
    }
    // 2. A point on an emissive triangle.
    if (EMISSIVE_TRIANGLES) {
        if (kind == EMITTER_TRIANGLE) {
            // Low-distortion map from the unit square to a triangle (Heitz 2019): it folds along the diagonal.
            float y = unit_float(word);
            float x = choice.x;
            vec2 w = y > x ? vec2(0.5 * x, y - 0.5 * x) : vec2(x - 0.5 * y, 0.5 * y);
            vec3 a, ab, ac;
            vec3 doubled = doubled_area_of(choice.emitter.place, a, ab, ac);
            float size = vector_length(doubled);
            vec3 n = doubled / size;
            vec3 p = a + w.x * ab + w.y * ac;
            vec3 to_light = p - origin;
            float side = dot(n, to_light) < 0.0 ? 1.0 : -1.0;
            bool shows = side > 0.0 || (choice.emitter.kind & EMITTER_TWO_SIDED) != 0;
            // The end of the shadow ray lies off the triangle by `offset`, so that the triangle does not occlude itself.
            to_light += n * (side * trace_terms.offset);
            float r2 = dot(to_light, to_light);
            float cos_light = -side * dot(n, to_light) * inversesqrt(r2);
            float pdf = density_per_solid_angle(choice.probability * 2.0 / size, r2, cos_light);
            bool lights = shows && r2 > 0.0 && cos_light > 0.0 && pdf <= LARGEST;
            vec3 radiance = emission_at(choice.emitter.place, w.x, w.y);
            r = LightSample(to_light, 1.0, lights ? radiance / pdf : vec3(0.0), lights ? pdf : 0.0);
        }
    }
    return r;
}
#endif
