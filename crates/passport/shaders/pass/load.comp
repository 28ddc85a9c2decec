// Loads of one kind: every invocation sums vectors that lie `stride` apart, so that neighbours load neighbours.
#version 460
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
layout(constant) const uint KIND = 0; // 0: storage buffer; 1: storage texel buffer; 2: sampled image; 3: atomic additions
layout(pass, scalar) readonly buffer Vectors { vec4 vectors[]; };
layout(pass, rgba32f) readonly uniform imageBuffer texels;
layout(pass) uniform sampler2D picture;
layout(pass, scalar) buffer Sums { float sums[]; };
layout(pass, scalar) buffer Counters { uint counters[]; };
layout(push_constant, scalar) uniform Push { uint stride; uint loads; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    vec4 sum = vec4(0.0);
    for (uint load = 0; load < loads; load++) {
        uint at = load * stride + i;
        if (KIND == 0) sum += vectors[at];
        if (KIND == 1) sum += imageLoad(texels, int(at));
        if (KIND == 2) sum += texelFetch(picture, ivec2(at & 4095u, at >> 12), 0);
        if (KIND == 3) atomicAdd(counters[at & 255u], 1u);
    }
    sums[i] = sum.x + sum.y + sum.z + sum.w;
}
