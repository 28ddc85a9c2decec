// What the two stages of the G-buffer and of the fragment list agree on: which textures a material has. Constants, so
// that code and varyings of absent textures do not exist (lavapipe runs both sides of a branch).
#ifndef GBUFFER_INTERFACE_GLSL
#define GBUFFER_INTERFACE_GLSL
#include "share/scene.glsl"

layout(constant_id = 0) const bool HAS_BASE = false;
layout(constant_id = 1) const bool HAS_METALLIC_ROUGHNESS = false;
layout(constant_id = 2) const bool HAS_NORMAL = false;
layout(constant_id = 3) const bool HAS_OCCLUSION = false;
layout(constant_id = 4) const bool HAS_EMISSIVE = false;
layout(constant_id = 5) const bool HAS_LAYERS = false;
layout(constant_id = 6) const bool HAS_COLOR = false;
layout(constant_id = 7) const bool MASKED = false;
layout(constant_id = 8) const bool HAS_COAT_NORMAL = false;
const bool HAS_TEXTURES = HAS_BASE || HAS_METALLIC_ROUGHNESS || HAS_NORMAL || HAS_OCCLUSION || HAS_EMISSIVE || HAS_LAYERS ||
                          HAS_COAT_NORMAL;

// Order of a material's texture slots.
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
