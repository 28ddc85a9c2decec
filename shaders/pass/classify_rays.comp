// Which 8x8 tiles hold surfaces that call for rays: mirrors and what lets light through. A list and the size of the
// dispatch over it; tiles are listed in whatever order they are found, each writes only its own pixels.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
#include "lib/surface.glsl"
#include "lib/work_tile.glsl"

layout(constant_id = 51) const bool TRANSMISSIVE = false;

layout(set = 0, binding = 1, r32f) readonly uniform imageBuffer depth;
layout(set = 0, binding = 2, rg32ui) readonly uniform uimage2D ids;
layout(scalar, set = 0, binding = 3) buffer Sizes { WorkSize rays_size; };
layout(scalar, set = 0, binding = 4) writeonly buffer RayTiles { uint ray_tiles[]; };
layout(push_constant, scalar) uniform Push { uvec2 size; uint stride; };

void main() {
    uvec2 tiles = (size + WORK_TILE - 1) / WORK_TILE;
    uint tile = scattered_tile(tiles.x * tiles.y, stride);
    if (tile >= tiles.x * tiles.y) return;
    uvec2 first = uvec2(tile % tiles.x, tile / tiles.x) * WORK_TILE;
    uvec2 last = min(first + WORK_TILE, size);
    bool calls = false;
    for (uint y = first.y; y < last.y; y++) {
        for (uint x = first.x; x < last.x; x++) {
            bool drawn = imageLoad(depth, int(y * size.x + x)).x > 0.0;
            uint id = drawn ? imageLoad(ids, ivec2(x, y)).x : 0u;
            Material m = material_at(id & 0xffffu);
            float roughness = max(float(id >> 16) * (1.0 / 65535.0) * m.roughness, MIN_ROUGHNESS);
            bool mirrors = MIRROR_RAYS && (m.flags & MATERIAL_MIRRORS) != 0 && roughness <= ROUGHEST_MIRROR;
            mirrors = mirrors || (CLEARCOAT && MIRROR_RAYS && m.clearcoat > 0.0);
            calls = calls || (drawn && (mirrors || (TRANSMISSIVE && m.transmission > 0.0)));
        }
    }
    if (calls) {
        APPEND_TILE(rays_size, place);
        ray_tiles[place] = packed_tile(first);
    }
}
