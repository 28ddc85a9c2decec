// Light sampling of path tracing: the emitters of lib/emitters.glsl and the environment (lecture R2–R4).
// The environment has a marginal CDF over rows and one conditional CDF over columns for each row, in 32-bit fixed point.
// Where to read: pbrt 4, section 12.5 (infinite area lights) and appendix A (piecewise constant distributions).
// Assumes: points in bvh space, metres; densities per solid angle.
#ifndef LIGHT_SAMPLING_GLSL
#define LIGHT_SAMPLING_GLSL
#include "lib/emitters.glsl"
#include "lib/environment.glsl"

layout(constant) const bool SAMPLED_ENVIRONMENT = false; // the environment is an emitter
layout(constant) const uint CDF_COLUMNS = 0;             // columns of the environment's CDF
layout(constant) const uint CDF_ROWS = 0;
layout(constant) const uint CDF_SEARCH_STEPS = 0;        // binary-search steps in a row, or over the rows

// Lower ends of the bins: the marginal CDF over rows; then, row by row, the conditional CDF over columns.
layout(paths, r32ui) readonly uniform uimageBuffer environment_cdf;

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

// Draws one light sample for a point at `origin` in bvh space. For the environment `arriving` is 1 over the density: the
// caller multiplies by the environment's radiance.
LightSample sample_light(vec3 origin, uvec2 words) {
    EmitterChoice choice = choose_emitter(origin, words.x);
    LightSample r = sample_emitter(origin, choice, words.y);
    if (SAMPLED_ENVIRONMENT) {
        if ((choice.emitter.kind & EMITTER_KIND) == EMITTER_ENVIRONMENT) {
            EnvironmentSample sky = sample_environment(uint(choice.x * 4294967040.0), words.y);
            float pdf = choice.probability * sky.pdf;
            r = LightSample(sky.direction, LARGEST, vec3(1.0 / pdf), pdf);
        }
    }
    return r;
}
#endif
