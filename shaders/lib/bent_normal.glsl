// Normal mapping: a tangent-space normal in the frame of an interpolated normal and tangent.
// Not the "bent normal" of ambient occlusion. Where to read: RTR 4, section 6.7.2; glTF 2.0, section 3.9.3 (additional
// textures).
// Assumes: the texel is decoded to [−1, 1], with its scale applied.
#ifndef BENT_NORMAL_GLSL
#define BENT_NORMAL_GLSL

// n is the unit interpolated normal, and tangent.w the handedness of the bitangent. Returns n where the vectors span no
// frame.
vec3 bent_normal(vec3 n, vec4 tangent, vec3 texel) {
    vec3 t = tangent.xyz - n * dot(n, tangent.xyz);
    float t2 = dot(t, t);
    vec3 t_unit = t2 > 0.0 ? t * inversesqrt(t2) : vec3(0.0);
    vec3 bent = t_unit * texel.x + cross(n, t_unit) * (tangent.w * texel.y) + n * texel.z;
    float bent2 = dot(bent, bent);
    return bent2 > 0.0 ? bent * inversesqrt(bent2) : n;
}
#endif
