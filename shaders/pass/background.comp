// The background: the environment, or nothing, over the tiles of the classification in which some pixel shows it.
// Where to read: docs/decisions/work-tiles.md. Alpha is 1 for the environment and 0 for nothing (premultiplied alpha).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/environment.glsl"
#include "lib/gbuffer.glsl"
#include "lib/work_tile.glsl"

layout(pass, rgba32f) writeonly uniform image2D radiance;
layout(pass, scalar) readonly buffer BackgroundTiles { uint background_tiles[]; };
layout(pass, scalar) readonly buffer Sizes { WorkSize surface_size; WorkSize background_size; } work;

void main() {
    uint place = listed_tile(gl_WorkGroupID);
    if (place >= work.background_size.count) return;
    ivec2 pixel = unpacked_pixel(background_tiles[place]) + ivec2(gl_LocalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(pixel), camera.size))) return;
    if (stored_depth(pixel_index(pixel)) != 0.0) return;
    vec4 result = vec4(0.0);
    if (SKY) result = vec4(background_radiance(view_direction(camera, pixel)), 1.0);
    imageStore(radiance, pixel, result);
}
