// What the G-buffer stores in one of several formats (knobs `normals` and `position`). Vulkan lets variables of one binding
// have different formats as long as what is used is what is bound: NAME_as_FORMAT is the binding NAME (build.rs), and
// specialization leaves one of them. Formats told by the image alone are no way: lavapipe 22.3 lacks
// shaderStorageImageReadWithoutFormat.
//
// Expects NORMALS_BINDING.
#ifndef STORED_GLSL
#define STORED_GLSL
layout(constant_id = 80) const uint NORMALS = 2; // place of the rung

layout(set = 0, binding = NORMALS_BINDING, rgba16_snorm) readonly uniform image2D normals;
layout(set = 0, binding = NORMALS_BINDING, rgba8_snorm) readonly uniform image2D normals_as_rgba8_snorm;
layout(set = 0, binding = NORMALS_BINDING, rgba32f) readonly uniform image2D normals_as_rgba32f;

// Octahedral shading normal and geometric normal.
vec4 stored_normals(ivec2 pixel) {
    if (NORMALS == 0) return imageLoad(normals_as_rgba8_snorm, pixel);
    if (NORMALS == 3) return imageLoad(normals_as_rgba32f, pixel);
    return imageLoad(normals, pixel);
}

#ifdef DEPTH_BINDING
layout(constant_id = 78) const bool POSITIONS = false;

layout(set = 0, binding = DEPTH_BINDING, r32f) readonly uniform imageBuffer depth;
layout(set = 0, binding = DEPTH_BINDING, rgba32f) readonly uniform imageBuffer depth_as_rgba32f;

// Reversed depth, and where positions are stored, the place relative to the eye.
vec4 stored_depth(int place) {
    if (POSITIONS) return imageLoad(depth_as_rgba32f, place);
    return imageLoad(depth, place);
}
#endif
#endif
