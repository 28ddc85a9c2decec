// Thin-film interference over the base (KHR_materials_iridescence): soap bubbles, oil on water, anodised metal.
// A plane wave is reflected at the film's outer face (amplitude a) and at its inner face (amplitude ρ); each crossing of the
// film and back adds the phase φ = 2π · 2 n d cosθ / λ. The sum over all orders (Airy) is
//   r = (a + ρ e^{iφ})/(1 + aρ e^{iφ}),   |r|² = (a² + ρ² + 2aρ cosφ)/(1 + a²ρ² + 2aρ cosφ).
// As a series with q = −aρ: |r|² = 1 − T (1 + 2 Σ qᵐ cos mφ), T = (1 − a²)(1 − ρ²)/(1 − q²).
// In a band of wavelengths the closed form holds at the band's middle. For red, green and blue each cos mφ is replaced by
// its mean over the sensitivity of a channel.
// Where to read: Born and Wolf, sections 1.5.2 and 7.6.1 (Fresnel's and Airy's formulae); Belcour and Barla 2017;
// docs/decisions/materials.md. Twin: crates/optics/src/thin_film.rs. Assumes: amplitudes in [−1, 1]; lengths in nm.
#ifndef THIN_FILM_GLSL
#define THIN_FILM_GLSL
#include "lib/arithmetic.glsl"
#include "lib/colour.glsl"
#include "lib/spectrum.glsl"

// @eq F3: |r|² = (a² + ρ² + 2aρ cosφ)/(1 + a²ρ² + 2aρ cosφ)
// @out F
// Reflectance of a film for one wavelength. With a² + ρ² + 2aρ cosφ = (a + ρ)² − 2aρ (1 − cosφ), a film of no thickness has
// no difference of large numbers.
float film_reflectance(float a, float rho, float cos_phi) {
    float twice = 2.0 * a * rho;
    float F = (a * a + rho * rho + twice * cos_phi) / (1.0 + a * a * rho * rho + twice * cos_phi);
    if (ARITHMETIC != FAST) {
        float sum = a + rho;
        float whole = 1.0 + a * rho;
        float numerator = sum * sum - twice * (1.0 - cos_phi);
        F = clamp(numerator / max(whole * whole - twice * (1.0 - cos_phi), SMALLEST_NORMAL), 0.0, 1.0);
    }
    return F;
}

// Mean of cos(2π path/λ) over the sensitivities of red, green and blue, relative to white. The matching functions are four
// Gaussians over 1/λ (Belcour and Barla 2017), so the mean has a closed form.
vec3 film_sensitivity(float path) {
    float micrometres = path * 1e-3;
    const vec4 TURNS = vec4(1.6810, 1.7953, 2.2084, 2.2399);
    const vec4 DECAYS = vec4(-4.3278e-3, -9.3046e-3, -6.6121e-3, -4.5282e-3);
    float k = 2.0 * PI * micrometres;
    vec4 gaussians;
    for (int i = 0; i < 4; i++) gaussians[i] = cos_of_turns(TURNS[i] * micrometres) * exp(DECAYS[i] * (k * k));
    // X has two, weighted by their areas.
    vec3 xyz = vec3(0.846202 * gaussians.x + 0.153798 * gaussians.w, gaussians.yz);
    // Equal X, Y and Z are not white in Rec. 709: each channel is divided by its value for them.
    return linear_srgb(xyz) / linear_srgb(vec3(1.0));
}

// A film of index n at an angle of incidence.
struct Film {
    float n;
    float sin2;       // (n1 sinθ)² in the medium n1 outside: the same in all layers
    float cos_film;   // within the film
    vec2 outer;       // amplitudes of the outer face, both polarisations
    bool total;       // total internal reflection there
    // In a band of wavelengths cosφ. Otherwise the means of cosφ, cos 2φ and cos 3φ: for |q| ≤ 0.05, films on glass, the rest is
    // below 2e-5; for |q| ≤ 0.3, dense films on metals, below 2q⁴/(1 − q) = 2.3 %.
    vec3 cos_phi;
    vec3 cos_2_phi;
    vec3 cos_3_phi;
};

// Amplitudes r_s and r_p of the interface from n1 to n2, from the cosines on both sides. The differences cancel for nearly
// equal indices: both are good to 1e-7, and so is the reflectance.
vec2 interface_amplitudes(float cos_1, float cos_2, float n1, float n2) {
    vec2 near = vec2(n1, n2) * cos_1;
    vec2 far = vec2(n2, n1) * cos_2;
    return (near - far) / max(near + far, vec2(1e-12));
}

Film film_at(float cos_in, float n1, float n, float thickness) {
    Film film;
    film.n = n;
    film.sin2 = n1 * n1 * max(1.0 - cos_in * cos_in, 0.0);
    float cos2 = 1.0 - film.sin2 / (n * n);
    film.total = cos2 <= 0.0;
    film.cos_film = sqrt(max(cos2, 0.0));
    film.outer = interface_amplitudes(cos_in, film.cos_film, n1, n);
    float path = 2.0 * n * thickness * film.cos_film;
    film.cos_phi = SPECTRAL ? vec3(cos_of_turns(path / band_wavelength())) : film_sensitivity(path);
    film.cos_2_phi = film_sensitivity(2.0 * path);
    film.cos_3_phi = film_sensitivity(3.0 * path);
    return film;
}

// Reflectance in a channel, for one polarisation, with the amplitude ρ of the inner face.
float film_in_channel(Film film, float a, float rho, int channel) {
    float q = -a * rho;
    float sum = 1.0 + 2.0 * q * (film.cos_phi[channel] + q * (film.cos_2_phi[channel] + q * film.cos_3_phi[channel]));
    return clamp(1.0 - (1.0 - a * a) * (1.0 - rho * rho) / (1.0 - q * q) * sum, 0.0, 1.0);
}

// Mean of both polarisations.
float film_unpolarised(Film film, vec2 rho, int channel) {
    return 0.5 * (film_in_channel(film, film.outer.x, rho.x, channel) + film_in_channel(film, film.outer.y, rho.y, channel));
}

// The same for the wavelength of a band.
vec3 film_in_band(Film film, vec2 rho) {
    return vec3(0.5 * (film_reflectance(film.outer.x, rho.x, film.cos_phi.x) + film_reflectance(film.outer.y, rho.y, film.cos_phi.x)));
}

// Reflectance of the film over a dielectric of index n2, unpolarised.
vec3 film_over_dielectric(Film film, float n2) {
    float cos_behind = sqrt(max(1.0 - film.sin2 / (n2 * n2), 0.0));
    vec2 rho = interface_amplitudes(film.cos_film, cos_behind, film.n, n2);
    // Channel by channel, which needs fewer registers. A loop would cost lavapipe a quarter of its time for pipelines.
    vec3 f = SPECTRAL ? film_in_band(film, rho)
                      : vec3(film_unpolarised(film, rho, 0), film_unpolarised(film, rho, 1), film_unpolarised(film, rho, 2));
    return film.total ? vec3(1.0) : f;
}

// Reflectance of the film over a metal of reflectance `metal`, unpolarised. A reflectance has no phase: it counts as that of a
// denser medium.
vec3 film_over_metal(Film film, vec3 metal) {
    vec3 rho = sqrt(clamp(metal, 0.0, 1.0));
    vec3 f = SPECTRAL ? film_in_band(film, vec2(-rho.x, rho.x))
                      : vec3(film_unpolarised(film, vec2(-rho.x, rho.x), 0), film_unpolarised(film, vec2(-rho.y, rho.y), 1),
                             film_unpolarised(film, vec2(-rho.z, rho.z), 2));
    return film.total ? vec3(1.0) : f;
}
#endif
