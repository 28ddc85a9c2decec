// Arbitrary output variables (AOVs): the G-buffer as plain f32 words per pixel, in the order of AovPixel.
// Assumes: positions relative to the eye in metres, normals in world axes (share/aov.glsl).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/encode.glsl"
#include "lib/gbuffer.glsl"
#include "lib/material.glsl"
#include "share/aov.glsl"

layout(pass, scalar) writeonly buffer Pixels { AovPixel pixels[]; };
layout(push_constant, scalar) uniform Push { uint first_row; uint end_row; };

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, first_row);
    if (any(greaterThanEqual(uvec2(pixel), uvec2(camera.size.x, end_row)))) return;
    float z = stored_depth(pixel_index(pixel));
    AovPixel result = AovPixel(vec3(0), vec3(0), vec3(0), vec3(0), 0, 0, 0, vec3(0), 0, 0);
    if (z > 0.0) {
        uvec2 id = imageLoad(ids, pixel).xy;
        vec4 texel = imageLoad(base, pixel);
        vec4 octahedral = stored_normals(pixel);
        Material m = material_at(id.x & 0xffffu);
        result.p_rel = POSITIONS ? stored_position(pixel_index(pixel)) : rel_from_pixel(camera, pixel, z);
        result.normal = unit_from_octahedral(octahedral.xy);
        result.geometric_normal = unit_from_octahedral(octahedral.zw);
        result.albedo = texel.rgb * m.base_color.rgb;
        result.distance = camera.orthographic != 0 ? view_depth(camera, z) : length(result.p_rel);
        result.roughness = float(id.x >> 16) * (1.0 / 65535.0) * m.roughness;
        result.metallic = texel.a * m.metallic;
        result.emissive = (STORED_EMISSIVE ? imageLoad(emissive, pixel).rgb : vec3(1.0)) * m.emissive;
        // 0 means "nothing drawn": ids count from 1.
        result.material = 1 + (id.x & 0xffffu);
        result.instance = 1 + (id.y & INSTANCE_BITS);
    }
    pixels[(pixel.y - first_row) * camera.size.x + pixel.x] = result;
}
