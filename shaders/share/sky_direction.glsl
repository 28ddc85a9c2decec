// Directions in which rays of ambient occlusion look at the environment.
#ifndef SHARE_SKY_DIRECTION_GLSL
#define SHARE_SKY_DIRECTION_GLSL
struct SkyDirection {
    vec3 direction; // world axes
    vec3 weight;    // radiance times solid angle of its region, times the number of directions
    float solid_angle; // of the region, times the number of directions
};
#endif
