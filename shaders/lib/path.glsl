// Path tracing, one bounce: next event estimation with multiple importance sampling, and Russian roulette (lecture R6).
// At each vertex two strategies estimate the light that arrives: a light sample with its shadow ray (next event
// estimation), and the BSDF sample that continues the path. The power heuristic weights both (multiple importance sampling,
// MIS). An interaction that does not deflect the path (a hole, a smooth thin-walled surface) starts no new vertex for MIS:
// the shadow ray passes it as the path does.
// Where to read: pbrt 4, sections 13.2 to 13.4 and 15.3 (wavefront path tracing); Veach 1997, chapter 9;
// docs/decisions/paths.md.
// Assumes: bvh space, metres; densities per solid angle; radiance divided by the square of the index of refraction.
#ifndef PATH_GLSL
#define PATH_GLSL
#include "lib/light_sampling.glsl"
#include "lib/path_vertex.glsl"
#include "lib/photon_map.glsl"
#include "lib/work_count.glsl"

layout(constant) const bool EMISSIVE_LIGHTS = false; // emissive surfaces light the scene; otherwise they are only seen

// Russian roulette from this vertex on: a path survives with a probability that falls with the path throughput, at most
// MOST_LIKELY.
const uint RUSSIAN_ROULETTE_FROM = 4;
const float MOST_LIKELY = 0.95;

float lost = 0.0;
float most_lost = 0.0;
uint path_rays = 0;

// A shadow ray: the visibility test for a light sample.
struct ShadowRay {
    vec3 origin;
    vec3 to_light;
    float t_max;       // negative: no shadow ray
    uint source_face;
    uvec4 media;
    vec3 contribution; // what the light adds to the path if nothing occludes it
};

bool is_finite(vec3 v) {
    return all(lessThanEqual(abs(v), vec3(LARGEST)));
}

// Replaces NaN or infinite radiance by 0, counts it, and stores where the first one occurred.
vec3 finite_or_zero(vec3 light, uvec2 pixel, uint material, uint surface) {
    bool good = is_finite(light);
    if (!good) {
        atomicAdd(counts.not_finite, 1u);
        if (atomicCompSwap(counts.not_finite_event, 0u, surface + 1) == 0u) {
            counts.not_finite_pixel = pixel.x | pixel.y << 16;
            counts.not_finite_material = material;
        }
    }
    return good ? light : vec3(0.0);
}

// End of the shadow ray: four roundings before the light, so that a surface touching the light does not occlude it.
float shadow_ray_t_max(ShadowRay shadow_ray) {
    return shadow_ray.t_max == 1.0 ? 1.0 - 4.0 / 16777216.0 : shadow_ray.t_max;
}

// Transmittance of the medium along a shadow ray without occluders.
vec3 unoccluded_transmittance(ShadowRay shadow_ray) {
    uint medium = present_medium(shadow_ray.media);
    float size = vector_length(shadow_ray.to_light);
    bool absorbs = ABSORPTION == ABSORPTION_PATH && medium != 0 && shadow_ray.t_max == 1.0;
    return absorbs ? absorbed(medium, shadow_ray.origin, shadow_ray.to_light / size, size) : vec3(1.0);
}

// Transmittance of everything on the straight shadow ray. It equals what a path gets that passes the same surfaces
// undeflected, so MIS may weight both strategies against each other.
vec3 shadow_ray_transmittance(ShadowRay shadow_ray) {
    vec3 through = vec3(shadow_ray.t_max > 0.0 ? 1.0 : 0.0);
    float size = vector_length(shadow_ray.to_light);
    vec3 direction = shadow_ray.to_light / size;
    Hit last = FROM_ORIGIN;
    bool goes_on = shadow_ray.t_max > 0.0;
    uvec4 media = shadow_ray.media;
    vec3 result = through;
    do {
        Hit found = trace(shadow_ray.origin, shadow_ray.to_light, shadow_ray.source_face, last, goes_on ? shadow_ray_t_max(shadow_ray) : -1.0, OPAQUE | FILTER, false);
        bool at_surface = goes_on && found.triangle != NO_TRIANGLE;
        uint medium = present_medium(media);
        float behind = 0.0;
        if (goes_on && ABSORPTION == ABSORPTION_PATH && medium != 0) {
            float end = at_surface ? found.t : min(shadow_ray.t_max, 1.0);
            // The last segment to a light at infinity has no end: its absorption is not counted.
            float far = at_surface || shadow_ray.t_max == 1.0 ? max(end - last.t, 0.0) * size : 0.0;
            through *= absorbed(medium, shadow_ray.origin + shadow_ray.to_light * last.t, direction, far);
        }
        if (at_surface) {
            if (hit_class(found.triangle) == OPAQUE) {
                through = vec3(0.0);
            } else {
                Interaction interaction = interaction_at(hit_point_of(found, shadow_ray.origin, shadow_ray.to_light), media, direction, PASSING_SLOTS);
                Layers b = passing_layers_at(interaction.hit, interaction.boundary);
                vec3 passes = is_straight(b) ? straight_transmittance(b) : vec3(0.0);
                through *= interaction.boundary.suppressed_by_priority ? vec3(1.0) : 1.0 - interaction.hit.coverage + interaction.hit.coverage * passes;
                bool enters = interaction.boundary.solid && (interaction.boundary.suppressed_by_priority || interaction.hit.coverage > 0.0);
                media = enters ? interaction.boundary.media_out : media;
                // Interfaces that coincide with this one have been crossed with it: the ray goes on behind them, as a path does.
                bool crossed = COINCIDENT_INTERFACES && enters && !interaction.boundary.touches_opaque;
                behind = crossed ? trace_terms.offset / max(-dot(interaction.hit.n, direction), 1.0 / 16.0) : 0.0;
            }
            last = behind > 0.0 ? Hit(found.t + behind / size, NO_TRIANGLE, 0.0, 0.0) : found;
        }
        if (goes_on) result = through;
        goes_on = at_surface && largest(through) > 0.0 && loop_iterations < LOOP_BUDGET;
    } while (goes_on);
    return result;
}

// The share of a light sample that arrives along its shadow ray.
vec3 arriving(ShadowRay shadow_ray) {
    if (FILTERS) return shadow_ray_transmittance(shadow_ray);
    bool blocked = trace(shadow_ray.origin, shadow_ray.to_light, shadow_ray.source_face, FROM_ORIGIN, shadow_ray_t_max(shadow_ray),
                         OPAQUE | FILTER, true).triangle != NO_TRIANGLE;
    return blocked ? vec3(0.0) : unoccluded_transmittance(shadow_ray);
}

// The shadow ray for one of LIGHT_SAMPLES light samples at a vertex, with its MIS-weighted contribution.
ShadowRay shadow_ray_to(Path p, Interaction interaction, bool scatters, vec3 front_origin, LightSample light, PathEval towards) {
    ShadowRay shadow_ray;
    float w = light.pdf > 0.0 ? mis_weight(light.pdf * float(LIGHT_SAMPLES), towards.pdf) : 1.0;
    vec3 contribution = p.throughput * towards.f_cos * light.arriving * (w / float(LIGHT_SAMPLES));
    // NaN is wanted: it is counted, not dropped.
    bool wanted = scatters && !(contribution.r + contribution.g + contribution.b <= 0.0);
    bool behind = dot(interaction.hit.n, light.to_light) < 0.0;
    shadow_ray.origin = behind ? ray_origin(interaction.hit.s.p_bvh, -interaction.hit.n, vec3(0.0)) : front_origin;
    // The sampled point on the light stays the same, wherever the ray starts.
    shadow_ray.to_light = light.t_max == 1.0 ? light.to_light + (front_origin - shadow_ray.origin) : light.to_light;
    shadow_ray.t_max = wanted ? light.t_max : -1.0;
    shadow_ray.source_face = interaction.hit.s.face;
    shadow_ray.media = behind && interaction.boundary.solid ? interaction.boundary.media_out : p.media;
    shadow_ray.contribution = wanted ? contribution : vec3(0.0);
    return shadow_ray;
}

// Weight of the emission of a surface that the path has found itself, of normal n: the power heuristic.
float weight_of_emission(Path p, Hit found, vec3 n) {
    float r = p.distance_since_vertex + found.t;
    float cos_light = max(abs(dot(n, p.direction)), 1e-9);
    // The last vertex for MIS lies straight behind: what the path has met since did not deflect it.
    vec3 last_vertex = p.origin - p.direction * p.distance_since_vertex;
    float drawn = density_per_solid_angle(light_pdf_area(found.triangle, last_vertex, p.pdf > 0.0), r * r, cos_light);
    return p.pdf > 0.0 && drawn > 0.0 ? mis_weight(p.pdf, float(LIGHT_SAMPLES) * drawn) : 1.0;
}

// The first light sample of a vertex whose shadow rays start at `origin`.
LightSample draw_first_light(Path p, vec3 origin, uvec2 pixel) {
    return sample_light(origin, dimension_words_of(pixel, p.state & PATH_SURFACES, DIMENSION_LIGHT, 0, LIGHT_SAMPLES));
}

// A photon near a vertex; none where it is not wanted.
PhotonSample draw_photon(Path p, vec3 p_bvh, vec3 n, uvec2 pixel, bool wanted) {
    float chooses = unit_float(dimension_words(pixel, (p.state & PATH_SURFACES) + 1, DIMENSION_PHOTON).x);
    return sample_photons(p_bvh, n, chooses, wanted);
}

// All three as the program has them: computed where they are needed, or before (path_sample.comp).
float emission_weight(Path p, Hit found, vec3 n);
LightSample first_light(Path p, vec3 origin, uvec2 pixel);
PhotonSample photon_near(Path p, vec3 p_bvh, vec3 n, uvec2 pixel, bool wanted);
// p.media: kept by the program, or read again from memory, so that no registers hold it while the BSDF is evaluated.
uvec4 media_before(Path p);

// What a path knows of a vertex, and what waits while the BSDF is evaluated (VECTORS_WAIT).
const uint WAITING_THROUGHPUT = 0;
const uint WAITING_ARRIVING = 1; // of the light sample
const uint WAITING_WEIGHT = 2;   // of the BSDF sample
const uint WAITING_GATHERED = 3;
shared vec3 path_waiting[VECTORS_WAIT ? 4u * TRACING_LANES : 1u];

// What waits, where it does; otherwise `kept`.
vec3 waited(uint which, uint of_turn, vec3 kept) {
    return VECTORS_WAIT ? path_waiting[waiting_word(which, of_turn)] : kept;
}

void gather(inout vec3 gathered, vec3 light, uint of_turn) {
    if (VECTORS_WAIT) {
        path_waiting[waiting_word(WAITING_GATHERED, of_turn)] += light;
    } else {
        gathered += light;
    }
}

// Shades one path vertex. Returns the radiance gathered there; also gives the shadow ray still to be traced, and the
// continued path p.
// Steps: 1. the vertex; 2. the BSDF sample; 3. next event estimation; light found by the path itself: 4a. the environment, 4b.
// emission of the surface; 5. the BSDF towards all light samples, a photon, and along the path, in one loop; 6. further
// light samples, in that loop; 7. the continued path; 8. Russian roulette.
vec3 shade_vertex(inout Path p, Hit found, uvec2 pixel, bool alive, out ShadowRay shadow_ray) {
    // 1. The vertex: absorption on the way, hit, boundary, BSDF.
    shadow_ray = ShadowRay(p.origin, vec3(0.0, 1.0, 0.0), -1.0, p.source_face, p.media, vec3(0.0));
    vec3 gathered = vec3(0.0);
    uint vertices_before = p.state & PATH_SURFACES;
    uvec2 event = dimension_words(pixel, vertices_before, DIMENSION_EVENT);
    PathVertex vertex = path_vertex_at(p, found, event.x);
    bool at_surface = vertex.at_surface;
    bool passed_by = vertex.passed_by;
    Interaction interaction = vertex.interaction;
    HitSurface hit = interaction.hit;
    if (PATH_GUIDING) enable_guiding(vertex.bsdf);
    Layers b = vertex.bsdf.layers;

    // 2. The BSDF sample that continues the path. Before the light sample, which would wait in registers.
    uvec2 words = dimension_words(pixel, vertices_before, DIMENSION_DIRECTION);
    BsdfSample drawn = bsdf_sample(vertex.bsdf, vertex.x, vec2(unit_float(words.x), unit_float(words.y)));

    // 3. Next event estimation: a light sample.
    LightSample light = LightSample(p.direction, -1.0, vec3(0.0), 0.0);
    bool scatters = at_surface && !passed_by && !hit.s.unlit && (!b.delta || b.shares.z > 0.0 || (CLEARCOAT && !b.coat_delta));
    vec3 front_origin = ray_origin(hit.s.p_bvh, hit.n, hit.s.v);
    if (EMITTERS > 0) light = first_light(p, front_origin, pixel);
    // 4a. Light found by the path itself: the environment, weighted by the power heuristic.
    if (ENVIRONMENT) {
        vec3 towards = at_surface ? light.to_light : p.direction;
        vec3 seen = environment_radiance(towards);
        // The background replaces the environment where it is seen directly: straight ahead and through the surface.
        bool directly_visible = OTHER_BACKGROUND && (p.state & PATH_TRANSPARENT_SO_FAR) != 0;
        bool ahead = directly_visible && (!at_surface || dot(hit.n, light.to_light) < 0.0 && !shines_through(b));
        if (ahead) seen = background_radiance(towards);
        float w = p.pdf > 0.0 ? mis_weight(p.pdf, float(LIGHT_SAMPLES) * environment_pdf(p.direction)) : 1.0;
        if (!at_surface) gathered = p.throughput * seen * w;
        if (SAMPLED_ENVIRONMENT && light.pdf > 0.0 && light.t_max == LARGEST) light.arriving *= seen;
    }
    bool ends = !at_surface;
    float background_share = mean(p.throughput);
    bool escaped = !at_surface && !SKY && (p.state & PATH_TRANSPARENT_SO_FAR) != 0;

    // 4b. Light found by the path itself: emission of the surface, weighted by the power heuristic.
    if (at_surface && !passed_by) {
        vec3 emits = hit.s.unlit ? hit.s.base : hit.s.emissive * under_coat(hit.s);
        // Single-sided surfaces emit on their front alone.
        bool shows = EMISSIVE_LIGHTS || (p.state & PATH_NON_SPECULAR) == 0;
        shows = shows && (hit.s.unlit || hit.front || (hit_material(vertex.leaf) & ONE_SIDED_TRIANGLE) == 0);
        float w = EMISSIVE_TRIANGLES ? emission_weight(p, Hit(found.t, vertex.leaf, 0.0, 0.0), hit.n) : 1.0;
        gathered = shows ? p.throughput * emits * w : vec3(0.0);
        ends = ends || hit.s.unlit;
    }

    // 5. BSDF and density for both strategies.
    uint vertices = vertices_before + 1;
    if (!ends && vertices > trace_terms.interfaces) {
        lost += largest(p.throughput);
        most_lost = max(most_lost, largest(p.throughput));
        ends = true;
    }
    PhotonSample photon = PhotonSample(0u, vec3(0.0));
    if (PHOTON_MAP) photon = photon_near(p, hit.s.p_bvh, hit.n, pixel, scatters && alive);
    // First towards the light samples, then to a photon, at last along the path, in a loop: the code exists once.
    PathEval towards_light = PathEval(vec3(0.0), 0.0, 0.0);
    PathEval on_path = PathEval(vec3(0.0), 0.0, 0.0);
    LightSample sampled = light;
    uint last = LIGHT_SAMPLES + (PHOTON_MAP ? 1u : 0u);
    if (VECTORS_WAIT) {
        path_waiting[waiting_word(WAITING_THROUGHPUT, 0)] = p.throughput;
        path_waiting[waiting_word(WAITING_ARRIVING, 0)] = light.arriving;
        path_waiting[waiting_word(WAITING_WEIGHT, 0)] = drawn.weight;
        path_waiting[waiting_word(WAITING_GATHERED, 0)] = gathered;
    }
    Bsdf bsdf = vertex.bsdf;
    for (uint i = 0; i <= last; i++) {
        bsdf.layers = in_turn(bsdf.layers, i);
        bool further = EMITTERS > 0 && LIGHT_SAMPLES > 1 && i > 0 && i < LIGHT_SAMPLES;
        vec3 towards = i == last ? drawn.direction : normalize(found_anew(sampled.to_light, i));
        if (further) {
            // 6. A further light sample; its shadow ray is traced below.
            sampled = sample_light(front_origin, dimension_words_of(pixel, vertices_before, DIMENSION_LIGHT, i, LIGHT_SAMPLES));
            if (SAMPLED_ENVIRONMENT && sampled.pdf > 0.0 && sampled.t_max == LARGEST) {
                bool ahead = OTHER_BACKGROUND && (p.state & PATH_TRANSPARENT_SO_FAR) != 0 && dot(hit.n, sampled.to_light) < 0.0 && !shines_through(b);
                sampled.arriving *= ahead ? background_radiance(sampled.to_light) : environment_radiance(sampled.to_light);
            }
            towards = normalize(sampled.to_light);
        }
        if (PHOTON_MAP && i == LIGHT_SAMPLES) towards = to_light_of(photon);
        PathEval now = bsdf_evaluate(bsdf, towards);
        if (i == 0) towards_light = now;
        on_path = now;
        if (PHOTON_MAP && i == LIGHT_SAMPLES && largest(photon.arriving) > 0.0) {
            gather(gathered, waited(WAITING_THROUGHPUT, i, p.throughput) * now.f_cos * photon.arriving, i);
        }
        if (further) {
            Path at_vertex = p;
            at_vertex.throughput = waited(WAITING_THROUGHPUT, i, p.throughput);
            ShadowRay one = shadow_ray_to(at_vertex, interaction, scatters, front_origin, sampled, now);
            one.t_max = alive ? one.t_max : -1.0;
            shadow_rays += one.t_max > 0.0 ? 1u : 0u;
            vec3 arrives = arriving(one);
            if (one.t_max > 0.0) gather(gathered, finite_or_zero(one.contribution, pixel, hit.material, vertices_before) * arrives, i);
        }
    }
    // What no register has held through the loop.
    uint of_turn = trace_terms.sample_index;
    p.throughput = waited(WAITING_THROUGHPUT, of_turn, p.throughput);
    light.arriving = waited(WAITING_ARRIVING, of_turn, light.arriving);
    drawn.weight = waited(WAITING_WEIGHT, of_turn, drawn.weight);
    gathered = waited(WAITING_GATHERED, of_turn, gathered);
    p.media = media_before(p);
    front_origin = ray_origin(found_anew(hit.s.p_bvh, of_turn), hit.n, hit.s.v);
    if (EMITTERS > 0) {
        // The first sample's shadow ray is traced by the caller.
        shadow_ray = shadow_ray_to(p, interaction, scatters, front_origin, light, towards_light);
    }
    // 7. The continued path: throughput, start of the next ray, media.
    vec3 weight = drawn.delta ? drawn.weight : on_path.pdf > 0.0 ? on_path.f_cos / on_path.pdf : vec3(0.0);
    bool unscattered = is_unscattered(vertex, drawn);
    bool behind = passed_by || drawn.through;
    p.throughput *= weight_of(vertex, drawn, weight);
    p.distance_since_vertex = escaped ? background_share : unscattered ? p.distance_since_vertex + found.t : 0.0;
    p.pdf = unscattered ? p.pdf : passed_by || drawn.delta ? 0.0 : on_path.pdf;
    leave(p, vertex, drawn, front_origin);
    unmatched_exits += at_surface && interaction.boundary.unmatched_exit ? 1u : 0u;
    uint flags = p.state & (PATH_TRANSPARENT_SO_FAR | PATH_UNSCATTERED | PATH_NON_SPECULAR);
    // Behind a surface that transmits diffusely, light samples see the environment: so do all directions but straight ones.
    flags &= behind && (passed_by || drawn.delta || !shines_through(b)) ? ~0u : ~PATH_TRANSPARENT_SO_FAR;
    flags &= passed_by || drawn.straight ? ~0u : ~PATH_UNSCATTERED;
    flags |= !passed_by && !drawn.delta ? PATH_NON_SPECULAR : 0u;
    // 8. Russian roulette uses the throughput that the path would have without path guiding. Guiding lowers the throughput
    //    of guided paths; terminating those more often would undo it.
    float most = largest(p.throughput);
    if (PATH_GUIDING) {
        bool scattered = !passed_by && !drawn.delta && on_path.unguided_pdf > 0.0;
        float pdf_ratio = guiding_pdf_ratio(p) * (scattered ? on_path.pdf / on_path.unguided_pdf : 1.0);
        flags |= packHalf2x16(vec2(0.0, min(pdf_ratio, 60000.0)));
        most *= pdf_ratio;
    }
    if (vertices >= RUSSIAN_ROULETTE_FROM && !passed_by) {
        float survives = min(most, MOST_LIKELY);
        ends = ends || unit_float(event.y) >= survives;
        p.throughput /= max(survives, 1e-6);
    }
    // Terminated paths, and paths that hit nothing, keep no values of the surface computed above.
    p.throughput = finite_or_zero(ends ? vec3(0.0) : p.throughput, pixel, hit.material, vertices_before);
    shadow_ray.contribution = finite_or_zero(shadow_ray.contribution, pixel, hit.material, vertices_before);
    gathered = finite_or_zero(gathered, pixel, hit.material, vertices_before);
    flags |= escaped ? PATH_ESCAPED_TO_BACKGROUND : 0u;
    p.state = vertices | flags | (!ends && largest(p.throughput) > 0.0 ? PATH_ALIVE : 0u);
    return gathered;
}
#endif
