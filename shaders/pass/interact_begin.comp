// Reflection and refraction in steps, 1 of 6: writes the light of complete ray trees into the picture, and begins the trees of
// other pixels: the branches of their primary surfaces, from the G-buffer.
// Where to read: lib/interact_steps.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 64) in;
#include "lib/interact_steps.glsl"

layout(pass, rgba32f) uniform image2D radiance;
layout(pass, scalar) readonly buffer RayTiles { uint ray_tiles[]; };
layout(pass, scalar) readonly buffer Sizes { WorkSize rays_size; } work;

void main() {
    uint place = place_in_queue();
    bool begins = place < steps[this_step].beginning.count;
    // 1. The complete tree, but at first.
    uint entry = begins ? queues[queue_start(BEGINNING, this_step) + place] : 0u;
    tree = entry == NO_TREE ? place : entry;
    uint complete = begins && entry != NO_TREE ? trees[tree_word(TREE_PIXEL)].x : NO_PIXEL;
    float lost_by_tree = 0.0;
    if (complete != NO_PIXEL) {
        read_sum();
        read_around();
        ivec2 pixel = unpacked_pixel(complete);
        vec4 before = imageLoad(radiance, pixel);
        imageStore(radiance, pixel, vec4(before.rgb + (sum + around), before.a * (1.0 - min(escaped, 1.0))));
        lost_by_tree = lost;
    }
    // 2. The next pixel: neighbours take neighbours.
    uint earlier = subgroupExclusiveAdd(begins ? 1u : 0u);
    uint wanted = subgroupAdd(begins ? 1u : 0u);
    uint base = 0;
    if (subgroupElect() && wanted > 0) base = atomicAdd(pixels_taken, wanted);
    uint next = subgroupMax(base) + earlier;
    const uint in_tile = WORK_TILE * WORK_TILE;
    begins = begins && next / in_tile < work.rays_size.count;
    sum = vec3(0.0);
    around = vec3(0.0);
    escaped = 0.0;
    lost = 0.0;
    if (begins) {
        ivec2 within = ivec2(next % WORK_TILE, next % in_tile / WORK_TILE);
        ivec2 pixel = unpacked_pixel(ray_tiles[next / in_tile]) + within;
        bool drawn = all(lessThan(uvec2(pixel), camera.size));
        if (drawn) {
            // 3. Its primary surface, and the first branches.
            Primary primary = primary_surface(pixel, true);
            drawn = primary.drawn;
            if (drawn) {
                HitSurface hit = primary.hit;
                Branch ray = ray_to_primary(hit);
                Boundary boundary = boundary_at(hit, ray.media, ray.direction);
                split(hit, boundary, ray, cone_at_primary(hit), uvec2(pixel), 0);
            }
        }
        trees[tree_word(TREE_PIXEL)] = uvec4(drawn ? packed_pixel(uvec2(pixel)) : NO_PIXEL, waiting, 0u, 0u);
        write_sum();
        write_around();
    }
    APPEND_TO_QUEUE(steps[this_step].growing, queues, queue_start(GROWING, this_step), begins && waiting > 0, tree)
    APPEND_TO_QUEUE(steps[this_step + 1].beginning, queues, queue_start(BEGINNING, this_step + 1), begins && waiting == 0, tree)
    if (FIRST_EVENT == 0) count_rays(0, 0, lost_by_tree, lost_by_tree);
}
