// The picture as a scene: a ray marched through the G-buffer's depth, pixel by pixel (McGuire and Mara, JCGT 3(4) 2014).
// Expects `camera`, the G-buffer's `depth` and `normals`, and the radiance of its surfaces, `seen`.
#ifndef SCREEN_GLSL
#define SCREEN_GLSL
#include "lib/camera.glsl"
#include "lib/encode.glsl"
#include "lib/lighting.glsl"

// A step is a pixel along the longer axis, so the longer side of a picture bounds them: 16,384 where loops are limited to
// 65,535 heads, and a surface marches twice at most, for its base and its coat.
const float MOST_PIXELS = 16384.0;
const float AT_INFINITY = 1e18;

// Where a + b t, not negative at t = 0, becomes so.
float until_negative(float a, float b) {
    return b < 0.0 ? max(a, 0.0) / -b : LARGEST;
}

// Pixel (row by row) where a ray from a surface first meets one that the picture shows, or -1: where it leaves the picture
// or the depth range, passes behind everything, or meets a surface from the side that is turned away.
//
// Reversed depth is 1/w times a constant, or linear where the view is parallel, so ray and planes are straight in x, y and z
// of the screen. A pixel holds a piece of a plane, by its depth and the normal of its triangle; the ray meets it where its
// distance in front of that plane falls through 0 within the step. Pieces of a curved surface do not join: between two steps
// the ray may pass from the front of one to behind the next, which counts where they differ by no more than the width of a
// pixel and what the slope of the second makes of it. That is all the thickness there is: how deep a surface goes the picture
// does not tell, and a ray that comes to lie behind it without having met it passes.
int met_on_screen(vec3 p_rel, vec3 direction) {
    vec4 from = camera.clip_from_rel * vec4(p_rel, 1.0);
    vec4 along = camera.clip_from_rel * vec4(direction, 0.0);
    float t = min(until_negative(from.z, along.z), until_negative(from.w - from.z, along.w - along.z));
    t = min(t, min(until_negative(from.w + from.x, along.w + along.x), until_negative(from.w - from.x, along.w - along.x)));
    t = min(t, min(until_negative(from.w + from.y, along.w + along.y), until_negative(from.w - from.y, along.w - along.y)));
    vec4 to = t < AT_INFINITY ? from + along * t : along;
    vec3 start = from.xyz / from.w;
    vec3 way = to.xyz / to.w - start;
    vec2 half_size = 0.5 * vec2(camera.size);
    float steps = max(abs(way.x) * half_size.x, abs(way.y) * half_size.y);
    // Less than a pixel: towards the eye or away from it.
    vec3 by = way / max(steps, 1.0);
    float last = steps >= 1.0 ? min(ceil(steps), MOST_PIXELS) : 0.0;
    bool parallel = camera.orthographic != 0;
    float pixel_width = length(camera.up) / half_size.y;
    float last_front = 0.0; // of the piece before, at the end of its step
    bool behind = false;    // and farther than the thickness
    bool ends = false;
    int met = -1;
    for (float i = 1.0; i <= last && !ends; i += 1.0) {
        loop_heads++;
        vec3 at = start + by * i;
        ivec2 pixel = clamp(ivec2(floor((at.xy + 1.0) * half_size)), ivec2(0), ivec2(camera.size) - 1);
        int index = pixel.y * int(camera.size.x) + pixel.x;
        float z = imageLoad(depth, index).x;
        vec3 n = unit_from_octahedral(imageLoad(normals, pixel).zw);
        // How z of the piece grows with x and y: the viewing ray through (x, y) meets its plane at 1/w ~ n·v(x, y).
        vec2 ndc = ndc_from_pixel(camera, pixel);
        vec3 v = parallel ? camera.forward : camera.forward + camera.right * ndc.x - camera.up * ndc.y;
        float scale = parallel ? 1.0 / (camera.far - camera.near) : z;
        vec2 slope = vec2(dot(n, camera.right), -dot(n, camera.up)) * (scale / min(dot(n, v), -1e-6));
        vec2 centre = (vec2(pixel) + 0.5) / half_size - 1.0;
        float front = at.z - z - dot(slope, at.xy - centre);
        float rise = by.z - dot(slope, by.xy);
        // A step is half a pixel to either side; the first one begins where the ray does.
        float before = front - (i == 1.0 ? 1.0 : 0.5) * rise;
        float after = front + 0.5 * rise;
        float thickness = abs(slope.x) / half_size.x + abs(slope.y) / half_size.y + scale * pixel_width;
        bool drawn = z > 0.0;
        bool joins = before < 0.0 && last_front >= 0.0 && last_front - before <= thickness;
        bool hits = drawn && rise < 0.0 && after <= 0.0 && (before >= 0.0 || joins);
        bool from_behind = drawn && behind && before < 0.0 && after >= 0.0;
        met = hits ? index : -1;
        ends = hits || from_behind;
        behind = drawn && after < -thickness;
        last_front = drawn ? after : LARGEST;
    }
    return met;
}

// What changes where a share of light comes from the screen and not from the environment, along the mirrored ray.
vec3 screen_instead(Surface s, vec3 n, float alpha, vec3 share) {
    vec3 r = reflect_ray(-s.v, n).R;
    bool looks = largest(share) > 0.0 && dot(r, s.n_triangle) > 0.0;
    int met = looks ? met_on_screen(s.p_rel, r) : -1;
    vec3 before = REFLECTION ? prefiltered_radiance(r, alpha) : vec3(0.0);
    return met >= 0 ? share * (imageLoad(seen, met).rgb - before) : vec3(0.0);
}

// What `environment_light` mirrors, corrected where the surface is smooth and the mirrored ray meets something.
vec3 mirrored_on_screen(Surface s, bool wanted) {
    compensate(s);
    float shown = wanted && !s.unlit ? s.occlusion : 0.0;
    float by_base = s.roughness <= ROUGHEST_MIRROR ? (CLEARCOAT ? under_coat(s) : 1.0) * shown : 0.0;
    vec3 result = screen_instead(s, s.n, s.alpha, mirrored_by_base(s) * by_base);
    if (CLEARCOAT) {
        float by_coat = s.clearcoat_roughness <= ROUGHEST_MIRROR ? mirrored_by_coat(s) * shown : 0.0;
        result += screen_instead(s, s.n_coat, s.clearcoat_alpha, vec3(by_coat));
    }
    return result;
}

// What is taken away again leaves its rounding; what is no number stays none.
vec3 not_negative(vec3 v) {
    return mix(v, vec3(0.0), lessThan(v, vec3(0.0)));
}
#endif
