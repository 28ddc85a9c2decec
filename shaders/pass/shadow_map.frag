// The depth of what stops light. lib/shadow.glsl says what is stored and why.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "lib/slots.glsl"
#include "share/scene.glsl"

layout(constant_id = 0) const bool MASKED = false;
layout(constant_id = 1) const bool HAS_BASE = false;
layout(constant_id = 2) const bool HAS_COLOR = false;

layout(scalar, set = 0, binding = 1) readonly buffer Materials { Material materials[]; };
layout(set = 0, binding = 2, rgba32f) readonly uniform imageBuffer slots;
layout(set = 0, binding = 3) uniform sampler2DArray base_page;

layout(location = 0) in vec4 uv;
layout(location = 1) in float alpha;
layout(location = 2) flat in uint material;

void main() {
    float z = gl_FragCoord.z;
    float change = fwidth(z);
    if (MASKED) {
        float a = materials[material].base_color.a * (HAS_COLOR ? alpha : 1.0);
        if (HAS_BASE) {
            int at = int(material * SLOTS + SLOT_BASE) * 2;
            vec4 u_layer = imageLoad(slots, at);
            vec4 v_set = imageLoad(slots, at + 1);
            vec3 set = vec3(v_set.w == 0.0 ? uv.xy : uv.zw, 1.0);
            // The finest level, as rays to lights read it: a texel of the map tells of its centre, not of its area.
            a *= textureLod(base_page, vec3(dot(u_layer.xyz, set), dot(v_set.xyz, set), u_layer.w), 0.0).a;
        }
        if (a < materials[material].alpha_cutoff) discard;
    }
    gl_FragDepth = max(z - change, 0.0);
}
