// Path tracing in steps of one path per invocation: what they leave for each other in memory.
// Each bounce is four dispatches over the queue: path_extend.comp traces the rays, path_sample.comp draws a light sample at
// what they hit, path_shade.comp shades it and appends the surviving paths to the next queue, path_shadow.comp traces the
// shadow rays. So most kernels traverse, or search lights, or shade, and need the registers of one of these. Shading
// traverses where surfaces coincide and for light samples beyond the first; shadow rays shade the surfaces that filter light.
// Where to read: Laine, Karras and Aila, Megakernels Considered Harmful, HPG 2013; pbrt 4, chapter 15;
// docs/decisions/architectures.md.
#ifndef PATH_STEPS_GLSL
#define PATH_STEPS_GLSL
#include "lib/path_state.glsl"
#include "lib/queue.glsl"

// Two queues: those of even and of odd bounces.
layout(pass, scalar) buffer Queues { uint queues[]; };
// One size for each bounce; `count` is the number of entries.
layout(pass, scalar) buffer Sizes { WorkSize sizes[]; };
// By pixel: the hit of its path, then origin and source_face of its shadow ray.
layout(pass, scalar) buffer Hits { uvec4 hits[]; };
layout(push_constant) uniform Push { uint width; uint places; uint bounce; };

// An entry of this bounce's queue; TERMINATED where there is none.
uint own_entry() {
    uint place = listed_tile(gl_WorkGroupID) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    return place < sizes[bounce].count ? queues[(bounce & 1u) * places + place] : TERMINATED;
}

uvec2 pixel_of(uint index) {
    return uvec2(index % width, index / width);
}
#endif
