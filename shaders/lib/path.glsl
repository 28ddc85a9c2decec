// One bounce of two paths: what they meet, what that sends to them, and where they go on (lecture R6). The light that arrives
// along a path is estimated in two ways at each surface, by a place on what emits and by the direction that is followed anyway,
// and both are weighted by the power heuristic.
#ifndef PATH_GLSL
#define PATH_GLSL
#include "lib/bsdf.glsl"
#include "lib/emitters.glsl"
#include "lib/path_ray.glsl"
#include "lib/work_count.glsl"

layout(constant) const bool LIGHTING_SURFACES = false; // what emits lights the scene, and is not only seen
layout(constant) const uint LIGHT_PLACES = 1; // places on lights that are looked for at each surface

// From this surface on a path goes on with a probability that falls with its throughput.
const uint ROULETTE_FROM = 4;
const float MOST_LIKELY = 0.95;

float lost = 0.0;
float most_lost = 0.0;
uint path_rays = 0;

// A light that is looked for.
struct LightTask {
    vec3 origin;
    vec3 to_light;
    float t_max;       // negative: none
    uint self;
    uvec4 media;
    vec3 contribution; // if nothing is in between
};

bool is_finite(vec3 v) {
    return all(lessThanEqual(abs(v), vec3(LARGEST)));
}

// Light that is no number, or infinite, is counted with the first place where it was met, and left out of the picture.
vec3 only_finite(vec3 light, uvec2 pixel, uint material, uint surface) {
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

// What a hit is on the way of something that goes straight on.
struct Met {
    HitSurface hit;
    Boundary boundary;
};

Met met_at(HitPoint point, uvec4 media, vec3 direction) {
    Met r;
    r.hit = hit_surface(point, direction, 0.0);
    r.hit.s.media = media;
    r.boundary = boundary_at(r.hit, media, direction);
    return r;
}

// How far a light is looked for: what touches it does not shadow it, and t is a few roundings off.
float search_end(LightTask task) {
    return task.t_max == 1.0 ? 1.0 - 4.0 / 16777216.0 : task.t_max;
}

// What the medium leaves of a light that nothing stands before.
vec3 left_of_light(LightTask task) {
    uint medium = present_medium(task.media);
    float size = vector_length(task.to_light);
    bool absorbs = ABSORPTION == ABSORPTION_PATH && medium != 0 && task.t_max == 1.0;
    return absorbs ? absorbed(medium, task.origin, task.to_light / size, size) : vec3(1.0);
}

// How much of a light arrives: what lies on the straight way there attenuates it. What a path finds by going straight through is
// the same, so that both may be weighted against each other.
vec3 light_that_arrives(LightTask task) {
    vec3 through = vec3(task.t_max > 0.0 ? 1.0 : 0.0);
    float size = vector_length(task.to_light);
    vec3 direction = task.to_light / size;
    Hit last = FROM_ORIGIN;
    bool goes_on = task.t_max > 0.0;
    uvec4 media = task.media;
    vec3 result = through;
    do {
        Hit found = trace(task.origin, task.to_light, task.self, last, goes_on ? search_end(task) : -1.0, OPAQUE | FILTER, false);
        bool at_surface = goes_on && found.triangle != NO_TRIANGLE;
        uint medium = present_medium(media);
        if (goes_on && ABSORPTION == ABSORPTION_PATH && medium != 0) {
            float end = at_surface ? found.t : min(task.t_max, 1.0);
            // Of what is infinitely far, light comes through no medium that has no end.
            float far = at_surface || task.t_max == 1.0 ? (end - last.t) * size : 0.0;
            through *= absorbed(medium, task.origin + task.to_light * last.t, direction, far);
        }
        if (at_surface) {
            if (hit_class(found.triangle) == OPAQUE) {
                through = vec3(0.0);
            } else {
                Met met = met_at(hit_point_of(found, task.origin, task.to_light), media, direction);
                Layers b = layers_at(met.hit, met.boundary);
                vec3 passes = is_straight(b) ? straight_transmittance(b) : vec3(0.0);
                through *= met.boundary.hidden ? vec3(1.0) : 1.0 - met.hit.coverage + met.hit.coverage * passes;
                bool enters = met.boundary.solid && (met.boundary.hidden || met.hit.coverage > 0.0);
                media = enters ? met.boundary.beyond : media;
            }
            last = found;
        }
        if (goes_on) result = through;
        goes_on = at_surface && largest(through) > 0.0 && loop_heads < LOOP_BUDGET;
    } while (goes_on);
    return result;
}

// A light to be looked for from a surface, drawn from as many places as are looked for: what of it would go along the path.
LightTask task_of(Path p, Met met, bool spreads, vec3 front_origin, LightSample light, PathEval towards) {
    LightTask task;
    float w = light.pdf > 0.0 ? mis_weight(light.pdf * float(LIGHT_PLACES), towards.pdf) : 1.0;
    vec3 contribution = p.throughput * towards.f_cos * light.arriving * (w / float(LIGHT_PLACES));
    bool wanted = spreads && largest(contribution) > 0.0;
    bool behind = dot(met.hit.n, light.to_light) < 0.0;
    task.origin = behind ? ray_origin(met.hit.s.p_bvh, -met.hit.n, vec3(0.0)) : front_origin;
    // Both ends are as they were drawn, wherever the ray starts.
    task.to_light = light.t_max == 1.0 ? light.to_light + (front_origin - task.origin) : light.to_light;
    task.t_max = wanted ? light.t_max : -1.0;
    task.self = met.hit.s.face;
    task.media = behind && met.boundary.solid ? met.boundary.beyond : p.media;
    task.contribution = wanted ? contribution : vec3(0.0);
    return task;
}

// What a path meets: light that this sends along it, and the path as it goes on.
vec3 meet(inout Path p, Hit found, uvec2 pixel, bool there, out LightTask task) {
    task = LightTask(p.origin, vec3(0.0, 1.0, 0.0), -1.0, p.self, p.media, vec3(0.0));
    vec3 gathered = vec3(0.0);
    bool at_surface = found.triangle != NO_TRIANGLE;
    uint met_before = p.state & PATH_SURFACES;
    uint medium = present_medium(p.media);
    if (ABSORPTION == ABSORPTION_PATH && medium != 0) p.throughput *= absorbed(medium, p.origin, p.direction, at_surface ? found.t : 0.0);
    uint place = at_surface ? found.triangle : 0u;
    HitPoint point = hit_point_of(Hit(found.t, place, found.u, found.v), p.origin, p.direction);
    Met met = met_at(point, p.media, p.direction);
    HitSurface hit = met.hit;
    Bsdf bsdf = bsdf_at(hit, met.boundary);
    if (AIMED) guide(bsdf);
    Layers b = bsdf.layers;
    uvec2 event = draw_words(pixel, met_before, DRAW_EVENT);
    float x = unit_float(event.x);
    // The back of what has one side only is not there for the eye.
    bool unseen = (p.state & PATH_STRAIGHT) != 0 && (hit_material(place) & ONE_SIDED_TRIANGLE) != 0 && !hit.front && !met.boundary.solid;
    bool passed_by = met.boundary.hidden || unseen || x >= hit.coverage;
    x = min(x / max(hit.coverage, 1e-6), 0.999999940395355);

    // Light from a place on what emits.
    LightSample light = LightSample(p.direction, -1.0, vec3(0.0), 0.0);
    bool spreads = at_surface && !passed_by && !hit.s.unlit && (!b.delta || b.shares.z > 0.0 || (CLEARCOAT && !b.coat_delta));
    vec3 front_origin = ray_origin(hit.s.p_bvh, hit.n, hit.s.v);
    if (EMITTERS > 0) light = sample_light(front_origin, draw_words_of(pixel, met_before, DRAW_LIGHT, 0, LIGHT_PLACES));
    if (ENVIRONMENT) {
        vec3 towards = at_surface ? light.to_light : p.direction;
        vec3 seen = environment_radiance(towards);
        bool clear = (p.state & PATH_CLEAR) != 0 && !SKY;
        float w = p.pdf > 0.0 ? mis_weight(p.pdf, float(LIGHT_PLACES) * sky_pdf(p.direction)) : 1.0;
        if (!at_surface && !clear) gathered = p.throughput * seen * w;
        if (EMITTING_SKY && light.pdf > 0.0 && light.t_max == LARGEST) {
            // Straight ahead there is the background, whatever lights the scene.
            bool hidden = clear && dot(hit.n, light.to_light) < 0.0;
            light.arriving *= hidden ? vec3(0.0) : seen;
        }
    }
    bool ends = !at_surface;
    float behind_all = mean(p.throughput);
    bool open = !at_surface && !SKY && (p.state & PATH_CLEAR) != 0;

    // What the surface itself sends.
    if (at_surface && !passed_by) {
        vec3 emits = hit.s.unlit ? hit.s.base : hit.s.emissive * (CLEARCOAT ? under_coat(hit.s) : 1.0);
        // One side may be dark.
        bool shows = LIGHTING_SURFACES || (p.state & PATH_SPREAD) == 0;
        shows = shows && (hit.s.unlit || hit.front || (hit_material(place) & ONE_SIDED_TRIANGLE) == 0);
        float w = 1.0;
        if (EMITTING_TRIANGLES) {
            float r = p.travelled + found.t;
            float cos_light = max(abs(dot(hit.n, p.direction)), 1e-9);
            float drawn = density_per_solid_angle(picked_per_area(place), r * r, cos_light);
            w = p.pdf > 0.0 && drawn > 0.0 ? mis_weight(p.pdf, float(LIGHT_PLACES) * drawn) : 1.0;
        }
        gathered = shows ? p.throughput * emits * w : vec3(0.0);
        ends = ends || hit.s.unlit;
    }

    // Where it goes on.
    uint met_now = met_before + 1;
    if (!ends && met_now > trace_terms.interfaces) {
        lost += largest(p.throughput);
        most_lost = max(most_lost, largest(p.throughput));
        ends = true;
    }
    uvec2 words = draw_words(pixel, met_before, DRAW_DIRECTION);
    BsdfSample drawn = bsdf_sample(bsdf, x, vec2(unit_float(words.x), unit_float(words.y)));
    // One evaluation for the light's direction, one for that which was drawn: the same code, once.
    vec3 along = normalize(light.to_light);
    PathEval towards_light = PathEval(vec3(0.0), 0.0, 0.0);
    PathEval on_path = PathEval(vec3(0.0), 0.0, 0.0);
    for (int i = 0; i < 2; i++) {
        PathEval now = bsdf_evaluate(bsdf, i == 0 ? along : drawn.direction);
        if (i == 0) towards_light = now;
        on_path = now;
    }
    if (EMITTERS > 0) {
        task = task_of(p, met, spreads, front_origin, light, towards_light);
    }
    if (LIGHT_PLACES > 1) {
        // The others are looked for here, one after the other.
        for (uint i = 1; i < LIGHT_PLACES; i++) {
            LightSample other = sample_light(front_origin, draw_words_of(pixel, met_before, DRAW_LIGHT, i, LIGHT_PLACES));
            if (EMITTING_SKY && other.pdf > 0.0 && other.t_max == LARGEST) {
                bool hidden = (p.state & PATH_CLEAR) != 0 && !SKY && dot(hit.n, other.to_light) < 0.0;
                other.arriving *= hidden ? vec3(0.0) : environment_radiance(other.to_light);
            }
            LightTask one = task_of(p, met, spreads, front_origin, other, bsdf_evaluate(bsdf, normalize(other.to_light)));
            one.t_max = there ? one.t_max : -1.0;
            shadow_rays += one.t_max > 0.0 ? 1u : 0u;
            vec3 arrives = light_that_arrives(one);
            if (one.t_max > 0.0) gathered += only_finite(one.contribution, pixel, hit.material, met_before) * arrives;
        }
    }
    vec3 weight = drawn.delta ? drawn.weight : on_path.pdf > 0.0 ? on_path.f_cos / on_path.pdf : vec3(0.0);
    bool on_right_side = drawn.through == (dot(drawn.direction, hit.n) < 0.0);
    weight = passed_by ? vec3(1.0) : on_right_side || drawn.straight ? weight : vec3(0.0);
    // Only what filters light lets the search for lights pass as well.
    bool straight = (passed_by || drawn.straight) && hit_class(place) == FILTER;
    p.throughput *= weight;
    p.travelled = open ? behind_all : straight ? p.travelled + found.t : 0.0;
    p.pdf = straight ? p.pdf : passed_by || drawn.delta ? 0.0 : on_path.pdf;
    bool behind = passed_by || drawn.through;
    bool into = passed_by ? met.boundary.hidden : drawn.through && met.boundary.solid;
    p.origin = behind ? ray_origin(hit.s.p_bvh, met.boundary.against ? hit.n : -hit.n, vec3(0.0)) : front_origin;
    p.after = met.boundary.against && passed_by ? met.boundary.opaque_at : 0.0;
    p.direction = passed_by ? p.direction : drawn.direction;
    p.self = hit.s.face;
    p.media = into ? met.boundary.beyond : p.media;
    stray_interfaces += at_surface && met.boundary.stray ? 1u : 0u;
    uint flags = p.state & (PATH_CLEAR | PATH_STRAIGHT | PATH_SPREAD);
    flags &= behind ? ~0u : ~PATH_CLEAR;
    flags &= passed_by || drawn.straight ? ~0u : ~PATH_STRAIGHT;
    flags |= !passed_by && !drawn.delta ? PATH_SPREAD : 0u;
    // Less is left of a path that was aimed than of another, and that is no reason to end it: roulette asks what would be left if
    // nothing were aimed at, or it would undo what aims are for.
    float most = largest(p.throughput);
    if (AIMED) {
        bool spread = !passed_by && !drawn.delta && on_path.unguided_pdf > 0.0;
        float aimed = aimed_before(p) * (spread ? on_path.pdf / on_path.unguided_pdf : 1.0);
        flags |= packHalf2x16(vec2(0.0, min(aimed, 60000.0)));
        most *= aimed;
    }
    if (met_now >= ROULETTE_FROM && !passed_by) {
        float survives = min(most, MOST_LIKELY);
        ends = ends || unit_float(event.y) >= survives;
        p.throughput /= max(survives, 1e-6);
    }
    // What a path that has met nothing computes for a surface does not count.
    p.throughput = only_finite(ends ? vec3(0.0) : p.throughput, pixel, hit.material, met_before);
    task.contribution = only_finite(task.contribution, pixel, hit.material, met_before);
    gathered = only_finite(gathered, pixel, hit.material, met_before);
    flags |= open ? PATH_OPEN : 0u;
    p.state = met_now | flags | (!ends && largest(p.throughput) > 0.0 ? PATH_ALIVE : 0u);
    return gathered;
}

// Two paths at once: rays are traced in pairs, surfaces one after the other, in code that is there once.
void bounce(inout Path a, inout Path b, uvec2 pixel_a, uvec2 pixel_b) {
    bool there_a = (a.state & PATH_ALIVE) != 0;
    bool there_b = (b.state & PATH_ALIVE) != 0;
    HitPair found = trace_pair(PairedRay(a.origin, a.direction, a.self, TOUCHING ? a.after : 0.0, there_a ? LARGEST : -1.0),
                               PairedRay(b.origin, b.direction, b.self, TOUCHING ? b.after : 0.0, there_b ? LARGEST : -1.0),
                               OPAQUE | FILTER, false);
    path_rays += (there_a ? 1u : 0u) + (there_b ? 1u : 0u);
    vec3 gathered_a = vec3(0.0);
    vec3 gathered_b = vec3(0.0);
    LightTask of_a, of_b;
    for (int i = 0; i < 2; i++) {
        Path p = a;
        Hit hit = found.a;
        uvec2 pixel = pixel_a;
        bool there = there_a;
        if (i == 1) {
            p = b;
            hit = found.b;
            pixel = pixel_b;
            there = there_b;
        }
        LightTask task;
        vec3 now = meet(p, hit, pixel, there, task);
        if (i == 0) {
            if (there_a) a = p;
            of_a = task;
            gathered_a = now;
        } else {
            if (there_b) b = p;
            of_b = task;
            gathered_b = now;
        }
    }
    if (EMITTERS > 0) {
        if (!there_a) of_a.t_max = -1.0;
        if (!there_b) of_b.t_max = -1.0;
        shadow_rays += (of_a.t_max > 0.0 ? 1u : 0u) + (of_b.t_max > 0.0 ? 1u : 0u);
        vec3 arrives_a = vec3(of_a.t_max > 0.0 ? 1.0 : 0.0);
        vec3 arrives_b = vec3(of_b.t_max > 0.0 ? 1.0 : 0.0);
        if (FILTERS) {
            for (int i = 0; i < 2; i++) {
                LightTask task = of_a;
                if (i == 1) task = of_b;
                vec3 arrives = light_that_arrives(task);
                if (i == 0) arrives_a = arrives;
                if (i == 1) arrives_b = arrives;
            }
        } else {
            HitPair blocked = trace_pair(PairedRay(of_a.origin, of_a.to_light, of_a.self, 0.0, search_end(of_a)),
                                         PairedRay(of_b.origin, of_b.to_light, of_b.self, 0.0, search_end(of_b)),
                                         OPAQUE | FILTER, true);
            arrives_a *= blocked.a.triangle == NO_TRIANGLE ? left_of_light(of_a) : vec3(0.0);
            arrives_b *= blocked.b.triangle == NO_TRIANGLE ? left_of_light(of_b) : vec3(0.0);
        }
        gathered_a += of_a.contribution * arrives_a;
        gathered_b += of_b.contribution * arrives_b;
    }
    if (there_a) a.sum += gathered_a;
    if (there_b) b.sum += gathered_b;
}
#endif
