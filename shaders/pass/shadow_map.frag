// Shadow maps: the depth of opaque surfaces as seen by a light, with the bias that lib/shadow.glsl derives.
// Where to read: RTR 4, section 7.4; docs/decisions/shadow-maps.md. Assumes: reversed depth; the stored value is farther
// from the light by the change over one texel.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "lib/gbuffer_interface.glsl"
#include "lib/material.glsl"

layout(location = 0) in vec4 uv;
layout(location = 1) in float alpha;
layout(location = 2) flat in uint material;

void main() {
    float z = gl_FragCoord.z;
    float change = fwidth(z);
    if (MASKED) {
        Material m = material_at(material);
        float a = m.base_color.a * (HAS_COLOR ? alpha : 1.0);
        // The finest mip level, as shadow rays read it: a texel of the map represents its centre, not its area.
        if ((TEXTURES & (1u << SLOT_BASE)) != 0) a *= textureLod(base_page, page_coordinates(material, SLOT_BASE, uv), 0.0).a;
        if (a < m.alpha_cutoff) discard;
    }
    gl_FragDepth = max(z - change, 0.0);
}
