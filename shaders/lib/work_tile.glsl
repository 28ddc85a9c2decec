// Tile classification: lists of 8x8 pixel tiles, processed by indirect dispatch with one workgroup per tile.
// A classify pass appends a tile to the lists of the passes that have work in it, and the size of each dispatch grows on
// the device (vkCmdDispatchIndirect). Where to read: Vulkan specification, "Dispatching Commands";
// docs/decisions/work-tiles.md.
#ifndef WORK_TILE_GLSL
#define WORK_TILE_GLSL
#include "share/tiles.glsl"

const uint WORK_TILE = 8;

const uint ROW = 32768; // workgroups along x; longer lists continue along y

// Appends a tile: grows the indirect dispatch and returns the tile's place in the list.
#define APPEND_TILE(size, place) \
    uint place = atomicAdd(size.count, 1u); \
    atomicMax(size.x, min(place + 1, ROW)); \
    atomicMax(size.y, place / ROW + 1)

// A pixel in one word; a tile is known by its first pixel.
uint packed_pixel(uvec2 pixel) {
    return pixel.x | pixel.y << 16;
}

ivec2 unpacked_pixel(uint packed) {
    return ivec2(packed & 0xffffu, packed >> 16);
}

// Place in the list of a workgroup's tile.
uint listed_tile(uvec3 workgroup) {
    return workgroup.y * ROW + workgroup.x;
}

// The tile, of `tiles`, that an invocation classifies, or a number beyond them. On CPUs workgroups cover the picture in
// strides (src/pass/rows.rs), so any contiguous piece of a list has tiles from everywhere.
uint scattered_tile(uint tiles, uint stride) {
    uint groups = (tiles + gl_WorkGroupSize.x - 1) / gl_WorkGroupSize.x;
    uint group = listed_tile(gl_WorkGroupID);
    return group < groups ? group * stride % groups * gl_WorkGroupSize.x + gl_LocalInvocationID.x : tiles;
}
#endif
