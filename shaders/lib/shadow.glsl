// How much of a light arrives at a point: what lies between stops it, or, where it is transparent, attenuates and colours
// it on a straight line (lecture R5; a stated approximation: refraction would focus the light elsewhere).
#ifndef SHADOW_GLSL
#define SHADOW_GLSL
#include "lib/hit.glsl"
#include "lib/media.glsl"

layout(constant_id = 44) const uint SHADOWS = 0;     // 0 off, 1 ray
layout(constant_id = 45) const bool FILTERS = false; // something masked, blended or transmissive is in the scene
layout(constant_id = 46) const uint ABSORPTION = 0;  // 0 off, 1 by the nominal thickness, 2 along the path

uint shadow_rays = 0;

// Reflectance of the boundary between two media for light that does not bend: by the angle in the thinner one, so that
// there is no total reflection on a straight line. Equal indices reflect nothing, Schlick's curve or not.
float straight_reflectance(float cos_v, float n1, float n2) {
    if (n1 == n2) return 0.0;
    float ratio = max(n1, n2) / min(n1, n2);
    return FRESNEL == 0 ? schlick(vec3(nested_f0(1.0, ratio)), 1.0, cos_v).x : fresnel_dielectric(cos_v, ratio).F;
}

// What one surface lets through of light along `direction`, with the media before and after it.
vec3 filtered(HitPoint point, vec3 direction, inout uvec4 media) {
    Material m = material_at(point.material);
    vec4 base = vec4(m.base_color.rgb, 1.0) * hit_texture_or(point.material, SLOT_BASE, point.uvs, 0.0, vec4(1.0)) * point.color;
    float transmits = m.transmission * hit_texture_or(point.material, SLOT_TRANSMISSION, point.uvs, 0.0, vec4(1.0)).r;
    transmits *= 1.0 - m.metallic * hit_texture_or(point.material, SLOT_METALLIC_ROUGHNESS, point.uvs, 0.0, vec4(1.0)).b;
    float coverage = coverage_of(m, base.a);
    float cos_v = abs(dot(point.n_smooth, direction));
    uvec4 after = media;
    float n1 = 1.0;
    float n2 = m.ior;
    if (!point.sheet && m.transmission > 0.0) {
        bool front = dot(point.n, direction) <= 0.0;
        after = front ? entered(media, m.medium) : left(media, m.medium);
        n1 = index_of(present_medium(media));
        n2 = index_of(present_medium(after));
        if (present_medium(media) == present_medium(after)) {
            media = after;
            return vec3(1.0);
        }
    }
    media = after;
    // A solid is entered and left: each takes the root of its colour.
    vec3 tint = point.sheet ? base.rgb : sqrt(base.rgb);
    if (point.sheet && ABSORPTION != 0) {
        float thickness = hit_texture_or(point.material, SLOT_THICKNESS, point.uvs, 0.0, vec4(1.0)).g;
        tint *= exp(-m.sigma_thickness * (thickness * point.scale));
    }
    vec3 through = tint * (transmits * (1.0 - straight_reflectance(cos_v, n1, n2)));
    return 1.0 - coverage + coverage * through;
}

// A hit that is known, with its barycentrics.
Hit hit_again(vec3 origin, vec3 direction, float t, uint triangle) {
    precise vec3 a = uintBitsToFloat(imageLoad(bvh_triangles, int(triangle) * 3).xyz) - origin;
    precise vec3 b = uintBitsToFloat(imageLoad(bvh_triangles, int(triangle) * 3 + 1).xyz) - origin;
    precise vec3 c = uintBitsToFloat(imageLoad(bvh_triangles, int(triangle) * 3 + 2).xyz) - origin;
    ShearedTriangle s = sheared_triangle(ray_shear(direction), a, b, c);
    float inverse = 1.0 / s.det;
    return Hit(t, triangle, s.weights.y * inverse, s.weights.z * inverse);
}

// p in bvh space, n the normal of its triangle, `self` its flat face, v to the viewer, `media` those on the light's side. The light is at p + to_light, or
// in that direction where t_max is larger than 1.
vec3 visibility(vec3 p, vec3 n, vec3 v, uint self, uvec4 media, vec3 to_light, float t_max, bool wanted) {
    vec3 origin = ray_origin(p, n, v);
    float length_of_direction = vector_length(to_light);
    // What touches the light itself does not shadow it: t is a few roundings off.
    float end = t_max == 1.0 ? 1.0 - 4.0 / 16777216.0 : t_max;
    shadow_rays += wanted ? 1u : 0u;
    vec3 through = vec3(wanted ? 1.0 : 0.0);
    if (!FILTERS) {
        bool blocked = trace(origin, to_light, self, FROM_ORIGIN, wanted ? end : -1.0, OPAQUE, true).triangle != NO_TRIANGLE;
        return blocked ? vec3(0.0) : through;
    }
    // Four filters at a time.
    Hit last = FROM_ORIGIN;
    bool goes_on = wanted;
    do {
        loop_heads++;
        Filters filters;
        bool blocked = trace_to_light(origin, to_light, self, last, goes_on ? end : -1.0, filters);
        through = blocked ? vec3(0.0) : through;
        goes_on = goes_on && !blocked && filters.triangles.w != NO_TRIANGLE;
        bool found = !blocked && filters.triangles.x != NO_TRIANGLE;
        do {
            loop_heads++;
            if (found) {
                Hit hit = hit_again(origin, to_light, filters.t.x, filters.triangles.x);
                uint medium = present_medium(media);
                if (ABSORPTION == 2 && medium != 0) through *= absorbed(medium, (hit.t - last.t) * length_of_direction);
                through *= filtered(hit_point_of(hit, origin, to_light), to_light / length_of_direction, media);
                last = hit;
            }
            filters = Filters(vec4(filters.t.yzw, LARGEST), uvec4(filters.triangles.yzw, NO_TRIANGLE));
            found = found && filters.triangles.x != NO_TRIANGLE;
        } while (found);
        goes_on = goes_on && largest_component(through) > 0.0;
    } while (goes_on);
    uint medium = present_medium(media);
    if (ABSORPTION == 2 && medium != 0 && t_max == 1.0) through *= absorbed(medium, (1.0 - last.t) * length_of_direction);
    return through;
}

// Smooth normals turn away from a light later than the triangles do that they stand for, and those shadow themselves in
// steps. The light fades out to where the triangle turns away (Chiang, Li and Burley, Taming the Shadow Terminator,
// SIGGRAPH 2019 Talks).
float terminator(vec3 n_smooth, vec3 n, vec3 l) {
    float cos_n = dot(n, l);
    float both = dot(n_smooth, l) * dot(n_smooth, n);
    float g = both > 0.0 ? min(cos_n / both, 1.0) : 0.0;
    return cos_n > 0.0 ? ((1.0 - g) * g + 1.0) * g : 0.0;
}
#endif
