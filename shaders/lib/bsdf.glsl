// The BSDF of a path vertex: evaluation with its sampling density, and sampling of one direction.
// lib/layers.glsl has the lobes. A lobe is specular (a delta distribution: one direction) or rough (evaluated, with a
// density). Half vectors of rough lobes are sampled from the VNDF. Path guiding samples part of the directions of the
// diffuse base layer (lib/path_guiding.glsl).
// Where to read: pbrt 4, sections 9.1 (BSDF interface) and 9.7; docs/decisions/paths.md. Assumes: world axes, densities per
// solid angle.
#ifndef BSDF_GLSL
#define BSDF_GLSL
#include "lib/path_guiding.glsl"
#include "lib/boundary.glsl"

struct Bsdf {
    Layers layers;
    vec3 n;       // normal of the triangle, on the viewer's side
    vec3 p_bvh;   // position of the vertex, bvh space
    float guided; // fraction of the diffuse directions that the guiding distribution samples
    GuidingCell guiding;
};

// Least selection probability of a rough lobe, before normalisation.
const float LEAST_SHARE = 0.1;

// Selection probabilities of coat, base, diffuse base layer and transmission, in proportion to their albedos at the
// viewer's angle.
vec4 shares_of(Layers b) {
    float mirrors = mean(b.f_base);
    // Facets tilted away from the normal reflect more than the viewer's angle suggests. A small reflectance at normal
    // incidence may be ten times as large there, so the lobe is sampled at least that often.
    if (!b.delta && mirrors > 0.0) mirrors = max(mirrors * mean(compensation(b.s)), LEAST_SHARE);
    float coat = CLEARCOAT ? 1.0 - b.under : 0.0;
    float left = 1.0 - coat;
    if (CLEARCOAT && !b.coat_delta && coat > 0.0) {
        coat = max(coat, LEAST_SHARE);
        left = 1.0 - coat;
    }
    // Some facets transmit where the viewer's angle would give total reflection.
    float below = 1.0 - largest(b.f_dielectric);
    below = b.delta ? below : max(below, LEAST_SHARE);
    vec4 shares = vec4(coat, vec3(left) * vec3(mirrors, scattered_share(b), mean(b.tint) * b.transmits * below));
    float sum = dot(shares, vec4(1.0));
    return sum > 0.0 ? shares / sum : vec4(0.0);
}

Bsdf bsdf_at(HitSurface hit, Boundary boundary) {
    Bsdf b;
    b.layers = layers_at(hit, boundary);
    b.layers.shares = shares_of(b.layers);
    b.n = hit.n;
    b.p_bvh = hit.s.p_bvh;
    b.guided = 0.0;
    b.guiding = GuidingCell(0, 0, 0, 0.0);
    return b;
}

// Enables path guiding for a vertex at which the path continues.
void enable_guiding(inout Bsdf b) {
    b.guiding = guiding_cell_at(b.p_bvh);
    b.guided = b.guiding.count > 0 ? GUIDED_FRACTION : 0.0;
}

// Whether light passes undeflected: a smooth thin-walled surface, or an interface between equal indices.
bool is_straight(Layers b) {
    return b.delta && (b.sheet || (b.solid && b.n1 == b.n2));
}

// Probability that a sample is of a lobe that scatters, not of a delta lobe.
float scattering_share(Layers b) {
    return b.shares.z + (b.delta ? 0.0 : b.shares.y + b.shares.w) + (b.coat_delta ? 0.0 : b.shares.x);
}

struct PathEval {
    vec3 f_cos;         // BSDF times |cosθ|, of all lobes but the delta ones
    float pdf;          // density with which bsdf_sample draws the direction, per solid angle
    float unguided_pdf; // solid-angle density without path guiding
};

// For light from the unit direction l, on either side of the surface.
PathEval bsdf_evaluate(Bsdf b, vec3 l) {
    bool above = dot(b.n, l) > 0.0;
    BsdfEval e = evaluate_reflection(b.layers, l);
    if (!above) e = BsdfEval(vec3(0.0), 0.0);
    if (TRANSMISSIVE && ROUGH_TRANSMISSION) {
        BsdfEval behind = evaluate_transmission(b.layers, l);
        if (dot(b.n, l) < 0.0) e = behind;
    }
    if (DIFFUSE_TRANSMISSION) {
        BsdfEval behind = evaluate_diffuse_transmission(b.layers, l);
        if (dot(b.n, l) < 0.0) e = BsdfEval(e.f_cos + behind.f_cos, e.pdf + behind.pdf);
    }
    PathEval r = PathEval(e.f_cos, e.pdf, e.pdf);
    if (PATH_GUIDING) {
        float cos_l = dot(b.layers.s.n, l);
        float instead = b.guided * b.layers.shares.z * (1.0 - b.layers.through_share);
        bool guided = above && cos_l > 0.0 && instead > 0.0;
        if (guided) r.pdf += instead * (guided_pdf(b.guiding, b.p_bvh, l) - cos_l * INV_PI);
    }
    return r;
}

// A sampled direction.
struct BsdfSample {
    vec3 direction;
    vec3 weight;   // of a delta lobe: BSDF times |cosθ| over probability
    bool delta;    // of a delta lobe, or of weight 0
    bool through;  // the direction leaves behind the surface
    bool straight; // and is not deflected
    bool diffuse;  // sampled from the diffuse base layer
    bool specular; // sampled from a delta lobe
    bool coat;     // sampled from the clear coat
};

// Importance sampling of the BSDF: `x` chooses the lobe, `u` the direction within it.
BsdfSample bsdf_sample(Bsdf bsdf, float x, vec2 u) {
    Layers b = bsdf.layers;
    Surface s = b.s;
    bool coat = CLEARCOAT && x < b.shares.x;
    bool lobe = !coat && x < b.shares.x + b.shares.y;
    bool last = b.shares.w == 0.0 || x < b.shares.x + b.shares.y + b.shares.z;
    bool diffuse = !coat && !lobe && last && b.shares.z > 0.0;
    bool through = TRANSMISSIVE && !coat && !lobe && !diffuse && b.shares.w > 0.0;
    bool delta = (coat ? b.coat_delta : b.delta) && !diffuse;
    vec3 h = event_half_vector(b, coat, u);
    vec3 mirrored = reflect_ray(-s.v, h).R;
    BsdfSample r = BsdfSample(delta ? on_side(mirrored, s.n_triangle) : mirrored, vec3(0.0), delta, through, false, diffuse, delta, coat);
    // A delta lobe returns its weight, at the viewer's angle. For rough lobes the caller evaluates the whole BSDF instead.
    vec3 weight = b.f_base * (b.under * b.left);
    float share = b.shares.y;
    if (CLEARCOAT) {
        weight = coat ? vec3(1.0 - b.under) : weight;
        share = coat ? b.shares.x : share;
    }
    if (TRANSMISSIVE) {
        if (through) {
            bool tir;
            r.direction = through_direction(b, h, mirrored, tir);
            r.straight = passes_straight(b);
            bool passes = r.straight || (dot(r.direction, s.n_triangle) < 0.0 && !(b.solid && ((b.delta && b.total) || tir)));
            weight = passes ? straight_transmittance(b) : vec3(0.0);
            share = b.shares.w;
            // Total internal reflection at the sampled facet: weight 0, so the path terminates.
            r.delta = r.delta || !passes;
        }
    }
    if (r.delta) r.weight = share > 0.0 ? weight / share : vec3(0.0);
    // Of the diffuse light the part `through_share` leaves on the other side: `x` within its lobe chooses.
    bool other_side = false;
    if (DIFFUSE_TRANSMISSION) {
        float within = (x - b.shares.x - b.shares.y) / max(b.shares.z, 1e-6);
        other_side = diffuse && within < b.through_share;
        r.through = r.through || other_side;
    }
    if (diffuse) {
        OrthonormalBasis frame = orthonormal_basis(s.n);
        // Choose the strategy with u.x and rescale it: stratification survives.
        float guides = DIFFUSE_TRANSMISSION && other_side ? 0.0 : bsdf.guided;
        bool guided = PATH_GUIDING && u.x < guides;
        float across = PATH_GUIDING && !guided ? (u.x - guides) / (1.0 - guides) : u.x;
        vec3 l = cosine_sample(across, u.y).L;
        r.direction = frame.t * l.x + frame.b * l.y + s.n * l.z;
        if (PATH_GUIDING) {
            if (guided) r.direction = guided_direction(bsdf.guiding, bsdf.p_bvh, vec2(u.x / guides, u.y));
        }
        if (DIFFUSE_TRANSMISSION) r.direction = other_side ? r.direction - 2.0 * dot(r.direction, s.n) * s.n : r.direction;
    }
    return r;
}
#endif
