// Shadow rays in memory between two dispatches, by pixel.
// Where to read: lib/path_steps.glsl.
#ifndef PATH_SHADOW_RAY_GLSL
#define PATH_SHADOW_RAY_GLSL
#include "lib/path.glsl"
#include "lib/path_steps.glsl"

layout(pass, scalar) buffer ShadowDirections { uvec4 shadow_directions[]; };        // to_light, t_max
layout(pass, scalar) buffer ShadowContributions { vec3 shadow_contributions[]; };
layout(pass, scalar) buffer ShadowMedia { uvec4 shadow_media[]; };

void store_shadow_ray(ShadowRay shadow_ray, uint pixel) {
    hits[pixel] = uvec4(floatBitsToUint(shadow_ray.origin), shadow_ray.source_face);
    shadow_directions[pixel] = uvec4(floatBitsToUint(shadow_ray.to_light), floatBitsToUint(shadow_ray.t_max));
    shadow_contributions[pixel] = shadow_ray.contribution;
    if (KEEPS_MEDIA) shadow_media[pixel] = shadow_ray.media;
}

ShadowRay shadow_ray_of(uint pixel) {
    uvec4 a = hits[pixel];
    uvec4 b = shadow_directions[pixel];
    ShadowRay shadow_ray;
    shadow_ray.origin = uintBitsToFloat(a.xyz);
    shadow_ray.source_face = a.w;
    shadow_ray.to_light = uintBitsToFloat(b.xyz);
    shadow_ray.t_max = uintBitsToFloat(b.w);
    shadow_ray.contribution = shadow_contributions[pixel];
    shadow_ray.media = trace_terms.camera_media;
    if (KEEPS_MEDIA) shadow_ray.media = shadow_media[pixel];
    return shadow_ray;
}
#endif
