// Ray intersection: spheres, boxes (slab test), watertight ray/triangle intersection, and ray origins off a surface.
// Where to read: Woop, Benthin and Wald, JCGT 2(1) 2013 (watertight intersection); Haines et al., Ray Tracing Gems 7
// (spheres); Ize, JCGT 2(2) 2013 (boxes); pbrt 4, section 6.8 (rounding error). Twins: crates/optics/src/ray.rs.
// Assumes: a ray is origin + t direction, t ≥ 0, with a direction of any length.
#ifndef RAY_GLSL
#define RAY_GLSL
#include "lib/arithmetic.glsl"
#include "lib/frame.glsl"

// t of a ray whose direction and lengths were scaled. Two multiplications: the quotient of the scales may be ∞ where t is
// 0.
float unscaled(float t, float scale_of_direction, float scale_of_lengths) {
    precise float by_direction = t * scale_of_direction;
    precise float whole = by_direction * (1.0 / scale_of_lengths);
    return whole;
}

struct RaySphere {
    bool hit;
    float t0;
    float t1;
};

// x² + y² + z² − r², rounded once
float squares_less(DoubleFloat x, DoubleFloat y, DoubleFloat z, float r) {
    DoubleFloat r2 = two_product(r, r);
    return df_add(df_add(df_add(df_mul(x, x), df_negate(r2)), df_mul(y, y)), df_mul(z, z)).hi;
}

DoubleFloat times(DoubleFloat a, float s) {
    return df_mul(a, DoubleFloat(s, 0.0));
}

// @eq N34 N35: f = origin − center, b = −f·d, D = r² − |f + (b/d²) d|², q = b ± √(d² D), t = (f² − r²)/q and q/d²
// Haines et al., Ray Tracing Gems 7. b² − d²(f² − r²) is a small difference of large squares for a distant sphere; the
// distance of its centre from the line is not. Of b ± √… only the sum is formed; the other root is Vieta's. t0 ≤ t1 are the
// intersections of the whole line, negative ones behind the origin. Compensated: f, f² − r² and the point next to the
// centre are double-floats, for origins near the surface and rays that graze a distant sphere. Without a hit, or for
// direction 0: 0, 0.
// Pictures have triangles alone; the near side of a sphere light is found by ball_reach.
// @lab ball_reach: lights_of_the_lecture_agree_with_those_of_pictures
RaySphere ray_sphere(vec3 origin, vec3 direction, vec3 center, float radius) {
    RaySphere r = RaySphere(false, 0.0, 0.0);
    if (ARITHMETIC == FAST) {
        vec3 f = origin - center;
        float a = dot(direction, direction);
        float b = dot(f, direction);
        float disc = b * b - a * (dot(f, f) - radius * radius);
        r.hit = disc >= 0.0;
        r.t0 = r.hit ? (-b - sqrt(disc)) / a : 0.0;
        r.t1 = r.hit ? (-b + sqrt(disc)) / a : 0.0;
    } else {
        vec3 f = origin - center;
        float scale = scale_to_one(max(largest_component(f), abs(radius)));
        float scale_d = scale_to_one(largest_component(direction));
        vec3 d = direction * scale_d;
        float R = radius * scale;
        f *= scale;
        float d2 = dot(d, d);
        bool moves = d2 > 0.5;
        d2 = moves ? d2 : 1.0;
        float b = -dot(f, d);
        float c, disc;
        if (ARITHMETIC == COMPENSATED) {
            DoubleFloat x = df_scale(two_sum(origin.x, -center.x), scale);
            DoubleFloat y = df_scale(two_sum(origin.y, -center.y), scale);
            DoubleFloat z = df_scale(two_sum(origin.z, -center.z), scale);
            c = squares_less(x, y, z, R);
            b = -df_add(df_add(times(x, d.x), times(y, d.y)), times(z, d.z)).hi;
            d2 = moves ? dot2(d, d).hi : 1.0;
            // Any point h near the foot of the perpendicular will do if it lies exactly on the line: its component along
            // the line is subtracted again.
            float s = b / d2;
            DoubleFloat hx = df_add(x, two_product(s, d.x));
            DoubleFloat hy = df_add(y, two_product(s, d.y));
            DoubleFloat hz = df_add(z, two_product(s, d.z));
            float along = dot(vec3(hx.hi, hy.hi, hz.hi), d);
            disc = along * along / d2 - squares_less(hx, hy, hz, R);
        } else {
            c = dot(f, f) - R * R;
            vec3 h = f + (b / d2) * d;
            disc = R * R - dot(h, h);
        }
        r.hit = moves && disc >= 0.0;
        float root = sqrt(max(disc, 0.0) * d2);
        float q = b < 0.0 ? b - root : b + root;
        float by_q = q == 0.0 ? 0.0 : c / q;
        float by_d = q / d2;
        r.t0 = r.hit ? unscaled(b < 0.0 ? by_d : by_q, scale_d, scale) : 0.0;
        r.t1 = r.hit ? unscaled(b < 0.0 ? by_q : by_d, scale_d, scale) : 0.0;
    }
    return r;
}

// A ray prepared for slab tests: near and far t of a box are centre·inverse + start ∓ half·extent.
struct BoxRay {
    vec3 inverse;
    vec3 start_near;
    vec3 start_far;
    vec3 extent;
    int base; // first texel of the BVH's list of nodes
    int end;  // index of its sentinel
};

// Beyond 1e20 a direction is parallel to the planes in every scene, and 0·∞ does not occur.
vec3 inverse_direction(vec3 direction) {
    return clamp(1.0 / direction, -1e20, 1e20);
}

// For boxes in f32. `offset` is 32 roundings of the largest coordinate in the scene. It is added on each side with 8
// roundings of the origin's coordinates: together they exceed all rounding errors here, so no hit is missed (a conservative
// test). Ize (JCGT 2(2) 2013) lengthens the far end by a factor; that has no effect on a box that begins behind the origin.
void of_boxes(inout BoxRay r, vec3 origin, vec3 inverse, float offset) {
    vec3 pad = abs(origin) * (8.0 / 16777216.0) * abs(inverse) + abs(inverse) * offset;
    r.inverse = inverse;
    r.start_near = -origin * inverse - pad;
    r.start_far = -origin * inverse + pad;
    r.extent = abs(inverse);
}

// @eq N36: max(near_x, near_y, near_z, t_min) ≤ min(far_x, far_y, far_z, t_max), t_min ≥ 0
// @out hit
// Slab test of a ray and a box within [t_min, t_max], in integers. Positive floats order as their bits do, and a negative
// far end fails in any case. min and max of integers are one instruction each; those of floats are three.
bool meets(vec3 near, vec3 far, float t_min, float t_max) {
    ivec3 n = floatBitsToInt(near);
    ivec3 f = floatBitsToInt(far);
    return max(max(n.x, n.y), max(n.z, floatBitsToInt(t_min))) <= min(min(f.x, f.y), min(f.z, floatBitsToInt(t_max)));
}

struct Slab {
    bool hit;
    float t_near;
    float t_far;
};

// @eq N36: t_near = max(0, near_i), t_far = min(t_max, far_i), i = x, y, z; near, far = (centre − origin ∓ half)/direction
// The slab test of BVH traversal, with its padding. `offset` is that of the scene.
// @lab meets: every_traversal_finds_what_brute_force_finds
Slab slab(vec3 origin, vec3 direction, vec3 centre, vec3 half_size, float offset, float t_max) {
    BoxRay r;
    of_boxes(r, origin, inverse_direction(direction), offset);
    vec3 t = centre * r.inverse;
    vec3 e = half_size * r.extent;
    vec3 near = t + r.start_near - e;
    vec3 far = t + r.start_far + e;
    return Slab(meets(near, far, 0.0, t_max), max(max(near.x, near.y), max(near.z, 0.0)),
                min(min(far.x, far.y), min(far.z, t_max)));
}

struct RayTriangle {
    bool hit;
    float t;
    float u;
    float v;
};

// Coordinates permuted so that the axis k is last.
vec3 axis_last(vec3 p, int k) {
    return k == 0 ? p.yzx : k == 1 ? p.zxy : p;
}

// The axis along which a direction is longest.
int longest_axis(vec3 direction) {
    float size = largest_component(direction);
    return abs(direction.x) == size ? 0 : abs(direction.y) == size ? 1 : 2;
}

// What the shear of a ray consists of: the axis along which its direction is longest, and the other two components in parts of that one.
struct ShearTerms {
    int axis;
    vec2 shear;
    float dz; // component of the direction along the axis, never 0
};

ShearTerms shear_terms(vec3 direction) {
    int k = longest_axis(direction);
    vec3 d = axis_last(direction, k);
    precise float dz = d.z == 0.0 ? 1.0 : d.z;
    precise vec2 shear = d.xy / dz;
    return ShearTerms(k, shear, dz);
}

// The shear that makes a ray the last axis, as rows of a matrix. Two of its entries are 0 and 1, so a product with a row
// rounds as x − s z does. The matrix also permutes the axes: exchanging coordinates costs lavapipe two selects each.
struct Shear {
    vec3 x;
    vec3 y;
    vec3 z;
    float dz;
};

Shear shear_of(ShearTerms t) {
    vec3 e = vec3(t.axis == 0 ? 1.0 : 0.0, t.axis == 1 ? 1.0 : 0.0, t.axis == 2 ? 1.0 : 0.0);
    // The axis after `axis` is e rotated once, the one after that e rotated twice.
    return Shear(e.zxy - t.shear.x * e, e.yzx - t.shear.y * e, e, t.dz);
}

Shear ray_shear(vec3 direction) {
    return shear_of(shear_terms(direction));
}

float along(vec3 row, vec3 p) {
    precise float sum = row.x * p.x + row.y * p.y + row.z * p.z;
    return sum;
}

vec3 sheared(Shear s, vec3 p) {
    return vec3(along(s.x, p), along(s.y, p), along(s.z, p));
}

// The same numbers without a matrix: fewer registers, and fewer instructions where a selection is one.
vec3 sheared_by_selection(ShearTerms t, vec3 p) {
    vec3 q = axis_last(p, t.axis);
    precise vec2 across = q.xy - t.shear * q.z;
    return vec3(across, q.z);
}

// a.x b.y − a.y b.x; exactly the negative with a and b exchanged. So an edge has one value in both of its triangles.
float edge_function(vec2 a, vec2 b) {
    precise float e = a.x * b.y - a.y * b.x;
    return e;
}

// On which side of the edge from a to b the ray passes: the sign of the edge function. Where that is 0, the sign for a ray
// moved by (ε, ε²). So a ray that meets an edge or a corner hits exactly one of the triangles there, and crosses a closed
// surface an even number of times.
float side_of_edge(float edge, vec2 a, vec2 b) {
    return edge != 0.0 ? edge : a.y != b.y ? a.y - b.y : b.x - a.x;
}

struct ShearedTriangle {
    bool inside;  // by side_of_edge
    vec3 weights; // barycentric weights of the corners, times det
    float det;    // twice the area projected along the ray
    float depth;  // det times dz times the ray's t
};

// Watertight ray/triangle intersection (Woop, Benthin and Wald, JCGT 2(1) 2013). The corners are relative to the ray's origin, and
// sheared.
ShearedTriangle sheared_triangle(vec3 qa, vec3 qb, vec3 qc) {
    ShearedTriangle r;
    r.weights = vec3(edge_function(qc.xy, qb.xy), edge_function(qa.xy, qc.xy), edge_function(qb.xy, qa.xy));
    vec3 side = vec3(side_of_edge(r.weights.x, qc.xy, qb.xy), side_of_edge(r.weights.y, qa.xy, qc.xy),
                     side_of_edge(r.weights.z, qb.xy, qa.xy));
    r.inside = min(side.x, min(side.y, side.z)) > 0.0 || max(side.x, max(side.y, side.z)) < 0.0;
    r.det = r.weights.x + r.weights.y + r.weights.z;
    r.depth = r.weights.x * qa.z + r.weights.y * qb.z + r.weights.z * qc.z;
    return r;
}

struct PairOfAxes {
    DoubleFloat x;
    DoubleFloat y;
};

// (p − origin)·scale, sheared, as double-floats
PairOfAxes sheared_pair(vec3 p, vec3 origin, float scale, DoubleFloat shear_x, DoubleFloat shear_y) {
    DoubleFloat x = df_scale(two_sum(p.x, -origin.x), scale);
    DoubleFloat y = df_scale(two_sum(p.y, -origin.y), scale);
    DoubleFloat z = df_scale(two_sum(p.z, -origin.z), scale);
    return PairOfAxes(df_add(x, df_negate(df_mul(shear_x, z))), df_add(y, df_negate(df_mul(shear_y, z))));
}

// The edge function of double-floats; exactly the negative with a and b exchanged, too.
DoubleFloat edge_of_pairs(PairOfAxes a, PairOfAxes b) {
    return df_add(df_mul(a.x, b.y), df_negate(df_mul(a.y, b.x)));
}

// @eq N37: point = origin + t direction = a + u (b − a) + v (c − a), u, v, 1 − u − v ≥ 0, t ≥ 0
// Watertight ray/triangle intersection (Woop, Benthin and Wald, JCGT 2(1) 2013). The vertices are sheared so that the ray
// is the last axis. On which side of an edge it passes depends on that edge alone, so no ray slips between two triangles.
// The exception is a triangle that subtends less than 2.5e-7 rad, the resolution of sheared coordinates, if rounding flips
// it. Compensated: double-floats, 1e-14 rad. Both sides of a triangle are hit. A miss, a triangle edge-on, or direction 0:
// all 0. Vertices and direction are scaled by powers of two, which rounds nothing.
// @lab sheared_triangle: every_traversal_finds_what_brute_force_finds
RayTriangle ray_triangle(vec3 origin, vec3 direction, vec3 a, vec3 b, vec3 c) {
    RayTriangle r = RayTriangle(false, 0.0, 0.0, 0.0);
    if (ARITHMETIC == FAST) {
        // Möller and Trumbore 1997.
        vec3 ab = b - a;
        vec3 ac = c - a;
        vec3 p = cross(direction, ac);
        float det = dot(ab, p);
        vec3 s = origin - a;
        vec3 q = cross(s, ab);
        float u = dot(s, p) / det;
        float v = dot(direction, q) / det;
        float t = dot(ac, q) / det;
        if (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0) r = RayTriangle(true, t, u, v);
    } else {
        float size_d = largest_component(direction);
        float scale_d = scale_to_one(size_d);
        bool moves = size_d >= SMALLEST_NORMAL;
        precise vec3 pa = a - origin;
        precise vec3 pb = b - origin;
        precise vec3 pc = c - origin;
        float scale = scale_to_one(max(largest_component(pa), max(largest_component(pb), largest_component(pc))));
        Shear shear = ray_shear(direction * scale_d);
        ShearedTriangle s = sheared_triangle(sheared(shear, pa * scale), sheared(shear, pb * scale), sheared(shear, pc * scale));
        // Barycentric weights of a, b and c, times twice the projected area.
        float wa = s.weights.x;
        float wb = s.weights.y;
        float wc = s.weights.z;
        float det = s.det;
        float depth = s.depth;
        if (ARITHMETIC == COMPENSATED) {
            int k = longest_axis(direction);
            vec3 o = axis_last(origin, k);
            vec3 d = axis_last(direction, k) * scale_d;
            DoubleFloat shear_x = df_div(DoubleFloat(d.x, 0.0), DoubleFloat(shear.dz, 0.0));
            DoubleFloat shear_y = df_div(DoubleFloat(d.y, 0.0), DoubleFloat(shear.dz, 0.0));
            PairOfAxes qa = sheared_pair(axis_last(a, k), o, scale, shear_x, shear_y);
            PairOfAxes qb = sheared_pair(axis_last(b, k), o, scale, shear_x, shear_y);
            PairOfAxes qc = sheared_pair(axis_last(c, k), o, scale, shear_x, shear_y);
            DoubleFloat by_a = edge_of_pairs(qc, qb);
            DoubleFloat by_b = edge_of_pairs(qa, qc);
            DoubleFloat by_c = edge_of_pairs(qb, qa);
            wa = by_a.hi;
            wb = by_b.hi;
            wc = by_c.hi;
            det = df_add(df_add(by_a, by_b), by_c).hi;
            depth = wa * along(shear.z, pa * scale) + wb * along(shear.z, pb * scale) + wc * along(shear.z, pc * scale);
        }
        bool inside = min(wa, min(wb, wc)) >= 0.0 || max(wa, max(wb, wc)) <= 0.0;
        float whole = det == 0.0 ? 1.0 : det;
        float t = depth / whole / shear.dz;
        if (inside && moves && det != 0.0 && t >= 0.0) {
            r = RayTriangle(true, unscaled(t, scale_d, scale), wb / whole, wc / whole);
        }
    }
    return r;
}

// @eq N38: p + (n + free) offset
// @out q
// The origin of every ray that leaves a surface. It is moved along n, the geometric normal on the side of departure, by
// `offset`: 32 roundings of the largest coordinate in the scene. A hit is off the plane of its triangle by a few roundings,
// and another surface is found there a few off its own (tests/traversal.rs counts self-intersections). It is also moved as
// far along `free`, a direction known to be unoccluded: back towards the viewer. Without that a point in a corner may end
// up behind the other wall.
// The rule has no length of its own: it treats scenes of any size and position alike. Rejected: Wächter and Binder (Ray
// Tracing Gems 6) move each coordinate by its own roundings, which is no motion along the normal.
vec3 offset_origin(vec3 p, vec3 n, vec3 free, float offset) {
    return p + (n + free) * offset;
}

// @eq N39: P = a + u (b − a) + v (c − a)
// @out P
// The point where a ray meets a triangle, from barycentric coordinates: their error scales with the size of the triangle.
// origin + t direction (fast) carries the rounding of t, which scales with the distance to the origin. u and v are clamped
// to [0, 1].
vec3 hit_point(vec3 origin, vec3 direction, float t, vec3 a, vec3 b, vec3 c, float u, float v) {
    vec2 uv = clamp(vec2(u, v), 0.0, 1.0);
    return ARITHMETIC == FAST ? origin + t * direction : a + (uv.x * (b - a) + uv.y * (c - a));
}

// @eq N33: p_rel = (p_hi + p_lo) − (eye_hi + eye_lo)
// @out p_rel
// Positions are double-floats, 1e-7 m apart at the Earth's radius; their difference is rounded once. Plain floats (the tier
// fast takes the hi parts) are 6 cm apart at 1e6 m.
// @host src/upload/scene.rs: computes camera-relative positions of instances and lights
vec3 camera_relative(vec3 p_hi, vec3 p_lo, vec3 eye_hi, vec3 eye_lo) {
    vec3 p_rel;
    if (ARITHMETIC == FAST) {
        p_rel = p_hi - eye_hi;
    } else {
        p_rel = vec3(df_add(DoubleFloat(p_hi.x, p_lo.x), DoubleFloat(-eye_hi.x, -eye_lo.x)).hi,
                     df_add(DoubleFloat(p_hi.y, p_lo.y), DoubleFloat(-eye_hi.y, -eye_lo.y)).hi,
                     df_add(DoubleFloat(p_hi.z, p_lo.z), DoubleFloat(-eye_hi.z, -eye_lo.z)).hi);
    }
    return p_rel;
}
#endif
