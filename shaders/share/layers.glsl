// Constants of the layered material model (lib/layers.glsl) that its host twin uses too (src/transport/layers.rs).
#ifndef SHARE_LAYERS_GLSL
#define SHARE_LAYERS_GLSL

const float COAT_INDEX = 1.5;      // index of refraction of the clear coat (KHR_materials_clearcoat)
const float COAT_F0 = 0.04;        // reflectance of the clear coat at normal incidence in air
// At that roughness the lobe is still finite (numerics.md 20 holds from α = 1e-5).
const float MIN_ROUGHNESS = 0.01;  // perceptual roughness below which a surface is specular: a mirror to 16-bit normals
const float LEAST_SHEEN_ROUGHNESS = 0.07; // least perceptual roughness of sheen: 1/α is 204, as steep as its table resolves
#endif
