// Reflection models: Lambert, Blinn–Phong, GGX microfacets; their terms and how to sample them (lecture B1–B6, B9).
// Where to read: pbrt 4, section 9.6; RTR 4, section 9.8; Walter et al. 2007 (GGX); Heitz 2014 (Smith masking) and 2018
// (VNDF); Turquin 2019 (energy compensation); Veach 1997, chapter 9 (power heuristic). Twins on the host:
// crates/optics/src/.
// Assumes: N, L, V, H are unit vectors rounded to f32; L and V point away from the surface; α = roughness². Out of domain:
// α is clamped to [1e-9, 1], shine < 0 is 0, F0 is clamped to [0, 1]. A zero vector, or one whose square overflows, counts
// as perpendicular to everything.
#ifndef BRDF_GLSL
#define BRDF_GLSL
#include "lib/arithmetic.glsl"
#include "lib/constants.glsl"
#include "lib/frame.glsl"
#include "lib/fresnel.glsl"

const float SMALLEST_ALPHA = 1e-9;

float alpha_in_domain(float alpha) {
    return clamp(alpha, SMALLEST_ALPHA, 1.0);
}

// --------------------------------------------------------------------------------------------------------------------
// Angles

// The half vector H = (L + V)/|L + V| by its angles to N and to V.
struct HalfAngle {
    float cos_h;
    float sin2_h;
    float cos_d;  // cosine between H and V: |L + V|/2
    float sum2;   // |L + V|²; 0 for L = −V, where H is undefined: then cos_h is 0 and sin2_h 1
};

// The half vector before it meets a normal. All normals of a surface share it.
struct DirectionSum {
    vec3 hi;           // H; 0 where it is undefined. Compensated: L + V without its component along L − V
    vec3 lo;           // compensated: the rest of it; otherwise 0
    DoubleFloat sum2;  // |L + V|², corrected as well
    HalfAngle any_normal;  // what does not depend on a normal
};

// Derivation. S = L + V, D = L − V.
// 1. Where L is near −V, S is exact but short. If rounding makes |L| and |V| differ by 1e-7, S has a component along D.
// 2. For unit vectors S ⟂ D. So the component of S along D is removed: S − (L² − V²)/4 · D, since S·D = L² − V² and D² = 4.
// 3. cosθ_h, sin²θ_h and cosθ_d follow from the corrected S (half_angle of a sum). 2(1 + L·V) would lose |L + V|² altogether
//    (numerics.md 18).
// Compensated: S and D are double-floats, and N × S and N·S are sums of exact products. Textbook: none of it.
DirectionSum sum_of_directions(vec3 L, vec3 V) {
    DirectionSum r = DirectionSum(L + V, vec3(0.0), DoubleFloat(0.0, 0.0), HalfAngle(0.0, 1.0, 0.0, 0.0));
    if (ARITHMETIC == FAST) {
        vec3 H = normalize(r.hi);
        r.any_normal.cos_d = dot(V, H);
        r.any_normal.sum2 = 2.0 * (1.0 + dot(L, V));
        r.hi = H;
    } else if (ARITHMETIC == COMPENSATED) {
        // 1. S and D as double-floats.
        DoubleFloat3 S = two_sums(L, V);
        DoubleFloat3 D = two_sums(L, -V);
        // 2. Remove the component of S along D.
        DoubleFloat l2 = dot2(L, L);
        DoubleFloat v2 = dot2(V, V);
        precise float length_error = ((l2.hi - 1.0) + l2.lo) + ((v2.hi - 1.0) + v2.lo);
        // Divided by (|L| + |V|)², which is 2L² + 2V² to 1e-14: |L + V| may be as small as the correction itself.
        DoubleFloat products = dot2(S.hi, D.hi);
        precise float along_lo = products.lo + (dot(S.lo, D.hi) + dot(S.hi, D.lo));
        DoubleFloat correction = df_div(quick_two_sum(products.hi, along_lo), df_scale(df_add(l2, v2), 2.0));
        DoubleFloat3 turned = two_products(vec3(correction.hi), D.hi);
        precise vec3 turned_lo = turned.lo + (correction.hi * D.lo + correction.lo * D.hi);
        DoubleFloat3 T = two_sums(S.hi, -turned.hi);
        precise vec3 T_lo = (S.lo + T.lo) - turned_lo;
        DoubleFloat t2 = dot2(T.hi, T.hi);
        precise float t2_lo = t2.lo + 2.0 * dot(T.hi, T_lo);
        r.hi = T.hi;
        r.lo = T_lo;
        r.sum2 = quick_two_sum(t2.hi, t2_lo);
        r.any_normal.sum2 = r.sum2.hi - r.sum2.hi * (0.5 * length_error);
        r.any_normal.cos_d = min(0.5 * sqrt(r.any_normal.sum2), 1.0);
    } else {
        // The same steps in f32.
        vec3 D = L - V;
        vec3 S = r.hi - D * (0.25 * dot(r.hi, D));
        float s2 = dot(S, S);
        bool defined = s2 >= SMALLEST_NORMAL;
        r.hi = defined ? S * inversesqrt(s2) : vec3(0.0);
        r.sum2.hi = s2;
        r.any_normal.cos_d = defined ? min(0.5 * sqrt(s2), 1.0) : 0.0;
        r.any_normal.sum2 = defined ? s2 : 0.0;
    }
    return r;
}

// The third step of the derivation above.
HalfAngle half_angle(vec3 N, DirectionSum sum) {
    HalfAngle r = sum.any_normal;
    if (ARITHMETIC == COMPENSATED) {
        DoubleFloat lengths = df_mul(sum.sum2, dot2(N, N));
        bool defined = lengths.hi >= SMALLEST_NORMAL;
        vec3 across = cross2(N, sum.hi) + cross(N, sum.lo);
        DoubleFloat c = dot2(N, sum.hi);
        precise float c_lo = c.lo + dot(N, sum.lo);
        float cos_h = df_div(quick_two_sum(c.hi, c_lo), df_sqrt(lengths)).hi;
        float sin2_h = df_div(dot2(across, across), lengths).hi;
        if (defined) r = HalfAngle(cos_h, sin2_h, r.cos_d, r.sum2);
        else r = HalfAngle(0.0, 1.0, 0.0, 0.0);
    } else if (ARITHMETIC == FAST || sum.sum2.hi >= SMALLEST_NORMAL) {
        r.cos_h = dot(N, sum.hi);
        r.sin2_h = sine_squared(N, sum.hi);
    }
    return r;
}

// @eq B1 N9 N18 N19: H = (L + V)/|L + V|, cosθ_h = N·H, cosθ_d = V·H = |L + V|/2
// The steps: sum_of_directions and half_angle of a sum, which pictures call.
HalfAngle half_angle(vec3 N, vec3 L, vec3 V) {
    return half_angle(N, sum_of_directions(L, V));
}

// The same angle `r` for a lobe that may be wide. For a shininess of 1 the lobe is the cosine itself, and near 90° a plain sum
// leaves no digits of it. So N·S is a sum of exact products here.
HalfAngle phong_half_angle(vec3 N, vec3 L, vec3 V, HalfAngle r) {
    if (ARITHMETIC == STABLE) {
        DoubleFloat l2 = dot2(L, L);
        DoubleFloat v2 = dot2(V, V);
        precise float length_error = (l2.hi - v2.hi) + (l2.lo - v2.lo);
        float correction = 0.25 * length_error * dot(N, L - V);
        DoubleFloat sum = df_add(df_add(dot2(N, L), dot2(N, V)), DoubleFloat(-correction, 0.0));
        r.cos_h = r.sum2 > 0.0 ? sum.hi / sqrt(r.sum2 * dot(N, N)) : 0.0;
    }
    return r;
}

// The same angles without NaN and infinities.
HalfAngle half_angle_in_range(HalfAngle a) {
    bool good = abs(a.cos_h) <= LARGEST && a.sin2_h <= LARGEST && a.sum2 <= LARGEST;
    return HalfAngle(good ? clamp(a.cos_h, -1.0, 1.0) : 0.0, good ? min(a.sin2_h, 1.0) : 1.0,
                     good ? clamp(a.cos_d, 0.0, 1.0) : 0.0, good ? a.sum2 : 0.0);
}

// --------------------------------------------------------------------------------------------------------------------
// The lecture's empirical models

// @eq B4: f_r = k_d = albedo/π, of a white ground that `enters` of the light reaches
// @out fr
float diffuse_brdf(float enters) {
    return INV_PI * enters;
}

struct Lambert {
    float cos_plus;
    float Lref;
};

// @eq B2 B4 B9 N25: L = L_in k_d cos⁺θ, cosθ = N·L
// @lab diffuse_brdf: laboratory_forms_agree_with_the_functions_of_pictures
Lambert lambert(vec3 N, vec3 L, float Lin, float kd) {
    float c = grazing_cosine(N, L);
    float cos_plus = ARITHMETIC == FAST ? max(c, 0.0) : max(cosine_in_range(c), 0.0);
    return Lambert(cos_plus, Lin * (kd * cos_plus));
}

// @eq B5 N17: (cos⁺δ)^shine
// @out lobe
// 0 from 90° on and for L = −V. cos^shine = e^(shine/2 ln(1 − sin²)). For a shininess of 1e7, cosδ is 1 − 1e-6 and keeps
// one digit of δ, while sin²δ keeps all of them; pow on top loses the rest (numerics.md 17). Beyond 45° the cosine itself
// is used.
float phong_lobe(HalfAngle a, float shine) {
    float lobe;
    if (ARITHMETIC == FAST) {
        lobe = pow(max(a.cos_h, 0.0), shine);
    } else {
        bool narrow = a.sin2_h < 0.5;
        DoubleFloat below = quick_two_sum(1.0, -a.sin2_h);
        float base = narrow ? below.hi : max(a.cos_h, SMALLEST_NORMAL);
        Reduced m = log_reduced(base);
        float f = m.f + (narrow ? below.lo * intBitsToFloat((127 - int(m.k)) << 23) : 0.0);
        float exponent = shine * log_sum(m.k, f);
        lobe = a.cos_h > 0.0 ? exp_pair(narrow ? 0.5 * exponent : exponent, 0.0) : 0.0;
    }
    return lobe;
}

// @eq B6 N18: the lobe over (L + V)²
// @out fr
// 0 for L = −V.
float reciprocal_lobe(HalfAngle a, float lobe) {
    return ARITHMETIC == FAST || a.sum2 > 0.0 ? lobe / a.sum2 : 0.0;
}

// The Blinn-Phong model: its terms and the reflected radiance.
struct BlinnPhong {
    float cos_in;
    float cos_delta;
    float sin2_delta;
    float spec;
    float Lref;
};

// @eq B5 B9 N9 N17 N19: L = L_in (k_d cos⁺θ + k_s (cos⁺δ)^shine), cosδ = N·H, H = (L + V)/|L + V|
// Self-shadowing: spec and L are 0 for cosθ < 0, not for cosθ = 0. V may point anywhere, as in the lecture's shade().
// @lab phong_lobe: laboratory_forms_agree_with_the_functions_of_pictures
BlinnPhong blinn_phong(vec3 N, vec3 L, vec3 V, float Lin, float kd, float ks, float shine) {
    BlinnPhong r;
    HalfAngle a = phong_half_angle(N, L, V, half_angle(N, L, V));
    if (ARITHMETIC == FAST) {
        r.cos_in = dot(N, L);
        r.spec = r.cos_in < 0.0 ? 0.0 : phong_lobe(a, shine);
        r.Lref = r.cos_in < 0.0 ? 0.0 : Lin * kd * r.cos_in + Lin * ks * r.spec;
    } else {
        a = half_angle_in_range(a);
        r.cos_in = cosine_in_range(grazing_cosine(N, L));
        r.spec = r.cos_in < 0.0 ? 0.0 : phong_lobe(a, max(shine, 0.0));
        r.Lref = r.cos_in < 0.0 ? 0.0 : Lin * (kd * r.cos_in + ks * r.spec);
    }
    r.cos_delta = a.cos_h;
    r.sin2_delta = a.sin2_h;
    return r;
}

struct ReciprocalPhong {
    float LV2;
    float fr_spec;
    float Lref;
};

// @eq B6 N17 N18: L = L_in (k_d + f_s) cos⁺θ, f_s = k_s (cos⁺δ)^shine/(L + V)²
// The BRDF is symmetric in L and V (reciprocity). f_s is 0 for cosθ < 0, and so is L.
// @lab reciprocal_lobe: laboratory_forms_agree_with_the_functions_of_pictures
ReciprocalPhong reciprocal_phong(vec3 N, vec3 L, vec3 V, float Lin, float kd, float ks, float shine) {
    HalfAngle a = phong_half_angle(N, L, V, half_angle(N, L, V));
    float c = grazing_cosine(N, L);
    ReciprocalPhong r;
    if (ARITHMETIC == FAST) {
        r.fr_spec = c < 0.0 ? 0.0 : ks * reciprocal_lobe(a, phong_lobe(a, shine));
        r.Lref = c < 0.0 ? 0.0 : Lin * (kd + r.fr_spec) * c;
    } else {
        a = half_angle_in_range(a);
        c = cosine_in_range(c);
        r.fr_spec = c < 0.0 ? 0.0 : ks * reciprocal_lobe(a, phong_lobe(a, max(shine, 0.0)));
        r.Lref = c < 0.0 ? 0.0 : Lin * (clamp(kd + r.fr_spec, -LARGEST, LARGEST) * c);
    }
    r.LV2 = a.sum2;
    return r;
}

// Shininess of the Blinn–Phong lobe as wide as a GGX lobe (Walter et al. 2007): α² = 2 / (shine + 2).
float shine_from_alpha(float alpha) {
    return max(2.0 / (alpha * alpha) - 2.0, 0.0);
}

// --------------------------------------------------------------------------------------------------------------------
// GGX microfacets

// @eq B1 N20: D = α²/(π (α² + sin²θ_h (1 − α²))²), 0 for cosθ_h ≤ 0
// @out D
// The GGX (Trowbridge–Reitz) normal distribution (Walter et al. 2007). c²(α² − 1) + 1 cancels at the peak of a narrow lobe.
// With c² = 1 − s² it is the sum α² + s²(1 − α²), and only the sign of the cosine is still needed (numerics.md 20).
float ggx_distribution(float cos_h, float sin2_h, float alpha) {
    float D;
    if (ARITHMETIC == FAST) {
        float t = cos_h * cos_h * (alpha * alpha - 1.0) + 1.0;
        D = alpha * alpha / (PI * t * t);
    } else {
        float k = alpha / (alpha * alpha + sin2_h * ((1.0 - alpha) * (1.0 + alpha)));
        D = k * k * INV_PI;
    }
    return cos_h > 0.0 ? D : 0.0;
}

float ggx_distribution(vec3 N, vec3 H, float alpha) {
    return ggx_distribution(cosine(N, H), sine_squared(N, H), alpha);
}

struct GgxD {
    float cos_h;
    float sin2_h;
    float D;
};

// @eq B1 N9 N20: D = α²/(π (cos²θ_h α² + sin²θ_h)²), 0 for cosθ_h ≤ 0
// @lab ggx_distribution: laboratory_forms_agree_with_the_functions_of_pictures
GgxD ggx_d(vec3 N, vec3 H, float alpha) {
    float cos_h = cosine(N, H);
    float sin2_h = sine_squared(ARITHMETIC == STABLE && cos_h < 0.0 ? -N : N, H);
    float a = alpha;
    if (ARITHMETIC != FAST) {
        cos_h = cosine_in_range(cos_h);
        sin2_h = sin2_h <= 1.0 ? sin2_h : 1.0;
        a = alpha_in_domain(alpha);
    }
    return GgxD(cos_h, sin2_h, ggx_distribution(cos_h, sin2_h, a));
}

// √(cos² + α² sin²), which is cosθ (1 + 2Λ), written as a sum for every α ≤ 1.
float smith_root(float c, float alpha) {
    return sqrt(alpha * alpha + (1.0 - alpha) * (1.0 + alpha) * (c * c));
}

// Smith masking-shadowing: the masking function G₁ = 1/(1 + Λ), without a quotient that is ∞ at 90°.
float smith_g1(float c, float alpha) {
    return 2.0 * c / (c + smith_root(c, alpha));
}

// @eq B1 N22: Λ = (√(1 + α² tan²θ) − 1)/2
// @out lambda
// Smith's Λ for GGX. With q = α² sin²θ and s = √(cos²θ + q), (s − c)/(2c) = q/(2c (s + c)). +∞ at 90°.
float ggx_lambda(float cos_v, float alpha) {
    float lambda;
    if (ARITHMETIC == FAST) {
        float tan2 = (1.0 - cos_v * cos_v) / (cos_v * cos_v);
        lambda = 0.5 * (sqrt(1.0 + alpha * alpha * tan2) - 1.0);
    } else {
        float c = clamp(cos_v, 0.0, 1.0);
        float a = alpha_in_domain(alpha);
        float q = a * a * (1.0 - c) * (1.0 + c);
        float s = sqrt(c * c + q);
        lambda = c >= SMALLEST_NORMAL ? 0.5 * q / (s + c) / c : plus_infinity();
    }
    return lambda;
}

// @eq B1 N23: Vis = G₂/(4 cosθ_l cosθ_v), height-correlated
// @out Vis
// Smith's height-correlated masking-shadowing (Heitz 2014), without division by the cosines. If both are 0: a large number,
// not infinity.
float ggx_visibility(float cos_l, float cos_v, float alpha) {
    float Vis;
    if (ARITHMETIC == FAST) {
        float G2 = 1.0 / (1.0 + ggx_lambda(cos_l, alpha) + ggx_lambda(cos_v, alpha));
        Vis = G2 / (4.0 * cos_l * cos_v);
    } else {
        float l = cos_v * smith_root(cos_l, alpha);
        float v = cos_l * smith_root(cos_v, alpha);
        Vis = 0.5 / max(l + v, SMALLEST_NORMAL);
    }
    return Vis;
}

struct GgxG {
    float G1_L;
    float G1_V;
    float G2;
    float Vis;
};

// @eq B1 N23: G₁ = 1/(1 + Λ), G₂ = 1/(1 + Λ_l + Λ_v), Vis = G₂/(4 N·L N·V)
// Λ → ∞ at 90°, where G₁ = 2c/(c + √(c² + α² sin²)) goes to 0 with all its digits. Cosines are clamped to [0, 1].
// @lab ggx_visibility: laboratory_forms_agree_with_the_functions_of_pictures
GgxG ggx_g(float NoL, float NoV, float alpha) {
    GgxG r;
    if (ARITHMETIC == FAST) {
        float l = ggx_lambda(NoL, alpha);
        float v = ggx_lambda(NoV, alpha);
        r = GgxG(1.0 / (1.0 + l), 1.0 / (1.0 + v), 1.0 / (1.0 + l + v), ggx_visibility(NoL, NoV, alpha));
    } else {
        float a = alpha_in_domain(alpha);
        float cl = clamp(NoL, 0.0, 1.0);
        float cv = clamp(NoV, 0.0, 1.0);
        float ql = smith_root(cl, a);
        float qv = smith_root(cv, a);
        r.G1_L = 2.0 * cl / (cl + ql);
        r.G1_V = 2.0 * cv / (cv + qv);
        // Divided one by one: the product of two cosines of 1e-30 is no float.
        bool lit = min(cl, cv) >= SMALLEST_NORMAL;
        r.G2 = lit ? 2.0 / (ql / cl + qv / cv) : 0.0;
        r.Vis = ggx_visibility(cl, cv, a);
    }
    return r;
}

// @eq F2 N1: F = F0 + (1 − F0)(1 − V·H)⁵
// @out F
// @lab schlick: laboratory_forms_agree_with_the_functions_of_pictures
float ggx_f(float F0, float VoH) {
    float f0 = ARITHMETIC == FAST ? F0 : clamp(F0, 0.0, 1.0);
    return schlick(vec3(f0), 1.0, VoH).x;
}

struct Ggx {
    float D;
    float G2;
    float F;
    float fr;
    float fr_cos;
};

// @eq B1 B2 B3: f_r = D G₂ F/(4 N·L N·V)
// V·H is |L + V|/2. f_r is 0 where L or V is below the surface.
// @lab ggx_distribution: laboratory_forms_agree_with_the_functions_of_pictures
Ggx ggx(vec3 N, vec3 L, vec3 V, float alpha, float F0) {
    HalfAngle h = half_angle(N, L, V);
    float NoL = grazing_cosine(N, L);
    float NoV = grazing_cosine(N, V);
    float a = alpha;
    if (ARITHMETIC != FAST) {
        h = half_angle_in_range(h);
        NoL = cosine_in_range(NoL);
        NoV = cosine_in_range(NoV);
        a = alpha_in_domain(alpha);
    }
    GgxG G = ggx_g(NoL, NoV, a);
    Ggx r;
    r.D = ggx_distribution(h.cos_h, h.sin2_h, a);
    r.G2 = G.G2;
    r.F = ggx_f(F0, h.cos_d);
    if (ARITHMETIC == FAST) {
        r.fr = r.D * r.G2 * r.F / (4.0 * NoL * NoV);
    } else {
        r.fr = NoL > 0.0 && NoV > 0.0 ? min(r.D * G.Vis, LARGEST) * r.F : 0.0;
    }
    r.fr_cos = r.fr * NoL;
    return r;
}

// Energy that single scattering loses on a white metal, relative to the energy it reflects: (1 − E)/E.
float ggx_missing(float albedo) {
    float E = clamp(albedo, 1.0 / 1024.0, 1.0);
    return ARITHMETIC == FAST ? 1.0 / albedo - 1.0 : (1.0 - E) / E;
}

// @eq B1: factor = 1 + F0 (1/E − 1)
// @out factor
// Energy compensation (Turquin 2019): scales the single-scattering lobe so that a white metal reflects all light it
// receives. Keeping the shape of the lobe is Turquin's simplification: light that scatters several times leaves the
// microsurface in more uniform directions (lecture B1). E is the directional albedo of the lobe with F = 1, clamped to
// [1/1024, 1]; that of GGX is above 0.3.
float ggx_compensation(float F0, float albedo) {
    return 1.0 + F0 * ggx_missing(albedo);
}

vec3 ggx_compensation(vec3 F0, float albedo) {
    return 1.0 + F0 * ggx_missing(albedo);
}

// --------------------------------------------------------------------------------------------------------------------
// Sampling

struct GgxSample {
    float sin_h;
    float cos_h;
};

// @eq B1 N21: tan²θ_h = α² u/(1 − u): half vectors of density D cosθ_h
// Sampling of the normal distribution (Walter et al. 2007). sin = α√u/√((1 − u) + α²u): √(1 − cos²) is 0 for narrow lobes.
GgxSample ggx_sample(float u, float alpha) {
    GgxSample r;
    if (ARITHMETIC == FAST) {
        r.cos_h = sqrt((1.0 - u) / (1.0 + (alpha * alpha - 1.0) * u));
        r.sin_h = sqrt(1.0 - r.cos_h * r.cos_h);
    } else {
        float x = clamp(u, 0.0, 1.0);
        float a = alpha_in_domain(alpha);
        float root = sqrt((1.0 - x) + a * a * x);
        r = GgxSample(a * sqrt(x) / root, sqrt(1.0 - x) / root);
    }
    return r;
}

// @eq B1: p(L) = G₁ D/(4 cosθ_v) per solid angle: of V mirrored at the half vectors of visible_half_vector
// @out pdf
// Density of reflected directions for half vectors sampled from the VNDF (Heitz 2018).
float mirrored_pdf(float cos_v, HalfAngle h, float alpha) {
    return smith_g1(cos_v, alpha) * ggx_distribution(h.cos_h, h.sin2_h, alpha) / (4.0 * cos_v);
}

// @eq B1: H of density D max(V·H, 0) G₁/cosθ_v: a point of a disk, moved up by what the viewer sees of the hemisphere below
// @out h
// Sampling of the VNDF, the distribution of visible normals (Heitz, JCGT 7(4) 2018). v and h are in the frame of the
// normal, and `alphas` are α along its first and its second axis.
vec3 visible_half_vector(vec3 v, vec2 alphas, vec2 u) {
    vec3 stretched = normalize(vec3(alphas * v.xy, v.z));
    float across2 = dot(stretched.xy, stretched.xy);
    vec3 t = across2 > 0.0 ? vec3(-stretched.y, stretched.x, 0.0) * inversesqrt(across2) : vec3(1.0, 0.0, 0.0);
    vec3 b = cross(stretched, t);
    vec2 disk = sqrt(u.x) * cos_sin_of_turns(u.y);
    float s = 0.5 * (1.0 + stretched.z);
    disk.y = (1.0 - s) * sqrt(max(1.0 - disk.x * disk.x, 0.0)) + s * disk.y;
    vec3 h = disk.x * t + disk.y * b + sqrt(max(1.0 - dot(disk, disk), 0.0)) * stretched;
    return normalize(vec3(alphas * h.xy, max(h.z, 0.0)));
}

// A half vector sampled from the VNDF, in the space of n and v.
vec3 half_vector(vec3 n, vec3 v, float alpha, vec2 u) {
    OrthonormalBasis frame = orthonormal_basis(n);
    vec3 local = vec3(dot(v, frame.t), dot(v, frame.b), max(dot(v, n), 1e-4));
    vec3 h = visible_half_vector(local, vec2(alpha), u);
    return frame.t * h.x + frame.b * h.y + n * h.z;
}

// @eq B1 N22: G₂/G₁ = (1 + Λ_v)/(1 + Λ_v + Λ_l)
// @out share
// Weight of VNDF sampling: masking-shadowing over masking, for a direction l reflected at a visible facet. Cosines from
// 1e-4 on.
float smith_g2_over_g1(float cos_v, float cos_l, float alpha) {
    float lambda_v = ggx_lambda(max(abs(cos_v), 1e-4), alpha);
    float lambda_l = ggx_lambda(max(abs(cos_l), 1e-4), alpha);
    return (1.0 + lambda_v) / (1.0 + lambda_v + lambda_l);
}

struct CosineSample {
    vec3 L;
    float pdf;
};

// @eq B4 N49: L = (√u₁ cos 2πu₂, √u₁ sin 2πu₂, √(1 − u₁)), p(L) = cosθ/π
// Cosine-weighted hemisphere about the z axis. z comes from 1 − u₁, not from 1 − x² − y², which may be below 0. u₁ is
// clamped to [0, 1 − 2^-24], so that no direction lies in the surface, where its density would be 0. z has half an ulp of
// 1 − u₁ and the square root's own: half an ulp where that is rounded correctly, 0.94 on NVIDIA's H100.
CosineSample cosine_sample(float u1, float u2) {
    CosineSample r;
    if (ARITHMETIC == FAST) {
        vec2 p = sqrt(u1) * cos_sin_of_turns(u2);
        r.L = vec3(p, sqrt(1.0 - p.x * p.x - p.y * p.y));
    } else {
        float u = clamp(u1, 0.0, 0.999999940395355);
        r.L = vec3(sqrt(u) * cos_sin_of_turns(u2), sqrt(1.0 - u));
    }
    r.pdf = r.L.z * INV_PI;
    return r;
}

// @eq N24: w = p²/(p² + q²), the power heuristic for a sample of density p that q might have drawn
// @out w
// Multiple importance sampling (Veach 1997). Computed by the quotient of the smaller over the larger density: its square
// may underflow but never overflows. Densities below 0 count as 0; w is 0 for p = 0 and 1 for p = ∞.
float mis_weight(float p, float q) {
    float w;
    if (ARITHMETIC == FAST) {
        w = p * p / (p * p + q * q);
    } else {
        float a = max(p, 0.0);
        float b = max(q, 0.0);
        float ratio = a < b ? a / b : b / a;
        float r2 = ratio * ratio;
        w = a < b ? r2 / (1.0 + r2) : 1.0 / (1.0 + r2);
        w = a == 0.0 ? 0.0 : a > LARGEST ? 1.0 : w;
    }
    return w;
}
#endif
