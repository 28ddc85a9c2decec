// Textures of a material: images of one size are layers of one array, a page (src/pass/texture.rs). Materials that read the same
// pages share a descriptor set of them.
#ifndef PAGES_GLSL
#define PAGES_GLSL
#include "lib/material.glsl"

layout(pages) uniform sampler2DArray base_page;
layout(pages) uniform sampler2DArray metallic_roughness_page;
layout(pages) uniform sampler2DArray normal_page;
layout(pages) uniform sampler2DArray occlusion_page;
layout(pages) uniform sampler2DArray emissive_page;
layout(pages) uniform sampler2DArray clearcoat_page;
layout(pages) uniform sampler2DArray clearcoat_roughness_page;
layout(pages) uniform sampler2DArray specular_page;
layout(pages) uniform sampler2DArray transmission_page;
layout(pages) uniform sampler2DArray thickness_page;
layout(pages) uniform sampler2DArray clearcoat_normal_page;

// Where a texture is read: coordinates in the page, and its layer. The array index is the rounded third coordinate; a layer never
// bleeds into the next.
vec3 page_coordinates(uint material, uint slot, vec4 uv_sets) {
    TextureSlot at = texture_slot(material, slot);
    return vec3(slot_coordinates(at, uv_sets), at.layer);
}
#endif
