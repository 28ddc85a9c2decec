//! Spectral upsampling: reflectance spectra for RGB colours (knob `upsampling`).
//!
//! Read Jakob and Hanika, "A Low-Dimensional Function Space for Efficient Spectral Upsampling", Eurographics 2019 (a
//! fitted sigmoid); Mallett and Yuksel, "Spectral Primary Decomposition for Rendering with sRGB Reflectance", EGSR 2019
//! (a sum of three curves, which needs no fit). Colours are linear Rec. 709 in [0, 1] under D65.

use std::sync::LazyLock;

use rayon::prelude::*;

use super::{Band, Spectrum, VISIBLE, d65, matching, rgb_from_xyz};
use crate::colour::{SAMPLES, upsampled_reflectance, wavelength};

/// Method of spectral upsampling.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Upsampling {
    /// A sum of three curves that sum to 1 (assets/spectra/rgb_basis.csv).
    MallettYuksel,
    /// A sigmoid of a fitted parabola: smoother than a sum of three curves, like measured reflectances.
    JakobHanika,
}

impl Upsampling {
    /// Reflectance spectrum of a linear Rec. 709 colour under D65; the colour is clamped to [0, 1].
    #[must_use]
    pub fn reflectance(self, rgb: [f64; 3]) -> Spectrum {
        let rgb = rgb.map(|x| x.clamp(0.0, 1.0));
        match self {
            Self::MallettYuksel => Spectrum::Basis(rgb),
            // Grey: a constant spectrum, without a fit.
            Self::JakobHanika if rgb[0] == rgb[1] && rgb[1] == rgb[2] => Spectrum::Constant(rgb[0]),
            Self::JakobHanika => Spectrum::Sigmoid(fit(rgb)),
        }
    }
}

/// Weights, in steps of 5 nm, that give X, Y, Z of a reflectance under D65 with Y = 1.
static WEIGHTS: LazyLock<[[f64; 3]; SAMPLES]> = LazyLock::new(|| {
    let d65 = d65();
    let mut weights = [[0.0; 3]; SAMPLES];
    // Each step's weight goes to the samples on both sides.
    let steps = 800;
    for i in 0..steps {
        let nm = VISIBLE.part(i, steps).middle();
        let at = (nm - VISIBLE.from) / 5.0;
        let (first, share) = (at as usize, at.fract());
        for (k, cmf) in matching(nm).into_iter().enumerate() {
            let power = d65.at(nm) * cmf;
            weights[first][k] += (1.0 - share) * power;
            weights[first + 1][k] += share * power;
        }
    }
    let white: f64 = weights.iter().map(|w| w[1]).sum();
    weights.map(|w| w.map(|x| x / white))
});

/// λ = 580 + 200 u nm: in u the coefficients of the parabola have similar magnitudes.
const MIDDLE: f64 = 580.0;
const REACH: f64 = 200.0;

/// Smallest and largest fitted value: the sigmoid reaches 0 and 1 only at infinity.
const ENDS: [f64; 2] = [1e-5, 1.0 - 1e-5];

/// Coefficients of λ², λ and 1, by the Levenberg-Marquardt method on differences in L*a*b*.
fn fit(rgb: [f64; 3]) -> [f64; 3] {
    let rgb = rgb.map(|x| x.clamp(ENDS[0], ENDS[1]));
    let wanted = lab(xyz_of_rgb(rgb));
    // Start with the grey of the same luminance.
    let grey = (0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]).clamp(0.01, 0.99);
    let mut c = [0.0, 0.0, (grey - 0.5) / (grey * (1.0 - grey)).sqrt()];
    let mut damping = 1e-3;
    let (mut error, mut system) = residual(c, wanted);
    for _ in 0..60 {
        if size(error) < 1e-8 || damping > 1e9 {
            break;
        }
        let step = solve(system, error, damping);
        let next = [0, 1, 2].map(|i| c[i] - step[i]);
        let (next_error, next_system) = residual(next, wanted);
        if size(next_error) < size(error) {
            (c, error, system) = (next, next_error, next_system);
            damping = (damping * 0.3).max(1e-9);
        } else {
            damping *= 4.0;
        }
    }
    // Coefficients of a u² + b u + c, converted from u to λ.
    let [a, b, c] = c;
    let (a, b, c) = (a / (REACH * REACH), b / REACH, c);
    [a, b - 2.0 * a * MIDDLE, a * MIDDLE * MIDDLE - b * MIDDLE + c]
}

fn size(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum()
}

/// X, Y, Z of a linear Rec. 709 colour.
fn xyz_of_rgb(rgb: [f64; 3]) -> [f64; 3] {
    static XYZ_FROM_RGB: LazyLock<glam::DMat3> = LazyLock::new(|| {
        let columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(rgb_from_xyz);
        glam::DMat3::from_cols_array_2d(&columns).inverse()
    });
    (*XYZ_FROM_RGB * glam::DVec3::from(rgb)).to_array()
}

/// L*a*b* relative to D65 (CIE 15).
fn lab(xyz: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = lab_terms(xyz).map(|(f, _)| f);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// For X, Y and Z over the white's: the cube root with its linear part near 0, and the derivative.
fn lab_terms(xyz: [f64; 3]) -> [(f64, f64); 3] {
    static WHITE: LazyLock<[f64; 3]> = LazyLock::new(|| xyz_of_rgb([1.0; 3]));
    const START: f64 = 6.0 / 29.0;
    [0, 1, 2].map(|k| {
        let t = xyz[k] / WHITE[k];
        let (f, slope) = match t > START.powi(3) {
            true => (t.cbrt(), 1.0 / (3.0 * t.cbrt().powi(2))),
            false => (t / (3.0 * START * START) + 4.0 / 29.0, 1.0 / (3.0 * START * START)),
        };
        (f, slope / WHITE[k])
    })
}

/// L*a*b* of the reflectance minus the target, and the rows of the Jacobian by the coefficients.
fn residual(c: [f64; 3], wanted: [f64; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
    let mut xyz = [0.0; 3];
    let mut by = [[0.0; 3]; 3];
    for (sample, weights) in WEIGHTS.iter().enumerate() {
        let u = (wavelength(sample) - MIDDLE) / REACH;
        let x = (c[0] * u + c[1]) * u + c[2];
        let root = (1.0 + x * x).sqrt();
        let (s, slope) = (0.5 + x / (2.0 * root), 0.5 / (root * root * root));
        for k in 0..3 {
            xyz[k] += weights[k] * s;
            let w = weights[k] * slope;
            by[k][0] += w * u * u;
            by[k][1] += w * u;
            by[k][2] += w;
        }
    }
    let terms = lab_terms(xyz);
    let f = |k: usize, i: usize| terms[k].1 * by[k][i];
    let rows = [
        [0, 1, 2].map(|i| 116.0 * f(1, i)),
        [0, 1, 2].map(|i| 500.0 * (f(0, i) - f(1, i))),
        [0, 1, 2].map(|i| 200.0 * (f(1, i) - f(2, i))),
    ];
    let got = lab(xyz);
    ([0, 1, 2].map(|k| got[k] - wanted[k]), rows)
}

/// Step of Levenberg and Marquardt, (JᵀJ + d diag JᵀJ)⁻¹ Jᵀ e.
fn solve(rows: [[f64; 3]; 3], error: [f64; 3], damping: f64) -> [f64; 3] {
    let j = glam::DMat3::from_cols_array_2d(&rows).transpose();
    let mut normal = j.transpose() * j;
    for i in 0..3 {
        let diagonal = normal.col(i)[i];
        normal.col_mut(i)[i] = diagonal * (1.0 + damping) + 1e-12;
    }
    (normal.inverse() * (j.transpose() * glam::DVec3::from(error))).to_array()
}

/// Upsampled reflectances for texture colours, fitted at the corners of a grid over the square roots of red, green and
/// blue.
pub struct Grid {
    /// Corners per axis.
    pub side: u32,
    coefficients: Vec<[f64; 3]>,
}

impl Grid {
    /// Corners per axis. The interpolated reflectance is off by at most 0.02, at saturated ends, and by 0.0003 in the
    /// mean of random colours.
    const SIDE: u32 = 32;

    /// The grid with all corners, fitted once per process.
    #[must_use]
    pub fn fitted() -> &'static Self {
        static GRID: LazyLock<Grid> = LazyLock::new(Grid::fit_all);
        &GRID
    }

    fn fit_all() -> Self {
        let side = Self::SIDE;
        let at = |i: u32| (f64::from(i) / f64::from(side - 1)).powi(2);
        let corner = |i: u32| match [i % side, i / side % side, i / side / side] {
            // Grey corners have a closed form: a constant spectrum.
            [r, g, b] if r == g && g == b => {
                let grey = at(r).clamp(1e-13, 1.0 - 1e-13);
                [0.0, 0.0, (grey - 0.5) / (grey * (1.0 - grey)).sqrt()]
            }
            rgb => fit(rgb.map(at)),
        };
        Self { side, coefficients: (0..side.pow(3)).into_par_iter().map(corner).collect() }
    }

    /// Square roots of the means over a band, red fastest.
    #[must_use]
    pub fn roots(&self, band: &Band) -> Vec<f32> {
        // Sigmoids of parabolas are smooth: eight points give the mean.
        const POINTS: u32 = 8;
        let mean = |c: &[f64; 3]| {
            let sum: f64 = (0..POINTS).map(|i| upsampled_reflectance(band.part(i, POINTS).middle(), *c)).sum();
            (sum / f64::from(POINTS)).sqrt() as f32
        };
        self.coefficients.par_iter().map(mean).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn colour_of(spectrum: &Spectrum) -> [f64; 3] {
        spectrum.reflectance_rgb()
    }

    #[test]
    fn colours_come_back() {
        for rgb in
            [[0.5, 0.2, 0.1], [0.1, 0.6, 0.3], [0.02, 0.03, 0.4], [0.8, 0.7, 0.05], [0.3, 0.3, 0.301], [0.9, 0.95, 0.9]]
        {
            for method in [Upsampling::MallettYuksel, Upsampling::JakobHanika] {
                let back = colour_of(&method.reflectance(rgb));
                for k in 0..3 {
                    // The fit treats reflectances as linear over 5 nm.
                    assert!((back[k] - rgb[k]).abs() < 4e-4, "{method:?} {rgb:?}: {back:?}");
                }
            }
        }
    }

    /// Interpolation of shaders/lib/spectrum.glsl.
    fn interpolated(side: u32, roots: &[f32], rgb: [f64; 3]) -> f64 {
        let at = rgb.map(|x| x.sqrt() * f64::from(side - 1));
        let cell = at.map(|x| (x as u32).min(side - 2));
        let mut order = [0, 1, 2].map(|k| (at[k] - f64::from(cell[k]), k));
        order.sort_by(|a, b| b.0.total_cmp(&a.0));
        let value = |[r, g, b]: [u32; 3]| f64::from(roots[((b * side + g) * side + r) as usize]);
        let (mut corner, mut root) = (cell, value(cell));
        for (share, axis) in order {
            let before = value(corner);
            corner[axis] += 1;
            root += (value(corner) - before) * share;
        }
        root * root
    }

    #[test]
    fn the_grid_is_near_the_fit() {
        let grid = Grid::fitted();
        let (mut worst, mut sum, mut count) = (0.0_f64, 0.0, 0);
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / (1_u64 << 31) as f64
        };
        let colors: Vec<[f64; 3]> = (0..400).map(|_| [0; 3].map(|_| random().powi(2))).collect();
        for band in [2, 5, 8, 11].map(|i| VISIBLE.part(i, 16)) {
            let roots = grid.roots(&band);
            for &rgb in &colors {
                let fitted = Upsampling::JakobHanika.reflectance(rgb);
                let error = (interpolated(grid.side, &roots, rgb) - band.mean(|nm| fitted.at(nm))).abs();
                (worst, sum, count) = (worst.max(error), sum + error, count + 1);
            }
            for grey in [0.001, 0.02, 0.18, 0.5, 0.97] {
                assert!((interpolated(grid.side, &roots, [grey; 3]) - grey).abs() < 2e-5, "grey {grey}");
            }
        }
        let mean = sum / f64::from(count);
        eprintln!("reflectances between corners: off by {worst:.4} at most, {mean:.5} in the mean");
        assert!(worst < 0.025 && mean < 0.0004, "{worst} {mean}");
    }

    #[test]
    fn the_reflectance_is_the_sigmoid_of_a_polynomial() {
        use crate::colour::spectrum_sigmoid;
        let c = fit([0.8, 0.3, 0.1]);
        for nm in [400.0, 550.0, 700.0] {
            let x = (c[0] * nm + c[1]) * nm + c[2];
            assert!((upsampled_reflectance(nm, c) - spectrum_sigmoid(x)).abs() < 1e-12);
        }
    }

    #[test]
    fn reflectances_stay_within_0_and_1() {
        for i in 0..27 {
            let rgb = [i % 3, i / 3 % 3, i / 9].map(|x| f64::from(x) * 0.5);
            for method in [Upsampling::MallettYuksel, Upsampling::JakobHanika] {
                let spectrum = method.reflectance(rgb);
                for nm in 380..=780 {
                    let value = spectrum.at(f64::from(nm));
                    assert!((-1e-8..=1.0 + 1e-8).contains(&value), "{method:?} {rgb:?} at {nm}: {value}");
                }
            }
        }
    }
}
