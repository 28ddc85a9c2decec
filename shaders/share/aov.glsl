// Arbitrary output variables (AOVs) of one pixel.
// Where to read: pbrt 4, section 5.4 (GBufferFilm). Assumes: metres, world axes.
#ifndef SHARE_AOV_GLSL
#define SHARE_AOV_GLSL
struct AovPixel {
    vec3 p_rel;            // metres from the eye, world axes
    vec3 normal;           // shading normal
    vec3 geometric_normal;
    vec3 albedo;
    float distance;        // from the eye; in an orthographic view along the view direction
    float roughness;
    float metallic;
    vec3 emissive;
    uint material;         // index + 1; 0 where nothing was drawn
    uint instance;         // index + 1
};
#endif
