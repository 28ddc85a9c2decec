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
layout(pages) uniform sampler2DArray specular_color_page;
layout(pages) uniform sampler2DArray anisotropy_page;
layout(pages) uniform sampler2DArray iridescence_page;
layout(pages) uniform sampler2DArray iridescence_thickness_page;
layout(pages) uniform sampler2DArray diffuse_transmission_page;
layout(pages) uniform sampler2DArray diffuse_transmission_color_page;

// Lobes of extensions (crates/scene/src/lobe/), each with a texel of parameters in the table of materials.
const uint LOBES = 4;
const uint LOBE_SHEEN = 0;
const uint LOBE_ANISOTROPY = 1;
const uint LOBE_IRIDESCENCE = 2;
const uint LOBE_DIFFUSE_TRANSMISSION = 3;

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
    vec3 specular_color;
    float anisotropy;          // strength
    vec3 tangent;              // unit direction along which the base's lobe is wide, world axes; while textures are read, the texel's two components
    vec2 iridescence;          // factor, thickness
    vec4 diffuse_transmission; // colour, factor
};

Texels texels_of_nothing(vec4 vertex_color) {
    return Texels(vertex_color, 1.0, 1.0, 1.0, vec3(1.0), 1.0, 1.0, 1.0, 1.0, 1.0, vec4(1.0), vec3(1.0), 1.0, vec3(1.0, 0.0, 0.0), vec2(1.0),
                  vec4(1.0));
}

// Puts the value of the texture in `slot` where it belongs; `used` has the bits of all slots that the caller reads. Callers keep
// normal maps themselves: they have the frames for them.
#define PUT(name) if ((used & (1u << name)) != 0 && slot == name)
void put_texel(inout Texels t, uint used, uint slot, vec4 value) {
    PUT(SLOT_BASE) t.base *= value;
    PUT(SLOT_METALLIC_ROUGHNESS) {
        t.roughness = value.g;
        t.metallic = value.b;
    }
    PUT(SLOT_OCCLUSION) t.occlusion = value.r;
    PUT(SLOT_EMISSIVE) t.emissive = value.rgb;
    PUT(SLOT_CLEARCOAT) t.clearcoat = value.r;
    PUT(SLOT_CLEARCOAT_ROUGHNESS) t.clearcoat_roughness = value.g;
    PUT(SLOT_SPECULAR) t.specular = value.a;
    PUT(SLOT_TRANSMISSION) t.transmission = value.r;
    PUT(SLOT_THICKNESS) t.thickness = value.g;
    PUT(SLOT_SHEEN_COLOR) t.sheen.rgb = value.rgb;
    PUT(SLOT_SHEEN_ROUGHNESS) t.sheen.a = value.a;
    PUT(SLOT_SPECULAR_COLOR) t.specular_color = value.rgb;
    PUT(SLOT_ANISOTROPY) {
        t.anisotropy = value.b;
        t.tangent.xy = value.rg * 2.0 - 1.0;
    }
    PUT(SLOT_IRIDESCENCE) t.iridescence.x = value.r;
    PUT(SLOT_IRIDESCENCE_THICKNESS) t.iridescence.y = value.g;
    PUT(SLOT_DIFFUSE_TRANSMISSION) t.diffuse_transmission.a = value.a;
    PUT(SLOT_DIFFUSE_TRANSMISSION_COLOR) t.diffuse_transmission.rgb = value.rgb;
}
#undef PUT

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

// What textures and tangents give to further lobes, packed into four more words:
//   specular colour, iridescence (8 bits each) | direction of anisotropy, octahedral (2 x 16) | thickness of iridescence (16),
//   strength of anisotropy (16) | diffuse transmission: colour, factor (8 each)
uvec4 packed_lobes(Texels t) {
    return uvec4(packUnorm4x8(vec4(t.specular_color, t.iridescence.x)), packUnorm2x16(octahedral_from_unit(t.tangent) * 0.5 + 0.5),
                 packUnorm2x16(vec2(t.iridescence.y, t.anisotropy)), packUnorm4x8(t.diffuse_transmission));
}

void unpack_lobes(uvec4 words, inout Texels t) {
    vec4 specular = unpackUnorm4x8(words.x);
    vec2 numbers = unpackUnorm2x16(words.z);
    t.specular_color = specular.rgb;
    t.iridescence = vec2(specular.a, numbers.x);
    t.anisotropy = numbers.y;
    t.tangent = unit_from_octahedral(unpackUnorm2x16(words.y) * 2.0 - 1.0);
    t.diffuse_transmission = unpackUnorm4x8(words.w);
}
#endif
