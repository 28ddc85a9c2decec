// A pixel of the G-buffer as a piece of a plane in screen space, for screen-space ray marching.
// Where to read: docs/decisions/screen-space.md. Assumes: normalised device coordinates, reversed depth, geometric normals.
#ifndef SCREEN_PIECE_GLSL
#define SCREEN_PIECE_GLSL
#include "lib/encode.glsl"
#include "lib/gbuffer.glsl"

struct ScreenPiece {
    float z;         // reversed depth at the pixel's centre; 0 where nothing was drawn
    vec2 slope;      // change of z per unit of x and y
    float width;     // width of the pixel at that depth, in z
    float thickness; // width, plus the range of z that the plane spans over the pixel
};

// Reversed depth is 1/w times a constant, or linear in an orthographic view. So planes stay planes in x, y and z of the
// screen: the viewing ray through (x, y) meets this one at 1/w ~ n·v(x, y).
ScreenPiece screen_piece(ivec2 pixel) {
    ScreenPiece r;
    r.z = stored_depth(pixel_index(pixel));
    vec3 n = unit_from_octahedral(stored_normals(pixel).zw);
    bool parallel = camera.orthographic != 0;
    vec2 ndc = ndc_from_pixel(camera, pixel);
    vec3 v = parallel ? camera.forward : camera.forward + camera.right * ndc.x - camera.up * ndc.y;
    float scale = parallel ? 1.0 / (camera.far - camera.near) : r.z;
    r.slope = vec2(dot(n, camera.right), -dot(n, camera.up)) * (scale / min(dot(n, v), -1e-6));
    vec2 per_pixel = 2.0 / vec2(camera.size);
    r.width = scale * (length(camera.up) * per_pixel.y);
    r.thickness = r.width + dot(abs(r.slope), per_pixel);
    return r;
}
#endif
