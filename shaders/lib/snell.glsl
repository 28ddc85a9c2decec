// Directions at a smooth surface (lecture F1, F4–F6). v points to the surface, N to the side that v comes from, both unit
// vectors as 32 bits hold them; n is n_transmitted / n_incident. Results have unit length. A zero v or N gives the zero
// vector: no direction. N is taken as given: it is the caller's business to turn it to the ray's side.
#ifndef SNELL_GLSL
#define SNELL_GLSL
#include "lib/arithmetic.glsl"
#include "lib/constants.glsl"

// Divided by its length; the zero vector stays. For vectors of about unit length (lib/frame.glsl has the general one).
vec3 renormalised(vec3 v) {
    float v2 = dot(v, v);
    return v2 > 0.0 ? v / sqrt(v2) : vec3(0.0);
}

struct Reflection {
    vec3 R;
};

// @eq F4 N12: R = v + 2N cosα, cosα = −v·N
// @name reflect
// Renormalised: the length of a chain of 256 reflections drifts by 8.5e-6 otherwise. Divided by |N|², so that a rounded
// N does not tilt the result.
Reflection reflect_ray(vec3 v, vec3 N) {
    if (ARITHMETIC == FAST) return Reflection(v - 2.0 * N * dot(N, v));
    float n2 = dot(N, N);
    if (n2 == 0.0) return Reflection(vec3(0.0));
    return Reflection(renormalised(v - N * (2.0 * dot(N, v) / n2)));
}

struct Refraction {
    vec3 T;
    bool tir;
    float disc;
};

// @eq F1 F5 N11 N13: T = v/n + N(cosα/n − cosβ), disc = cos²β = 1 − sin²α/n²; disc < 0 is total internal reflection
// With s = |N × v| (1 − cos² would lose small angles) and g = n cosβ = √((n − s)(n + s)), cosα − g = (1 − n²)/(cosα + g):
// nothing cancels, and N⊥ = (v + N cosα)/sinα, 0/0 at normal incidence, is never formed. Compensated: cosα and the
// lengths of v and N by dot2, g² in double-float. On total reflection T is the zero vector and `tir` says so.
Refraction refract_ray(vec3 v, vec3 N, float n) {
    if (ARITHMETIC == FAST) {
        float cos_in = -dot(v, N);
        float disc = 1.0 - (1.0 - cos_in * cos_in) / (n * n);
        if (disc < 0.0) return Refraction(vec3(0.0), true, disc);
        return Refraction(v / n + N * (cos_in / n - sqrt(disc)), false, disc);
    }
    float c, g2;
    if (ARITHMETIC == COMPENSATED) {
        DoubleFloat cosine = dot2(N, v);
        DoubleFloat lengths = df_mul(dot2(N, N), dot2(v, v));
        if (!(lengths.hi > 0.0 && n > 0.0)) return Refraction(vec3(0.0), true, 0.0);
        DoubleFloat c2 = df_div(df_mul(cosine, cosine), lengths);
        g2 = df_add(df_add(two_product(n, n), DoubleFloat(-1.0, 0.0)), c2).hi;
        c = sqrt(c2.hi);
    } else {
        vec3 across = cross(N, v);
        float lengths = dot(N, N) * dot(v, v);
        if (!(lengths > 0.0 && n > 0.0)) return Refraction(vec3(0.0), true, 0.0);
        float s = sqrt(dot(across, across));
        g2 = (n - s) * (n + s);
        c = abs(dot(N, v));
    }
    float disc = g2 / n / n;
    if (g2 < 0.0) return Refraction(vec3(0.0), true, disc);
    float g = sqrt(g2);
    float lift = c + g > 0.0 ? (1.0 - n) * (1.0 + n) / (c + g) : 0.0;
    return Refraction(renormalised(v + N * lift), false, disc);
}

struct CriticalAngle {
    bool exists;
    float theta_rad;
    float theta_deg;
    float cos_theta;
};

// @eq F6: θ_c = arcsin(n_out/n_in), from the dense side: it exists for n_in > n_out
// Not Brewster's angle. Taken as an arc tangent of sine and cosine: the cosine √((n_in − n_out)(n_in + n_out))/n_in keeps
// its digits for nearly equal indices, where the arc sine has none. Without one: 90°, cosine 0.
CriticalAngle critical_angle(float n_in, float n_out) {
    if (!(n_in > n_out && n_out >= 0.0)) return CriticalAngle(false, 0.5 * PI, 90.0, 0.0);
    if (ARITHMETIC == FAST) {
        float theta = asin(n_out / n_in);
        return CriticalAngle(true, theta, theta * (180.0 / PI), cos(theta));
    }
    float cosine = sqrt((n_in - n_out) / n_in) * sqrt((n_in + n_out) / n_in);
    float theta = atan2f(n_out / n_in, cosine);
    return CriticalAngle(true, theta, theta * (180.0 / PI), cosine);
}

struct BrewsterAngle {
    float theta_rad;
    float cos_theta;
};

// @eq F6: θ_B = arctan(n_out/n_in), where r_p = 0; it exists on both sides
// Index 0 on both sides: 0.
BrewsterAngle brewster_angle(float n_in, float n_out) {
    float larger = max(abs(n_in), abs(n_out));
    if (larger == 0.0) return BrewsterAngle(0.0, 1.0);
    float a = abs(n_in) / larger;
    float b = abs(n_out) / larger;
    if (ARITHMETIC == FAST) {
        float theta = atan(n_out / n_in);
        return BrewsterAngle(theta, cos(theta));
    }
    return BrewsterAngle(atan2f(b, a), a / sqrt(a * a + b * b));
}
#endif
