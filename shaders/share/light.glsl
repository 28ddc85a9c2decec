// Punctual and analytic area lights, as texels of a table (lib/light_table.glsl).
// Where to read: KHR_lights_punctual. Assumes: positions relative to the eye, metres.
#ifndef SHARE_LIGHT_GLSL
#define SHARE_LIGHT_GLSL

struct Light {
    vec3 position;         // relative to the eye; of a directional light the unit direction to it
    float range;           // metres; negative: unlimited
    vec3 color;            // cd, or lx of a directional light
    float inv_range2;      // 1 / range²; 0 for none
    vec3 axis;             // unit axis of a spot light, a disk or a rectangle
    float spot_scale;      // scale of the ramp between the cones, spot_scale cosθ + spot_offset
    float spot_offset;
    float shape;           // SHAPE_...
    float extent;          // radius of a sphere or disk; half the height of a rectangle
    float pad_shape;
    vec3 across;           // half the width of a rectangle, as a vector
    float pad_across;
    float first_map;       // texel of the first shadow map
    float maps;            // number of shadow maps: 1 or 6
    float infinite_far; // 1: depth of the shadow maps is near/z; 0: it is linear between planes around the scene
    float pad_map;
};
#endif
