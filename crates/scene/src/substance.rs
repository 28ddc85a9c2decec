//! Optical constants: refractive indices of named substances (lecture F1), metals as n and κ, dielectrics by Sellmeier
//! formulas.
//!
//! Read pbrt 9.3 and 9.4. The source of each constant is beside it.

use etalon_optics::spectra::{self, Dispersion, Spectrum};

/// The index of refraction for "infinite" (KHR_materials_ior, value 0): F0 is within 4e-6 of 1.
pub(crate) const INFINITE_IOR: f32 = 1.0e6;

/// Complex index (n, κ) of a metal at 645.16, 526.32 and 444.44 nm, the three wavelengths of lecture C1, red first.
pub(crate) type ComplexIndex = [(f64, f64); 3];

/// A metal: its name in [`spectra::metal`] and its index at the three wavelengths.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Metal {
    /// Key into the tables by wavelength.
    name: &'static str,
    /// Index for rendering in RGB.
    lamps: ComplexIndex,
}

/// Gold, silver and copper: Johnson & Christy, "Optical constants of the noble metals", Phys. Rev. B 6, 4370 (1972), as
/// tabulated by refractiveindex.info (CC0 1.0), interpolated linearly between its wavelengths.
pub(crate) const GOLD: Metal = Metal { name: "gold", lamps: [(0.1635, 3.5543), (0.5828, 2.1542), (1.4022, 1.9248)] };
pub(crate) const SILVER: Metal =
    Metal { name: "silver", lamps: [(0.0534, 4.3718), (0.0520, 3.3753), (0.0400, 2.5953)] };
pub(crate) const COPPER: Metal =
    Metal { name: "copper", lamps: [(0.2469, 3.5650), (1.1487, 2.6019), (1.2432, 2.3679)] };
/// Rakić, "Algorithm for the determination of intrinsic optical constants of metal films: application to aluminum",
/// Appl. Opt. 34, 4755 (1995), as tabulated and interpolated for gold.
pub(crate) const ALUMINIUM: Metal =
    Metal { name: "aluminium", lamps: [(1.5271, 7.6630), (0.9147, 6.3540), (0.6137, 5.3874)] };

/// A transparent dielectric.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Medium {
    /// n at the Fraunhofer d line, 587.56 nm.
    pub n: f64,
    /// n at all other wavelengths.
    pub dispersion: Dispersion,
}

const fn sellmeier(n: f64, b: [f64; 4], c: [f64; 4]) -> Medium {
    Medium { n, dispersion: Dispersion::Sellmeier { b, c } }
}

/// Water relative to air at 20 °C; IAPWS R9-97 gives 1.3330, the index of lecture F7. Dispersion: Daimon & Masumura,
/// Appl. Opt. 46, 3811 (2007), whose Sellmeier formula gives 1.3334.
const WATER: Medium = sellmeier(
    1.333,
    [0.568_402_756_5, 0.172_617_739_1, 0.020_861_895_78, 0.113_074_868_8],
    [0.005_101_829_712, 0.018_211_539_36, 0.026_207_222_93, 10.697_927_21],
);
/// Schott's crown glass BK7 and dense flint SF10, by the Sellmeier formulas of Schott's catalogue of 2017.
pub(crate) const BK7: Medium = sellmeier(
    1.5168,
    [1.039_612_12, 0.231_792_344, 1.010_469_45, 0.0],
    [0.006_000_698_67, 0.020_017_914_4, 103.560_653, 0.0],
);
pub(crate) const SF10: Medium = sellmeier(
    1.72825,
    [1.616_259_77, 0.259_229_334, 1.077_623_17, 0.0],
    [0.012_753_455_9, 0.058_198_395_4, 116.607_68, 0.0],
);
/// Malitson, "Interspecimen comparison of the refractive index of fused silica", J. Opt. Soc. Am. 55, 1205 (1965).
const FUSED_SILICA: Medium = sellmeier(
    1.45846,
    [0.696_166_3, 0.407_942_6, 0.897_479_4, 0.0],
    [0.068_404_3 * 0.068_404_3, 0.116_241_4 * 0.116_241_4, 9.896_161 * 9.896_161, 0.0],
);
/// Peter, "Über Brechungsindizes und Absorptionskonstanten des Diamanten", Z. Phys. 15, 358 (1923).
const DIAMOND: Medium = sellmeier(2.4175, [0.3306, 4.3356, 0.0, 0.0], [0.175 * 0.175, 0.106 * 0.106, 0.0, 0.0]);

/// Optical class of a substance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Substance {
    /// A conductor: it absorbs within a wavelength, so only its surface is visible.
    Metal(Metal),
    /// A dielectric: light enters it.
    Dielectric(Medium),
}

/// Substances by the names that files may use.
pub(crate) const SUBSTANCES: &[(&str, Substance)] = &[
    ("gold", Substance::Metal(GOLD)),
    ("silver", Substance::Metal(SILVER)),
    ("copper", Substance::Metal(COPPER)),
    ("aluminium", Substance::Metal(ALUMINIUM)),
    ("water", Substance::Dielectric(WATER)),
    ("bk7", Substance::Dielectric(BK7)),
    ("sf10", Substance::Dielectric(SF10)),
    ("fused-silica", Substance::Dielectric(FUSED_SILICA)),
    ("diamond", Substance::Dielectric(DIAMOND)),
];

/// Reflectance at normal incidence, lecture F2: ((n − 1)² + κ²) / ((n + 1)² + κ²).
pub(crate) fn f0(index: ComplexIndex) -> [f32; 3] {
    index.map(|(n, k)| (((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k)) as f32)
}

impl Metal {
    /// n and κ in the layout of [`crate::Material::conductor`], red first.
    pub(crate) fn index(&self) -> [[f32; 2]; 3] {
        self.lamps.map(|(n, k)| [n as f32, k as f32])
    }

    /// n and κ by wavelength.
    pub(crate) fn spectra(&self) -> Option<[Spectrum; 2]> {
        spectra::metal(self.name)
    }

    /// Reflectance at normal incidence.
    pub(crate) fn f0(&self) -> [f32; 3] {
        f0(self.lamps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use etalon_optics::spectra::FRAUNHOFER_D;

    #[test]
    fn media_have_the_index_of_their_dispersion_formula_in_yellow_light() {
        for (name, substance) in SUBSTANCES {
            let Substance::Dielectric(Medium { n, dispersion }) = substance else { continue };
            let by_formula = dispersion.index(*n, FRAUNHOFER_D);
            // Half a unit in the last digit of the constants, and the rounding of the catalogues; water is rounded
            // more.
            let rounded = if *name == "water" { 5e-4 } else { 6e-6 };
            assert!(
                (by_formula - n).abs() < rounded || *name == "diamond" && (by_formula - n).abs() < 5e-5,
                "{name}: {by_formula}"
            );
        }
    }
}
