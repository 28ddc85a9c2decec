// What a surface scatters, as one function of two directions and as densities to draw directions by: the coat's lobe, the
// base's lobe, the diffuse ground and what goes through. A lobe of roughness up to MIN_ROUGHNESS is one direction.
#ifndef BSDF_GLSL
#define BSDF_GLSL
#include "lib/aims.glsl"
#include "lib/boundary.glsl"
#include "lib/reflectance.glsl"
#include "lib/snell.glsl"

layout(constant) const bool FROSTED = false; // some surface that lets light through is

struct Bsdf {
    Surface s;       // compensated; its diffuse albedo without what goes through
    vec3 n;          // of the triangle, on the viewer's side
    float cos_v;
    float n1;        // index of the medium before
    float n2;        // and behind, or of the surface
    bool solid;
    bool sheet;
    bool sharp;      // the base reflects and refracts into one direction each
    bool coat_sharp;
    vec3 tint;       // of what goes through
    float transmits;
    float enters;    // what the base's lobe leaves to what lies below it, where that does not depend on the light's direction
    float under;     // what the coat lets through, by the viewer's angle
    vec3 f_dielectric; // reflectance at the viewer's angle: of the dielectric part …
    vec3 f_sharp;    // … and of the mixture
    bool total;
    vec4 shares;     // probabilities of coat, lobe, diffuse ground, through; their sum is 1, or 0 where nothing is scattered
    float aimed;     // share of the diffuse ground's directions that are aimed
    Aims aims;
    vec3 p_bvh;      // where from
};

float mean(vec3 v) {
    return (v.x + v.y + v.z) * (1.0 / 3.0);
}

// Of the probability of a rough lobe, beside albedos.
const float LEAST_SHARE = 0.1;

// Below the lobe light is only lost to it: for a sharp one by its reflectance at the viewer's angle, for `ggx-multi` by its
// directional reflectance there, so that no surface sends more than it receives. The other models have 1 − F(V·H), as the
// deferred pass does, which at grazing angles is more than the lobe leaves.
Bsdf bsdf_of(HitSurface hit, Boundary boundary) {
    Bsdf b;
    b.s = hit.s;
    b.s.diffuse *= 1.0 - hit.transmits;
    b.n = hit.n;
    b.cos_v = max(dot(b.s.n, b.s.v), 1e-4);
    b.solid = boundary.solid;
    b.sheet = boundary.sheet;
    b.n1 = index_of(boundary.here);
    b.n2 = boundary.solid ? index_of(boundary.there) : b.s.ior;
    // Where nothing is bent, nothing is spread either.
    b.sharp = !ROUGH || b.s.roughness <= MIN_ROUGHNESS || (b.solid && b.n1 == b.n2);
    b.coat_sharp = !ROUGH || b.s.clearcoat_roughness <= MIN_ROUGHNESS;
    if (!b.sharp) compensate(b.s);
    b.f_dielectric = reflectance_between(b.s, b.solid, b.n1, b.n2, b.cos_v, b.total);
    b.f_sharp = mix(b.f_dielectric, fresnel_of_metal(b.s, b.cos_v), b.s.metallic);
    b.enters = 1.0 - largest(b.f_dielectric);
    float mirrors = mean(b.f_sharp);
    // Half vectors away from the normal see more of it than the viewer's angle tells: what little a lobe reflects at normal
    // incidence may be ten times as much there, and is drawn often enough for that.
    if (!b.sharp && mirrors > 0.0) mirrors = max(mirrors * mean(b.s.compensation), LEAST_SHARE);
    if (ROUGH && BRDF == 3 && !b.sharp) {
        vec2 ab = lobe_reflectance(b.s);
        b.enters = 1.0 - min(largest((b.s.f0_dielectric * ab.x + b.s.f90_dielectric * ab.y) * b.s.compensation), 1.0);
    }
    b.transmits = TRANSMISSIVE ? hit.transmits * (1.0 - hit.s.metallic) : 0.0;
    b.tint = vec3(0.0);
    if (TRANSMISSIVE) b.tint = tint_through(hit, boundary.sheet);
    b.under = 1.0;
    float coat = 0.0;
    if (CLEARCOAT) {
        coat = 1.0 - under_coat(b.s);
        if (ROUGH && BRDF == 3 && !b.coat_sharp) {
            vec2 ab = reflectance_of_lobe(dot(b.s.n_coat, b.s.v), b.s.clearcoat_roughness);
            coat = b.s.clearcoat * min(0.04 * ab.x + ab.y, 1.0);
        }
        b.under = 1.0 - coat;
        if (!b.coat_sharp && coat > 0.0) coat = max(coat, LEAST_SHARE);
    }
    // Some facets let through what the viewer's angle would reflect altogether.
    float below = 1.0 - largest(b.f_dielectric);
    below = b.sharp ? below : max(below, LEAST_SHARE);
    b.shares = vec4(coat, vec3(1.0 - coat) * vec3(mirrors, mean(b.s.diffuse) * b.enters, mean(b.tint) * b.transmits * below));
    float sum = dot(b.shares, vec4(1.0));
    b.shares = sum > 0.0 ? b.shares / sum : vec4(0.0);
    b.aimed = 0.0;
    b.aims = Aims(0, 0, 0.0);
    b.p_bvh = b.s.p_bvh;
    return b;
}

// The same, for a path that goes on from there: towards what mirrors or bends light, too.
void aim(inout Bsdf b) {
    b.aims = aims_at(b.p_bvh);
    b.aimed = b.aims.count > 0 ? AIMED_SHARE : 0.0;
}

// What goes straight through a sharp surface that bends nothing: a sheet, or a boundary between equal indices.
vec3 straight_through(Bsdf b) {
    bool straight = b.sharp && (b.sheet || (b.solid && b.n1 == b.n2));
    return straight ? b.tint * (b.transmits * (1.0 - largest(b.f_dielectric)) * b.under) : vec3(0.0);
}

struct Scattered {
    vec3 f_cos; // BSDF times |cosθ|, of all lobes that are not sharp
    float pdf;  // with which they are drawn, per solid angle
    float plain_pdf; // and would be if nothing were aimed at
};

// For light from the unit direction l, on whichever side.
Scattered scattered(Bsdf b, vec3 l) {
    Surface s = b.s;
    Scattered r = Scattered(vec3(0.0), 0.0, 0.0);
    float cos_l = dot(s.n, l);
    bool above = dot(b.n, l) > 0.0;
    if (above && cos_l > 0.0) {
        vec3 lobe = vec3(0.0);
        float enters = b.enters;
        if (ROUGH) {
            HalfAngle h = BRDF <= 1 ? phong_half_angle(s.n, l, s.v) : half_angle(s.n, l, s.v);
            if (!b.sharp) {
                if (BRDF <= 1) {
                    float shine = shine_from_alpha(s.alpha);
                    vec3 ks = s.f0 * ((shine + 2.0) * 0.5 * INV_PI);
                    float cosine_power = phong_lobe(h, shine);
                    lobe = BRDF == 0 ? ks * (cosine_power * 0.25) : ks * (reciprocal_lobe(h, cosine_power) * cos_l);
                    enters = 1.0;
                } else {
                    bool total;
                    vec3 f_dielectric = reflectance_between(s, b.solid, b.n1, b.n2, h.cos_d, total);
                    vec3 f = mix(f_dielectric, fresnel_of_metal(s, h.cos_d), s.metallic);
                    float d = ggx_distribution(h.cos_h, h.sin2_h, s.alpha);
                    lobe = f * s.compensation * (d * ggx_visibility(cos_l, b.cos_v, s.alpha) * cos_l);
                    if (BRDF == 2) enters = 1.0 - largest(f_dielectric);
                }
                r.pdf += b.shares.y * mirrored_pdf(b.cos_v, h, s.alpha);
            }
        }
        r.f_cos = s.diffuse * (diffuse_brdf(enters) * cos_l) + lobe;
        r.pdf += b.shares.z * cos_l * INV_PI;
    }
    if (TRANSMISSIVE && FROSTED) {
        bool below = dot(b.n, l) < 0.0 && cos_l < 0.0 && !b.sharp && b.transmits > 0.0;
        if (below) {
            // A sheet spreads as its mirror image does, to the other side. Between two media the half vector that bends v
            // into l is along n₁v + n₂l, and dω_h = n₂² |l·h| / (n₁ v·h + n₂ l·h)² dω_l (Walter et al. 2007); radiance is
            // told over the square of the index here, so that n₂² falls out of the BSDF alone.
            vec3 mirrored = l - 2.0 * cos_l * s.n;
            vec3 sum = b.sheet ? s.v + mirrored : -(b.n1 * s.v + b.n2 * l);
            sum = dot(sum, s.n) < 0.0 ? -sum : sum;
            vec3 h = sum * inversesqrt(max(dot(sum, sum), SMALLEST_NORMAL));
            float v_h = dot(s.v, h);
            float l_h = dot(l, h);
            float denominator = b.n1 * v_h + b.n2 * l_h;
            float stretch = b.sheet ? 0.25 / max(v_h, 1e-6)
                                    : b.n2 * b.n2 * abs(l_h) / max(denominator * denominator, 1e-12);
            bool meets_facet = v_h > 0.0 && (b.sheet || l_h < 0.0);
            float pdf = smith_g1(b.cos_v, s.alpha) * ggx_distribution(s.n, h, s.alpha) * v_h / b.cos_v * stretch;
            bool total;
            vec3 f_dielectric = reflectance_between(s, b.solid, b.n1, b.n2, v_h, total);
            float share = b.transmits * (1.0 - largest(f_dielectric)) * smith_g2_over_g1(b.cos_v, cos_l, s.alpha);
            if (meets_facet) {
                r.f_cos = b.tint * (share * pdf);
                r.pdf = b.shares.w * pdf;
            }
        }
    }
    if (CLEARCOAT && !ROUGH) r.f_cos *= b.under;
    if (CLEARCOAT && ROUGH) {
        HalfAngle h = half_angle(s.n_coat, l, s.v);
        float coat_l = dot(s.n_coat, l);
        float coat_v = max(dot(s.n_coat, s.v), 1e-4);
        float f = s.clearcoat * schlick(vec3(0.04), 1.0, h.cos_d).x;
        bool on_coat = above && coat_l > 0.0 && !b.coat_sharp;
        float d = ggx_distribution(h.cos_h, h.sin2_h, s.clearcoat_alpha);
        float lobe = on_coat ? d * ggx_visibility(coat_l, coat_v, s.clearcoat_alpha) * coat_l : 0.0;
        r.f_cos = r.f_cos * (b.coat_sharp || BRDF == 3 || !above ? b.under : 1.0 - f) + f * lobe;
        r.pdf += on_coat ? b.shares.x * mirrored_pdf(coat_v, h, s.clearcoat_alpha) : 0.0;
    }
    r.plain_pdf = r.pdf;
    if (AIMED) {
        float instead = b.aimed * b.shares.z;
        bool aims = above && cos_l > 0.0 && instead > 0.0;
        if (aims) r.pdf += instead * (aimed_pdf(b.aims, b.p_bvh, l) - cos_l * INV_PI);
    }
    return r;
}

// A direction drawn from a surface.
struct Drawn {
    vec3 direction;
    vec3 weight;   // of a sharp one: BSDF times |cosθ| over probability
    bool sharp;
    bool through;  // it leaves behind the surface
    bool straight; // and nothing bent it
};

// `x` chooses the lobe, `u` the direction in it.
Drawn draw_direction(Bsdf b, vec3 direction, float x, vec2 u) {
    Surface s = b.s;
    Drawn r = Drawn(s.n, vec3(0.0), false, false, false);
    bool coat = CLEARCOAT && x < b.shares.x;
    bool lobe = !coat && x < b.shares.x + b.shares.y;
    bool last = b.shares.w == 0.0 || x < b.shares.x + b.shares.y + b.shares.z;
    bool diffuse = !coat && !lobe && last && b.shares.z > 0.0;
    bool through = TRANSMISSIVE && !coat && !lobe && !diffuse && b.shares.w > 0.0;
    bool sharp = coat ? b.coat_sharp : b.sharp;
    vec3 n = coat ? s.n_coat : s.n;
    vec3 h = n;
    if (ROUGH && !sharp) h = half_vector(n, s.v, coat ? s.clearcoat_alpha : s.alpha, u);
    vec3 mirrored = reflect_ray(direction, h).R;
    r.sharp = sharp && !diffuse;
    r.direction = r.sharp ? on_side(mirrored, b.n) : mirrored;
    if (diffuse) {
        OrthonormalBasis frame = orthonormal_basis(s.n);
        // Parts of an even set of points in an interval are as even: which directions are aimed is for `u` to say.
        bool aimed = AIMED && u.x < b.aimed;
        float across = AIMED && !aimed ? (u.x - b.aimed) / (1.0 - b.aimed) : u.x;
        vec3 l = cosine_sample(across, u.y).L;
        r.direction = frame.t * l.x + frame.b * l.y + s.n * l.z;
        if (AIMED) {
            if (aimed) r.direction = aimed_direction(b.aims, b.p_bvh, vec2(u.x / b.aimed, u.y));
        }
    }
    if (r.sharp) {
        float f_coat = CLEARCOAT ? 1.0 - under_coat(s) : 0.0;
        r.weight = coat ? vec3(f_coat / b.shares.x) : b.shares.y > 0.0 ? b.f_sharp * (b.under / b.shares.y) : vec3(0.0);
    }
    if (through) {
        Refraction t = refract_ray(direction, h, b.n2 / b.n1);
        // Equal indices bend nothing, not even by a rounding.
        vec3 bent = b.n1 == b.n2 ? direction : t.T;
        vec3 spread = b.sharp ? direction : mirrored - 2.0 * dot(mirrored, s.n) * s.n;
        vec3 l = b.sheet ? spread : bent;
        r.direction = b.sharp ? -on_side(-l, b.n) : l;
        r.through = true;
        r.straight = b.sharp && (b.sheet || b.n1 == b.n2);
        bool passes = !(b.solid && ((b.sharp && b.total) || t.tir)) || r.straight;
        float enters = b.transmits * (1.0 - largest(b.f_dielectric));
        r.weight = b.sharp && passes ? b.tint * (enters * b.under / b.shares.w) : vec3(0.0);
        r.sharp = r.sharp || !passes;
    }
    return r;
}
#endif
