// The table of materials, read as texels of four words.
// Texels, because lavapipe fetches one at once, and a word of a storage buffer in eight steps. Members and units:
// share/scene.glsl. Where to read: glTF 2.0, section 3.9; KHR_texture_transform.
#ifndef MATERIAL_GLSL
#define MATERIAL_GLSL
#include "lib/texels.glsl"
#include "share/scene.glsl"

layout(scene, rgba32ui) readonly uniform uimageBuffer material_texels;
// @pages SLOTS
// Texels of one material: the struct Material; then three texels per texture slot: row of u and layer | row of v and
// coordinate set | for rays: first texel, width and height, levels and flags (lib/hit.glsl).
const int MATERIAL_SLOTS_AT = 9;
const int SLOT_TEXELS = 3;
const int MATERIAL_LOBES_AT = MATERIAL_SLOTS_AT + int(SLOTS) * SLOT_TEXELS;
const int MATERIAL_TEXELS = MATERIAL_LOBES_AT + int(LOBES);

uvec4 material_words(uint id, int i) {
    return imageLoad(material_texels, int(id) * MATERIAL_TEXELS + i);
}

vec4 material_texel(uint id, int i) {
    return uintBitsToFloat(material_words(id, i));
}

// @texels Material material_at(material_words)
// @texels Material.emissive material_emissive(material_words)
// @texels Material.flags material_flags(material_words)
// @texels Material.ior material_ior(material_words)
// @texels Material.sigma material_sigma(material_words)
// @texels Material.grid material_grid(material_words)

// How a material's texture is read: KHR_texture_transform as two rows, the set of coordinates, and the layer of its page.
struct TextureSlot {
    vec3 u_row;
    vec3 v_row;
    bool second_set;
    float layer;
    int first; // the slot's third texel of the table, for rays
};

TextureSlot texture_slot(uint material, uint slot) {
    int at = MATERIAL_SLOTS_AT + int(slot) * SLOT_TEXELS;
    vec4 u_layer = material_texel(material, at);
    vec4 v_set = material_texel(material, at + 1);
    return TextureSlot(u_layer.xyz, v_set.xyz, v_set.w != 0.0, u_layer.w, at + 2);
}

vec2 slot_coordinates(TextureSlot at, vec4 uv_sets) {
    vec3 set = vec3(at.second_set ? uv_sets.zw : uv_sets.xy, 1.0);
    return vec2(dot(at.u_row, set), dot(at.v_row, set));
}

// Coordinates and layer in the texture's page, an array of images. The array index is the rounded third coordinate, so
// neighbouring layers do not mix.
vec3 page_coordinates(uint material, uint slot, vec4 uv_sets) {
    TextureSlot at = texture_slot(material, slot);
    return vec3(slot_coordinates(at, uv_sets), at.layer);
}
#endif
