// One band of wavelengths (lecture C3): what reflects, transmits or bends is a number there, the same in all three components,
// and light is the X, Y, Z of what it sends in the band. Beside this file only what reads a colour of a material asks
// which of the two a picture is made of.
#ifndef SPECTRUM_GLSL
#define SPECTRUM_GLSL

layout(constant) const bool SPECTRAL = false; // the picture is drawn band by band
layout(constant) const uint GRID_SIDE = 0;    // corners a side of the grid of reflectances; 0: they are sums
// Columns of X, Y, Z of light that is red, green, blue | shares of red, green and blue in the band | then
// the grid over the square roots of red, green and blue, cell by cell, red fastest: square roots of reflectances at a corner, at
// the next red, the next green, and both.
layout(scene, rgba32f) readonly uniform imageBuffer spectrum;
const int SHARES_AT = 3;
const int GRID_AT = 4;

// Light that is told as linear Rec. 709.
vec3 light_of_rgb(vec3 rgb) {
    if (!SPECTRAL) return rgb;
    return imageLoad(spectrum, 0).xyz * rgb.r + imageLoad(spectrum, 1).xyz * rgb.g + imageLoad(spectrum, 2).xyz * rgb.b;
}

// What adds up, where it is told as three numbers.
vec3 sum_of_rgb(vec3 rgb) {
    return SPECTRAL ? vec3(dot(imageLoad(spectrum, SHARES_AT).xyz, rgb)) : rgb;
}

// Reflectance that is told as linear Rec. 709.
vec3 reflectance_of_rgb(vec3 rgb) {
    if (GRID_SIDE == 0) return sum_of_rgb(rgb);
    vec3 at = sqrt(clamp(rgb, 0.0, 1.0)) * float(GRID_SIDE - 1);
    vec3 cell = min(floor(at), vec3(GRID_SIDE - 2));
    vec3 share = at - cell;
    ivec3 i = ivec3(cell);
    int cells = int(GRID_SIDE) - 1;
    int texel = GRID_AT + (i.z * cells + i.y) * cells + i.x;
    vec4 low = imageLoad(spectrum, texel);
    vec4 high = imageLoad(spectrum, texel + cells * cells);
    // In the tetrahedron that goes from the least corner first along the largest share: a grey lies on the diagonal, between
    // greys, and stays one.
    bool red = share.r >= share.g && share.r >= share.b;
    bool green = !red && share.g >= share.b;
    float one = red ? low.y : green ? low.z : high.x;
    float two = red ? share.g >= share.b ? low.w : high.y : green ? share.r >= share.b ? low.w : high.z
        : share.r >= share.g ? high.y : high.z;
    float most = max(share.r, max(share.g, share.b));
    float least = min(share.r, min(share.g, share.b));
    float middle = share.r + share.g + share.b - most - least;
    float root = low.x + (one - low.x) * most + (two - one) * middle + (high.w - two) * least;
    return vec3(root * root);
}
#endif
