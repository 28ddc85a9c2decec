// Colour: spectra to XYZ and sRGB, spectral upsampling, dispersion, black bodies, and tone mapping (lecture C1–C4).
// Twins: crates/optics/src/colour.rs; of the tone curves crates/image/src/tone.rs.
// Where to read: pbrt 4, chapter 4; RTR 4, chapter 8; docs/colour.md; IEC 61966-2-1 (sRGB). Assumes: scene-linear values
// with Rec. 709 primaries. No colour is clipped to a gamut here: one outside it has a negative component.
#ifndef COLOUR_GLSL
#define COLOUR_GLSL
#include "lib/arithmetic.glsl"
#include "lib/matching_functions.glsl"

// --------------------------------------------------------------------------------------------------------------------
// Colour matching

// XYZ to linear sRGB, with the four-digit matrix of IEC 61966-2-1.
vec3 linear_srgb(vec3 xyz) {
    return mat3(3.2406, -0.9689, 0.0557, -1.5372, 1.8758, -0.2040, -0.4986, 0.0415, 1.0570) * xyz;
}

struct XyzToSrgb {
    float sR;
    float sG;
    float sB;
};

// @eq C2: linear sRGB of X, Y, Z, white at D65, by the four-digit matrix of IEC 61966-2-1
// X, Y and Z stay below 5e37, or the sums overflow.
// @host crates/optics/src/spectra/mod.rs: converts the film of bands to RGB; a test compares its matrix with this function
XyzToSrgb xyz_to_srgb(float X, float Y, float Z) {
    vec3 rgb = linear_srgb(vec3(X, Y, Z));
    return XyzToSrgb(rgb.r, rgb.g, rgb.b);
}

struct CmfIntegral {
    float X;
    float Y;
    float Z;
    float sR;
    float sG;
    float sB;
    float r10;
    float g10;
    float b10;
};

// @eq C1 C2 N50: X = ∫S x̄ dλ as 5 nm sums over 380 … 780 nm, r10 g10 b10 the three lamps of Stiles & Burch that match
// Plain sums: 81 terms cost 81 roundings at worst. Samples stay below 1e34 in magnitude, or the sums overflow.
// @host crates/optics/src/spectra/mod.rs: integrates bands in steps of 0.5 nm; a test compares their sum with this function
CmfIntegral cmf_integral(float s[81]) {
    vec3 xyz = vec3(0.0);
    vec3 rgb10 = vec3(0.0);
    // @iterations 82
    for (uint i = 0u; i < 81u; ++i) {
        xyz += s[i] * CIE_1931_2DEG[i];
        rgb10 += s[i] * STILES_BURCH_1959_10DEG[i];
    }
    xyz *= 5.0;
    rgb10 *= 5.0;
    vec3 rgb = linear_srgb(xyz);
    return CmfIntegral(xyz.x, xyz.y, xyz.z, rgb.r, rgb.g, rgb.b, rgb10.r, rgb10.g, rgb10.b);
}

struct CmfGaussian {
    float X;
    float Y;
    float Z;
    float r10;
    float g10;
    float b10;
};

// ((λ − μ)/w)²/2, with `scale` = 1/(2w²). Double-float: the exponential multiplies the argument's rounding error by the
// argument.
float gaussian(float lambda, float mu, DoubleFloat scale) {
    DoubleFloat off = two_sum(lambda, -mu);
    DoubleFloat x = df_mul(df_mul(off, off), scale);
    return exp_pair(-x.hi, x.hi < 110.0 ? -x.lo : 0.0);
}

// @eq C1 C2: as cmf_integral, of S = A e^(−((λ − μ)/w)²/2) at the same wavelengths
// |μ| is clamped to 1e6 nm, |w| to [1e-6, 1e6] nm; |A| stays below 1e34, or the sums overflow.
// @host crates/optics/src/spectra/mod.rs: integrates bands in steps of 0.5 nm; a test checks this function against cmf_integral
CmfGaussian cmf_gaussian(float A, float mu_nm, float width_nm) {
    float mu = clamp(mu_nm, -1e6, 1e6);
    float w = clamp(abs(width_nm), 1e-6, 1e6);
    DoubleFloat scale = df_div(DoubleFloat(0.5, 0.0), two_product(w, w));
    vec3 xyz = vec3(0.0);
    vec3 rgb10 = vec3(0.0);
    // @iterations 82
    for (uint i = 0u; i < 81u; ++i) {
        float lambda = 380.0 + 5.0 * float(i);
        float S;
        if (ARITHMETIC == FAST) {
            float t = (lambda - mu) / w;
            S = A * exp(-0.5 * t * t);
        } else {
            S = A * gaussian(lambda, mu, scale);
        }
        xyz += S * CIE_1931_2DEG[i];
        rgb10 += S * STILES_BURCH_1959_10DEG[i];
    }
    xyz *= 5.0;
    rgb10 *= 5.0;
    return CmfGaussian(xyz.x, xyz.y, xyz.z, rgb10.r, rgb10.g, rgb10.b);
}

// --------------------------------------------------------------------------------------------------------------------
// Spectral upsampling of RGB reflectances

// @eq C3: S(x) = 1/2 + x/(2√(1 + x²))
// @out S
// For x < 0 it is 1/(2(1 + x² − x√(1 + x²))): the difference loses the digits of a small S. |x| is clamped to 1e18.
// @host crates/optics/src/spectra/upsampling.rs: evaluates reflectances by upsampled_reflectance; a test compares it with this function
float spectrum_sigmoid(float x) {
    float S;
    if (ARITHMETIC == FAST) {
        S = 0.5 + x / (2.0 * sqrt(1.0 + x * x));
    } else {
        float size = min(abs(x), 1e18);
        float square = 1.0 + size * size;
        float tail = 0.5 / (square + size * sqrt(square));
        S = x < 0.0 ? tail : 1.0 - tail;
    }
    return S;
}

// @eq C3: ρ(λ) = S((c0 λ + c1) λ + c2), λ in nm
// @out rho
// Spectral upsampling by Jakob and Hanika 2019: a smooth reflectance in (0, 1) for every colour. Compensated: the
// polynomial is a double-float, because its terms of several hundred cancel to a few. λ is clamped to [0, 1e6] nm,
// coefficients to ±1e20.
// @host crates/optics/src/spectra/upsampling.rs: averages the reflectance of a colour over a band
float upsampled_reflectance(float lambda_nm, float c0, float c1, float c2) {
    float lambda = clamp(lambda_nm, 0.0, 1e6);
    vec3 c = clamp(vec3(c0, c1, c2), -1e20, 1e20);
    float x;
    if (ARITHMETIC == COMPENSATED) {
        DoubleFloat slope = df_add(two_product(c.x, lambda), DoubleFloat(c.y, 0.0));
        x = df_add(df_mul(slope, DoubleFloat(lambda, 0.0)), DoubleFloat(c.z, 0.0)).hi;
    } else {
        x = (c.x * lambda + c.y) * lambda + c.z;
    }
    return spectrum_sigmoid(x);
}

// --------------------------------------------------------------------------------------------------------------------
// Dispersion

struct Sellmeier {
    float n;
    float n_minus_1;
};

// @eq F1 N46: n² − 1 = t = Σ B λ²/(λ² − C), λ in µm; n − 1 = t/(√(1 + t) + 1)
// The Sellmeier equation with four terms, of which glasses use three (B.w = 0). λ²/(λ² − C) = 1 + C/(λ² − C), in the form
// that does not cancel. λ is clamped to [1e-6, 1e9] µm, B, C and the quotients to ±1e18. A term at its own resonance is 0.
// t < −1, inside an absorption band, gives n = 0.
// @host crates/optics/src/spectra/dispersion.rs: computes the refractive index of a medium in a band
Sellmeier sellmeier(float lambda_um, vec4 B, vec4 C) {
    float lambda = clamp(lambda_um, 1e-6, 1e9);
    float l2 = lambda * lambda;
    vec4 b = clamp(B, -1e18, 1e18);
    vec4 c = clamp(C, -1e18, 1e18);
    vec4 d = vec4(l2) - c;
    vec4 part = l2 / d;
    if (ARITHMETIC != FAST) part = mix(part, 1.0 + c / d, lessThan(abs(c), vec4(0.5 * l2)));
    part = mix(clamp(part, -1e18, 1e18), vec4(0.0), equal(d, vec4(0.0)));
    float t = max(dot(b, part), -1.0);
    float root = sqrt(1.0 + t);
    return Sellmeier(root, ARITHMETIC == FAST ? root - 1.0 : t / (root + 1.0));
}

// @eq F1: n = A + B/λ², λ in µm
// @out n
// Cauchy's equation: an adjustable approximation, not measured data. λ is clamped to [1e-6, 1e9] µm, n to [0, 1e9].
// @host crates/optics/src/spectra/dispersion.rs: computes the refractive index of a medium in a band
float cauchy(float lambda_um, float A, float B) {
    float lambda = clamp(lambda_um, 1e-6, 1e9);
    return clamp(A + B / (lambda * lambda), 0.0, 1e9);
}

// --------------------------------------------------------------------------------------------------------------------
// Black bodies

// @eq N48: 1/(e^x − 1), x = hc/(λkT)
// @out y
// The Planck distribution without its factor. 0 from x = 88 on, where e^x overflows; 2^126 for x → 0 and x ≤ 0.
// @host crates/optics/src/spectra/mod.rs: computes black-body spectra by blackbody; a test compares them with this function
float planck(float x) {
    float y;
    if (ARITHMETIC == FAST) {
        y = 1.0 / (exp(x) - 1.0);
    } else {
        y = x < 88.0 ? 1.0 / max(expm1f(x), SMALLEST_NORMAL) : 0.0;
    }
    return y;
}

const float RADIATION_1 = 1.191042972e8;  // 2hc², W µm⁴/(m² sr)
const float RADIATION_2_HI = 14387.769;  // hc/k, µm K
const float RADIATION_2_LO = 2.2035184e-4;

// @eq N48: L = 2hc²/λ⁵ /(e^(hc/(λkT)) − 1) in W/(m² sr µm), λ in µm, T in K
// @out L
// Planck's law, spectral radiance. hc/(λkT) is a double-float: the exponential multiplies its rounding error by its value,
// up to 88. λ is clamped to [1e-3, 1e4] µm, T to [1e-3, 1e12] K. 0 where the exponent exceeds 88.
// @host crates/optics/src/spectra/mod.rs: computes the spectra of lights that are given by a temperature
float blackbody(float lambda_um, float T) {
    float lambda = clamp(lambda_um, 1e-3, 1e4);
    float kelvin = clamp(T, 1e-3, 1e12);
    float l2 = lambda * lambda;
    float power = RADIATION_1 / (l2 * l2 * lambda);
    float L;
    if (ARITHMETIC == FAST) {
        L = power / (exp(RADIATION_2_HI / (lambda * kelvin)) - 1.0);
    } else {
        DoubleFloat x = df_div(DoubleFloat(RADIATION_2_HI, RADIATION_2_LO), two_product(lambda, kelvin));
        float below = expm1f(min(x.hi, 88.0));
        L = x.hi < 88.0 ? power / (below + (below + 1.0) * x.lo) : 0.0;
    }
    return L;
}

// --------------------------------------------------------------------------------------------------------------------
// Display

struct Srgb {
    float encode;
    float decode;
};

// @eq C4 N44: IEC 61966-2-1: 12.92 x or 1.055 x^(1/2.4) − 0.055
// @out encode
// Not above 1 for x up to 1; 0 for negative x. The decimal 0.0031308 lies below its f32, so that f32 is above the
// threshold.
float srgb_encode(float x) {
    float y = 1.055 * powf(x, 1.0 / 2.4) - 0.055;
    y = x <= 1.0 ? min(y, 1.0) : y;
    return x < 0.0031308 ? 12.92 * max(x, 0.0) : y;
}

// v^2.4 is v² v^0.4: the nearest f32 to 0.4 is nearer than that to 2.4. The decimal 0.04045 lies above its f32.
float srgb_decode(float x) {
    float v = (x + 0.055) / 1.055;
    float power = ARITHMETIC == FAST ? pow(v, 2.4) : v * v * powf(v, 0.4);
    return x <= 0.04045 ? max(x, 0.0) / 12.92 : power;
}

// @eq C4 N44 N45: IEC 61966-2-1: encode 12.92 x or 1.055 x^(1/2.4) − 0.055, decode its inverse
// Negative values give 0; above 1 the power continues. A gamma of 2.2 is another curve, off by 0.034. The tier fast has the
// same formula with built-in powers, so that it does not change the look of a picture.
// @lab srgb_encode: laboratory_forms_agree_with_the_functions_of_pictures
Srgb srgb(float x) {
    return Srgb(srgb_encode(x), srgb_decode(x));
}

// --------------------------------------------------------------------------------------------------------------------
// Tone curves. They use the built-in pow and log2: their error, 33 ULP at worst, is far below a step of a display.

vec3 tone_reinhard(vec3 x) {
    return x / (1.0 + x);
}

// Stephen Hill's fit of the ACES reference rendering transform and sRGB output transform.
vec3 tone_aces(vec3 x) {
    const mat3 aces_from_linear = mat3(0.59719, 0.07600, 0.02840, 0.35458, 0.90834, 0.13383, 0.04823, 0.01566, 0.83777);
    const mat3 linear_from_aces =
        mat3(1.60475, -0.10208, -0.00327, -0.53108, 1.10813, -0.07276, -0.07367, -0.00605, 1.07602);
    vec3 v = aces_from_linear * x;
    v = (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081);
    return linear_from_aces * v;
}

// AgX (Troy Sobotka), with Benjamin Wrensch's sixth-order fit of its sigmoid. The result is display-linear.
vec3 tone_agx(vec3 x) {
    const mat3 inset = mat3(
        0.842479062253094, 0.0423282422610123, 0.0423756549057051,
        0.0784335999999992, 0.878468636469772, 0.0784336,
        0.0792237451477643, 0.0791661274605434, 0.879142973793104);
    const mat3 outset = mat3(
        1.19687900512017, -0.0528968517574562, -0.0529716355144438,
        -0.0980208811401368, 1.15190312990417, -0.0980434501171241,
        -0.0990297440797205, -0.0989611768448433, 1.15107367264116);
    const float min_ev = -12.47393;
    const float max_ev = 4.026069;
    vec3 v = (clamp(log2(max(inset * x, 1e-10)), min_ev, max_ev) - min_ev) / (max_ev - min_ev);
    vec3 v2 = v * v;
    vec3 v4 = v2 * v2;
    v = 15.5 * v4 * v2 - 40.14 * v4 * v + 31.96 * v4 - 6.868 * v2 * v + 0.4298 * v2 + 0.1191 * v - 0.00232;
    v = max(outset * v, 0.0);
    // The fit gives display values of gamma 2.2; the caller applies the transfer function.
    return pow(v, vec3(2.2));
}

// Khronos PBR Neutral (specification of 2024).
vec3 tone_khronos_neutral(vec3 x) {
    const float start = 0.8 - 0.04;
    const float desaturation = 0.15;
    float low = min(x.r, min(x.g, x.b));
    float offset = low < 0.08 ? low - 6.25 * low * low : 0.04;
    x -= offset;
    float peak = max(x.r, max(x.g, x.b));
    if (peak >= start) {
        float d = 1.0 - start;
        float new_peak = 1.0 - d * d / (peak + d - start);
        x *= new_peak / peak;
        float g = 1.0 - 1.0 / (desaturation * (peak - new_peak) + 1.0);
        x = mix(x, vec3(new_peak), g);
    }
    return x;
}

// Gamut mapping: moves a colour towards the grey of the same luminance (Rec. 709) until no component is negative. Spectra
// may lie outside the gamut of a display. Without luminance: black.
vec3 desaturated(vec3 x) {
    float y = dot(vec3(0.2126, 0.7152, 0.0722), x);
    float least = min(x.r, min(x.g, x.b));
    vec3 inside = y > 0.0 ? y + (x - y) * (y / (y - least)) : vec3(0.0);
    return least < 0.0 ? max(inside, 0.0) : x;
}

// `curve`: 0 linear, 1 reinhard, 2 aces, 3 agx, 4 khronos-neutral. The result is in [0, 1], display-linear.
vec3 tone(uint curve, vec3 x) {
    // Clamped to the largest half float: a curve with a quotient would give NaN, shown as black, for the brightest pixels.
    x = clamp(x, 0.0, 65504.0);
    if (curve == 1) x = tone_reinhard(x);
    if (curve == 2) x = tone_aces(x);
    if (curve == 3) x = tone_agx(x);
    if (curve == 4) x = tone_khronos_neutral(x);
    return clamp(x, 0.0, 1.0);
}
#endif
