// Reflection and refraction at a smooth surface: directions, critical angle, Brewster angle (lecture F1, F4–F6).
// Where to read: pbrt 4, section 9.3 (Snell's law). Twins: crates/optics/src/.
// Assumes: v points to the surface, N to the side that v comes from, both unit vectors rounded to f32; n = n_transmitted /
// n_incident. Results have unit length. A zero v or N gives the zero vector: no direction. The caller turns N to the ray's
// side.
#ifndef SNELL_GLSL
#define SNELL_GLSL
#include "lib/arithmetic.glsl"
#include "lib/constants.glsl"

// Normalises a vector of about unit length. The zero vector, and one far from unit length, give zero (lib/frame.glsl has
// the general safe_normalize).
vec3 renormalised(vec3 v) {
    float v2 = dot(v, v);
    return v2 > 1e-30 && v2 < 1e30 ? v / sqrt(v2) : vec3(0.0);
}

struct Reflection {
    vec3 R;
};

// @eq F4 N12: R = v + 2N cosα, cosα = −v·N
// @name reflect
// Normalised again: otherwise the length drifts by 8.5e-6 over a chain of 256 reflections. Divided by |N|², so that a
// rounded N does not tilt the result.
Reflection reflect_ray(vec3 v, vec3 N) {
    vec3 r;
    if (ARITHMETIC == FAST) {
        r = v - 2.0 * N * dot(N, v);
    } else {
        float n2 = dot(N, N);
        vec3 mirrored = v - N * (2.0 * dot(N, v) / n2);
        // Vectors whose squares leave the range of f32 have no direction here either.
        r = renormalised(n2 > 1e-30 && n2 < 1e30 ? mirrored : vec3(0.0));
    }
    return Reflection(r);
}

// Mirrors a direction to the front of its triangle where an interpolated normal has sent it behind.
vec3 on_side(vec3 direction, vec3 n) {
    return direction - n * (2.0 * min(dot(direction, n), 0.0));
}

struct Refraction {
    vec3 T;
    bool tir;
    float disc;
};

// @eq F1 F5 N11 N13: T = v/n + N(cosα/n − cosβ), disc = cos²β = 1 − sin²α/n²; disc < 0 is total internal reflection
// @name refract
// With g = n cosβ = √(cos²α + n² − 1): T = (v + N(cosα − g))/n, and cosα − g = (1 − n²)/(cosα + g), where nothing cancels.
// N⊥ = (v + N cosα)/sinα, which is 0/0 at normal incidence, is not needed.
// Near the critical angle the rounding of cos²α and of the lengths of v and N decides. They come from dot2, and g² is
// summed in double-float. Rejected: g² = n² − |N × v|² in plain f32 reported total internal reflection for rays up to 3e-7
// on the wrong side.
// Compensated: the tangential part too, as (N × v) × N from exact products. On total internal reflection T is the zero
// vector and `tir` is true. The same for n ≤ 0, for zero vectors, and for any component beyond 1e9.
Refraction refract_ray(vec3 v, vec3 N, float n) {
    Refraction r = Refraction(vec3(0.0), true, 0.0);
    if (ARITHMETIC == FAST) {
        float cos_in = -dot(v, N);
        r.disc = 1.0 - (1.0 - cos_in * cos_in) / (n * n);
        r.tir = r.disc < 0.0;
        if (!r.tir) r.T = v / n + N * (cos_in / n - sqrt(r.disc));
    } else {
        vec3 largest = max(abs(v), abs(N));
        bool valid = n > 0.0 && n < 1e9 && max(largest.x, max(largest.y, largest.z)) < 1e9;
        DoubleFloat cosine = dot2(N, v);
        DoubleFloat n2 = dot2(N, N);
        DoubleFloat lengths = df_mul(n2, dot2(v, v));
        if (valid && lengths.hi > 1e-30) {
            DoubleFloat c2 = df_div(df_mul(cosine, cosine), lengths);
            float g2 = df_add(df_square_minus_one(n), c2).hi;
            r.disc = g2 / n / n;
            r.tir = g2 < 0.0;
            float g = sqrt(max(g2, 0.0));
            vec3 T;
            if (ARITHMETIC == COMPENSATED) {
                T = cross2(cross2(N, v), N) / sqrt(lengths.hi * n2.hi) - N * (g / sqrt(n2.hi));
            } else {
                float sum = sqrt(c2.hi) + g;
                T = v + N * (sum > 0.0 ? (1.0 - n) * (1.0 + n) / sum : 0.0);
            }
            r.T = r.tir ? vec3(0.0) : renormalised(T);
        }
    }
    return r;
}

struct CriticalAngle {
    bool exists;
    float theta_rad;
    float theta_deg;
    float cos_theta;
};

// @eq F6: θ_c = arcsin(n_out/n_in), from the dense side: it exists for n_in > n_out
// Not Brewster's angle. It is the arc tangent of sine and cosine: the cosine √((n_in − n_out)(n_in + n_out))/n_in keeps its
// digits for nearly equal indices, where the arc sine has none. Without a critical angle: 90°, cosine 0.
// @lab fresnel_dielectric: both_angles_of_a_boundary_are_those_of_its_reflectance
CriticalAngle critical_angle(float n_in, float n_out) {
    CriticalAngle r = CriticalAngle(n_in > n_out && n_out >= 0.0, 0.5 * PI, 90.0, 0.0);
    if (r.exists) {
        if (ARITHMETIC == FAST) {
            r.theta_rad = asin(n_out / n_in);
            r.cos_theta = cos(r.theta_rad);
        } else {
            r.cos_theta = sqrt((n_in - n_out) / n_in) * sqrt((n_in + n_out) / n_in);
            r.theta_rad = atan2f(n_out / n_in, r.cos_theta);
        }
        r.theta_deg = r.theta_rad * (180.0 / PI);
    }
    return r;
}

struct BrewsterAngle {
    float theta_rad;
    float cos_theta;
};

// @eq F6: θ_B = arctan(n_out/n_in), where r_p = 0; it exists on both sides
// Uses the magnitudes of the indices; 0 for both gives 0.
// @lab fresnel_dielectric: both_angles_of_a_boundary_are_those_of_its_reflectance
BrewsterAngle brewster_angle(float n_in, float n_out) {
    BrewsterAngle r = BrewsterAngle(0.0, 1.0);
    float larger = max(abs(n_in), abs(n_out));
    if (larger > 0.0) {
        if (ARITHMETIC == FAST) {
            r.theta_rad = atan(n_out / n_in);
            r.cos_theta = cos(r.theta_rad);
        } else {
            float a = abs(n_in) / larger;
            float b = abs(n_out) / larger;
            r.theta_rad = atan2f(b, a);
            r.cos_theta = a / sqrt(a * a + b * b);
        }
    }
    return r;
}
#endif
