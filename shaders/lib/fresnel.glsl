// Reflectance of smooth surfaces (lecture F2, F3). n is n_transmitted / n_incident, cosines are of angles to the normal;
// F is the unpolarised power reflectance. Out of domain: cosines are clamped to [0, 1], n to [0, 1e9], κ to [0, 1e9]
// (its square times n² still fits in 32 bits); n = 0 reflects everything.
#ifndef FRESNEL_GLSL
#define FRESNEL_GLSL
#include "lib/arithmetic.glsl"

const float LARGEST_INDEX = 1e9;

// (1 − cosθ)⁵. Multiplied out: exact powers, and no NaN where a rounded dot product exceeds 1, which one in five does.
float schlick_weight(float cos_in) {
    float m = clamp(1.0 - cos_in, 0.0, 1.0);
    float m2 = m * m;
    return ARITHMETIC == FAST ? pow(1.0 - cos_in, 5.0) : m2 * m2 * m;
}

// The curve from f0 to f90: of materials that are given by reflectances.
vec3 schlick(vec3 f0, float f90, float cos_in) {
    return f0 + (vec3(f90) - f0) * schlick_weight(cos_in);
}

struct FresnelSchlick {
    float F0;
    float F;
};

// @eq F2 N1: F = F0 + (1 − F0)(1 − cosθ)⁵, F0 = ((n − 1)² + κ²)/((n + 1)² + κ²)
// n − 1 is exact for n in [1/2, 2] (Sterbenz), so F0 keeps its digits where it vanishes.
FresnelSchlick fresnel_schlick(float cos_in, float n, float kappa) {
    float index = clamp(n, 0.0, LARGEST_INDEX);
    float k = clamp(kappa, 0.0, LARGEST_INDEX);
    float below = index - 1.0;
    float above = index + 1.0;
    float F0 = (below * below + k * k) / (above * above + k * k);
    return FresnelSchlick(F0, F0 + (1.0 - F0) * schlick_weight(cos_in));
}

// c² + n² − 1 = (n cosθ_t)². Two forms of the same sum, each with the small rounding errors on its own side:
// c² + (n − 1)(n + 1) is exact for n → 1, n² − (1 − c)(1 + c) for small n. Compensated: the sum in double-float, which
// is what is left to gain near the critical angle, where everything cancels (numerics.md 4).
float refracted_square(float c, float n) {
    float sum;
    if (ARITHMETIC == COMPENSATED) {
        sum = df_add(df_add(two_product(n, n), DoubleFloat(-1.0, 0.0)), two_product(c, c)).hi;
    } else {
        sum = n < 0.70710678 ? n * n - (1.0 - c) * (1.0 + c) : c * c + (n - 1.0) * (n + 1.0);
    }
    return sum;
}

// c²(n² + 1) − 1, zero at Brewster's angle. For n < 1 by way of g² (numerics.md 4).
float brewster_term(float c, float n, float g2) {
    float term;
    if (ARITHMETIC == COMPENSATED) {
        DoubleFloat c2 = two_product(c, c);
        term = df_add(df_add(df_mul(c2, two_product(n, n)), DoubleFloat(-1.0, 0.0)), c2).hi;
    } else {
        float n2 = n * n;
        term = n < 1.0 ? g2 * (n2 + 1.0) - n2 * n2 : c * c * (n2 + 1.0) - 1.0;
    }
    return term;
}

struct FresnelDielectric {
    float F;
    float rs;
    float rp;
    float cos_t;
    bool tir;
};

// @eq F3 F5 N2 N4: r_s = (c − g)/(c + g), r_p = (n²c − g)/(n²c + g), g = n cosθ_t = √(c² + n² − 1), F = (r_s² + r_p²)/2
// Near n = 1 both differences cancel. Multiplied by their conjugates they are products:
//   r_s = −(n² − 1)/(c + g)²,   r_p = (n² − 1)(c²(n² + 1) − 1)/(n²c + g)².
// Total internal reflection (g² ≤ 0, only for n < 1): F = r_s = r_p = 1, cosθ_t = 0. At c = 0, F = 1 for every n: the
// limit for n ≠ 1.
FresnelDielectric fresnel_dielectric(float cos_in, float n) {
    FresnelDielectric r = FresnelDielectric(1.0, 1.0, 1.0, 0.0, true);
    if (ARITHMETIC == FAST) {
        float cos2_t = 1.0 - (1.0 - cos_in * cos_in) / (n * n);
        if (!(cos2_t < 0.0)) {
            r.tir = false;
            r.cos_t = sqrt(cos2_t);
            r.rs = (cos_in - n * r.cos_t) / (cos_in + n * r.cos_t);
            r.rp = (n * cos_in - r.cos_t) / (n * cos_in + r.cos_t);
            r.F = 0.5 * (r.rs * r.rs + r.rp * r.rp);
        }
    } else {
        float c = clamp(cos_in, 0.0, 1.0);
        float index = clamp(n, 0.0, LARGEST_INDEX);
        float g2 = refracted_square(c, index);
        if (index >= 1.0 || g2 > 0.0 && index > 0.0) {
            float g = sqrt(max(g2, 0.0));
            float difference = (index - 1.0) * (index + 1.0);
            float s = c + g;
            float p = index * index * c + g;
            bool grazes = c == 0.0;
            r.tir = false;
            r.cos_t = min(g / index, 1.0);
            r.rs = grazes ? -1.0 : -difference / s / s;
            r.rp = grazes ? -1.0 : (difference / p) * (brewster_term(c, index, g2) / p);
            r.F = min(0.5 * (r.rs * r.rs + r.rp * r.rp), 1.0);
        }
    }
    return r;
}

struct Transmitted {
    float Ts;
    float Tp;
    float T;
};

// @eq F3 N3: T_s = 4cg/(c + g)², T_p = 4n²cg/(n²c + g)², T = (T_s + T_p)/2 = 1 − F
// 1 − F loses every digit at grazing incidence, where F → 1.
Transmitted dielectric_transmitted(float cos_in, float n) {
    if (ARITHMETIC == FAST) {
        FresnelDielectric r = fresnel_dielectric(cos_in, n);
        return Transmitted(1.0 - r.rs * r.rs, 1.0 - r.rp * r.rp, 1.0 - r.F);
    }
    float c = clamp(cos_in, 0.0, 1.0);
    float index = clamp(n, 0.0, LARGEST_INDEX);
    float g2 = refracted_square(c, index);
    if (c == 0.0 || index == 0.0 || g2 <= 0.0) return Transmitted(0.0, 0.0, 0.0);
    float g = sqrt(g2);
    float s = c + g;
    float p = index * index * c + g;
    float Ts = 4.0 * (c / s) * (g / s);
    float Tp = 4.0 * (index * c / p) * (index * g / p);
    return Transmitted(Ts, Tp, 0.5 * (Ts + Tp));
}

// @eq F2 N47: F0 = ((n2 − n1)/(n2 + n1))²
// Between two media of nearly one index: their quotient rounds the difference away, the indices themselves do not.
// @out F0
float nested_f0(float n1, float n2) {
    if (ARITHMETIC == FAST) {
        float e = n2 / n1;
        float r = (e - 1.0) / (e + 1.0);
        return r * r;
    }
    float sum = n2 + n1;
    float r = sum > 0.0 ? (n2 - n1) / sum : 0.0;
    return min(r * r, 1.0);
}

float abs2(vec2 z) {
    return dot(z, z);
}

// The root with positive parts of a number with imaginary part ≥ 0: the smaller part by division, not by the difference
// |z| − |x| that cancels.
vec2 complex_root(vec2 z) {
    // length() of lavapipe squares without scaling: fine below 1e19, and z is at most 2e18.
    float larger = sqrt(0.5 * (sqrt(abs2(z)) + abs(z.x)));
    float smaller = larger > 0.0 ? 0.5 * z.y / larger : 0.0;
    return z.x >= 0.0 ? vec2(larger, smaller) : vec2(smaller, larger);
}

// m² = (n + iκ)² and g = √(m² − sin²θ) = m cosθ_t of a conductor.
void conductor_terms(float c, float n, float k, out vec2 m2, out vec2 g) {
    m2 = vec2((n - k) * (n + k), 2.0 * n * k);
    float real;
    if (ARITHMETIC == COMPENSATED) {
        DoubleFloat sum = df_add(df_add(two_product(n, n), DoubleFloat(-1.0, 0.0)), two_product(c, c));
        DoubleFloat k2 = two_product(k, k);
        real = df_add(sum, DoubleFloat(-k2.hi, -k2.lo)).hi;
    } else {
        real = k > 0.25 ? m2.x - (1.0 - c) * (1.0 + c) : refracted_square(c, n) - k * k;
    }
    g = complex_root(vec2(real, m2.y));
}

struct FresnelConductor {
    float F;
    float Rs;
    float Rp;
};

// @eq F3 F8 N5 N6 N8: R_s = |c − g|²/|c + g|², R_p = |m²c − g|²/|m²c + g|², g = √(m² − sin²θ), m = n + iκ
// For κ well above 0 as written. For κ → 0 the differences cancel as a dielectric's do, and the products
//   r_s = −(m² − 1)/(c + g)²,   r_p = (m² − 1)(c²(m² + 1) − 1)/(m²c + g)²
// take over, divided twice so that no fourth power is formed. Grazing with n = 1, κ = 0: 1, as for a dielectric.
FresnelConductor fresnel_conductor(float cos_in, float n, float kappa) {
    if (ARITHMETIC == FAST) {
        float s2 = 1.0 - cos_in * cos_in;
        float t0 = n * n - kappa * kappa - s2;
        float a2b2 = sqrt(t0 * t0 + 4.0 * n * n * kappa * kappa);
        float t1 = a2b2 + cos_in * cos_in;
        float t2 = 2.0 * cos_in * sqrt(0.5 * (a2b2 + t0));
        float Rs = (t1 - t2) / (t1 + t2);
        float t3 = cos_in * cos_in * a2b2 + s2 * s2;
        float t4 = t2 * s2;
        float Rp = Rs * (t3 - t4) / (t3 + t4);
        return FresnelConductor(0.5 * (Rs + Rp), Rs, Rp);
    }
    float c = clamp(cos_in, 0.0, 1.0);
    float index = clamp(n, 0.0, LARGEST_INDEX);
    float k = clamp(kappa, 0.0, LARGEST_INDEX);
    vec2 m2, g;
    conductor_terms(c, index, k, m2, g);
    vec2 s = g + vec2(c, 0.0);
    vec2 p = m2 * c + g;
    float s2 = abs2(s);
    float p2 = abs2(p);
    if (c == 0.0 || s2 == 0.0 || p2 == 0.0) return FresnelConductor(1.0, 1.0, 1.0);
    float Rs, Rp;
    if (k > 0.25 * max(index, 1.0)) {
        Rs = abs2(vec2(c, 0.0) - g) / s2;
        Rp = abs2(m2 * c - g) / p2;
    } else {
        vec2 difference = vec2((index - 1.0) * (index + 1.0) - k * k, m2.y);
        float bracket;
        if (ARITHMETIC == COMPENSATED) {
            DoubleFloat c2 = two_product(c, c);
            DoubleFloat n2 = two_product(index, index);
            DoubleFloat k2 = two_product(k, k);
            DoubleFloat real_m2 = df_add(n2, DoubleFloat(-k2.hi, -k2.lo));
            difference.x = df_add(real_m2, DoubleFloat(-1.0, 0.0)).hi;
            bracket = df_add(df_add(df_mul(c2, real_m2), DoubleFloat(-1.0, 0.0)), c2).hi;
        } else {
            bracket = brewster_term(c, index, refracted_square(c, index)) - c * c * k * k;
        }
        vec2 brewster = vec2(bracket, c * c * m2.y);
        Rs = abs2(difference) / s2 / s2;
        Rp = (abs2(difference) / p2) * (abs2(brewster) / p2);
    }
    Rs = min(Rs, 1.0);
    Rp = min(Rp, 1.0);
    return FresnelConductor(0.5 * (Rs + Rp), Rs, Rp);
}

struct Absorbed {
    float As;
    float Ap;
    float A;
};

// @eq F3 N7: A_s = 4c Re g/|c + g|², A_p = 4c(Re m² Re g + Im m² Im g)/|m²c + g|², A = (A_s + A_p)/2 = 1 − F
// What a metal keeps. 1 − F loses every digit at grazing incidence.
Absorbed conductor_absorbed(float cos_in, float n, float kappa) {
    if (ARITHMETIC == FAST) {
        FresnelConductor r = fresnel_conductor(cos_in, n, kappa);
        return Absorbed(1.0 - r.Rs, 1.0 - r.Rp, 1.0 - r.F);
    }
    float c = clamp(cos_in, 0.0, 1.0);
    float index = clamp(n, 0.0, LARGEST_INDEX);
    float k = clamp(kappa, 0.0, LARGEST_INDEX);
    vec2 m2, g;
    conductor_terms(c, index, k, m2, g);
    float s2 = abs2(g + vec2(c, 0.0));
    float p2 = abs2(m2 * c + g);
    if (c == 0.0 || s2 == 0.0 || p2 == 0.0) return Absorbed(0.0, 0.0, 0.0);
    float As = clamp(4.0 * c * g.x / s2, 0.0, 1.0);
    float Ap = clamp(4.0 * c * (dot(m2, g) / p2), 0.0, 1.0);
    return Absorbed(As, Ap, 0.5 * (As + Ap));
}
#endif
