// Texture values of a surface point, each next to the material's factor that it multiplies; texture slots and pages.
// Where to read: glTF 2.0, section 3.9 and the KHR_materials extensions; docs/decisions/large-pages.md.
//
// Each texture of a material has a slot: the build counts the pages below, and SLOT_NAME is the number of NAME_page. Images
// of one size are layers of an array, a page (src/upload/texture.rs). Materials that read the same pages share a descriptor
// set.
#ifndef TEXELS_GLSL
#define TEXELS_GLSL
#include "lib/constants.glsl"
#include "lib/encode.glsl"

layout(pages) uniform sampler2DArray base_page;
layout(pages) uniform sampler2DArray metallic_roughness_page;
layout(pages) uniform sampler2DArray normal_page;
layout(pages) uniform sampler2DArray occlusion_page;
layout(pages) uniform sampler2DArray emissive_page;
layout(pages) uniform sampler2DArray clearcoat_page;
layout(pages) uniform sampler2DArray clearcoat_roughness_page;
layout(pages) uniform sampler2DArray clearcoat_normal_page;
layout(pages) uniform sampler2DArray specular_page;
layout(pages) uniform sampler2DArray transmission_page;
layout(pages) uniform sampler2DArray thickness_page;
layout(pages) uniform sampler2DArray sheen_color_page;
layout(pages) uniform sampler2DArray sheen_roughness_page;

// Lobes of extensions over the base (crates/scene/src/lobe/), each with a texel of parameters in the table of materials.
const uint LOBES = 1;
const uint LOBE_SHEEN = 0;

struct Texels {
    vec4 base; // times the vertex colour
    float metallic;
    float roughness;
    float occlusion;
    vec3 emissive;
    float clearcoat;
    float clearcoat_roughness;
    float specular;
    float transmission;
    float thickness;
    vec4 sheen; // colour, roughness
};

Texels texels_of_nothing(vec4 vertex_color) {
    return Texels(vertex_color, 1.0, 1.0, 1.0, vec3(1.0), 1.0, 1.0, 1.0, 1.0, 1.0, vec4(1.0));
}

// Reads all textures but the normal maps. TEXEL(page, slot) is a vec4, white where the material has no such texture.
// Rasterised surfaces read samplers, ray hits read by index (lib/surface_fragment.glsl, lib/hit.glsl).
#define READ_TEXELS(t) \
    t.base *= TEXEL(base_page, SLOT_BASE); \
    vec4 metallic_roughness = TEXEL(metallic_roughness_page, SLOT_METALLIC_ROUGHNESS); \
    t.roughness = metallic_roughness.g; \
    t.metallic = metallic_roughness.b; \
    t.occlusion = TEXEL(occlusion_page, SLOT_OCCLUSION).r; \
    t.emissive = TEXEL(emissive_page, SLOT_EMISSIVE).rgb; \
    t.clearcoat = TEXEL(clearcoat_page, SLOT_CLEARCOAT).r; \
    t.clearcoat_roughness = TEXEL(clearcoat_roughness_page, SLOT_CLEARCOAT_ROUGHNESS).g; \
    t.specular = TEXEL(specular_page, SLOT_SPECULAR).a; \
    t.transmission = TEXEL(transmission_page, SLOT_TRANSMISSION).r; \
    t.thickness = TEXEL(thickness_page, SLOT_THICKNESS).g; \
    t.sheen = vec4(TEXEL(sheen_color_page, SLOT_SHEEN_COLOR).rgb, TEXEL(sheen_roughness_page, SLOT_SHEEN_ROUGHNESS).a);

// The layers over and under the base, and the normal of the clear coat, packed into four words of the G-buffer and the
// fragment list:
//   clearcoat and its roughness (8 bits each), specular (16) | normal of the coat, octahedral (2 x 16) | transmission, thickness (16 each) |
//   sheen (8 each)
uvec4 packed_layers(Texels t, vec3 n_coat) {
    uint coat = packUnorm4x8(vec4(t.clearcoat, t.clearcoat_roughness, 0.0, 0.0));
    return uvec4(coat | packUnorm2x16(vec2(0.0, t.specular)), packUnorm2x16(octahedral_from_unit(n_coat) * 0.5 + 0.5),
                 packUnorm2x16(vec2(t.transmission, t.thickness)), packUnorm4x8(t.sheen));
}

void unpack_layers(uvec4 words, inout Texels t, out vec3 n_coat) {
    vec2 coat = unpackUnorm4x8(words.x).xy;
    vec2 below = unpackUnorm2x16(words.z);
    t.clearcoat = coat.x;
    t.clearcoat_roughness = coat.y;
    t.specular = unpackUnorm2x16(words.x).y;
    t.transmission = below.x;
    t.thickness = below.y;
    t.sheen = unpackUnorm4x8(words.w);
    n_coat = unit_from_octahedral(unpackUnorm2x16(words.y) * 2.0 - 1.0);
}
#endif
