// Rays through the scene's bounding volume hierarchy: the nearest hit, or whether there is any. One interface, `trace`,
// and three ways through the tree that return the same hits: along skip links with nodes of 16 bytes or of 32, or with
// a stack (docs/decisions/rays.md). Triangles are in the order of the leaves, whatever the way.
#ifndef TRACE_GLSL
#define TRACE_GLSL
#include "lib/loops.glsl"
#include "lib/ray.glsl"
#include "share/bvh.glsl"
#include "share/trace.glsl"

layout(constant) const uint TRAVERSAL = 0;
const uint LINKS_16 = 0; // boxes in steps of a grid over the scene
const uint LINKS_32 = 1; // boxes of floats
const uint STACK = 2;
// Lists of nodes ordered for each octant of directions, before the one for any hit, which is the only one without.
layout(constant) const bool OCTANTS = false;
const int OCTANT_LISTS = 8;

layout(scene, rgba32ui) readonly uniform uimageBuffer bvh_nodes;
layout(scene, rgba32ui) readonly uniform uimageBuffer bvh_triangles;
layout(scene, scalar) uniform TraceBlock { TraceTerms trace_terms; };

// @texels GridNode grid_node_at(bvh_nodes)
// @texels FloatNode float_node_at(bvh_nodes)
// @texels StackNode stack_node_at(bvh_nodes)
// @texels BvhTriangle triangle_at(bvh_triangles)

// What a ray stops at.
const uint OPAQUE = 1;
const uint FILTER = 2; // masked, blended or transmissive: what is seen there decides
const uint NO_TRIANGLE = 0xffffffffu;

struct Hit {
    float t;
    uint triangle; // in the order of the leaves, or NO_TRIANGLE
    float u;
    float v;
};

// Work done so far by this invocation.
uint node_visits = 0;
uint triangle_tests = 0;

// Where a ray that leaves a surface begins.
vec3 ray_origin(vec3 p, vec3 n, vec3 free) {
    return offset_origin(p, n, free, trace_terms.offset);
}

int octant(vec3 d) {
    return (d.x < 0.0 ? 1 : 0) | (d.y < 0.0 ? 2 : 0) | (d.z < 0.0 ? 4 : 0);
}

BoxRay box_ray(vec3 origin, vec3 direction, bool any_order) {
    BoxRay r;
    vec3 inverse = inverse_direction(direction);
    r.end = int(trace_terms.nodes);
    int list = any_order || !OCTANTS ? OCTANTS ? OCTANT_LISTS : 0 : octant(direction);
    r.base = list * (r.end + 1);
    if (TRAVERSAL == LINKS_16) {
        // Boxes are a grid unit larger than need be on each side, 1.5e-5 of the scene: more than the roundings here as
        // long as the origin is within 80 times its extent.
        vec3 unit = inverse * trace_terms.grid_unit;
        r.inverse = unit * (1.0 / float(1 << SLAB_BITS));
        r.start_near = (trace_terms.grid_middle - origin) * inverse;
        r.start_far = r.start_near;
        r.extent = abs(unit);
    } else {
        of_boxes(r, origin, inverse, trace_terms.offset);
    }
    return r;
}

// One way through the tree, ready to go on.
struct Traversal {
    int node;  // the next node, or BoxRay.end
    int leaf;  // triangles found and not tested yet, as a leaf of the tree; 0: none
    Hit hit;
};

bool is_traversing(Traversal w, BoxRay r) {
    return w.node != r.end || w.leaf != 0;
}

// One node: to its children, which follow it, or along its link. A leaf is kept for later; if one is being kept
// already, the walk waits. Selections only: lavapipe runs both sides of a branch.
void visit(inout Traversal w, BoxRay r, float t_min) {
    node_visits += w.node != r.end ? 1u : 0u;
    vec3 near, far;
    int word;
    if (TRAVERSAL == LINKS_16) {
        GridNode node = grid_node_at(uint(r.base + w.node));
        // The whole word is the centre, in steps of which the half extent is a fraction.
        vec3 half_extent = vec3(node.slabs & ((1 << SLAB_BITS) - 1));
        vec3 t = vec3(node.slabs) * r.inverse + r.start_near;
        vec3 e = half_extent * r.extent;
        near = t - e;
        far = t + e;
        word = node.word;
    } else {
        FloatNode node = float_node_at(uint(r.base + w.node));
        vec3 t = node.center * r.inverse;
        vec3 e = node.half_extent * r.extent;
        near = t + r.start_near - e;
        far = t + r.start_far + e;
        word = node.word;
    }
    bool leaf = word < 0;
    bool hit = meets(near, far, t_min, w.hit.t);
    bool keep = hit && leaf && w.leaf == 0;
    bool wait = hit && leaf && w.leaf != 0;
    int next = hit || leaf ? w.node + 1 : word;
    next = wait ? w.node : next;
    // The sentinel is a box as well, and may be hit.
    w.node = min(next, r.end);
    w.leaf = keep ? word : w.leaf;
}

// A ray as triangles see it.
struct TriangleRay {
    vec3 origin;
    Shear shear;
    float after;         // hits at this t or before do not count,
    uint after_triangle; // but those of later triangles at the same t
    uint source_face;           // the flat face it leaves, which it cannot meet again
};

// The nearest four filters on the way to a light, in order; LARGEST where there are fewer.
struct Filters {
    vec4 t;
    uvec4 triangles;
};
const Filters NO_FILTERS = Filters(vec4(LARGEST), uvec4(NO_TRIANGLE));

void exchange(inout float t, inout uint triangle, inout float other_t, inout uint other) {
    bool nearer = t < other_t || (t == other_t && triangle < other);
    float t_old = other_t;
    uint old = other;
    other_t = nearer ? t : other_t;
    other = nearer ? triangle : other;
    t = nearer ? t_old : t;
    triangle = nearer ? old : triangle;
}

// Into its place, all in registers; the fifth falls off the end.
void insert(inout Filters f, float t, uint triangle) {
    exchange(t, triangle, f.t.x, f.triangles.x);
    exchange(t, triangle, f.t.y, f.triangles.y);
    exchange(t, triangle, f.t.z, f.triangles.z);
    exchange(t, triangle, f.t.w, f.triangles.w);
}

// What a walk is for.
const uint NEAREST = 0;
const uint ANY = 1;
const uint TO_LIGHT = 2; // any opaque triangle ends it, filters are collected

// A triangle as a ray sees it. A function of its own: glslang never ends where a `precise` value comes from a member of what was
// fetched at a place that depends on itself.
ShearedTriangle sheared_from(BvhTriangle triangle, vec3 origin, Shear shear) {
    precise vec3 a = triangle.a - origin;
    precise vec3 b = triangle.b - origin;
    precise vec3 c = triangle.c - origin;
    return sheared_triangle(shear, a, b, c);
}

// One triangle of the leaf that is kept. The nearest counts, of two at the same t the first: any order of the tree finds
// the same.
void test_triangle(inout Traversal w, inout Filters f, TriangleRay r, BoxRay b, uint classes, uint purpose) {
    bool pending = w.leaf != 0;
    triangle_tests += pending ? 1u : 0u;
    int place = ~w.leaf;
    uint index = uint(pending ? place >> LEAF_BITS : 0);
    BvhTriangle triangle = triangle_at(index);
    ShearedTriangle s = sheared_from(triangle, r.origin, r.shear);
    float inverse = 1.0 / s.det;
    float t = s.depth * inverse / r.shear.dz;
    bool hit = pending && s.inside && s.det != 0.0 && (triangle.stops & classes) != 0 && triangle.face != r.source_face;
    hit = hit && (t > r.after || (t == r.after && index > r.after_triangle));
    hit = hit && (t < w.hit.t || (t == w.hit.t && index < w.hit.triangle));
    if (purpose == TO_LIGHT) {
        bool is_filter = hit && (triangle.stops & FILTER) != 0;
        insert(f, is_filter ? t : LARGEST, is_filter ? index : NO_TRIANGLE);
        hit = hit && !is_filter;
    }
    w.hit.t = hit ? t : w.hit.t;
    w.hit.triangle = hit ? index : w.hit.triangle;
    w.hit.u = hit ? s.weights.y * inverse : w.hit.u;
    w.hit.v = hit ? s.weights.z * inverse : w.hit.v;
    // The next triangle of the leaf: one more to begin with, one fewer.
    const int others = (1 << LEAF_BITS) - 1;
    int rest = (place & others) == 0 ? 0 : ~(place + others);
    w.leaf = pending ? rest : 0;
    bool ended = purpose != NEAREST && hit;
    w.node = ended ? b.end : w.node;
    w.leaf = ended ? 0 : w.leaf;
}

Hit traverse_links(TriangleRay r, vec3 direction, float t_max, uint classes, uint purpose, inout Filters f) {
    BoxRay b = box_ray(r.origin, direction, purpose != NEAREST);
    Traversal w = Traversal(t_max > 0.0 ? 0 : b.end, 0, Hit(t_max, NO_TRIANGLE, 0.0, 0.0));
    // Once more after a filter has been found: where lanes end at different times, lavapipe forgets for those that are through
    // what their last iteration has put into `f`. Light on a ball of 12 rings, inside a body, missed the faces of the body
    // in a third of the pixels.
    bool inserted;
    // lavapipe goes through a loop's body at least once and through both sides of each branch in it: a fixed number of
    // nodes, then one triangle, and one way out at the end.
    do {
        visit(w, b, r.after);
        visit(w, b, r.after);
        visit(w, b, r.after);
        visit(w, b, r.after);
        visit(w, b, r.after);
        uvec4 known = f.triangles;
        test_triangle(w, f, r, b, classes, purpose);
        inserted = purpose == TO_LIGHT && any(notEqual(f.triangles, known));
    } while (is_traversing(w, b) || inserted);
    return w.hit;
}

struct HitPair {
    Hit a;
    Hit b;
};

// Two rays at once, turn about: what one waits for, the other computes. A node is a chain of fetch, conversion, comparison
// and selection in which most of a processor idles.
HitPair traverse_links_pair(TriangleRay ra, vec3 da, float ta, TriangleRay rb, vec3 db, float tb, uint classes, uint purpose) {
    BoxRay ba = box_ray(ra.origin, da, purpose != NEAREST);
    BoxRay bb = box_ray(rb.origin, db, purpose != NEAREST);
    Filters none;
    Traversal a = Traversal(ta > 0.0 ? 0 : ba.end, 0, Hit(ta, NO_TRIANGLE, 0.0, 0.0));
    Traversal b = Traversal(tb > 0.0 ? 0 : bb.end, 0, Hit(tb, NO_TRIANGLE, 0.0, 0.0));
    do {
        visit(a, ba, 0.0);
        visit(b, bb, 0.0);
        visit(a, ba, 0.0);
        visit(b, bb, 0.0);
        visit(a, ba, 0.0);
        visit(b, bb, 0.0);
        visit(a, ba, 0.0);
        visit(b, bb, 0.0);
        visit(a, ba, 0.0);
        visit(b, bb, 0.0);
        test_triangle(a, none, ra, ba, classes, purpose);
        test_triangle(b, none, rb, bb, classes, purpose);
    } while (is_traversing(a, ba) || is_traversing(b, bb));
    return HitPair(a.hit, b.hit);
}

layout(constant) const uint STACK_SIZE = 1; // one more than the depth of the tree: the entry above the last is written, too

// The tree with both children's boxes in the parent, the nearer child first, the other on a stack.
Hit traverse_stack(TriangleRay r, vec3 direction, float t_max, uint classes, uint purpose, inout Filters f) {
    BoxRay b = box_ray(r.origin, direction, purpose != NEAREST);
    // A reference is a node, or a leaf as in Walk; the sentinel ends the walk.
    b.end = 0x7fffffff;
    Traversal w = Traversal(t_max > 0.0 ? 0 : b.end, 0, Hit(t_max, NO_TRIANGLE, 0.0, 0.0));
    bool inserted; // as in traverse_links
    int stack[STACK_SIZE];
    int entries = 0;
    do {
        for (int i = 0; i < 2; i++) {
            // A leaf waits for its turn while another is being tested.
            bool at_leaf = w.node < 0;
            bool keep = at_leaf && w.leaf == 0;
            w.leaf = keep ? w.node : w.leaf;
            bool inner = w.node >= 0 && w.node != b.end;
            node_visits += inner ? 1u : 0u;
            StackNode node = stack_node_at(uint(inner ? w.node : 0));
            vec3 tl = node.left_center * b.inverse;
            vec3 el = node.left_half_extent * b.extent;
            vec3 tr = node.right_center * b.inverse;
            vec3 er = node.right_half_extent * b.extent;
            vec3 near_l = tl + b.start_near - el;
            vec3 near_r = tr + b.start_near - er;
            bool hit_l = inner && meets(near_l, tl + b.start_far + el, r.after, w.hit.t);
            bool hit_r = inner && meets(near_r, tr + b.start_far + er, r.after, w.hit.t);
            float enter_l = max(near_l.x, max(near_l.y, near_l.z));
            float enter_r = max(near_r.x, max(near_r.y, near_r.z));
            bool swap = enter_r < enter_l;
            int first = swap ? node.right : node.left;
            int second = swap ? node.left : node.right;
            bool both = hit_l && hit_r;
            int one = hit_l ? node.left : node.right;
            // Written whatever comes: only where the next entry goes is decided.
            stack[min(entries, int(STACK_SIZE) - 1)] = second;
            entries += both ? 1 : 0;
            bool pop = keep || (inner && !hit_l && !hit_r);
            entries -= pop ? 1 : 0;
            int popped = entries >= 0 ? stack[max(entries, 0)] : b.end;
            entries = max(entries, 0);
            w.node = inner && !pop ? (both ? first : one) : pop ? popped : w.node;
        }
        uvec4 known = f.triangles;
        test_triangle(w, f, r, b, classes, purpose);
        inserted = purpose == TO_LIGHT && any(notEqual(f.triangles, known));
    } while (is_traversing(w, b) || inserted);
    return w.hit;
}

Hit traverse(TriangleRay r, vec3 direction, float t_max, uint classes, uint purpose, inout Filters f) {
    return TRAVERSAL == STACK ? traverse_stack(r, direction, t_max, classes, purpose, f)
                              : traverse_links(r, direction, t_max, classes, purpose, f);
}

// The nearest hit of a triangle of these classes along origin + t direction that comes after the hit `after` and not
// after t_max; or, with any_hit, any such hit, of which only that there is one is the same every way. A negative t_max asks
// for nothing and costs next to nothing. `self` is the flat face that the origin lies in, or 0xffffffff: slivers of 7 m were
// met again up to 7e-6 m away, and what is seen edge-on may be met at any t.
Hit trace(vec3 origin, vec3 direction, uint source_face, Hit after, float t_max, uint classes, bool any_hit) {
    Filters none;
    return traverse(TriangleRay(origin, ray_shear(direction), after.t, after.triangle, source_face), direction, t_max, classes,
                any_hit ? ANY : NEAREST, none);
}

// Whether anything opaque lies on the way, and the nearest four filters after `after`.
bool trace_to_light(vec3 origin, vec3 direction, uint source_face, Hit after, float t_max, out Filters filters) {
    filters = NO_FILTERS;
    TriangleRay r = TriangleRay(origin, ray_shear(direction), after.t, after.triangle, source_face);
    return traverse(r, direction, t_max, OPAQUE | FILTER, TO_LIGHT, filters).triangle != NO_TRIANGLE;
}

// One of two rays: nothing up to `after` is met.
struct PairedRay {
    vec3 origin;
    vec3 direction;
    uint source_face;
    float after;
    float t_max;
};

// Two rays at once.
HitPair trace_pair(PairedRay a, PairedRay b, uint classes, bool any_hit) {
    TriangleRay ra = TriangleRay(a.origin, ray_shear(a.direction), a.after, NO_TRIANGLE, a.source_face);
    TriangleRay rb = TriangleRay(b.origin, ray_shear(b.direction), b.after, NO_TRIANGLE, b.source_face);
    uint purpose = any_hit ? ANY : NEAREST;
    if (TRAVERSAL != STACK) return traverse_links_pair(ra, a.direction, a.t_max, rb, b.direction, b.t_max, classes, purpose);
    Filters none;
    return HitPair(traverse_stack(ra, a.direction, a.t_max, classes, purpose, none),
                   traverse_stack(rb, b.direction, b.t_max, classes, purpose, none));
}

// To begin with: t > 0.
const Hit FROM_ORIGIN = Hit(0.0, NO_TRIANGLE, 0.0, 0.0);
#endif
