// Tiled light culling, step 2: which point and spot lights reach which 16x16 tile, as a bit mask per tile.
// One invocation handles a tile and a word of 32 lights. It tests the sphere of each light against the tile's four side
// planes and its range of depths. A bit mask cannot overflow and has one order. Where to read: RTR 4, section 20.3;
// docs/decisions/light-lists.md.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
#include "lib/view.glsl"
#include "lib/light_table.glsl"
#include "lib/light_tile.glsl"
#include "lib/work_tile.glsl"

layout(pass, rg32f) readonly uniform imageBuffer tile_depths;
layout(pass, scalar) writeonly buffer TileLights { uint tile_lights[]; };
layout(push_constant, scalar) uniform Push { uint first; uint count; uint words; uint tiles_across; uint tiles; };

void main() {
    uint job = listed_tile(gl_WorkGroupID) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    if (job >= tiles * words) return;
    uint tile = job / words;
    uint word = job - tile * words;
    vec2 range = imageLoad(tile_depths, int(tile)).xy; // nearest and farthest view depth; empty where nothing was drawn
    uint bits = 0;
    if (range.x <= range.y) {
        ivec2 corner = ivec2(tile % tiles_across, tile / tiles_across) * int(TILE);
        // The side planes, as displacements of the viewing ray at the tile's borders, half a pixel wider than any sample of
        // the tile.
        vec2 scale = 2.0 / vec2(camera.size);
        vec2 low = (vec2(corner) - 0.5) * scale - 1.0;
        vec2 high = (vec2(corner + int(TILE)) + 0.5) * scale - 1.0;
        bool parallel = camera.orthographic != 0;
        vec3 r = camera.right;
        vec3 u = -camera.up;
        vec3 f = camera.forward;
        float r2 = dot(r, r);
        float u2 = dot(u, u);
        for (uint i = 0; i < 32; i++) {
            uint index = word * 32 + i;
            if (index >= count) break;
            Light light = light_at(first + index);
            float radius = light.range; // negative: unlimited
            bool hit = radius < 0.0;
            if (!hit) {
                float z = dot(light.position, f);
                float x = dot(light.position, r) / r2;
                float y = dot(light.position, u) / u2;
                float w = parallel ? 1.0 : z;
                // Signed distances to the planes x = low.x w …: their normals are not unit vectors, so the radius is scaled
                // instead.
                float rx = radius * (parallel ? 1.0 : sqrt(1.0 + r2 * max(low.x * low.x, high.x * high.x))) * inversesqrt(r2);
                float ry = radius * (parallel ? 1.0 : sqrt(1.0 + u2 * max(low.y * low.y, high.y * high.y))) * inversesqrt(u2);
                hit = z + radius >= range.x && z - radius <= range.y && x - low.x * w >= -rx && high.x * w - x >= -rx &&
                      y - low.y * w >= -ry && high.y * w - y >= -ry;
            }
            if (hit) bits |= 1u << i;
        }
    }
    tile_lights[job] = bits;
}
