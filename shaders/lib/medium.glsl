// Absorption in media by the Beer–Lambert law, and quadrature of the optical depth by ray marching (lecture A1, A2).
// The absorption coefficient σ in 1/m times a length in m is the optical depth τ; the transmittance is e^(−τ). For a
// heterogeneous medium τ is the integral of σ along the ray (lib/sigma_grid.glsl).
// Where to read: pbrt 4, section 11.2; RTR 4, section 14.1. Twins: crates/optics/src/. Out of domain: a negative σ, length
// or κ counts as 0.
#ifndef MEDIUM_GLSL
#define MEDIUM_GLSL
#include "lib/arithmetic.glsl"
#include "lib/constants.glsl"

// Transmittance e^(−τ). Beyond 110 it is 0 for every lo, and lo may be larger than exp_pair allows.
float transmittance(DoubleFloat tau) {
    return exp_pair(-tau.hi, tau.hi < 110.0 ? -tau.lo : 0.0);
}

// Absorptance 1 − e^(−τ), T = e^(−τ): T itself has no digits for it where little is absorbed.
float absorptance(DoubleFloat tau, float T) {
    return T * (tau.hi < 110.0 ? tau.lo : 0.0) - expm1f(-tau.hi);
}

struct BeerLambert {
    float tau;
    float T;
    float one_minus_T;
    float L;
};

// @eq A1 N27 N28 N29: L = L0 e^(−τ), τ = σd; one_minus_T = 1 − e^(−τ)
// Rounding σd alone costs T τ/2 ULP, so its rounding error goes into the exponential. τ = 0 for σ = 0 or d = 0, whatever
// the other is; +∞ where τ overflows. L is (L0 e^(−τ/2)) e^(−τ/2) where T underflows and L may not.
BeerLambert beer_lambert(float L0, float sigma, float d) {
    BeerLambert r;
    if (ARITHMETIC == FAST) {
        r.tau = sigma * d;
        r.T = exp(-r.tau);
        r.one_minus_T = 1.0 - r.T;
        r.L = L0 * r.T;
    } else {
        DoubleFloat product = two_product(sigma, d);
        bool absorbs = sigma > 0.0 && d > 0.0;
        DoubleFloat tau = DoubleFloat(absorbs ? product.hi : 0.0, absorbs ? product.lo : 0.0);
        float half_T = transmittance(df_scale(tau, 0.5));
        r.tau = tau.hi;
        r.T = transmittance(tau);
        r.one_minus_T = absorptance(tau, r.T);
        r.L = r.T >= SMALLEST_NORMAL ? L0 * r.T : L0 * half_T * half_T;
    }
    return r;
}

// --------------------------------------------------------------------------------------------------------------------
// Quadrature: sums over the steps of a ray march

// Adds one step's σ to sum + rest. Rests may be added in any order, so they are not `precise`: with it glslang does not
// terminate here.
void add_absorption(inout float sum, inout float rest, float sigma) {
    if (ARITHMETIC == FAST) {
        sum += sigma;
    } else {
        DoubleFloat t = two_sum(sum, sigma);
        sum = t.hi;
        rest += t.lo;
    }
}

// 1 + m·2^-23, with m the leading 23 bits of the word: a float in [1, 2).
float scrambled(uint word) {
    return uintBitsToFloat(0x3f800000u | (word >> 9));
}

const uint GOLDEN = 2654435761u;  // 2^32 over the golden ratio
const uint MOST_STEPS = 2097152u;  // 2^21

struct BeerLambertSum {
    float tau;
    float T;
    float one_minus_T;
};

// Repeats a statement. Unrolled, because lavapipe ends all loops of an invocation after 65,535 iterations.
#define TIMES_8(statement) statement statement statement statement statement statement statement statement
#define TIMES_64(statement) TIMES_8(TIMES_8(statement))

// @eq A2 N30: τ = Σ σ_i Δs, σ_i = s0(1 + m_i 2^-23), m_i the leading 23 bits of (2654435761 i + seed) mod 2^32
// A plain running sum of n floats loses n/2 ULP at worst, so the sum is a double-float. s0 and Δs, common to all steps, are
// multiplied in once. More than 2^21 steps count as n = 0.
// @lab add_sigma: a_constant_grid_is_a_homogeneous_medium
BeerLambertSum beer_lambert_sum(uint n, float s0, float ds, uint seed) {
    uint steps = n <= MOST_STEPS ? n : 0u;
    uint word = seed;
    float sum = 0.0;
    float rest = 0.0;
    float factor = ARITHMETIC == FAST ? s0 : 1.0;
    float width = ARITHMETIC == FAST ? ds : 1.0;
    // @iterations 32769
    for (uint block = 0u; block < steps / 64u; ++block) {
        TIMES_64(add_absorption(sum, rest, factor * scrambled(word) * width); word += GOLDEN;)
        // The rest stays so small that its own rounding does not matter.
        DoubleFloat t = quick_two_sum(sum, rest);
        sum = t.hi;
        rest = t.lo;
    }
    // @iterations 64
    for (uint i = 0u; i < steps % 64u; ++i) {
        add_absorption(sum, rest, factor * scrambled(word) * width);
        word += GOLDEN;
    }
    BeerLambertSum r;
    if (ARITHMETIC == FAST) {
        r.tau = sum;
        r.T = exp(-sum);
        r.one_minus_T = 1.0 - r.T;
    } else {
        DoubleFloat product = df_mul(quick_two_sum(sum, rest), two_product(s0, ds));
        bool absorbs = steps > 0u && s0 > 0.0 && ds > 0.0;
        DoubleFloat tau = DoubleFloat(absorbs ? product.hi : 0.0, absorbs ? product.lo : 0.0);
        r.tau = tau.hi;
        r.T = transmittance(tau);
        r.one_minus_T = absorptance(tau, r.T);
    }
    return r;
}

const uint QUADRATURE_LEFT = 0;
const uint QUADRATURE_MIDPOINT = 1;
const uint QUADRATURE_SIMPSON = 2;

// @eq A2 N31: ∫σ ds ≈ Δs/w Σ (x σ(s_i) + y σ(s_i + Δs/2)) + Δs/w z (σ(S) − σ(0)), rule 0 left (slide), 1 midpoint, 2 Simpson
// @out w
// Weights (x, y, z, w) of quadrature rules of first, second and fourth order. In Simpson's sum the end of each step is
// counted as the start of the next.
vec4 quadrature_weights(uint rule) {
    return rule == QUADRATURE_LEFT ? vec4(1.0, 0.0, 0.0, 1.0)
        : rule == QUADRATURE_MIDPOINT ? vec4(0.0, 1.0, 0.0, 1.0)
        : vec4(2.0, 4.0, 1.0, 6.0);
}

const uint MOST_MARCHED = 4096u;

struct MarchOpticalDepth {
    float tau;
    float T;
};

// @eq A2 N31: τ ≈ Σ σ(s_i) Δs of σ(s) = σ0 e^(−falloff s), s in [0, d]; rule 0 left (slide), 1 midpoint, 2 Simpson
// The optical depth of an exponential atmosphere: its integral σ0 (1 − e^(−falloff d))/falloff gives the error of each
// rule. Steps are clamped to [1, 4096]; τ is at most the largest float. A negative falloff is a density that grows.
// @lab mean_sigma: errors_fall_by_the_order_of_the_rule
MarchOpticalDepth march_optical_depth(float sigma0, float falloff, float d, uint steps, uint rule) {
    uint n = clamp(steps, 1u, MOST_MARCHED);
    float S = max(d, 0.0);
    float ds = S / float(n);
    vec4 w = quadrature_weights(rule);
    float sum = 0.0;
    float rest = 0.0;
    // @iterations 4097
    for (uint i = 0u; i < n; ++i) {
        if (w.x != 0.0) add_absorption(sum, rest, w.x * expf(-falloff * (float(i) * ds)));
        if (w.y != 0.0) add_absorption(sum, rest, w.y * expf(-falloff * ((float(i) + 0.5) * ds)));
    }
    if (w.z != 0.0) add_absorption(sum, rest, w.z * expm1f(-falloff * S));
    float mean = min((sum + rest) / w.w, LARGEST);
    float tau = min(max(sigma0, 0.0) * min(mean * ds, LARGEST), LARGEST);
    return MarchOpticalDepth(tau, expf(-tau));
}
#endif
