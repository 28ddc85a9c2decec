// Light that arrives at a surface (lecture R2–R4; KHR_lights_punctual) and the solid angles that lights fill. N is a
// unit vector as 32 bits hold it. A zero vector is at a right angle to everything: no light.
#ifndef LIGHT_GLSL
#define LIGHT_GLSL
#include "lib/arithmetic.glsl"
#include "lib/constants.glsl"
#include "lib/frame.glsl"

// The renderer's rule for r → 0 (numerics.md 32): a point light is never nearer than this, in metres, so that
// irradiance stays finite. It is part of point_falloff, not of light_point, which is I/r² and says +∞.
const float LIGHT_RADIUS = 1e-12;

struct LightDirectional {
    float cos_plus;
    float irradiance;
};

// @eq R3 N14 N25: E cos⁺θ, cosθ = N·L/|L|; E is the irradiance perpendicular to L
// L of any length from 1e-37 to 1e38: scaled by a power of two before it is squared.
LightDirectional light_directional(vec3 N, vec3 L, float E) {
    float cos_plus;
    if (ARITHMETIC == FAST) {
        cos_plus = max(dot(N, normalize(L)), 0.0);
    } else {
        vec3 l = L * scale_to_one(largest_component(L));
        cos_plus = max(cosine_in_range(grazing_cosine(N, l)), 0.0);
    }
    return LightDirectional(cos_plus, E * cos_plus);
}

// I f²/r2, with f a power of two: in the order in which nothing leaves the range of floats unless the result does.
float over_square(float I, float r2, float f) {
    return abs(I) < 1.0 ? I * f / r2 * f : I / r2 * f * f;
}

struct LightPoint {
    float r2;
    float cos_plus;
    float E_perp;
    float irradiance;
};

// @eq R4 N32 N33: E_⊥ = I/r², E = E_⊥ cos⁺θ, of a light at Q with radiant intensity I on a surface at P
// No smallest radius here: what exceeds the range of floats is +∞, never NaN. P = Q: r² = 0, cos⁺ = 0, E = 0, and E_⊥
// is +∞ for I > 0, 0 otherwise. Q − P in pairs: it does not round.
LightPoint light_point(vec3 P, vec3 Q, vec3 N, float I) {
    LightPoint r;
    if (ARITHMETIC == FAST) {
        vec3 d = Q - P;
        r.r2 = dot(d, d);
        r.cos_plus = max(dot(N, d) / sqrt(r.r2), 0.0);
        r.E_perp = I / r.r2;
        r.irradiance = r.E_perp * r.cos_plus;
    } else {
        DoubleFloat dx = two_sum(Q.x, -P.x);
        DoubleFloat dy = two_sum(Q.y, -P.y);
        DoubleFloat dz = two_sum(Q.z, -P.z);
        vec3 d = vec3(dx.hi, dy.hi, dz.hi);
        float f = scale_to_one(largest_component(d));
        d *= f;
        float d2 = dot(d, d);
        float c = 0.0;
        if (d2 > 0.0) {
            DoubleFloat sum = dot2(N, d);
            precise float lo = sum.lo + dot(N, vec3(dx.lo, dy.lo, dz.lo) * f);
            float lengths = sqrt(d2 * dot(N, N));
            c = lengths > 0.0 ? (sum.hi + lo) / lengths : 0.0;
        }
        float back = 1.0 / f;
        r.r2 = d2 * back * back;
        r.cos_plus = max(cosine_in_range(c), 0.0);
        r.E_perp = d2 > 0.0 ? over_square(I, d2, f) : I > 0.0 ? plus_infinity() : 0.0;
        // E_⊥ may exceed the range of floats and E not.
        bool far = abs(r.E_perp) <= LARGEST;
        r.irradiance = r.cos_plus == 0.0 ? 0.0 : far ? r.E_perp * r.cos_plus : over_square(I * r.cos_plus, d2, f);
    }
    return r;
}

// @eq R4 N32: E/I = max(min(1 − (r/range)⁴, 1), 0)/r², r at least LIGHT_RADIUS
// @out falloff
// On a surface that faces the light, ended smoothly at `range` (KHR_lights_punctual). inv_range2 = 1/range², 0 for
// none.
float point_falloff(float r2, float inv_range2) {
    float x = r2 * inv_range2;
    float window = clamp(1.0 - x * x, 0.0, 1.0);
    return ARITHMETIC == FAST ? window / r2 : window / max(r2, LIGHT_RADIUS * LIGHT_RADIUS);
}

// @eq R4: share = clamp(scale cosθ + offset, 0, 1)²
// @out share
// Of a spot light's intensity at angle θ from its axis: the square of a ramp in the cosine between the two cones.
// Compensated: the product and the sum round once, which is seen in narrow cones, whose scale is large.
float spot_share(float cos_angle, float scale, float offset) {
    float ramp = cos_angle * scale + offset;
    if (ARITHMETIC == COMPENSATED) {
        DoubleFloat p = two_product(cos_angle, scale);
        DoubleFloat s = two_sum(p.hi, offset);
        precise float sum = s.hi + (s.lo + p.lo);
        ramp = sum;
    }
    ramp = clamp(ramp, 0.0, 1.0);
    return ramp * ramp;
}

struct SphereCone {
    float one_minus_cos;
    float omega;
};

// @eq R2 N26: 1 − cosθ = q²/(1 + √((1 − q)(1 + q))), q = radius/distance; Ω = 2π (1 − cosθ)
// The cone of a sphere of that radius around a point at that distance from it; (1 − q)(1 + q) from distance ± radius,
// since q has rounded. Inside the sphere is all around: 2 and 4π. A radius ≤ 0 fills nothing.
SphereCone sphere_cone(float radius, float distance) {
    float one_minus_cos;
    if (ARITHMETIC == FAST) {
        float q = radius / distance;
        one_minus_cos = 1.0 - sqrt(1.0 - q * q);
    } else {
        float d = max(distance, 0.0);
        float r = max(radius, 0.0);
        bool outside = d >= r && d > 0.0;
        float q = outside ? r / d : 0.0;
        float cos2 = outside ? ((d - r) / d) * ((d + r) / d) : 0.0;
        one_minus_cos = outside ? q * q / (1.0 + sqrt(cos2)) : r > 0.0 ? 2.0 : 0.0;
    }
    return SphereCone(one_minus_cos, 2.0 * PI * one_minus_cos);
}

// p·(q × r), as if in twice the precision.
DoubleFloat triple_product(DoubleFloat p[3], DoubleFloat q[3], DoubleFloat r[3]) {
    DoubleFloat x = df_add(df_mul(q[1], r[2]), df_negate(df_mul(q[2], r[1])));
    DoubleFloat y = df_add(df_mul(q[2], r[0]), df_negate(df_mul(q[0], r[2])));
    DoubleFloat z = df_add(df_mul(q[0], r[1]), df_negate(df_mul(q[1], r[0])));
    return df_add(df_add(df_mul(p[0], x), df_mul(p[1], y)), df_mul(p[2], z));
}

// @eq R2: tan(Ω/2) = a·(b × c)/(|a||b||c| + (a·b)|c| + (b·c)|a| + (c·a)|b|)
// @out omega
// Solid angle of a triangle with corners at a, b, c from the point (van Oosterom and Strackee 1983), in [0, 2π]. The
// volume from the edges, a·((b − a) × (c − a)): edges of small triangles are exact, a·(b × c) is all error there. A
// corner at the point: 0. All corners are scaled together by a power of two.
float triangle_solid_angle(vec3 a, vec3 b, vec3 c) {
    float numerator, denominator;
    if (ARITHMETIC == FAST) {
        float la = length(a);
        float lb = length(b);
        float lc = length(c);
        numerator = abs(dot(a, cross(b, c)));
        denominator = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
    } else {
        float f = scale_to_one(largest_component(max(max(abs(a), abs(b)), abs(c))));
        vec3 p = a * f;
        vec3 q = b * f;
        vec3 r = c * f;
        if (ARITHMETIC == COMPENSATED) {
            DoubleFloat corner[3], u[3], v[3];
            corner[0] = DoubleFloat(p.x, 0.0);
            corner[1] = DoubleFloat(p.y, 0.0);
            corner[2] = DoubleFloat(p.z, 0.0);
            u[0] = two_sum(q.x, -p.x);
            u[1] = two_sum(q.y, -p.y);
            u[2] = two_sum(q.z, -p.z);
            v[0] = two_sum(r.x, -p.x);
            v[1] = two_sum(r.y, -p.y);
            v[2] = two_sum(r.z, -p.z);
            numerator = abs(triple_product(corner, u, v).hi);
        } else {
            numerator = abs(dot(p, cross(q - p, r - p)));
        }
        float lp = sqrt(dot(p, p));
        float lq = sqrt(dot(q, q));
        float lr = sqrt(dot(r, r));
        denominator = lp * lq * lr + dot(p, q) * lr + dot(q, r) * lp + dot(r, p) * lq;
        bool touched = min(min(lp, lq), lr) == 0.0;
        numerator = touched ? 0.0 : numerator;
        denominator = touched ? 1.0 : denominator;
    }
    return ARITHMETIC == FAST ? 2.0 * atan(numerator, denominator) : 2.0 * atan2f(numerator, denominator);
}
#endif
