// Spectral rendering by bands of wavelengths, and spectral upsampling of RGB in a band (lecture C3).
// A spectral picture is drawn band by band. In a band, reflectance, transmittance and index are numbers, equal in all three
// components; radiance is the X, Y, Z of the light in the band. Besides this file, only code that reads a material's colour
// distinguishes spectral from RGB rendering.
// Where to read: Jakob and Hanika 2019 (spectral upsampling); pbrt 4, chapter 4; docs/decisions/spectra.md. Assumes: RGB is
// linear Rec. 709.
#ifndef SPECTRUM_GLSL
#define SPECTRUM_GLSL

layout(constant) const bool SPECTRAL = false; // spectral rendering: the picture is drawn band by band
layout(constant) const uint GRID_SIDE = 0;    // points per side of the upsampling grid; 0: reflectances are sums of R, G and B
// Texels: X, Y, Z of red, green and blue light in the band (w of red: its middle in nm) | shares of red, green and blue in the band | the upsampling
// grid over the square roots of red, green and blue, cell by cell, red fastest. A cell holds square roots of reflectances:
// at its corner, at the next red, the next green, and both.
layout(scene, rgba32f) readonly uniform imageBuffer spectrum;
const int SHARES_AT = 3;
const int GRID_AT = 4;

// Middle of the current band, or of the part of it that represents it, in nm.
float band_wavelength() {
    return imageLoad(spectrum, 0).w;
}

// Light given as linear Rec. 709, in the current band.
vec3 light_of_rgb(vec3 rgb) {
    if (!SPECTRAL) return rgb;
    return imageLoad(spectrum, 0).xyz * rgb.r + imageLoad(spectrum, 1).xyz * rgb.g + imageLoad(spectrum, 2).xyz * rgb.b;
}

// A quantity that adds up (such as σ), given by three numbers, in the current band.
vec3 sum_of_rgb(vec3 rgb) {
    return SPECTRAL ? vec3(dot(imageLoad(spectrum, SHARES_AT).xyz, rgb)) : rgb;
}

// Spectral upsampling of a reflectance given as linear Rec. 709: its value in the current band.
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
    // Tetrahedral interpolation: the tetrahedron from the least corner, first along the largest fraction. Greys lie on the
    // diagonal, between greys, and stay grey.
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
