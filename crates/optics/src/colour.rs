//! Spectra to colour (lecture C1–C3): colour matching functions, spectral upsampling, Sellmeier and Cauchy dispersion
//! (F1), Planck's law, and the sRGB transfer function (C4).
//!
//! Read pbrt 4.4 to 4.6; IEC 61966-2-1; docs/colour.md. Wavelengths are in nm unless a name ends in `_um`.

use std::sync::LazyLock;

use super::catalogue::{Axis, Case, Equation, Output, Region, SplitMix64};

/// Number of samples of a spectrum: 380, 385, … 780 nm.
pub const SAMPLES: usize = 81;

/// Colour matching functions x̄ ȳ z̄ of CIE 1931, 2°.
pub static CIE_1931_2DEG: LazyLock<[[f64; 3]; SAMPLES]> =
    LazyLock::new(|| table(include_str!("../assets/cmf/cmf_cie1931_2deg_5nm.csv")));

/// Colour matching functions r̄ ḡ b̄ of Stiles & Burch 1959, 10°.
pub static STILES_BURCH_1959_10DEG: LazyLock<[[f64; 3]; SAMPLES]> =
    LazyLock::new(|| table(include_str!("../assets/cmf/cmf_stiles_burch1959_10deg_5nm.csv")));

/// Wavelength of a sample in nm.
#[must_use]
pub fn wavelength(sample: usize) -> f64 {
    380.0 + 5.0 * sample as f64
}

/// Parses rows `nm,a,b,c` as values of f32; 0 outside the range of the file.
fn table(text: &str) -> [[f64; 3]; SAMPLES] {
    let mut all = [[0.0; 3]; SAMPLES];
    for line in text.lines().skip(1) {
        let cells: Vec<f32> = line.split(',').map(|cell| cell.parse().expect("a number")).collect();
        let sample = (cells[0] as usize - 380) / 5;
        all[sample] = [1, 2, 3].map(|column| f64::from(cells[column]));
    }
    all
}

/// Integrals of a spectrum with three functions, as sums of steps of 5 nm.
fn matched(spectrum: &[f64], functions: &[[f64; 3]; SAMPLES]) -> [f64; 3] {
    [0, 1, 2].map(|k| 5.0 * spectrum.iter().zip(functions).map(|(s, f)| s * f[k]).sum::<f64>())
}

/// Sums of absolute values, the scale of the rounding error of [`matched`].
fn magnitude(spectrum: &[f64], functions: &[[f64; 3]; SAMPLES]) -> [f64; 3] {
    [0, 1, 2].map(|k| 5.0 * spectrum.iter().zip(functions).map(|(s, f)| (s * f[k]).abs()).sum::<f64>())
}

/// XYZ to linear sRGB, rows (IEC 61966-2-1, four digits).
pub const XYZ_TO_SRGB: [[f64; 3]; 3] =
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]];

fn times(rows: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    rows.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// |row| · |v| for each row, the scale of the product's rounding error.
fn magnitude_of_product(v: [f64; 3]) -> [f64; 3] {
    times(&XYZ_TO_SRGB.map(|row| row.map(f64::abs)), v.map(f64::abs))
}

/// @eq C2: linear sRGB, white at D65.
#[must_use]
pub fn xyz_to_srgb(xyz: [f64; 3]) -> [f64; 3] {
    times(&XYZ_TO_SRGB, xyz)
}

/// @eq C1 C2: X Y Z, linear sRGB, and the amounts of the three lamps of Stiles & Burch for a spectrum.
#[must_use]
pub fn cmf_integral(spectrum: &[f64]) -> [f64; 9] {
    let [x, y, z] = matched(spectrum, &CIE_1931_2DEG);
    let [r, g, b] = xyz_to_srgb([x, y, z]);
    let [r10, g10, b10] = matched(spectrum, &STILES_BURCH_1959_10DEG);
    [x, y, z, r, g, b, r10, g10, b10]
}

/// Samples of the Gaussian A e^(−((λ − μ)/w)²/2).
fn gaussian(a: f64, mu: f64, width: f64) -> Vec<f64> {
    (0..SAMPLES).map(|i| a * (-((wavelength(i) - mu) / width).powi(2) / 2.0).exp()).collect()
}

/// @eq C1 C2: X Y Z and the amounts of the three lamps for a spectrum in the shape of a bell.
#[must_use]
pub fn cmf_gaussian(a: f64, mu: f64, width: f64) -> [f64; 6] {
    let spectrum = gaussian(a, mu, width);
    let [x, y, z] = matched(&spectrum, &CIE_1931_2DEG);
    let [r10, g10, b10] = matched(&spectrum, &STILES_BURCH_1959_10DEG);
    [x, y, z, r10, g10, b10]
}

/// @eq C3: Jakob and Hanika's sigmoid. For x < 0 as 1 − S(−x), without the difference.
#[must_use]
pub fn spectrum_sigmoid(x: f64) -> f64 {
    // S = sin²(π/4 + atan(x)/2), and atan(x) = −π/2 + atan(1/|x|) for x < 0.
    if x < 0.0 { (0.5 * (1.0 / -x).atan()).sin().powi(2) } else { 0.5 + x / (2.0 * (1.0 + x * x).sqrt()) }
}

/// @eq C3: reflectance of three coefficients at λ in nm (Jakob and Hanika 2019, equation 2).
#[must_use]
pub fn upsampled_reflectance(lambda: f64, c: [f64; 3]) -> f64 {
    spectrum_sigmoid(c[0] * lambda * lambda + c[1] * lambda + c[2])
}

/// @eq F1: n and n − 1 by Sellmeier's formula, λ in µm.
#[must_use]
pub fn sellmeier(lambda_um: f64, b: &[f64], c: &[f64]) -> [f64; 2] {
    let l2 = lambda_um * lambda_um;
    let t: f64 = b.iter().zip(c).map(|(b, c)| b * l2 / (l2 - c)).sum();
    let n = (1.0 + t).sqrt();
    [n, t / (n + 1.0)]
}

/// @eq F1: n by Cauchy's formula, λ in µm.
#[must_use]
pub fn cauchy(lambda_um: f64, a: f64, b: f64) -> f64 {
    a + b / (lambda_um * lambda_um)
}

/// @eq N48: the number of quanta in a mode of black-body radiation, x = hc/(λkT).
#[must_use]
pub fn planck(x: f64) -> f64 {
    1.0 / x.exp_m1()
}

const PLANCK: f64 = 6.62607015e-34;
const LIGHT: f64 = 299_792_458.0;
const BOLTZMANN: f64 = 1.380649e-23;

/// x = hc/(λkT) of Planck's law, with λ in µm and T in K.
fn quantum(lambda_um: f64, t: f64) -> f64 {
    PLANCK * LIGHT / (lambda_um * 1e-6 * BOLTZMANN * t)
}

/// @eq N48: black-body radiance in W/(m² sr µm), λ in µm, T in K; constants of the SI of 2019.
#[must_use]
pub fn blackbody(lambda_um: f64, t: f64) -> f64 {
    let lambda = lambda_um * 1e-6;
    1e-6 * 2.0 * PLANCK * LIGHT * LIGHT / lambda.powi(5) * planck(quantum(lambda_um, t))
}

/// @eq C4: sRGB's transfer function and its inverse (IEC 61966-2-1); negative is 0.
#[must_use]
pub fn srgb(x: f64) -> [f64; 2] {
    let x = x.max(0.0);
    let encode = if x <= 0.0031308 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    let decode = if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) };
    [encode, decode]
}

/// @eq C4: sRGB's transfer function alone.
#[must_use]
pub fn srgb_encode(x: f64) -> f64 {
    srgb(x)[0]
}

const SRGB: &[Region] = &[
    Region { name: "display light", share: 3, draw: |d| vec![d.between(0.0, 1.0) as f32] },
    Region { name: "dark", share: 2, draw: |d| vec![d.log(1e-9, 1.0) as f32] },
    Region {
        name: "thresholds and ends",
        share: 1,
        draw: |d| vec![d.near(&[0.003_130_8, 0.04045, 0.5, 1.0]).max(0.0)],
    },
    Region { name: "bytes", share: 1, draw: |d| vec![srgb(d.below(256) as f64 / 255.0)[1] as f32] },
    Region { name: "above 1", share: 1, draw: |d| vec![d.log(1.0, 65504.0) as f32] },
];

fn encode_allowed(case: &Case<'_>) -> f64 {
    if case.inputs[0] <= 1.0 { case.ulps(8.0).min(2.5e-7) } else { case.ulps(8.0) }
}

/// Bound of a sum, row 50 of docs/numerics.md: 81 roundings of the sum of magnitudes.
const SUM: f64 = 81.0 * 5.960464477539063e-8;

/// Outputs X Y Z sR sG sB r10 g10 b10.
fn integral_allowed(case: &Case<'_>) -> f64 {
    let spectrum = case.inputs;
    let xyz = || magnitude(spectrum, &CIE_1931_2DEG);
    let part = match case.column {
        k @ 0..3 => xyz()[k],
        k @ 3..6 => magnitude_of_product(xyz())[k - 3],
        k => magnitude(spectrum, &STILES_BURCH_1959_10DEG)[k - 6],
    };
    SUM * part
}

/// Outputs X Y Z r10 g10 b10. Samples below the range of f32 may be flushed to 0.
fn gaussian_allowed(case: &Case<'_>) -> f64 {
    let [a, mu, width] = [case.inputs[0], case.inputs[1], case.inputs[2]];
    let functions = if case.column < 3 { &CIE_1931_2DEG } else { &STILES_BURCH_1959_10DEG };
    let lost = f64::from(f32::MIN_POSITIVE) * (1.0 + a.abs());
    SUM * magnitude(&gaussian(a, mu, width), functions)[case.column % 3]
        + magnitude(&[lost; SAMPLES], functions)[case.column % 3]
}

/// Bound: the rounding error of the polynomial, 3 units of 2^-24 of the magnitudes of its terms, times the slope of the
/// sigmoid, plus 5 ulp. The compensated tier has the 5 ulp alone.
fn upsampled_allowed(case: &Case<'_>) -> f64 {
    let [lambda, c0, c1, c2] = [case.inputs[0], case.inputs[1], case.inputs[2], case.inputs[3]];
    let x = (c0 * lambda + c1) * lambda + c2;
    let terms = (c0 * lambda * lambda).abs() + (c1 * lambda).abs() + c2.abs();
    let error = 3.0 * 2_f64.powi(-24) * terms;
    // The slope decreases away from 0; this is its largest value within the error.
    let nearest = (x.abs() - error).max(0.0);
    let slope = 0.5 * nearest.mul_add(nearest, 1.0).powf(-1.5);
    case.tiered(error * slope, 0.0) + case.ulps(5.0)
}

/// A random mixture of two lines, a Gaussian and noise of either sign.
fn spectrum(d: &mut SplitMix64) -> Vec<f32> {
    let scale = d.log(1e-3, 1e6);
    let (mu, width) = (d.between(380.0, 780.0), d.log(2.0, 200.0));
    let (bell, noise, line) = (d.below(2) as f64, d.below(2) as f64 * d.log(1e-3, 1.0), d.below(3));
    let mut all: Vec<f32> =
        gaussian(bell, mu, width).into_iter().map(|s| (scale * (s + noise * d.between(-1.0, 1.0))) as f32).collect();
    for _ in 0..line {
        all[d.below(SAMPLES)] = scale as f32;
    }
    all
}

/// Coefficients of x = a u² + b u + c, u = (λ − 580)/200, in the range of fitted reflectances.
fn coefficients(d: &mut SplitMix64) -> Vec<f32> {
    let size = d.log(0.1, 300.0);
    let [a, b, c] = [0; 3].map(|_| size * d.between(-1.0, 1.0));
    let (s, m) = (1.0 / 200.0, 580.0 / 200.0);
    let lambda = d.between(380.0, 780.0);
    vec![lambda as f32, (a * s * s) as f32, (s * (b - 2.0 * a * m)) as f32, (a * m * m - b * m + c) as f32]
}

/// Sellmeier coefficients B and C of N-BK7, SF10, water and diamond, from docs/colour.md.
const MEDIA: [[f64; 8]; 4] = [
    [1.03961212, 0.231792344, 1.01046945, 0.0, 0.00600069867, 0.0200179144, 103.560653, 0.0],
    [1.61625977, 0.259229334, 1.07762317, 0.0, 0.0127534559, 0.0581983954, 116.60768, 0.0],
    [
        0.5684027565,
        0.1726177391,
        0.02086189578,
        0.1130748688,
        0.005101829712,
        0.01821153936,
        0.02620722293,
        10.69792721,
    ],
    [0.3306, 4.3356, 0.0, 0.0, 0.030625, 0.011236, 0.0, 0.0],
];

/// The equations of this file.
pub(super) const EQUATIONS: &[Equation] = &[
    Equation {
        name: "xyz_to_srgb",
        twin: |x| xyz_to_srgb([x[0], x[1], x[2]]).to_vec(),
        regions: &[Region {
            name: "colours of either sign",
            share: 1,
            draw: |d| [0; 3].map(|_| (d.sign() * d.log(1e-6, 1e6)) as f32).to_vec(),
        }],
        outputs: &[
            Output { name: "sR", bound: "4·2^-24 Σ|m||x|", allowed: product_allowed },
            Output { name: "sG", bound: "as sR", allowed: product_allowed },
            Output { name: "sB", bound: "as sR", allowed: product_allowed },
        ],
        axis: Axis { name: "Y/X", log: true, of: |x| (x[1] / x[0]).abs(), column: 0, relative: true },
        extreme: 5e37,
    },
    Equation {
        name: "cmf_integral",
        twin: |x| cmf_integral(x).to_vec(),
        regions: &[Region { name: "bells, noise, lines", share: 1, draw: spectrum }],
        outputs: &[
            Output { name: "X", bound: "81·2^-24 of the sum of magnitudes", allowed: integral_allowed },
            Output { name: "Y", bound: "as X", allowed: integral_allowed },
            Output { name: "Z", bound: "as X", allowed: integral_allowed },
            Output { name: "sR", bound: "as X, through |matrix|", allowed: integral_allowed },
            Output { name: "sG", bound: "as sR", allowed: integral_allowed },
            Output { name: "sB", bound: "as sR", allowed: integral_allowed },
            Output { name: "r10", bound: "as X", allowed: integral_allowed },
            Output { name: "g10", bound: "as X", allowed: integral_allowed },
            Output { name: "b10", bound: "as X", allowed: integral_allowed },
        ],
        axis: Axis {
            name: "largest sample",
            log: true,
            of: |x| x.iter().copied().fold(0.0, f64::max),
            column: 1,
            relative: true,
        },
        extreme: 1e34,
    },
    Equation {
        name: "cmf_gaussian",
        twin: |x| cmf_gaussian(x[0], x[1], x[2]).to_vec(),
        regions: &[
            Region {
                name: "bands",
                share: 3,
                draw: |d| vec![d.log(1e-3, 1e5) as f32, d.between(300.0, 900.0) as f32, d.log(1.0, 200.0) as f32],
            },
            Region {
                name: "lines",
                share: 1,
                draw: |d| vec![d.log(1e-3, 1e5) as f32, d.between(380.0, 780.0) as f32, d.log(0.2, 5.0) as f32],
            },
        ],
        outputs: &[
            Output { name: "X", bound: "81·2^-24 of the sum of magnitudes", allowed: gaussian_allowed },
            Output { name: "Y", bound: "as X", allowed: gaussian_allowed },
            Output { name: "Z", bound: "as X", allowed: gaussian_allowed },
            Output { name: "r10", bound: "as X", allowed: gaussian_allowed },
            Output { name: "g10", bound: "as X", allowed: gaussian_allowed },
            Output { name: "b10", bound: "as X", allowed: gaussian_allowed },
        ],
        axis: Axis { name: "width, nm", log: true, of: |x| x[2], column: 1, relative: true },
        extreme: 1e34,
    },
    Equation {
        name: "spectrum_sigmoid",
        twin: |x| vec![spectrum_sigmoid(x[0])],
        regions: &[
            Region { name: "either sign", share: 1, draw: |d| vec![(d.sign() * d.log(1e-3, 1e3)) as f32] },
            Region { name: "far below 0", share: 1, draw: |d| vec![-d.log(1.0, 1e17) as f32] },
        ],
        outputs: &[Output { name: "S", bound: "4 ulp", allowed: |c| c.ulps(4.0) }],
        axis: Axis { name: "−x", log: true, of: |x| -x[0], column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "upsampled_reflectance",
        twin: |x| vec![upsampled_reflectance(x[0], [x[1], x[2], x[3]])],
        regions: &[Region { name: "fitted", share: 1, draw: coefficients }],
        outputs: &[Output {
            name: "rho",
            bound: "3·2^-24 Σ|c λ^k| dS/dx + 5 ulp; compensated 5 ulp",
            allowed: upsampled_allowed,
        }],
        axis: Axis {
            name: "ρ",
            log: true,
            of: |x| upsampled_reflectance(x[0], [x[1], x[2], x[3]]),
            column: 0,
            relative: true,
        },
        extreme: 1e38,
    },
    Equation {
        name: "sellmeier",
        twin: |x| sellmeier(x[0], &x[1..5], &x[5..9]).to_vec(),
        regions: &[
            Region {
                name: "glasses, water, diamond",
                share: 1,
                draw: |d| {
                    let mut all = vec![d.between(0.36, 0.83) as f32];
                    all.extend(MEDIA[d.below(4)].map(|x| x as f32));
                    all
                },
            },
            Region {
                name: "weak",
                share: 1,
                draw: |d| {
                    let [b, c] = [d.log(1e-7, 1e-1), d.log(1e-4, 0.02)].map(|x| x as f32);
                    vec![d.between(0.36, 0.83) as f32, b, 0.0, 0.0, 0.0, c, 0.0, 0.0, 0.0]
                },
            },
        ],
        outputs: &[
            Output { name: "n", bound: "2 ulp", allowed: |c| c.ulps(2.0) },
            Output { name: "n_minus_1", bound: "4 ulp", allowed: |c| c.ulps(4.0) },
        ],
        axis: Axis {
            name: "n − 1",
            log: true,
            of: |x| sellmeier(x[0], &x[1..5], &x[5..9])[1],
            column: 1,
            relative: true,
        },
        extreme: 1e38,
    },
    Equation {
        name: "cauchy",
        twin: |x| vec![cauchy(x[0], x[1], x[2])],
        regions: &[Region {
            name: "glasses",
            share: 1,
            draw: |d| vec![d.between(0.36, 0.83) as f32, d.between(1.3, 2.4) as f32, d.log(1e-4, 0.05) as f32],
        }],
        outputs: &[Output { name: "n", bound: "2 ulp", allowed: |c| c.ulps(2.0) }],
        axis: Axis { name: "B, µm²", log: true, of: |x| x[2], column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "planck",
        twin: |x| vec![planck(x[0])],
        regions: &[
            Region { name: "every x", share: 1, draw: |d| vec![d.log(1e-30, 88.0) as f32] },
            Region { name: "about 1 and above", share: 1, draw: |d| vec![d.between(0.5, 88.0) as f32] },
        ],
        outputs: &[Output { name: "y", bound: "4 ulp", allowed: |c| c.ulps(4.0) }],
        axis: Axis { name: "x", log: true, of: |x| x[0], column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "blackbody",
        twin: |x| vec![blackbody(x[0], x[1])],
        regions: &[
            Region {
                name: "lamps and stars in visible light",
                share: 2,
                draw: |d| vec![d.between(0.36, 0.83) as f32, d.log(500.0, 5e4) as f32],
            },
            Region {
                name: "every temperature and wavelength",
                share: 1,
                draw: |d| {
                    let (lambda, x) = (d.log(1e-2, 1e3), d.log(1e-4, 87.0));
                    vec![lambda as f32, (14387.77 / (x * lambda)) as f32]
                },
            },
        ],
        outputs: &[Output {
            name: "L",
            bound: "6 ulp, where hc/(λkT) < 87",
            // Beyond, the value is below 1e-38 of 2hc²/λ⁵.
            allowed: |c| if quantum(c.inputs[0], c.inputs[1]) < 87.0 { c.ulps(6.0) } else { c.x() },
        }],
        axis: Axis { name: "hc/(λkT)", log: true, of: |x| quantum(x[0], x[1]), column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "srgb_encode",
        twin: |x| vec![srgb_encode(x[0])],
        regions: SRGB,
        outputs: &[Output { name: "encode", bound: "8 ulp, and 2.5e-7 up to 1", allowed: encode_allowed }],
        axis: Axis { name: "x", log: true, of: |x| x[0], column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "srgb",
        twin: |x| srgb(x[0]).to_vec(),
        regions: SRGB,
        outputs: &[
            Output { name: "encode", bound: "8 ulp, and 2.5e-7 up to 1", allowed: encode_allowed },
            Output { name: "decode", bound: "8 ulp", allowed: |c| c.ulps(8.0) },
        ],
        axis: Axis { name: "x", log: true, of: |x| x[0], column: 0, relative: true },
        extreme: 1e38,
    },
];

fn product_allowed(case: &Case<'_>) -> f64 {
    let xyz = [case.inputs[0], case.inputs[1], case.inputs[2]];
    4.0 * 2_f64.powi(-24) * magnitude_of_product(xyz)[case.column]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lamps_match_themselves_and_all_three_have_negative_lobes() {
        let table = &*STILES_BURCH_1959_10DEG;
        let at = |nm: usize| table[(nm - 380) / 5];
        let near = |got: [f64; 3], want: [f64; 3]| (0..3).all(|k| (got[k] - want[k]).abs() < 0.02);
        assert!(near(at(645), [1.0, 0.0, 0.0]) && near(at(445), [0.0, 0.0, 1.0]));
        let (low, high) = (at(525), at(530));
        let between = [0, 1, 2].map(|k| low[k] + (high[k] - low[k]) * 1.32 / 5.0);
        assert!(near(between, [0.0, 1.0, 0.0]), "{between:?}");
        for k in 0..3 {
            assert!(table.iter().any(|row| row[k] < -0.009));
        }
    }

    #[test]
    fn colour_is_linear_in_the_spectrum() {
        let (a, b) = (gaussian(2.0, 500.0, 20.0), gaussian(1.0, 600.0, 60.0));
        let sum: Vec<f64> = a.iter().zip(&b).map(|(a, b)| 3.0 * a + b).collect();
        let (a, b, sum) = (cmf_integral(&a), cmf_integral(&b), cmf_integral(&sum));
        for k in 0..9 {
            assert!((3.0 * a[k] + b[k] - sum[k]).abs() < 1e-10);
        }
        assert!(a[6] < 0.0, "500 nm is matched only with red on its own side");
    }

    /// Values of refractiveindex.info at 587.6 nm, from docs/colour.md.
    #[test]
    fn media_have_their_published_indices() {
        for (medium, n) in MEDIA.iter().zip([1.516798, 1.728245, 1.333402, 2.417481]) {
            assert!((sellmeier(0.5876, &medium[..4], &medium[4..])[0] - n).abs() < 1e-5);
        }
    }
}
