// Light of the environment and of what occludes it (ambient occlusion), over the tiles with surfaces (tile classification).
// It takes the place of the environment's part of light.comp and adds to the radiance. Where to read: RTR 4, section 11.3;
// docs/decisions/ambient-occlusion.md. Assumes: world axes, positions relative to the eye.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/ambient_occlusion.glsl"
#include "lib/lit_surface.glsl"
#include "lib/work_count.glsl"
#include "lib/work_tile.glsl"

layout(pass, rgba32f) uniform image2D radiance;
layout(pass, scalar) readonly buffer SurfaceTiles { uint surface_tiles[]; };
layout(pass, scalar) readonly buffer Sizes { WorkSize surface_size; WorkSize background_size; } work;

void main() {
    uint place = listed_tile(gl_WorkGroupID);
    if (place >= work.surface_size.count) return;
    ivec2 pixel = unpacked_pixel(surface_tiles[place]) + ivec2(gl_LocalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(pixel), camera.size))) return;
    LitSurface lit = lit_surface(pixel);
    if (!lit.drawn) return;
    sky_list = list_of(uvec2(pixel));
    vec3 result = occluded_environment_light(lit.s) * left_at_eye(lit.s);
    if (lit.suppressed || lit.s.unlit) result = vec3(0.0);
    imageStore(radiance, pixel, imageLoad(radiance, pixel) + vec4(result, 0.0));
    count_rays(0, 0, 0.0, 0.0);
}
