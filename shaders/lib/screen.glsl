// The picture as a scene: a ray marched through the G-buffer's depth, pixel by pixel (McGuire and Mara, JCGT 3(4) 2014).
#ifndef SCREEN_GLSL
#define SCREEN_GLSL
#include "lib/lighting.glsl"
#include "lib/screen_piece.glsl"
#include "lib/work_tile.glsl"

layout(pass, scalar) readonly buffer Seen { vec4 seen[]; };                     // radiance of the surfaces, pixel by pixel
layout(pass, scalar) readonly buffer NearestPieces { float nearest_pieces[]; }; // nearest z of each work tile (pass/screen_tiles.comp)

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
// The ray is a straight line in x, y and z of the screen. It meets the piece of a plane that a pixel holds where its distance
// in front of that falls through 0 within the step. Pieces of a curved surface do not join: between two steps the ray may pass
// from the front of one to behind the next, which counts where they differ by no more than the width of a pixel and what the
// flatter one's slope makes of it. A piece that does not join the one before is an outline: it goes no deeper than the pixel
// is wide, whatever its slope. That is all the thickness there is: how deep a surface goes the picture does not tell, and a
// ray that comes to lie behind it without having met it passes. Tiles that lie behind the ray are crossed in two steps.
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
    int tiles_across = int(camera.size.x + WORK_TILE - 1) / int(WORK_TILE);
    vec2 pixels_by = by.xy * half_size;
    float last_front = 0.0; // of the piece before, at the end of its step
    float last_thickness = 0.0;
    bool behind = false;    // and farther than the thickness
    bool ends = false;
    int met = -1;
    float i = 1.0;
    while (i <= last && !ends) {
        vec3 at = start + by * i;
        vec2 place = (at.xy + 1.0) * half_size;
        ivec2 pixel = clamp(ivec2(floor(place)), ivec2(0), ivec2(camera.size) - 1);
        // A step is half a pixel to either side; the first one begins where the ray does.
        float begins = i == 1.0 ? 1.0 : 0.5;

        ivec2 tile = pixel / int(WORK_TILE);
        vec2 edge = vec2(tile * int(WORK_TILE)) + mix(vec2(0.0), vec2(WORK_TILE), greaterThan(pixels_by, vec2(0.0)));
        vec2 to_edge = mix(vec2(LARGEST), (edge - place) / pixels_by, greaterThan(abs(pixels_by), vec2(1e-6)));
        float more = clamp(floor(min(to_edge.x, to_edge.y)), 0.0, float(WORK_TILE));
        float farthest = min(at.z - by.z * begins, at.z + by.z * (more + 0.5));
        bool free = more >= 1.0 && farthest > nearest_pieces[tile.y * tiles_across + tile.x];

        ScreenPiece piece = screen_piece(pixel);
        vec2 centre = (vec2(pixel) + 0.5) / half_size - 1.0;
        float front = at.z - piece.z - dot(piece.slope, at.xy - centre);
        float rise = by.z - dot(piece.slope, by.xy);
        float before = front - begins * rise;
        float after = front + 0.5 * rise;
        bool drawn = piece.z > 0.0 && !free;
        bool joins = last_front >= 0.0 && abs(last_front - before) <= min(piece.thickness, last_thickness);
        float z_met = at.z + by.z * (before / max(before - after, 1e-30) * (begins + 0.5) - begins);
        bool outline = before >= 0.0 && abs(z_met - piece.z) <= piece.width;
        bool hits = drawn && rise < 0.0 && after <= 0.0 && (joins || outline);
        bool from_behind = drawn && behind && before < 0.0 && after >= 0.0;
        met = hits ? pixel.y * int(camera.size.x) + pixel.x : -1;
        ends = hits || from_behind;
        behind = drawn && after < -piece.thickness;
        last_front = after;
        last_thickness = drawn ? piece.thickness : 0.0;
        i += free ? more : 1.0;
    }
    return met;
}

// What changes where a share of light comes from the screen and not from the environment, along the mirrored ray.
vec3 screen_instead(Surface s, vec3 n, float alpha, vec3 share) {
    vec3 r = reflect_ray(-s.v, n).R;
    bool looks = largest(share) > 0.0 && dot(r, s.n_triangle) > 0.0;
    int met = looks ? met_on_screen(s.p_rel, r) : -1;
    vec3 before = REFLECTION ? prefiltered_radiance(r, alpha) : vec3(0.0);
    return met >= 0 ? share * (seen[met].rgb - before) : vec3(0.0);
}

// What `environment_light` mirrors, corrected where the surface is smooth and the mirrored ray meets something.
vec3 mirrored_on_screen(Surface s, bool wanted) {
    float shown = wanted && !s.unlit ? s.occlusion : 0.0;
    float by_base = s.roughness <= ROUGHEST_MIRROR ? (CLEARCOAT ? under_coat(s) : 1.0) * shown : 0.0;
    vec3 result = screen_instead(s, s.n, s.alpha, albedo_of_base(s, lobe_reflectance(s)).base * by_base);
    if (CLEARCOAT) {
        float by_coat = s.clearcoat_roughness <= ROUGHEST_MIRROR ? albedo_of_coat(s) * shown : 0.0;
        result += screen_instead(s, s.n_coat, s.clearcoat_alpha, vec3(by_coat));
    }
    return result;
}

// What is taken away again leaves its rounding; what is no number stays none.
vec3 not_negative(vec3 v) {
    return mix(v, vec3(0.0), lessThan(v, vec3(0.0)));
}
#endif
