// Paths between two dispatches: by pixel, whatever their place in a queue.
#ifndef PATH_STATE_GLSL
#define PATH_STATE_GLSL
#include "lib/path_ray.glsl"

layout(constant_id = 69) const bool KEEPS_MEDIA = false; // paths go through media
layout(constant_id = 70) const bool KEEPS_WAY = false;   // or through what lets them straight on

// Texels of a path lie as far from each other as there are pixels: those of neighbours are beside each other.
layout(set = 0, binding = 52, rgba32ui) uniform uimageBuffer path_states;

Path path_of(uint pixel, uint pixels) {
    uvec4 a = imageLoad(path_states, int(pixel));
    uvec4 b = imageLoad(path_states, int(pixels + pixel));
    uvec4 c = imageLoad(path_states, int(2 * pixels + pixel));
    Path p;
    p.origin = uintBitsToFloat(a.xyz);
    p.self = a.w;
    p.direction = uintBitsToFloat(b.xyz);
    p.pdf = uintBitsToFloat(b.w);
    p.throughput = uintBitsToFloat(c.xyz);
    p.state = c.w;
    p.media = trace_terms.camera_media;
    if (KEEPS_MEDIA) p.media = imageLoad(path_states, int(3 * pixels + pixel));
    p.travelled = 0.0;
    p.after = 0.0;
    if (KEEPS_WAY) {
        uvec4 d = imageLoad(path_states, int((KEEPS_MEDIA ? 4 : 3) * pixels + pixel));
        p.travelled = uintBitsToFloat(d.x);
        p.after = uintBitsToFloat(d.y);
    }
    return p;
}

void store_path(Path p, uint pixel, uint pixels) {
    imageStore(path_states, int(pixel), uvec4(floatBitsToUint(p.origin), p.self));
    imageStore(path_states, int(pixels + pixel), uvec4(floatBitsToUint(p.direction), floatBitsToUint(p.pdf)));
    imageStore(path_states, int(2 * pixels + pixel), uvec4(floatBitsToUint(p.throughput), p.state));
    if (KEEPS_MEDIA) imageStore(path_states, int(3 * pixels + pixel), p.media);
    if (KEEPS_WAY) {
        uvec4 d = uvec4(floatBitsToUint(p.travelled), floatBitsToUint(p.after), 0, 0);
        imageStore(path_states, int((KEEPS_MEDIA ? 4 : 3) * pixels + pixel), d);
    }
}
#endif
