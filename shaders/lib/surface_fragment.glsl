// A surface at a fragment: the material's textures read, normals turned to the viewer. Shared by the G-buffer and by
// the fragment list of see-through surfaces, which store the same quantities.
#ifndef SURFACE_FRAGMENT_GLSL
#define SURFACE_FRAGMENT_GLSL
#include "lib/bent_normal.glsl"
#include "lib/gbuffer_interface.glsl"
#include "share/camera.glsl"

layout(scalar, set = 0, binding = 0) uniform CameraBlock { Camera camera_block; };
layout(scalar, set = 0, binding = 2) readonly buffer Materials { Material materials[]; };
// Two texels per slot: row of u, layer | row of v, coordinate set. A texel buffer, not a storage buffer: lavapipe 22.3
// masks storage-buffer loads of helper invocations to 0, and the texture's level would come out of those coordinates.
layout(set = 0, binding = 3, rgba32f) readonly uniform imageBuffer slots;
layout(set = 0, binding = 4) uniform sampler2DArray base_page;
layout(set = 0, binding = 5) uniform sampler2DArray metallic_roughness_page;
layout(set = 0, binding = 6) uniform sampler2DArray normal_page;
layout(set = 0, binding = 7) uniform sampler2DArray occlusion_page;
layout(set = 0, binding = 8) uniform sampler2DArray emissive_page;
layout(set = 0, binding = 9) uniform sampler2DArray clearcoat_page;
layout(set = 0, binding = 10) uniform sampler2DArray clearcoat_roughness_page;
layout(set = 0, binding = 11) uniform sampler2DArray specular_page;
layout(set = 0, binding = 12) uniform sampler2DArray transmission_page;
layout(set = 0, binding = 13) uniform sampler2DArray thickness_page;
layout(set = 0, binding = 14) uniform sampler2DArray coat_normal_page;

layout(location = 0) in vec3 p_rel;
layout(location = 1) in vec3 n_rel;
layout(location = 2) in vec4 t_rel;
layout(location = 3) in vec4 uv;
layout(location = 4) in vec4 vertex_color;
layout(location = 5) flat in uvec3 ids;

layout(push_constant, scalar) uniform Push { float lod_bias; uint strip; };

struct SurfaceFragment {
    vec4 base;          // texel times vertex colour; the constant factor is not in it
    float metallic;     // texel
    float roughness;    // texel
    float occlusion;    // texel
    vec3 emissive;      // texel
    vec4 layers;        // texels: clearcoat, clearcoat roughness, specular, transmission
    float thickness;    // texel
    vec3 n_shading;     // unit, to the viewer's side of the face
    vec3 n_coat;        // unit: of the clear coat, which does not follow the base's normal texture
    vec3 n_geometric;   // unit, to the viewer
};

// The array index is the rounded third coordinate; a layer never bleeds into the next.
vec4 read(sampler2DArray page, uint slot_index) {
    int at = int(ids.y * SLOTS + slot_index) * 2;
    vec4 u_layer = imageLoad(slots, at);
    vec4 v_set = imageLoad(slots, at + 1);
    vec3 set = vec3(v_set.w == 0.0 ? uv.xy : uv.zw, 1.0);
    return texture(page, vec3(dot(u_layer.xyz, set), dot(v_set.xyz, set), u_layer.w), lod_bias);
}

SurfaceFragment surface_fragment() {
    SurfaceFragment s;
    // Not the varying's constant: perspective interpolation makes 0.99999994 of 1, which a half rounds to 0.9995.
    s.base = HAS_COLOR ? vertex_color : vec4(1.0);
    if (HAS_BASE) s.base *= read(base_page, SLOT_BASE);
    s.metallic = 1.0;
    s.roughness = 1.0;
    if (HAS_METALLIC_ROUGHNESS) {
        vec4 texel = read(metallic_roughness_page, SLOT_METALLIC_ROUGHNESS);
        s.roughness = texel.g;
        s.metallic = texel.b;
    }
    s.occlusion = HAS_OCCLUSION ? read(occlusion_page, SLOT_OCCLUSION).r : 1.0;
    s.emissive = HAS_EMISSIVE ? read(emissive_page, SLOT_EMISSIVE).rgb : vec3(1.0);
    s.layers = vec4(1.0);
    s.thickness = 1.0;
    if (HAS_LAYERS) {
        s.layers.x = read(clearcoat_page, SLOT_CLEARCOAT).r;
        s.layers.y = read(clearcoat_roughness_page, SLOT_CLEARCOAT_ROUGHNESS).g;
        s.layers.z = read(specular_page, SLOT_SPECULAR).a;
        s.layers.w = read(transmission_page, SLOT_TRANSMISSION).r;
        s.thickness = read(thickness_page, SLOT_THICKNESS).g;
    }

    // The face's own normal from the positions of neighbouring fragments: they lie in the plane of the triangle.
    vec3 face = cross(dFdx(p_rel), dFdy(p_rel));
    vec3 view = camera_block.orthographic != 0 ? camera_block.forward : p_rel;
    face = dot(face, view) > 0.0 ? -face : face;
    float size = max(abs(face.x), max(abs(face.y), abs(face.z)));
    // A face seen exactly edge-on has no extent on the screen: any normal to the viewer will do.
    s.n_geometric = size > 0.0 ? normalize(face / size) : normalize(-view);

    vec3 n = normalize(n_rel);
    s.n_shading = n;
    s.n_coat = n;
    if (HAS_NORMAL) {
        vec3 texel = read(normal_page, SLOT_NORMAL).xyz * 2.0 - 1.0;
        s.n_shading = bent_normal(n, t_rel, vec3(texel.xy * materials[ids.y].normal_scale, texel.z));
    }
    if (HAS_COAT_NORMAL) s.n_coat = bent_normal(n, t_rel, read(coat_normal_page, SLOT_CLEARCOAT_NORMAL).xyz * 2.0 - 1.0);
    // From behind, the mapped normal is reversed as a whole (glTF 2.0 section 3.9.5, double sided).
    if (!gl_FrontFacing) {
        s.n_shading = -s.n_shading;
        s.n_coat = -s.n_coat;
    }
    return s;
}
#endif
