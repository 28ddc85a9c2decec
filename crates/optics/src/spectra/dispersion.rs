//! Dispersion: index of refraction by wavelength (lecture F1), by the formulas of Sellmeier and Cauchy or by Abbe
//! number.
//!
//! Read KHR_materials_dispersion and docs/colour.md.

use crate::colour::{cauchy, sellmeier};

/// Fraunhofer d line, the yellow line of helium, in nm: the wavelength of an index given without one.
pub const FRAUNHOFER_D: f64 = 587.5618;

/// Dependence of the index on the wavelength.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Dispersion {
    /// Constant index.
    #[default]
    None,
    /// 20/V_d of the Abbe number V_d; the index at the d line is given beside it (KHR_materials_dispersion).
    Abbe(f64),
    /// Sellmeier's formula n² = 1 + Σ B λ²/(λ² − C), λ and √C in µm.
    Sellmeier {
        /// B, without unit.
        b: [f64; 4],
        /// C in µm².
        c: [f64; 4],
    },
    /// Cauchy's formula n = A + B/λ².
    Cauchy {
        /// A, without unit.
        a: f64,
        /// B in µm².
        b: f64,
    },
}

impl Dispersion {
    /// Index at a wavelength in nm, at least 1; `n_d` is the index at the d line.
    #[must_use]
    pub fn index(&self, n_d: f64, nm: f64) -> f64 {
        match self {
            Self::None => n_d,
            // KHR_materials_dispersion: Cauchy's formula with n = n_d at the d line and n_F − n_C = (n_d − 1)/V_d.
            Self::Abbe(d) => (n_d + (n_d - 1.0) * d / 20.0 * (523_655.0 / (nm * nm) - 1.5168)).max(1.0),
            Self::Sellmeier { b, c } => sellmeier(nm * 1e-3, b, c)[0].max(1.0),
            Self::Cauchy { a, b } => cauchy(nm * 1e-3, *a, *b).max(1.0),
        }
    }

    /// Whether the index differs between 400 and 700 nm.
    #[must_use]
    pub fn disperses(&self, n_d: f64) -> bool {
        self.index(n_d, 400.0) != self.index(n_d, 700.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn khronos_formula_has_its_abbe_number() {
        let (n_d, v_d) = (1.5168, 64.17);
        let medium = Dispersion::Abbe(20.0 / v_d);
        let [d, f, c] = [FRAUNHOFER_D, 486.13, 656.27].map(|nm| medium.index(n_d, nm));
        // The extension rounds its constants, so V_d is correct to a per mille.
        assert!(
            (d - n_d).abs() < 1e-4 && ((d - 1.0) / (f - c) / v_d - 1.0).abs() < 2e-3,
            "{d} {}",
            (d - 1.0) / (f - c)
        );
        assert!(!Dispersion::Abbe(0.0).disperses(1.5) && !medium.disperses(1.0) && medium.disperses(1.5));
        assert!(!Dispersion::None.disperses(1.5));
    }

    #[test]
    fn no_index_falls_below_that_of_empty_space() {
        assert_eq!(Dispersion::Abbe(200.0).index(1.1, 780.0), 1.0);
        assert_eq!(Dispersion::Cauchy { a: 0.5, b: 0.0 }.index(1.5, 500.0), 1.0);
    }
}
