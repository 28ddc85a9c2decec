// Light sampling: punctual lights, emissive triangles and the environment, with their densities (lecture R2–R4).
// One emitter is chosen by a CDF over powers, then a point or direction on it. Each CDF is in 32-bit fixed point: a random
// 32-bit word is looked up by binary search, and its position inside the bin becomes the next random number. The
// environment has a marginal CDF over rows and one conditional CDF over columns for each row.
// With the light hierarchy the emitters that have a place share the last bin. The descent from its root divides the bin
// between two children in proportion to their importance at the shaded point, again and again.
// Where to read: pbrt 4, section 12.6 (light sampling) and appendix A (piecewise constant distributions); Conty Estevez and
// Kulla 2018 (light hierarchy); docs/decisions/paths.md.
// Assumes: points in bvh space, metres; densities per solid angle.
#ifndef EMITTERS_GLSL
#define EMITTERS_GLSL
#include "lib/encode.glsl"
#include "lib/environment.glsl"
#include "lib/hit.glsl"
#include "lib/punctual.glsl"
#include "lib/random.glsl"
#include "share/emitters.glsl"

layout(constant) const uint EMITTERS = 0;
layout(constant) const uint EMITTER_SEARCH_STEPS = 0;           // binary-search steps over all emitters
layout(constant) const bool PUNCTUAL_EMITTERS = false;   // some emitter is a light of the table
layout(constant) const bool AREA_EMITTERS = false;     // some light of the table is an analytic area light
layout(constant) const bool EMISSIVE_TRIANGLES = false;  // some emitter is an emissive triangle
layout(constant) const bool SAMPLED_ENVIRONMENT = false;        // the environment is an emitter
layout(constant) const bool LIGHT_HIERARCHY = false;     // emitters with a place are chosen by their importance
layout(constant) const uint LIGHT_NODES = 0;             // texel of the hierarchy's root, behind the emitters
layout(constant) const uint CDF_COLUMNS = 0;             // columns of the environment's CDF
layout(constant) const uint CDF_ROWS = 0;
layout(constant) const uint CDF_SEARCH_STEPS = 0;               // binary-search steps in a row, or over the rows

layout(paths, rgba32ui) readonly uniform uimageBuffer emitters;
// @texels Emitter emitter_at(emitters)
uvec4 light_node_texel(uint index, int texel) {
    return imageLoad(emitters, int(LIGHT_NODES + 2u * index) + texel);
}
// @texels LightNode light_node_at(light_node_texel)
// Lower ends of the bins: the marginal CDF over rows; then, row by row, the conditional CDF over columns.
layout(paths, r32ui) readonly uniform uimageBuffer environment_cdf;

// A light sample: light that may arrive at a point from one point on a light.
struct LightSample {
    vec3 to_light; // from the shaded point; a unit vector to a light at infinity
    float t_max;   // end of the shadow ray in units of to_light: 1, or LARGEST
    vec3 arriving; // radiance over density; of punctual lights irradiance perpendicular to to_light over probability
    float pdf;     // per solid angle; 0 for punctual (delta) lights, which BSDF sampling cannot hit
};

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

// Binary search for the bin that holds a word, in a CDF of `count` entries from `base` on.
uint search_environment_cdf(uint base, uint count, uint word) {
    uint found = 0;
    for (uint step = CDF_SEARCH_STEPS; step > 0; step--) {
        uint next = found + (1u << (step - 1));
        uint first = imageLoad(environment_cdf, int(base + min(next, count - 1))).x;
        found = next < count && first <= word ? next : found;
    }
    return found;
}

uint environment_cdf_at(uint base, uint count, uint i) {
    return i < count ? imageLoad(environment_cdf, int(base + i)).x : 0u;
}

// Density per solid angle of a texel of the environment's CDF; sin_theta is the sine of its polar angle.
float environment_texel_pdf(float p_row, float p_column, float sin_theta) {
    return p_row * p_column * float(CDF_ROWS * CDF_COLUMNS) / (2.0 * PI * PI * max(sin_theta, 1e-6));
}

// Density, among all light samples, of a direction in world axes.
float environment_pdf(vec3 direction) {
    if (!SAMPLED_ENVIRONMENT) return 0.0;
    vec3 d = into_environment(direction);
    vec2 at = equirectangular_from_direction(d);
    uint row = min(uint(max(at.y, 0.0) * float(CDF_ROWS)), CDF_ROWS - 1);
    uint column = min(uint(max(at.x, 0.0) * float(CDF_COLUMNS)), CDF_COLUMNS - 1);
    uint columns = CDF_ROWS + row * CDF_COLUMNS;
    float p_row = bin_probability(environment_cdf_at(0, CDF_ROWS, row), environment_cdf_at(0, CDF_ROWS, row + 1));
    float p_column = bin_probability(environment_cdf_at(columns, CDF_COLUMNS, column), environment_cdf_at(columns, CDF_COLUMNS, column + 1));
    // The environment is the first emitter.
    float picked = emitter_at(0).probability;
    return picked * environment_texel_pdf(p_row, p_column, sqrt(d.x * d.x + d.z * d.z));
}

struct EnvironmentSample {
    vec3 direction;
    float pdf;
};

EnvironmentSample sample_environment(uint word_x, uint word_y) {
    uint row = search_environment_cdf(0, CDF_ROWS, word_y);
    uint row_first = environment_cdf_at(0, CDF_ROWS, row);
    uint row_next = environment_cdf_at(0, CDF_ROWS, row + 1);
    uint columns = CDF_ROWS + row * CDF_COLUMNS;
    uint column = search_environment_cdf(columns, CDF_COLUMNS, word_x);
    uint first = environment_cdf_at(columns, CDF_COLUMNS, column);
    uint next = environment_cdf_at(columns, CDF_COLUMNS, column + 1);
    float u = (float(column) + remapped_in_bin(word_x, first, next)) / float(CDF_COLUMNS);
    float v = (float(row) + remapped_in_bin(word_y, row_first, row_next)) / float(CDF_ROWS);
    vec3 d = direction_from_equirectangular(vec2(u, v));
    float across = sqrt(d.x * d.x + d.z * d.z);
    float pdf = environment_texel_pdf(bin_probability(row_first, row_next), bin_probability(first, next), across);
    return EnvironmentSample(turned(d, environment.cos_rotation, -environment.sin_rotation), pdf);
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
        radiance *= hit_texture_or(material, SLOT_EMISSIVE, point.uvs, 0.0, vec4(1.0)).rgb;
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

// Draws one light sample for a point at `origin` in bvh space. For the environment `arriving` is 1 over the density: the
// caller multiplies by the environment's radiance.
LightSample sample_light(vec3 origin, uvec2 words) {
    LightSample r = LightSample(vec3(0.0, 1.0, 0.0), -1.0, vec3(0.0), 0.0);
    // 1. Choose an emitter: binary search in the CDF over powers.
    uint found = 0;
    for (uint step = EMITTER_SEARCH_STEPS; step > 0; step--) {
        uint next = found + (1u << (step - 1));
        uint first = emitter_at(min(next, EMITTERS - 1)).first;
        found = next < EMITTERS && first <= words.x ? next : found;
    }
    Emitter emitter = emitter_at(found);
    uint next_first = found + 1 < EMITTERS ? emitter_at(found + 1).first : 0u;
    float probability = emitter.probability;
    float x = remapped_in_bin(words.x, emitter.first, next_first);
    if (LIGHT_HIERARCHY) {
        bool by_place = found == EMITTERS - 1;
        HierarchyChoice choice = descend_light_hierarchy(origin, words.x, 0, by_place);
        if (by_place) {
            emitter = emitter_at(choice.emitter);
            emitter.kind = choice.size > 0 ? emitter.kind : EMITTER_NONE;
            probability = bin_probability(choice.first, choice.first + choice.size);
            x = remapped_in_bin(words.x, choice.first, choice.first + choice.size);
        }
    }
    uint kind = emitter.kind & EMITTER_KIND;
    // 2a. A punctual light, or a point on an analytic area light.
    if (PUNCTUAL_EMITTERS) {
        if (kind == EMITTER_PUNCTUAL) {
            vec3 p_rel = origin - trace_terms.bvh_from_rel;
            PunctualLight light = AREA_EMITTERS ? shaped_light_at(emitter.place, p_rel, vec2(x, unit_float(words.y)))
                : punctual_light_at(emitter.place, p_rel);
            r = LightSample(light.directional ? light.l : light.to_light, light.directional ? LARGEST : 1.0,
                            light.arriving / probability, 0.0);
        }
    }
    // 2b. A direction to the environment.
    if (SAMPLED_ENVIRONMENT) {
        if (kind == EMITTER_ENVIRONMENT) {
            EnvironmentSample sky = sample_environment(uint(x * 4294967040.0), words.y);
            float pdf = probability * sky.pdf;
            r = LightSample(sky.direction, LARGEST, vec3(1.0 / pdf), pdf);
        }
    }
    // 2c. A point on an emissive triangle.
    if (EMISSIVE_TRIANGLES) {
        if (kind == EMITTER_TRIANGLE) {
            // Low-distortion map from the unit square to a triangle (Heitz 2019): it folds along the diagonal.
            float y = unit_float(words.y);
            vec2 w = y > x ? vec2(0.5 * x, y - 0.5 * x) : vec2(x - 0.5 * y, 0.5 * y);
            vec3 a, ab, ac;
            vec3 doubled = doubled_area_of(emitter.place, a, ab, ac);
            float size = vector_length(doubled);
            vec3 n = doubled / size;
            vec3 p = a + w.x * ab + w.y * ac;
            vec3 to_light = p - origin;
            float side = dot(n, to_light) < 0.0 ? 1.0 : -1.0;
            bool shows = side > 0.0 || (emitter.kind & EMITTER_TWO_SIDED) != 0;
            // The end of the shadow ray lies off the triangle by `offset`, so that the triangle does not occlude itself.
            to_light += n * (side * trace_terms.offset);
            float r2 = dot(to_light, to_light);
            float cos_light = -side * dot(n, to_light) * inversesqrt(r2);
            float pdf = density_per_solid_angle(probability * 2.0 / size, r2, cos_light);
            bool lights = shows && r2 > 0.0 && cos_light > 0.0 && pdf <= LARGEST;
            vec3 radiance = emission_at(emitter.place, w.x, w.y);
            r = LightSample(to_light, 1.0, lights ? radiance / pdf : vec3(0.0), lights ? pdf : 0.0);
        }
    }
    return r;
}
#endif
