// Where paths begin: at the eye, through a point of the pixel.
#ifndef PATH_BEGIN_GLSL
#define PATH_BEGIN_GLSL
#include "lib/own_tiles.glsl"
#include "lib/path_ray.glsl"

// The pixel that stands at a place of the first queue: tiles of 8x8 in strides over the picture, since lavapipe gives each of
// its threads one contiguous piece of a dispatch; within a tile in Morton order, so that neighbours in a queue are neighbours
// in the picture. One outside of the picture where a tile juts out.
uvec2 pixel_at(uint place, uint stride) {
    uint turn = place / 64 * stride % own_tiles();
    uint lane = place % 64;
    uvec2 within = uvec2(lane & 1u | lane >> 1 & 2u | lane >> 2 & 4u, lane >> 1 & 1u | lane >> 2 & 2u | lane >> 3 & 4u);
    return own_tile(turn) + within;
}

Path path_through(uvec2 pixel) {
    Camera c = camera;
    uvec2 words = dimension_words(pixel, 0, DIMENSION_PIXEL);
    c.jitter = vec2(unit_float(words.x), unit_float(words.y)) - 0.5;
    Path p;
    // From the near plane, as what is rasterised; what lies beyond an orthographic camera's far one is seen all the same.
    p.origin = trace_terms.bvh_from_rel + rel_from_pixel(c, ivec2(pixel), 1.0);
    p.direction = view_direction(c, ivec2(pixel));
    p.source_face = 0xffffffffu;
    p.pdf = 0.0;
    p.throughput = vec3(1.0);
    p.state = PATH_ALIVE | PATH_TRANSPARENT_SO_FAR | PATH_UNSCATTERED | packHalf2x16(vec2(0.0, 1.0));
    p.media = trace_terms.camera_media;
    p.distance_since_vertex = 0.0;
    p.t_min = 0.0;
    p.sum = vec3(0.0);
    return p;
}
#endif
