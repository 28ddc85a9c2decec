// What the two stages of the G-buffer and of the fragment list agree on: which textures a material has. Constants, so
// that code and varyings of absent textures do not exist (lavapipe runs both sides of a branch).
#ifndef GBUFFER_INTERFACE_GLSL
#define GBUFFER_INTERFACE_GLSL
#include "lib/slots.glsl"
#include "share/scene.glsl"

layout(constant) const bool HAS_BASE = false;
layout(constant) const bool HAS_METALLIC_ROUGHNESS = false;
layout(constant) const bool HAS_NORMAL = false;
layout(constant) const bool HAS_OCCLUSION = false;
layout(constant) const bool HAS_EMISSIVE = false;
layout(constant) const bool HAS_LAYERS = false;
layout(constant) const bool HAS_COLOR = false;
layout(constant) const bool MASKED = false;
layout(constant) const bool HAS_COAT_NORMAL = false;
layout(constant) const uint NORMAL_STEPS = 0; // that stored normals are rounded to; 0: what they are stored in decides
const bool HAS_TEXTURES = HAS_BASE || HAS_METALLIC_ROUGHNESS || HAS_NORMAL || HAS_OCCLUSION || HAS_EMISSIVE || HAS_LAYERS ||
                          HAS_COAT_NORMAL;

#endif
