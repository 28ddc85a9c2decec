// Environment lighting: the map, its irradiance in spherical harmonics and its prefiltered levels (split sum).
// The split-sum approximation multiplies a prefiltered level of the map (pass/prefilter.comp) by the directional albedo of
// the lobe (lib/reflectance.glsl).
// Where to read: RTR 4, sections 10.5 and 10.6; Ramamoorthi and Hanrahan 2001 (irradiance); Karis 2013 (split sum).
// Assumes: directions in world axes; `turned` rotates them about +Y into the map.
#ifndef ENVIRONMENT_GLSL
#define ENVIRONMENT_GLSL
#include "lib/encode.glsl"
#include "lib/spectrum.glsl"
#include "share/environment.glsl"

layout(constant) const bool SKY = false;         // the environment is visible as the background
layout(constant) const bool BLURRED_BACKGROUND = false; // SKY: it is seen directly through a lobe
layout(constant) const bool ENVIRONMENT = false; // rays that leave the scene see an environment
const bool OTHER_BACKGROUND = !SKY || BLURRED_BACKGROUND; // what is seen directly is not the environment as it is
layout(scene, scalar) uniform Environment { EnvironmentTerms environment; };
layout(scene) uniform sampler2D sky;
layout(scene) uniform sampler2D prefiltered; // mip chain: each level convolved with a wider lobe (pass/prefilter.comp)

vec3 into_environment(vec3 d) {
    return turned(d, environment.cos_rotation, environment.sin_rotation);
}

// Light of the environment from a texel of its map, of a prefiltered level or of its irradiance.
vec3 light_of_environment(vec3 rgb) {
    return light_of_rgb(rgb * environment.intensity);
}

// Radiance from a direction in world axes.
vec3 environment_radiance(vec3 direction) {
    vec2 at = equirectangular_from_direction(into_environment(direction));
    return light_of_environment(textureLod(sky, at, 0.0).rgb);
}

// Mean radiance around a direction, over about a square of `width` radians a side: the mip level whose texels are as large.
// A row of the map is shorter by the sine of its angle to the pole.
vec3 environment_radiance(vec3 direction, float width) {
    vec3 d = into_environment(direction);
    float texels = width * float(textureSize(sky, 0).x) * (0.5 * INV_PI) * inversesqrt(sqrt(max(1.0 - d.y * d.y, 1e-6)));
    float level = texels > 1.0 ? log2(texels) : 0.0;
    return light_of_environment(textureLod(sky, equirectangular_from_direction(d), level).rgb);
}

// Mip level of the prefiltered map whose texels are 1/16 of the lobe: α = 16 / width (pass/prefilter.comp).
float prefiltered_level(float alpha) {
    float first = environment.width * alpha * 0.0625;
    return first >= 2.0 ? min(log2(first), environment.levels - 1.0) : first * 0.5;
}

vec3 prefiltered_radiance(vec3 direction, float alpha) {
    vec2 at = equirectangular_from_direction(into_environment(direction));
    return light_of_environment(textureLod(prefiltered, at, prefiltered_level(alpha)).rgb);
}

// Radiance of the background, which is seen directly or through surfaces that transmit light: the environment, blurred
// or not, or nothing. All other light comes from the environment itself.
vec3 background_radiance(vec3 direction) {
    if (!SKY) return vec3(0.0);
    vec3 sharp = environment_radiance(direction);
    if (!BLURRED_BACKGROUND) return sharp;
    // The first prefiltered level may be coarser than the map.
    vec2 at = equirectangular_from_direction(into_environment(direction));
    float level = prefiltered_level(environment.blur);
    vec3 blurred = light_of_environment(textureLod(prefiltered, at, max(level, min(1.0, environment.levels - 1.0))).rgb);
    return mix(sharp, blurred, min(level, 1.0));
}

// Ambient light: irradiance from nine spherical-harmonic coefficients, without visibility.
vec3 environment_irradiance(vec3 n) {
    vec3 d = into_environment(n);
    vec3 e = environment.irradiance[0] * 0.282095;
    e += (environment.irradiance[1] * d.y + environment.irradiance[2] * d.z + environment.irradiance[3] * d.x) * 0.488603;
    e += (environment.irradiance[4] * (d.x * d.y) + environment.irradiance[5] * (d.y * d.z) + environment.irradiance[7] * (d.x * d.z)) * 1.092548;
    e += environment.irradiance[6] * (0.315392 * (3.0 * d.z * d.z - 1.0));
    e += environment.irradiance[8] * (0.546274 * (d.x * d.x - d.y * d.y));
    return light_of_environment(max(e, 0.0));
}
#endif
