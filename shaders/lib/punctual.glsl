// Punctual lights (point, spot, directional) and analytic area lights (sphere, disk, rectangle), from the table of lights.
// Where to read: KHR_lights_punctual; pbrt 4, sections 12.2 and 6.2.4 (sampling of spheres). Assumes: positions relative to
// the eye, metres, cd.
#ifndef PUNCTUAL_GLSL
#define PUNCTUAL_GLSL
#include "lib/light.glsl"
#include "lib/light_table.glsl"

layout(constant) const uint DIRECTIONAL_LIGHTS = 0; // directional lights are the first ones of the table, up to this index

struct PunctualLight {
    vec3 to_light;    // from the point; unit direction to a light at infinity
    vec3 l;           // to_light, normalised
    vec3 arriving;    // irradiance perpendicular to l, unoccluded
    bool directional; // at infinity
};

// Light `index` of the table as seen from a point.
PunctualLight punctual_light_at(uint index, vec3 p_rel) {
    Light light = light_at(index);
    PunctualLight r;
    r.directional = index < DIRECTIONAL_LIGHTS;
    r.to_light = r.directional ? light.position : light.position - p_rel;
    ArrivingLight arriving = arriving_light(r.to_light, r.directional, light.inv_range2, light.axis, light.spot_scale, light.spot_offset);
    r.l = arriving.l;
    r.arriving = light.color * arriving.share;
    return r;
}

// A sample of an analytic area light: light from one point of it, by a point x of the unit square. The light is a
// Lambertian emitter with intensity I along its axis from afar. L = I/(πr²) for spheres and disks, I/A for rectangles, so
// that the irradiance from a face is I cosθ_light/r² whatever its size.
PunctualLight shaped_light_at(uint index, vec3 p_rel, vec2 x) {
    PunctualLight r = punctual_light_at(index, p_rel);
    Light light = light_at(index);
    uint kind = uint(light.shape);
    if (kind == SHAPE_NONE) return r;
    vec3 middle = r.to_light;
    float window = point_falloff(dot(middle, middle), light.inv_range2) * dot(middle, middle);
    vec2 around = cos_sin_of_turns(x.y);
    if (kind == SHAPE_SPHERE) {
        // Uniform sampling of the cone that the sphere subtends (pbrt 4, section 6.2.4).
        float d2 = dot(middle, middle);
        if (d2 <= light.extent * light.extent) {
            // From inside the sphere is invisible.
            r.arriving = vec3(0.0);
            return r;
        }
        float lost = sphere_cone(light.extent * light.extent, d2);
        float cos_theta = 1.0 - x.x * lost;
        float sin2 = max(x.x * lost * (2.0 - x.x * lost), 0.0);
        OrthonormalBasis b = orthonormal_basis(r.l);
        vec3 l = r.l * cos_theta + (b.t * around.x + b.b * around.y) * sqrt(sin2);
        r.to_light = l * ball_reach(d2, light.extent, cos_theta, sin2);
        r.l = l;
        // Irradiance Ω L = 2π(1 − cosθ) I/(πr²).
        r.arriving = light.color * (window * 2.0 * lost / (light.extent * light.extent));
        return r;
    }
    if (kind == SHAPE_DISK) {
        OrthonormalBasis b = orthonormal_basis(light.axis);
        r.to_light = middle + (b.t * around.x + b.b * around.y) * (light.extent * sqrt(x.x));
    } else {
        vec3 up = normalize(cross(light.axis, light.across)) * light.extent;
        r.to_light = middle + light.across * (2.0 * x.x - 1.0) + up * (2.0 * x.y - 1.0);
    }
    float r2 = max(dot(r.to_light, r.to_light), LIGHT_RADIUS * LIGHT_RADIUS);
    r.l = r.to_light * inversesqrt(r2);
    float cos_light = -dot(light.axis, r.l);
    r.arriving = light.color * (cos_light > 0.0 ? window * cos_light / r2 * spot_share(cos_light, light.spot_scale, light.spot_offset) : 0.0);
    return r;
}
#endif
