// A surface point as the lighting sees it, and its reflected radiance.
#ifndef SURFACE_GLSL
#define SURFACE_GLSL
#include "lib/brdf.glsl"
#include "lib/fresnel.glsl"
#include "lib/material.glsl"
#include "lib/spectrum.glsl"

// The knobs `brdf` and `fresnel` (src/plan/knobs.rs): one formula each, chosen when the pipeline is made.
layout(constant) const uint BRDF = 2;    // 0 blinn-phong, 1 blinn-phong-reciprocal, 2 ggx, 3 ggx-multi
layout(constant) const uint FRESNEL = 0; // 0 schlick, 1 exact
layout(constant) const bool CLEARCOAT = false;
layout(constant) const bool ROUGH = false; // some surface that rays meet is rough
layout(constant) const bool CONDUCTORS = false; // some metal is given by its n and κ
// Smooth enough surfaces are mirrored by rays, rougher ones by the prefiltered environment (knobs `reflection`, `lobes`).
layout(constant) const bool MIRROR_RAYS = false;
layout(constant) const float ROUGHEST_MIRROR = 0.0;

struct Surface {
    vec3 p_rel;
    vec3 n;              // shading normal
    vec3 n_coat;         // shading normal of the clear coat
    vec3 v;              // to the viewer
    vec3 diffuse;        // albedo of the diffuse part
    float metallic;
    vec3 f0_dielectric;
    float f90_dielectric;
    vec3 f0;             // of the mixture of dielectric and metal
    float f90;
    float ior;           // of the dielectric part
    vec3 compensation;   // of light lost to single scattering: 1 but for `ggx-multi`
    float alpha;         // roughness²
    float roughness;
    float occlusion;
    vec3 emissive;
    float clearcoat;
    float clearcoat_alpha;
    float clearcoat_roughness;
    bool unlit;
    vec3 base;
    vec3 n_metal;        // index and extinction of a metal per channel; index 0 where a colour is all that is known
    vec3 kappa_metal;
    bool base_traced;    // mirrored by rays, not by the prefiltered environment
    bool coat_traced;
    vec3 p_bvh;          // the same point where rays live (share/trace.glsl)
    vec3 n_triangle;     // geometric normal, to the viewer
    uint face;           // the flat face it lies in, which rays from it cannot meet
    uvec4 media;         // those the viewer's side lies in (lib/media.glsl)
};

// Roughness below this is a mirror to 16-bit normals; the lobe stays finite (numerics.md 20 holds from α = 1e-5).
const float MIN_ROUGHNESS = 0.01;

// Base colour, where texels and vertices say `varies`; in a band of wavelengths a number, and light of what is unlit.
vec3 base_from_texel(Material m, vec3 varies) {
    vec3 base = varies * m.base_color.rgb;
    if (SPECTRAL) {
        if ((m.flags & MATERIAL_UNLIT) != 0) {
            base = light_of_rgb(base);
        } else if ((m.flags & (MATERIAL_BASE_RGB | MATERIAL_VARIES_RGB)) != 0) {
            bool number = (m.flags & MATERIAL_VARIES_RGB) != 0;
            vec3 found = reflectance_of_rgb(number ? varies : base);
            base = number ? found * m.base_color.rgb : found;
        }
    }
    return base;
}

Surface surface_from_texels(Material m, vec3 base, float metallic, float roughness, float occlusion, vec3 emissive,
                            vec3 layers, vec3 n, vec3 n_coat, vec3 v, vec3 p_rel) {
    Surface s;
    s.p_rel = p_rel;
    s.v = v;
    s.n = n;
    s.n_coat = n_coat;
    s.unlit = (m.flags & MATERIAL_UNLIT) != 0;
    s.base = base_from_texel(m, base);
    float metal = metallic * m.metallic;
    s.diffuse = s.base * (1.0 - metal);
    s.metallic = metal;
    s.f0_dielectric = m.f0 * layers.z;
    s.f90_dielectric = m.f90 * layers.z;
    s.n_metal = vec3(0.0);
    s.kappa_metal = vec3(0.0);
    if (CONDUCTORS) {
        if ((m.flags & MATERIAL_CONDUCTOR) != 0) {
            s.n_metal = m.n_metal;
            s.kappa_metal = m.kappa_metal;
        }
    }
    s.f0 = mix(s.f0_dielectric, s.base, metal);
    s.f90 = mix(s.f90_dielectric, 1.0, metal);
    s.ior = m.ior;
    s.compensation = vec3(1.0);
    s.roughness = max(roughness * m.roughness, MIN_ROUGHNESS);
    s.alpha = s.roughness * s.roughness;
    s.occlusion = 1.0 + m.occlusion_strength * (occlusion - 1.0);
    s.emissive = emissive * m.emissive;
    if (SPECTRAL && (m.flags & MATERIAL_EMISSIVE_RGB) != 0) s.emissive = light_of_rgb(s.emissive);
    s.clearcoat = layers.x * m.clearcoat;
    s.clearcoat_roughness = max(layers.y * m.clearcoat_roughness, MIN_ROUGHNESS);
    s.clearcoat_alpha = s.clearcoat_roughness * s.clearcoat_roughness;
    s.base_traced = MIRROR_RAYS && s.roughness <= ROUGHEST_MIRROR;
    s.coat_traced = MIRROR_RAYS && s.clearcoat_roughness <= ROUGHEST_MIRROR;
    s.p_bvh = p_rel;
    s.n_triangle = n;
    s.face = 0xffffffffu;
    s.media = uvec4(0);
    return s;
}

// Reflectance of the dielectric part.
vec3 fresnel_of_dielectric(Surface s, float cos_in) {
    if (FRESNEL == 0) return schlick(s.f0_dielectric, s.f90_dielectric, cos_in);
    // F0 may be tinted by KHR_materials_specular, so the exact curve is carried over as its share between F0 and 1.
    float r0 = nested_f0(1.0, s.ior);
    float share = clamp((fresnel_dielectric(cos_in, s.ior).F - r0) / max(1.0 - r0, 1e-6), 0.0, 1.0);
    return s.f0_dielectric + (vec3(s.f90_dielectric) - s.f0_dielectric) * share;
}

// Reflectance of the metallic part. Metals given by a colour alone have no n and κ: Schlick on every rung. Of those that
// have them the colour is F0, and what a texture does to it tints the exact curve.
vec3 fresnel_of_metal(Surface s, float cos_in) {
    vec3 f = schlick(s.base, 1.0, cos_in);
    if (CONDUCTORS && FRESNEL == 1) {
        if (s.n_metal.x > 0.0) {
            vec3 tint = s.base / normal_reflectance(s.n_metal, s.kappa_metal);
            f = tint * vec3(fresnel_conductor(cos_in, s.n_metal.r, s.kappa_metal.r).F,
                            fresnel_conductor(cos_in, s.n_metal.g, s.kappa_metal.g).F,
                            fresnel_conductor(cos_in, s.n_metal.b, s.kappa_metal.b).F);
        }
    }
    return f;
}

// Reflectance of the mixture.
vec3 fresnel(Surface s, float cos_in) {
    return mix(fresnel_of_dielectric(s, cos_in), fresnel_of_metal(s, cos_in), s.metallic);
}

// Reflectance of the boundary from n1 to n2 as its share between that at normal and that at grazing incidence: 1 where the
// reflection is total, 0 where the indices are equal: Schlick's curve rises at grazing incidence whatever they are.
float boundary_share(float cos_in, float n1, float n2) {
    if (n1 == n2) return 0.0;
    if (FRESNEL == 1) {
        float r0 = nested_f0(n1, n2);
        return clamp((fresnel_dielectric(cos_in, n2 / n1).F - r0) / max(1.0 - r0, 1e-6), 0.0, 1.0);
    }
    float sin2 = max(1.0 - cos_in * cos_in, 0.0) * (n1 / n2) * (n1 / n2);
    float cos_thin = n1 > n2 ? sqrt(max(1.0 - sin2, 0.0)) : cos_in;
    return n1 > n2 && sin2 >= 1.0 ? 1.0 : schlick(vec3(0.0), 1.0, cos_thin).x;
}

float largest(vec3 v) {
    return max(v.x, max(v.y, v.z));
}

// BRDF times cosθ_l for light from the unit direction l (lecture B2): what irradiance perpendicular to l becomes.
vec3 reflected(Surface s, vec3 l) {
    float cos_l = cosine(s.n, l);
    float cos_v = max(cosine(s.n, s.v), 1e-4);
    HalfAngle h = BRDF <= 1 ? phong_half_angle(s.n, l, s.v) : half_angle(s.n, l, s.v);
    vec3 result = vec3(0.0);
    // Self-shadow (lecture B9).
    if (cos_l > 0.0) {
        if (BRDF <= 1) {
            float shine = shine_from_alpha(s.alpha);
            float lobe = phong_lobe(h, shine);
            // k_s such that the lobe of B6 reflects F0 of the light at normal incidence in the limit of a narrow lobe: 0.31 F0 for
            // a shine of 0, 0.41 for 1, 0.81 for 10, 0.98 for 100 (numerics.md S13).
            vec3 ks = s.f0 * ((shine + 2.0) * 0.5 * INV_PI);
            if (BRDF == 0) {
                // B5: the lobe is not multiplied by cosθ_l.
                result = s.diffuse * diffuse_brdf(1.0) * cos_l + ks * (lobe * 0.25);
            } else {
                result = (s.diffuse * diffuse_brdf(1.0) + ks * reciprocal_lobe(h, lobe)) * cos_l;
            }
        } else {
            // What the dielectric's surface reflects does not reach its diffuse ground; its largest component, so that
            // a tinted F0 gives no complementary colour (KHR_materials_specular).
            vec3 f_dielectric = fresnel_of_dielectric(s, h.cos_d);
            float enters = 1.0 - largest(f_dielectric);
            vec3 f = mix(f_dielectric, fresnel_of_metal(s, h.cos_d), s.metallic);
            float d = ggx_distribution(h.cos_h, h.sin2_h, s.alpha);
            float vis = ggx_visibility(cos_l, cos_v, s.alpha);
            result = (s.diffuse * diffuse_brdf(enters) + f * s.compensation * (d * vis)) * cos_l;
        }
    }
    if (CLEARCOAT) {
        HalfAngle coat = half_angle(s.n_coat, l, s.v);
        float f = s.clearcoat * schlick(vec3(0.04), 1.0, coat.cos_d).x;
        float coat_l = max(cosine(s.n_coat, l), 0.0);
        float d = ggx_distribution(coat.cos_h, coat.sin2_h, s.clearcoat_alpha);
        float vis = ggx_visibility(coat_l, max(cosine(s.n_coat, s.v), 1e-4), s.clearcoat_alpha);
        // Selected, not multiplied by 0: the textbook form of `vis` is no number at the horizon.
        float lobe = coat_l > 0.0 ? d * vis * coat_l : 0.0;
        result = result * (1.0 - f) + f * lobe;
    }
    return result;
}

// What the clear coat lets through to the eye.
float under_coat(Surface s) {
    return 1.0 - s.clearcoat * schlick(vec3(0.04), 1.0, clamp(dot(s.n_coat, s.v), 0.0, 1.0)).x;
}
#endif
