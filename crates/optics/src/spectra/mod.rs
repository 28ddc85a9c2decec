//! Spectra for spectral rendering (lecture C1–C3, F1, F8): bands of wavelengths, light sources, metals, and RGB
//! conversions.
//!
//! Read pbrt 4.5 and 4.6; docs/decisions/spectra.md. A spectral picture is rendered band by band. In a band each
//! reflectance, transmittance and index is one number, its mean over the band. Light is the tristimulus X, Y, Z of its
//! emission in the band: spectrum and colour matching functions are multiplied before averaging, so that no spectral
//! line is lost, wherever in the band it lies. The film is the sum over the bands.

mod dispersion;
mod upsampling;

pub use dispersion::{Dispersion, FRAUNHOFER_D};
pub use upsampling::{Grid, Upsampling};

use std::sync::{Arc, LazyLock};

use crate::colour::{CIE_1931_2DEG, SAMPLES, XYZ_TO_SRGB, blackbody, upsampled_reflectance, wavelength};

/// Observer of all tristimulus values.
pub const OBSERVER: &str = "CIE 1931 2°";

/// Range of wavelengths of pictures, nm (lecture R7).
pub const VISIBLE: Band = Band { from: 380.0, to: 780.0 };

/// Largest integration step in nm: the data are linear over ten steps.
const STEP: f64 = 0.5;

/// Narrowest line in nm that integration preserves: exactly in whole bands, to a thousandth in parts of bands.
const NARROWEST: f64 = 0.05;

/// An interval of wavelengths in nm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Band {
    /// Shortest wavelength.
    pub from: f64,
    /// Longest wavelength.
    pub to: f64,
}

impl Band {
    /// Part `index` of `count` equal parts.
    #[must_use]
    pub fn part(&self, index: u32, count: u32) -> Self {
        let at = |i: u32| self.from + (self.to - self.from) * f64::from(i) / f64::from(count);
        Self { from: at(index), to: at(index + 1) }
    }

    /// Middle wavelength.
    #[must_use]
    pub fn middle(&self) -> f64 {
        0.5 * (self.from + self.to)
    }

    /// Mean of a function of the wavelength over the band.
    pub fn mean(&self, f: impl Fn(f64) -> f64) -> f64 {
        self.mean_of(|nm| [f(nm)])[0]
    }

    fn mean_of<const N: usize>(&self, f: impl Fn(f64) -> [f64; N]) -> [f64; N] {
        self.mean_by(STEP, f)
    }

    fn mean_by<const N: usize>(&self, step: f64, f: impl Fn(f64) -> [f64; N]) -> [f64; N] {
        let steps = ((self.to - self.from) / step).ceil().max(1.0) as u32;
        let mut sum = [0.0; N];
        for i in 0..steps {
            let values = f(self.part(i, steps).middle());
            sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        }
        sum.map(|sum| sum / f64::from(steps))
    }
}

/// A spectrum: a function of the wavelength.
#[derive(Debug, Clone, PartialEq)]
pub enum Spectrum {
    /// The same value at all wavelengths.
    Constant(f64),
    /// Rows of wavelength in nm and value, ascending: linear interpolation, constant outside.
    Table(Arc<[[f64; 2]]>),
    /// Black-body radiance by Planck's law, for a temperature in kelvin.
    BlackBody(f64),
    /// CIE illuminant A.
    IlluminantA,
    /// A weighted sum of the three reflectance curves of assets/spectra/rgb_basis.csv.
    Basis([f64; 3]),
    /// Jakob and Hanika's sigmoid of c0 λ² + c1 λ + c2.
    Sigmoid([f64; 3]),
}

impl Spectrum {
    /// Value at a wavelength in nm.
    #[must_use]
    pub fn at(&self, nm: f64) -> f64 {
        match self {
            Self::Constant(value) => *value,
            Self::Table(rows) => {
                let next = rows.partition_point(|row| row[0] <= nm);
                match (next.checked_sub(1).map(|last| rows[last]), rows.get(next)) {
                    (Some([a, from]), Some([b, to])) => from + (to - from) * (nm - a) / (b - a),
                    (Some([_, value]), None) | (None, Some(&[_, value])) => value,
                    (None, None) => 0.0,
                }
            }
            Self::BlackBody(kelvin) => blackbody(nm * 1e-3, *kelvin),
            // c2 / T = 1.435e7 nm K / 2848 K, as CIE 15 defines it; 100 at 560 nm.
            Self::IlluminantA => {
                let x = |nm: f64| (1.435e7 / (2848.0 * nm)).exp_m1();
                100.0 * (560.0 / nm).powi(5) * x(560.0) / x(nm)
            }
            Self::Basis(rgb) => {
                let basis = basis(nm);
                (0..3).map(|i| rgb[i] * basis[i]).sum()
            }
            Self::Sigmoid(c) => upsampled_reflectance(nm, *c),
        }
    }

    /// ∫ S (x̄, ȳ, z̄) dλ over a band.
    fn integral(&self, band: &Band) -> [f64; 3] {
        let mean = band.mean_by(self.step(), |nm| matching(nm).map(|cmf| self.at(nm) * cmf));
        mean.map(|mean| mean * (band.to - band.from))
    }

    /// Integration step in nm: an eighth of the narrowest interval of a table.
    fn step(&self) -> f64 {
        let Self::Table(rows) = self else { return STEP };
        // Two rows at one wavelength, as at the ends of a light's table, have width 0 and do not count.
        let widths = rows.windows(2).map(|pair| pair[1][0] - pair[0][0]).filter(|&width| width > 1e-3);
        (widths.fold(f64::INFINITY, f64::min) / 8.0).clamp(NARROWEST / 8.0, STEP)
    }

    /// X, Y, Z of light of this spectrum in a band, where Y over all bands is 1.
    #[must_use]
    pub fn light_in(&self, band: &Band) -> [f64; 3] {
        let all = self.integral(&VISIBLE)[1];
        self.integral(band).map(|part| if all > 0.0 { part / all } else { 0.0 })
    }

    /// Linear Rec. 709 colour of light of this spectrum with luminance 1.
    #[must_use]
    pub fn light_rgb(&self) -> [f64; 3] {
        rgb_from_xyz(self.light_in(&VISIBLE))
    }

    /// Linear Rec. 709 colour of a surface of this reflectance under D65.
    #[must_use]
    pub fn reflectance_rgb(&self) -> [f64; 3] {
        let d65 = d65();
        let sum = VISIBLE.mean_of(|nm| matching(nm).map(|cmf| self.at(nm) * d65.at(nm) * cmf));
        rgb_from_xyz(sum.map(|sum| sum * (VISIBLE.to - VISIBLE.from) / d65.integral(&VISIBLE)[1]))
    }

    /// An emission table, 0 outside its range.
    #[must_use]
    pub fn light_table(rows: &[[f64; 2]]) -> Self {
        let (Some(first), Some(last)) = (rows.first(), rows.last()) else { return Self::Constant(0.0) };
        let ends = [[first[0] - 1e-6, 0.0], [last[0] + 1e-6, 0.0]];
        Self::Table([&ends[..1], rows, &ends[1..]].concat().into())
    }

    /// Column `column` of a file in assets/spectra.
    fn column(text: &str, column: usize) -> Self {
        let row = |line: &str| {
            let mut cells = line.split(',').map(|cell| cell.parse().expect("a number"));
            [cells.next().expect("a wavelength"), cells.nth(column).expect("a value")]
        };
        Self::Table(text.lines().skip(1).map(row).collect())
    }
}

/// Emission: a spectrum with an absolute luminance.
#[derive(Debug, Clone, PartialEq)]
pub struct Emission {
    /// Relative spectrum.
    pub spectrum: Spectrum,
    /// Y over all wavelengths, in the unit of the emitted quantity.
    pub luminance: f64,
    /// ∫ S ȳ dλ of the relative spectrum.
    whole: f64,
}

impl Emission {
    /// Emission of a light that has a spectrum and a linear Rec. 709 colour: only the luminance of the colour counts.
    #[must_use]
    pub fn new(spectrum: Spectrum, rgb: [f32; 3]) -> Self {
        let [r, g, b] = rgb.map(f64::from);
        Self::of_luminance(spectrum, 0.2126 * r + 0.7152 * g + 0.0722 * b)
    }

    /// Emission of a spectrum with luminance Y over all wavelengths.
    #[must_use]
    pub fn of_luminance(spectrum: Spectrum, luminance: f64) -> Self {
        let whole = spectrum.integral(&VISIBLE)[1];
        Self { spectrum, luminance, whole }
    }

    /// X, Y, Z of the emission in a band.
    #[must_use]
    pub fn in_band(&self, band: &Band) -> [f64; 3] {
        let scale = if self.whole > 0.0 { self.luminance / self.whole } else { 0.0 };
        self.spectrum.integral(band).map(|part| part * scale)
    }

    /// Linear Rec. 709 colour, clamped to the gamut.
    #[must_use]
    pub fn rgb(&self) -> [f32; 3] {
        self.spectrum.light_rgb().map(|x| (x.max(0.0) * self.luminance) as f32)
    }
}

const ILLUMINANTS: &str = include_str!("../../assets/spectra/illuminants.csv");
const METALS: &str = include_str!("../../assets/spectra/metals.csv");
const CHART: &str = include_str!("../../assets/spectra/chart.csv");

/// Illuminants by the names that files may use: those of the CIE, and `e` with equal power at every wavelength.
pub const LIGHTS: &[&str] = &["a", "d65", "e", "f2", "f11"];

/// CIE illuminant D65 (daylight).
fn d65() -> Spectrum {
    Spectrum::column(ILLUMINANTS, 0)
}

/// The spectrum of an illuminant by name.
#[must_use]
pub fn illuminant(name: &str) -> Option<Spectrum> {
    match name {
        "a" => Some(Spectrum::IlluminantA),
        "e" => Some(Spectrum::Constant(1.0)),
        "d65" => Some(d65()),
        "f2" => Some(Spectrum::column(ILLUMINANTS, 1)),
        "f11" => Some(Spectrum::column(ILLUMINANTS, 2)),
        _ => None,
    }
}

/// n and κ of a metal: gold, silver, copper, aluminium.
#[must_use]
pub fn metal(name: &str) -> Option<[Spectrum; 2]> {
    let index = ["gold", "silver", "copper", "aluminium"].iter().position(|known| *known == name)?;
    Some([0, 1].map(|part| Spectrum::column(METALS, 2 * index + part)))
}

/// Names and reflectances of the patches of a ColorChecker, row by row.
#[must_use]
pub fn chart() -> Vec<(String, Spectrum)> {
    let names = CHART.lines().next().unwrap_or_default().split(',').skip(1);
    names.enumerate().map(|(i, name)| (name.replace('_', " "), Spectrum::column(CHART, i))).collect()
}

/// Linear interpolation in a table of three functions; 0 outside.
fn interpolated(table: &[[f64; 3]; SAMPLES], nm: f64) -> [f64; 3] {
    let at = (nm - wavelength(0)) / (wavelength(1) - wavelength(0));
    let last = (SAMPLES - 1) as f64;
    if !(0.0..=last).contains(&at) {
        return [0.0; 3];
    }
    let first = (at as usize).min(SAMPLES - 2);
    let share = at - first as f64;
    [0, 1, 2].map(|k| table[first][k] + share * (table[first + 1][k] - table[first][k]))
}

/// Colour matching functions x̄, ȳ, z̄ at a wavelength.
fn matching(nm: f64) -> [f64; 3] {
    interpolated(&CIE_1931_2DEG, nm)
}

/// Three reflectances that sum to 1 and are red, green and blue under D65.
fn basis(nm: f64) -> [f64; 3] {
    static BASIS: LazyLock<[[f64; 3]; SAMPLES]> = LazyLock::new(|| {
        let curves = [0, 1, 2].map(|i| Spectrum::column(include_str!("../../assets/spectra/rgb_basis.csv"), i));
        std::array::from_fn(|sample| [0, 1, 2].map(|i| curves[i].at(wavelength(sample))))
    });
    interpolated(&BASIS, nm.clamp(VISIBLE.from, VISIBLE.to))
}

/// Weights of red, green and blue in a band, which convert an additive RGB quantity to one number.
#[must_use]
pub fn shares(band: &Band) -> [f64; 3] {
    band.mean_of(basis)
}

/// Columns: X, Y, Z in a band of red, green and blue linear Rec. 709 light. RGB light is D65 filtered by the three
/// basis reflectances; summed over all bands it has its colour again.
#[must_use]
pub fn light_from_rgb(band: &Band) -> [[f64; 3]; 3] {
    static D65: LazyLock<(Spectrum, f64)> = LazyLock::new(|| {
        let d65 = d65();
        let white = d65.integral(&VISIBLE)[1];
        (d65, white)
    });
    let (d65, white) = &*D65;
    let mean = band.mean_of(|nm| {
        let (power, cmf, basis) = (d65.at(nm), matching(nm), basis(nm));
        std::array::from_fn::<f64, 9, _>(|i| power * basis[i / 3] * cmf[i % 3])
    });
    let scale = (band.to - band.from) / white;
    [0, 1, 2].map(|primary| [0, 1, 2].map(|k| mean[3 * primary + k] * scale))
}

/// Rows: linear Rec. 709 from X, Y, Z by IEC 61966-2-1, each row divided by its value for D65, so that D65 is exactly
/// white: with the standard's four digits it is off by up to 6e-4 for these tables.
pub static RGB_FROM_XYZ: LazyLock<[[f64; 3]; 3]> = LazyLock::new(|| {
    let white = d65().light_in(&VISIBLE);
    XYZ_TO_SRGB.map(|row| {
        let sum: f64 = (0..3).map(|k| row[k] * white[k]).sum();
        row.map(|cell| cell / sum)
    })
});

/// Linear Rec. 709 of X, Y, Z; negative outside the gamut.
#[must_use]
pub fn rgb_from_xyz(xyz: [f64; 3]) -> [f64; 3] {
    RGB_FROM_XYZ.map(|row| (0..3).map(|k| row[k] * xyz[k]).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: [f64; 3], b: [f64; 3], tolerance: f64) -> bool {
        (0..3).all(|k| (a[k] - b[k]).abs() <= tolerance)
    }

    /// Integrals over bands equal those of the equations, which sum over steps of 5 nm.
    #[test]
    fn bands_add_up_to_the_matching_of_the_lecture() {
        use crate::colour::{cmf_gaussian, cmf_integral, planck, xyz_to_srgb};
        let bell = |nm: f64| (-((nm - 560.0) / 60.0).powi(2) / 2.0).exp();
        let steps: Vec<f64> = (0..SAMPLES).map(|i| bell(wavelength(i))).collect();
        let found =
            VISIBLE.mean_of(|nm| matching(nm).map(|f| f * bell(nm))).map(|mean| mean * (VISIBLE.to - VISIBLE.from));
        let [x, y, z, r, g, b, ..] = cmf_integral(&steps);
        assert!(near(found, [x, y, z], 0.05), "{found:?}, not {x} {y} {z}");
        let [x2, y2, z2, ..] = cmf_gaussian(1.0, 560.0, 60.0);
        assert!(near([x, y, z], [x2, y2, z2], 1e-12));
        assert!(
            near(rgb_from_xyz([x, y, z]).map(|c| c / y), xyz_to_srgb([x, y, z]).map(|c| c / y), 1e-3),
            "{r} {g} {b}"
        );
        // A light given by its temperature has Planck's spectrum: compare the ratio of two wavelengths.
        let lamp = Spectrum::BlackBody(2856.0);
        let at = |nm: f64| planck(14_387_768.8 / (nm * 2856.0)) / nm.powi(5);
        assert!((lamp.at(700.0) / lamp.at(450.0) / (at(700.0) / at(450.0)) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn light_given_as_rgb_keeps_its_colour() {
        for bands in [1, 8, 16, 32] {
            let mut sum = [[0.0; 3]; 3];
            for i in 0..bands {
                let of_band = light_from_rgb(&VISIBLE.part(i, bands));
                (0..9).for_each(|k| sum[k / 3][k % 3] += of_band[k / 3][k % 3]);
                assert!(of_band.as_flattened().iter().all(|&x| x >= 0.0), "light is never negative");
            }
            for (i, xyz) in sum.into_iter().enumerate() {
                let wanted = [0, 1, 2].map(|k| f64::from(u8::from(k == i)));
                assert!(near(rgb_from_xyz(xyz), wanted, 1e-6), "{bands}: {:?}", rgb_from_xyz(xyz));
            }
        }
    }

    #[test]
    fn the_basis_is_made_of_reflectances_that_add_up_to_one() {
        for i in 0..=800 {
            let basis = basis(380.0 + 0.5 * f64::from(i));
            assert!(basis.iter().all(|&b| (-1e-12..=1.0 + 1e-12).contains(&b)));
            assert!((basis.iter().sum::<f64>() - 1.0).abs() < 1e-7);
        }
        for part in [VISIBLE, VISIBLE.part(3, 8)] {
            assert!((shares(&part).iter().sum::<f64>() - 1.0).abs() < 1e-7);
        }
    }

    /// Chromaticities of the illuminants, CIE 15.
    #[test]
    fn illuminants_have_their_chromaticities() {
        for (name, x, y) in [
            ("a", 0.44758, 0.40745),
            ("d65", 0.31272, 0.32903),
            ("e", 1.0 / 3.0, 1.0 / 3.0),
            ("f2", 0.37208, 0.37529),
            ("f11", 0.38052, 0.37713),
        ] {
            let [cx, cy, cz] = illuminant(name).unwrap().light_in(&VISIBLE);
            let sum = cx + cy + cz;
            assert!((cx / sum - x).abs() < 3e-4 && (cy / sum - y).abs() < 3e-4, "{name}: {} {}", cx / sum, cy / sum);
        }
        assert!(illuminant("sun").is_none());
        assert!(near(illuminant("d65").unwrap().light_rgb(), [1.0; 3], 1e-12));
    }

    #[test]
    fn bands_add_up_and_lines_are_not_missed() {
        // Spectral lines of various widths.
        for (nm, width) in [(404.7, 0.5), (435.8, 0.05), (546.1, 0.1), (555.0, 1.0), (611.5, 2.0)] {
            let line = Spectrum::light_table(&[[nm - width, 0.0], [nm, 1.0], [nm + width, 0.0]]);
            for bands in [8, 16, 32, 32 * 64] {
                let sum: f64 = (0..bands).map(|i| line.light_in(&VISIBLE.part(i, bands))[1]).sum();
                // Whole bands use the steps of all wavelengths; narrower parts use shorter steps.
                let bound = if bands > 32 { 1e-3 } else { 1e-12 };
                assert!((sum - 1.0).abs() < bound, "{nm} in {bands} bands: {sum}");
            }
        }
    }

    #[test]
    fn metals_have_the_indices_of_the_lamps() {
        // docs/colour.md, section 7: gold at 645.16, 526.32 and 444.44 nm, linear between the wavelengths of the
        // source; this table is linear between those and steps of 5 nm.
        let [n, kappa] = metal("gold").unwrap();
        for (nm, wanted) in [(645.16, [0.1635, 3.5543]), (526.32, [0.5828, 2.1542]), (444.44, [1.4022, 1.9248])] {
            assert!((n.at(nm) - wanted[0]).abs() < 0.01 && (kappa.at(nm) - wanted[1]).abs() < 0.01, "{nm}");
        }
        assert!(metal("lead").is_none());
    }

    #[test]
    fn tables_are_linear_between_and_constant_beyond() {
        let table = Spectrum::Table([[400.0, 1.0], [500.0, 3.0]].into());
        assert_eq!([300.0, 400.0, 450.0, 500.0, 600.0].map(|nm| table.at(nm)), [1.0, 1.0, 2.0, 3.0, 3.0]);
        let light = Spectrum::light_table(&[[400.0, 1.0], [500.0, 3.0]]);
        assert_eq!([300.0, 450.0, 600.0].map(|nm| light.at(nm)), [0.0, 2.0, 0.0]);
        assert_eq!(chart().len(), 24);
    }
}
