// Random numbers that depend on the pixel, the sample and the event of a path alone: whatever the order of the work, the
// picture is the same.
#ifndef RANDOM_GLSL
#define RANDOM_GLSL

// A permutation of 32-bit words without visible structure (PCG; Jarzynski and Olano, JCGT 9(3) 2020).
uint pcg(uint x) {
    uint state = x * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

uint hash(uvec3 key) {
    return pcg(key.x + pcg(key.y + pcg(key.z)));
}

// In [0, 1), the leading 24 bits.
float unit_float(uint word) {
    return float(word >> 8) * (1.0 / 16777216.0);
}

// Second dimension of Sobol's sequence: Pascal's triangle mod 2, row by row. `index` below 2^10.
uint sobol_second(uint index) {
    uint result = 0;
    uint direction = 0x80000000u;
    for (uint i = 0; i < 10; i++) {
        result ^= (index >> i & 1u) != 0 ? direction : 0u;
        direction ^= direction >> 1;
    }
    return result;
}

// A point in the unit square for one event of one sample of a pixel: of `samples` of them, a power of two, each
// elementary interval gets its share ((0, 2)-sequence, scrambled by exclusive or). Each event has its own order.
vec2 random_point(uvec2 pixel, uint event, uint index, uint samples) {
    uint seed = hash(uvec3(pixel.x | pixel.y << 16, event, 0x68bc21ebu));
    uint place = index ^ (seed & (samples - 1));
    uint x = bitfieldReverse(place) ^ pcg(seed);
    uint y = sobol_second(place) ^ pcg(seed ^ 0x9e3779b9u);
    return vec2(unit_float(x), unit_float(y));
}
#endif
