// Environment lighting: irradiance as nine spherical-harmonic coefficients, rotation and scale of the map.
// Where to read: Ramamoorthi and Hanrahan 2001; RTR 4, section 10.6.
#ifndef SHARE_ENVIRONMENT_GLSL
#define SHARE_ENVIRONMENT_GLSL
const uint LOBE_TABLE_SIDE = 32; // of each table of lobes (lib/reflectance.glsl)
struct EnvironmentTerms {
    vec3 irradiance[9];  // coefficients with the cosine lobe folded in (Ramamoorthi & Hanrahan 2001): E(n) = Σ c_i Y_i(n)
    float cos_rotation;
    float sin_rotation;
    float intensity;
    float width;         // texels across level 0 of the prefiltered map
    float levels;        // its number of levels
    float blur;          // α of the lobe that blurs the background
};
#endif
