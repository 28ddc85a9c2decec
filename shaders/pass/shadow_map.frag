// The depth of what stops light. lib/shadow.glsl says what is stored and why.
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
        // The finest level, as rays to lights read it: a texel of the map tells of its centre, not of its area.
        if ((TEXTURES & (1u << SLOT_BASE)) != 0) a *= textureLod(base_page, page_coordinates(material, SLOT_BASE, uv), 0.0).a;
        if (a < m.alpha_cutoff) discard;
    }
    gl_FragDepth = max(z - change, 0.0);
}
