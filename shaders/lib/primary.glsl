// The primary surface of a pixel, reconstructed from the G-buffer.
// Where to read: RTR 4, section 20.1 (deferred shading); docs/decisions/positions.md. Assumes: positions relative to the
// eye, and in bvh space for rays; metres.
#ifndef PRIMARY_GLSL
#define PRIMARY_GLSL
#include "lib/encode.glsl"
#include "lib/gbuffer.glsl"
#include "lib/hit.glsl"
#include "lib/instances.glsl"
#include "lib/shadow.glsl"

layout(constant) const bool IN_MEDIUM = false; // the eye is inside a transparent solid
// Index of each triangle of the scene among the leaves of the BVH.
layout(scene, scalar) readonly buffer LeafPlaces { uint leaf_places[]; };

struct Primary {
    bool drawn;
    HitSurface hit;
};

// Transmittance of the medium around the eye, up to the primary surface.
vec3 left_at_eye(Surface s) {
    vec3 left = vec3(1.0);
    if (IN_MEDIUM && ABSORPTION == ABSORPTION_PATH) {
        float distance = camera.orthographic != 0 ? dot(s.p_rel, camera.forward) : length(s.p_rel);
        left = absorbed(present_medium(trace_terms.camera_media), s.p_bvh + s.v * distance, -s.v, distance);
    }
    return left;
}

// Where the ray of a pixel meets the plane of the triangle drawn there. A position from depth and stored normal has
// rounding errors of its own, off the plane that rays hit.
HitPoint on_triangle(uint leaf, vec3 p_bvh, vec3 direction) {
    // Orthographic rays come from the pixel's own point, all others from the eye.
    vec3 origin = camera.orthographic != 0 ? p_bvh : trace_terms.bvh_from_rel;
    ShearedTriangle t = sheared_from(triangle_at(leaf), origin, ray_shear(direction));
    float whole = t.det == 0.0 ? 1.0 : t.det;
    return hit_point_of(Hit(0.0, leaf, t.weights.y / whole, t.weights.z / whole), p_bvh, vec3(0.0));
}

// Moves the origin of a surface's rays to where its pixel's ray meets the plane of its triangle. p_rel stays: lighting does
// not depend on whether there are rays.
HitPoint put_on_triangle(inout Surface s, uint leaf, vec3 direction) {
    HitPoint point = on_triangle(leaf, s.p_bvh, direction);
    s.p_bvh = point.p;
    s.face = point.face;
    return point;
}

// With `exact_normals` the normals are those of the triangle, unless a normal map has changed them: for rays that leave the
// surface. Lighting at the surface uses the stored normals, which do not depend on whether the scene calls for rays.
Primary primary_surface(ivec2 pixel, bool exact_normals) {
    Primary r;
    float z = stored_depth(pixel_index(pixel));
    r.drawn = z != 0.0;
    uvec2 id = imageLoad(ids, pixel).xy;
    uint material = r.drawn ? id.x & 0xffffu : 0u;
    vec4 texel = imageLoad(base, pixel);
    vec4 octahedral = stored_normals(pixel);
    vec3 n = unit_from_octahedral(octahedral.xy);
    Texels t = texels_of_nothing(vec4(texel.rgb, 1.0));
    t.metallic = texel.a;
    t.roughness = float(id.x >> 16) * (1.0 / 65535.0);
    t.occlusion = float(id.y >> 24) * (1.0 / 255.0);
    if (STORED_EMISSIVE) t.emissive = imageLoad(emissive, pixel).rgb;
    vec3 n_coat = n;
    if (STORED_LAYERS) unpack_layers(imageLoad(layers, pixel), t, n_coat);
    if (STORED_LOBES) unpack_lobes(lobes[pixel_index(pixel)], t);
    Material m = material_at(material);
    vec3 p_rel = POSITIONS && r.drawn ? stored_position(pixel_index(pixel)) : rel_from_pixel(camera, pixel, r.drawn ? z : 1.0);
    Surface s = surface_from_texels(material, m, t, n, n_coat, -view_direction(camera, pixel), p_rel);
    s.p_bvh = p_rel + trace_terms.bvh_from_rel;
    s.n_triangle = unit_from_octahedral(octahedral.zw);
    s.media = trace_terms.camera_media;
    if (STORED_TRIANGLES) {
        uint leaf = r.drawn ? leaf_places[r.drawn ? imageLoad(triangles, pixel).x : 0u] : NO_TRIANGLE;
        if (leaf != NO_TRIANGLE) {
            HitPoint point = put_on_triangle(s, leaf, view_direction(camera, pixel));
            if (exact_normals) {
                float side = is_front(point.n, view_direction(camera, pixel)) ? 1.0 : -1.0;
                s.n_triangle = side * point.n;
                vec3 smooth_n = side * point.n_smooth;
                s.n = dot(n - smooth_n, n - smooth_n) < NORMAL_ERROR2 ? smooth_n : n;
                s.n_coat = dot(n_coat - smooth_n, n_coat - smooth_n) < 1e-7 ? smooth_n : n_coat;
            }
        }
    }
    // Interfaces of transparent solids lie between two media (lib/boundary.glsl).
    uint instance = r.drawn ? id.y & INSTANCE_BITS : 0u;
    bool sheet = (instances[instance].flags & INSTANCE_SHEET) != 0;
    if (IN_MEDIUM && (m.transmission == 0.0 || sheet)) seen_from(s, index_of(present_medium(s.media)));
    r.hit.s = s;
    r.hit.n = s.n_triangle;
    r.hit.front = (id.y & BACK_FACE) == 0;
    r.hit.coverage = 1.0;
    r.hit.transmits = STORED_TRANSMISSION ? m.transmission * t.transmission : 0.0;
    r.hit.sheet = sheet;
    r.hit.thickness = instances[instance].scale * t.thickness;
    r.hit.material = material;
    r.hit.transmission = m.transmission;
    r.hit.medium = m.medium;
    r.hit.sigma_thickness = m.sigma_thickness;
    return r;
}
#endif
