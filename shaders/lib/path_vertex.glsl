// A vertex of a path of light, from the eye or from a light: the surface that its ray meets, and how it goes on from there.
// Where to read: pbrt 4, sections 13.2 (path tracing) and 9.1 (BSDF interface); Veach 1997, section 5.3. Assumes: bvh space, metres.
#ifndef PATH_VERTEX_GLSL
#define PATH_VERTEX_GLSL
#include "lib/bsdf.glsl"
#include "lib/path_ray.glsl"

// A hit and its boundary, for a ray that may pass undeflected.
struct Interaction {
    HitSurface hit;
    Boundary boundary;
};

Interaction interaction_at(HitPoint point, uvec4 media, vec3 direction, uint slots) {
    Interaction r;
    r.hit = hit_surface(point, direction, 0.0, slots);
    r.hit.s.media = media;
    r.boundary = boundary_at(r.hit, media, direction);
    return r;
}

struct PathVertex {
    Interaction interaction;
    Bsdf bsdf;
    uint leaf;       // the triangle
    bool at_surface; // otherwise the ray meets nothing, and the rest is meaningless
    bool passed_by;  // the path passes the surface as if it were not there
    float x;         // uniform random number for the lobe
};

// The vertex at the end of a ray. Absorption on the way reduces the throughput of p. `word` decides between the surface and
// its holes, then the lobe.
PathVertex path_vertex_at(inout Path p, Hit found, uint word) {
    PathVertex r;
    r.at_surface = found.triangle != NO_TRIANGLE;
    uint medium = present_medium(p.media);
    if (ABSORPTION == ABSORPTION_PATH && medium != 0) p.throughput *= absorbed(medium, p.origin, p.direction, r.at_surface ? found.t : 0.0);
    r.leaf = r.at_surface ? found.triangle : 0u;
    HitPoint point = hit_point_of(Hit(found.t, r.leaf, found.u, found.v), p.origin, p.direction);
    r.interaction = interaction_at(point, p.media, p.direction, SCATTERING_SLOTS);
    HitSurface hit = r.interaction.hit;
    r.bsdf = bsdf_at(hit, r.interaction.boundary);
    float x = unit_float(word);
    // Single-sided surfaces are invisible from behind to the eye, as with back-face culling.
    bool unseen = (p.state & PATH_UNSCATTERED) != 0 && (hit_material(r.leaf) & ONE_SIDED_TRIANGLE) != 0 && !hit.front && !r.interaction.boundary.solid;
    r.passed_by = r.interaction.boundary.suppressed_by_priority || unseen || x >= hit.coverage;
    r.x = min(x / max(hit.coverage, 1e-6), 0.999999940395355);
    return r;
}

// Whether a path continues without a new vertex for MIS. Shadow rays pass surfaces of class FILTER only.
bool is_unscattered(PathVertex vertex, BsdfSample drawn) {
    return (vertex.passed_by || drawn.straight) && hit_class(vertex.leaf) == FILTER;
}

// Factor on the throughput of a path that continues along a sample; `weight` is that of the sampled lobe.
vec3 weight_of(PathVertex vertex, BsdfSample drawn, vec3 weight) {
    bool on_right_side = drawn.through == (dot(drawn.direction, vertex.interaction.hit.n) < 0.0);
    return vertex.passed_by ? vec3(1.0) : on_right_side || drawn.straight ? weight : vec3(0.0);
}

// Where surfaces have shading normals, particles scatter with another weight than paths from the eye: cosines at the
// shading normal n and the triangle's normal do not cancel. `from` is where the particle came from, `to` where it goes.
float adjoint_weight(vec3 from, vec3 to, vec3 n, vec3 n_triangle) {
    float cosines = abs(dot(from, n_triangle) * dot(to, n));
    return cosines > 1e-8 ? abs(dot(from, n) * dot(to, n_triangle)) / cosines : 1.0;
}

// Start of the next ray of a path: origin, direction, media. `front_origin` leaves on the viewer's side.
void leave(inout Path p, PathVertex vertex, BsdfSample drawn, vec3 front_origin) {
    HitSurface hit = vertex.interaction.hit;
    Boundary boundary = vertex.interaction.boundary;
    bool passed_by = vertex.passed_by;
    bool behind = passed_by || drawn.through;
    bool into = passed_by ? boundary.suppressed_by_priority : drawn.through && boundary.solid;
    p.origin = behind ? ray_origin(hit.s.p_bvh, boundary.touches_opaque ? hit.n : -hit.n, vec3(0.0)) : front_origin;
    p.t_min = boundary.touches_opaque && passed_by ? boundary.opaque_at : 0.0;
    p.direction = passed_by ? p.direction : drawn.direction;
    p.source_face = hit.s.face;
    p.media = into ? boundary.media_out : p.media;
}
#endif
