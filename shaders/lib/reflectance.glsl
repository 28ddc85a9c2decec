// What lobes reflect in all directions together, out of a table.
#ifndef REFLECTANCE_GLSL
#define REFLECTANCE_GLSL
#include "lib/surface.glsl"

layout(scene) uniform sampler2D reflectance;

// F0 and F90 factors of the directional reflectance of a lobe: the table's first and last texels are 0 and 1.
vec2 reflectance_of_lobe(float cos_v, float roughness) {
    vec2 side = vec2(textureSize(reflectance, 0));
    return textureLod(reflectance, (vec2(clamp(cos_v, 0.0, 1.0), roughness) * (side - 1.0) + 0.5) / side, 0.0).rg;
}

// The same of a surface's base.
vec2 lobe_reflectance(Surface s) {
    return reflectance_of_lobe(dot(s.n, s.v), s.roughness);
}

// Makes up for what single scattering loses, where the knob `brdf` says so.
void compensate(inout Surface s) {
    if (BRDF == 3) {
        vec2 ab = lobe_reflectance(s);
        s.compensation = ggx_compensation(s.f0, ab.x + ab.y);
    }
}
#endif
