// The interface between the vertex and fragment stages of the G-buffer and of the fragment lists: textures and attributes.
// These are specialization constants, so code and varyings of absent textures do not exist (lavapipe runs both sides of a
// branch). Where to read: Vulkan specification, "Specialization Constants".
#ifndef GBUFFER_INTERFACE_GLSL
#define GBUFFER_INTERFACE_GLSL
#include "lib/texels.glsl"
#include "share/scene.glsl"

layout(constant) const uint TEXTURES = 0; // bit by slot; normal maps only where the mesh has tangents
layout(constant) const bool HAS_COLOR = false;
layout(constant) const bool MASKED = false;
layout(constant) const bool ANISOTROPIC = false; // the material's lobe has a direction
layout(constant) const bool LOBE_TEXELS = false; // what textures and tangents give to further lobes is stored (lib/texels.glsl)
layout(constant) const bool SHARED_VERTICES = true; // triangles share vertices by index; otherwise each has its own three, in order
const bool HAS_NORMAL = (TEXTURES & (1u << SLOT_NORMAL)) != 0;
const bool HAS_COAT_NORMAL = (TEXTURES & (1u << SLOT_CLEARCOAT_NORMAL)) != 0;

#endif
