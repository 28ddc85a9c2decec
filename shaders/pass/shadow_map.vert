// Shadow maps: casters as a light sees them, from object space to the light's clip space.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "share/scene.glsl"

// Transforms relative to the middle of the scene, not to the eye.
layout(pass, scalar) readonly buffer Casters { Instance casters[]; };
layout(push_constant, scalar) uniform Push { mat4 clip_from_scene; };

layout(location = 0) in vec3 position;
layout(location = 1) in vec2 uv0;
layout(location = 2) in vec2 uv1;
layout(location = 3) in vec4 color;

layout(location = 0) out vec4 uv;
layout(location = 1) out float alpha;
layout(location = 2) flat out uint material;

void main() {
    Instance instance = casters[gl_InstanceIndex];
    uv = vec4(uv0, uv1);
    alpha = color.a;
    material = instance.material;
    gl_Position = clip_from_scene * vec4(instance.rel_from_object * vec4(position, 1.0), 1.0);
}
