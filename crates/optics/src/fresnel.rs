//! Fresnel reflectance of smooth surfaces, dielectrics and conductors (lecture F2, F3).
//!
//! Read Born & Wolf, Principles of Optics, 1.5.2 and 14.2; pbrt 9.3. n is n_transmitted / n_incident.

use super::catalogue::{Axis, Case, Equation, Output, Region, SplitMix64, flag};

/// @eq F2: reflectance at normal incidence.
#[must_use]
pub fn normal_reflectance(n: f64, kappa: f64) -> f64 {
    ((n - 1.0).powi(2) + kappa * kappa) / ((n + 1.0).powi(2) + kappa * kappa)
}

/// @eq F2: Schlick's curve between two reflectances.
#[must_use]
pub fn schlick(f0: f64, f90: f64, cos_in: f64) -> f64 {
    f0 + (f90 - f0) * (1.0 - cos_in).max(0.0).powi(5)
}

/// @eq F2: Schlick's approximation: F0, F.
#[must_use]
pub fn fresnel_schlick(cos_in: f64, n: f64, kappa: f64) -> [f64; 2] {
    let f0 = normal_reflectance(n, kappa);
    // A cosine that was rounded to more than 1 counts as 1.
    [f0, schlick(f0, 1.0, cos_in)]
}

/// (n cosθ_t)²; products of f32 are exact in f64, so only the sum rounds.
fn refracted_square(cos_in: f64, n: f64) -> f64 {
    // This order leaves the small difference for last.
    let (c2, n2) = (cos_in * cos_in, n * n);
    if n2 > c2 { (n2 - 1.0) + c2 } else { (c2 - 1.0) + n2 }
}

/// @eq F3: exact reflectance of a dielectric: F, r_s, r_p, cosθ_t, total reflection.
#[must_use]
pub fn fresnel_dielectric(cos_in: f64, n: f64) -> [f64; 5] {
    let cos2_t = refracted_square(cos_in, n) / (n * n);
    if n < 1.0 && cos2_t <= 0.0 {
        return [1.0, 1.0, 1.0, 0.0, 1.0];
    }
    let cos_t = cos2_t.max(0.0).sqrt();
    if cos_in == 0.0 {
        return [1.0, -1.0, -1.0, cos_t, 0.0];
    }
    let rs = (cos_in - n * cos_t) / (cos_in + n * cos_t);
    let rp = (n * cos_in - cos_t) / (n * cos_in + cos_t);
    [0.5 * (rs * rs + rp * rp), rs, rp, cos_t, 0.0]
}

/// @eq F3: transmitted power by polarisation and in the mean: the ratio of the refracted beam's to the incident one's.
#[must_use]
pub fn dielectric_transmitted(cos_in: f64, n: f64) -> [f64; 3] {
    let cos2_t = refracted_square(cos_in, n) / (n * n);
    if cos_in == 0.0 || cos2_t <= 0.0 {
        return [0.0; 3];
    }
    let cos_t = cos2_t.sqrt();
    let beam = n * cos_t / cos_in;
    let ts = 2.0 * cos_in / (cos_in + n * cos_t);
    let tp = 2.0 * cos_in / (n * cos_in + cos_t);
    [beam * ts * ts, beam * tp * tp, 0.5 * beam * (ts * ts + tp * tp)]
}

/// @eq F2: reflectance at normal incidence between two media.
#[must_use]
pub fn nested_f0(n1: f64, n2: f64) -> f64 {
    ((n2 - n1) / (n2 + n1)).powi(2)
}

/// A complex number.
type Complex = [f64; 2];

fn mul([a, b]: Complex, [c, d]: Complex) -> Complex {
    [a * c - b * d, a * d + b * c]
}

fn div([a, b]: Complex, [c, d]: Complex) -> Complex {
    let size = c * c + d * d;
    [(a * c + b * d) / size, (b * c - a * d) / size]
}

fn root([re, im]: Complex) -> Complex {
    let size = re.hypot(im);
    // The larger part first; the other follows from 2pq = im.
    if re >= 0.0 {
        let p = (0.5 * (size + re)).sqrt();
        [p, if p > 0.0 { 0.5 * im / p } else { 0.0 }]
    } else {
        let q = (0.5 * (size - re)).sqrt();
        [0.5 * im / q, q]
    }
}

/// Amplitudes r_s and r_p of a conductor, and g = √(m² − sin²θ).
fn conductor(cos_in: f64, n: f64, kappa: f64) -> (Complex, Complex, Complex) {
    let m2 = [n * n - kappa * kappa, 2.0 * n * kappa];
    let g = root([refracted_square(cos_in, n) - kappa * kappa, m2[1]]);
    let m2c = mul(m2, [cos_in, 0.0]);
    let rs = div([cos_in - g[0], -g[1]], [cos_in + g[0], g[1]]);
    let rp = div([m2c[0] - g[0], m2c[1] - g[1]], [m2c[0] + g[0], m2c[1] + g[1]]);
    (rs, rp, g)
}

/// @eq F3 F8: exact reflectance of a conductor: F, R_s, R_p.
#[must_use]
pub fn fresnel_conductor(cos_in: f64, n: f64, kappa: f64) -> [f64; 3] {
    if cos_in == 0.0 {
        return [1.0; 3];
    }
    let (rs, rp, _) = conductor(cos_in, n, kappa);
    let (s, p) = (rs[0].powi(2) + rs[1].powi(2), rp[0].powi(2) + rp[1].powi(2));
    [0.5 * (s + p), s, p]
}

/// @eq F3: what a conductor keeps: A_s, A_p, A, as the flux that enters it: Re g |t_s|²/c with t_s = 1 + r_s, and
/// Re(g/m²) |1 + r_p|²/c for the magnetic amplitude.
#[must_use]
pub fn conductor_absorbed(cos_in: f64, n: f64, kappa: f64) -> [f64; 3] {
    if cos_in == 0.0 {
        return [0.0; 3];
    }
    let m2 = [n * n - kappa * kappa, 2.0 * n * kappa];
    let (_, _, g) = conductor(cos_in, n, kappa);
    let ts = div([2.0 * cos_in, 0.0], [cos_in + g[0], g[1]]);
    let m2c = mul(m2, [cos_in, 0.0]);
    let tp = div([2.0 * m2c[0], 2.0 * m2c[1]], [m2c[0] + g[0], m2c[1] + g[1]]);
    let s = g[0] * (ts[0].powi(2) + ts[1].powi(2)) / cos_in;
    let p = div(g, m2)[0] * (tp[0].powi(2) + tp[1].powi(2)) / cos_in;
    [s, p, 0.5 * (s + p)]
}

/// A cosine: uniform, grazing, near normal incidence, or a special value.
fn cosine(d: &mut SplitMix64) -> f64 {
    match d.below(8) {
        0..4 => d.unit(),
        4..6 => d.log(1e-8, 1.0),
        6 => 1.0 - d.log(1e-7, 0.1),
        _ => f64::from(d.near(&[1.0, 0.5, 0.25, 1e-8]).clamp(0.0, 1.0)),
    }
}

fn log_index(d: &mut SplitMix64) -> f64 {
    match d.below(8) {
        0 => f64::from(d.near(&[1.0, 1.2, 1.333, 1.5, 2.42, 0.5, 1.0 / 1.5])),
        1..3 => d.between(1.0, 3.0),
        _ => d.log(0.05, 20.0),
    }
}

const NEAR_ONE: Region = Region {
    name: "n → 1",
    share: 3,
    draw: |d| {
        let offset = d.sign() * d.log(6e-8, 0.1);
        vec![cosine(d) as f32, (1.0 + offset) as f32]
    },
};

const CRITICAL: Region = Region {
    name: "near the critical angle",
    share: 3,
    draw: |d| {
        let n = (if d.below(3) == 0 { 1.0 - d.log(1e-6, 0.5) } else { d.between(0.05, 0.999) }) as f32;
        let c = (1.0 - f64::from(n).powi(2)).sqrt() * (1.0 + d.sign() * d.log(1e-8, 0.1));
        vec![c.min(1.0) as f32, n]
    },
};

const ANYWHERE: Region =
    Region { name: "0.05 < n < 20", share: 4, draw: |d| vec![cosine(d) as f32, log_index(d) as f32] };

/// Cosines whose squares are outside the range of f32, half of the cases for n = 1.
const FAR_GRAZING: Region = Region {
    name: "cosines to 1e-37, n = 1",
    share: 1,
    draw: |d| {
        let n = if d.below(2) == 0 { 1.0 } else { log_index(d) };
        vec![d.log(2e-38, 1e-8) as f32, n as f32]
    },
};

/// Rounding error of g² = c² + n² − 1: cancelling terms are summed to 2^-32 in the stable tier, and the terms
/// themselves to 2^-46 in the compensated one.
fn rounding_of_g2(case: &Case<'_>) -> f64 {
    let (c, n) = (case.inputs[0], case.inputs[1]);
    let terms = c.min(n).powi(2) + (1.0 - c.max(n)).powi(2);
    case.tiered(2_f64.powi(-32) * terms, 2_f64.powi(-46) * c.max(n).max(1.0).powi(2))
}

/// Absolute error of g that results from [`rounding_of_g2`].
fn error_of_g(case: &Case<'_>) -> f64 {
    let (c, n) = (case.inputs[0], case.inputs[1]);
    let rounding = rounding_of_g2(case);
    let g2 = refracted_square(c, n);
    (g2 + rounding).max(0.0).sqrt() - (g2 - rounding).max(0.0).sqrt()
}

/// Bound near Brewster's angle, where r_p is a small difference: 12 ulp of its terms. The compensated tier sums
/// exactly.
fn brewster(case: &Case<'_>) -> f64 {
    let (c, n) = (case.inputs[0], case.inputs[1]);
    let g = refracted_square(c, n).max(0.0).sqrt();
    let part = (n - 1.0).abs() * (n + 1.0) / (n * n * c + g).powi(2);
    let terms = if n < 1.0 { n.powi(4) } else { 1_f64.max(c * c * (n * n + 1.0)) };
    case.tiered(if part.is_finite() { 12.0 * super::ulp(part * terms) } else { 0.0 }, 0.0)
}

/// Error of r_s and r_p that results from g: |dr_s/dg| = 2c/(c + g)², |dr_p/dg| = 2n²c/(n²c + g)².
fn through_g(case: &Case<'_>) -> [f64; 2] {
    let (c, n) = (case.inputs[0], case.inputs[1]);
    let g = refracted_square(c, n).max(0.0).sqrt();
    let slope = |c: f64| if c > 0.0 { 2.0 * c / (c + g).powi(2) } else { 0.0 };
    [slope(c), slope(n * n * c)].map(|slope| slope * error_of_g(case))
}

const SCHLICK_BOUND: &str = "8 ulp, and 5 of F0 where F90 is less";

fn schlick_allowed(case: &Case<'_>) -> f64 {
    let (f0, f90) = (case.inputs[case.column], case.inputs[3]);
    case.ulps(8.0) + if f90 < f0 { 5.0 * super::ulp(f0) } else { 0.0 }
}

/// The equations of this file.
pub(super) const EQUATIONS: &[Equation] = &[
    Equation {
        name: "schlick",
        twin: |x| (0..3).map(|k| schlick(x[k], x[3], x[4])).collect(),
        regions: &[
            Region {
                name: "metals and dielectrics",
                share: 2,
                draw: |d| {
                    let f0 = [0; 3].map(|_| if d.below(2) == 0 { d.unit() } else { d.log(1e-6, 1.0) } as f32);
                    [&f0[..], &[1.0, cosine(d) as f32]].concat()
                },
            },
            Region {
                name: "any F90",
                share: 1,
                draw: |d| {
                    let f = [0; 4].map(|_| d.unit() as f32);
                    [&f[..], &[cosine(d) as f32]].concat()
                },
            },
        ],
        outputs: &[
            Output { name: "Fx", bound: SCHLICK_BOUND, allowed: schlick_allowed },
            Output { name: "Fy", bound: "as Fx", allowed: schlick_allowed },
            Output { name: "Fz", bound: "as Fx", allowed: schlick_allowed },
        ],
        axis: Axis { name: "1 − cosθ", log: true, of: |x| 1.0 - x[4], column: 0, relative: true },
        extreme: 1e37,
    },
    Equation {
        name: "normal_reflectance",
        twin: |x| vec![normal_reflectance(x[0], x[1])],
        regions: &[
            Region { name: "metals", share: 2, draw: |d| vec![log_index(d) as f32, d.log(1e-6, 1e9) as f32] },
            Region {
                name: "n → 1",
                share: 1,
                draw: |d| vec![(1.0 + d.sign() * d.log(6e-8, 0.1)) as f32, d.log(1e-8, 1e-2) as f32],
            },
        ],
        outputs: &[Output { name: "F0", bound: "8 ulp", allowed: |c| c.ulps(8.0) }],
        axis: Axis { name: "κ", log: true, of: |x| x[1], column: 0, relative: true },
        // Only indices of metals in files are that large.
        extreme: -1.0,
    },
    Equation {
        name: "fresnel_schlick",
        twin: |x| fresnel_schlick(x[0], x[1], x[2]).to_vec(),
        regions: &[
            Region { name: "dielectrics", share: 2, draw: |d| vec![cosine(d) as f32, log_index(d) as f32, 0.0] },
            Region {
                name: "metals",
                share: 2,
                draw: |d| vec![cosine(d) as f32, log_index(d) as f32, d.log(1e-6, 1e9) as f32],
            },
            Region {
                name: "n → 1",
                share: 1,
                draw: |d| {
                    let n = 1.0 + d.sign() * d.log(6e-8, 0.1);
                    vec![cosine(d) as f32, n as f32, if d.below(2) == 0 { 0.0 } else { d.log(1e-8, 1e-2) as f32 }]
                },
            },
        ],
        outputs: &[
            Output { name: "F0", bound: "8 ulp", allowed: |c| c.ulps(8.0) },
            Output { name: "F", bound: "8 ulp", allowed: |c| c.ulps(8.0) },
        ],
        axis: Axis { name: "1 − cosθ", log: true, of: |x| 1.0 - x[0], column: 1, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "fresnel_dielectric",
        twin: |x| fresnel_dielectric(x[0], x[1]).to_vec(),
        regions: &[ANYWHERE, NEAR_ONE, CRITICAL, FAR_GRAZING],
        outputs: &[
            Output {
                name: "F",
                bound: "12 ulp + |r_s| δr_s + |r_p| δr_p",
                allowed: |c| {
                    let [s, p] = through_g(c);
                    c.ulps(12.0) + c.exact[1].abs() * s + c.exact[2].abs() * (p + brewster(c)) + p * p
                },
            },
            Output { name: "rs", bound: "12 ulp + δg", allowed: |c| c.ulps(12.0) + through_g(c)[0] },
            Output {
                name: "rp",
                bound: "12 ulp + δg; stable: ulp of |n² − 1| max(1, c²(n² + 1))/(n²c + g)², the size of what cancels at Brewster",
                allowed: |c| c.ulps(12.0).max(brewster(c)) + through_g(c)[1],
            },
            Output { name: "cos_t", bound: "4 ulp + δg", allowed: |c| c.ulps(4.0) + error_of_g(c) / c.inputs[1] },
            Output {
                name: "tir",
                bound: "exact where |g²| exceeds its rounding",
                allowed: |c| flag(error_of_g(c).powi(2) >= refracted_square(c.inputs[0], c.inputs[1]).abs()),
            },
        ],
        axis: Axis {
            name: "distance of cos²θ from the critical one, relative (n < 1)",
            log: true,
            of: |x| if x[1] < 1.0 { refracted_square(x[0], x[1]) / (1.0 - x[1] * x[1]) } else { f64::NAN },
            column: 0,
            relative: true,
        },
        extreme: 1e38,
    },
    Equation {
        name: "dielectric_transmitted",
        twin: |x| dielectric_transmitted(x[0], x[1]).to_vec(),
        regions: &[ANYWHERE, NEAR_ONE, CRITICAL, FAR_GRAZING],
        outputs: &[
            Output { name: "Ts", bound: "8 ulp + δg", allowed: |c| c.ulps(8.0) + 2.0 * through_g(c)[0] },
            Output { name: "Tp", bound: "8 ulp + δg", allowed: |c| c.ulps(8.0) + 2.0 * through_g(c)[1] },
            Output { name: "T", bound: "10 ulp + δg", allowed: |c| c.ulps(10.0) + through_g(c)[0] + through_g(c)[1] },
        ],
        axis: Axis { name: "cosθ", log: true, of: |x| x[0], column: 2, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "nested_f0",
        twin: |x| vec![nested_f0(x[0], x[1])],
        regions: &[
            Region {
                name: "glasses",
                share: 1,
                draw: |d| vec![d.between(1.0, 3.0) as f32, d.between(1.0, 3.0) as f32],
            },
            Region {
                name: "nearly equal",
                share: 1,
                draw: |d| {
                    let n = d.between(1.0, 3.0);
                    vec![n as f32, (n * (1.0 + d.sign() * d.log(1e-7, 0.1))) as f32]
                },
            },
        ],
        outputs: &[Output { name: "F0", bound: "4 ulp", allowed: |c| c.ulps(4.0) }],
        axis: Axis { name: "|n2/n1 − 1|", log: true, of: |x| (x[1] / x[0] - 1.0).abs(), column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "fresnel_conductor",
        twin: |x| fresnel_conductor(x[0], x[1], x[2]).to_vec(),
        regions: CONDUCTORS,
        outputs: &[
            Output {
                name: "F",
                bound: "8 ulp for κ > max(n, 1/2), else 12 ulp + half of what R_p adds + δg",
                allowed: |c| {
                    c.ulps(if is_metal(c.inputs) { 8.0 } else { 12.0 })
                        + conductor_slack(c)
                        + 0.5 * conductor_brewster(c)
                },
            },
            Output {
                name: "Rs",
                bound: "8 ulp for κ > max(n, 1/2), else 12 ulp + δg",
                allowed: |c| c.ulps(if is_metal(c.inputs) { 8.0 } else { 12.0 }) + conductor_slack(c),
            },
            Output {
                name: "Rp",
                bound: "9 ulp for κ > max(n, 1/2), else 12 ulp + δg + 2 |r_p| δ + δ², δ of what cancels at Brewster",
                allowed: |c| {
                    c.ulps(if is_metal(c.inputs) { 9.0 } else { 12.0 }) + conductor_slack(c) + conductor_brewster(c)
                },
            },
        ],
        axis: Axis { name: "κ", log: true, of: |x| x[2], column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "conductor_absorbed",
        twin: |x| conductor_absorbed(x[0], x[1], x[2]).to_vec(),
        regions: &[METALS],
        outputs: &[
            Output { name: "As", bound: "8 ulp", allowed: |c| c.ulps(8.0) },
            Output { name: "Ap", bound: "9 ulp", allowed: |c| c.ulps(9.0) },
            Output { name: "A", bound: "8 ulp", allowed: |c| c.ulps(8.0) },
        ],
        axis: Axis { name: "cosθ", log: true, of: |x| x[0], column: 2, relative: true },
        extreme: 1e38,
    },
];

const METALS: Region = Region {
    name: "metals",
    share: 3,
    draw: |d| vec![cosine(d) as f32, d.log(0.03, 8.0) as f32, d.log(1.0, 10.0) as f32],
};

const CONDUCTORS: &[Region] = &[
    METALS,
    Region {
        name: "κ → 0",
        share: 2,
        draw: |d| {
            let k = if d.below(4) == 0 { 0.0 } else { d.log(1e-9, 1.0) };
            vec![cosine(d) as f32, log_index(d) as f32, k as f32]
        },
    },
    Region {
        name: "n → 1 and κ → 0",
        share: 2,
        draw: |d| {
            let n = 1.0 + d.sign() * d.log(6e-8, 0.1);
            vec![cosine(d) as f32, n as f32, d.log(1e-9, 0.1) as f32]
        },
    },
    Region {
        name: "cosines to 1e-37, n = 1 and κ = 0",
        share: 1,
        draw: |d| {
            let nothing = d.below(2) == 0;
            let (n, k) = if nothing { (1.0, 0.0) } else { (log_index(d), d.log(1e-3, 1e3)) };
            vec![d.log(2e-38, 1e-8) as f32, n as f32, k as f32]
        },
    },
    Region {
        name: "large κ",
        share: 1,
        draw: |d| vec![cosine(d) as f32, d.log(0.05, 20.0) as f32, d.log(10.0, 1e9) as f32],
    },
];

fn is_metal(x: &[f64]) -> bool {
    x[2] > x[1].max(0.5)
}

/// Error of F and R_s that results from g near the critical angle of a nearly transparent conductor: twice the change
/// of an amplitude, at most 2c/|c + g|² and 2|m²|c/|m²c + g|² per unit of g.
fn conductor_slack(case: &Case<'_>) -> f64 {
    let (c, n, k) = (case.inputs[0], case.inputs[1], case.inputs[2]);
    if is_metal(case.inputs) || c == 0.0 {
        return 0.0;
    }
    let (_, _, g) = conductor(c, n, k);
    let size = g[0].powi(2) + g[1].powi(2);
    let terms = c.min(n).powi(2) + (1.0 - c.max(n)).powi(2);
    let rounding =
        case.tiered(2_f64.powi(-32) * terms, 2_f64.powi(-46) * c.max(n).max(1.0).powi(2)) + 2_f64.powi(-24) * k * k;
    let error = (size + rounding).sqrt() - (size - rounding).max(0.0).sqrt();
    let m2 = [n * n - k * k, 2.0 * n * k];
    let s = (c + g[0]).powi(2) + g[1].powi(2);
    let p = (m2[0] * c + g[0]).powi(2) + (m2[1] * c + g[1]).powi(2);
    2.0 * error * (2.0 * c / s).max(2.0 * m2[0].hypot(m2[1]) * c / p)
}

/// Rounding error of R_p near Brewster's angle, where r_p = (m² − 1)(c²(m² + 1) − 1)/(m²c + g)² is a small difference:
/// 2|r_p|δ
/// + δ² with δ an eighth of 12 ulp of the terms. Pairs of floats sum the terms, so the remaining error is that of a
///   small R_p.
fn conductor_brewster(case: &Case<'_>) -> f64 {
    let (c, n, k) = (case.inputs[0], case.inputs[1], case.inputs[2]);
    if is_metal(case.inputs) || c == 0.0 {
        return 0.0;
    }
    let m2 = [n * n - k * k, 2.0 * n * k];
    let (_, _, g) = conductor(c, n, k);
    let p = (m2[0] * c + g[0]).powi(2) + (m2[1] * c + g[1]).powi(2);
    let terms = 1_f64.max(c * c * (n * n + k * k + 1.0));
    let delta = 12.0 * 2_f64.powi(-26) * (m2[0] - 1.0).hypot(m2[1]) / p * terms;
    2.0 * case.exact[2].sqrt() * delta + delta * delta
}
