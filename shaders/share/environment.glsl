// The environment as light: irradiance as nine spherical-harmonic coefficients, and how the map is turned.
#ifndef SHARE_ENVIRONMENT_GLSL
#define SHARE_ENVIRONMENT_GLSL
struct EnvironmentTerms {
    vec3 irradiance[9];  // coefficients with the cosine lobe folded in (Ramamoorthi & Hanrahan 2001): E(n) = Σ c_i Y_i(n)
    float cos_rotation;
    float sin_rotation;
    float intensity;
    float width;         // texels across level 0 of the prefiltered map
    float levels;        // its number of levels
};
#endif
