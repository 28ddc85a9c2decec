// Surfaces at ray hits, from the same vertices and textures that the G-buffer is drawn with.
// Where to read: pbrt 4, section 10.4 (image textures); glTF 2.0, section 3.9. Assumes: bvh space (share/trace.glsl),
// metres; world axes.
#ifndef HIT_GLSL
#define HIT_GLSL
#include "lib/anisotropy.glsl"
#include "lib/bent_normal.glsl"
#include "lib/encode.glsl"
#include "lib/surface.glsl"
#include "lib/trace.glsl"
#include "share/corners.glsl"

// Bit by slot: some material that rays may hit has a texture in it.
layout(constant) const uint HIT_TEXTURES = 0;
layout(constant) const bool HIT_COLORS = false;     // some mesh has vertex colours
layout(constant) const bool HIT_SECOND_UVS = false; // some texture reads the second texture coordinates
const bool HIT_UVS = HIT_TEXTURES != 0;
layout(constant) const bool HIT_TANGENTS = false; // normal maps, or a lobe with a direction

// In the order of the BVH's leaves.
layout(scene, rgba32ui) readonly uniform uimageBuffer hit_corners;
// @texels Corners.frame corner_frame(hit_corners)
// @texels Corners.uvs corner_uvs(hit_corners)
// @texels Corners.second_uvs corner_second_uvs(hit_corners)
// @texels Corners.tangents corner_tangents(hit_corners)
// @texels Corners.colors corner_colors(hit_corners)

// All mip levels of all images, RGBA in bytes. Any lane can read any texel of a texel buffer, while sampled images cannot
// be indexed per lane. lavapipe binds at most 128 MiB of a storage buffer, and 512 MiB of a texel buffer.
layout(scene, r32ui) readonly uniform uimageBuffer texels;

const int MOST_LEVELS = 15; // above level 0, for an image of 32768 texels
const uint TEXELS_SRGB = 1;
const uint TEXELS_NEAREST = 2;
// Wrap modes, u in bits 2 and 3, v in bits 4 and 5: 0 repeat, 1 mirrored repeat, 2 clamp to edge.

int wrapped(int i, int size, uint mode) {
    int period = mode == 1 ? 2 * size : size;
    // Division of integers is slow on lavapipe. That of floats may be below a whole quotient on GPUs: 60/60 < 1.
    int repeated = i - int(floor(float(i) / float(period))) * period;
    repeated += repeated < 0 ? period : repeated >= period ? -period : 0;
    int mirrored = repeated < size ? repeated : period - 1 - repeated;
    return mode == 2 ? clamp(i, 0, size - 1) : clamp(mode == 1 ? mirrored : repeated, 0, size - 1);
}

// Two neighbouring texels along one axis.
ivec2 two_wrapped(int i, int size, uint mode) {
    return ivec2(wrapped(i, size, mode), wrapped(i + 1, size, mode));
}

// One of the channels of four texels, between them by `share`: the texels at low x and high x, first of low y, then of high y.
float between_texels(vec4 of_texels, vec2 share) {
    return mix(mix(of_texels.x, of_texels.y, share.x), mix(of_texels.z, of_texels.w, share.x), share.y);
}

// The same of a channel of colour, which may be stored as sRGB.
float between_colors(vec4 of_texels, vec2 share, bool srgb) {
    if (srgb) of_texels = vec4(linear_from_srgb(of_texels.xyz), linear_channel(of_texels.w));
    return between_texels(of_texels, share);
}

// A texture of a material at uv, bilinear within one mip level: the one whose texels are `footprint` wide in units of uv.
vec4 hit_texture(uint material, uint slot, vec4 uv_sets, float footprint) {
    TextureSlot at_slot = texture_slot(material, slot);
    uvec4 place = material_words(material, at_slot.first);
    vec2 uv = slot_coordinates(at_slot, uv_sets);
    ivec2 size = ivec2(place.y & 0xffffu, place.y >> 16);
    uint levels = place.z & 0xffu;
    uint flags = place.z >> 8;
    // The texture transform may scale; its determinant is the scale of areas.
    float stretch = sqrt(abs(at_slot.u_row.x * at_slot.v_row.y - at_slot.u_row.y * at_slot.v_row.x));
    float across = footprint * stretch * float(max(size.x, size.y));
    int level = clamp(int(floor(log2(max(across, 1.0)) + 0.5)), 0, int(levels) - 1);
    uint first = place.x;
    // Start of the level: the sum of the sizes of the finer levels, which has no closed form for odd sizes. The loop count
    // is the same for every lane: when the level ended the loop, lavapipe read wrong texels for whole groups of lanes.
    for (int i = 0; i < MOST_LEVELS; i++) {
        bool above = i < level;
        first += above ? uint(size.x * size.y) : 0u;
        size = above ? max(size >> 1, ivec2(1)) : size;
    }
    bool nearest = (flags & TEXELS_NEAREST) != 0;
    vec2 at = uv * vec2(size) - (nearest ? 0.0 : 0.5);
    // Very large coordinates have no fraction left; this keeps the integers in range.
    at = clamp(at, -1e9, 1e9);
    ivec2 corner = ivec2(floor(at));
    vec2 share = nearest ? vec2(0.0) : at - floor(at);
    ivec2 rows = int(first) + two_wrapped(corner.y, size.y, flags >> 4 & 3u) * size.x;
    ivec2 columns = two_wrapped(corner.x, size.x, flags >> 2 & 3u);
    vec4 a = unpackUnorm4x8(imageLoad(texels, rows.x + columns.x).x);
    vec4 b = unpackUnorm4x8(imageLoad(texels, rows.x + columns.y).x);
    vec4 c = unpackUnorm4x8(imageLoad(texels, rows.y + columns.x).x);
    vec4 d = unpackUnorm4x8(imageLoad(texels, rows.y + columns.y).x);
    // Channel by channel: the four texels wait as words, a register each. Texel by texel, three more registers were live (RADV).
    bool srgb = (flags & TEXELS_SRGB) != 0;
    return vec4(between_colors(vec4(a.r, b.r, c.r, d.r), share, srgb), between_colors(vec4(a.g, b.g, c.g, d.g), share, srgb),
                between_colors(vec4(a.b, b.b, c.b, d.b), share, srgb), between_texels(vec4(a.a, b.a, c.a, d.a), share));
}

bool has_hit_texture(uint material, uint slot) {
    return (HIT_TEXTURES & (1u << slot)) != 0 && material_words(material, texture_slot(material, slot).first).z != 0;
}

// White where the material has no such texture.
vec4 hit_texture_or_white(uint material, uint slot, vec4 uv_sets, float footprint) {
    if ((HIT_TEXTURES & (1u << slot)) == 0) return vec4(1.0);
    return has_hit_texture(material, slot) ? hit_texture(material, slot, uv_sets, footprint) : vec4(1.0);
}

// Position, frame and attributes of a hit.
struct HitPoint {
    vec3 p;         // bvh space
    vec3 n;         // unit normal of the triangle, on the side of its front
    vec3 n_smooth;  // unit interpolated normal, on the same side
    vec4 t_smooth;  // interpolated tangent and its handedness
    vec4 uvs;
    vec4 color;
    float uv_per_metre; // density of texture coordinates
    float scale;    // length in the world of one metre of the object
    bool sheet;     // thin-walled: transmits light and encloses no medium
    uint material;
    uint face;      // coplanar group of the triangle
};

// Material | ..._TRIANGLE flags.
uint hit_material(uint triangle) {
    return corner_frame(triangle).material;
}

// OPAQUE or FILTER.
uint hit_class(uint triangle) {
    return triangle_at(triangle).stops;
}

// Normal of a triangle on the side of its front; its length is twice the area.
vec3 hit_normal(uint triangle) {
    BvhTriangle t = triangle_at(triangle);
    return doubled_area(t.b - t.a, t.c - t.a);
}

vec4 four_halves(uvec2 words) {
    return vec4(unpackHalf2x16(words.x), unpackHalf2x16(words.y));
}

HitPoint hit_point_of(Hit hit, vec3 origin, vec3 direction) {
    BvhTriangle triangle = triangle_at(hit.triangle);
    CornerFrame frame = corner_frame(hit.triangle);
    vec3 w = vec3(1.0 - hit.u - hit.v, hit.u, hit.v);
    HitPoint r;
    r.p = hit_point(origin, direction, hit.t, triangle.a, triangle.b, triangle.c, hit.u, hit.v);
    r.material = frame.material & MATERIAL_OF_TRIANGLE;
    r.sheet = (frame.material & SHEET_TRIANGLE) != 0;
    r.scale = frame.scale;
    r.face = triangle.face;
    r.uv_per_metre = frame.uv_per_metre;
    r.n = triangle_normal(triangle.a, triangle.b, triangle.c).n;
    vec3 smooth_sum = frame.normal_a * w.x + frame.normal_b * w.y + frame.normal_c * w.z;
    float length2 = dot(smooth_sum, smooth_sum);
    r.n_smooth = length2 > 0.0 ? smooth_sum * inversesqrt(length2) : r.n;
    r.n_smooth = dot(r.n_smooth, r.n) < 0.0 ? -r.n_smooth : r.n_smooth;
    r.t_smooth = vec4(0.0);
    if (HIT_TANGENTS) {
        CornerTangents t = corner_tangents(hit.triangle);
        r.t_smooth = vec4(t.a.xyz * w.x + t.b.xyz * w.y + t.c.xyz * w.z, t.a.w);
    }
    r.uvs = vec4(0.0);
    if (HIT_UVS) {
        CornerUvs uv = corner_uvs(hit.triangle);
        r.uvs.xy = uv.a * w.x + uv.b * w.y + uv.c * w.z;
    }
    if (HIT_SECOND_UVS) {
        CornerUvs uv = corner_second_uvs(hit.triangle);
        r.uvs.zw = uv.a * w.x + uv.b * w.y + uv.c * w.z;
    }
    r.color = vec4(1.0);
    if (HIT_COLORS) {
        CornerColors color = corner_colors(hit.triangle);
        // White stays white to the last bit: the sum of the weights need not be 1.
        vec4 first = four_halves(color.a);
        r.color = first + (four_halves(color.b) - first) * w.y + (four_halves(color.c) - first) * w.z;
    }
    return r;
}

// Coverage of a surface with this alpha: 0 where an alpha-tested surface is cut out, alpha where it is blended, else 1.
float coverage_of(Material m, float texel_alpha) {
    float alpha = texel_alpha * m.base_color.a;
    bool blended = (m.flags & MATERIAL_BLENDED) != 0;
    return blended ? clamp(alpha, 0.0, 1.0) : m.alpha_cutoff > 0.0 && alpha < m.alpha_cutoff ? 0.0 : 1.0;
}

// The alpha test: whether the hit is in a hole of a masked surface. A blended surface is hit however small its alpha.
bool hit_is_hole(HitPoint point) {
    Material m = material_at(point.material);
    vec4 texel = hit_texture_or_white(point.material, SLOT_BASE, point.uvs, 0.0);
    return coverage_of(m, point.color.a * texel.a) == 0.0 && (m.flags & MATERIAL_BLENDED) == 0;
}

struct HitSurface {
    Surface s;
    vec3 n;          // of the triangle, on the viewer's side
    bool front;
    float coverage;
    float transmits; // fraction of the light entering the dielectric part that is transmitted
    float thickness; // thickness texel, times the length in the world of one metre of the object
    bool sheet;      // thin-walled: transmits light and encloses no medium
    uint material;
    // Copied from the material.
    float transmission;
    uint medium;
    vec3 sigma_thickness;
};

// Whether a ray meets the front of a triangle of normal n.
bool is_front(vec3 n, vec3 direction) {
    return dot(n, direction) <= 0.0;
}

// The triangle's normal on the side that a ray comes from.
vec3 facing_normal(HitPoint point, vec3 direction) {
    return is_front(point.n, direction) ? point.n : -point.n;
}

// Slots whose textures are read at a hit.
const uint EVERY_SLOT = ~0u;
// Of paths, which trace the visibility that occlusion textures approximate.
const uint SCATTERING_SLOTS = ~(1u << SLOT_OCCLUSION);
// Where a branch of a ray tree splits: another kernel lights the surface.
const uint SPLITTING_SLOTS = SCATTERING_SLOTS & ~(1u << SLOT_EMISSIVE);
// Of straight light, by the same layers as a path that passes undeflected.
const uint PASSING_SLOTS = SPLITTING_SLOTS & ~(1u << SLOT_DIFFUSE_TRANSMISSION | 1u << SLOT_DIFFUSE_TRANSMISSION_COLOR);
// Of transparent shadows, which count angles to the interpolated normal.
const uint FILTERING_SLOTS = PASSING_SLOTS & ~(1u << SLOT_CLEARCOAT_NORMAL | 1u << SLOT_CLEARCOAT_ROUGHNESS | 1u << SLOT_ANISOTROPY | 1u << SLOT_NORMAL);

// The surface seen along `direction` by a ray (cone) of diameter `width` at the hit, from the textures of `slots`.
HitSurface hit_surface(HitPoint point, vec3 direction, float width, uint slots) {
    HitSurface r;
    uint id = point.material;
    Material m = material_at(id);
    float cos_v = abs(dot(point.n, direction));
    float footprint = width * point.uv_per_metre / max(cos_v, 0.05);
    Texels t = texels_of_nothing(point.color);
    vec3 normal = vec3(0.0, 0.0, 1.0);
    vec3 coat_normal = normal;
    uint wanted = HIT_TEXTURES & slots;
    if (wanted != 0) {
        // Texture by texture: the code that reads one stands once here, and not once for each slot.
        for (uint unread = wanted; unread != 0; unread &= unread - 1) {
            uint slot = uint(findLSB(unread));
            if (has_hit_texture(id, slot)) {
                vec4 value = hit_texture(id, slot, point.uvs, footprint);
                put_texel(t, wanted, slot, value);
                if (slot == SLOT_NORMAL) normal = value.xyz * 2.0 - 1.0;
                if (slot == SLOT_CLEARCOAT_NORMAL) coat_normal = value.xyz * 2.0 - 1.0;
            }
        }
    }
    r.transmits = m.transmission * t.transmission;
    r.thickness = point.scale * t.thickness;
    vec3 n = point.n_smooth;
    vec3 n_coat = n;
    if ((wanted & (1u << SLOT_NORMAL)) != 0) {
        vec3 bent = bent_normal(point.n_smooth, point.t_smooth, vec3(normal.xy * m.normal_scale, normal.z));
        n = has_hit_texture(id, SLOT_NORMAL) ? bent : n;
    }
    if ((wanted & (1u << SLOT_CLEARCOAT_NORMAL)) != 0) {
        vec3 bent = bent_normal(point.n_smooth, point.t_smooth, coat_normal);
        n_coat = has_hit_texture(id, SLOT_CLEARCOAT_NORMAL) ? bent : n_coat;
    }
    if (ANISOTROPY) {
        t.tangent = anisotropy_direction(n, point.t_smooth, t.tangent.xy, lobe_factors(id, LOBE_ANISOTROPY).yz);
    }
    r.front = is_front(point.n, direction);
    float side = r.front ? 1.0 : -1.0;
    r.n = facing_normal(point, direction);
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
