// Tile classification: lists of the 8x8 tiles with surfaces and with background, and the sizes of their indirect
// dispatches.
// A branch in the later passes saves nothing on lavapipe, which runs both sides for every group of eight pixels; not
// dispatching a tile does. The order of a list is arbitrary: each tile writes only its own pixels.
// Where to read: docs/decisions/work-tiles.md; RTR 4, section 20.3.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
#include "lib/gbuffer.glsl"
#include "lib/own_tiles.glsl"

layout(pass, scalar) buffer Sizes { WorkSize surface_size; WorkSize background_size; };
layout(pass, scalar) writeonly buffer SurfaceTiles { uint surface_tiles[]; };
layout(pass, scalar) writeonly buffer BackgroundTiles { uint background_tiles[]; };
layout(push_constant, scalar) uniform Push { uint stride; };

void main() {
    uint turn = scattered_tile(own_tiles(), stride);
    if (turn >= own_tiles()) return;
    uvec2 first = own_tile(turn);
    uvec2 last = min(first + WORK_TILE, camera.size);
    float nearest = 0.0;
    float farthest = 1.0;
    for (uint y = first.y; y < last.y; y++) {
        for (uint x = first.x; x < last.x; x++) {
            float z = stored_depth(pixel_index(ivec2(x, y)));
            nearest = max(nearest, z);
            farthest = min(farthest, z);
        }
    }
    uint packed = packed_pixel(first);
    if (nearest > 0.0) {
        APPEND_TILE(surface_size, place);
        surface_tiles[place] = packed;
    }
    if (farthest == 0.0) {
        APPEND_TILE(background_size, place);
        background_tiles[place] = packed;
    }
}
