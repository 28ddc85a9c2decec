// Tables that describe the scene.
#ifndef SHARE_SCENE_GLSL
#define SHARE_SCENE_GLSL

struct Instance {
    mat4x3 rel_from_object;  // columns; the last is the translation
    mat3 normal_from_object; // cofactor matrix times the sign of the determinant, scaled to fit (numerics.md 41)
    float handedness;        // sign of the determinant: −1 mirrors
    uint material;
    float scale;             // cube root of |determinant|: how long a metre of the object is in the world
    uint flags;              // INSTANCE_SHEET
    uint first_triangle;     // of the scene's, instances counted
};
const uint INSTANCE_SHEET = 1; // transmits light and is no closed solid: read as a thin sheet

// What is constant over a material, in full f32: the G-buffer holds only what varies over it. Also read as texels of
// four words (lib/material.glsl).
struct Material {
    vec4 base_color;
    vec3 emissive;
    float metallic;
    vec3 f0;                  // specular reflectance of the dielectric part at normal incidence
    float roughness;
    vec3 sigma_thickness;     // optical depth through the nominal thickness
    float f90;                // specular reflectance of the dielectric part at grazing incidence
    float ior;
    float occlusion_strength;
    float normal_scale;
    float alpha_cutoff;
    float transmission;
    float clearcoat;
    float clearcoat_roughness;
    uint flags;               // MATERIAL_...
    vec3 sigma;               // absorption of the medium inside, 1/m, beside that of its grid
    uint medium;              // as an entry of lib/media.glsl
    vec3 n_metal;             // index of refraction and extinction of a metal per channel, where flagged
    float thickness;          // nominal, in metres of the object
    vec3 kappa_metal;
    uint grid;                // of σ (share/sigma_grid.glsl) the first texel + 1; 0 where none is marched
};
const uint MATERIAL_UNLIT = 1;
const uint MATERIAL_BLENDED = 2;   // alpha is coverage
const uint MATERIAL_CONDUCTOR = 4; // n_metal and kappa_metal tell its reflectance
const uint MATERIAL_MIRRORS = 8;   // reflects anything at all at its surface
// In a band of wavelengths, where colours are numbers (lib/spectrum.glsl), these are still red, green and blue:
const uint MATERIAL_BASE_RGB = 16;     // base_color, times what varies over the surface
const uint MATERIAL_VARIES_RGB = 64;   // or that alone: base_color is a number
const uint MATERIAL_EMISSIVE_RGB = 32; // emissive

// The G-buffer's second id: instance, which side of it, and occlusion in the leading byte.
const uint INSTANCE_BITS = 0x7fffffu;
const uint BACK_FACE = 0x800000u;
#endif
