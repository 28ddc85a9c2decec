// One built-in function or operation of GLSL over columns of inputs.
// Where to read: the Vulkan specification, appendix Precision and Operation of SPIR-V Instructions.
#version 460
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
layout(constant) const uint OPERATION = 0;
layout(pass, scalar) readonly buffer Inputs { float inputs[]; };
layout(pass, scalar) writeonly buffer Outputs { float outputs[]; };
layout(push_constant, scalar) uniform Push { uint count; };

float value(float a, float b, float c) {
    switch (OPERATION) {
    case 0: return a + b;
    case 1: return a * b;
    case 2: return a / b;
    case 3: return sqrt(a);
    case 4: return inversesqrt(a);
    case 5: return exp2(a);
    case 6: return log2(a);
    case 7: return exp(a);
    case 8: return log(a);
    case 9: return sin(a);
    case 10: return cos(a);
    case 11: return pow(a, b);
    case 12: return acos(a);
    case 13: return atan(a, b);
    case 14: return fma(a, b, c);
    // One rounding or two; what `precise` asks for is two.
    case 15: return a * b + c;
    case 16: { precise float product = a * b; precise float sum = product + c; return sum; }
    // Its bits: compilers take a packing that is unpacked again for nothing.
    case 17: return uintBitsToFloat(packHalf2x16(vec2(a, 0.0)));
    case 18: return min(a, b);
    case 19: return isnan(a) ? 1.0 : 0.0;
    default: return a;
    }
}

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i < count) outputs[i] = value(inputs[i], inputs[count + i], inputs[2 * count + i]);
}
