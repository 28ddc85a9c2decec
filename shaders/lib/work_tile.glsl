// Tiles of 8x8 pixels as units of work: one workgroup each, dispatched indirectly over a list.
#ifndef WORK_TILE_GLSL
#define WORK_TILE_GLSL

const uint WORK_TILE = 8;

// VkDispatchIndirectCommand.
struct DispatchSize {
    uint x;
    uint y;
    uint z;
};

uint packed_tile(uvec2 first_pixel) {
    return first_pixel.x | first_pixel.y << 16;
}

ivec2 first_pixel(uint packed) {
    return ivec2(packed & 0xffffu, packed >> 16);
}
#endif
