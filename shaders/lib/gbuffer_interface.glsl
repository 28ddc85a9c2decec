// What the two stages of the G-buffer and of the fragment list agree on: which textures a material has. Constants, so
// that code and varyings of absent textures do not exist (lavapipe runs both sides of a branch).
#ifndef GBUFFER_INTERFACE_GLSL
#define GBUFFER_INTERFACE_GLSL
#include "lib/slots.glsl"
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
layout(constant_id = 77) const uint NORMAL_STEPS = 0; // that stored normals are rounded to; 0: what they are stored in decides
const bool HAS_TEXTURES = HAS_BASE || HAS_METALLIC_ROUGHNESS || HAS_NORMAL || HAS_OCCLUSION || HAS_EMISSIVE || HAS_LAYERS ||
                          HAS_COAT_NORMAL;

#endif
