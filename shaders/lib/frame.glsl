// Directions: robust normalisation, angles, orthonormal bases, and normals of triangles, instances and quadrics.
// Twins: crates/optics/src/frame.rs. Where to read: pbrt 4, chapter 3; Duff et al., JCGT 6(1) 2017 (bases); Kahan's notes
// on angles between vectors. Assumes: vectors of any length that f32 holds, unless a function says more.
#ifndef FRAME_GLSL
#define FRAME_GLSL
#include "lib/arithmetic.glsl"

float largest_component(vec3 v) {
    return max(abs(v.x), max(abs(v.y), abs(v.z)));
}

// The power of two that brings a size into [1, 2), exactly; above 2^127 into [2, 4). A size below the normal range counts
// as 0 and gives 1. Squares of the scaled size neither overflow nor underflow, and the reciprocal of the factor is a normal
// number too.
float scale_to_one(float size) {
    int exponent = int(floatBitsToUint(size) >> 23) - 127;
    return size < SMALLEST_NORMAL ? 1.0 : power_of_two(-min(exponent, 126));
}

// scale_to_one for sizes whose squares leave the range of floats. It is 1 between 1e-9 and 1e9, so that differences of two
// vectors of about one length stay unchanged.
float scale_if_extreme(float size) {
    return size > 1e9 || size < 1e-9 ? scale_to_one(size) : 1.0;
}

// The length |v|, for every v whose length is a float.
float vector_length(vec3 v) {
    float scale = scale_to_one(largest_component(v));
    vec3 w = v * scale;
    return sqrt(dot(w, w)) * (1.0 / scale);
}

struct SafeNormalized {
    vec3 n;
    bool is_zero;
};

// @eq N14: n = v/|v|
// |v|² is 0 for components below 1e-19 and ∞ for components above 1e19. So v is first scaled by the power of two of its
// largest component, which rounds nothing. A vector below the normal range of floats has no direction: the result is the
// zero vector and a flag.
SafeNormalized safe_normalize(vec3 v) {
    SafeNormalized r = SafeNormalized(vec3(0.0), false);
    if (ARITHMETIC == FAST) {
        r.n = v * inversesqrt(dot(v, v));
    } else {
        float size = largest_component(v);
        vec3 w = v * scale_to_one(size);
        r.is_zero = size < SMALLEST_NORMAL;
        r.n = r.is_zero ? vec3(0.0) : w / sqrt(dot(w, w));
    }
    return r;
}

// u × v for two unit vectors. Nearly parallel ones use u × (v ∓ u): the difference of nearly equal vectors, or the sum of
// nearly opposite ones, is exact. The products of the plain cross product round, and leave little of a small difference.
vec3 cross_of_units(vec3 u, vec3 v) {
    float cosine = dot(u, v);
    float parallel = cosine > 0.5 ? 1.0 : cosine < -0.5 ? -1.0 : 0.0;
    return cross(u, v - parallel * u);
}

// @eq N10: θ = atan2(|u × v|, u·v)
// @out angle
// arccos(u·v) keeps no digits for small angles. Both arguments scale with |u||v|, so rounded lengths do not matter. Kahan's
// 2 atan2(|u − v|, |u + v|) is sensitive to them. Lengths are about 1; a zero vector gives 0.
// @lab atan2f: laboratory_forms_agree_with_the_functions_of_pictures
float angle_between(vec3 u, vec3 v) {
    float angle;
    if (ARITHMETIC == FAST) {
        angle = acos(dot(u, v));
    } else {
        vec3 a = u * scale_if_extreme(largest_component(u));
        vec3 b = v * scale_if_extreme(largest_component(v));
        vec3 across = cross_of_units(a, b);
        angle = atan2f(sqrt(dot(across, across)), dot(a, b));
    }
    return angle;
}

// Cosine between two directions to 32 ULP down to 1e-8: exact products over the lengths. The tagged functions return this
// one; `cosine` is enough for the terms of a microfacet model, which are smooth in it.
float grazing_cosine(vec3 a, vec3 b) {
    float lengths = sqrt(dot(a, a) * dot(b, b));
    return ARITHMETIC == FAST ? dot(a, b) : lengths > 0.0 ? dot2(a, b).hi / lengths : 0.0;
}

// @eq B2 N25: cosθ = a·b
// @out cos
// Of unit vectors. A plain sum is good to 2e-7, rounded lengths included; near 90° nothing but that error is left.
// Compensated: the sum of exact products over the lengths.
float cosine(vec3 a, vec3 b) {
    return ARITHMETIC == COMPENSATED ? grazing_cosine(a, b) : dot(a, b);
}

// Clamps a cosine to [−1, 1]; 0 for NaN and infinities.
float cosine_in_range(float c) {
    return abs(c) <= LARGEST ? clamp(c, -1.0, 1.0) : 0.0;
}

// sin² of the angle between two directions. 1 − cos² loses small angles, and so does the cross product N × H with its
// rounded products. H − N is exact where H is near N, so N × (H − N) loses nothing (numerics.md 9).
float sine_squared(vec3 N, vec3 H) {
    float sin2;
    if (ARITHMETIC == FAST) {
        float c = dot(N, H);
        sin2 = 1.0 - c * c;
    } else if (ARITHMETIC == COMPENSATED) {
        vec3 s = cross2(N, H);
        DoubleFloat lengths = df_mul(dot2(N, N), dot2(H, H));
        sin2 = lengths.hi > 0.0 ? df_div(dot2(s, s), lengths).hi : 1.0;
    } else {
        vec3 s = cross(N, H - N);
        sin2 = dot(s, s);
    }
    return sin2;
}

struct OrthonormalBasis {
    vec3 t;
    vec3 b;
};

// @eq N15: t = (1 + s a n_x², s a n_x n_y, −s n_x), b = (a n_x n_y, s + a n_y², −n_y), a = −1/(s + n_z), s = sign n_z
// Duff et al., JCGT 6(1) 2017. Frisvad's basis (s = 1 everywhere, the tier fast) divides by 0 at n_z = −1. For n_z < 0 it
// is another basis than this one: a choice, no error. (t, b, n) is right-handed.
OrthonormalBasis orthonormal_basis(vec3 n) {
    float s = ARITHMETIC != FAST && n.z < 0.0 ? -1.0 : 1.0;
    float a = -1.0 / (s + n.z);
    float b = (n.x * a) * n.y;
    return OrthonormalBasis(vec3(1.0 + s * (n.x * a) * n.x, s * b, -s * n.x), vec3(b, s + (n.y * a) * n.y, -n.y));
}

// @eq N15: the largest of |t·t − 1|, |b·b − 1|, |t·b|, |t·n|, |b·n|
// @out gram
// Deviation of a basis from orthonormality, by exact products. NaN counts as 3e38, so that a maximum cannot hide it.
// @lab orthonormal_basis: laboratory_forms_agree_with_the_functions_of_pictures
float basis_gram(vec3 n) {
    OrthonormalBasis basis = orthonormal_basis(n);
    float tt = df_add(dot2(basis.t, basis.t), DoubleFloat(-1.0, 0.0)).hi;
    float bb = df_add(dot2(basis.b, basis.b), DoubleFloat(-1.0, 0.0)).hi;
    vec3 mixed = vec3(dot2(basis.t, basis.b).hi, dot2(basis.t, n).hi, dot2(basis.b, n).hi);
    float sum = abs(tt) + abs(bb) + abs(mixed.x) + abs(mixed.y) + abs(mixed.z);
    float most = max(max(abs(tt), abs(bb)), largest_component(mixed));
    return sum <= LARGEST ? most : LARGEST;
}

// @eq N41: N = sign(det M) (b × c, c × a, a × b) n, normalised; M = (a, b, c)
// @out N
// Transforms a normal by the linear map with columns a, b, c. The cofactor matrix is det(M) times the inverse transpose. It
// needs no division by the determinant, which is 0 already for lengths of 1e-14. The sign of the determinant keeps the
// fronts of mirrored meshes in front. Each column is scaled by its own power of two, and n is scaled to undo the effect on
// the cofactors. Where M or n leaves no direction: the zero vector.
// @host src/upload/scene.rs: computes the normal matrix of an instance; a test compares it with this function
vec3 transformed_normal(vec3 a, vec3 b, vec3 c, vec3 n) {
    vec3 N;
    if (ARITHMETIC == FAST) {
        N = normalize(transpose(inverse(mat3(a, b, c))) * n);
    } else {
        vec3 scales = vec3(scale_to_one(largest_component(a)), scale_to_one(largest_component(b)),
                           scale_to_one(largest_component(c)));
        vec3 u = a * scales.x;
        vec3 v = b * scales.y;
        vec3 w = c * scales.z;
        vec3 bc = cross(v, w);
        // Relative to the largest of the three factors, so that none overflows.
        vec3 weights = scales * (1.0 / max(scales.x, max(scales.y, scales.z)));
        vec3 m = n * scale_to_one(largest_component(n)) * weights;
        m *= scale_to_one(largest_component(m));
        vec3 sum = bc * m.x + cross(w, u) * m.y + cross(u, v) * m.z;
        N = safe_normalize(dot(u, bc) < 0.0 ? -sum : sum).n;
    }
    return N;
}

// x y − z w of double-floats, rounded once.
float df_difference_of_products(DoubleFloat x, DoubleFloat y, DoubleFloat z, DoubleFloat w) {
    return df_add(df_mul(x, y), df_negate(df_mul(z, w))).hi;
}

// u × v: twice the area of the triangle with these edges, times its unit normal on the side from which they run
// counter-clockwise.
vec3 doubled_area(vec3 u, vec3 v) {
    return cross(u, v);
}

struct TriangleNormal {
    vec3 n;
    bool degenerate;
};

// @eq N40: n = (b − a) × (c − a), normalised
// Stable: edges are scaled by powers of two, which round nothing. Compensated: the edges are exact double-floats, and so
// are the six products. Otherwise the area of a sliver is a small difference of large products of rounded edges. (a × b + b
// × c + c × a by dot2 is as exact near the origin, and loses digits with the distance from it.) Without area: the zero
// vector, and a flag.
TriangleNormal triangle_normal(vec3 a, vec3 b, vec3 c) {
    TriangleNormal r;
    if (ARITHMETIC == FAST) {
        // Scaled as well: scenes of tiny size would otherwise have no normals.
        vec3 across = doubled_area(b - a, c - a);
        r = TriangleNormal(normalize(across * scale_to_one(largest_component(across))), false);
    } else if (ARITHMETIC == COMPENSATED) {
        float s = scale_to_one(largest_component(b - a));
        float t = scale_to_one(largest_component(c - a));
        DoubleFloat ux = df_scale(two_sum(b.x, -a.x), s);
        DoubleFloat uy = df_scale(two_sum(b.y, -a.y), s);
        DoubleFloat uz = df_scale(two_sum(b.z, -a.z), s);
        DoubleFloat vx = df_scale(two_sum(c.x, -a.x), t);
        DoubleFloat vy = df_scale(two_sum(c.y, -a.y), t);
        DoubleFloat vz = df_scale(two_sum(c.z, -a.z), t);
        vec3 doubled = vec3(df_difference_of_products(uy, vz, uz, vy), df_difference_of_products(uz, vx, ux, vz),
                            df_difference_of_products(ux, vy, uy, vx));
        SafeNormalized unit = safe_normalize(doubled);
        r = TriangleNormal(unit.n, unit.is_zero);
    } else {
        vec3 u = b - a;
        vec3 v = c - a;
        u *= scale_to_one(largest_component(u));
        v *= scale_to_one(largest_component(v));
        vec3 across = doubled_area(u, v);
        float size = largest_component(across);
        r.degenerate = size < SMALLEST_NORMAL;
        r.n = r.degenerate ? vec3(0.0) : normalize(across * scale_to_one(size));
    }
    return r;
}

// @eq Q5: N = (a x, b y, c z)/|…|, half the gradient of a x² + b y² + c z²
// @out N
// The normal of a level surface is the gradient of its function. At the centre: the zero vector.
// @host crates/scene/src/study/shape.rs: computes the normals of spheres; a test compares them with this function
vec3 quadric_normal(vec3 p, vec3 k) {
    vec3 n;
    if (ARITHMETIC == FAST) {
        n = normalize(k * p);
    } else {
        n = safe_normalize((k * scale_to_one(largest_component(k))) * (p * scale_to_one(largest_component(p)))).n;
    }
    return n;
}
#endif
