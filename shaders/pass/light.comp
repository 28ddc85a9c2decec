// Deferred lighting: the radiance of each pixel's nearest opaque surface, over the tiles that have one.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/camera.glsl"
#include "lib/lighting.glsl"
#include "lib/work_tile.glsl"

layout(constant_id = 0) const bool HAS_EMISSIVE = false;
layout(constant_id = 1) const bool HAS_LAYERS = false;

layout(scalar, set = 0, binding = 0) uniform CameraBlock { Camera camera; };
layout(scalar, set = 0, binding = 1) readonly buffer Materials { Material materials[]; };
layout(set = 0, binding = 2, r32f) readonly uniform imageBuffer depth;
layout(set = 0, binding = 3, rgba16f) readonly uniform image2D base;
layout(set = 0, binding = 4, rgba16_snorm) readonly uniform image2D normals;
layout(set = 0, binding = 5, rg32ui) readonly uniform uimage2D ids;
layout(set = 0, binding = 6, rgba16f) readonly uniform image2D emissive;
layout(set = 0, binding = 7, rgba16) readonly uniform image2D layers;
layout(set = 0, binding = 8, rgba32f) writeonly uniform image2D radiance;
layout(scalar, set = 0, binding = 9) readonly buffer SurfaceTiles { uint surface_tiles[]; };
layout(scalar, set = 0, binding = 10) readonly buffer Sizes { WorkSize surface_size; WorkSize background_size; } work;

void main() {
    uint place = listed_tile(gl_WorkGroupID);
    if (place >= work.surface_size.count) return;
    ivec2 pixel = first_pixel(surface_tiles[place]) + ivec2(gl_LocalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(pixel), camera.size))) return;
    float z = imageLoad(depth, pixel.y * int(camera.size.x) + pixel.x).x;
    if (z == 0.0) return;
    uvec2 id = imageLoad(ids, pixel).xy;
    vec4 texel = imageLoad(base, pixel);
    vec3 glow = HAS_EMISSIVE ? imageLoad(emissive, pixel).rgb : vec3(1.0);
    vec3 n = unit_from_octahedral(imageLoad(normals, pixel).xy);
    vec3 layer = vec3(1.0);
    vec3 n_coat = n;
    if (HAS_LAYERS) {
        vec4 packed_value = imageLoad(layers, pixel);
        layer = layers_from_packed(packed_value);
        n_coat = coat_normal_from_packed(packed_value);
    }
    float roughness = float(id.x >> 16) * (1.0 / 65535.0);
    float occlusion = float(id.y >> 24) * (1.0 / 255.0);
    Surface s = surface_from_texels(materials[id.x & 0xffffu], texel.rgb, texel.a, roughness, occlusion, glow, layer, n, n_coat,
                                    -view_direction(camera, pixel), rel_from_pixel(camera, pixel, z));
    uint tiles_across = (camera.size.x + TILE - 1) / TILE;
    imageStore(radiance, pixel, vec4(radiance_to_eye(s, pixel, tiles_across), 1.0));
}
