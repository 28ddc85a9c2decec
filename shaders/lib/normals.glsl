// Storage of normals in the G-buffer (knob `normals`): octahedral encodings packed into 32-bit words.
// Every device can render to these integer formats. Where to read: Cigolle et al., JCGT 3(2) 2014; lib/encode.glsl.
#ifndef NORMALS_GLSL
#define NORMALS_GLSL
#include "lib/encode.glsl"

layout(constant) const uint NORMALS = 2; // rung of the knob `normals`

const uint NORMALS_OCT16 = 0;
const uint NORMALS_OCT24 = 1;
const uint NORMALS_OCT32 = 2;
const uint NORMALS_F32 = 3;

// Steps on each side of 0 that a component is rounded to; 0: the storage format decides.
const uint NORMAL_STEPS = NORMALS == NORMALS_OCT16 ? 127u : NORMALS == NORMALS_OCT24 ? 2047u : 0u;

vec2 stored_octahedron(vec3 n) {
    return in_steps(octahedral_from_unit(n), NORMAL_STEPS);
}

// Words for the octahedral encodings of shading normal and geometric normal: one word, two, or four. No renderable format
// has four components of 12 bits: `oct24` leaves four of each 16 bits empty, and costs as much as `oct32`.
uvec4 words_of_octahedra(vec4 p) {
    if (NORMALS == NORMALS_OCT16) return uvec4(packSnorm4x8(p), 0, 0, 0);
    if (NORMALS == NORMALS_F32) return floatBitsToUint(p);
    return uvec4(packSnorm2x16(p.xy), packSnorm2x16(p.zw), 0, 0);
}

vec4 octahedra_of_words(uvec4 words) {
    if (NORMALS == NORMALS_OCT16) return unpackSnorm4x8(words.x);
    if (NORMALS == NORMALS_F32) return uintBitsToFloat(words);
    return vec4(unpackSnorm2x16(words.x), unpackSnorm2x16(words.y));
}
#endif
