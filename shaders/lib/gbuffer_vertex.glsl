// The vertex stage of rasterised surfaces: object space to clip space, and the interpolated attributes.
// Assumes: positions relative to the eye in metres (rel space); reversed depth in clip space.
#include "lib/gbuffer_interface.glsl"
#include "lib/instances.glsl"
#include "lib/view.glsl"

layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec4 tangent;
layout(location = 3) in vec2 uv0;
layout(location = 4) in vec2 uv1;
layout(location = 5) in vec4 color;

// `invariant`: meshes of different materials, drawn by different variants of the program, share edges.
invariant gl_Position;
layout(location = 0) out vec3 p_rel;
layout(location = 1) out vec3 n_rel;
layout(location = 2) out vec4 t_rel;
layout(location = 3) out vec4 uv;
layout(location = 4) out vec4 vertex_color;
layout(location = 5) flat out uvec3 ids; // instance, material, first triangle of the instance (vertices not shared: the triangle)

void main() {
    Instance instance = instances[gl_InstanceIndex];
    p_rel = instance.rel_from_object * vec4(position, 1.0);
    n_rel = instance.normal_from_object * normal;
    t_rel = HAS_NORMAL || HAS_COAT_NORMAL || ANISOTROPIC ? vec4(mat3(instance.rel_from_object) * tangent.xyz, tangent.w * instance.handedness) : vec4(0);
    uv = TEXTURES != 0 ? vec4(uv0, uv1) : vec4(0);
    vertex_color = HAS_COLOR ? color : vec4(1);
    ids = uvec3(gl_InstanceIndex, instance.material, instance.first_triangle + (SHARED_VERTICES ? 0u : uint(gl_VertexIndex) / 3));
    gl_Position = camera.clip_from_rel * vec4(p_rel, 1.0);
}
