// How the environment is turned and scaled.
#ifndef ENVIRONMENT_GLSL
#define ENVIRONMENT_GLSL
#include "lib/encode.glsl"
#include "lib/spectrum.glsl"
#include "share/environment.glsl"

layout(scalar, set = 0, binding = 22) uniform Environment { EnvironmentTerms environment; };

vec3 into_environment(vec3 d) {
    return turned(d, environment.cos_rotation, environment.sin_rotation);
}

// Light of the environment, from its map or what was made of it.
vec3 light_of_environment(vec3 rgb) {
    return light_of_rgb(rgb * environment.intensity);
}
#endif
