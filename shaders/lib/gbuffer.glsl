// The G-buffer as passes read it: of each pixel its nearest opaque surface (docs/decisions/gbuffer.md).
//
// Normals are stored in one of several formats (knob `normals`). Vulkan lets variables of one binding have different formats as
// long as what is used is what is bound: NAME_as_FORMAT is the binding NAME (build.rs), and specialization leaves one of them. A format
// told by the image alone is no way: lavapipe 22.3 lacks shaderStorageImageReadWithoutFormat.
#ifndef GBUFFER_GLSL
#define GBUFFER_GLSL
#include "lib/normals.glsl"
#include "lib/view.glsl"

layout(constant) const float NORMAL_ERROR2 = 1e-7;    // |n − stored n|² that storing accounts for
layout(constant) const bool POSITIONS = false;        // positions are stored beside depth (knob `position`)
layout(constant) const bool STORED_EMISSIVE = false;
layout(constant) const bool STORED_LAYERS = false;
layout(constant) const bool STORED_TRIANGLES = false;
layout(constant) const bool STORED_TRANSMISSION = false; // transmissive surfaces are in it

// Reversed depth, row by row; where positions are stored, depth and the place relative to the eye. A buffer, not the depth image: on
// lavapipe it is fetched inline, where a sampled image is a call that spills every register.
layout(pass, r32f) readonly uniform imageBuffer depths;
layout(pass, rgba32f) readonly uniform imageBuffer depths_as_rgba32f;
layout(pass, rgba16f) readonly uniform image2D base; // base colour and metallic texels
layout(pass, rg32ui) readonly uniform uimage2D normals; // lib/normals.glsl
layout(pass, r32ui) readonly uniform uimage2D normals_as_r32ui;
layout(pass, rgba32ui) readonly uniform uimage2D normals_as_rgba32ui;
layout(pass, rg32ui) readonly uniform uimage2D ids; // material | roughness << 16, instance | back face << 23 | occlusion << 24
layout(pass, rgba16f) readonly uniform image2D emissive; // texel
layout(pass, rgba32ui) readonly uniform uimage2D layers; // lib/texels.glsl, packed_layers
layout(pass, r32ui) readonly uniform uimage2D triangles; // of the scene

// Octahedral shading normal and geometric normal.
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
