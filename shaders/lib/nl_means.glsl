// Denoising by non-local means: a pixel becomes the mean of those around it that differ from it by no more than noise.
// Pixels are compared with all pixels around them, so a pixel of texture or of an edge finds its like where single pixels are lost
// in noise. There are two pictures, of even and of odd samples. Each is filtered by weights of the other one, so that no
// noise decides on its own weight, and their difference estimates the variance.
// 1. Compared is the radiance x as log(1 + 4 x): ratios of what is bright, about as an eye would, and a firefly is one pixel.
// 2. Variance v of a pixel: half of the squared difference of the two pictures, its mean over 5x5 pixels.
// 3. Distance of the pixels p and q: ((x_p − x_q)² − (v_p + min(v_p, v_q))) / (k² (v_p + v_q)), the mean over 3x3 pixels. Of a
//    squared difference v_p + v_q is noise; min keeps a very noisy pixel from being like any other.
// 4. Weight: exp(−max(distance, 0)), times 4 v over the own variance of q where that is less than 1: what is far noisier than
//    the pixels around it, a firefly, would make a square of light.
// Without noise a pixel is averaged with equals alone, so it keeps its value; with more samples the picture converges.
// Where to read: Buades, Coll and Morel 2005 (non-local means); Rousselle, Knaus and Zwicker 2012 (variances, two buffers);
// docs/decisions/denoising.md.
#ifndef NL_MEANS_GLSL
#define NL_MEANS_GLSL

const int NL_REACH = 3;          // pixels in each direction from which a pixel takes light
const int NL_PATCH = 9;          // pixels that are compared: 3x3
const int NL_VARIANCE_REACH = 2; // pixels in each direction of the mean of variances
const float NL_TOLERANCE = 0.6;  // k
const float NL_OUTLIER = 4.0;    // own variance, in units of that around it, above which a pixel counts less
// Against 0/0 where nothing is noise: there equals have distance 0, and all else is far away.
const float NL_LEAST_VARIANCE = 1e-20;
// Variance of a pixel of which a half is not finite: it stays as it is, to be counted, and no other one takes of it. By bits, as a
// compiler may assume that there is none.
const float NL_NOT_FINITE = -1.0;
const uint NL_INFINITY_BITS = 0x7f800000u;
bool nl_is_finite(vec3 x) {
    return all(lessThan(floatBitsToUint(x) & 0x7fffffffu, uvec3(NL_INFINITY_BITS)));
}

// What pixels are compared by.
vec3 log_radiance(vec3 radiance) {
    return log(1.0 + 4.0 * max(radiance, 0.0));
}

// Variance in a pixel by the two halves.
float variance_of_halves(vec3 a, vec3 b) {
    return 0.5 * dot(a - b, a - b);
}

// One pixel's part of a distance.
float nl_distance(vec3 p, vec3 q, float v_p, float v_q) {
    float noise = v_p + min(v_p, v_q);
    float scale = NL_TOLERANCE * NL_TOLERANCE * (v_p + v_q) + NL_LEAST_VARIANCE;
    return (dot(p - q, p - q) - noise) / scale;
}

// Factor on the weight of a pixel, by its own variance and the mean around it.
float nl_outlier_weight(float own, float around) {
    if (own == NL_NOT_FINITE) return 0.0;
    return own > NL_OUTLIER * around ? NL_OUTLIER * around / own : 1.0;
}

float nl_weight(float d) {
    return exp(-clamp(d, 0.0, 80.0));
}
#endif
