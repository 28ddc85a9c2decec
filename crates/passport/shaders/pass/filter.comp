// A linear filter between two texels: the weights that the device can give them.
// Where to read: the Vulkan specification, section Texel Filtering, and the limit subTexelPrecisionBits.
#version 460
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
layout(pass) uniform sampler2D two_texels; // 0 on the left, 1 on the right
layout(pass, scalar) writeonly buffer Weights { float weights[]; };
layout(push_constant, scalar) uniform Push { uint count; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= count) return;
    // From the middle of the left texel to that of the right one.
    float u = 0.25 + 0.5 * (float(i) + 0.5) / float(count);
    weights[i] = textureLod(two_texels, vec2(u, 0.5), 0.0).r;
}
