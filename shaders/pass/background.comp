// What lies behind the scene, over the tiles where it is seen: the environment, or nothing.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/camera.glsl"
#include "lib/encode.glsl"
#include "lib/spectrum.glsl"
#include "lib/work_tile.glsl"
#include "share/environment.glsl"

layout(constant_id = 0) const bool SKY = false;

layout(scalar, set = 0, binding = 0) uniform CameraBlock { Camera camera; };
layout(set = 0, binding = 1, r32f) readonly uniform imageBuffer depth;
layout(set = 0, binding = 2, rgba32f) writeonly uniform image2D radiance;
layout(scalar, set = 0, binding = 3) readonly buffer BackgroundTiles { uint background_tiles[]; };
layout(scalar, set = 0, binding = 4) uniform Environment { EnvironmentTerms environment; };
layout(set = 0, binding = 5) uniform sampler2D sky;
layout(scalar, set = 0, binding = 6) readonly buffer Sizes { WorkSize surface_size; WorkSize background_size; } work;

void main() {
    uint place = listed_tile(gl_WorkGroupID);
    if (place >= work.background_size.count) return;
    ivec2 pixel = first_pixel(background_tiles[place]) + ivec2(gl_LocalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(pixel), camera.size))) return;
    if (imageLoad(depth, pixel.y * int(camera.size.x) + pixel.x).x != 0.0) return;
    vec4 result = vec4(0.0);
    if (SKY) {
        vec3 d = turned(view_direction(camera, pixel), environment.cos_rotation, environment.sin_rotation);
        result = vec4(light_of_rgb(textureLod(sky, equirectangular_from_direction(d), 0.0).rgb * environment.intensity), 1.0);
    }
    imageStore(radiance, pixel, result);
}
