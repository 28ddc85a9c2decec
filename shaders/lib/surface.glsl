// A surface point as lighting sees it: geometry, and parameters from the material, its textures and the vertices.
// Where to read: glTF 2.0, section 3.9 and appendix B; pbrt 4, chapter 9. Assumes: unit vectors in world axes, reflectances
// in [0, 1].
#ifndef SURFACE_GLSL
#define SURFACE_GLSL
#include "lib/fresnel.glsl"
#include "lib/material.glsl"
#include "lib/spectrum.glsl"
#include "lib/texels.glsl"
#include "share/layers.glsl"

// The knobs `brdf` and `fresnel` (src/plan/knobs/rungs.rs): specialization selects one formula of each.
layout(constant) const uint BRDF = 2;
const uint BRDF_BLINN_PHONG = 0;
const uint BRDF_BLINN_PHONG_RECIPROCAL = 1;
const uint BRDF_GGX = 2;
const uint BRDF_GGX_MULTI = 3;
layout(constant) const uint FRESNEL = 0;
const uint FRESNEL_SCHLICK = 0;
const uint FRESNEL_EXACT = 1;
layout(constant) const bool CLEARCOAT = false;
layout(constant) const bool ROUGH = false; // some surface that rays hit is rough
layout(constant) const bool CONDUCTORS = false; // some metal is a conductor with n and κ
layout(constant) const bool SPECULAR_COLORS = false; // some texture gives the colour of F0
layout(constant) const uint LOBES_SEEN = 0;     // bit by LOBE_...: some material has that lobe
// Surfaces up to this roughness are reflected by rays, rougher ones by the prefiltered environment (knobs `reflection`,
// `lobes`).
layout(constant) const bool MIRROR_RAYS = false;
layout(constant) const float ROUGHEST_MIRROR = 0.0;

const bool SHEEN = (LOBES_SEEN & (1u << LOBE_SHEEN)) != 0;
// The lobes of Blinn-Phong are round.
const bool ANISOTROPY = (LOBES_SEEN & (1u << LOBE_ANISOTROPY)) != 0 && BRDF >= BRDF_GGX;
const bool IRIDESCENCE = (LOBES_SEEN & (1u << LOBE_IRIDESCENCE)) != 0;
const bool DIFFUSE_TRANSMISSION = (LOBES_SEEN & (1u << LOBE_DIFFUSE_TRANSMISSION)) != 0;

struct Surface {
    vec3 p_rel;
    vec3 n;              // shading normal
    vec3 n_coat;         // shading normal of the clear coat
    vec3 v;              // unit vector to the viewer
    vec3 diffuse;        // albedo of the diffuse base layer
    vec3 diffuse_through; // albedo of diffuse transmission
    vec3 passes;         // share of the light that enters a rough thin-walled surface which leaves on the other side (lib/layers.glsl)
    float metallic;
    vec3 f0_dielectric;
    float f90_dielectric;
    float ior;           // of the dielectric part
    float n_outside;     // index of the medium on the viewer's side
    vec2 lobe;           // factors of F0 and F90 in the directional albedo of the base's lobe; 1 and 0 until it is looked up
    float alpha;         // roughness²; with anisotropy α across `tangent`
    float alpha_along;   // α along `tangent`: `alpha` without anisotropy
    vec3 tangent;        // unit direction of anisotropy, perpendicular to n
    vec3 film;           // iridescence: factor, index of the film, its thickness in nm (lib/thin_film.glsl)
    float roughness;
    float occlusion;
    vec3 emissive;
    float clearcoat;
    float clearcoat_alpha;
    float clearcoat_roughness;
    vec4 sheen;          // colour, roughness (lib/sheen.glsl)
    bool unlit;
    vec3 base;
    vec3 f0_metal;
    vec3 n_metal;        // index n and extinction κ of a conductor per channel; n = 0 for a metal given by its colour
    vec3 kappa_metal;
    vec3 metal_tint;     // of conductors: the colour over the reflectance at normal incidence
    bool base_traced;    // reflected by rays, not by the prefiltered environment
    bool coat_traced;
    vec3 p_bvh;          // the same point in bvh space (share/trace.glsl)
    vec3 n_triangle;     // geometric normal, on the viewer's side
    uint face;           // coplanar group of its triangle, which rays from it cannot hit
    uvec4 media;         // the media on the viewer's side (lib/media.glsl)
};

// F0 and F90 of the mixture of dielectric and metallic part.
vec3 f0_of(Surface s) {
    return blend(s.f0_dielectric, s.f0_metal, s.metallic);
}

float f90_of(Surface s) {
    return blend(s.f90_dielectric, 1.0, s.metallic);
}

// Base colour; `varies` is the product of texel and vertex colour. In a band of wavelengths it is a number, and for unlit
// materials light.
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

// A colour of a lobe. In a band of wavelengths the factor is a number, but the texel is still a colour.
vec3 lobe_color(vec3 factor, vec3 texel) {
    vec3 color = texel * factor;
    if (SPECTRAL && texel != vec3(1.0)) color = factor * reflectance_of_rgb(texel);
    return color;
}

// Factors of lobe number `lobe` of a material (crates/scene/src/lobe/).
vec4 lobe_factors(uint id, uint lobe) {
    return material_texel(id, MATERIAL_LOBES_AT + int(lobe));
}

// The surface of material m, whose number in the table is `id`.
Surface surface_from_texels(uint id, Material m, Texels t, vec3 n, vec3 n_coat, vec3 v, vec3 p_rel) {
    Surface s;
    s.p_rel = p_rel;
    s.v = v;
    s.n = n;
    s.n_coat = n_coat;
    s.unlit = (m.flags & MATERIAL_UNLIT) != 0;
    s.base = base_from_texel(m, t.base.rgb);
    float metal = t.metallic * m.metallic;
    s.diffuse = s.base * (1.0 - metal);
    s.diffuse_through = vec3(0.0);
    s.passes = vec3(0.0);
    if (DIFFUSE_TRANSMISSION) {
        vec4 factors = lobe_factors(id, LOBE_DIFFUSE_TRANSMISSION);
        float through = factors.x * t.diffuse_transmission.a;
        s.diffuse_through = lobe_color(factors.yzw, t.diffuse_transmission.rgb) * (through * (1.0 - metal));
        s.diffuse *= 1.0 - through;
    }
    s.metallic = metal;
    s.f0_dielectric = m.f0 * t.specular;
    if (SPECULAR_COLORS) {
        // min(r² · factor · texel, 1) · specular, where F90 is the material's specular. Blinn and Phong's lobe has no such bound.
        vec3 f0 = lobe_color(m.f0, t.specular_color);
        s.f0_dielectric = (BRDF == BRDF_BLINN_PHONG ? f0 : min(f0, vec3(m.f90))) * t.specular;
    }
    s.f90_dielectric = m.f90 * t.specular;
    s.f0_metal = s.base;
    s.n_metal = vec3(0.0);
    s.kappa_metal = vec3(0.0);
    s.metal_tint = vec3(1.0);
    if (CONDUCTORS) {
        if ((m.flags & MATERIAL_CONDUCTOR) != 0) {
            s.n_metal = m.n_metal;
            s.kappa_metal = m.kappa_metal;
            s.metal_tint = s.f0_metal / normal_reflectance(s.n_metal, s.kappa_metal);
        }
    }
    s.ior = m.ior;
    s.n_outside = 1.0;
    s.lobe = vec2(1.0, 0.0);
    s.roughness = max(t.roughness * m.roughness, MIN_ROUGHNESS);
    s.alpha = s.roughness * s.roughness;
    s.alpha_along = s.alpha;
    s.tangent = t.tangent;
    if (ANISOTROPY) {
        float strength = lobe_factors(id, LOBE_ANISOTROPY).x * t.anisotropy;
        s.alpha_along += (1.0 - s.alpha) * (strength * strength);
        if (strength > 0.0) s.tangent = normalize(t.tangent - n * dot(n, t.tangent));
    }
    s.film = vec3(0.0);
    if (IRIDESCENCE) {
        vec4 factors = lobe_factors(id, LOBE_IRIDESCENCE);
        s.film = vec3(factors.x * t.iridescence.x, factors.y, factors.z + (factors.w - factors.z) * t.iridescence.y);
    }
    s.occlusion = 1.0 + m.occlusion_strength * (t.occlusion - 1.0);
    s.emissive = t.emissive * m.emissive;
    if (SPECTRAL && (m.flags & MATERIAL_EMISSIVE_RGB) != 0) s.emissive = light_of_rgb(s.emissive);
    s.clearcoat = t.clearcoat * m.clearcoat;
    s.clearcoat_roughness = max(t.clearcoat_roughness * m.clearcoat_roughness, MIN_ROUGHNESS);
    s.clearcoat_alpha = s.clearcoat_roughness * s.clearcoat_roughness;
    s.sheen = vec4(0.0);
    if (SHEEN) {
        vec4 factors = lobe_factors(id, LOBE_SHEEN);
        s.sheen = vec4(lobe_color(factors.rgb, t.sheen.rgb), t.sheen.a * factors.a);
    }
    // Of an anisotropic lobe its wide direction counts.
    float widest = s.alpha_along != s.alpha ? sqrt(s.alpha_along) : s.roughness;
    s.base_traced = MIRROR_RAYS && widest <= ROUGHEST_MIRROR;
    s.coat_traced = MIRROR_RAYS && s.clearcoat_roughness <= ROUGHEST_MIRROR;
    s.p_bvh = p_rel;
    s.n_triangle = n;
    s.face = 0xffffffffu;
    s.media = uvec4(0);
    return s;
}

// Leaves a fraction of the light that enters the surface to its diffuse base layer: the rest is transmitted.
void keep_diffuse(inout Surface s, float fraction) {
    s.diffuse *= fraction;
    if (DIFFUSE_TRANSMISSION) s.diffuse_through *= fraction;
}

// The same surface in a medium of index n_outside on the viewer's side: reflectance depends on relative indices. A metal
// given by a colour alone has no index and keeps its reflectance.
//
// If the index does not change, every value is selected unchanged: on some devices a quotient of equal numbers is not 1,
// but both plans of a scene have to agree.
void seen_from(inout Surface s, float n_outside) {
    // New names for what is known: glslang needs more than 24 GB where members of s are selected from themselves
    // (lib/arithmetic.glsl).
    vec3 dielectric = s.f0_dielectric;
    vec3 metal = s.f0_metal;
    bool changes = n_outside != s.n_outside;
    float before = nested_f0(s.n_outside, s.ior);
    float r0 = nested_f0(n_outside, s.ior);
    // As for the interfaces of bodies (between_media).
    bool unknown = changes && before == 0.0;
    s.f0_dielectric = unknown ? vec3(r0) : changes ? dielectric * (r0 / before) : dielectric;
    // Between equal indices nothing is reflected at any angle.
    s.f90_dielectric = n_outside == s.ior ? 0.0 : unknown ? 1.0 : s.f90_dielectric;
    if (CONDUCTORS) {
        bool relative = changes && s.n_metal.x > 0.0;
        float ratio = relative ? s.n_outside / n_outside : 1.0;
        vec3 n = s.n_metal * ratio;
        vec3 kappa = s.kappa_metal * ratio;
        vec3 reflectance = normal_reflectance(n, kappa);
        s.f0_metal = relative ? s.metal_tint * reflectance : metal;
        s.n_metal = n;
        s.kappa_metal = kappa;
    }
    s.n_outside = n_outside;
}

float largest(vec3 v) {
    return max(v.x, max(v.y, v.z));
}

float mean(vec3 v) {
    return (v.x + v.y + v.z) * (1.0 / 3.0);
}
#endif
