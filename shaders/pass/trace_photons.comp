// Photon tracing: each photon leaves a punctual light and follows smooth surfaces until it lands on one that scatters.
// Next event estimation finds light that no surface deflects. So a photon lands only after a surface has deflected it.
// Where to read: Jensen 2001, chapter 5; Veach 1997, section 5.3 (adjoint BSDF of shading normals); docs/decisions/paths.md.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
#include "lib/path_vertex.glsl"
#include "lib/punctual.glsl"
#include "lib/work_tile.glsl"
#include "share/photon_map.glsl"

layout(pass, scalar) readonly buffer Rays { PhotonRay rays[]; };
layout(pass, scalar) writeonly buffer Landings { Landing landings[]; };
layout(push_constant) uniform Push { uint count; };

// Russian roulette from this surface on: light that total reflection keeps in a body would hold up the invocations beside
// it. In study:nested a photon takes 6 us instead of 11 (lavapipe).
const uint ROULETTE_FROM = 4;
const float SURVIVES = 0.75;

// The photons of a sample are the elements of one sequence for each surface and draw.
uvec2 photon_words(uint photon, uint surface, uint draw) {
    return random_words(uvec2(trace_terms.sample_index, 0xffffu) * BLOCK, surface * DIMENSION_PAIRS + draw, trace_terms.seed, photon, 1);
}

void main() {
    uint index = listed_tile(gl_WorkGroupID) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    bool alive = index < count;
    PhotonRay ray = rays[alive ? index : 0u];
    Light light = light_at(ray.light);
    Path p;
    p.origin = ray.origin;
    p.direction = ray.direction;
    p.source_face = 0xffffffffu;
    p.pdf = 0.0;
    p.throughput = vec3(1.0);
    p.state = 0;
    p.media = ray.media;
    p.distance_since_vertex = 0.0;
    p.t_min = 0.0;
    p.sum = vec3(0.0);
    bool deflected = false;
    float travelled = 0.0;
    float index_at_light = index_of(present_medium(p.media));
    Landing landing = Landing(vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0));
    for (uint surface = 0; surface <= trace_terms.interfaces && alive; surface++) {
        // 1. The next vertex.
        Hit found = trace(p.origin, p.direction, p.source_face, Hit(p.t_min, NO_TRIANGLE, 0.0, 0.0), LARGEST, OPAQUE | FILTER, false);
        uvec2 event = photon_words(index, surface, DIMENSION_EVENT);
        PathVertex vertex = path_vertex_at(p, found, event.x);
        BsdfSample drawn = bsdf_sample(vertex.bsdf, vertex.x, vec2(0.5));
        travelled += vertex.at_surface ? found.t : 0.0;
        bool lobe = !vertex.passed_by && !drawn.specular;
        // 2. It lands where a lobe is drawn that scatters. Those lobes together stand for all light that arrives.
        float share = scattering_share(vertex.bsdf.layers) * vertex.interaction.hit.coverage;
        if (lobe && vertex.at_surface && deflected && share > 0.0 && !vertex.interaction.hit.s.unlit) {
            float spot = spot_share(dot(light.axis, ray.direction), light.spot_scale, light.spot_offset);
            float towards = ray.light < DIRECTIONAL_LIGHTS ? 1.0 : spot * range_window(travelled * travelled, light.inv_range2);
            landing.position = vertex.interaction.hit.s.p_bvh;
            landing.normal = vertex.interaction.hit.n;
            landing.to_light = -p.direction;
            // Paths carry radiance divided by the square of the index of refraction, and lights give it to them.
            float index_ratio = index_at_light / index_of(present_medium(p.media));
            landing.power = p.throughput * light.color * (ray.measure * towards * index_ratio * index_ratio / share);
        }
        alive = vertex.at_surface && !lobe && (vertex.passed_by || !vertex.interaction.hit.s.unlit);
        // 3. Or goes on.
        vec3 before = p.direction;
        bool straight = is_unscattered(vertex, drawn);
        p.throughput *= weight_of(vertex, drawn, drawn.weight);
        vec3 n = drawn.coat ? vertex.interaction.hit.s.n_coat : vertex.interaction.hit.s.n;
        if (!straight) p.throughput *= adjoint_weight(before, vertex.passed_by ? before : drawn.direction, n, vertex.interaction.hit.n);
        deflected = deflected || !straight;
        leave(p, vertex, drawn, ray_origin(vertex.interaction.hit.s.p_bvh, vertex.interaction.hit.n, vertex.interaction.hit.s.v));
        if (surface >= ROULETTE_FROM) {
            alive = alive && unit_float(event.y) < SURVIVES;
            p.throughput /= SURVIVES;
        }
        alive = alive && largest(p.throughput) > 0.0;
    }
    if (index < count) landings[index] = landing;
}
