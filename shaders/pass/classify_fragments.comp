// Tile classification: the 8x8 tiles of a strip with transparent fragments, and the size of their indirect dispatch.
// Where to read: docs/decisions/work-tiles.md, docs/decisions/transparency.md (strips).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
#include "lib/fragment_list.glsl"
#include "lib/own_tiles.glsl"

layout(pass, r32ui) readonly uniform uimage2D heads;
layout(pass, scalar) buffer Sizes { WorkSize tiles_size; };
layout(pass, scalar) writeonly buffer Tiles { uint fragment_tiles[]; };
layout(push_constant, scalar) uniform Push { uint width; uint first_row; uint end_row; uint stride; };

void main() {
    uvec2 size = uvec2(width, end_row - first_row);
    uvec2 tiles = (size + WORK_TILE - 1) / WORK_TILE;
    uint tile = scattered_tile(tiles.x * tiles.y, stride);
    if (tile >= tiles.x * tiles.y) return;
    uvec2 first = uvec2(tile % tiles.x, tile / tiles.x) * WORK_TILE + uvec2(0, first_row);
    if (!in_own_tile(first)) return;
    uvec2 last = min(first + WORK_TILE, uvec2(width, end_row));
    bool any_fragment = false;
    for (uint y = first.y; y < last.y; y++) {
        for (uint x = first.x; x < last.x; x++) {
            any_fragment = any_fragment || imageLoad(heads, ivec2(x, y)).x != END_OF_LIST;
        }
    }
    if (any_fragment) {
        APPEND_TILE(tiles_size, place);
        fragment_tiles[place] = packed_pixel(first);
    }
}
