// Punctual lights, analytic area lights and solid angles: irradiance at a surface and sampling densities (lecture R2–R4).
// Where to read: KHR_lights_punctual; pbrt 4, sections 4.2 (solid angle, densities) and 12.2 (point lights); RTR 4, section
// 5.2. Twins: crates/optics/src/.
// Assumes: metres, radiant intensity I, N a unit vector rounded to f32. A zero vector counts as perpendicular to
// everything: no light.
#ifndef LIGHT_GLSL
#define LIGHT_GLSL
#include "lib/arithmetic.glsl"
#include "lib/constants.glsl"
#include "lib/frame.glsl"

// The renderer's limit for r → 0 (numerics.md 32), in metres: a point light is never nearer, so irradiance stays finite.
// point_falloff has this limit; light_point does not: it is I/r² and returns +∞.
const float LIGHT_RADIUS = 1e-12;

struct LightDirectional {
    float cos_plus;
    float irradiance;
};

// @eq R3 N14 N25: E cos⁺θ, cosθ = N·L/|L|; E is the irradiance perpendicular to L
// L may have any length from 1e-37 to 1e38: it is scaled by a power of two before it is squared.
// @lab arriving_light: lights_of_the_lecture_agree_with_those_of_pictures
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

// I f²/r2, with f a power of two, in an order in which no intermediate leaves the range of floats unless the result does.
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
// No smallest radius here: values beyond the range of floats are +∞, never NaN. P = Q gives r² = 0, cos⁺ = 0, E = 0, and
// E_⊥ = +∞ for I > 0, 0 otherwise. Q − P is a double-float: it does not round.
// @lab arriving_light: lights_of_the_lecture_agree_with_those_of_pictures
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
        // E_⊥ may overflow where E does not.
        bool far = abs(r.E_perp) <= LARGEST;
        r.irradiance = r.cos_plus == 0.0 ? 0.0 : far ? r.E_perp * r.cos_plus : over_square(I * r.cos_plus, d2, f);
    }
    return r;
}

// The smooth window of a light's range, which ends at `range` (KHR_lights_punctual). inv_range2 = 1/range², 0 for no range.
float range_window(float r2, float inv_range2) {
    float x = r2 * inv_range2;
    return clamp(1.0 - x * x, 0.0, 1.0);
}

// @eq R4 N32: E/I = max(min(1 − (r/range)⁴, 1), 0)/r², r at least LIGHT_RADIUS
// @out falloff
// On a surface that faces the light.
float point_falloff(float r2, float inv_range2) {
    float window = range_window(r2, inv_range2);
    return ARITHMETIC == FAST ? window / r2 : window / max(r2, LIGHT_RADIUS * LIGHT_RADIUS);
}

// @eq R4: share = clamp(scale cosθ + offset, 0, 1)²
// @out share
// Fraction of a spot light's intensity at angle θ from its axis: the square of a ramp in the cosine between the two cones.
// Compensated: product and sum round once. This matters for narrow cones, whose scale is large.
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

struct ArrivingLight {
    vec3 l;
    float share;
};

// @eq R3 R4 N32: l = Q/|Q|, share = E_⊥/I = w/r² s, w and s of point_falloff and spot_share; infinitely far: l = Q, share 1
// A light of the table seen from a point. `to_light`, Q, leads from the point to the light; for a light at infinity it is
// the unit direction to it. Irradiance perpendicular to l is the share times I, or times E for a directional light.
ArrivingLight arriving_light(vec3 to_light, bool directional, float inv_range2, vec3 axis, float spot_scale, float spot_offset) {
    float r2 = dot(to_light, to_light);
    vec3 l = directional ? to_light : to_light * inversesqrt(max(r2, 1e-30));
    float falloff = point_falloff(r2, inv_range2) * spot_share(-dot(axis, l), spot_scale, spot_offset);
    return ArrivingLight(l, directional ? 1.0 : falloff);
}

// @eq R2 N26: 1 − cosθ = q²/(1 + √(1 − q²)), q = radius/distance; the solid angle is 2π (1 − cosθ)
// @out one_minus_cos
// The cone that a sphere subtends: of sphere lights and of the spheres of path guiding. From inside: a hemisphere, 1. At
// the surface q² has rounded, and 1 − cosθ is off by up to 2.5e-4. (1 − q)(1 + q) from distance ± radius would avoid that
// for a root and a division more. The estimate does not depend on it, since density and cone come from the same number.
float sphere_cone(float radius2, float distance2) {
    float sin2 = min(radius2 / distance2, 1.0);
    return sin2 / (1.0 + sqrt(1.0 - sin2));
}

// @eq N34 N35: t = d cosθ − √(r² − d² sin²θ), no less than 1e-6 d
// @out t
// Distance to the near side of a sphere whose centre is d away, along a direction at θ from the centre. At the surface
// itself, where everything cancels, the lower limit holds.
float ball_reach(float distance2, float radius, float cos_theta, float sin2_theta) {
    return max(sqrt(distance2) * cos_theta - sqrt(max(radius * radius - distance2 * sin2_theta, 0.0)), 1e-6 * sqrt(distance2));
}

// Cosine and sine of an angle less another, both in [0, π]; of 0 where the other is larger.
vec2 angle_beyond(vec2 angle, vec2 other) {
    bool less = angle.x > other.x;
    return less ? vec2(1.0, 0.0) : vec2(angle.x * other.x + angle.y * other.y, angle.y * other.x - angle.x * other.y);
}

// Cosine and sine of an angle in [0, π].
vec2 angle_of(float cosine) {
    return vec2(cosine, sqrt(max(1.0 - cosine * cosine, 0.0)));
}

// @eq R4: I cos⁺θ'/max(d², r²), θ' = max(θ − θ_o − θ_b, 0), sinθ_b = r/d; 0 where θ' > θ_e; I/r² where d ≤ r
// @out importance
// Importance of a node of the light hierarchy at a point: about the largest irradiance that its emitters can give. They lie
// in a sphere of radius r, from whose centre the point is seen in the direction `to_point`, of length d, at θ from `axis`.
// Their axes are within θ_o of it, and each emits up to θ_e from its own. θ_b is the half angle of the sphere as the point
// sees it, and θ' is then the smallest angle between the axis of any emitter and the point (Conty Estevez and Kulla 2018).
float light_importance(vec3 to_point, float radius, vec3 axis, float cos_o, float cos_e, bool two_sided, float intensity) {
    float d2 = dot(to_point, to_point);
    float r2 = max(radius * radius, LIGHT_RADIUS * LIGHT_RADIUS);
    float along = dot(axis, to_point) * inversesqrt(max(d2, 1e-30));
    vec2 theta = angle_of(clamp(two_sided ? abs(along) : along, -1.0, 1.0));
    float sin2_b = min(r2 / max(d2, r2), 1.0);
    vec2 sphere = vec2(sqrt(1.0 - sin2_b), sqrt(sin2_b));
    float cosine = d2 <= r2 ? 1.0 : angle_beyond(angle_beyond(theta, angle_of(cos_o)), sphere).x;
    return cosine < cos_e ? 0.0 : intensity * max(cosine, 0.0) / max(d2, r2);
}

// @eq R2: p(ω) = p(A) r²/cosθ
// @out pdf
// Converts a density per area to a density per solid angle, for a point at distance r whose normal is at θ to the
// direction.
float density_per_solid_angle(float per_area, float r2, float cos_theta) {
    return per_area * r2 / cos_theta;
}
#endif
