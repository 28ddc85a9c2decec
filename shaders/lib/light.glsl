// Punctual lights (lecture R3, R4; KHR_lights_punctual).
#ifndef LIGHT_GLSL
#define LIGHT_GLSL

// A point light is never nearer than this, in metres: irradiance stays finite at r = 0 (numerics.md 32).
const float LIGHT_RADIUS = 1e-6;

// Irradiance per unit intensity on a surface that faces the light: 1/r², ended smoothly at `range`
// (KHR_lights_punctual): max(min(1 − (r / range)⁴, 1), 0) / r². inv_range2 = 0 means no range.
float point_falloff(float r2, float inv_range2) {
    float x = r2 * inv_range2;
    return clamp(1.0 - x * x, 0.0, 1.0) / max(r2, LIGHT_RADIUS * LIGHT_RADIUS);
}

// Share of a spot light's intensity at angle θ from its axis: the square of a ramp in cosθ between the two cones.
float spot_share(float cos_angle, float scale, float offset) {
    float ramp = clamp(cos_angle * scale + offset, 0.0, 1.0);
    return ramp * ramp;
}
#endif
