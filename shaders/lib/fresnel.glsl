// Fresnel reflectance (lecture F2, F3).
#ifndef FRESNEL_GLSL
#define FRESNEL_GLSL

// Schlick's approximation: F0 + (F90 − F0)(1 − cosθ)⁵. Multiplied out instead of pow: exact powers, and no NaN when a
// rounded dot product exceeds 1 (numerics.md 1).
vec3 fresnel_schlick(vec3 f0, float f90, float cos_in) {
    float m = clamp(1.0 - cos_in, 0.0, 1.0);
    float m2 = m * m;
    return f0 + (vec3(f90) - f0) * (m2 * m2 * m);
}

// Exact unpolarised reflectance of a dielectric of relative index n, without the cancellation near n = 1
// (numerics.md 2): with g = n cosθ_t = √(c² + n² − 1),
//   r_s = −(n² − 1) / (c + g)²,   r_p = (n² − 1)(c²(n² + 1) − 1) / (n²c + g)².
float fresnel_dielectric(float n, float cos_in) {
    float c = clamp(cos_in, 0.0, 1.0);
    float difference = (n - 1.0) * (n + 1.0);
    float g2 = c * c + difference;
    // Total internal reflection: no transmitted ray.
    if (g2 <= 0.0) return 1.0;
    float g = sqrt(g2);
    float s = c + g;
    float p = n * n * c + g;
    float r_s = -difference / (s * s);
    float r_p = difference * (c * c * (n * n + 1.0) - 1.0) / (p * p);
    return min(0.5 * (r_s * r_s + r_p * r_p), 1.0);
}
#endif
