// Error-free sums and products, double-float arithmetic, and exp, log, pow and atan2 to a few ULP.
// Vulkan's own exp, log, pow and atan are less precise (numerics.md 2). Twins on the host: crates/optics/src/arithmetic.rs.
// Where to read: Knuth, The Art of Computer Programming 2, section 4.2.2 (two_sum); Dekker 1971 (two_product); Ogita, Rump
// and Oishi 2005 (dot2); pbrt 4, section 6.8 (rounding error).
//
// Everything here is made of + − × / √ and bit patterns, so devices that round to nearest give the same bits. Every step is
// `precise`: a compiler may otherwise fuse or reassociate, and the computed rounding error becomes 0. `fma` is never used:
// a device may implement it as a multiplication and an addition. Polynomials are minimax fits by Lawson's reweighted least
// squares. Their coefficients are rounded to f32 one after the other, and the remaining ones are fitted again.
#ifndef ARITHMETIC_GLSL
#define ARITHMETIC_GLSL
#include "lib/constants.glsl"

// The knob `arithmetic`. 0: textbook formulas and built-in functions. 1: formulas rewritten so that nothing cancels. 2:
// double-float sums and products where they still gain digits.
layout(constant) const uint ARITHMETIC = 1;
const uint FAST = 0;
const uint STABLE = 1;
const uint COMPENSATED = 2;

const float LARGEST = 3.402823466e38;
const float SMALLEST_NORMAL = 1.175494351e-38;

// k · LN2_HI is exact for every exponent k.
const float LN2_HI = 0.693359375;
const float LN2_LO = -2.121944401e-4;
const float LOG2_E = 1.44269504;
// 1, 2 and 4 times EIGHTH_HI are exact, and 3 times as well.
const float EIGHTH_HI = 0.785398483276;  // π/4
const float EIGHTH_LO = -3.19878919e-7;
const float TAN_PI_8 = 0.414213562;

float plus_infinity() {
    return uintBitsToFloat(0x7f800000u);
}

// x (1 − t) + y t. Not mix(): drivers compile it in one of two ways, by what else stands in the program, but all plans of a
// scene have to agree to the bit.
vec3 blend(vec3 x, vec3 y, float t) {
    precise vec3 kept = x * (1.0 - t);
    precise vec3 sum = kept + y * t;
    return sum;
}

float blend(float x, float y, float t) {
    precise float kept = x * (1.0 - t);
    precise float sum = kept + y * t;
    return sum;
}

// 2^n, n in [-126, 127].
float power_of_two(int n) {
    return intBitsToFloat((n + 127) << 23);
}

// --------------------------------------------------------------------------------------------------------------------
// Double-float numbers: the value is hi + lo, with |lo| ≤ ULP(hi)/2. Where hi overflows, lo is 0 and not ∞ − ∞.
//
// glslang does not terminate where a `precise` value comes from a member of a variable that is assigned from its own
// member: `s = two_sum(s.hi, x); precise float r = s.lo + y;`. So each result gets a new variable. Loops carry either whole
// pairs, `s = df_add(s, t)`, or plain floats, `DoubleFloat t = two_sum(sum, x); rest += t.lo; sum = t.hi;`.

struct DoubleFloat {
    float hi;
    float lo;
};

// @eq N11 N25 N30: hi + lo = a + b exactly, hi = fl(a + b)
// Knuth's two-sum: no condition on the magnitudes.
DoubleFloat two_sum(float a, float b) {
    precise float s = a + b;
    precise float b_in_s = s - a;
    precise float a_in_s = s - b_in_s;
    precise float rest = (a - a_in_s) + (b - b_in_s);
    return DoubleFloat(s, abs(s) <= LARGEST ? rest : 0.0);
}

// Three double-floats, for which compilers and validators see a third of the instructions.
struct DoubleFloat3 {
    vec3 hi;
    vec3 lo;
};

// two_sum of each component.
DoubleFloat3 two_sums(vec3 a, vec3 b) {
    precise vec3 s = a + b;
    precise vec3 b_in_s = s - a;
    precise vec3 a_in_s = s - b_in_s;
    precise vec3 rest = (a - a_in_s) + (b - b_in_s);
    return DoubleFloat3(s, mix(vec3(0.0), rest, lessThanEqual(abs(s), vec3(LARGEST))));
}

// @eq N11 N25 N30: hi + lo = a + b exactly, for |a| ≥ |b| or a = 0
// Dekker's fast two-sum: half the operations of Knuth's. If |a| < |b|, lo may lack the last bits.
DoubleFloat quick_two_sum(float a, float b) {
    precise float s = a + b;
    precise float b_in_s = s - a;
    precise float rest = b - b_in_s;
    return DoubleFloat(s, abs(s) <= LARGEST ? rest : 0.0);
}

// The leading 12 of 24 bits. Veltkamp's splitting, 4097·a − (4097·a − a), costs twice as much and overflows above 8e34.
float leading_half(float a) {
    return uintBitsToFloat(floatBitsToUint(a) & 0xfffff000u);
}

vec3 leading_halves(vec3 a) {
    return uintBitsToFloat(floatBitsToUint(a) & 0xfffff000u);
}

// @eq N11 N25 N28: hi + lo = a·b exactly, hi = fl(a·b)
// Dekker's product: halves of 12 bits have exact products, and each partial sum below fits into 24 bits. Where |a·b| <
// 2^-102 the error is below the normal range and lo is rounded or 0.
DoubleFloat two_product(float a, float b) {
    precise float p = a * b;
    precise float a_hi = leading_half(a);
    precise float a_lo = a - a_hi;
    precise float b_hi = leading_half(b);
    precise float b_lo = b - b_hi;
    precise float rest = (((a_hi * b_hi - p) + a_hi * b_lo) + a_lo * b_hi) + a_lo * b_lo;
    return DoubleFloat(p, abs(p) <= LARGEST ? rest : 0.0);
}

// two_product of each component.
DoubleFloat3 two_products(vec3 a, vec3 b) {
    precise vec3 p = a * b;
    precise vec3 a_hi = leading_halves(a);
    precise vec3 a_lo = a - a_hi;
    precise vec3 b_hi = leading_halves(b);
    precise vec3 b_lo = b - b_hi;
    precise vec3 rest = (((a_hi * b_hi - p) + a_hi * b_lo) + a_lo * b_hi) + a_lo * b_lo;
    return DoubleFloat3(p, mix(vec3(0.0), rest, lessThanEqual(abs(p), vec3(LARGEST))));
}

// @eq N11: a + b, relative error 3·2^-48
// The accurate variant, with two_sum for both pairs of parts: the bound holds whatever cancels.
DoubleFloat df_add(DoubleFloat a, DoubleFloat b) {
    DoubleFloat s = two_sum(a.hi, b.hi);
    DoubleFloat t = two_sum(a.lo, b.lo);
    precise float rest = s.lo + t.hi;
    DoubleFloat u = quick_two_sum(s.hi, rest);
    precise float last = u.lo + t.lo;
    return quick_two_sum(u.hi, last);
}

// −a, exactly
DoubleFloat df_negate(DoubleFloat a) {
    return DoubleFloat(-a.hi, -a.lo);
}

// a·s, exactly, for s a power of two
DoubleFloat df_scale(DoubleFloat a, float s) {
    return DoubleFloat(a.hi * s, a.lo * s);
}

// @eq N11: a·b, relative error 6·2^-48
DoubleFloat df_mul(DoubleFloat a, DoubleFloat b) {
    DoubleFloat p = two_product(a.hi, b.hi);
    precise float rest = p.lo + (a.hi * b.lo + a.lo * b.hi);
    return quick_two_sum(p.hi, abs(p.hi) <= LARGEST ? rest : 0.0);
}

// @eq N11: a/b, relative error 2^-44
// One Newton step from fl(a_hi/b_hi). The error of that quotient does not matter. 0/0 is 0, a/0 is ±∞.
DoubleFloat df_div(DoubleFloat a, DoubleFloat b) {
    precise float q = a.hi == 0.0 ? 0.0 : a.hi / b.hi;
    DoubleFloat p = two_product(q, b.hi);
    precise float rest = (((a.hi - p.hi) - p.lo) + (a.lo - q * b.lo)) / b.hi;
    return quick_two_sum(q, abs(q) <= LARGEST && q != 0.0 ? rest : 0.0);
}

// @eq N11: √a, relative error 2^-44; 0 for a ≤ 0
// One Newton step from fl(√a_hi). The error of that root does not matter.
DoubleFloat df_sqrt(DoubleFloat a) {
    bool positive = a.hi > 0.0;
    precise float root = positive ? sqrt(a.hi) : 0.0;
    DoubleFloat p = two_product(root, root);
    precise float rest = (((a.hi - p.hi) - p.lo) + a.lo) / (2.0 * root);
    return quick_two_sum(root, positive ? rest : 0.0);
}

// n² − 1
DoubleFloat df_square_minus_one(float n) {
    return df_add(two_product(n, n), DoubleFloat(-1.0, 0.0));
}

// a × b, each component as if computed in twice the precision.
vec3 cross2(vec3 a, vec3 b) {
    DoubleFloat3 p = two_products(a.yzx, b.zxy);
    DoubleFloat3 q = two_products(a.zxy, b.yzx);
    DoubleFloat3 s = two_sums(p.hi, -q.hi);
    precise vec3 rest = s.lo + (p.lo - q.lo);
    precise vec3 sum = s.hi + rest;
    return sum;
}

// @eq N11 N25: a_x b_x + a_y b_y + a_z b_z as if in twice the precision
// Ogita, Rump and Oishi: exact products and sums; their rounding errors are added in f32. Error 2^-46 of the sum of
// magnitudes. Components stay below 1e19: the products overflow above.
DoubleFloat dot2(vec3 a, vec3 b) {
    DoubleFloat3 p = two_products(a, b);
    DoubleFloat s = two_sum(p.hi.x, p.hi.y);
    DoubleFloat t = two_sum(s.hi, p.hi.z);
    precise float rest = ((p.lo.x + p.lo.y) + (s.lo + p.lo.z)) + t.lo;
    return two_sum(t.hi, rest);
}

// --------------------------------------------------------------------------------------------------------------------
// Exponential

// @eq N28: e^(x + lo)
// @out y
// Assumes |lo| ≤ ULP(x). Reduction: x = k ln 2 + r, |r| ≤ ln(2)/2, e^r = 1 + r + r²P(r). The result is +∞ above 88.72284,
// and below -87.34 it is 0, or a denormal where the device keeps them. Selects instead of clamp keep NaN as NaN.
float exp_pair(float x, float lo) {
    precise float c = x > 89.0 ? 89.0 : x;
    c = c < -104.0 ? -104.0 : c;
    precise float k = floor(c * LOG2_E + 0.5);
    precise float r = ((c - k * LN2_HI) - k * LN2_LO) + lo;
    precise float p = ((((1.38198258e-3 * r + 8.36868677e-3) * r + 4.16682772e-2) * r + 0.166665211) * r + 0.49999994);
    precise float y = (p * (r * r) + r) + 1.0;
    // 2^k in two factors: 2^128 and numbers below 2^-126 are no normal floats, but results near them are.
    int n = int(k);
    int half_n = n >> 1;
    precise float scaled = y * power_of_two(half_n) * power_of_two(n - half_n);
    return scaled;
}

// e^x
float expf(float x) {
    if (ARITHMETIC == FAST) return exp(x);
    return exp_pair(x, 0.0);
}

// @eq N27: e^x − 1
// @out y
// 2^k (e^r − 1) + (2^k − 1), computed in halves so that k = 128 does not overflow early. For k = 0 the first term alone.
float expm1f(float x) {
    if (ARITHMETIC == FAST) return exp(x) - 1.0;
    precise float c = x > 89.0 ? 89.0 : x;
    c = c < -18.0 ? -18.0 : c;
    precise float k = floor(c * LOG2_E + 0.5);
    precise float r = (c - k * LN2_HI) - k * LN2_LO;
    precise float p = ((((1.38707086e-3 * r + 8.36627278e-3) * r + 4.16674353e-2) * r + 0.166665465) * r + 0.49999997);
    precise float y = p * (r * r) + r;
    float scale = power_of_two(int(k) - 1);
    precise float sum = 2.0 * (scale * y + (scale - 0.5));
    return k == 0.0 ? y : sum;
}

// --------------------------------------------------------------------------------------------------------------------
// Logarithm

struct Reduced {
    float k;
    float f;
};

// x = 2^k (1 + f), 1 + f in [√½, √2), for x a positive normal number.
Reduced log_reduced(float x) {
    int i = floatBitsToInt(x) - 0x3f3504f3;  // √½
    return Reduced(float(i >> 23), intBitsToFloat((i & 0x7fffff) + 0x3f3504f3) - 1.0);
}

// Scales positive numbers below the normal range into it. Where the device reads them as 0, the logarithm is -∞.
float log_scaled(float x) {
    return x < SMALLEST_NORMAL ? x * 33554432.0 : x;
}

float log_scale(float x) {
    return x < SMALLEST_NORMAL ? 25.0 : 0.0;
}

// k ln 2 + ln(1 + f), ln(1 + f) = f − f²/2 + f³P(f).
float log_sum(float k, float f) {
    precise float p = (((-7.63643906e-2 * f + 0.127622172) * f - 0.131596103) * f + 0.1420158) * f - 0.166234091;
    p = ((p * f + 0.200012416) * f - 0.250008196) * f + 0.333333313;
    precise float f2 = f * f;
    precise float small = (p * (f2 * f) + k * LN2_LO) - 0.5 * f2;
    precise float y = (f + small) + k * LN2_HI;
    return y;
}

// @eq N17 N44: hi + lo = ln x, to 2^-30 of itself
// The bound holds near 1 as well. (-∞, 0) for x ≤ 0.
// x = 2^k m, ln m = ln c + 2 artanh(s), s = (m − c)/(m + c), with c the nearest of three numbers. So s², and with it the
// part that f32 must carry, stays below 0.0035. ln c is a multiple of 1/512, as LN2_HI is, plus some 1e-8.
DoubleFloat df_log(float x) {
    Reduced m = log_reduced(log_scaled(x));
    precise float k = m.k - log_scale(x);
    bool low = m.f < -0.1088;
    bool high = m.f > 0.1221;
    float c = low ? 0.79416126 : high ? 1.25919008 : 1.0;
    float ln_c_hi = low ? -0.23046875 : high ? 0.23046875 : 0.0;
    float ln_c_lo = low ? 1.00413228e-8 : high ? -2.73426691e-8 : 0.0;
    precise float from_c = (m.f + 1.0) - c;
    DoubleFloat d = quick_two_sum(2.0 * c, from_c);
    precise float s = from_c / d.hi;
    DoubleFloat p = two_product(s, d.hi);
    precise float s_lo = (((from_c - p.hi) - p.lo) - s * d.lo) / d.hi;
    precise float z = s * s;
    precise float series = (0.401403874 * z + 0.666665137) * z;
    DoubleFloat sum = quick_two_sum(k * LN2_HI + ln_c_hi, 2.0 * s);
    precise float rest = sum.lo + ((s * series + 2.0 * s_lo) + (k * LN2_LO + ln_c_lo));
    DoubleFloat y = quick_two_sum(sum.hi, rest);
    bool finite = x > 0.0 && x <= LARGEST;
    float end = x <= 0.0 ? -plus_infinity() : x;
    return DoubleFloat(finite ? y.hi : end, finite ? y.lo : 0.0);
}

// @eq N17 N44: x^y = e^(y ln x)
// @out z
// ln x and the product are double-floats: the built-in's y log2 x loses every bit for x near 1 and y of 1e7. For x ≤ 0 the
// result is the power of 0: 0 if y > 0, 1 if y = 0, +∞ if y < 0.
float powf(float x, float y) {
    if (ARITHMETIC == FAST) return pow(x, y);
    DoubleFloat l = df_log(x);
    DoubleFloat p = two_product(y, l.hi);
    precise float lo = p.lo + y * l.lo;
    // Beyond ±110 the power is 0 or +∞ for every lo.
    float power = exp_pair(p.hi, abs(p.hi) < 110.0 ? lo : 0.0);
    return y == 0.0 ? 1.0 : power;
}

// --------------------------------------------------------------------------------------------------------------------
// Arc tangent

// k π/4 + m (s + rest). Adding s + rest first would cost one more rounding.
float arc_sum(float k, float m, float s, float rest) {
    precise float y = (k * EIGHTH_HI + m * s) + (m * rest + k * EIGHTH_LO);
    return y;
}

float with_sign_of(float magnitude, float x) {
    return uintBitsToFloat(floatBitsToUint(magnitude) | (floatBitsToUint(x) & 0x80000000u));
}

// @eq N10: the angle of (x, y) from +x
// @out angle
// arctan of the smaller over the larger argument, or π/4 plus arctan of (a − b)/(a + b), so that |t| ≤ tan(π/8). 0 for (0,
// 0).
float atan2f(float y, float x) {
    if (ARITHMETIC == FAST) return atan(y, x);
    float ax = abs(x);
    float ay = abs(y);
    bool steep = ay > ax;
    float large = steep ? ay : ax;
    // Scaled away from both ends of the range of floats, so that sum and quotient stay inside it.
    float scale = large > 1.15292150e18 ? 0.0625 : 16777216.0;
    precise float a = (steep ? ax : ay) * scale;
    precise float b = large * scale;
    bool turned = a > TAN_PI_8 * b;
    precise float num = turned ? a - b : a;
    precise float den = turned ? a + b : b;
    precise float t = num / (den < SMALLEST_NORMAL ? 1.0 : den);
    precise float z = t * t;
    precise float p = (((-6.09186068e-2 * z + 0.105998456) * z - 0.142444715) * z + 0.19998531) * z - 0.333333164;
    float k = turned ? 1.0 : 0.0;
    k = steep ? 2.0 - k : k;
    k = x < 0.0 ? 4.0 - k : k;
    return with_sign_of(arc_sum(k, steep != (x < 0.0) ? -1.0 : 1.0, t, t * (z * p)), y);
}

// (cos, sin) of 2π·turns. Turns reduce exactly: the nearest quarter turn is subtracted, and the rest is within ±π/4, where
// series as in Cephes hold. Vulkan's sin and cos promise no more than 2^-11. Beyond 2^22 turns, where floats are no finer
// than a quarter: (1, 0).
vec2 cos_sin_of_turns(float turns) {
    vec2 r;
    if (ARITHMETIC == FAST) {
        r = vec2(cos(2.0 * PI * turns), sin(2.0 * PI * turns));
    } else {
        precise float turn = abs(turns) < 4194304.0 ? turns - floor(turns) : 0.0;
        precise float quarter = floor(4.0 * turn + 0.5);
        precise float x = (turn - 0.25 * quarter) * (2.0 * PI);
        precise float z = x * x;
        precise float s = ((-1.9515295891e-4 * z + 8.3321608736e-3) * z - 1.6666654611e-1) * z * x + x;
        precise float c = ((2.443315712e-5 * z - 1.388731625e-3) * z + 4.166664568e-2) * z * z - 0.5 * z + 1.0;
        int quadrant = int(quarter) & 3;
        r = (quadrant & 1) == 0 ? vec2(c, s) : vec2(-s, c);
        r = quadrant < 2 ? r : -r;
    }
    return r;
}

// cos 2π·turns. The fast tier reduces the angle as well: beyond half a turn Vulkan bounds no error of its cosine.
float cos_of_turns(float turns) {
    return cos_sin_of_turns(ARITHMETIC == FAST ? turns - floor(turns + 0.5) : turns).x;
}
#endif
