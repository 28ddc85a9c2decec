// Path states in memory between two dispatches, by pixel, wherever the path stands in a queue.
// Buffers of four words each: words that neighbours read lie together, and large pictures fit into one binding. Where to
// read: pbrt 4, chapter 15 (structure of arrays); docs/decisions/paths.md.
#ifndef PATH_STATE_GLSL
#define PATH_STATE_GLSL
#include "lib/path_ray.glsl"

layout(constant) const bool KEEPS_MEDIA = false; // paths cross media
layout(constant) const bool KEEPS_T_MIN = false; // some interface coincides with an opaque surface

layout(pass, scalar) buffer Origins { uvec4 origins[]; };          // origin, source_face (path_sample.comp: weight of emission)
layout(pass, scalar) buffer Directions { uvec4 directions[]; };    // direction, pdf
layout(pass, scalar) buffer Throughputs { uvec4 throughputs[]; };  // throughput, state
layout(pass, scalar) buffer Sums { uvec4 sums[]; };                // sum, distance_since_vertex
layout(pass, scalar) buffer Media { uvec4 media[]; };
layout(pass, scalar) buffer TMins { float t_mins[]; };

// Without `sum` and `distance_since_vertex`.
Path path_without_sum(uint pixel) {
    uvec4 a = origins[pixel];
    uvec4 b = directions[pixel];
    uvec4 c = throughputs[pixel];
    Path p;
    p.origin = uintBitsToFloat(a.xyz);
    p.source_face = a.w;
    p.direction = uintBitsToFloat(b.xyz);
    p.pdf = uintBitsToFloat(b.w);
    p.throughput = uintBitsToFloat(c.xyz);
    p.state = c.w;
    p.sum = vec3(0.0);
    p.distance_since_vertex = 0.0;
    p.media = trace_terms.camera_media;
    if (KEEPS_MEDIA) p.media = media[pixel];
    p.t_min = 0.0;
    if (KEEPS_T_MIN) p.t_min = t_mins[pixel];
    return p;
}

Path path_of(uint pixel) {
    uvec4 d = sums[pixel];
    Path p = path_without_sum(pixel);
    p.sum = uintBitsToFloat(d.xyz);
    p.distance_since_vertex = uintBitsToFloat(d.w);
    return p;
}

void store_path(Path p, uint pixel) {
    origins[pixel] = uvec4(floatBitsToUint(p.origin), p.source_face);
    directions[pixel] = uvec4(floatBitsToUint(p.direction), floatBitsToUint(p.pdf));
    throughputs[pixel] = uvec4(floatBitsToUint(p.throughput), p.state);
    sums[pixel] = uvec4(floatBitsToUint(p.sum), floatBitsToUint(p.distance_since_vertex));
    if (KEEPS_MEDIA) media[pixel] = p.media;
    if (KEEPS_T_MIN) t_mins[pixel] = p.t_min;
}
#endif
