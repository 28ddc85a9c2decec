// BVH traversal: the nearest hit of a ray, or any hit. Stackless with skip pointers, or with a short stack.
// Three layouts of one bounding volume hierarchy return the same hits through one interface, `trace`. Stackless traversal
// follows nodes in depth-first order; a node that is missed points to the next one outside its subtree (a skip pointer).
// Nodes have 16 bytes (boxes on a grid) or 32 (boxes of floats). The third layout has both children's boxes in the parent
// and a short stack. Triangles are in the order of the leaves in all three.
// Where to read: Smits 1998 (skip pointers); pbrt 4, section 7.3 (BVH); Woop, Benthin and Wald 2013 (watertight
// intersection); docs/decisions/rays.md. Assumes: bvh space (share/trace.glsl), metres; t in units of the direction's
// length.
#ifndef TRACE_GLSL
#define TRACE_GLSL
#include "lib/loops.glsl"
#include "lib/ray.glsl"
#include "share/bvh.glsl"
#include "share/trace.glsl"

layout(constant) const uint TRAVERSAL = 0;
const uint LINKS_16 = 0; // skip pointers, 16 bytes: boxes in steps of a grid over the scene
const uint LINKS_32 = 1; // skip pointers, 32 bytes: boxes of floats
const uint STACK = 2;
// One list of nodes for each octant of ray directions, in front-to-back order, before the list for any-hit rays. Without
// OCTANTS that last list is the only one.
layout(constant) const bool OCTANTS = false;
const int OCTANT_LISTS = 8;

layout(scene, rgba32ui) readonly uniform uimageBuffer bvh_nodes;
layout(scene, rgba32ui) readonly uniform uimageBuffer bvh_triangles;
layout(scene, scalar) uniform TraceBlock { TraceTerms trace_terms; };

// @texels GridNode grid_node_at(bvh_nodes)
// @texels FloatNode float_node_at(bvh_nodes)
// @texels StackNode stack_node_at(bvh_nodes)
// @texels BvhTriangle triangle_at(bvh_triangles)

// Classes of triangles that stop a ray.
const uint OPAQUE = 1;
const uint FILTER = 2; // masked, blended or transmissive: the material at the hit decides
const uint NO_TRIANGLE = 0xffffffffu;

struct Hit {
    float t;
    uint triangle; // in the order of the leaves, or NO_TRIANGLE
    float u;
    float v;
};

// Work counters of this invocation.
uint node_visits = 0;
uint triangle_tests = 0;

// Origin of a ray that leaves a surface.
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
        // Boxes are one grid unit larger than necessary on each side, 1.5e-5 of the scene. This exceeds the roundings here
        // as long as the origin is within 80 times the extent of the scene.
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

// State of a traversal.
struct Traversal {
    int node;  // next node, or BoxRay.end
    int leaf;  // triangles still to be tested, as a reference to a leaf; 0: none
    Hit hit;
};

bool is_traversing(Traversal w, BoxRay r) {
    return w.node != r.end || w.leaf != 0;
}

// Visits one node. A hit continues with the children, which follow it in the list; a miss follows the skip pointer. A leaf
// is stored for test_triangle; while one is stored, the traversal waits at the next leaf. Only selections: lavapipe runs
// both sides of a branch.
void visit(inout Traversal w, BoxRay r, float t_min) {
    node_visits += w.node != r.end ? 1u : 0u;
    vec3 near, far;
    int word;
    if (TRAVERSAL == LINKS_16) {
        GridNode node = grid_node_at(uint(r.base + w.node));
        // The whole word serves as the centre, in 2^-SLAB_BITS grid units: the half extent in its low bits is a fraction of
        // a unit.
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
    // The sentinel is a box too, and may be hit.
    w.node = min(next, r.end);
    w.leaf = keep ? word : w.leaf;
}

// A ray prepared for watertight ray/triangle intersection.
struct TriangleRay {
    vec3 origin;
    ShearTerms terms;
    Shear shear;         // of the terms; a traversal with a stack does without
    float after;         // hits at this t or before do not count,
    uint after_triangle; // except those of later triangles at the same t
    uint source_face;           // coplanar group that the ray leaves, which it cannot hit again
};

TriangleRay triangle_ray(vec3 origin, vec3 direction, Hit after, uint source_face) {
    ShearTerms terms = shear_terms(direction);
    return TriangleRay(origin, terms, shear_of(terms), after.t, after.triangle, source_face);
}

// The four nearest hits of class FILTER along a shadow ray, in order; LARGEST where there are fewer.
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

// Insertion into the sorted list, all in registers; the fifth is dropped.
void insert(inout Filters f, float t, uint triangle) {
    exchange(t, triangle, f.t.x, f.triangles.x);
    exchange(t, triangle, f.t.y, f.triangles.y);
    exchange(t, triangle, f.t.z, f.triangles.z);
    exchange(t, triangle, f.t.w, f.triangles.w);
}

// Purpose of a traversal.
const uint NEAREST = 0;
const uint ANY = 1;
const uint TO_LIGHT = 2; // an opaque hit ends it; hits of class FILTER are collected

// Shears a triangle for a ray. Functions of their own: glslang does not terminate where a `precise` value comes from a
// member of a value that was fetched at an index depending on itself.
ShearedTriangle sheared_from(BvhTriangle triangle, vec3 origin, Shear shear) {
    precise vec3 a = triangle.a - origin;
    precise vec3 b = triangle.b - origin;
    precise vec3 c = triangle.c - origin;
    return sheared_triangle(sheared(shear, a), sheared(shear, b), sheared(shear, c));
}

ShearedTriangle sheared_for(BvhTriangle triangle, TriangleRay r) {
    precise vec3 a = triangle.a - r.origin;
    precise vec3 b = triangle.b - r.origin;
    precise vec3 c = triangle.c - r.origin;
    if (TRAVERSAL == STACK) {
        a = sheared_by_selection(r.terms, a);
        b = sheared_by_selection(r.terms, b);
        c = sheared_by_selection(r.terms, c);
    } else {
        a = sheared(r.shear, a);
        b = sheared(r.shear, b);
        c = sheared(r.shear, c);
    }
    return sheared_triangle(a, b, c);
}

// Tests one triangle of the stored leaf. The nearest hit counts, and of two at the same t the first triangle. So the result
// does not depend on the traversal order.
void test_triangle(inout Traversal w, inout Filters f, TriangleRay r, BoxRay b, uint classes, uint purpose) {
    bool pending = w.leaf != 0;
    triangle_tests += pending ? 1u : 0u;
    int place = ~w.leaf;
    uint index = uint(pending ? place >> LEAF_BITS : 0);
    BvhTriangle triangle = triangle_at(index);
    bool counts = pending && (triangle.stops & classes) != 0 && triangle.face != r.source_face;
    bool filters = (triangle.stops & FILTER) != 0;
    ShearedTriangle s = sheared_for(triangle, r);
    float inverse = 1.0 / s.det;
    float t = s.depth * inverse / r.terms.dz;
    bool hit = counts && s.inside && s.det != 0.0;
    hit = hit && (t > r.after || (t == r.after && index > r.after_triangle));
    hit = hit && (t < w.hit.t || (t == w.hit.t && index < w.hit.triangle));
    if (purpose == TO_LIGHT) {
        bool is_filter = hit && filters;
        insert(f, is_filter ? t : LARGEST, is_filter ? index : NO_TRIANGLE);
        hit = hit && !is_filter;
    }
    w.hit.t = hit ? t : w.hit.t;
    w.hit.triangle = hit ? index : w.hit.triangle;
    w.hit.u = hit ? s.weights.y * inverse : w.hit.u;
    w.hit.v = hit ? s.weights.z * inverse : w.hit.v;
    // The leaf without its first triangle: the start increases by one, the count decreases by one.
    const int others = (1 << LEAF_BITS) - 1;
    int rest = (place & others) == 0 ? 0 : ~(place + others);
    w.leaf = pending ? rest : 0;
    bool ended = purpose != NEAREST && hit;
    w.node = ended ? b.end : w.node;
    w.leaf = ended ? 0 : w.leaf;
}

// Stackless traversal along skip pointers: up to five nodes, then one triangle, until the list ends.
Hit traverse_links(TriangleRay r, vec3 direction, float t_max, uint classes, uint purpose, inout Filters f) {
    BoxRay b = box_ray(r.origin, direction, purpose != NEAREST);
    Traversal w = Traversal(t_max > 0.0 ? 0 : b.end, 0, Hit(t_max, NO_TRIANGLE, 0.0, 0.0));
    // One more iteration after a filter was inserted. Where lanes leave the loop at different times, lavapipe loses what
    // the last iteration of the finished lanes assigned to `f`. Without it, light on a sphere mesh of 12 rings inside a
    // solid missed the faces of the solid in a third of the pixels.
    bool inserted;
    // lavapipe runs a loop's body at least once and both sides of each branch in it. So the body is a fixed number of
    // nodes, then one triangle, with a single exit at the end.
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

// Stackless traversal of two rays, interleaved: one computes while the other waits. A node is a chain of fetch, conversion,
// comparison and selection that leaves most of a processor idle.
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

// Invocations in a workgroup of every program that traces rays.
const uint TRACING_LANES = 64;
// Entries of a short stack; a power of two.
const uint SHORT_STACK = 8;
// Entry by entry: neighbouring invocations access neighbouring words.
shared int traversal_stacks[TRAVERSAL == STACK ? SHORT_STACK * TRACING_LANES : 1u];

// Where the stack is in shared memory, so are vectors that a shader does not need while it traces rays or evaluates a BSDF: they
// would take its registers. A program has an array of them; the word of number `which` of this invocation is found anew.
const bool VECTORS_WAIT = TRAVERSAL == STACK;
uint waiting_word(uint which, uint of_turn) {
    return which * TRACING_LANES + found_anew(gl_LocalInvocationIndex, of_turn);
}

// The way from the root of the BVH to a node, one bit for each level.
const uint TRAIL_LEVELS = 64;
struct Trail {
    uint level;    // of the node; the root has 0
    uvec2 right;   // the way goes to the right child
    uvec2 waiting; // the other child waits
    uint stacked;  // waiting children that are on the stack: the deepest ones
};

uvec2 bit_of_level(uint level) {
    uint bit = 1u << (level & 31u);
    return level < 32u ? uvec2(bit, 0u) : uvec2(0u, bit);
}

// Word of the topmost entry, or of the next one: a ring, in which the deepest entries replace the oldest.
uint short_stack_word(Trail trail) {
    uint waiting = uint(bitCount(trail.waiting.x) + bitCount(trail.waiting.y));
    return (waiting & (SHORT_STACK - 1u)) * TRACING_LANES + gl_LocalInvocationIndex;
}

// Goes to a child. The other one waits where it is met too.
void descend(inout Trail trail, bool right, bool other_waits, int other) {
    uvec2 bit = bit_of_level(trail.level++);
    trail.right = right ? trail.right | bit : trail.right & ~bit;
    if (other_waits) {
        traversal_stacks[short_stack_word(trail)] = other;
        trail.waiting |= bit;
        trail.stacked = min(trail.stacked + 1u, SHORT_STACK);
    }
}

// The deepest child that waits, or `end`. One that is no longer on the stack is found from the root, along the trail.
int ascend(inout Trail trail, int end) {
    if ((trail.waiting.x | trail.waiting.y) == 0u) return end;
    uint level = uint(trail.waiting.y != 0u ? 32 + findMSB(trail.waiting.y) : findMSB(trail.waiting.x));
    uvec2 bit = bit_of_level(level);
    trail.waiting ^= bit;
    trail.right ^= bit;
    trail.level = level + 1u;
    if (trail.stacked > 0u) {
        trail.stacked--;
        return traversal_stacks[short_stack_word(trail)];
    }
    int node = 0;
    for (uint k = 0; k <= level; k++) {
        node_visits++;
        StackNode parent = stack_node_at(uint(node));
        uvec2 right = trail.right & bit_of_level(k);
        node = (right.x | right.y) != 0u ? parent.right : parent.left;
    }
    return node;
}

// Whether a ray meets a box within [t_min, t_max]; it enters the box at `enter`. One box is done before the next one is begun: of both
// at once, more registers were live (RADV).
bool enters(BoxRay b, vec3 center, vec3 half_extent, float t_min, float t_max, out float enter) {
    vec3 t = center * b.inverse;
    vec3 e = half_extent * b.extent;
    vec3 near = t + b.start_near - e;
    enter = max(near.x, max(near.y, near.z));
    return meets(near, t + b.start_far + e, t_min, t_max);
}

// Traversal with a short stack, the one of GPUs: both children's boxes are in the parent; the nearer child is next, the
// other goes onto the stack. Inner nodes, then the triangles of one leaf, with branches: an invocation fetches only what
// it needs. The stack is in shared memory. As an array of the invocation, Mesa's compiler selects among registers or copies
// the array. It is short, because shared memory limits how many subgroups run: what does not fit is found again from the
// root (docs/decisions/architectures.md).
// Where to read: Aila and Laine, Understanding the Efficiency of Ray Traversal on GPUs, HPG 2009 ("while-while"); Laine,
// Restart Trail for Stackless BVH Traversal, HPG 2010.
Hit traverse_stack(TriangleRay r, vec3 direction, float t_max, uint classes, uint purpose, inout Filters f) {
    BoxRay b = box_ray(r.origin, direction, purpose != NEAREST);
    // A reference is a node or a leaf, as in Traversal; the sentinel ends the traversal.
    b.end = 0x7fffffff;
    Trail trail = Trail(0, uvec2(0), uvec2(0), 0);
    Traversal w = Traversal(t_max > 0.0 ? 0 : b.end, 0, Hit(t_max, NO_TRIANGLE, 0.0, 0.0));
    while (w.node != b.end) {
        // 1. Inner nodes: the boxes of both children, until a leaf is met.
        while (w.node >= 0 && w.node != b.end) {
            node_visits++;
            StackNode node = stack_node_at(uint(w.node));
            float enter_l, enter_r;
            bool hit_l = enters(b, node.left_center, node.left_half_extent, r.after, w.hit.t, enter_l);
            bool hit_r = enters(b, node.right_center, node.right_half_extent, r.after, w.hit.t, enter_r);
            if (hit_l || hit_r) {
                bool right = hit_r && (!hit_l || enter_r < enter_l);
                descend(trail, right, hit_l && hit_r, right ? node.left : node.right);
                w.node = right ? node.right : node.left;
            } else {
                w.node = ascend(trail, b.end);
            }
        }
        // 2. The triangles of the leaf. A hit may end the traversal.
        if (w.node < 0) {
            w.leaf = w.node;
            while (w.leaf != 0) test_triangle(w, f, r, b, classes, purpose);
            if (w.node != b.end) w.node = ascend(trail, b.end);
        }
    }
    return w.hit;
}

Hit traverse(TriangleRay r, vec3 direction, float t_max, uint classes, uint purpose, inout Filters f) {
    return TRAVERSAL == STACK ? traverse_stack(r, direction, t_max, classes, purpose, f)
                              : traverse_links(r, direction, t_max, classes, purpose, f);
}

// The nearest hit of a triangle of these classes along origin + t direction, after the hit `after` and up to t_max. With
// any_hit: any such hit; which one depends on the layout of the BVH, whether there is one does not. A negative t_max finds
// nothing and costs almost nothing. `source_face` is the coplanar group that the origin lies in, or 0xffffffff. It avoids
// self-intersection: slivers of 7 m were hit again up to 7e-6 m away, and a triangle seen edge-on may be hit at any t.
Hit trace(vec3 origin, vec3 direction, uint source_face, Hit after, float t_max, uint classes, bool any_hit) {
    Filters none;
    return traverse(triangle_ray(origin, direction, after, source_face), direction, t_max, classes, any_hit ? ANY : NEAREST, none);
}

// Shadow ray: whether an opaque triangle occludes it; otherwise the four nearest filters after the hit `after`.
bool trace_to_light(vec3 origin, vec3 direction, uint source_face, Hit after, float t_max, out Filters filters) {
    filters = NO_FILTERS;
    TriangleRay r = triangle_ray(origin, direction, after, source_face);
    return traverse(r, direction, t_max, OPAQUE | FILTER, TO_LIGHT, filters).triangle != NO_TRIANGLE;
}

// One ray of a pair; hits up to `after` do not count.
struct PairedRay {
    vec3 origin;
    vec3 direction;
    uint source_face;
    float after;
    float t_max;
};

// Traces two rays at once.
HitPair trace_pair(PairedRay a, PairedRay b, uint classes, bool any_hit) {
    TriangleRay ra = triangle_ray(a.origin, a.direction, Hit(a.after, NO_TRIANGLE, 0.0, 0.0), a.source_face);
    TriangleRay rb = triangle_ray(b.origin, b.direction, Hit(b.after, NO_TRIANGLE, 0.0, 0.0), b.source_face);
    uint purpose = any_hit ? ANY : NEAREST;
    if (TRAVERSAL != STACK) return traverse_links_pair(ra, a.direction, a.t_max, rb, b.direction, b.t_max, classes, purpose);
    Filters none;
    return HitPair(traverse_stack(ra, a.direction, a.t_max, classes, purpose, none),
                   traverse_stack(rb, b.direction, b.t_max, classes, purpose, none));
}

// Start of a search: every hit with t > 0 counts.
const Hit FROM_ORIGIN = Hit(0.0, NO_TRIANGLE, 0.0, 0.0);
#endif
