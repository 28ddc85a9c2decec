//! A scene in one band of wavelengths, for spectral rendering: colours of materials become one number, and light
//! becomes X, Y, Z (lecture C3; docs/decisions/spectra.md).
//!
//! Read pbrt 4.5 and 4.6. Colours without a spectrum are upsampled (`etalon_optics::spectra::Upsampling`).

use super::lobe::{self, LOBES};
use super::{Light, Material, Scene};
use etalon_optics::spectra::{Band, Spectrum, Upsampling, light_from_rgb};

/// Spectra of all materials of a scene.
pub struct Wavelengths {
    curves: Vec<Curves>,
    /// The base colour of some material varies over its surface.
    pub vary: bool,
}

/// Spectra of one material.
struct Curves {
    /// Base reflectance; `None`: the shader upsamples the colour at each point.
    base: Option<Spectrum>,
    /// Textures or vertex colours multiply the base.
    varies: bool,
    /// Specular colour as a spectrum of at most 1, and its scale.
    specular: (Spectrum, f32),
    /// Transmittance over the attenuation distance.
    attenuation: Spectrum,
    /// n and κ of the conductor.
    metal: Option<[Spectrum; 2]>,
    /// Colours of the lobes over the base layer.
    lobes: [Option<Spectrum>; lobe::COUNT],
}

/// The wavelengths of one frame: a band, or a part of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slice {
    /// Band of the picture: reflectances are means over it.
    pub band: Band,
    /// The whole band, or a part that represents it: emission and refractive index are those of the part.
    pub part: Band,
    /// X, Y, Z of red, green and blue light, scaled from the part to the band.
    pub light_from_rgb: [[f64; 3]; 3],
}

impl Slice {
    /// A slice for a part of a band.
    #[must_use]
    pub fn new(band: Band, part: Band) -> Self {
        let mut slice = Self { band, part, light_from_rgb: light_from_rgb(&part) };
        let weight = slice.weight();
        slice.light_from_rgb.as_flattened_mut().iter_mut().for_each(|x| *x *= weight);
        slice
    }

    /// Width of the band over that of the part.
    #[must_use]
    pub fn weight(&self) -> f64 {
        (self.band.to - self.band.from) / (self.part.to - self.part.from)
    }

    /// X, Y, Z of a light in the band, in the unit of the light.
    #[must_use]
    pub fn light(&self, light: &Light) -> [f32; 3] {
        let of_rgb = |k: usize| (0..3).map(|i| f64::from(light.color[i]) * self.light_from_rgb[i][k]).sum::<f64>();
        let xyz = match &light.spectrum {
            Some(emission) => emission.in_band(&self.part).map(|x| x * self.weight()),
            None => [0, 1, 2].map(of_rgb),
        };
        xyz.map(|x| x as f32)
    }
}

/// A material in a band of wavelengths; the flags name the colours that are still RGB.
pub struct Banded {
    /// The material, with three equal numbers in place of each colour.
    pub material: Material,
    /// `base_color` is RGB: textures or vertex colours multiply it.
    pub base_rgb: bool,
    /// Textures or vertex colours are RGB, and `base_color` is a number.
    pub varies_rgb: bool,
    /// `emissive` is RGB, as is all light without a spectrum of its own.
    pub emissive_rgb: bool,
}

impl Wavelengths {
    /// Collects the spectra of all materials; colours without a spectrum are upsampled.
    #[must_use]
    pub fn new(scene: &Scene, upsampling: Upsampling) -> Self {
        let spectrum = |rgb: [f32; 3]| upsampling.reflectance(rgb.map(f64::from));
        let mut coloured = vec![false; scene.materials.len()];
        for mesh in scene.meshes.iter().filter(|mesh| !mesh.colors.is_empty()) {
            coloured[mesh.material] = true;
        }
        let of = |(m, coloured): (&Material, bool)| {
            let [r, g, b, _] = m.base_color;
            let varies = m.base_color_texture.is_some() || coloured;
            let told = m.reflectance.clone().or_else(|| m.conductor.map(|_| Spectrum::Constant(1.0)));
            let found = || (!varies).then(|| spectrum([r, g, b]));
            // F0 is multiplied by the scale before it is clamped to 1.
            let most = m.specular_color.iter().copied().fold(1.0, f32::max);
            Curves {
                base: if m.unlit { None } else { told.or_else(found) },
                varies,
                specular: (spectrum(m.specular_color.map(|c| c / most)), most),
                attenuation: spectrum(m.attenuation_color),
                lobes: std::array::from_fn(|i| LOBES[i].colour(&m.lobes[i]).map(spectrum)),
                metal: m.conductor_spectra.clone().or_else(|| m.conductor.map(between_lamps)),
            }
        };
        let curves: Vec<Curves> = scene.materials.iter().zip(coloured).map(of).collect();
        let vary = scene.materials.iter().zip(&curves).any(|(m, curves)| curves.varies && !m.unlit);
        Self { curves, vary }
    }

    /// Material `index` of the scene in a band.
    #[must_use]
    pub fn material(&self, index: usize, m: &Material, slice: &Slice) -> Banded {
        let curves = &self.curves[index];
        let band = &slice.band;
        let mean = |spectrum: &Spectrum| band.mean(|nm| spectrum.at(nm)) as f32;
        let mut material = Material {
            specular_color: [mean(&curves.specular.0) * curves.specular.1; 3],
            attenuation_color: [mean(&curves.attenuation); 3],
            ior: m.dispersion.index(f64::from(m.ior), slice.part.middle()) as f32,
            ..m.clone()
        };
        for ((lobe, of), colour) in LOBES.iter().zip(&mut material.lobes).zip(&curves.lobes) {
            if let (Some(components), Some(colour)) = (lobe.colour_components(), colour) {
                of.factors[components].fill(mean(colour));
            }
        }
        if let Some(base) = &curves.base {
            let mean = mean(base);
            material.base_color = [mean, mean, mean, m.base_color[3]];
        }
        if let Some([n, kappa]) = &curves.metal {
            let [n, kappa] = [mean(n), mean(kappa)];
            let f0 = ((n - 1.0).powi(2) + kappa * kappa) / ((n + 1.0).powi(2) + kappa * kappa);
            material.conductor = Some([[n, kappa]; 3]);
            material.base_color = [f0, f0, f0, m.base_color[3]];
        }
        if let Some(emission) = &m.emission {
            material.emissive = emission.in_band(&slice.part).map(|part| (part * slice.weight()) as f32);
        }
        let (told, varies) = (curves.base.is_some(), curves.varies);
        Banded { material, base_rgb: !told, varies_rgb: told && varies, emissive_rgb: m.emission.is_none() }
    }
}

/// n and κ given at the three wavelengths of lecture C1, red first, as spectra linear between them.
fn between_lamps(index: [[f32; 2]; 3]) -> [Spectrum; 2] {
    const LAMPS: [f64; 3] = [645.16, 526.32, 444.44];
    [0, 1].map(|part| {
        let row = |lamp: usize| [LAMPS[lamp], f64::from(index[lamp][part])];
        Spectrum::Table([row(2), row(1), row(0)].into())
    })
}
