// Arithmetic that takes time: dependent multiplications and additions.
#version 460
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
layout(pass, scalar) buffer Values { float values[]; };

void main() {
    float x = float(gl_GlobalInvocationID.x);
    for (uint i = 0; i < 4096; i++) x = x * 0.999 + 0.5;
    values[gl_GlobalInvocationID.x & 0xffffu] = x;
}
