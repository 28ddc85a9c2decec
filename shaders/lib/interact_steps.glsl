// Ray trees in steps: what the kernels of reflection and refraction on GPUs leave for each other in memory.
// As many trees grow at the same time as there is memory for. In each step every tree follows one branch, the last one of
// its stack, and a tree that is complete makes room for that of another pixel (path regeneration). So all invocations have
// work until the last pixels. A step is six dispatches over queues of trees: interact_begin.comp writes the light of
// complete trees and begins those of other pixels; interact_extend.comp traces the branches; interact_sample.comp draws a
// light sample at the surfaces that they meet; interact_light.comp lights these; interact_ambient.comp adds the
// environment's light with visibility; interact_split.comp splits the branches there. So most kernels trace, or search
// lights, or shade, and need the registers of one of these. The host repeats STEPS steps until no tree is left;
// interact_next.comp moves the queues' sizes from the last to the first.
// The order within a queue varies from run to run. Each tree adds to its own pixel alone, in its own order, so the picture
// does not.
// Where to read: Laine, Karras and Aila, Megakernels Considered Harmful, HPG 2013; Novák, Havran and Dachsbacher, Path
// Regeneration for Interactive Path Tracing, Eurographics 2010; docs/decisions/architectures.md.
#ifndef INTERACT_STEPS_GLSL
#define INTERACT_STEPS_GLSL
#include "lib/queue.glsl"
#include "lib/ray_tree.glsl"

// The stacks of all trees: the words of a branch by level of the stack, each by tree, so neighbours read neighbouring words.
layout(pass, scalar) buffer Branches { uvec4 branches[]; };
const uint BRANCH_ORIGIN = 0;     // origin, source_face
const uint BRANCH_DIRECTION = 1;  // direction, width
const uint BRANCH_THROUGHPUT = 2; // throughput, events
const uint BRANCH_CONE = 3;       // spread, from
const uint BRANCH_MEDIA = 4;
const uint BRANCH_WORDS = 5; // of four words each
// What else is known of each tree.
layout(pass, scalar) buffer Trees { uvec4 trees[]; };
const uint TREE_PIXEL = 0;  // pixel, waiting branches, rays so far
const uint TREE_SUM = 1;    // sum, escaped
const uint TREE_AROUND = 2; // around, lost
const uint TREE_HIT = 3;    // hit of the last branch of the stack
const uint TREE_LIGHT = 4;  // first light sample there: to_light, t_max; arriving, pdf
const uint TREE_WORDS = 6;  // of four words each
// Queues of trees by the kernel that takes them next: begin and extend, each for even and for odd steps; then those that
// have met a surface in this step. At first all entries are NO_TREE: such an entry stands for the tree of its own place.
layout(pass, scalar) buffer Queues { uint queues[]; };
const uint BEGINNING = 0;
const uint GROWING = 2;
const uint MET = 4;
const uint TREE_QUEUES = 5;
const uint NO_TREE = 0xffffffffu;
// Steps between two checks of the host, an even number; the sizes of step STEPS are those of the next step 0.
const uint STEPS = 4;
layout(pass, scalar) buffer Steps { uint pixels_taken; StepSizes steps[]; };
layout(push_constant) uniform Push { uint trees_at_once; uint this_step; };

// Rays of one tree. The branches that then wait are dropped and counted, as at the limit of loop iterations on CPUs.
const uint MOST_RAYS = 1u << 16;
// A tree that stands for a pixel without surface.
const uint NO_PIXEL = 0xffffffffu;

uint waiting = 0;
uint tree = 0; // of this invocation

uint place_in_queue() {
    return listed_tile(gl_WorkGroupID) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
}

// Start of a queue of step `at`.
uint queue_start(uint queue, uint at) {
    return (queue + (at & 1u)) * trees_at_once;
}

// Appends trees to the queues of the next step: those with branches grow, the others are complete.
#define APPEND_TO_NEXT_STEP(wanted) \
    APPEND_TO_QUEUE(steps[this_step + 1].growing, queues, queue_start(GROWING, this_step + 1), (wanted) && waiting > 0, tree) \
    APPEND_TO_QUEUE(steps[this_step + 1].beginning, queues, queue_start(BEGINNING, this_step + 1), (wanted) && waiting == 0, tree)

uint branch_word(uint level, uint word) {
    return (level * BRANCH_WORDS + word) * trees_at_once + tree;
}

uint tree_word(uint word) {
    return word * trees_at_once + tree;
}

bool has_room() {
    return waiting < PENDING;
}

void push(Branch branch) {
    branches[branch_word(waiting, BRANCH_ORIGIN)] = uvec4(floatBitsToUint(branch.origin), branch.source_face);
    branches[branch_word(waiting, BRANCH_DIRECTION)] = uvec4(floatBitsToUint(branch.direction), floatBitsToUint(branch.width));
    branches[branch_word(waiting, BRANCH_THROUGHPUT)] = uvec4(floatBitsToUint(branch.throughput), branch.events);
    branches[branch_word(waiting, BRANCH_CONE)].xy = uvec2(floatBitsToUint(branch.spread), floatBitsToUint(branch.from));
    if (TRANSMISSIVE) branches[branch_word(waiting, BRANCH_MEDIA)] = branch.media;
    waiting++;
}

// The last branch of the stack, which stays there.
Branch last_branch() {
    uint level = waiting - 1;
    uvec4 a = branches[branch_word(level, BRANCH_ORIGIN)];
    uvec4 b = branches[branch_word(level, BRANCH_DIRECTION)];
    uvec4 c = branches[branch_word(level, BRANCH_THROUGHPUT)];
    uvec2 d = branches[branch_word(level, BRANCH_CONE)].xy;
    Branch ray;
    ray.origin = uintBitsToFloat(a.xyz);
    ray.source_face = a.w;
    ray.direction = uintBitsToFloat(b.xyz);
    ray.width = uintBitsToFloat(b.w);
    ray.throughput = uintBitsToFloat(c.xyz);
    ray.events = c.w;
    ray.spread = uintBitsToFloat(d.x);
    ray.from = uintBitsToFloat(d.y);
    ray.media = trace_terms.camera_media;
    if (TRANSMISSIVE) ray.media = branches[branch_word(level, BRANCH_MEDIA)];
    return ray;
}

void look(vec3 direction, vec3 throughput, float width) {
    around += throughput * (ENVIRONMENT ? environment_radiance(direction, width) : vec3(0.0));
}

// Reads and writes what the tree has gathered.
void read_sum() {
    uvec4 a = trees[tree_word(TREE_SUM)];
    sum = uintBitsToFloat(a.xyz);
    escaped = uintBitsToFloat(a.w);
}

void read_around() {
    uvec4 a = trees[tree_word(TREE_AROUND)];
    around = uintBitsToFloat(a.xyz);
    lost = uintBitsToFloat(a.w);
}

void write_sum() {
    trees[tree_word(TREE_SUM)] = uvec4(floatBitsToUint(sum), floatBitsToUint(escaped));
}

void write_around() {
    trees[tree_word(TREE_AROUND)] = uvec4(floatBitsToUint(around), floatBitsToUint(lost));
}

// The hit of the last branch.
Hit tree_hit() {
    uvec4 a = trees[tree_word(TREE_HIT)];
    return Hit(uintBitsToFloat(a.x), a.y, uintBitsToFloat(a.z), uintBitsToFloat(a.w));
}

LightSample drawn_apart() {
    uvec4 a = trees[tree_word(TREE_LIGHT)];
    uvec4 b = trees[tree_word(TREE_LIGHT + 1)];
    return LightSample(uintBitsToFloat(a.xyz), uintBitsToFloat(a.w), uintBitsToFloat(b.xyz), uintBitsToFloat(b.w));
}

void write_light(LightSample light) {
    trees[tree_word(TREE_LIGHT)] = uvec4(floatBitsToUint(light.to_light), floatBitsToUint(light.t_max));
    trees[tree_word(TREE_LIGHT + 1)] = uvec4(floatBitsToUint(light.arriving), floatBitsToUint(light.pdf));
}

// The surface that the last branch has met.
HitSurface surface_met(Branch ray, Hit found, float cone, uint slots) {
    HitSurface hit = hit_surface(hit_point_of(found, ray.origin, ray.direction), ray.direction, cone * exp2(trace_terms.lod_bias), slots);
    hit.s.media = ray.media;
    return hit;
}
#endif
