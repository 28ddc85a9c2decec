// How quantities are stored: normals as octahedra, numbers as parts of words.
#ifndef ENCODE_GLSL
#define ENCODE_GLSL
#include "lib/constants.glsl"

// Octahedral map of a unit vector to [−1, 1]² (Cigolle et al., JCGT 3(2) 2014). In 2x16 bits the largest error is
// 3.7e-3 degrees (numerics.md 16).
//        y
//     +--|--+    the upper hemisphere is the inner diamond |u| + |v| < 1,
//     | /|\ |    the lower one is folded over its edges into the corners
//     |/ | \|
//   --+--+--+-- x
vec2 octahedral_from_unit(vec3 n) {
    vec2 p = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
    vec2 sign_p = vec2(p.x >= 0.0 ? 1.0 : -1.0, p.y >= 0.0 ? 1.0 : -1.0);
    return n.z < 0.0 ? (1.0 - abs(p.yx)) * sign_p : p;
}

vec3 unit_from_octahedral(vec2 p) {
    vec3 n = vec3(p, 1.0 - abs(p.x) - abs(p.y));
    float fold = max(-n.z, 0.0);
    n.x += n.x >= 0.0 ? -fold : fold;
    n.y += n.y >= 0.0 ? -fold : fold;
    return normalize(n);
}

// Clear-coat strength and roughness as the two bytes of one 16-bit number, specular strength, and the coat's normal: for
// four unorm16 components.
vec4 packed_layers(vec3 coat_roughness_specular, vec3 n_coat) {
    vec2 bytes = floor(clamp(coat_roughness_specular.xy, 0.0, 1.0) * 255.0 + 0.5);
    float both = (bytes.x * 256.0 + bytes.y) * (1.0 / 65535.0);
    return vec4(both, coat_roughness_specular.z, octahedral_from_unit(n_coat) * 0.5 + 0.5);
}

vec3 layers_from_packed(vec4 packed_value) {
    uint both = uint(packed_value.x * 65535.0 + 0.5);
    return vec3(vec2(both >> 8, both & 255u) * (1.0 / 255.0), packed_value.y);
}

vec3 coat_normal_from_packed(vec4 packed_value) {
    return unit_from_octahedral(packed_value.zw * 2.0 - 1.0);
}

// Equirectangular coordinates of a unit direction (README, "Conventions"): u to the right, v down from the top.
vec2 equirectangular_from_direction(vec3 d) {
    return vec2(atan(d.z, d.x) * (0.5 * INV_PI) + 0.5, 0.5 - asin(clamp(d.y, -1.0, 1.0)) * INV_PI);
}

// A direction turned about +Y.
vec3 turned(vec3 d, float cos_angle, float sin_angle) {
    return vec3(cos_angle * d.x - sin_angle * d.z, d.y, sin_angle * d.x + cos_angle * d.z);
}

vec3 direction_from_equirectangular(vec2 uv) {
    float phi = (uv.x - 0.5) * 2.0 * PI;
    float elevation = (0.5 - uv.y) * PI;
    return vec3(cos(elevation) * cos(phi), sin(elevation), cos(elevation) * sin(phi));
}
#endif
