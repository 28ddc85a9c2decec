// Light samples and shadow rays in memory between two dispatches, by pixel.
// Where to read: lib/path_steps.glsl.
#ifndef PATH_SHADOW_RAY_GLSL
#define PATH_SHADOW_RAY_GLSL
#include "lib/path.glsl"
#include "lib/path_steps.glsl"

layout(pass, scalar) buffer ShadowDirections { uvec4 shadow_directions[]; };        // to_light, t_max
layout(pass, scalar) buffer ShadowContributions { uvec4 shadow_contributions[]; };  // contribution; of a light sample arriving, pdf
layout(pass, scalar) buffer ShadowMedia { uvec4 shadow_media[]; };                  // media; of a photon to_light, arriving

// The first light sample of a vertex, and the photon near it, wait where its shadow ray will.
void store_light(LightSample light, uint pixel) {
    shadow_directions[pixel] = uvec4(floatBitsToUint(light.to_light), floatBitsToUint(light.t_max));
    shadow_contributions[pixel] = uvec4(floatBitsToUint(light.arriving), floatBitsToUint(light.pdf));
}

LightSample stored_light(uint pixel) {
    uvec4 a = shadow_directions[pixel];
    uvec4 b = shadow_contributions[pixel];
    return LightSample(uintBitsToFloat(a.xyz), uintBitsToFloat(a.w), uintBitsToFloat(b.xyz), uintBitsToFloat(b.w));
}

void store_photon(PhotonSample photon, uint pixel) {
    shadow_media[pixel] = uvec4(photon.to_light, floatBitsToUint(photon.arriving));
}

PhotonSample stored_photon(uint pixel) {
    uvec4 a = shadow_media[pixel];
    return PhotonSample(a.x, uintBitsToFloat(a.yzw));
}

void store_shadow_ray(ShadowRay shadow_ray, uint pixel) {
    hits[pixel] = uvec4(floatBitsToUint(shadow_ray.origin), shadow_ray.source_face);
    shadow_directions[pixel] = uvec4(floatBitsToUint(shadow_ray.to_light), floatBitsToUint(shadow_ray.t_max));
    shadow_contributions[pixel].xyz = floatBitsToUint(shadow_ray.contribution);
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
    shadow_ray.contribution = uintBitsToFloat(shadow_contributions[pixel].xyz);
    shadow_ray.media = trace_terms.camera_media;
    if (KEEPS_MEDIA) shadow_ray.media = shadow_media[pixel];
    return shadow_ray;
}
#endif
