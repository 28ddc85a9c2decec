// Tables that describe the scene. Twin: src/share.rs (build.rs compares the layouts).

struct Instance {
    mat4x3 rel_from_object;  // columns; the last is the translation
    mat3 normal_from_object; // cofactor matrix times the sign of the determinant, scaled to fit (numerics.md 41)
    float handedness;        // sign of the determinant: −1 mirrors
    uint material;
    float scale;             // cube root of |determinant|: how long a metre of the object is in the world
};

// What is constant over a material, in full f32: the G-buffer holds only what varies over it.
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
    uint flags;               // bit 0: unlit; bit 1: alpha is coverage
};
