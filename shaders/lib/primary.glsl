// The nearest surface of a pixel, out of the G-buffer. Expects `instances` and `camera`.
#ifndef PRIMARY_GLSL
#define PRIMARY_GLSL
#include "lib/camera.glsl"
#include "lib/encode.glsl"
#include "lib/hit.glsl"
#include "lib/shadow.glsl"

layout(constant_id = 0) const bool HAS_EMISSIVE = false;
layout(constant_id = 1) const bool HAS_LAYERS = false;
layout(constant_id = 3) const bool HAS_TRIANGLES = false;
layout(constant_id = 2) const bool HAS_TRANSMISSION = false; // transmissive surfaces are in the G-buffer

layout(set = 0, binding = 4, rgba16f) readonly uniform image2D base;
#define DEPTH_BINDING 3
#define NORMALS_BINDING 5
#include "lib/stored.glsl"
layout(set = 0, binding = 6, rg32ui) readonly uniform uimage2D ids;
layout(set = 0, binding = 7, rgba16f) readonly uniform image2D emissive;
layout(set = 0, binding = 8, rgba16) readonly uniform image2D layers;
layout(set = 0, binding = 9, r32ui) readonly uniform uimage2D triangles;
// Places among the leaves of the scene's triangles.
layout(set = 0, binding = 35, r32ui) readonly uniform uimageBuffer leaf_places;

layout(constant_id = 79) const float NORMAL_ERROR2 = 1e-7; // |n − stored n|² that storing accounts for
layout(constant_id = 4) const bool IN_MEDIUM = false; // the eye is inside a transparent body

struct Primary {
    bool drawn;
    HitSurface hit;
};

// What is left of the light from the nearest surface at the eye.
vec3 left_at_eye(Surface s) {
    vec3 left = vec3(1.0);
    if (IN_MEDIUM && ABSORPTION == 2) {
        float distance = camera.orthographic != 0 ? dot(s.p_rel, camera.forward) : length(s.p_rel);
        left = absorbed(present_medium(trace_terms.camera_media), s.p_bvh + s.v * distance, -s.v, distance);
    }
    return left;
}

// Where the ray of a pixel meets the plane of the triangle that was drawn there. What depth and stored normal tell of
// the point has roundings of its own, off the plane that rays meet. Not into a Surface at once: glslang never ends
// where a `precise` value comes from a struct that is assigned from itself.
HitPoint on_triangle(uint leaf, vec3 p_bvh, vec3 direction) {
    vec3 a = uintBitsToFloat(imageLoad(bvh_triangles, int(leaf) * 3).xyz);
    vec3 b = uintBitsToFloat(imageLoad(bvh_triangles, int(leaf) * 3 + 1).xyz);
    vec3 c = uintBitsToFloat(imageLoad(bvh_triangles, int(leaf) * 3 + 2).xyz);
    // Parallel rays come from the pixel's point, all others from the eye.
    vec3 origin = camera.orthographic != 0 ? p_bvh : trace_terms.bvh_from_rel;
    precise vec3 to_a = a - origin;
    precise vec3 to_b = b - origin;
    precise vec3 to_c = c - origin;
    ShearedTriangle t = sheared_triangle(ray_shear(direction), to_a, to_b, to_c);
    float whole = t.det == 0.0 ? 1.0 : t.det;
    return hit_point_of(Hit(0.0, leaf, t.weights.y / whole, t.weights.z / whole), p_bvh, vec3(0.0));
}

// With `exact_normals`, the triangle's own where no texture has bent them: for rays that leave the surface. Light that is
// looked up at the surface has the stored ones, which are there whether or not the scene calls for rays.
Primary primary_surface(ivec2 pixel, bool exact_normals) {
    Primary r;
    vec4 z_position = stored_depth(pixel.y * int(camera.size.x) + pixel.x);
    float z = z_position.x;
    r.drawn = z != 0.0;
    uvec2 id = imageLoad(ids, pixel).xy;
    uint material = r.drawn ? id.x & 0xffffu : 0u;
    vec4 texel = imageLoad(base, pixel);
    vec4 glow = HAS_EMISSIVE || HAS_TRANSMISSION ? imageLoad(emissive, pixel) : vec4(1.0);
    vec4 octahedral = stored_normals(pixel);
    vec3 n = unit_from_octahedral(octahedral.xy);
    vec3 layer = vec3(1.0);
    vec3 n_coat = n;
    if (HAS_LAYERS) {
        vec4 packed_value = imageLoad(layers, pixel);
        layer = layers_from_packed(packed_value);
        n_coat = coat_normal_from_packed(packed_value);
    }
    float roughness = float(id.x >> 16) * (1.0 / 65535.0);
    float occlusion = float(id.y >> 24) * (1.0 / 255.0);
    Material m = material_at(material);
    vec3 p_rel = POSITIONS && r.drawn ? z_position.yzw : rel_from_pixel(camera, pixel, r.drawn ? z : 1.0);
    Surface s = surface_from_texels(m, texel.rgb, texel.a, roughness, occlusion, HAS_EMISSIVE ? glow.rgb : vec3(1.0), layer, n, n_coat,
                                    -view_direction(camera, pixel), p_rel);
    vec3 p_bvh = p_rel + trace_terms.bvh_from_rel;
    s.p_bvh = p_bvh;
    s.n_triangle = unit_from_octahedral(octahedral.zw);
    s.media = trace_terms.camera_media;
    if (HAS_TRIANGLES) {
        uint leaf = r.drawn ? imageLoad(leaf_places, int(imageLoad(triangles, pixel).x)).x : NO_TRIANGLE;
        if (leaf != NO_TRIANGLE) {
            HitPoint point = on_triangle(leaf, p_bvh, view_direction(camera, pixel));
            s.p_bvh = point.p;
            s.face = point.face;
            if (exact_normals) {
                float side = dot(point.n, view_direction(camera, pixel)) <= 0.0 ? 1.0 : -1.0;
                s.n_triangle = side * point.n;
                vec3 smooth_n = side * point.n_smooth;
                s.n = dot(n - smooth_n, n - smooth_n) < NORMAL_ERROR2 ? smooth_n : n;
                s.n_coat = dot(n_coat - smooth_n, n_coat - smooth_n) < 1e-7 ? smooth_n : n_coat;
            }
        }
    }
    r.hit.s = s;
    r.hit.n = s.n_triangle;
    r.hit.front = (id.y & BACK_FACE) == 0;
    r.hit.coverage = 1.0;
    // The emissive target's fourth component is how much the texture lets through.
    r.hit.transmits = HAS_TRANSMISSION ? m.transmission * glow.a : 0.0;
    uint instance = r.drawn ? id.y & INSTANCE_BITS : 0u;
    r.hit.sheet = (instances[instance].flags & INSTANCE_SHEET) != 0;
    r.hit.thickness = instances[instance].scale;
    r.hit.material = material;
    r.hit.transmission = m.transmission;
    r.hit.medium = m.medium;
    r.hit.sigma_thickness = m.sigma_thickness;
    return r;
}
#endif
