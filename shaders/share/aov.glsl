// One pixel of arbitrary output variables.
#ifndef SHARE_AOV_GLSL
#define SHARE_AOV_GLSL
struct AovPixel {
    vec3 p_rel;            // metres from the eye, world axes
    vec3 normal;           // shading normal
    vec3 geometric_normal;
    vec3 albedo;
    float distance;        // from the eye; along the view direction where the camera is orthographic
    float roughness;
    float metallic;
    vec3 emissive;
    uint material;         // index + 1; 0 where nothing was drawn
    uint instance;         // index + 1
};
#endif
