// The G-buffer of deferred shading, as passes read it: the nearest opaque surface of each pixel.
// Where to read: RTR 4, section 20.1; docs/decisions/gbuffer.md. Assumes: pixel coordinates, reversed depth, positions
// relative to the eye in metres, normals in world axes.
//
// Normals are stored in one of several formats (knob `normals`). Vulkan lets variables of one binding have different
// formats as long as the used one is the bound one. NAME_as_FORMAT is the binding NAME (build.rs), and specialization keeps
// one of them. Images without a format in the shader were rejected: lavapipe 22.3 lacks
// shaderStorageImageReadWithoutFormat.
#ifndef GBUFFER_GLSL
#define GBUFFER_GLSL
#include "lib/normals.glsl"
#include "lib/view.glsl"

layout(constant) const float NORMAL_ERROR2 = 1e-7;    // |n − stored n|² that encoding explains
layout(constant) const bool POSITIONS = false;        // positions are stored beside depth (knob `position`)
layout(constant) const bool STORED_EMISSIVE = false;
layout(constant) const bool STORED_LAYERS = false;
layout(constant) const bool STORED_LOBES = false;
layout(constant) const bool STORED_TRIANGLES = false;
layout(constant) const bool STORED_TRANSMISSION = false; // transmissive surfaces are stored too

// Reversed depth, row by row; with POSITIONS, depth and position relative to the eye. A texel buffer instead of the depth
// image: lavapipe reads it inline, while a sampled image is a call that spills every register.
layout(pass, r32f) readonly uniform imageBuffer depths;
layout(pass, rgba32f) readonly uniform imageBuffer depths_as_rgba32f;
layout(pass, rgba16f) readonly uniform image2D base; // base colour and metallic texels
layout(pass, rg32ui) readonly uniform uimage2D normals; // lib/normals.glsl
layout(pass, r32ui) readonly uniform uimage2D normals_as_r32ui;
layout(pass, rgba32ui) readonly uniform uimage2D normals_as_rgba32ui;
layout(pass, rg32ui) readonly uniform uimage2D ids; // material | roughness << 16, instance | back face << 23 | occlusion << 24
layout(pass, rgba16f) readonly uniform image2D emissive; // texel
layout(pass, rgba32ui) readonly uniform uimage2D layers; // lib/texels.glsl, packed_layers
layout(pass, r32ui) readonly uniform uimage2D triangles; // triangle of the scene

// lib/texels.glsl, packed_lobes, row by row. A buffer, because a shader may have 16 storage images on some devices.
layout(pass, scalar) readonly buffer Lobes { uvec4 lobes[]; };

// Octahedral encodings of the shading normal (xy) and the geometric normal (zw).
vec4 stored_normals(ivec2 pixel) {
    uvec4 words;
    if (NORMALS == NORMALS_OCT16) words = imageLoad(normals_as_r32ui, pixel);
    else if (NORMALS == NORMALS_F32) words = imageLoad(normals_as_rgba32ui, pixel);
    else words = imageLoad(normals, pixel);
    return octahedra_of_words(words);
}

int pixel_index(ivec2 pixel) {
    return pixel.y * int(camera.size.x) + pixel.x;
}

// Reversed depth; 0 where nothing was drawn.
float stored_depth(int pixel) {
    return POSITIONS ? imageLoad(depths_as_rgba32f, pixel).x : imageLoad(depths, pixel).x;
}

// Position relative to the eye, where positions are stored.
vec3 stored_position(int pixel) {
    return imageLoad(depths_as_rgba32f, pixel).yzw;
}
#endif
