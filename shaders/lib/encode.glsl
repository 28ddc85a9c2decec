// Storage formats: octahedral encoding of normals, depths, sRGB bytes, and equirectangular maps of directions.
// Twins of the tagged functions: crates/optics/src/encode.rs. Where to read: Cigolle et al., JCGT 3(2) 2014 (octahedral
// encoding); IEC 61966-2-1 (sRGB); RTR 4, section 4.7 (projections and depth). Assumes: directions in world axes, +Y up.
#ifndef ENCODE_GLSL
#define ENCODE_GLSL
#include "lib/constants.glsl"
#include "lib/frame.glsl"

// Octahedral encoding of a unit vector into [−1, 1]² (Cigolle et al., JCGT 3(2) 2014). In 2x16 bits the largest error is
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

// Rounds to the nearest of `steps` steps on each side of 0; no rounding for steps = 0.
vec2 in_steps(vec2 p, uint steps) {
    return steps == 0 ? p : floor(p * float(steps) + 0.5) / float(steps);
}

struct OctahedralRoundTrip {
    vec3 d;
    float error_deg;
};

// Steps on each side of 0 of a signed normalised number with `bits` bits.
float snorm_steps(uint bits) {
    return float((1u << (clamp(bits, 2u, 24u) - 1u)) - 1u);
}

// Normalised input of the round trip below: +Z for the zero vector.
vec3 unit_or_z(vec3 n) {
    SafeNormalized unit = safe_normalize(n);
    return unit.is_zero ? vec3(0.0, 0.0, 1.0) : unit.n;
}

// @eq N16: d = decode(round(encode(n)·m)/m), m = 2^(bits − 1) − 1
// Each component is rounded to the nearest step, as a texture unit stores it. bits is clamped to [2, 24].
// @lab unit_from_octahedral: quantised_values_are_off_by_their_quantisation_error
OctahedralRoundTrip octahedral_round_trip(vec3 n, uint bits) {
    vec3 unit = unit_or_z(n);
    float steps = snorm_steps(bits);
    vec3 d = unit_from_octahedral(floor(octahedral_from_unit(unit) * steps + 0.5) / steps);
    return OctahedralRoundTrip(d, angle_between(unit, d) * (180.0 / PI));
}

// @eq N42: d = near/z in f32, z = near/d
// @out z_back
// Reversed infinite depth: the floats of d have the same relative density at every distance. The tier fast is the standard
// depth d = far (z − near)/(z (far − near)), which is nearly 1 for most z; only that tier uses `far`. A point nearer than
// `near` > 0 comes back at `near`, and one with near/z = 0 at infinity. near ≤ 0 gives 0.
// @lab view_depth: the_gbuffer_of_study_scenes_agrees_with_ray_casts
float depth_round_trip(float z, float near, float far) {
    float z_back;
    if (ARITHMETIC == FAST) {
        float d = far / (far - near) * (1.0 - near / z);
        z_back = near * far / (far - d * (far - near));
    } else {
        // `precise` keeps the compiler from simplifying near / (near / z).
        precise float d = near / max(z, near);
        z_back = d >= SMALLEST_NORMAL ? near / d : plus_infinity();
        z_back = near > 0.0 ? z_back : 0.0;
    }
    return z_back;
}

// linear_from_srgb of one channel: the channels one after the other need fewer registers.
float linear_channel(float x) {
    float t = (x + 0.055) / 1.055;
    float q = sqrt(sqrt(t));
    float p = (((4.466797411e-2 * q - 0.231552169) * q + 0.908784986) * q + 0.298558623) * q - 2.045780234e-2;
    return x <= 0.04045 ? x / 12.92 : t * t * p;
}

// @eq N45: sRGB to linear by IEC 61966-2-1, of bytes
// @out linear
// x^2.4 as x² P(⁴√x), with a relative error of 2.1e-6. Rays decode single texels with it, as a texture unit does in hardware.
vec3 linear_from_srgb(vec3 x) {
    return vec3(linear_channel(x.r), linear_channel(x.g), linear_channel(x.b));
}

// @eq N10: u = 1/2 + φ/2π, v = 1/2 − elevation/π; φ = atan2(d_z, d_x), elevation = atan2(d_y, √(d_x² + d_z²))
// @out uv
// Equirectangular coordinates of a direction (README, "Conventions"): u to the right, v down from the top. The elevation is
// an arc tangent: an arc sine turns the rounding of d_y into 3e-4 rad at the poles. The zero vector gives (1/2, 1/2).
vec2 equirectangular_from_direction(vec3 d) {
    vec2 uv;
    if (ARITHMETIC == FAST) {
        uv = vec2(atan(d.z, d.x) * (0.5 * INV_PI) + 0.5, 0.5 - asin(clamp(d.y, -1.0, 1.0)) * INV_PI);
    } else {
        float across = sqrt(d.x * d.x + d.z * d.z);
        uv = vec2(atan2f(d.z, d.x) * (0.5 * INV_PI) + 0.5, 0.5 - atan2f(d.y, across) * INV_PI);
    }
    return uv;
}

// Rotates a direction about +Y.
vec3 turned(vec3 d, float cos_angle, float sin_angle) {
    return vec3(cos_angle * d.x - sin_angle * d.z, d.y, sin_angle * d.x + cos_angle * d.z);
}

// @eq N10: d = (cos e cos φ, sin e, cos e sin φ), φ = 2π(u − 1/2), e = π(1/2 − v)
// @out d
// Angles are in turns: Vulkan promises its sine to 2^-11 only. u has period 1; the caller keeps v in its range.
vec3 direction_from_equirectangular(vec2 uv) {
    vec3 d;
    if (ARITHMETIC == FAST) {
        float phi = (uv.x - 0.5) * 2.0 * PI;
        float elevation = (0.5 - uv.y) * PI;
        d = vec3(cos(elevation) * cos(phi), sin(elevation), cos(elevation) * sin(phi));
    } else {
        // φ is taken half a turn early, so both signs change. The polar angle from the top replaces the elevation: no
        // difference is rounded near v = 0.
        vec2 around = -cos_sin_of_turns(uv.x);
        vec2 polar = cos_sin_of_turns(0.5 * uv.y);
        d = vec3(polar.y * around.x, polar.x, polar.y * around.y);
    }
    return d;
}
#endif
