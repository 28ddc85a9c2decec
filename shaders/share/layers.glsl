// Numbers of the material model (lib/layers.glsl) that its twin on the host has, too (src/transport/layers.rs).
#ifndef SHARE_LAYERS_GLSL
#define SHARE_LAYERS_GLSL

const float COAT_INDEX = 1.5;      // index of refraction of clear coats (KHR_materials_clearcoat)
const float COAT_F0 = 0.04;        // and their reflectance at normal incidence in air
// The lobe stays finite there (numerics.md 20 holds from α = 1e-5).
const float MIN_ROUGHNESS = 0.01;  // perceptual roughness below which a surface is a mirror to 16-bit normals
const float LEAST_SHEEN_ROUGHNESS = 0.07; // perceptual roughness below which sheen grows no sharper: 1/α is 204, as steep as its table resolves
#endif
