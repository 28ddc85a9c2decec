// Lights without extent, out of their table.
#ifndef PUNCTUAL_GLSL
#define PUNCTUAL_GLSL
#include "lib/light.glsl"

layout(constant_id = 13) const uint DIRECTIONAL_LIGHTS = 0; // lights [0, this) of the table

// Four texels per light: position (or direction to it), unused | colour, 1 / range² | axis, spot scale | spot offset.
layout(set = 0, binding = 20, rgba32f) readonly uniform imageBuffer lights;

struct PunctualLight {
    vec3 to_light;    // from the point, or the direction to what is infinitely far
    vec3 l;           // the same with length 1
    vec3 arriving;    // irradiance perpendicular to l, where nothing is in between
    bool directional; // infinitely far
};

// Light `index` of the table as a point sees it.
PunctualLight punctual_light_at(uint index, vec3 p_rel) {
    vec4 place = imageLoad(lights, int(index * 4));
    vec4 color = imageLoad(lights, int(index * 4 + 1));
    vec4 axis = imageLoad(lights, int(index * 4 + 2));
    float spot_offset = imageLoad(lights, int(index * 4 + 3)).x;
    PunctualLight r;
    r.directional = index < DIRECTIONAL_LIGHTS;
    r.to_light = r.directional ? place.xyz : place.xyz - p_rel;
    float r2 = dot(r.to_light, r.to_light);
    r.l = r.directional ? place.xyz : r.to_light * inversesqrt(max(r2, 1e-30));
    float falloff = point_falloff(r2, color.w) * spot_share(-dot(axis.xyz, r.l), axis.w, spot_offset);
    r.arriving = color.rgb * (r.directional ? 1.0 : falloff);
    return r;
}
#endif
