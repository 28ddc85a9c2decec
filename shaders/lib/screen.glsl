// Screen-space ray marching: reflected rays through the depth of the G-buffer, pixel by pixel.
// Where to read: McGuire and Mara, JCGT 3(4) 2014; docs/decisions/screen-space.md. Assumes: normalised device coordinates
// with reversed depth, in which a ray is a straight line.
#ifndef SCREEN_GLSL
#define SCREEN_GLSL
#include "lib/lighting.glsl"
#include "lib/screen_piece.glsl"
#include "lib/work_tile.glsl"

layout(pass, scalar) readonly buffer Seen { vec4 seen[]; };                     // radiance of the surfaces, by pixel
layout(pass, scalar) readonly buffer NearestPieces { float nearest_pieces[]; }; // nearest z per 8x8 tile (pass/screen_tiles.comp)

// A step is one pixel along the longer axis, so the longer side of the picture bounds the steps: 16,384 where loops are
// limited to 65,535 iterations. A surface marches at most twice, for its base and its coat.
const float MOST_PIXELS = 16384.0;
const float AT_INFINITY = 1e18;

// The t at which a + b t, not negative at t = 0, becomes negative.
float until_negative(float a, float b) {
    return b < 0.0 ? max(a, 0.0) / -b : LARGEST;
}

// Screen-space reflection: the pixel (row by row) where a ray from a surface first hits a surface of the picture. -1 if it
// leaves the picture or the depth range, passes behind everything, or hits a surface from behind.
//
// 1. The ray is a straight line in x, y and z of the screen; each pixel holds a piece of a plane (lib/screen_piece.glsl).
// 2. A hit is where the ray's distance in front of the piece falls through 0 within the step.
// 3. Pieces of a curved surface do not join. Between two steps the ray may pass from the front of one to behind the next.
//    This counts as a hit where the gap is no larger than the thickness of the flatter piece: the width of a pixel and what
//    its slope spans.
// 4. A piece that does not join the one before it is an outline. It goes no deeper than the width of a pixel, whatever its
//    slope.
// 5. No other thickness is assumed, because the picture does not hold the depth of an object. A ray that is behind a
//    surface without having hit it passes.
// 6. Tiles whose surfaces all lie behind the ray are crossed in two steps.
int met_on_screen(vec3 p_rel, vec3 direction) {
    vec4 from = camera.clip_from_rel * vec4(p_rel, 1.0);
    vec4 along = camera.clip_from_rel * vec4(direction, 0.0);
    float t = min(until_negative(from.z, along.z), until_negative(from.w - from.z, along.w - along.z));
    // Clip the ray to the view volume: t of the nearest of its planes.
    t = min(t, min(until_negative(from.w + from.x, along.w + along.x), until_negative(from.w - from.x, along.w - along.x)));
    t = min(t, min(until_negative(from.w + from.y, along.w + along.y), until_negative(from.w - from.y, along.w - along.y)));
    vec4 to = t < AT_INFINITY ? from + along * t : along;
    vec3 start = from.xyz / from.w;
    vec3 way = to.xyz / to.w - start;
    vec2 half_size = 0.5 * vec2(camera.size);
    float steps = max(abs(way.x) * half_size.x, abs(way.y) * half_size.y);
    // Shorter than a pixel on the screen: the ray runs towards or away from the eye, and nothing is marched.
    vec3 by = way / max(steps, 1.0);
    float last = steps >= 1.0 ? min(ceil(steps), MOST_PIXELS) : 0.0;
    int tiles_across = int(camera.size.x + WORK_TILE - 1) / int(WORK_TILE);
    vec2 pixels_by = by.xy * half_size;
    float last_front = 0.0; // distance in front of the previous piece, at the end of its step
    float last_thickness = 0.0;
    bool behind = false;    // behind the piece by more than its thickness
    bool ends = false;
    int met = -1;
    float i = 1.0;
    while (i <= last && !ends) {
        vec3 at = start + by * i;
        vec2 place = (at.xy + 1.0) * half_size;
        ivec2 pixel = clamp(ivec2(floor(place)), ivec2(0), ivec2(camera.size) - 1);
        // A step reaches half a pixel to either side; the first one begins at the ray's origin.
        float begins = i == 1.0 ? 1.0 : 0.5;

        // Skip the rest of a tile if the ray stays in front of all its surfaces.
        ivec2 tile = pixel / int(WORK_TILE);
        vec2 edge = vec2(tile * int(WORK_TILE)) + mix(vec2(0.0), vec2(WORK_TILE), greaterThan(pixels_by, vec2(0.0)));
        vec2 to_edge = mix(vec2(LARGEST), (edge - place) / pixels_by, greaterThan(abs(pixels_by), vec2(1e-6)));
        float more = clamp(floor(min(to_edge.x, to_edge.y)), 0.0, float(WORK_TILE));
        float farthest = min(at.z - by.z * begins, at.z + by.z * (more + 0.5));
        bool free = more >= 1.0 && farthest > nearest_pieces[tile.y * tiles_across + tile.x];

        // Test the piece against the ray.
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

// The change of radiance where the reflected ray hits the picture: radiance of the hit pixel instead of the environment's.
vec3 screen_instead(Surface s, vec3 n, vec3 environment, vec3 share) {
    vec3 r = reflect_ray(-s.v, n).R;
    bool looks = largest(share) > 0.0 && dot(r, s.n_triangle) > 0.0;
    int met = looks ? met_on_screen(s.p_rel, r) : -1;
    return met >= 0 ? share * (seen[met].rgb - environment) : vec3(0.0);
}

// Correction of `environment_light` for smooth surfaces whose reflected rays hit the picture.
vec3 mirrored_on_screen(Surface s, bool wanted) {
    float shown = wanted && !s.unlit ? s.occlusion : 0.0;
    // What an anisotropic lobe sees of the environment is no single direction (lib/environment_light.glsl).
    bool is_round = !ANISOTROPY || !is_anisotropic(s);
    BaseAlbedo albedo = albedo_of_base(s);
    // The weight with which lib/environment_light.glsl has added the environment.
    float by_base = is_round && s.roughness <= ROUGHEST_MIRROR ? layer_albedo(s, albedo).under_coat * shown : 0.0;
    vec3 result = screen_instead(s, s.n, REFLECTION ? radiance_in_round_base_lobe(s) : vec3(0.0), albedo.base * by_base);
    if (CLEARCOAT) {
        float by_coat = s.clearcoat_roughness <= ROUGHEST_MIRROR ? albedo_of_coat(s) * shown : 0.0;
        result += screen_instead(s, s.n_coat, REFLECTION ? radiance_in_coat_lobe(s) : vec3(0.0), vec3(by_coat));
    }
    return result;
}

// Removes negative rounding errors of a subtraction; NaN stays NaN.
vec3 not_negative(vec3 v) {
    return mix(v, vec3(0.0), lessThan(v, vec3(0.0)));
}
#endif
