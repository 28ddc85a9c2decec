// The table of lights, which shaders read as texels (lib/light_table.glsl).
#ifndef SHARE_LIGHT_GLSL
#define SHARE_LIGHT_GLSL

struct Light {
    vec3 position;         // from the eye; of a directional light the direction to it
    float range;           // metres; negative: the light reaches everywhere
    vec3 color;            // cd, or lx of a directional light
    float inv_range2;      // 1 / range²; 0 for none
    vec3 axis;             // of a spot light
    float spot_scale;      // the ramp between its cones is spot_scale cosθ + spot_offset
    float spot_offset;
    float shape;           // SHAPE_...
    float extent;          // its radius, or half its height
    float pad_shape;
    vec3 across;           // half its side across
    float pad_across;
    float first_map;       // texel of its first shadow map
    float maps;            // 1 or 6
    float infinite_far; // 1: depth of its maps is near/z; 0: it lies between planes around the scene
    float pad_map;
};
#endif
