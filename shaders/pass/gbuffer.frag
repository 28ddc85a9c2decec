// The G-buffer of deferred shading: writes the nearest opaque surface of every pixel.
// Values that are constant over a material stay in the material table: an untextured material is exact, a textured one as
// exact as its texels. Where to read: RTR 4, section 20.1; docs/decisions/gbuffer.md.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "lib/surface_fragment.glsl"
#include "lib/normals.glsl"

layout(location = 0) out vec4 out_base;     // RGBA16F: base colour, metallic
layout(location = 1) out uvec4 out_normals; // lib/normals.glsl
layout(location = 2) out uvec2 out_ids;     // RG32UI: material | roughness << 16, instance | back face << 23 | occlusion << 24
layout(location = 3) out uint out_triangle; // R32UI, where the plan has rays: triangle of the scene
layout(location = 4) out vec4 out_emissive; // RGBA16F, where the plan has it
layout(location = 5) out uvec4 out_layers;  // RGBA32UI, where the plan has it: lib/texels.glsl, packed_layers
layout(location = 6) out vec4 out_position; // RGBA32F, where the plan has it: depth, position relative to the eye
layout(location = 7) out uvec4 out_lobes;   // RGBA32UI, where the plan has it: lib/texels.glsl, packed_lobes

void main() {
    SurfaceFragment s = surface_fragment();
    if (MASKED && s.texels.base.a * material_at(ids.y).base_color.a < material_at(ids.y).alpha_cutoff) discard;
    out_base = vec4(s.texels.base.rgb, s.texels.metallic);
    out_normals = words_of_octahedra(vec4(stored_octahedron(s.n_shading), stored_octahedron(s.n_geometric)));
    uint roughness = uint(clamp(s.texels.roughness, 0.0, 1.0) * 65535.0 + 0.5);
    uint occlusion = uint(clamp(s.texels.occlusion, 0.0, 1.0) * 255.0 + 0.5);
    out_ids = uvec2(ids.y | roughness << 16, ids.x | occlusion << 24 | (gl_FrontFacing ? 0u : BACK_FACE));
    out_triangle = triangle();
    out_emissive = vec4(s.texels.emissive, 1.0);
    out_layers = packed_layers(s.texels, s.n_coat);
    out_position = vec4(gl_FragCoord.z, p_rel);
    out_lobes = packed_lobes(s.texels);
}
