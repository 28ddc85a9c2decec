//! A scene in one band of wavelengths: the same materials and lights, whose colours are numbers and whose light is X, Y, Z
//! (lecture C3; docs/decisions/spectra.md).

use super::{Light, Material, Scene};
use crate::spectra::{Band, Spectrum, Upsampling, light_from_rgb};

/// What the materials of a scene are by wavelength.
pub struct Wavelengths {
    curves: Vec<Curves>,
    /// Some base varies over its surface.
    pub vary: bool,
}

/// Of one material.
struct Curves {
    /// `None`: its base varies over the surface, and is found for the colour of each place.
    base: Option<Spectrum>,
    specular: Spectrum,
    /// What is left after the attenuation distance.
    attenuation: Spectrum,
    /// n and κ.
    metal: Option<[Spectrum; 2]>,
}

/// What a frame shows of the light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slice {
    /// A band of the picture: what reflects is its mean over it.
    pub band: Band,
    /// All of the band, or a part of it that stands for all: light is that of the part, and so is what bends it.
    pub part: Band,
}

impl Slice {
    /// How many of such parts the band has.
    #[must_use]
    pub fn weight(&self) -> f64 {
        (self.band.to - self.band.from) / (self.part.to - self.part.from)
    }

    /// X, Y, Z of a light, in its own unit.
    #[must_use]
    pub fn light(&self, light: &Light) -> [f32; 3] {
        let xyz = match &light.spectrum {
            Some(emission) => emission.in_band(&self.part),
            None => {
                let columns = light_from_rgb(&self.part);
                [0, 1, 2].map(|k| (0..3).map(|i| f64::from(light.color[i]) * columns[i][k]).sum())
            }
        };
        xyz.map(|x| (x * self.weight()) as f32)
    }
}

/// A material in a band, and what of it is still told as red, green and blue.
pub struct Banded {
    /// Numbers stand three times where colours stood.
    pub material: Material,
    /// `base_color` is: texels or vertices multiply it.
    pub base_rgb: bool,
    /// `emissive` is: as all light that has no spectrum of its own.
    pub emissive_rgb: bool,
}

impl Wavelengths {
    /// Fits what is told as colours.
    #[must_use]
    pub fn new(scene: &Scene, upsampling: Upsampling) -> Self {
        let spectrum = |rgb: [f32; 3]| upsampling.reflectance(rgb.map(f64::from));
        let mut coloured = vec![false; scene.materials.len()];
        for mesh in scene.meshes.iter().filter(|mesh| !mesh.colors.is_empty()) {
            coloured[mesh.material] = true;
        }
        let of = |(m, coloured): (&Material, bool)| {
            let [r, g, b, _] = m.base_color;
            let varies = m.unlit || m.base_color_texture.is_some() || coloured;
            Curves {
                base: (!varies).then(|| m.reflectance.clone().unwrap_or_else(|| spectrum([r, g, b]))),
                specular: spectrum(m.specular_color),
                attenuation: spectrum(m.attenuation_color),
                metal: m.conductor_spectra.clone().or_else(|| m.conductor.map(between_lamps)),
            }
        };
        let curves: Vec<Curves> = scene.materials.iter().zip(coloured).map(of).collect();
        let vary = scene.materials.iter().zip(&curves).any(|(m, curves)| curves.base.is_none() && !m.unlit);
        Self { curves, vary }
    }

    /// Material `index` of the scene in a band.
    #[must_use]
    pub fn material(&self, index: usize, m: &Material, slice: &Slice) -> Banded {
        let curves = &self.curves[index];
        let band = &slice.band;
        let mean = |spectrum: &Spectrum| band.mean(|nm| spectrum.at(nm)) as f32;
        let mut material = Material {
            specular_color: [mean(&curves.specular); 3],
            attenuation_color: [mean(&curves.attenuation); 3],
            ior: m.dispersion.index(f64::from(m.ior), slice.part.middle()) as f32,
            ..m.clone()
        };
        if let Some(base) = &curves.base {
            let mean = mean(base);
            material.base_color = [mean, mean, mean, m.base_color[3]];
        }
        if let Some([n, kappa]) = &curves.metal {
            let [n, kappa] = [mean(n), mean(kappa)];
            material.conductor = Some([[n, kappa]; 3]);
            if curves.base.is_some() {
                let f0 = ((n - 1.0).powi(2) + kappa * kappa) / ((n + 1.0).powi(2) + kappa * kappa);
                material.base_color = [f0, f0, f0, m.base_color[3]];
            }
        }
        if let Some(emission) = &m.emission {
            material.emissive = emission.in_band(&slice.part).map(|part| (part * slice.weight()) as f32);
        }
        Banded { material, base_rgb: curves.base.is_none(), emissive_rgb: m.emission.is_none() }
    }
}

/// n and κ that are told at the three lamps of lecture C1, red first: linear between.
fn between_lamps(index: [[f32; 2]; 3]) -> [Spectrum; 2] {
    const LAMPS: [f64; 3] = [645.16, 526.32, 444.44];
    [0, 1].map(|part| {
        let row = |lamp: usize| [LAMPS[lamp], f64::from(index[lamp][part])];
        Spectrum::Table([row(2), row(1), row(0)].into())
    })
}
