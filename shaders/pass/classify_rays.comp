// Tile classification: the 8x8 tiles with surfaces that send rays, reflective or transmissive, and their indirect dispatch.
// The order of the list is arbitrary: each tile writes only its own pixels. Where to read: docs/decisions/work-tiles.md.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
#include "lib/gbuffer.glsl"
#include "lib/surface.glsl"
#include "lib/own_tiles.glsl"

// Which surfaces the dispatch looks for.
layout(constant) const bool FIND_MIRRORS = false;
layout(constant) const bool FIND_TRANSMISSIVE = false;

layout(pass, scalar) buffer Sizes { WorkSize rays_size; };
layout(pass, scalar) writeonly buffer RayTiles { uint ray_tiles[]; };
layout(push_constant, scalar) uniform Push { uint stride; };

void main() {
    uint turn = scattered_tile(own_tiles(), stride);
    if (turn >= own_tiles()) return;
    uvec2 first = own_tile(turn);
    uvec2 last = min(first + WORK_TILE, camera.size);
    bool calls = false;
    for (uint y = first.y; y < last.y; y++) {
        for (uint x = first.x; x < last.x; x++) {
            bool drawn = stored_depth(pixel_index(ivec2(x, y))) > 0.0;
            uint id = drawn ? imageLoad(ids, ivec2(x, y)).x : 0u;
            Material m = material_at(id & 0xffffu);
            float roughness = max(float(id >> 16) * (1.0 / 65535.0) * m.roughness, MIN_ROUGHNESS);
            bool mirrors = FIND_MIRRORS && (m.flags & MATERIAL_MIRRORS) != 0 && roughness <= ROUGHEST_MIRROR;
            mirrors = mirrors || (CLEARCOAT && FIND_MIRRORS && m.clearcoat > 0.0);
            calls = calls || (drawn && (mirrors || (FIND_TRANSMISSIVE && m.transmission > 0.0)));
        }
    }
    if (calls) {
        APPEND_TILE(rays_size, place);
        ray_tiles[place] = packed_pixel(first);
    }
}
