// Tables of the scene: instances and materials.
// Where to read: glTF 2.0, sections 3.5 and 3.9; the KHR_materials extensions. Assumes: rel space (share/camera.glsl),
// metres.
#ifndef SHARE_SCENE_GLSL
#define SHARE_SCENE_GLSL

struct Instance {
    mat4x3 rel_from_object;  // columns; the last is the translation
    mat3 normal_from_object; // cofactor matrix times the sign of the determinant, scaled to fit (numerics.md 41)
    float handedness;        // sign of the determinant: −1 mirrors
    uint material;
    float scale;             // cube root of |determinant|: length in the world of one metre of the object
    uint flags;              // INSTANCE_SHEET
    uint first_triangle;     // in the scene's triangles, all instances counted
};
const uint INSTANCE_SHEET = 1; // thin-walled: transmits light and is no closed mesh

// What is constant over a material, in full f32; the G-buffer holds only what varies over the surface. Also read as texels
// of four words (lib/material.glsl).
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
    vec3 sigma;               // absorption of the medium inside, 1/m, without that of its grid
    uint medium;              // an entry of lib/media.glsl
    vec3 n_metal;             // index of refraction n and extinction κ of a conductor per channel, where flagged
    float thickness;          // nominal, in metres of the object
    vec3 kappa_metal;
    uint grid;                // first texel of the grid of σ (share/sigma_grid.glsl) + 1; 0: no heterogeneous medium
};
const uint MATERIAL_UNLIT = 1;
const uint MATERIAL_BLENDED = 2;   // alpha is coverage
const uint MATERIAL_CONDUCTOR = 4; // reflectance from n_metal and kappa_metal
const uint MATERIAL_MIRRORS = 8;   // its surface reflects at all
// In a band of wavelengths colours are numbers (lib/spectrum.glsl). Flags of those that are still red, green and blue:
const uint MATERIAL_BASE_RGB = 16;     // base_color, and the texture and vertex colours that multiply it
const uint MATERIAL_VARIES_RGB = 64;   // only the texture and vertex colours: base_color is a number
const uint MATERIAL_EMISSIVE_RGB = 32; // emissive

// The second id of the G-buffer: instance, back face, and occlusion in the leading byte.
const uint INSTANCE_BITS = 0x7fffffu;
const uint BACK_FACE = 0x800000u;
#endif
