// Directions in which rays of ambient occlusion look at the environment, the same for all pixels.
#ifndef SHARE_SKY_DIRECTION_GLSL
#define SHARE_SKY_DIRECTION_GLSL
struct SkyDirection {
    vec3 direction; // world axes
    vec3 weight;    // radiance over the density of the direction
    float solid_angle; // 1 over that density
};
#endif
