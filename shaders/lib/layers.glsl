// The material model: what the layers of a surface do with light. From the top: a clear coat; sheen; the base, which is the boundary of a
// dielectric, a metal, or a mixture of both; below the boundary a diffuse ground, or what lets light through
// (glTF 2.0 appendix B; KHR_materials_clearcoat, sheen, specular, ior, transmission).
//
// Each layer is written once: its Fresnel reflectance, its lobe towards a direction (evaluate), a direction of its lobe (sample), its
// directional albedo for light from all around. A layer leaves to those below what it does not reflect:
//   1 − F(V·H) by the half vector, for lobes of single scattering;
//   1 − its albedo at the viewer's angle for `ggx-multi`, so that no surface sends more than it receives;
//   1 − F(N·V) for a lobe of one direction.
// Where to read: Pharr, Jakob and Humphreys, PBRT 4, chapter 9; Walter et al. 2007; Heitz 2014 and 2018; Turquin 2019.
#ifndef LAYERS_GLSL
#define LAYERS_GLSL
#include "lib/brdf.glsl"
#include "lib/reflectance.glsl"
#include "lib/sheen.glsl"
#include "lib/snell.glsl"
#include "lib/surface.glsl"

layout(constant) const bool TRANSMISSIVE = false; // some material lets light through

// --------------------------------------------------------------------------------------------------------------------
// Fresnel reflectance of each layer

// Reflectance of the boundary from n1 to n2 as its share between that at normal and that at grazing incidence: 1 where the
// reflection is total, 0 where the indices are equal: Schlick's curve rises at grazing incidence whatever they are.
float boundary_share(float cos_in, float n1, float n2) {
    if (n1 == n2) return 0.0;
    if (FRESNEL == FRESNEL_EXACT) {
        float r0 = nested_f0(n1, n2);
        return clamp((fresnel_dielectric(cos_in, n2 / n1).F - r0) / max(1.0 - r0, 1e-6), 0.0, 1.0);
    }
    float sin2 = max(1.0 - cos_in * cos_in, 0.0) * (n1 / n2) * (n1 / n2);
    float cos_thin = n1 > n2 ? sqrt(max(1.0 - sin2, 0.0)) : cos_in;
    return n1 > n2 && sin2 >= 1.0 ? 1.0 : schlick_weight(cos_thin);
}

// Of the dielectric part. F0 may be tinted by KHR_materials_specular, so the exact curve is carried over as its share between F0 and 1.
vec3 fresnel_of_dielectric(Surface s, float cos_in) {
    if (FRESNEL == FRESNEL_SCHLICK) return schlick(s.f0_dielectric, s.f90_dielectric, cos_in);
    float r0 = nested_f0(s.n_outside, s.ior);
    float n = s.n_outside == 1.0 ? s.ior : s.ior / s.n_outside;
    float share = clamp((fresnel_dielectric(cos_in, n).F - r0) / max(1.0 - r0, 1e-6), 0.0, 1.0);
    return s.f0_dielectric + (vec3(s.f90_dielectric) - s.f0_dielectric) * share;
}

// Of the metallic part. Metals given by a colour alone have no n and κ: Schlick on every rung. Of those that have them the colour is
// F0, and what a texture does to it tints the exact curve.
vec3 fresnel_of_metal(Surface s, float cos_in) {
    vec3 f = schlick(s.f0_metal, 1.0, cos_in);
    if (CONDUCTORS && FRESNEL == FRESNEL_EXACT) {
        if (s.n_metal.x > 0.0) {
            f = s.metal_tint * vec3(fresnel_conductor(cos_in, s.n_metal.r, s.kappa_metal.r).F,
                                    fresnel_conductor(cos_in, s.n_metal.g, s.kappa_metal.g).F,
                                    fresnel_conductor(cos_in, s.n_metal.b, s.kappa_metal.b).F);
        }
    }
    return f;
}

// Of the clear coat, a layer of COAT_INDEX. Schlick's curve keeps its F0 (KHR_materials_clearcoat) in every medium.
float fresnel_of_coat(Surface s, float cos_in) {
    float f;
    if (FRESNEL == FRESNEL_EXACT) {
        // In air from constants: drivers round what they know in another way, and both plans of a scene have to agree (from a selected
        // index 6 pixels of ClearCoatTest do not).
        bool in_air = s.n_outside == 1.0;
        f = in_air ? fresnel_dielectric(cos_in, COAT_INDEX).F : fresnel_dielectric(cos_in, COAT_INDEX / s.n_outside).F;
    } else {
        f = schlick(vec3(COAT_F0), 1.0, cos_in).x;
    }
    return s.clearcoat * f;
}

// What the clear coat lets through to the eye.
float under_coat(Surface s) {
    return 1.0 - fresnel_of_coat(s, clamp(dot(s.n_coat, s.v), 0.0, 1.0));
}

// --------------------------------------------------------------------------------------------------------------------
// Directional albedo of each layer: what it sends to the eye of light that is the same from all around

// Cosine at which Schlick's curve has the weight that the table has of a lobe: the exact curve at that angle stands for its mean over
// the lobe, and is the exact curve itself where the lobe is narrow.
float mean_cosine(vec2 ab) {
    return 1.0 - pow(clamp(ab.y / max(ab.x + ab.y, 1e-6), 0.0, 1.0), 0.2);
}

// What the lobes of extensions over the base leave to it, at the viewer's angle.
float left_to_base(Surface s) {
    return SHEEN ? left_by_sheen(s, max(cosine(s.n, s.v), 1e-4)) : 1.0;
}

struct BaseAlbedo {
    vec3 dielectric; // of the dielectric part alone
    vec3 base;       // of the mixture, under the lobes of extensions
};

// `ab` is the table's texel of the base.
BaseAlbedo albedo_of_base(Surface s, vec2 ab) {
    vec3 dielectric = s.f0_dielectric * ab.x + s.f90_dielectric * ab.y;
    vec3 base = s.f0 * ab.x + s.f90 * ab.y;
    if (FRESNEL == FRESNEL_EXACT) {
        float cos_m = mean_cosine(ab);
        vec3 f_dielectric = fresnel_of_dielectric(s, cos_m);
        dielectric = f_dielectric * (ab.x + ab.y);
        base = mix(f_dielectric, fresnel_of_metal(s, cos_m), s.metallic) * (ab.x + ab.y);
    }
    return BaseAlbedo(dielectric * s.compensation, base * s.compensation * left_to_base(s));
}

float albedo_of_coat(Surface s) {
    vec2 ab = reflectance_of_lobe(dot(s.n_coat, s.v), s.clearcoat_roughness);
    if (FRESNEL == FRESNEL_EXACT) return fresnel_of_coat(s, mean_cosine(ab)) * (ab.x + ab.y);
    return s.clearcoat * (COAT_F0 * ab.x + ab.y);
}

// The table's texel of a surface's base.
vec2 lobe_reflectance(Surface s) {
    return reflectance_of_lobe(dot(s.n, s.v), s.roughness);
}

// What the base leaves to the diffuse ground of light from all around.
float ground_share(BaseAlbedo albedo) {
    return 1.0 - min(largest(albedo.dielectric), 1.0);
}

// What the diffuse ground, and the lobes over the base that send light in all directions, make of irradiance from all around.
vec3 scattered_radiance(Surface s, BaseAlbedo albedo, vec3 irradiance) {
    vec3 scattered = s.diffuse * diffuse_brdf(ground_share(albedo));
    if (SHEEN) {
        float cos_v = max(cosine(s.n, s.v), 1e-4);
        scattered = scattered * left_by_sheen_of_all(s, cos_v) + s.sheen.rgb * (sheen_albedo(s, cos_v).x * INV_PI);
    }
    return scattered * irradiance;
}

// Makes up for what single scattering loses, where the knob `brdf` says so.
void compensate(inout Surface s) {
    if (BRDF == BRDF_GGX_MULTI) {
        vec2 ab = lobe_reflectance(s);
        s.compensation = ggx_compensation(s.f0, ab.x + ab.y);
    }
}

// --------------------------------------------------------------------------------------------------------------------
// The layers together

struct Layers {
    Surface s;         // compensated; its diffuse albedo without what goes through
    float cos_v;       // of the shading normal and the viewer, at least 1e-4
    bool between;      // seen by a ray that knows its media, which the next three tell of
    bool solid;        // the surface of a transparent body
    float n1;          // index of the medium before
    float n2;          // and behind, or of the dielectric part
    bool sheet;        // lets light through and encloses nothing
    bool delta;        // the base reflects and refracts into one direction each
    bool coat_delta;
    vec3 f_dielectric; // reflectance at the viewer's angle: of the dielectric part …
    vec3 f_base;       // … and of the mixture
    bool total;        // nothing passes at that angle
    float enters;      // what the base leaves to what lies below it, by the viewer's angle alone
    float under;       // what the coat leaves
    float left;        // and the lobes of extensions, to the base
    vec3 tint;         // of what goes through
    float transmits;   // share of what enters that goes through
    vec4 shares;       // probabilities of coat, base, diffuse ground, through where paths choose; their sum is 1, or 0
};

// Reflectance of the dielectric part by an angle. What tints it in air tints it between two media. `total`: nothing passes.
vec3 fresnel_below_coat(Layers b, float cos_in, out bool total) {
    Surface s = b.s;
    total = false;
    if (!b.between) return fresnel_of_dielectric(s, cos_in);
    float share = boundary_share(cos_in, b.n1, b.n2);
    float in_air = nested_f0(1.0, s.ior);
    vec3 f0 = b.solid ? s.f0_dielectric * (in_air > 0.0 ? nested_f0(b.n1, b.n2) / in_air : 0.0) : s.f0_dielectric;
    total = b.solid && share >= 1.0;
    return total ? vec3(1.0) : f0 + (vec3(s.f90_dielectric) - f0) * share;
}

// The layers of a surface whose base is a lobe, whatever its roughness, and which lets nothing through: for light from points and
// from the prefiltered environment.
Layers layers_of(Surface s) {
    Layers b;
    b.s = s;
    b.cos_v = max(cosine(s.n, s.v), 1e-4);
    b.between = false;
    b.n1 = s.n_outside;
    b.n2 = s.ior;
    b.solid = false;
    b.sheet = false;
    b.delta = false;
    b.coat_delta = false;
    b.f_dielectric = vec3(0.0);
    b.f_base = vec3(0.0);
    b.total = false;
    b.enters = BRDF == BRDF_GGX_MULTI ? ground_share(albedo_of_base(s, lobe_reflectance(s))) : 1.0;
    b.under = CLEARCOAT && BRDF == BRDF_GGX_MULTI ? 1.0 - min(albedo_of_coat(s), 1.0) : 1.0;
    b.left = left_to_base(s);
    b.tint = vec3(0.0);
    b.transmits = 0.0;
    b.shares = vec4(0.0);
    return b;
}

// What is sent in all directions, of light from all around.
float scattered_share(Layers b) {
    float ground = mean(b.s.diffuse) * b.enters * b.left;
    return SHEEN ? ground + mean(b.s.sheen.rgb) * sheen_albedo(b.s, b.cos_v).x : ground;
}

// What goes straight through a surface that bends nothing.
vec3 straight_transmittance(Layers b) {
    return b.tint * (b.transmits * (1.0 - largest(b.f_dielectric)) * b.under * b.left);
}

// --------------------------------------------------------------------------------------------------------------------
// Evaluate

struct BsdfEval {
    vec3 f_cos; // BSDF times |cosθ|, of all lobes that are wider than one direction
    float pdf;  // with which they are drawn, per solid angle
};

// For light from the unit direction l on the viewer's side (lecture B2): what irradiance perpendicular to l becomes.
BsdfEval evaluate_reflection(Layers b, vec3 l) {
    Surface s = b.s;
    BsdfEval r = BsdfEval(vec3(0.0), 0.0);
    float cos_l = cosine(s.n, l);
    const bool phong = BRDF == BRDF_BLINN_PHONG || BRDF == BRDF_BLINN_PHONG_RECIPROCAL;
    // Self-shadow (lecture B9).
    if (cos_l > 0.0) {
        float enters = b.enters;
        vec3 lobe = vec3(0.0);       // of the BRDF
        vec3 lobe_alone = vec3(0.0); // and what is not multiplied by cosθ_l
        if (!b.delta) {
            HalfAngle h = phong ? phong_half_angle(s.n, l, s.v) : half_angle(s.n, l, s.v);
            if (phong) {
                // k_s such that the lobe of B6 reflects F0 of the light at normal incidence in the limit of a narrow lobe: 0.31 F0
                // for a shine of 0, 0.41 for 1, 0.81 for 10, 0.98 for 100 (numerics.md S13).
                float shine = shine_from_alpha(s.alpha);
                vec3 ks = s.f0 * ((shine + 2.0) * 0.5 * INV_PI);
                float cosine_power = phong_lobe(h, shine);
                // The bound of B6, k_d π + k_s 2π/(shine + 2) ≤ 1; B5 has none.
                enters = BRDF == BRDF_BLINN_PHONG ? 1.0 : 1.0 - largest(s.f0_dielectric);
                if (BRDF == BRDF_BLINN_PHONG) lobe_alone = ks * (cosine_power * 0.25);
                else lobe = ks * reciprocal_lobe(h, cosine_power);
            } else {
                // What the dielectric's surface reflects does not reach the ground below; its largest component, so that a
                // tinted F0 gives no complementary colour (KHR_materials_specular).
                bool total;
                vec3 f_dielectric = fresnel_below_coat(b, h.cos_d, total);
                vec3 f = mix(f_dielectric, fresnel_of_metal(s, h.cos_d), s.metallic);
                if (BRDF == BRDF_GGX) enters = 1.0 - largest(f_dielectric);
                float d = ggx_distribution(h.cos_h, h.sin2_h, s.alpha);
                lobe = f * s.compensation * (d * ggx_visibility(cos_l, b.cos_v, s.alpha));
            }
            r.pdf += b.shares.y * mirrored_pdf(b.cos_v, h, s.alpha);
        }
        r.f_cos = (s.diffuse * diffuse_brdf(enters) + lobe) * cos_l;
        if (BRDF == BRDF_BLINN_PHONG) r.f_cos += lobe_alone;
        // Of light from l to the eye sheen leaves the lesser of what it leaves of either (KHR_materials_sheen).
        if (SHEEN) r.f_cos = r.f_cos * min(b.left, left_by_sheen(s, cos_l)) + sheen_lobe(s, l, cos_l, b.cos_v);
        r.pdf += b.shares.z * cos_l * INV_PI;
    }
    if (CLEARCOAT) {
        if (b.coat_delta) {
            r.f_cos *= b.under;
        } else {
            HalfAngle h = half_angle(s.n_coat, l, s.v);
            float f = fresnel_of_coat(s, h.cos_d);
            float coat_l = max(cosine(s.n_coat, l), 0.0);
            float coat_v = max(cosine(s.n_coat, s.v), 1e-4);
            float d = ggx_distribution(h.cos_h, h.sin2_h, s.clearcoat_alpha);
            float vis = ggx_visibility(coat_l, coat_v, s.clearcoat_alpha);
            // Selected, not multiplied by 0: the textbook form of `vis` is no number at the horizon.
            float lobe = coat_l > 0.0 ? d * vis * coat_l : 0.0;
            r.f_cos = r.f_cos * (BRDF == BRDF_GGX_MULTI ? b.under : 1.0 - f) + f * lobe;
            r.pdf += coat_l > 0.0 ? b.shares.x * mirrored_pdf(coat_v, h, s.clearcoat_alpha) : 0.0;
        }
    }
    return r;
}

// For light from behind a rough surface. A sheet scatters as its mirror image does, to the other side. Between two media the half
// vector that bends v into l is along n₁v + n₂l, and dω_h = n₂² |l·h| / (n₁ v·h + n₂ l·h)² dω_l (Walter et al. 2007); radiance is divided
// by the square of the index here, so that n₂² falls out of the BSDF alone.
BsdfEval evaluate_transmission(Layers b, vec3 l) {
    Surface s = b.s;
    float cos_l = dot(s.n, l);
    vec3 mirrored = l - 2.0 * cos_l * s.n;
    vec3 sum = b.sheet ? s.v + mirrored : -(b.n1 * s.v + b.n2 * l);
    sum = dot(sum, s.n) < 0.0 ? -sum : sum;
    vec3 h = sum * inversesqrt(max(dot(sum, sum), SMALLEST_NORMAL));
    float v_h = dot(s.v, h);
    float l_h = dot(l, h);
    float denominator = b.n1 * v_h + b.n2 * l_h;
    float stretch = b.sheet ? 0.25 / max(v_h, 1e-6) : b.n2 * b.n2 * abs(l_h) / max(denominator * denominator, 1e-12);
    bool meets_facet = cos_l < 0.0 && !b.delta && b.transmits > 0.0 && v_h > 0.0 && (b.sheet || l_h < 0.0);
    float pdf = smith_g1(b.cos_v, s.alpha) * ggx_distribution(s.n, h, s.alpha) * v_h / b.cos_v * stretch;
    bool total;
    vec3 f_dielectric = fresnel_below_coat(b, v_h, total);
    float share = b.transmits * (1.0 - largest(f_dielectric)) * smith_g2_over_g1(b.cos_v, cos_l, s.alpha);
    float under = (CLEARCOAT ? b.under : 1.0) * b.left;
    return meets_facet ? BsdfEval(b.tint * (share * pdf * under), b.shares.w * pdf) : BsdfEval(vec3(0.0), 0.0);
}

// --------------------------------------------------------------------------------------------------------------------
// Sample: one lobe at a time

struct LobeSample {
    vec3 direction;
    vec3 weight;   // BSDF times |cosθ| over density, of this lobe alone and without the coat above it; 0: nothing goes there
    bool straight; // nothing has bent it
};

// What masking and shadowing leave of r, mirrored at a half vector drawn for the viewer: nothing below the surface or its triangle.
float unshadowed(vec3 n, vec3 v, vec3 r, vec3 n_triangle, float alpha) {
    float cos_r = dot(r, n);
    return dot(r, n_triangle) > 0.0 && cos_r > 0.0 ? smith_g2_over_g1(dot(n, v), cos_r, alpha) : 0.0;
}

// The half vector of an event: of the coat's lobe, or of the base's.
vec3 event_half_vector(Layers b, bool coat, vec2 u) {
    vec3 n = coat ? b.s.n_coat : b.s.n;
    bool delta = coat ? b.coat_delta : b.delta;
    return ROUGH && !delta ? half_vector(n, b.s.v, coat ? b.s.clearcoat_alpha : b.s.alpha, u) : n;
}

// Where what goes through leaves, r being the mirrored direction. Equal indices bend nothing, not even by a rounding. A sheet scatters as
// its mirror image does, to the other side. `tir`: nothing does.
vec3 through_direction(Layers b, vec3 h, vec3 r, out bool tir) {
    Surface s = b.s;
    vec3 direction = -s.v;
    bool rough = ROUGH && !b.delta;
    Refraction t = refract_ray(direction, h, b.n2 / b.n1);
    tir = t.tir;
    vec3 bent = b.n1 == b.n2 ? direction : t.T;
    vec3 scattered = rough ? r - 2.0 * dot(r, s.n) * s.n : direction;
    vec3 through = b.sheet ? scattered : bent;
    return rough ? through : -on_side(-through, s.n_triangle);
}

// Whether nothing bends what goes through.
bool passes_straight(Layers b) {
    return !(ROUGH && !b.delta) && (b.sheet || b.n1 == b.n2);
}

LobeSample sample_coat(Layers b, vec3 h) {
    Surface s = b.s;
    vec3 r = reflect_ray(-s.v, h).R;
    float masking = ROUGH && !b.coat_delta ? unshadowed(s.n_coat, s.v, r, s.n_triangle, s.clearcoat_alpha) : 1.0;
    float f = fresnel_of_coat(s, clamp(dot(h, s.v), 0.0, 1.0));
    return LobeSample(b.coat_delta ? on_side(r, s.n_triangle) : r, vec3(f * masking), false);
}

// Reflectance at a facet.
struct FacetFresnel {
    vec3 dielectric;
    vec3 base;  // of the mixture
    bool total; // nothing passes
};

FacetFresnel fresnel_at_facet(Layers b, vec3 h) {
    FacetFresnel f;
    float cos_h = clamp(dot(h, b.s.v), 0.0, 1.0);
    f.dielectric = fresnel_below_coat(b, cos_h, f.total);
    f.base = mix(f.dielectric, fresnel_of_metal(b.s, cos_h), b.s.metallic);
    return f;
}

LobeSample sample_base(Layers b, vec3 h, FacetFresnel f) {
    Surface s = b.s;
    vec3 r = reflect_ray(-s.v, h).R;
    float masking = ROUGH && !b.delta ? unshadowed(s.n, s.v, r, s.n_triangle, s.alpha) : 1.0;
    return LobeSample(b.delta ? on_side(r, s.n_triangle) : r, f.base * s.compensation * (masking * b.left), false);
}

LobeSample sample_transmission(Layers b, vec3 h, FacetFresnel f) {
    Surface s = b.s;
    bool rough = ROUGH && !b.delta;
    vec3 r = reflect_ray(-s.v, h).R;
    bool tir;
    vec3 through = through_direction(b, h, r, tir);
    bool straight = passes_straight(b);
    bool passes = straight || (dot(through, s.n_triangle) < 0.0 && !(b.solid && (f.total || tir)));
    float masking = rough ? smith_g2_over_g1(dot(s.n, s.v), dot(through, s.n), s.alpha) : 1.0;
    if (rough && b.sheet) masking = dot(r, s.n) > 0.0 ? masking : 0.0;
    vec3 weight = b.tint * (b.transmits * (1.0 - largest(f.dielectric)) * masking * b.left);
    return LobeSample(through, passes ? weight : vec3(0.0), straight);
}
#endif
