// What lies where a ray hits: the surface, from the same vertices and textures that the G-buffer is drawn with.
#ifndef HIT_GLSL
#define HIT_GLSL
#include "lib/bent_normal.glsl"
#include "lib/encode.glsl"
#include "lib/surface.glsl"
#include "lib/trace.glsl"

// Bit by slot: some material that rays may hit has such a texture.
layout(constant) const uint HIT_TEXTURES = 0;
layout(constant) const bool HIT_COLORS = false;     // some mesh has colours
layout(constant) const bool HIT_SECOND_UVS = false; // some texture reads the second coordinates
const bool HIT_UVS = HIT_TEXTURES != 0;
const bool HIT_TANGENTS = (HIT_TEXTURES & (1u << SLOT_NORMAL | 1u << SLOT_CLEARCOAT_NORMAL)) != 0;

// What lies at the corners of the triangles, in world axes, in the order of the leaves. Three texels per triangle:
//   normal of a, material | ..._TRIANGLE   normal of b, world length of a metre of the object   normal of c, texture
//   coordinates per metre
// then, where HIT_TEXTURES says so, two of the first texture coordinates, two of the second, three of tangents with
// their handedness, and two of colours as halves.
layout(scene, rgba32ui) readonly uniform uimageBuffer hit_corners;
const uint SHEET_TRIANGLE = 0x10000u;
const uint ONE_SIDED_TRIANGLE = 0x20000u;
const int UV0_AT = 3;
const int UV1_AT = UV0_AT + (HIT_UVS ? 2 : 0);
const int TANGENTS_AT = UV1_AT + (HIT_SECOND_UVS ? 2 : 0);
const int COLORS_AT = TANGENTS_AT + (HIT_TANGENTS ? 3 : 0);
const int CORNER_TEXELS = COLORS_AT + (HIT_COLORS ? 2 : 0);

// All levels of all images, RGBA in bytes. A texel buffer can be read at any place by any lane, where sampled images cannot be chosen
// by an index; lavapipe binds 128 MiB of a storage buffer at most, and 512 MiB of these.
layout(scene, r32ui) readonly uniform uimageBuffer texels;

const int MOST_LEVELS = 15; // above the first, of a picture of 32768 texels
const uint TEXELS_SRGB = 1;
const uint TEXELS_NEAREST = 2;
// Bits 2 and 3, 4 and 5: wrap of u and v: 0 repeat, 1 mirror, 2 clamp.

int wrapped(int i, int size, uint mode) {
    int period = mode == 1 ? 2 * size : size;
    int repeated = i - int(floor(float(i) / float(period))) * period;
    int mirrored = repeated < size ? repeated : period - 1 - repeated;
    return mode == 2 ? clamp(i, 0, size - 1) : clamp(mode == 1 ? mirrored : repeated, 0, size - 1);
}

vec4 texel_at(uint first, ivec2 size, ivec2 at, uint flags) {
    int x = wrapped(at.x, size.x, flags >> 2 & 3u);
    int y = wrapped(at.y, size.y, flags >> 4 & 3u);
    vec4 value = unpackUnorm4x8(imageLoad(texels, int(first) + y * size.x + x).x);
    return (flags & TEXELS_SRGB) != 0 ? vec4(linear_from_srgb(value.rgb), value.a) : value;
}

// A texture of a material at coordinates uv, at the level whose texels are `footprint` wide in units of the
// coordinates: bilinear in it.
vec4 hit_texture(uint material, uint slot, vec4 uv_sets, float footprint) {
    TextureSlot at_slot = texture_slot(material, slot);
    uvec4 place = material_words(material, at_slot.first);
    vec2 uv = slot_coordinates(at_slot, uv_sets);
    ivec2 size = ivec2(place.y & 0xffffu, place.y >> 16);
    uint levels = place.z & 0xffu;
    uint flags = place.z >> 8;
    // The coordinate's transform may scale; its determinant is its area.
    float stretch = sqrt(abs(at_slot.u_row.x * at_slot.v_row.y - at_slot.u_row.y * at_slot.v_row.x));
    float across = footprint * stretch * float(max(size.x, size.y));
    int level = clamp(int(floor(log2(max(across, 1.0)) + 0.5)), 0, int(levels) - 1);
    uint first = place.x;
    // Sizes of the levels above: their sum has no closed form where sides are odd.
    // As many turns for every lane: where the level ended the loop, lavapipe read other texels in whole groups of lanes.
    for (int i = 0; i < MOST_LEVELS; i++) {
        bool above = i < level;
        first += above ? uint(size.x * size.y) : 0u;
        size = above ? max(size >> 1, ivec2(1)) : size;
    }
    bool nearest = (flags & TEXELS_NEAREST) != 0;
    vec2 at = uv * vec2(size) - (nearest ? 0.0 : 0.5);
    // Far coordinates have no fraction left: keep the integers in range.
    at = clamp(at, -1e9, 1e9);
    ivec2 corner = ivec2(floor(at));
    vec2 share = nearest ? vec2(0.0) : at - floor(at);
    vec4 top = mix(texel_at(first, size, corner, flags), texel_at(first, size, corner + ivec2(1, 0), flags), share.x);
    vec4 bottom = mix(texel_at(first, size, corner + ivec2(0, 1), flags), texel_at(first, size, corner + ivec2(1), flags), share.x);
    return mix(top, bottom, share.y);
}

bool has_hit_texture(uint material, uint slot) {
    return (HIT_TEXTURES & (1u << slot)) != 0 && material_words(material, texture_slot(material, slot).first).z != 0;
}

vec4 hit_texture_or(uint material, uint slot, vec4 uv_sets, float footprint, vec4 otherwise) {
    if ((HIT_TEXTURES & (1u << slot)) == 0) return otherwise;
    return has_hit_texture(material, slot) ? hit_texture(material, slot, uv_sets, footprint) : otherwise;
}

// The point and the frame of a hit.
struct HitPoint {
    vec3 p;         // bvh space
    vec3 n;         // unit normal of the triangle, on the side of its front
    vec3 n_smooth;  // unit interpolated normal, on the same side
    vec4 t_smooth;  // interpolated tangent and its handedness
    vec4 uvs;
    vec4 color;
    float uv_per_metre; // how dense texture coordinates are
    float scale;    // how long a metre of the object is in the world
    bool sheet;     // transmits light and encloses nothing
    uint material;
    uint face;      // flat face of the triangle
};

vec4 corner_texel(uint triangle, int i) {
    return uintBitsToFloat(imageLoad(hit_corners, int(triangle) * CORNER_TEXELS + i));
}

// Its material | ..._TRIANGLE.
uint hit_material(uint triangle) {
    return floatBitsToUint(corner_texel(triangle, 0).w);
}

// OPAQUE or FILTER.
uint hit_class(uint triangle) {
    return imageLoad(bvh_triangles, int(triangle * 3)).w;
}

// Across a triangle, on the side of its front, as long as twice its area.
vec3 hit_normal(uint triangle) {
    vec3 a = uintBitsToFloat(imageLoad(bvh_triangles, int(triangle) * 3).xyz);
    vec3 b = uintBitsToFloat(imageLoad(bvh_triangles, int(triangle) * 3 + 1).xyz);
    vec3 c = uintBitsToFloat(imageLoad(bvh_triangles, int(triangle) * 3 + 2).xyz);
    // Corners run counter-clockwise around the front, whatever mirrored the object.
    return doubled_area(b - a, c - a);
}

HitPoint hit_point_of(Hit hit, vec3 origin, vec3 direction) {
    int first = int(hit.triangle * 3);
    vec3 a = uintBitsToFloat(imageLoad(bvh_triangles, first).xyz);
    uvec4 b_face = imageLoad(bvh_triangles, first + 1);
    vec3 b = uintBitsToFloat(b_face.xyz);
    uint face = b_face.w;
    vec3 c = uintBitsToFloat(imageLoad(bvh_triangles, first + 2).xyz);
    vec4 ta = corner_texel(hit.triangle, 0);
    vec4 tb = corner_texel(hit.triangle, 1);
    vec4 tc = corner_texel(hit.triangle, 2);
    vec3 w = vec3(1.0 - hit.u - hit.v, hit.u, hit.v);
    HitPoint r;
    r.p = hit_point(origin, direction, hit.t, a, b, c, hit.u, hit.v);
    r.material = floatBitsToUint(ta.w) & 0xffffu;
    r.sheet = (floatBitsToUint(ta.w) & SHEET_TRIANGLE) != 0;
    r.scale = tb.w;
    r.face = face;
    r.uv_per_metre = tc.w;
    // Corners run counter-clockwise around the front, whatever mirrored the object.
    r.n = triangle_normal(a, b, c).n;
    vec3 smooth_sum = ta.xyz * w.x + tb.xyz * w.y + tc.xyz * w.z;
    float length2 = dot(smooth_sum, smooth_sum);
    r.n_smooth = length2 > 0.0 ? smooth_sum * inversesqrt(length2) : r.n;
    r.n_smooth = dot(r.n_smooth, r.n) < 0.0 ? -r.n_smooth : r.n_smooth;
    r.t_smooth = vec4(0.0);
    if (HIT_TANGENTS) {
        vec4 t = corner_texel(hit.triangle, TANGENTS_AT);
        r.t_smooth.xyz = t.xyz * w.x + corner_texel(hit.triangle, TANGENTS_AT + 1).xyz * w.y +
                         corner_texel(hit.triangle, TANGENTS_AT + 2).xyz * w.z;
        r.t_smooth.w = t.w;
    }
    r.uvs = vec4(0.0);
    if (HIT_UVS) {
        vec4 ab = corner_texel(hit.triangle, UV0_AT);
        r.uvs.xy = ab.xy * w.x + ab.zw * w.y + corner_texel(hit.triangle, UV0_AT + 1).xy * w.z;
    }
    if (HIT_SECOND_UVS) {
        vec4 ab = corner_texel(hit.triangle, UV1_AT);
        r.uvs.zw = ab.xy * w.x + ab.zw * w.y + corner_texel(hit.triangle, UV1_AT + 1).xy * w.z;
    }
    r.color = vec4(1.0);
    if (HIT_COLORS) {
        uvec4 ab = floatBitsToUint(corner_texel(hit.triangle, COLORS_AT));
        uvec2 of_c = floatBitsToUint(corner_texel(hit.triangle, COLORS_AT + 1).xy);
        // White stays white to the last bit: the weights' sum need not be 1.
        vec4 first = vec4(unpackHalf2x16(ab.x), unpackHalf2x16(ab.y));
        r.color = first + (vec4(unpackHalf2x16(ab.z), unpackHalf2x16(ab.w)) - first) * w.y +
                  (vec4(unpackHalf2x16(of_c.x), unpackHalf2x16(of_c.y)) - first) * w.z;
    }
    return r;
}

// How much of the surface there is where its texel and colour have this alpha: 0 in the holes of a mask, coverage where
// it is blended, else 1.
float coverage_of(Material m, float texel_alpha) {
    float alpha = texel_alpha * m.base_color.a;
    bool blended = (m.flags & MATERIAL_BLENDED) != 0;
    return blended ? clamp(alpha, 0.0, 1.0) : m.alpha_cutoff > 0.0 && alpha < m.alpha_cutoff ? 0.0 : 1.0;
}

// Whether there is no surface: in the holes of masks. What blends is there, however little of it.
bool hit_is_hole(HitPoint point) {
    Material m = material_at(point.material);
    vec4 texel = hit_texture_or(point.material, SLOT_BASE, point.uvs, 0.0, vec4(1.0));
    return coverage_of(m, point.color.a * texel.a) == 0.0 && (m.flags & MATERIAL_BLENDED) == 0;
}

struct HitSurface {
    Surface s;
    vec3 n;          // of the triangle, on the viewer's side
    bool front;
    float coverage;
    float transmits; // share of what enters its dielectric part that goes through
    float thickness; // texel, times how long a metre of the object is in the world
    bool sheet;      // transmits light and encloses nothing
    uint material;
    // Of its material.
    float transmission;
    uint medium;
    vec3 sigma_thickness;
};

#define TEXEL(page, slot) hit_texture_or(id, slot, point.uvs, footprint, vec4(1.0))

// The surface as seen along `direction`, by a ray that is as wide as `width` there.
HitSurface hit_surface(HitPoint point, vec3 direction, float width) {
    HitSurface r;
    uint id = point.material;
    Material m = material_at(id);
    float cos_v = abs(dot(point.n, direction));
    float footprint = width * point.uv_per_metre / max(cos_v, 0.05);
    Texels t = texels_of_nothing(point.color);
    READ_TEXELS(t)
    r.transmits = m.transmission * t.transmission;
    r.thickness = point.scale * t.thickness;
    vec3 n = point.n_smooth;
    vec3 n_coat = n;
    if ((HIT_TEXTURES & (1u << SLOT_NORMAL)) != 0) {
        vec3 texel = hit_texture_or(id, SLOT_NORMAL, point.uvs, footprint, vec4(0.5, 0.5, 1.0, 1.0)).xyz * 2.0 - 1.0;
        vec3 bent = bent_normal(point.n_smooth, point.t_smooth, vec3(texel.xy * m.normal_scale, texel.z));
        n = has_hit_texture(id, SLOT_NORMAL) ? bent : n;
    }
    if ((HIT_TEXTURES & (1u << SLOT_CLEARCOAT_NORMAL)) != 0) {
        vec3 texel = hit_texture_or(id, SLOT_CLEARCOAT_NORMAL, point.uvs, footprint, vec4(0.5, 0.5, 1.0, 1.0)).xyz * 2.0 - 1.0;
        vec3 bent = bent_normal(point.n_smooth, point.t_smooth, texel);
        n_coat = has_hit_texture(id, SLOT_CLEARCOAT_NORMAL) ? bent : n_coat;
    }
    r.front = dot(point.n, direction) <= 0.0;
    float side = r.front ? 1.0 : -1.0;
    r.n = side * point.n;
    r.coverage = coverage_of(m, t.base.a);
    r.sheet = point.sheet;
    r.material = id;
    r.transmission = m.transmission;
    r.medium = m.medium;
    r.sigma_thickness = m.sigma_thickness;
    r.s = surface_from_texels(id, m, t, side * n, side * n_coat, -direction, point.p - trace_terms.bvh_from_rel);
    r.s.p_bvh = point.p;
    r.s.n_triangle = r.n;
    r.s.face = point.face;
    return r;
}
#endif
