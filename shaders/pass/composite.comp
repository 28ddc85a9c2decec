// Order-independent transparency: composites the A-buffer's fragments of a pixel over the opaque surface, nearest first.
// radiance += T a L, T *= 1 − a + a t, where T is the transmittance so far, a coverage and t the transmittance of the
// surface. The result has premultiplied alpha. Selecting the next nearest fragment again and again sorts the per-pixel
// linked list without moving anything; n fragments cost n² steps. Where a driver limits the loop iterations of an
// invocation, the fragments beyond are counted.
// Where to read: Carpenter 1984 (A-buffer); Yang et al. 2010 (per-pixel linked lists); RTR 4, section 5.5;
// docs/decisions/transparency.md. Assumes: world axes, positions relative to the eye, reversed depth.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/fragment_list.glsl"
#include "lib/bent_view.glsl"
#include "lib/instances.glsl"
#include "lib/lighting.glsl"
#include "lib/primary.glsl"
#include "lib/screen.glsl"
#include "lib/work_count.glsl"
#include "lib/work_tile.glsl"

layout(pass, r32ui) readonly uniform uimage2D heads;
layout(pass, scalar) readonly buffer Nodes { uint nodes[]; };
layout(pass, rgba32f) uniform image2D radiance;
layout(pass, scalar) buffer Dropped { uint dropped; };
layout(pass, scalar) readonly buffer Tiles { uint fragment_tiles[]; };
layout(pass, scalar) readonly buffer Sizes { WorkSize tiles_size; } work;
layout(push_constant, scalar) uniform Push { uint end_row; };

const uint NODE_WORDS = STORED_LOBES ? LEAST_NODE_WORDS + LOBE_WORDS : LEAST_NODE_WORDS;
layout(constant) const bool BENDS = false;   // knob `refraction`: screen
layout(constant) const bool MIRRORS = false; // knob `reflection`: screen
layout(constant) const bool BEHIND_ALONE = false; // keeps only the background seen through the surfaces, without their own radiance

// Whether key a comes after key b: farther away (smaller depth). Of coplanar fragments the one drawn later lies on top.
bool after(uvec3 a, uvec3 b) {
    if (a.x != b.x) return a.x < b.x; // depth is in [0, 1]: its bits order as its values do
    if (a.y != b.y) return a.y < b.y;
    return a.z < b.z;
}

LightSample drawn_apart() {
    return NO_LIGHT_SAMPLE;
}

void main() {
    uint place = listed_tile(gl_WorkGroupID);
    if (place >= work.tiles_size.count) return;
    ivec2 pixel = unpacked_pixel(fragment_tiles[place]) + ivec2(gl_LocalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(pixel), uvec2(camera.size.x, end_row)))) return;
    uint head = imageLoad(heads, pixel).x;
    if (head == END_OF_LIST) return;
    uint tiles_across = (camera.size.x + TILE - 1) / TILE;
    vec3 direction = view_direction(camera, pixel);
    vec3 sum = vec3(0.0);
    vec3 through = vec3(1.0);
    uvec3 last = uvec3(0xffffffffu);
    LightRange all = LightRange(0, DIRECTIONAL_LIGHTS + LIGHT_SAMPLES + LOCAL_LIGHTS, 0, TILE_WORDS);
    vec2 shift = vec2(0.0); // offset in pixels of the refracted background
    uint surface = FIRST_FRAGMENT;
    float entry = 0.0;      // depth of the nearest transparent solid
    uint per_fragment = 0; // loop iterations of the last fragment: its neighbours in the list see the same lights
    while (true) {
        // 1. Select: the nearest fragment behind the last one.
        uint best = END_OF_LIST;
        uvec3 best_key = uvec3(0);
        uint before = loop_iterations;
        for (uint node = head; node != END_OF_LIST; node = nodes[node * NODE_WORDS]) {
            uint at = node * NODE_WORDS;
            uvec3 key = uvec3(nodes[at + 1], nodes[at + 2], nodes[at + 3]);
            if (after(key, last) && !after(key, best_key)) {
                best = node;
                best_key = key;
            }
        }
        if (best == END_OF_LIST) break;
        if (loop_iterations + per_fragment > LOOP_BUDGET) {
            if (!BEHIND_ALONE) atomicAdd(dropped, 1u);
            break;
        }
        // 2. Unpack: the surface, from the node.
        last = best_key;
        uint at = best * NODE_WORDS;
        uint word = nodes[at + 4];
        Material m = material_at(word & 0xffffu);
        vec2 blue_metal = unpackHalf2x16(nodes[at + 6]);
        vec2 blue_alpha = unpackHalf2x16(nodes[at + 9]);
        Texels t = texels_of_nothing(vec4(unpackHalf2x16(nodes[at + 5]), blue_metal.x, 1.0));
        t.metallic = blue_metal.y;
        t.roughness = float(word >> 16) * (1.0 / 65535.0);
        t.occlusion = unpackUnorm2x16(nodes[at + 10]).x;
        t.emissive = vec3(unpackHalf2x16(nodes[at + 8]), blue_alpha.x);
        vec3 n_coat;
        unpack_layers(uvec4(nodes[at + 11], nodes[at + 12], nodes[at + 13], nodes[at + 14]), t, n_coat);
        if (STORED_LOBES) unpack_lobes(uvec4(nodes[at + 15], nodes[at + 16], nodes[at + 17], nodes[at + 18]), t);
        vec3 n = unit_from_octahedral(unpackSnorm2x16(nodes[at + 7]));
        vec3 p = rel_from_pixel(camera, pixel, uintBitsToFloat(nodes[at + 1]));
        Surface s = surface_from_texels(word & 0xffffu, m, t, n, n_coat, -direction, p);
        s.p_bvh = p + trace_terms.bvh_from_rel;
        if (STORED_TRIANGLES) {
            uint leaf = leaf_places[nodes[at + 3]];
            if (leaf != NO_TRIANGLE) put_on_triangle(s, leaf, direction);
        }
        s.media = trace_terms.camera_media;
        float transmission = m.transmission * t.transmission;
        float scale = t.thickness * instances[nodes[at + 2]].scale;
        // 3. Screen-space refraction: the offset where a solid is entered.
        if (BENDS) {
            bool body = (instances[nodes[at + 2]].flags & INSTANCE_SHEET) == 0 && m.transmission > 0.0 &&
                        (m.flags & MATERIAL_BLENDED) == 0;
            shift += body ? bent_shift(camera, pixel, p, direction, s.n, m.ior, m.thickness * scale) : vec2(0.0);
            entry = max(entry, body ? uintBitsToFloat(nodes[at + 1]) : 0.0);
        }
        // 4. Transmittance: light that is not reflected passes, tinted by the base colour and absorbed over the nominal
        //    thickness (A1). It passes straight, or with refraction `screen` bent where a solid is entered.
        vec3 tint = s.base * exp(-m.sigma_thickness * scale);
        vec3 reflected = fresnel_of_base(s, clamp(dot(s.n, s.v), 0.0, 1.0)).dielectric;
        vec3 passes = straight_transmittance(tint, transmission * (1.0 - s.metallic), reflected, under_coat(s), left_to_base(s));
        keep_diffuse(s, 1.0 - transmission);
        s.passes = passes_roughly(s, (instances[nodes[at + 2]].flags & INSTANCE_SHEET) != 0, tint, transmission);
        // 5. Lighting of the fragment.
        float alpha = blue_alpha.y;
        s.lobe = lobe_reflectance(s);
        vec3 shown = radiance_to_eye(s, pixel, surface, tiles_across, all, true);
        // Screen-space reflection for the nearest fragment alone: a ray may march as many steps as the picture is wide.
        // What the lookup of the environment has computed is not kept while lights are summed.
        s = found_anew(s, floatBitsToUint(abs(shown.x)));
        if (MIRRORS) shown = not_negative(shown + mirrored_on_screen(s, surface == FIRST_FRAGMENT));
        surface++;
        // 6. Composite front to back.
        sum += through * alpha * shown;
        through *= 1.0 - alpha + alpha * passes;
        per_fragment = loop_iterations - before;
    }
    // 7. The background, over which the fragments lie.
    vec4 behind = imageLoad(radiance, pixel);
    if (BENDS) {
        // The nearest pixel of the picture. Surfaces in front of the solid are not seen through it.
        ivec2 bent = clamp(pixel + ivec2(floor(shift + 0.5)), ivec2(0), ivec2(camera.size) - 1);
        int from = bent.y * int(camera.size.x) + bent.x;
        if (stored_depth(from) < entry) behind = seen[from];
    }
    float coverage = 1.0 - (through.r + through.g + through.b) * (1.0 / 3.0) * (1.0 - behind.a);
    imageStore(radiance, pixel, vec4((BEHIND_ALONE ? vec3(0.0) : sum) + through * behind.rgb, coverage));
    lights_cut_off += samples_cut_off;
    if (sends_shadow_rays() && !BEHIND_ALONE) count_rays(0, 0, 0.0, 0.0);
}
