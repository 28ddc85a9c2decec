// The layered material model: the lobes of a BSDF from the clear coat down to the diffuse base layer.
// The layers from the top: a clear coat; sheen; the base, which is a dielectric interface, a conductor, or a mixture of
// both; below the dielectric interface a diffuse base layer, or transmission (glTF 2.0 appendix B; KHR_materials_clearcoat,
// sheen, anisotropy, iridescence, diffuse_transmission, specular, ior, transmission).
//
// Each layer has its Fresnel reflectance, its lobe towards a direction (evaluate), a sampled direction of its lobe
// (sample), and its directional albedo in a uniform environment. A layer leaves to the layers below it the energy that it
// does not reflect:
//   1 − F(V·H) at the half vector, for lobes of single scattering;
//   1 − its directional albedo at the viewer's angle for `ggx-multi`, so that no surface sends more than it receives;
//   1 − F(N·V) for a specular (delta) lobe.
// Rough lobes are sampled by the VNDF (distribution of visible normals). Where to read: pbrt 4, chapter 9; Walter et al.
// 2007; Heitz 2014 and 2018; Turquin 2019. Assumes: unit vectors in world axes, on the viewer's side; α = roughness².
#ifndef LAYERS_GLSL
#define LAYERS_GLSL
#include "lib/anisotropy.glsl"
#include "lib/brdf.glsl"
#include "lib/loops.glsl"
#include "lib/random.glsl"
#include "lib/reflectance.glsl"
#include "lib/sheen.glsl"
#include "lib/snell.glsl"
#include "lib/surface.glsl"
#include "lib/thin_film.glsl"

layout(constant) const bool TRANSMISSIVE = false; // some material transmits light
layout(constant) const bool ROUGH_TRANSMISSION = false; // lobes of rough surfaces that transmit light are evaluated

// --------------------------------------------------------------------------------------------------------------------
// Fresnel reflectance of each layer

// Fresnel reflectance of the interface from n1 to n2 by the exact curve, as its position between the values at normal and at
// grazing incidence.
float exact_share(float cos_in, float n1, float n2) {
    float r0 = nested_f0(n1, n2);
    // Some devices do not divide by 1 exactly.
    float reflectance = fresnel_dielectric(cos_in, n1 == 1.0 ? n2 : n2 / n1).F;
    // Where a quotient may be off by some roundings, x/x is not 1, and total internal reflection would be missed.
    return reflectance >= 1.0 ? 1.0 : clamp((reflectance - r0) / max(1.0 - r0, 1e-6), 0.0, 1.0);
}

// The same by the curve of the knob `fresnel`. 1 for total internal reflection; 0 for equal indices, where Schlick's curve would rise at grazing incidence
// all the same.
float boundary_share(float cos_in, float n1, float n2) {
    if (n1 == n2) return 0.0;
    if (FRESNEL == FRESNEL_EXACT) return exact_share(cos_in, n1, n2);
    float sin2 = max(1.0 - cos_in * cos_in, 0.0) * (n1 / n2) * (n1 / n2);
    float cos_thin = n1 > n2 ? sqrt(max(1.0 - sin2, 0.0)) : cos_in;
    return n1 > n2 && sin2 >= 1.0 ? 1.0 : schlick_weight(cos_thin);
}

// The film over the base, at an angle whose cosine in the medium n1 outside is cos_in (lib/thin_film.glsl).
Film film_of(Surface s, float cos_in, float n1) {
    return film_at(cos_in, n1, s.film.y, s.film.z);
}

// Fresnel reflectance `bare` of a dielectric base of index n2, with the film over it. KHR_materials_specular scales F0, and
// here the whole: r0 is what f0_dielectric would be without it.
vec3 under_film(Surface s, Film film, vec3 bare, float n2, float r0) {
    vec3 scale = r0 > 0.0 ? min(s.f0_dielectric / r0, 1.0) : vec3(1.0);
    vec3 coated = scale * film_over_dielectric(film, n2);
    return s.film.x > 0.0 ? bare + (coated - bare) * s.film.x : bare;
}

// Fresnel reflectance `bare` of a metal, with the film over it.
vec3 metal_under_film(Surface s, Film film, vec3 bare) {
    vec3 coated = film_over_metal(film, schlick(s.f0_metal, 1.0, film.cos_film));
    return s.film.x > 0.0 ? bare + (coated - bare) * s.film.x : bare;
}

// Fresnel reflectance of the dielectric part without its film. KHR_materials_specular may tint F0, so the exact curve is
// mapped to the range from F0 to F90.
vec3 fresnel_of_dielectric(Surface s, float cos_in) {
    if (FRESNEL == FRESNEL_SCHLICK) return schlick(s.f0_dielectric, s.f90_dielectric, cos_in);
    return s.f0_dielectric + (vec3(s.f90_dielectric) - s.f0_dielectric) * exact_share(cos_in, s.n_outside, s.ior);
}

// Fresnel reflectance of the metallic part without its film. Metals given by a colour have no n and κ: Schlick on every rung. For metals
// with n and κ the colour is F0, and a texture's factor tints the exact curve.
vec3 fresnel_of_metal(Surface s, float cos_in) {
    vec3 f = schlick(s.f0_metal, 1.0, cos_in);
    if (CONDUCTORS && FRESNEL == FRESNEL_EXACT) {
        if (s.n_metal.x > 0.0) {
            // The channels in a loop: the code exists once.
            for (int i = 0; i < 3; i++) f[i] = s.metal_tint[i] * fresnel_conductor(cos_in, s.n_metal[i], s.kappa_metal[i]).F;
        }
    }
    return f;
}

// Fresnel reflectance of both parts, with the film.
struct BaseFresnel {
    vec3 dielectric;
    vec3 metal;
};

BaseFresnel fresnel_of_base(Surface s, float cos_in) {
    // The film first: nothing else waits in registers meanwhile.
    Film film;
    if (IRIDESCENCE) film = film_of(s, cos_in, s.n_outside);
    vec3 dielectric = fresnel_of_dielectric(s, cos_in);
    if (IRIDESCENCE) dielectric = under_film(s, film, dielectric, s.ior, nested_f0(s.n_outside, s.ior));
    vec3 metal = fresnel_of_metal(s, cos_in);
    if (IRIDESCENCE) metal = metal_under_film(s, film, metal);
    return BaseFresnel(dielectric, metal);
}

// Fresnel reflectance of the clear coat, of index COAT_INDEX. Schlick's curve keeps its F0 (KHR_materials_clearcoat) in
// every medium.
float fresnel_of_coat(Surface s, float cos_in) {
    float f;
    if (FRESNEL == FRESNEL_EXACT) {
        f = fresnel_dielectric(cos_in, s.n_outside == 1.0 ? COAT_INDEX : COAT_INDEX / s.n_outside).F;
    } else {
        f = schlick(vec3(COAT_F0), 1.0, cos_in).x;
    }
    return s.clearcoat * f;
}

// Energy left under the clear coat, at the viewer's angle; 1 without a coat.
float under_coat(Surface s) {
    return CLEARCOAT ? 1.0 - fresnel_of_coat(s, clamp(dot(s.n_coat, s.v), 0.0, 1.0)) : 1.0;
}

// --------------------------------------------------------------------------------------------------------------------
// The GGX lobe of the base, round or anisotropic. A surface without anisotropy takes the round formulas in every plan.

bool is_anisotropic(Surface s) {
    return s.alpha_along != s.alpha;
}

vec2 base_alphas(Surface s) {
    return vec2(s.alpha_along, s.alpha);
}

// A direction in the frame of the base's lobe.
vec3 in_lobe_frame(Surface s, vec3 w) {
    return vec3(dot(w, s.tangent), dot(w, cross(s.n, s.tangent)), dot(w, s.n));
}

float base_g2_over_g1(Surface s, vec3 v, vec3 l) {
    float g = smith_g2_over_g1(dot(s.n, v), dot(s.n, l), s.alpha);
    if (ANISOTROPY) g = is_anisotropic(s) ? anisotropic_g2_over_g1(in_lobe_frame(s, v), in_lobe_frame(s, l), base_alphas(s)) : g;
    return g;
}

// G₁ of the viewer times D of a half vector.
float base_visible_normals(Surface s, float cos_v, vec3 h) {
    float g_d = smith_g1(cos_v, s.alpha) * ggx_distribution(s.n, h, s.alpha);
    if (ANISOTROPY) {
        float root = anisotropic_root(in_lobe_frame(s, s.v), base_alphas(s));
        float d = anisotropic_distribution(cosine(s.n, h), sine_squared(s.n, h), share_along(in_lobe_frame(s, h)), base_alphas(s));
        g_d = is_anisotropic(s) ? 2.0 * cos_v / (cos_v + root) * d : g_d;
    }
    return g_d;
}

// A half vector of the base's anisotropic lobe, sampled from the VNDF.
vec3 anisotropic_half_vector(Surface s, vec2 alphas, vec2 u) {
    vec3 v = in_lobe_frame(s, s.v);
    vec3 h = visible_half_vector(vec3(v.xy, max(v.z, 1e-4)), alphas, u);
    return s.tangent * h.x + cross(s.n, s.tangent) * h.y + s.n * h.z;
}

// Point i of `count` points of the unit square for the VNDF: half of them the Hammersley set, the others turned by half a turn.
// The frame of the VNDF turns by half a turn where a view crosses the lobe's axis: with these points nothing is seen of that.
vec2 half_turn_point(uint i, uint count) {
    uint pair = i % (count / 2);
    float turn = i < count / 2 ? 0.0 : 0.5;
    return vec2((float(pair) + 0.5) / float(count / 2), 0.5 * unit_float(bitfieldReverse(pair)) + turn);
}

// Directions that average an anisotropic lobe: the mean is within 0.037 of the integral (f64, seven elevations, five azimuths,
// five materials). A round lobe of some mean α is off by up to 0.24.
const uint LOBE_DIRECTIONS = 32;

// Factors of F0 and F90 in the directional albedo of the base's anisotropic lobe (as lib/reflectance.glsl of a round one).
vec2 anisotropic_reflectance(Surface s) {
    vec2 sum = vec2(0.0);
    for (uint i = 0; i < LOBE_DIRECTIONS; i++) {
        vec3 h = anisotropic_half_vector(s, base_alphas(s), half_turn_point(i, LOBE_DIRECTIONS));
        vec3 r = reflect_ray(-s.v, h).R;
        vec3 to = in_lobe_frame(s, r);
        float weight = to.z > 0.0 ? anisotropic_g2_over_g1(in_lobe_frame(s, s.v), to, base_alphas(s)) : 0.0;
        float grazing = schlick_weight(dot(s.v, h));
        sum += weight * vec2(1.0 - grazing, grazing);
    }
    return sum / float(LOBE_DIRECTIONS);
}

// --------------------------------------------------------------------------------------------------------------------
// Directional albedo of each layer: the fraction of a uniform environment's radiance that it sends to the eye

// The cosine at which Schlick's weight equals the table's weight of a lobe. The exact curve at that angle stands for its
// mean over the lobe; for a narrow lobe it is the exact curve itself.
float mean_cosine(vec2 ab) {
    return 1.0 - pow(clamp(ab.y / max(ab.x + ab.y, 1e-6), 0.0, 1.0), 0.2);
}

// Energy left to the base under the lobes of extensions, at the viewer's angle.
float left_to_base(Surface s) {
    return SHEEN ? left_by_sheen(s, max(cosine(s.n, s.v), 1e-4)) : 1.0;
}

struct BaseAlbedo {
    vec3 dielectric; // of the dielectric part alone
    vec3 base;       // of the mixture with the metallic part, under the lobes of extensions
};

// Energy compensation of the base's lobe for single scattering, where the knob `brdf` is `ggx-multi`.
vec3 compensation(Surface s) {
    return BRDF == BRDF_GGX_MULTI ? ggx_compensation(f0_of(s), s.lobe.x + s.lobe.y) : vec3(1.0);
}

BaseAlbedo albedo_of_base(Surface s) {
    vec2 ab = s.lobe;
    vec3 dielectric = s.f0_dielectric * ab.x + s.f90_dielectric * ab.y;
    vec3 base = f0_of(s) * ab.x + f90_of(s) * ab.y;
    if (FRESNEL == FRESNEL_EXACT || IRIDESCENCE) {
        BaseFresnel f = fresnel_of_base(s, mean_cosine(ab));
        bool at_mean = FRESNEL == FRESNEL_EXACT || s.film.x > 0.0;
        dielectric = at_mean ? f.dielectric * (ab.x + ab.y) : dielectric;
        base = at_mean ? blend(f.dielectric, f.metal, s.metallic) * (ab.x + ab.y) : base;
    }
    vec3 compensated = compensation(s);
    return BaseAlbedo(dielectric * compensated, base * compensated * left_to_base(s));
}

// `ab` is the table's texel for the coat, f its Fresnel reflectance at mean_cosine(ab).
float albedo_of_coat(Surface s, vec2 ab, float f) {
    return FRESNEL == FRESNEL_EXACT ? f * (ab.x + ab.y) : s.clearcoat * (COAT_F0 * ab.x + ab.y);
}

float albedo_of_coat(Surface s) {
    vec2 ab = reflectance_of_lobe(dot(s.n_coat, s.v), s.clearcoat_roughness);
    return albedo_of_coat(s, ab, fresnel_of_coat(s, mean_cosine(ab)));
}

// Energy left under the clear coat: by its directional albedo, or by its reflectance at the viewer's angle. Fresnel's formula stands
// once.
float left_under_coat(Surface s, bool by_albedo) {
    if (!CLEARCOAT) return 1.0;
    vec2 ab = reflectance_of_lobe(dot(s.n_coat, s.v), s.clearcoat_roughness);
    float f = fresnel_of_coat(s, by_albedo ? mean_cosine(ab) : clamp(dot(s.n_coat, s.v), 0.0, 1.0));
    return 1.0 - (by_albedo ? min(albedo_of_coat(s, ab, f), 1.0) : f);
}

// The table's texel for the base of a surface; of an anisotropic lobe the same factors by a sum.
vec2 lobe_reflectance(Surface s) {
    vec2 ab = reflectance_of_lobe(dot(s.n, s.v), s.roughness);
    if (ANISOTROPY) {
        if (is_anisotropic(s)) ab = anisotropic_reflectance(s);
    }
    return ab;
}

// Energy left to the diffuse base layer under the base's lobe, in a uniform environment.
float ground_share(BaseAlbedo albedo) {
    return 1.0 - min(largest(albedo.dielectric), 1.0);
}

// Radiance that diffuse transmission sends, per irradiance on the other side.
vec3 transmitted_per_irradiance(Surface s, BaseAlbedo albedo) {
    vec3 scattered = s.diffuse_through * diffuse_brdf(ground_share(albedo));
    if (SHEEN) scattered *= left_by_sheen_of_all(s, max(cosine(s.n, s.v), 1e-4));
    return scattered;
}

// Radiance that the diffuse base layer and the lobes of extensions (sheen) send, per irradiance from a uniform environment.
vec3 scattered_per_irradiance(Surface s, BaseAlbedo albedo) {
    vec3 scattered = s.diffuse * diffuse_brdf(ground_share(albedo));
    if (SHEEN) {
        float cos_v = max(cosine(s.n, s.v), 1e-4);
        scattered = scattered * left_by_sheen_of_all(s, cos_v) + s.sheen.rgb * (sheen_albedo(s, cos_v).x * INV_PI);
    }
    return scattered;
}

// --------------------------------------------------------------------------------------------------------------------
// The layers together

struct Layers {
    Surface s;         // its `lobe` is known; its diffuse albedo excludes what is transmitted
    float cos_v;       // cosine between shading normal and viewer, at least 1e-4
    bool between;      // the media on both sides are known, as for a ray: solid, n1 and n2 hold
    bool solid;        // interface of a closed dielectric mesh
    float n1;          // index of the medium on the viewer's side
    float n2;          // index behind the interface; unless solid, of the dielectric part
    bool sheet;        // thin-walled: transmits light and encloses no medium
    bool delta;        // the base reflects and refracts as a specular (delta) lobe
    bool coat_delta;
    vec3 f_dielectric; // Fresnel reflectance at the viewer's angle: of the dielectric part …
    vec3 f_base;       // … and of its mixture with the metallic part
    bool total;        // total internal reflection at that angle
    float enters;      // energy left under the base, by the viewer's angle alone
    float under;       // energy left under the clear coat
    float left;        // energy left to the base under the lobes of extensions
    float through_share; // fraction of the diffuse light that diffuse transmission sends to the other side
    vec3 tint;         // colour of transmitted light
    float transmits;   // fraction of the entering light that is transmitted
    bool base_apart;   // what the base reflects is found by a ray or in the picture: evaluate_reflection leaves it out
    bool from_behind;  // light comes through this rough thin-walled surface: evaluate_reflection takes its mirrored direction
    vec4 shares;       // selection probabilities of coat, base, diffuse base layer, transmission for paths; their sum is 1, or 0
};

// A surface found anew: what follows from its directions, roughness and indices is computed in a turn of a loop over lights, or again
// after it, and takes no registers while shadow rays are traced.
Surface found_anew(Surface s, uint of_turn) {
    Surface r = s;
    r.n = found_anew(s.n, of_turn);
    r.v = found_anew(s.v, of_turn);
    r.metallic = found_anew(s.metallic, of_turn);
    r.f0_dielectric = found_anew(s.f0_dielectric, of_turn);
    r.f0_metal = found_anew(s.f0_metal, of_turn);
    r.ior = found_anew(s.ior, of_turn);
    r.lobe = found_anew(s.lobe, of_turn);
    r.alpha = found_anew(s.alpha, of_turn);
    r.alpha_along = found_anew(s.alpha_along, of_turn);
    r.film = found_anew(s.film, of_turn);
    r.clearcoat_alpha = found_anew(s.clearcoat_alpha, of_turn);
    r.sheen = found_anew(s.sheen, of_turn);
    return r;
}

// The layers in one turn of a loop over lights.
Layers in_turn(Layers b, uint of_turn) {
    b.s = found_anew(b.s, of_turn);
    b.n1 = found_anew(b.n1, of_turn);
    b.n2 = found_anew(b.n2, of_turn);
    b.cos_v = found_anew(b.cos_v, of_turn);
    return b;
}

// Fresnel reflectance of the base at an angle.
struct FacetFresnel {
    vec3 dielectric;
    vec3 base;  // of the mixture with the metallic part
    bool total; // total internal reflection
};

// F0 and F90 of a dielectric between two media, from those in air. What KHR_materials_specular makes of F0 in air applies here too. A
// body of index 1 reflects nothing in air: nothing is known to apply, and inside another medium it reflects like any other.
void between_media(inout vec3 f0, inout float f90, float ior, float n1, float n2) {
    float in_air = nested_f0(1.0, ior);
    float r0 = nested_f0(n1, n2);
    f90 = in_air > 0.0 ? f90 : (n1 == n2 ? 0.0 : 1.0);
    f0 = in_air > 0.0 ? f0 * (r0 / in_air) : vec3(r0);
}

FacetFresnel fresnel_below_coat(Layers b, float cos_in) {
    Surface s = b.s;
    FacetFresnel f;
    // The film first, as in fresnel_of_base.
    Film film;
    if (IRIDESCENCE) film = film_of(s, cos_in, b.n1);
    float share = b.between || FRESNEL == FRESNEL_EXACT ? boundary_share(cos_in, b.n1, b.n2) : schlick_weight(cos_in);
    vec3 f0 = s.f0_dielectric;
    float f90 = s.f90_dielectric;
    if (b.solid) between_media(f0, f90, s.ior, b.n1, b.n2);
    f.total = b.solid && share >= 1.0;
    f.dielectric = f0 + (vec3(f90) - f0) * share;
    if (IRIDESCENCE) {
        // Of a closed dielectric mesh f0_dielectric is that in air.
        float r0 = nested_f0(b.solid ? 1.0 : b.n1, s.ior);
        f.dielectric = under_film(s, film, f.dielectric, b.n2, r0);
    }
    f.dielectric = f.total ? vec3(1.0) : f.dielectric;
    vec3 metal = fresnel_of_metal(s, cos_in);
    if (IRIDESCENCE) metal = metal_under_film(s, film, metal);
    f.base = blend(f.dielectric, metal, s.metallic);
    return f;
}

// Of the light that scatters into all directions, the fraction that diffuse transmission sends to the other side.
float diffuse_through_share(Surface s) {
    float through = mean(s.diffuse_through);
    float reflected = mean(s.diffuse);
    if (SHEEN) reflected += mean(s.sheen.rgb) * sheen_albedo(s, max(cosine(s.n, s.v), 1e-4)).x;
    return DIFFUSE_TRANSMISSION && through > 0.0 ? through / (reflected + through) : 0.0;
}

// The directional albedos of a surface's layers; its `lobe` is known.
struct LayerAlbedo {
    BaseAlbedo base;
    float coat;       // 0 without a coat
    float under_coat; // energy left under the coat: by its albedo for `ggx-multi`, else at the viewer's angle; 1 without one
};

LayerAlbedo layer_albedo(Surface s, BaseAlbedo base) {
    LayerAlbedo r = LayerAlbedo(base, 0.0, 1.0);
    if (CLEARCOAT) {
        r.coat = albedo_of_coat(s);
        r.under_coat = BRDF == BRDF_GGX_MULTI ? 1.0 - min(r.coat, 1.0) : under_coat(s);
    }
    return r;
}

// The layers of a surface whose base is a rough lobe for every roughness: for lighting by punctual lights and by the
// prefiltered environment.
Layers layers_of(Surface s, LayerAlbedo albedo) {
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
    b.enters = BRDF == BRDF_GGX_MULTI ? ground_share(albedo.base) : 1.0;
    b.under = BRDF == BRDF_GGX_MULTI ? albedo.under_coat : 1.0;
    b.left = left_to_base(s);
    b.through_share = diffuse_through_share(s);
    b.tint = vec3(0.0);
    b.transmits = 0.0;
    b.base_apart = false;
    b.from_behind = false;
    b.shares = vec4(0.0);
    return b;
}

// Albedo of the diffuse base layer and of sheen, in a uniform environment.
float scattered_share(Layers b) {
    float ground = mean(b.s.diffuse) * b.enters * b.left;
    if (DIFFUSE_TRANSMISSION) ground += mean(b.s.diffuse_through) * b.enters * b.left;
    return SHEEN ? ground + mean(b.s.sheen.rgb) * sheen_albedo(b.s, b.cos_v).x : ground;
}

// Whether light from the other side reaches the viewer by diffuse transmission.
bool shines_through(Layers b) {
    return DIFFUSE_TRANSMISSION && largest(b.s.diffuse_through) > 0.0;
}

// Transmittance of a surface that does not deflect light: the colour of what it transmits, and what of the light enters.
vec3 straight_transmittance(vec3 tint, float transmits, vec3 f_dielectric, float under, float left) {
    return tint * (transmits * (1.0 - largest(f_dielectric)) * under * left);
}

vec3 straight_transmittance(Layers b) {
    return straight_transmittance(b.tint, b.transmits, b.f_dielectric, b.under, b.left);
}

struct BaseLobe {
    float value; // D times G₂/(4 cosθ_l cosθ_v)
    float pdf;   // density of directions reflected at half vectors of the VNDF
};

BaseLobe base_lobe(Layers b, vec3 l, float cos_l, HalfAngle h) {
    Surface s = b.s;
    BaseLobe r;
    float d = ggx_distribution(h.cos_h, h.sin2_h, s.alpha);
    r.value = d * ggx_visibility(cos_l, b.cos_v, s.alpha);
    r.pdf = mirrored_pdf(b.cos_v, h, s.alpha);
    if (ANISOTROPY) {
        vec3 from = in_lobe_frame(s, s.v);
        vec3 to = in_lobe_frame(s, l);
        vec2 alphas = base_alphas(s);
        float d_along = anisotropic_distribution(h.cos_h, h.sin2_h, share_along(from + to), alphas);
        float vis = anisotropic_visibility(vec3(to.xy, cos_l), vec3(from.xy, b.cos_v), alphas);
        float g1 = 2.0 * b.cos_v / (b.cos_v + anisotropic_root(vec3(from.xy, b.cos_v), alphas));
        if (is_anisotropic(s)) r = BaseLobe(d_along * vis, g1 * d_along / (4.0 * b.cos_v));
    }
    return r;
}

// What a thin-walled surface transmits of the light that enters it, where it is rough: a light behind it is seen through it.
// 0 of smooth surfaces, through which no ray meets a punctual light, and of others.
vec3 passes_roughly(Surface s, bool sheet, vec3 tint, float transmits) {
    bool rough = s.roughness > MIN_ROUGHNESS || is_anisotropic(s);
    return ROUGH_TRANSMISSION && sheet && rough ? tint * (transmits * (1.0 - s.metallic)) : vec3(0.0);
}

// For light from behind a rough thin-walled surface, which scatters as its mirror image does to the other side: what reflects
// light sends nothing.
Layers seen_through(Layers b) {
    b.from_behind = true;
    b.s.diffuse = vec3(0.0);
    b.s.sheen.rgb = vec3(0.0);
    return b;
}

bool passes_light_from(Surface s, vec3 l) {
    return ROUGH_TRANSMISSION && largest(s.passes) > 0.0 && dot(s.n, l) < 0.0;
}

// --------------------------------------------------------------------------------------------------------------------
// Evaluate

struct BsdfEval {
    vec3 f_cos; // BSDF times |cosθ|, of all lobes but the delta ones
    float pdf;  // density with which these lobes are sampled, per solid angle
};

// For light from the unit direction l on the viewer's side (lecture B2): radiance sent to the viewer per irradiance
// perpendicular to l.
BsdfEval evaluate_reflection(Layers b, vec3 l) {
    Surface s = b.s;
    BsdfEval r = BsdfEval(vec3(0.0), 0.0);
    float cos_l = cosine(s.n, l);
    const bool phong = BRDF == BRDF_BLINN_PHONG || BRDF == BRDF_BLINN_PHONG_RECIPROCAL;
    DirectionSum sum = sum_of_directions(l, s.v);
    // Self-shadowing (lecture B9).
    if (cos_l > 0.0) {
        float enters = b.enters;
        vec3 lobe = vec3(0.0);       // the part of the BRDF that is multiplied by cosθ_l
        vec3 lobe_alone = vec3(0.0); // the part that is not
        HalfAngle h = half_angle(s.n, sum);
        if (!b.delta) {
            // Transmission has no Phong lobe.
            bool by_phong = phong && !b.from_behind;
            if (by_phong) h = phong_half_angle(s.n, l, s.v, h);
            BaseLobe base = base_lobe(b, l, cos_l, h);
            if (by_phong) {
                // k_s makes the albedo of B6's lobe at normal incidence F0 in the limit of a narrow lobe only (shininess →
                // ∞). It is 0.31 F0 for a shininess of 0, 0.41 F0 for 1, 0.81 F0 for 10 and 0.98 F0 for 100 (numerics.md
                // S13).
                float shine = shine_from_alpha(s.alpha);
                vec3 ks = f0_of(s) * ((shine + 2.0) * 0.5 * INV_PI);
                float cosine_power = phong_lobe(h, shine);
                // The bound of B6, k_d π + k_s 2π/(shine + 2) ≤ 1; B5 has no bound.
                enters = BRDF == BRDF_BLINN_PHONG ? 1.0 : 1.0 - largest(s.f0_dielectric);
                if (BRDF == BRDF_BLINN_PHONG) lobe_alone = ks * (cosine_power * 0.25);
                else lobe = ks * reciprocal_lobe(h, cosine_power);
            } else {
                // Light reflected at the dielectric interface does not reach the diffuse base layer. The largest component
                // counts, so that a tinted F0 gives no complementary colour (KHR_materials_specular).
                FacetFresnel f = fresnel_below_coat(b, h.cos_d);
                if (BRDF == BRDF_GGX) enters = 1.0 - largest(f.dielectric);
                lobe = b.from_behind ? s.passes * ((1.0 - largest(f.dielectric)) * base.value) : f.base * compensation(s) * base.value;
            }
            r.pdf += b.shares.y * base.pdf;
        }
        r.f_cos = (s.diffuse * diffuse_brdf(enters) + (b.base_apart ? vec3(0.0) : lobe)) * cos_l;
        if (BRDF == BRDF_BLINN_PHONG && !b.base_apart) r.f_cos += lobe_alone;
        // For light from l to the eye, sheen leaves the smaller of its values for both directions (KHR_materials_sheen).
        if (SHEEN) r.f_cos = r.f_cos * min(b.left, left_by_sheen(s, cos_l)) + sheen_lobe(s, h.sin2_h, cos_l, b.cos_v);
        r.pdf += b.shares.z * (1.0 - b.through_share) * cos_l * INV_PI;
    }
    if (CLEARCOAT) {
        if (b.coat_delta) {
            r.f_cos *= b.under;
        } else {
#ifndef ONE_KERNEL
            // Not the halves of directions that the base's compensated products needed: they would be kept until here. For the
            // kernels of CPUs, which would change nothing, glslang needs more than 3 GB with these lines.
            uint base_known = floatBitsToUint(abs(r.f_cos.x));
            l = found_anew(l, base_known);
            s.v = found_anew(s.v, base_known);
            sum.hi = found_anew(sum.hi, base_known);
#endif
            HalfAngle h = half_angle(s.n_coat, sum);
            float f = fresnel_of_coat(s, h.cos_d);
            float coat_l = max(cosine(s.n_coat, l), 0.0);
            float coat_v = max(cosine(s.n_coat, s.v), 1e-4);
            float d = ggx_distribution(h.cos_h, h.sin2_h, s.clearcoat_alpha);
            float vis = ggx_visibility(coat_l, coat_v, s.clearcoat_alpha);
            // Selected, not multiplied by 0: the textbook form of `vis` is NaN at the horizon.
            float lobe = coat_l > 0.0 && !b.from_behind ? d * vis * coat_l : 0.0;
            r.f_cos = r.f_cos * (BRDF == BRDF_GGX_MULTI ? b.under : 1.0 - f) + f * lobe;
            r.pdf += coat_l > 0.0 ? b.shares.x * mirrored_pdf(coat_v, h, s.clearcoat_alpha) : 0.0;
        }
    }
    return r;
}

// Diffuse transmission, for light from the unit direction l on the other side (KHR_materials_diffuse_transmission): the
// light enters as it does from the mirrored direction, and leaves in all directions.
BsdfEval evaluate_diffuse_transmission(Layers b, vec3 l) {
    Surface s = b.s;
    float cos_l = -cosine(s.n, l);
    vec3 mirrored = l + 2.0 * cos_l * s.n;
    float cos_d = 0.5 * length(mirrored + s.v);
    float enters = b.enters;
    if (BRDF == BRDF_GGX && !b.delta) {
        enters = 1.0 - largest(fresnel_below_coat(b, cos_d).dielectric);
    }
    if (BRDF == BRDF_BLINN_PHONG) enters = 1.0;
    if (BRDF == BRDF_BLINN_PHONG_RECIPROCAL) enters = 1.0 - largest(s.f0_dielectric);
    float left = b.left;
    if (SHEEN) left = min(left, left_by_sheen(s, max(cos_l, 1e-4)));
    float under = 1.0;
    if (CLEARCOAT) {
        bool by_albedo = BRDF == BRDF_GGX_MULTI || b.coat_delta;
        under = by_albedo ? b.under : 1.0 - fresnel_of_coat(s, cos_d);
    }
    vec3 f_cos = s.diffuse_through * (diffuse_brdf(enters) * max(cos_l, 0.0) * left * under);
    float pdf = b.shares.z * b.through_share * max(cos_l, 0.0) * INV_PI;
    return BsdfEval(f_cos, pdf);
}

// Rough transmission, for light from behind a rough surface: the rough BTDF (Walter et al. 2007). A thin-walled surface
// scatters as its mirror image does, to the other side. Between two media the half vector that refracts v into l is along
// n₁v + n₂l, and dω_h = n₂² |l·h| / (n₁ v·h + n₂ l·h)² dω_l. Radiance is divided by the square of the index here, so the
// BSDF has no factor n₁²/n₂²: BSDF times |cosθ| is transmittance times density.
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
    float pdf = base_visible_normals(s, b.cos_v, h) * v_h / b.cos_v * stretch;
    float share = b.transmits * (1.0 - largest(fresnel_below_coat(b, v_h).dielectric)) * base_g2_over_g1(s, s.v, l);
    float under = (CLEARCOAT ? b.under : 1.0) * b.left;
    return meets_facet ? BsdfEval(b.tint * (share * pdf * under), b.shares.w * pdf) : BsdfEval(vec3(0.0), 0.0);
}

// --------------------------------------------------------------------------------------------------------------------
// Sample: one lobe at a time

struct LobeSample {
    vec3 direction;
    vec3 weight;   // BSDF times |cosθ| over density, of this lobe without the coat above it; 0: no light
    bool straight; // the direction is not deflected
};

// Smith's G₂/G₁ for r, reflected at a half vector of the VNDF; 0 below the surface or its triangle.
float unshadowed(vec3 n, vec3 v, vec3 r, vec3 n_triangle, float alpha) {
    float cos_r = dot(r, n);
    return dot(r, n_triangle) > 0.0 && cos_r > 0.0 ? smith_g2_over_g1(dot(n, v), cos_r, alpha) : 0.0;
}

// The same for the base's lobe.
float unshadowed_base(Surface s, vec3 r) {
    return dot(r, s.n_triangle) > 0.0 && dot(r, s.n) > 0.0 ? base_g2_over_g1(s, s.v, r) : 0.0;
}

// The half vector of an event, sampled from the VNDF of the coat's or of the base's lobe; the normal for a delta lobe.
vec3 event_half_vector(Layers b, bool coat, vec2 u) {
    vec3 n = coat ? b.s.n_coat : b.s.n;
    bool delta = coat ? b.coat_delta : b.delta;
    vec3 h = ROUGH && !delta ? half_vector(n, b.s.v, coat ? b.s.clearcoat_alpha : b.s.alpha, u) : n;
    if (ANISOTROPY && ROUGH) {
        if (!coat && is_anisotropic(b.s)) h = anisotropic_half_vector(b.s, base_alphas(b.s), u);
    }
    return h;
}

// Direction of transmitted light; r is the reflected direction. Equal indices refract nothing, not even by a rounding. A
// thin-walled surface scatters as its mirror image does, to the other side. `tir`: total internal reflection.
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

// Whether transmitted light is not deflected.
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

// Fresnel reflectance at a microfacet.
FacetFresnel fresnel_at_facet(Layers b, vec3 h) {
    return fresnel_below_coat(b, clamp(dot(h, b.s.v), 0.0, 1.0));
}

LobeSample sample_base(Layers b, vec3 h, FacetFresnel f) {
    Surface s = b.s;
    vec3 r = reflect_ray(-s.v, h).R;
    float masking = ROUGH && !b.delta ? unshadowed_base(s, r) : 1.0;
    return LobeSample(b.delta ? on_side(r, s.n_triangle) : r, f.base * compensation(s) * (masking * b.left), false);
}

LobeSample sample_transmission(Layers b, vec3 h, FacetFresnel f) {
    Surface s = b.s;
    bool rough = ROUGH && !b.delta;
    vec3 r = reflect_ray(-s.v, h).R;
    bool tir;
    vec3 through = through_direction(b, h, r, tir);
    bool straight = passes_straight(b);
    bool passes = straight || (dot(through, s.n_triangle) < 0.0 && !(b.solid && (f.total || tir)));
    float masking = rough ? base_g2_over_g1(s, s.v, through) : 1.0;
    if (rough && b.sheet) masking = dot(r, s.n) > 0.0 ? masking : 0.0;
    vec3 weight = b.tint * (b.transmits * (1.0 - largest(f.dielectric)) * masking * b.left);
    return LobeSample(through, passes ? weight : vec3(0.0), straight);
}
#endif
