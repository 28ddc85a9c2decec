// Order of a material's texture slots.
#ifndef SLOTS_GLSL
#define SLOTS_GLSL
const uint SLOT_BASE = 0;
const uint SLOT_METALLIC_ROUGHNESS = 1;
const uint SLOT_NORMAL = 2;
const uint SLOT_OCCLUSION = 3;
const uint SLOT_EMISSIVE = 4;
const uint SLOT_CLEARCOAT = 5;
const uint SLOT_CLEARCOAT_ROUGHNESS = 6;
const uint SLOT_SPECULAR = 7;
const uint SLOT_TRANSMISSION = 8;
const uint SLOT_THICKNESS = 9;
const uint SLOT_CLEARCOAT_NORMAL = 10;
const uint SLOTS = 11;
#endif
