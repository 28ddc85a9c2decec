// Tiles of the picture that this process draws: all of them, or every n-th where other processes draw the rest.
// Where to read: docs/decisions/shards.md. Assumes: tiles of 8x8 pixels (lib/work_tile.glsl), row by row.
#ifndef OWN_TILES_GLSL
#define OWN_TILES_GLSL
#include "lib/view.glsl"
#include "lib/work_tile.glsl"

layout(constant) const bool SHARED_PICTURE = false; // other processes draw some tiles of the picture

uvec2 tiles_of_picture() {
    return (camera.size + WORK_TILE - 1) / WORK_TILE;
}

// Number of tiles that this process draws.
uint own_tiles() {
    uvec2 tiles = tiles_of_picture();
    uint all = tiles.x * tiles.y;
    if (!SHARED_PICTURE) return all;
    return camera.tiles.x < all ? (all - camera.tiles.x - 1) / camera.tiles.y + 1 : 0;
}

// First pixel of such a tile, by its index among them.
uvec2 own_tile(uint index) {
    uint tile = SHARED_PICTURE ? camera.tiles.x + index * camera.tiles.y : index;
    uint across = tiles_of_picture().x;
    return uvec2(tile % across, tile / across) * WORK_TILE;
}

// Whether this process draws the tile that holds a pixel.
bool in_own_tile(uvec2 pixel) {
    if (!SHARED_PICTURE) return true;
    uvec2 at = pixel / WORK_TILE;
    uint tile = at.y * tiles_of_picture().x + at.x;
    return tile % camera.tiles.y == camera.tiles.x;
}
#endif
