// Camera rays of path tracing: the first state of a path, through a random point of its pixel.
// Where to read: pbrt 4, sections 5.1 and 8.8 (pixel reconstruction; here a box filter). Assumes: bvh space, metres.
#ifndef PATH_BEGIN_GLSL
#define PATH_BEGIN_GLSL
#include "lib/own_tiles.glsl"
#include "lib/path_ray.glsl"

// The pixel at a position of the first queue. Tiles of 8x8 are taken in strides over the picture
// (src/pass/rows.rs). Pixels of a tile are in Morton order, so neighbours in a queue are
// neighbours in the picture. It lies outside the picture where a tile does.
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
    // Rays start at the near plane, as in rasterisation. Surfaces beyond the far plane of an orthographic camera stay
    // visible.
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
