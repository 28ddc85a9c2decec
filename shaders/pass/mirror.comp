// Screen-space reflection over the tiles with smooth surfaces.
// Where the reflected ray hits a surface on the screen, its radiance replaces the environment's, which lighting has added.
// Where to read: McGuire and Mara, JCGT 3(4) 2014; docs/decisions/screen-space.md.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/primary.glsl"
#include "lib/screen.glsl"
#include "lib/work_tile.glsl"

layout(pass, rgba32f) uniform image2D radiance;
layout(pass, scalar) readonly buffer MirrorTiles { uint mirror_tiles[]; };
layout(pass, scalar) readonly buffer Sizes { WorkSize mirrors_size; } work;

LightSample drawn_apart() {
    return NO_LIGHT_SAMPLE;
}

void main() {
    uint place = listed_tile(gl_WorkGroupID);
    if (place >= work.mirrors_size.count) return;
    ivec2 pixel = unpacked_pixel(mirror_tiles[place]) + ivec2(gl_LocalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(pixel), camera.size))) return;
    Primary primary = primary_surface(pixel, false);
    if (!primary.drawn) return;
    primary.hit.s.lobe = lobe_reflectance(primary.hit.s);
    vec3 changed = mirrored_on_screen(primary.hit.s, true);
    if (changed == vec3(0.0)) return;
    vec4 before = imageLoad(radiance, pixel);
    imageStore(radiance, pixel, vec4(not_negative(before.rgb + changed), before.a));
}
