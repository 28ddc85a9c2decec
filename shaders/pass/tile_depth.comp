// Tiled light culling, step 1: nearest and farthest view depth of each 16x16 tile.
// With transparent surfaces the near end is the camera, and the far end is infinity where the background shows: the same
// lists light them. Where to read: RTR 4, section 20.3; docs/decisions/light-lists.md.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/gbuffer.glsl"
#include "lib/light_tile.glsl"

layout(constant) const bool FROM_CAMERA = false;
layout(pass, rg32f) writeonly uniform imageBuffer tile_depths;

void main() {
    ivec2 tile = ivec2(gl_GlobalInvocationID.xy);
    ivec2 tiles = (ivec2(camera.size) + int(TILE) - 1) / int(TILE);
    if (any(greaterThanEqual(tile, tiles))) return;
    ivec2 last = min((tile + 1) * int(TILE), ivec2(camera.size));
    float nearest = 0.0; // reversed depth
    float farthest = 1.0;
    bool drawn = false;
    bool seen_through = false; // some pixel shows the background
    for (int y = tile.y * int(TILE); y < last.y; y++) {
        for (int x = tile.x * int(TILE); x < last.x; x++) {
            float z = stored_depth(pixel_index(ivec2(x, y)));
            nearest = max(nearest, z);
            if (z > 0.0) {
                farthest = min(farthest, z);
                drawn = true;
            } else {
                seen_through = true;
            }
        }
    }
    vec2 range = drawn ? vec2(view_depth(camera, nearest), view_depth(camera, farthest)) : vec2(1.0, -1.0);
    if (FROM_CAMERA) range = vec2(0.0, seen_through ? 3e38 : range.y);
    imageStore(tile_depths, tile.y * tiles.x + tile.x, vec4(range, 0.0, 0.0));
}
