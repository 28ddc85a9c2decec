//! Indices of refraction of real substances (lecture F1), by the names that files may use.

/// The index of refraction that stands for "infinite" (KHR_materials_ior, value 0): F0 is within 4e-6 of 1.
pub(crate) const INFINITE_IOR: f32 = 1.0e6;

/// Complex index (n, κ) of a metal at 645.16, 526.32 and 444.44 nm: the three lamps of lecture C1, red first.
pub(crate) type ComplexIndex = [(f64, f64); 3];

/// Johnson & Christy, "Optical constants of the noble metals", Phys. Rev. B 6, 4370 (1972), as tabulated by
/// refractiveindex.info (CC0 1.0), linear between its wavelengths. The other two noble metals are from there too.
pub(crate) const GOLD: ComplexIndex = [(0.1635, 3.5543), (0.5828, 2.1542), (1.4022, 1.9248)];
pub(crate) const SILVER: ComplexIndex = [(0.0534, 4.3718), (0.0520, 3.3753), (0.0400, 2.5953)];
pub(crate) const COPPER: ComplexIndex = [(0.2469, 3.5650), (1.1487, 2.6019), (1.2432, 2.3679)];
/// Rakić, "Algorithm for the determination of intrinsic optical constants of metal films: application to aluminum",
/// Appl. Opt. 34, 4755 (1995), by the same route.
pub(crate) const ALUMINIUM: ComplexIndex = [(1.5271, 7.6630), (0.9147, 6.3540), (0.6137, 5.3874)];

/// Water against air at 20 °C in yellow light, the index of lecture F7; IAPWS R9-97 has 1.3330.
const WATER: f64 = 1.333;
/// n_d at 587.56 nm of Schott's crown BK7 and dense flint SF10, from the dispersion formulas of Schott's catalogue.
const BK7: f64 = 1.5168;
const SF10: f64 = 1.72825;
/// n_d by the dispersion formula of Peter, "Über Brechungsindizes und Absorptionskonstanten des Diamanten", Z. Phys.
/// 15, 358 (1923).
const DIAMOND: f64 = 2.4175;

/// What light meets in a substance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Substance {
    /// Absorbs within a wavelength: only its surface is seen.
    Metal(ComplexIndex),
    /// Lets light in, with one index for all colours.
    Dielectric(f64),
}

/// The substances by name.
pub(crate) const SUBSTANCES: &[(&str, Substance)] = &[
    ("gold", Substance::Metal(GOLD)),
    ("silver", Substance::Metal(SILVER)),
    ("copper", Substance::Metal(COPPER)),
    ("aluminium", Substance::Metal(ALUMINIUM)),
    ("water", Substance::Dielectric(WATER)),
    ("bk7", Substance::Dielectric(BK7)),
    ("sf10", Substance::Dielectric(SF10)),
    ("diamond", Substance::Dielectric(DIAMOND)),
];

/// Reflectance at normal incidence, lecture F2: ((n − 1)² + κ²) / ((n + 1)² + κ²).
pub(crate) fn f0(index: ComplexIndex) -> [f32; 3] {
    index.map(|(n, k)| (((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k)) as f32)
}

/// An index as materials carry it.
pub(crate) fn conductor(index: ComplexIndex) -> [[f32; 2]; 3] {
    index.map(|(n, k)| [n as f32, k as f32])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glasses_and_diamond_have_the_index_of_their_dispersion_formula() {
        // Sellmeier: n² = 1 + Σ B λ² / (λ² − C), λ in µm, at the helium d line.
        let at_d = |terms: &[(f64, f64)]| {
            let square = 0.587_561_8_f64.powi(2);
            (1.0 + terms.iter().map(|(b, c)| b * square / (square - c)).sum::<f64>()).sqrt()
        };
        let bk7 = [(1.039_612_12, 0.006_000_698_67), (0.231_792_344, 0.020_017_914_4), (1.010_469_45, 103.560_653)];
        let sf10 = [(1.616_259_77, 0.012_753_455_9), (0.259_229_334, 0.058_198_395_4), (1.077_623_17, 116.607_68)];
        let diamond = [(0.3306, 0.175 * 0.175), (4.3356, 0.106 * 0.106)];
        // Half a unit of the last digit that the constants give, and what the catalogue rounded.
        assert!((at_d(&bk7) - BK7).abs() < 1e-6, "{}", at_d(&bk7));
        assert!((at_d(&sf10) - SF10).abs() < 1e-6, "{}", at_d(&sf10));
        assert!((at_d(&diamond) - DIAMOND).abs() < 5e-5, "{}", at_d(&diamond));
    }
}
