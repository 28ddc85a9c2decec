// Deferred lighting: the radiance of each pixel's nearest surface, over the tiles with surfaces (tile classification).
// Light along reflected and refracted rays is added by another pass (lib/ray_tree.glsl). Where to read: RTR 4, section 20.1. Assumes: world
// axes, positions relative to the eye.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/lighting.glsl"
#include "lib/lit_surface.glsl"
#include "lib/work_count.glsl"
#include "lib/work_tile.glsl"

layout(pass, rgba32f) uniform image2D radiance;
layout(pass, scalar) readonly buffer SurfaceTiles { uint surface_tiles[]; };
layout(pass, scalar) readonly buffer Sizes { WorkSize surface_size; WorkSize background_size; } work;
// With shadow rays the lights are divided among dispatches: lavapipe ends long loops (src/pass/lighting.rs).
layout(push_constant, scalar) uniform Push { LightRange range; uint first_dispatch; };

LightSample drawn_apart() {
    return NO_LIGHT_SAMPLE;
}

void main() {
    uint place = listed_tile(gl_WorkGroupID);
    if (place >= work.surface_size.count) return;
    ivec2 pixel = unpacked_pixel(surface_tiles[place]) + ivec2(gl_LocalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(pixel), camera.size))) return;
    LitSurface lit = lit_surface(pixel);
    if (!lit.drawn) return;
    Surface s = lit.s;
    uint tiles_across = (camera.size.x + TILE - 1) / TILE;
    vec3 result = radiance_to_eye(s, pixel, 0, tiles_across, range, first_dispatch != 0) * left_at_eye(s);
    if (lit.suppressed) result = vec3(0.0);
    if (first_dispatch == 0) result += imageLoad(radiance, pixel).rgb;
    imageStore(radiance, pixel, vec4(result, 1.0));
    if (sends_shadow_rays()) count_rays(0, 0, 0.0, 0.0);
}
