// What the two stages of the G-buffer and of the fragment list agree on: which textures a material has. Constants, so
// that code and varyings of absent textures do not exist (lavapipe runs both sides of a branch).
#ifndef GBUFFER_INTERFACE_GLSL
#define GBUFFER_INTERFACE_GLSL
#include "lib/texels.glsl"
#include "share/scene.glsl"

layout(constant) const uint TEXTURES = 0; // bit by slot; those of normals where the mesh has tangents
layout(constant) const bool HAS_COLOR = false;
layout(constant) const bool MASKED = false;
layout(constant) const bool SHARED_VERTICES = true; // by triangles; otherwise each has three of its own, one after the other
const bool HAS_NORMAL = (TEXTURES & (1u << SLOT_NORMAL)) != 0;
const bool HAS_COAT_NORMAL = (TEXTURES & (1u << SLOT_CLEARCOAT_NORMAL)) != 0;

#endif
