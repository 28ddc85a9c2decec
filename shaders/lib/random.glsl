// Random numbers: a low-discrepancy Sobol sequence with Owen scrambling, keyed by block of pixels, event and seed.
// They do not depend on the order of the work, so the picture does not either. Where to read: pbrt 4, section 8.7; Ahmed and
// Wonka 2020 (the sequence along a Morton curve over the pixels); Burley, JCGT 9(4) 2020 (hash-based Owen scrambling).
#ifndef RANDOM_GLSL
#define RANDOM_GLSL

// A hash of 32-bit words (PCG; Jarzynski and Olano, JCGT 9(3) 2020).
uint pcg(uint x) {
    uint state = x * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

uint hash(uvec3 key) {
    return pcg(key.x + pcg(key.y + pcg(key.z)));
}

// The leading 24 bits as a number in [0, 1).
float unit_float(uint word) {
    return float(word >> 8) * (1.0 / 16777216.0);
}

// Owen scrambling in base 2, of a word whose first digit is its last bit: a hash of the bits after it decides whether a bit
// is flipped (Laine and Karras, EGSR 2011, with the constants of Vegdahl, "Building a better LK hash", 2021).
uint scrambled_backwards(uint x, uint seed) {
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return x;
}

// Second dimension of the Sobol sequence, with its first digit in the last bit. Digit j is the sum mod 2 of C(i, j) times
// digit i of the index. C(i, j) is odd where the bits of j are among those of i (Lucas), so five sums over one bit each
// suffice.
uint sobol_second_backwards(uint index) {
    index ^= index >> 1 & 0x55555555u;
    index ^= index >> 2 & 0x33333333u;
    index ^= index >> 4 & 0x0f0f0f0fu;
    index ^= index >> 8 & 0x00ff00ffu;
    index ^= index >> 16 & 0x0000ffffu;
    return index;
}

// Pixels in blocks of 16x16.
const uint BLOCK = 16;

// Number of a pixel of a block along a Morton curve: the bits of x and y, 4 each, in turns.
uint morton(uvec2 place) {
    uint bits = place.x | place.y << 16;
    bits = (bits | bits << 2) & 0x00330033u;
    bits = (bits | bits << 1) & 0x00550055u;
    return (bits | bits >> 15) & 0xffu;
}

// A point in the unit square, as words, for one event of one sample of a pixel: number `index` of the pixel's `count`, a power
// of two. It is the (0, 2)-sequence of Sobol: any 2^k points from a multiple of 2^k on are stratified, with their share in each
// elementary interval. The pixels of a block follow each other in the sequence in Morton order, so the points of each square of
// 2x2, 4x4 or 8x8 pixels are stratified together as well: errors of neighbours cancel, and what is left is fine grain (blue
// noise). Each block, event and seed shuffles and scrambles the sequence in its own way.
uvec2 random_words(uvec2 pixel, uint event, uint seed, uint index, uint count) {
    uvec2 block = pixel / BLOCK;
    uint key = hash(uvec3(block.x | block.y << 16, event, seed ^ 0x68bc21ebu));
    uint in_order = morton(pixel % BLOCK) * count + index;
    uint shuffled = bitfieldReverse(scrambled_backwards(bitfieldReverse(in_order), key));
    uint x = scrambled_backwards(shuffled, pcg(key));
    uint y = scrambled_backwards(sobol_second_backwards(shuffled), pcg(key ^ 0x9e3779b9u));
    return uvec2(bitfieldReverse(x), bitfieldReverse(y));
}

vec2 random_point(uvec2 pixel, uint event, uint seed, uint index, uint count) {
    uvec2 words = random_words(pixel, event, seed, index, count);
    return vec2(unit_float(words.x), unit_float(words.y));
}
#endif
