// The nearest depth of each 8x8 tile, with which screen-space ray marching skips tiles in one step.
// A minimum-depth pyramid of one level. Where to read: docs/decisions/screen-space.md. Assumes: reversed depth, so the
// nearest is the largest.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
#include "lib/screen_piece.glsl"
#include "lib/work_tile.glsl"

layout(pass, scalar) writeonly buffer NearestPieces { float nearest_pieces[]; };

void main() {
    uvec2 tiles = (camera.size + WORK_TILE - 1) / WORK_TILE;
    uint tile = listed_tile(gl_WorkGroupID) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    if (tile >= tiles.x * tiles.y) return;
    uvec2 first = uvec2(tile % tiles.x, tile / tiles.x) * WORK_TILE;
    uvec2 last = min(first + WORK_TILE, camera.size);
    float nearest = 0.0;
    for (uint y = first.y; y < last.y; y++) {
        for (uint x = first.x; x < last.x; x++) {
            ScreenPiece piece = screen_piece(ivec2(x, y));
            // Half a pixel to each side, and as much again for the difference to pieces of the next tile.
            nearest = max(nearest, piece.z > 0.0 ? piece.z + 2.0 * piece.thickness : 0.0);
        }
    }
    nearest_pieces[tile] = nearest;
}
