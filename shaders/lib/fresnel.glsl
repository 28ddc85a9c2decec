// Fresnel reflectance of smooth dielectrics and conductors, exact and by Schlick's approximation (lecture F2, F3).
// Where to read: pbrt 4, sections 9.3 and 9.4; RTR 4, section 9.5; Schlick 1994. Twins: crates/optics/src/.
// Assumes: n = n_transmitted / n_incident, cosines of angles to the normal; F is the unpolarised power reflectance. Out of
// domain: cosines are clamped to [0, 1], n and κ to [0, 1e9] (κ² times n² still fits in f32). n = 0 reflects everything.
#ifndef FRESNEL_GLSL
#define FRESNEL_GLSL
#include "lib/arithmetic.glsl"

const float LARGEST_INDEX = 1e9;

layout(constant) const bool FAINT_CONDUCTORS = true; // some conductor has a small κ (is_metallic is false)

// (1 − cosθ)⁵, multiplied out: exact powers, and no NaN where a rounded dot product exceeds 1, as one in five does.
float schlick_weight(float cos_in) {
    float m = clamp(1.0 - cos_in, 0.0, 1.0);
    float m2 = m * m;
    return ARITHMETIC == FAST ? pow(1.0 - cos_in, 5.0) : m2 * m2 * m;
}

// @eq F2 N1: F = F0 + (F90 − F0)(1 − cosθ)⁵
// @out F
// Schlick's approximation, for materials given by their reflectances.
vec3 schlick(vec3 f0, float f90, float cos_in) {
    return f0 + (vec3(f90) - f0) * schlick_weight(cos_in);
}

// @eq F2: F0 = ((n − 1)² + κ²)/((n + 1)² + κ²)
// @out F0
// Reflectance at normal incidence. n − 1 is exact for n in [1/2, 2] (Sterbenz), so F0 keeps its digits where it vanishes.
float normal_reflectance(float n, float kappa) {
    float k2 = kappa * kappa;
    return ((n - 1.0) * (n - 1.0) + k2) / ((n + 1.0) * (n + 1.0) + k2);
}

vec3 normal_reflectance(vec3 n, vec3 kappa) {
    return vec3(normal_reflectance(n.r, kappa.r), normal_reflectance(n.g, kappa.g), normal_reflectance(n.b, kappa.b));
}

struct FresnelSchlick {
    float F0;
    float F;
};

// @eq F2 N1: F = F0 + (1 − F0)(1 − cosθ)⁵, F0 = ((n − 1)² + κ²)/((n + 1)² + κ²)
// @lab schlick: laboratory_forms_agree_with_the_functions_of_pictures
FresnelSchlick fresnel_schlick(float cos_in, float n, float kappa) {
    float index = clamp(n, 0.0, LARGEST_INDEX);
    float k = clamp(kappa, 0.0, LARGEST_INDEX);
    float F0 = normal_reflectance(index, k);
    return FresnelSchlick(F0, schlick(vec3(F0), 1.0, cos_in).x);
}

// g² = (n cosθ_t)² = c² + n² − 1, to 2^-32 of the terms that cancel. Let a and b be the larger and the smaller of c and n,
// and e = 1 − a (exact near the critical angle, where a > 1/√2). Then g² = b² − 2e + e². The squares of the leading halves
// of b and e are exact, and where everything cancels their sum is exact too (Sterbenz).
// Rejected after measurement: c² + (n − 1)(n + 1) in plain f32 missed total internal reflection in 3 of 2000 cases within a
// few ULP of the critical angle.
float refracted_square_in_halves(float c, float n) {
    precise float b = min(c, n);
    precise float e = 1.0 - max(c, n);
    precise float b_half = leading_half(b);
    precise float e_half = leading_half(e);
    precise float coarse = (b_half * b_half - 2.0 * e) + e_half * e_half;
    precise float rest = (b + b_half) * (b - b_half) + (e + e_half) * (e - e_half);
    precise float all = coarse + rest;
    return all;
}

// g² by the tier: compensated in double-float.
float refracted_square(float c, float n) {
    if (ARITHMETIC == COMPENSATED) return df_add(df_square_minus_one(n), two_product(c, c)).hi;
    return refracted_square_in_halves(c, n);
}

// c²(n² + 1) − 1, zero at Brewster's angle. For n < 1 it is computed from g² (numerics.md 4).
float brewster_term(float c, float n, float g2) {
    float term;
    if (ARITHMETIC == COMPENSATED) {
        DoubleFloat c2 = two_product(c, c);
        term = df_add(df_add(df_mul(c2, two_product(n, n)), DoubleFloat(-1.0, 0.0)), c2).hi;
    } else {
        float n2 = n * n;
        precise float below_one = g2 * (n2 + 1.0) - n2 * n2;
        precise float above_one = c * c * (n2 + 1.0) - 1.0;
        term = n < 1.0 ? below_one : above_one;
    }
    return term;
}

// T = 2cg(1/s² + n²/p²), s = c + g, p = n²c + g, from 1/s and 1/p: a single sum, so reflected and transmitted power add up
// to 1 within 2e-7.
float transmitted_part(float c, float g, float n, float by_s, float by_p) {
    precise float T = 2.0 * (c * g) * (by_s * by_s + n * by_p * (n * by_p));
    return T;
}

struct FresnelDielectric {
    float F;
    float rs;
    float rp;
    float cos_t;
    bool tir;
};

// @eq F3 F5 N2 N4: r_s = (c − g)/(c + g), r_p = (n²c − g)/(n²c + g), g = n cosθ_t = √(c² + n² − 1), F = (r_s² + r_p²)/2
// Near n = 1 both differences suffer catastrophic cancellation. Multiplied by their conjugates they become products:
//   r_s = −(n² − 1)/(c + g)²,   r_p = (n² − 1)(c²(n² + 1) − 1)/(n²c + g)².
// Total internal reflection (g² ≤ 0, only for n < 1): F = r_s = r_p = 1, cosθ_t = 0. At c = 0, F = 1 for every n: the limit
// for n ≠ 1. For n = 1 there is no interface, and g is c itself: computed from g², which underflows for c below 1e-19, it
// would give cosθ_t = 0 and F = 1.
// Products are precise: where the index is a constant a compiler may take them in another order, and every plan of a scene has to
// give the same bits.
FresnelDielectric fresnel_dielectric(float cos_in, float n) {
    FresnelDielectric r = FresnelDielectric(1.0, 1.0, 1.0, 0.0, true);
    if (ARITHMETIC == FAST) {
        precise float cos2_t = 1.0 - (1.0 - cos_in * cos_in) / (n * n);
        if (!(cos2_t < 0.0)) {
            r.tir = false;
            r.cos_t = sqrt(cos2_t);
            precise float rs = (cos_in - n * r.cos_t) / (cos_in + n * r.cos_t);
            precise float rp = (n * cos_in - r.cos_t) / (n * cos_in + r.cos_t);
            r.rs = rs;
            r.rp = rp;
            r.F = 0.5 * (rs * rs + rp * rp);
        }
    } else {
        float c = clamp(cos_in, 0.0, 1.0);
        float index = clamp(n, 0.0, LARGEST_INDEX);
        float g2 = refracted_square(c, index);
        if (index >= 1.0 || g2 > 0.0 && index > 0.0) {
            float g = index == 1.0 ? c : sqrt(max(g2, 0.0));
            float difference = (index - 1.0) * (index + 1.0);
            // Two divisions instead of seven.
            float by_s = 1.0 / (c + g);
            precise float by_p = 1.0 / (index * index * c + g);
            // Below the normal range some operations flush the cosine to 0 and others do not.
            bool grazes = c < SMALLEST_NORMAL;
            r.tir = false;
            r.cos_t = min(g / index, 1.0);
            precise float rs = -difference * by_s * by_s;
            precise float rp = (difference * by_p) * (brewster_term(c, index, g2) * by_p);
            r.rs = grazes ? -1.0 : rs;
            r.rp = grazes ? -1.0 : rp;
            // 1 − T where little is transmitted: the error is T times the relative error of T.
            float T = index == 1.0 ? 1.0 : transmitted_part(c, g, index, by_s, by_p);
            r.F = grazes ? 1.0 : T < 0.5 ? 1.0 - T : min(0.5 * (r.rs * r.rs + r.rp * r.rp), 1.0);
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
// 1 − F loses every digit at grazing incidence, where F → 1. Pictures use 1 − F: the loss is 1e-7 of the light.
// @lab fresnel_dielectric: reflected_and_transmitted_power_are_one
Transmitted dielectric_transmitted(float cos_in, float n) {
    Transmitted t = Transmitted(0.0, 0.0, 0.0);
    if (ARITHMETIC == FAST) {
        FresnelDielectric r = fresnel_dielectric(cos_in, n);
        t = Transmitted(1.0 - r.rs * r.rs, 1.0 - r.rp * r.rp, 1.0 - r.F);
    } else {
        float c = clamp(cos_in, 0.0, 1.0);
        float index = clamp(n, 0.0, LARGEST_INDEX);
        float g2 = refracted_square(c, index);
        if (c >= SMALLEST_NORMAL && index > 0.0 && (g2 > 0.0 || index == 1.0)) {
            float g = index == 1.0 ? c : sqrt(g2);
            // The same products as in fresnel_dielectric, so that F and T add up to 1.
            float by_s = 1.0 / (c + g);
            precise float by_p = 1.0 / (index * index * c + g);
            // 1 − r² where little is reflected: the error is r² times the relative error of r².
            float difference = (index - 1.0) * (index + 1.0);
            precise float rs = difference * by_s * by_s;
            precise float rp = (difference * by_p) * (brewster_term(c, index, g2) * by_p);
            t.Ts = rs * rs < 0.5 ? 1.0 - rs * rs : 4.0 * (c * by_s) * (g * by_s);
            t.Tp = rp * rp < 0.5 ? 1.0 - rp * rp : 4.0 * (index * c * by_p) * (index * g * by_p);
            float F = 0.5 * (rs * rs + rp * rp);
            // c g would underflow for cosines below 1e-31; a power of two rounds nothing.
            float up = c < 1e-20 ? 1.15292150e18 : 1.0;
            t.T = F < 0.5 ? 1.0 - F : transmitted_part(c * up, g, index, by_s, by_p) * (1.0 / up);
        }
    }
    return t;
}

// @eq F2 N47: F0 = ((n2 − n1)/(n2 + n1))²
// Between two media of nearly equal index: their quotient rounds the difference away, the indices themselves do not.
// @out F0
float nested_f0(float n1, float n2) {
    float r;
    if (ARITHMETIC == FAST) {
        float e = n2 / n1;
        r = (e - 1.0) / (e + 1.0);
    } else {
        float sum = n2 + n1;
        r = sum > 0.0 ? clamp((n2 - n1) / sum, -1.0, 1.0) : 0.0;
    }
    return r * r;
}

float abs2(vec2 z) {
    return dot(z, z);
}

// Terms that both polarisations of a conductor need: m² = (n + iκ)², g = √(m² − sin²θ) = m cosθ_t, and the denominators |c
// + g|² and |m²c + g|². These are sums of positive parts: |g|² = |g²| and Re(m² ḡ) = Re g (|g²| + sin²θ).
struct ConductorTerms {
    vec2 m2;
    vec2 g;
    float mg;  // Re(m² ḡ)
    float s2;  // |c + g|²
    float p2;  // |m²c + g|²
};

// κ is well above 0: nothing cancels in the textbook form of the reflectances.
bool is_metallic(float n, float k) {
    return k > max(n, 0.5);
}

ConductorTerms conductor_terms(float c, float n, float k) {
    ConductorTerms t;
    t.m2 = vec2((n - k) * (n + k), 2.0 * n * k);
    float real;
    if (ARITHMETIC == COMPENSATED) {
        DoubleFloat sum = df_add(df_square_minus_one(n), two_product(c, c));
        real = df_add(sum, df_negate(two_product(k, k))).hi;
    } else {
        real = t.m2.x - (1.0 - c) * (1.0 + c);
        if (FAINT_CONDUCTORS && !is_metallic(n, k)) real = refracted_square_in_halves(c, n) - k * k;
    }
    // The root with positive parts. The smaller part is a quotient: the difference |g²| − |x| cancels. Squares are at most
    // 4e36, n and κ at most 1e9.
    float size = sqrt(real * real + t.m2.y * t.m2.y);
    float larger = sqrt(0.5 * (size + abs(real)));
    float smaller = larger > 0.0 ? 0.5 * t.m2.y / larger : 0.0;
    t.g = real >= 0.0 ? vec2(larger, smaller) : vec2(smaller, larger);
    float m2_size = n * n + k * k;
    t.s2 = (size + 2.0 * c * t.g.x) + c * c;
    t.mg = t.g.x * (size + (1.0 - c) * (1.0 + c));
    t.p2 = (c * m2_size) * (c * m2_size) + (2.0 * c * t.mg + size);
    return t;
}

// m² − 1 and c²(m² + 1) − 1, each zero where a dielectric reflects nothing. Double-float sums in both careful tiers: in
// plain f32 R_p was off by nine times itself at Brewster's angle of a nearly transparent conductor.
void conductor_differences(float c, float n, float k, float im_m2, out vec2 difference, out vec2 brewster) {
    DoubleFloat c2 = two_product(c, c);
    DoubleFloat re_m2 = df_add(two_product(n, n), df_negate(two_product(k, k)));
    DoubleFloat minus_one = DoubleFloat(-1.0, 0.0);
    difference = vec2(df_add(re_m2, minus_one).hi, im_m2);
    brewster = vec2(df_add(df_add(df_mul(c2, re_m2), minus_one), c2).hi, c * c * im_m2);
}

struct FresnelConductor {
    float F;
    float Rs;
    float Rp;
};

// @eq F3 F8 N5 N6 N8: R_s = |c − g|²/|c + g|², R_p = |m²c − g|²/|m²c + g|², g = √(m² − sin²θ), m = n + iκ
// For κ well above 0 in textbook form. For κ → 0 the differences cancel as those of a dielectric do, and the products
//   r_s = −(m² − 1)/(c + g)²,   r_p = (m² − 1)(c²(m² + 1) − 1)/(m²c + g)²
// replace them, divided twice so that no fourth power is formed. n = 1, κ = 0 is no interface: F = 0, and 1 at grazing
// incidence, as for a dielectric. There the squares above underflow from 1e-19 on.
FresnelConductor fresnel_conductor(float cos_in, float n, float kappa) {
    FresnelConductor r = FresnelConductor(1.0, 1.0, 1.0);
    if (ARITHMETIC == FAST) {
        float c2 = cos_in * cos_in;
        float s2 = 1.0 - c2;
        float t0 = n * n - kappa * kappa - s2;
        float a2b2 = sqrt(t0 * t0 + 4.0 * n * n * kappa * kappa);
        float t1 = a2b2 + c2;
        float t2 = 2.0 * cos_in * sqrt(0.5 * (a2b2 + t0));
        float t3 = c2 * a2b2 + s2 * s2;
        float t4 = t2 * s2;
        r.Rs = (t1 - t2) / (t1 + t2);
        r.Rp = r.Rs * (t3 - t4) / (t3 + t4);
        r.F = 0.5 * (r.Rs + r.Rp);
    } else {
        float c = clamp(cos_in, 0.0, 1.0);
        float index = clamp(n, 0.0, LARGEST_INDEX);
        float k = clamp(kappa, 0.0, LARGEST_INDEX);
        ConductorTerms t = conductor_terms(c, index, k);
        if (c >= SMALLEST_NORMAL && index == 1.0 && k == 0.0) {
            r = FresnelConductor(0.0, 0.0, 0.0);
        } else if (c >= SMALLEST_NORMAL && t.s2 > 0.0 && t.p2 > 0.0) {
            if (!FAINT_CONDUCTORS || is_metallic(index, k)) {
                // 1 − A where little is absorbed: the error is A times the relative error of A.
                float As = 4.0 * c * t.g.x / t.s2;
                float Ap = 4.0 * c * (t.mg / t.p2);
                r.Rs = clamp(As < 0.5 ? 1.0 - As : abs2(vec2(c, 0.0) - t.g) / t.s2, 0.0, 1.0);
                r.Rp = clamp(Ap < 0.5 ? 1.0 - Ap : abs2(t.m2 * c - t.g) / t.p2, 0.0, 1.0);
            } else {
                vec2 difference, brewster;
                conductor_differences(c, index, k, t.m2.y, difference, brewster);
                r.Rs = min(abs2(difference) / t.s2 / t.s2, 1.0);
                r.Rp = min((abs2(difference) / t.p2) * (abs2(brewster) / t.p2), 1.0);
            }
            r.F = 0.5 * (r.Rs + r.Rp);
        }
    }
    return r;
}

struct Absorbed {
    float As;
    float Ap;
    float A;
};

// @eq F3 N7: A_s = 4c Re g/|c + g|², A_p = 4c Re(m² ḡ)/|m²c + g|², A = (A_s + A_p)/2 = 1 − F
// The absorbed part of the power. 1 − F loses every digit at grazing incidence.
// @lab fresnel_conductor: reflected_and_transmitted_power_are_one
Absorbed conductor_absorbed(float cos_in, float n, float kappa) {
    Absorbed r = Absorbed(0.0, 0.0, 0.0);
    if (ARITHMETIC == FAST) {
        FresnelConductor reflected = fresnel_conductor(cos_in, n, kappa);
        r = Absorbed(1.0 - reflected.Rs, 1.0 - reflected.Rp, 1.0 - reflected.F);
    } else {
        float c = clamp(cos_in, 0.0, 1.0);
        ConductorTerms t = conductor_terms(c, clamp(n, 0.0, LARGEST_INDEX), clamp(kappa, 0.0, LARGEST_INDEX));
        if (c >= SMALLEST_NORMAL && t.s2 > 0.0 && t.p2 > 0.0) {
            // 1 − R where little is reflected, as fresnel_conductor takes 1 − A where little is absorbed.
            float As = 4.0 * c * t.g.x / t.s2;
            float Ap = 4.0 * c * (t.mg / t.p2);
            r.As = clamp(As > 0.5 ? 1.0 - abs2(vec2(c, 0.0) - t.g) / t.s2 : As, 0.0, 1.0);
            r.Ap = clamp(Ap > 0.5 ? 1.0 - abs2(t.m2 * c - t.g) / t.p2 : Ap, 0.0, 1.0);
            r.A = 0.5 * (r.As + r.Ap);
        }
    }
    return r;
}
#endif
