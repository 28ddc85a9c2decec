// Order-independent transparency: appends transparent fragments in front of the opaque surface to per-pixel linked lists.
// This builds the A-buffer (lib/fragment_list.glsl); composite.comp reads it. Where to read: Carpenter 1984; Yang et al.
// 2010; Vulkan specification, "Early Fragment Test" (a hidden fragment is discarded before it writes).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(early_fragment_tests) in;
#include "lib/surface_fragment.glsl"
#include "lib/normals.glsl"
#include "lib/fragment_list.glsl"

layout(pass, r32ui) uniform uimage2D heads;
layout(pass, scalar) buffer Counters { uint counters[]; };
layout(pass, scalar) writeonly buffer Nodes { uint nodes[]; };

const uint NODE_WORDS = LOBE_TEXELS ? LEAST_NODE_WORDS + LOBE_WORDS : LEAST_NODE_WORDS;

void main() {
    SurfaceFragment s = surface_fragment();
    Texels t = s.texels;
    Material m = material_at(ids.y);
    float alpha = t.base.a * m.base_color.a;
    bool covers = (m.flags & MATERIAL_BLENDED) != 0;
    if (!covers) alpha = 1.0;
    if (MASKED && t.base.a * m.base_color.a < m.alpha_cutoff) return;
    // A fragment without coverage is dropped. NaN coverage stays: it is counted later.
    if (alpha <= 0.0) return;
    uint slot = atomicAdd(counters[strip], 1u);
    // The counter continues beyond the end of the buffer, so the host learns how many nodes the frame needs. Nodes are compared, not
    // words, whose number overflows from 226 million fragments on.
    if (slot >= uint(nodes.length()) / NODE_WORDS) return;
    uint at = slot * NODE_WORDS;
    nodes[at + 0] = imageAtomicExchange(heads, ivec2(gl_FragCoord.xy), slot);
    nodes[at + 1] = floatBitsToUint(gl_FragCoord.z);
    nodes[at + 2] = ids.x;
    nodes[at + 3] = triangle();
    nodes[at + 4] = ids.y | uint(clamp(t.roughness, 0.0, 1.0) * 65535.0 + 0.5) << 16;
    nodes[at + 5] = packHalf2x16(t.base.rg);
    nodes[at + 6] = packHalf2x16(vec2(t.base.b, t.metallic));
    nodes[at + 7] = packSnorm2x16(stored_octahedron(s.n_shading));
    nodes[at + 8] = packHalf2x16(t.emissive.rg);
    nodes[at + 9] = packHalf2x16(vec2(t.emissive.b, alpha));
    nodes[at + 10] = packUnorm2x16(vec2(t.occlusion, 0.0));
    uvec4 layers = packed_layers(t, s.n_coat);
    nodes[at + 11] = layers.x;
    nodes[at + 12] = layers.y;
    nodes[at + 13] = layers.z;
    nodes[at + 14] = layers.w;
    if (LOBE_TEXELS) {
        uvec4 lobes = packed_lobes(t);
        nodes[at + 15] = lobes.x;
        nodes[at + 16] = lobes.y;
        nodes[at + 17] = lobes.z;
        nodes[at + 18] = lobes.w;
    }
}
