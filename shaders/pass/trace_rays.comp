// BVH traversal alone, for tests and measurements: rays from a buffer, hits into a buffer.
// An invocation traces one ray, or two that are 8 apart, so that neighbours stay together in a group of 8. Where to read:
// lib/trace.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 64) in;
#include "lib/trace.glsl"
#include "lib/add_work.glsl"

layout(constant) const bool ANY_HIT = false;
layout(constant) const bool PAIRS = false;
layout(constant) const bool COUNT = false;
layout(pass, rgba32ui) readonly uniform uimageBuffer rays; // origin, t_max | direction, source face (coplanar group it leaves)
layout(pass, scalar) writeonly buffer Hits { Hit hits[]; };
// lavapipe cuts workgroups into one contiguous piece per thread, so blocks of 32 of them are dealt out in turn.
layout(push_constant, scalar) uniform Push { uint count; uint blocks; };

struct RayRead {
    vec3 origin;
    vec3 direction;
    uint source_face;
    float t_max;
};

RayRead read_ray(uint i) {
    uvec4 o = imageLoad(rays, int(min(i, count - 1) * 2));
    uvec4 d = imageLoad(rays, int(min(i, count - 1) * 2 + 1));
    return RayRead(uintBitsToFloat(o.xyz), uintBitsToFloat(d.xyz), d.w, i < count ? uintBitsToFloat(o.w) : -1.0);
}

uint dealt(uint group) {
    uint block = group / 32;
    uint half_of = (blocks + 1) / 2;
    uint place = block < half_of ? 2 * block : 2 * (block - half_of) + 1;
    return place * 32 + group % 32;
}

void main() {
    uint group = dealt(gl_WorkGroupID.x);
    uint lane = gl_LocalInvocationID.x;
    if (PAIRS) {
        uint a = group * 128 + (lane / 8) * 16 + lane % 8;
        uint b = a + 8;
        RayRead ra = read_ray(a);
        RayRead rb = read_ray(b);
        HitPair hit = trace_pair(PairedRay(ra.origin, ra.direction, ra.source_face, 0.0, ra.t_max),
                                 PairedRay(rb.origin, rb.direction, rb.source_face, 0.0, rb.t_max), OPAQUE | FILTER, ANY_HIT);
        if (a < count) hits[a] = hit.a;
        if (b < count) hits[b] = hit.b;
    } else {
        uint a = group * 64 + lane;
        RayRead r = read_ray(a);
        Hit hit = trace(r.origin, r.direction, r.source_face, FROM_ORIGIN, r.t_max, OPAQUE | FILTER, ANY_HIT);
        if (a < count) hits[a] = hit;
    }
    if (COUNT) {
        ADD_WORK(node_visits, node_visits)
        ADD_WORK(triangle_tests, triangle_tests)
    }
}
