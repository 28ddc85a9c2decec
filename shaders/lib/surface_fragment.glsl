// A rasterised surface at a fragment: textures read and normals turned to the viewer, for the G-buffer and the A-buffer.
// Both store the same quantities (lib/gbuffer.glsl, lib/fragment_list.glsl). Where to read: glTF 2.0, section 3.9. Assumes:
// positions relative to the eye, metres; world axes.
#ifndef SURFACE_FRAGMENT_GLSL
#define SURFACE_FRAGMENT_GLSL
#include "lib/anisotropy.glsl"
#include "lib/bent_normal.glsl"
#include "lib/gbuffer_interface.glsl"
#include "lib/material.glsl"
#include "lib/view.glsl"

layout(location = 0) in vec3 p_rel;
layout(location = 1) in vec3 n_rel;
layout(location = 2) in vec4 t_rel;
layout(location = 3) in vec4 uv;
layout(location = 4) in vec4 vertex_color;
layout(location = 5) flat in uvec3 ids;

layout(push_constant, scalar) uniform Push { float lod_bias; uint strip; };

// Triangle of the scene. Where fragments cannot know it, `ids` holds all of it and gl_PrimitiveID is replaced by 0
// (crates/vulkan/src/primitive_ids.rs).
uint triangle() {
    return ids.z + uint(gl_PrimitiveID);
}

struct SurfaceFragment {
    Texels texels;
    vec3 n_shading;     // unit, on the viewer's side of the face
    vec3 n_coat;        // unit; the normal map of the base does not affect the clear coat
    vec3 n_geometric;   // unit, on the viewer's side
};

vec4 page_texel(sampler2DArray page, uint slot) {
    vec4 texel = vec4(1.0);
    if ((TEXTURES & (1u << slot)) != 0) texel = texture(page, page_coordinates(ids.y, slot, uv), lod_bias);
    return texel;
}
#define READ(page, slot) put_texel(s.texels, TEXTURES, slot, page_texel(page, slot));

SurfaceFragment surface_fragment() {
    SurfaceFragment s;
    // Not the interpolated constant: perspective interpolation turns 1 into 0.99999994, which a half rounds to 0.9995.
    s.texels = texels_of_nothing(HAS_COLOR ? vertex_color : vec4(1.0));
    READ(base_page, SLOT_BASE)
    READ(metallic_roughness_page, SLOT_METALLIC_ROUGHNESS)
    READ(occlusion_page, SLOT_OCCLUSION)
    READ(emissive_page, SLOT_EMISSIVE)
    READ(clearcoat_page, SLOT_CLEARCOAT)
    READ(clearcoat_roughness_page, SLOT_CLEARCOAT_ROUGHNESS)
    READ(specular_page, SLOT_SPECULAR)
    READ(transmission_page, SLOT_TRANSMISSION)
    READ(thickness_page, SLOT_THICKNESS)
    READ(sheen_color_page, SLOT_SHEEN_COLOR)
    READ(sheen_roughness_page, SLOT_SHEEN_ROUGHNESS)
    READ(specular_color_page, SLOT_SPECULAR_COLOR)
    READ(anisotropy_page, SLOT_ANISOTROPY)
    READ(iridescence_page, SLOT_IRIDESCENCE)
    READ(iridescence_thickness_page, SLOT_IRIDESCENCE_THICKNESS)
    READ(diffuse_transmission_page, SLOT_DIFFUSE_TRANSMISSION)
    READ(diffuse_transmission_color_page, SLOT_DIFFUSE_TRANSMISSION_COLOR)
#undef READ

    // The geometric normal from positions of neighbouring fragments: they lie in the plane of the triangle.
    vec3 face = cross(dFdx(p_rel), dFdy(p_rel));
    vec3 view = camera.orthographic != 0 ? camera.forward : p_rel;
    face = dot(face, view) > 0.0 ? -face : face;
    float size = max(abs(face.x), max(abs(face.y), abs(face.z)));
    // A face seen exactly edge-on has no extent on the screen, so any normal towards the viewer will do.
    s.n_geometric = size > 0.0 ? normalize(face / size) : normalize(-view);

    vec3 n = normalize(n_rel);
    s.n_shading = n;
    s.n_coat = n;
    if (HAS_NORMAL) {
        vec3 texel = page_texel(normal_page, SLOT_NORMAL).xyz * 2.0 - 1.0;
        s.n_shading = bent_normal(n, t_rel, vec3(texel.xy * material_at(ids.y).normal_scale, texel.z));
    }
    if (HAS_COAT_NORMAL) s.n_coat = bent_normal(n, t_rel, page_texel(clearcoat_normal_page, SLOT_CLEARCOAT_NORMAL).xyz * 2.0 - 1.0);
    if (!ANISOTROPIC) {
        s.texels.tangent = vec3(1.0, 0.0, 0.0);
    } else {
        vec2 rotation = material_texel(ids.y, MATERIAL_LOBES_AT + int(LOBE_ANISOTROPY)).yz;
        s.texels.tangent = anisotropy_direction(s.n_shading, t_rel, s.texels.tangent.xy, rotation);
    }
    // From behind the whole normal is reversed, normal map included (glTF 2.0, section 3.9.5, double sided).
    if (!gl_FrontFacing) {
        s.n_shading = -s.n_shading;
        s.n_coat = -s.n_coat;
    }
    return s;
}
#endif
