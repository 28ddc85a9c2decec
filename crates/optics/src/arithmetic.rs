//! Twins of shaders/lib/arithmetic.glsl: error-free transformations, double-float arithmetic and elementary functions,
//! in f64.
//!
//! Read Knuth, TAOCP volume 2, 4.2.2 (two-sum), and docs/numerics.md. Arguments are values of f32. Domains, and results
//! outside them, are those of the shader.

use glam::DVec3;

use super::catalogue::{Axis, EXACT, Equation, Output, Region, SplitMix64, columns, ulp, vector};

/// hi + lo = `value` + `rest`, with hi a value of f32; lo is 0 when hi is outside the range of f32.
fn pair(value: f64, rest: f64) -> [f64; 2] {
    let hi = f64::from(value as f32);
    [hi, if hi.is_finite() { (value - hi) + rest } else { 0.0 }]
}

/// a + b = s + rest exactly (Knuth).
fn exact_sum(a: f64, b: f64) -> [f64; 2] {
    let s = a + b;
    let b_in_s = s - a;
    [s, (a - (s - b_in_s)) + (b - b_in_s)]
}

/// @eq N11 N25 N30: hi = the f32 nearest to a + b, lo = the exact rest
#[must_use]
pub fn two_sum(a: f64, b: f64) -> [f64; 2] {
    let [s, rest] = exact_sum(a, b);
    pair(s, rest)
}

/// @eq N11 N25 N30: hi = the f32 nearest to a + b, lo = the exact rest
#[must_use]
pub fn quick_two_sum(a: f64, b: f64) -> [f64; 2] {
    two_sum(a, b)
}

/// @eq N11 N25 N28: hi = the f32 nearest to a·b, lo = the exact rest; a product of two f32 is an f64
#[must_use]
pub fn two_product(a: f64, b: f64) -> [f64; 2] {
    pair(a * b, 0.0)
}

/// @eq N11: (a_hi + a_lo) + (b_hi + b_lo)
#[must_use]
pub fn df_add(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    let [hi, hi_rest] = exact_sum(a[0], b[0]);
    let [lo, lo_rest] = exact_sum(a[1], b[1]);
    let [s, rest] = exact_sum(hi, lo);
    pair(s, rest + (hi_rest + lo_rest))
}

/// @eq N11: −a
#[must_use]
pub fn df_negate(a: [f64; 2]) -> [f64; 2] {
    a.map(|part| -part)
}

/// @eq N11: a·s, s a power of two
#[must_use]
pub fn df_scale(a: [f64; 2], s: f64) -> [f64; 2] {
    a.map(|part| part * s)
}

/// @eq N11: (a_hi + a_lo)(b_hi + b_lo)
#[must_use]
pub fn df_mul(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    let [s, rest] = exact_sum(a[0] * b[0], a[0] * b[1] + a[1] * b[0]);
    pair(s, rest + a[1] * b[1])
}

/// @eq N11: (a_hi + a_lo)/(b_hi + b_lo); 0/0 is 0
#[must_use]
pub fn df_div(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    if a[0] == 0.0 { [0.0; 2] } else { pair((a[0] + a[1]) / (b[0] + b[1]), 0.0) }
}

/// @eq N11: √(a_hi + a_lo); 0 for a ≤ 0
#[must_use]
pub fn df_sqrt(a: [f64; 2]) -> [f64; 2] {
    pair((a[0] + a[1]).max(0.0).sqrt(), 0.0)
}

/// @eq N11 N25: a·b; each product is exact, and so are the sums' rests
#[must_use]
pub fn dot2(a: DVec3, b: DVec3) -> [f64; 2] {
    let [s, s_rest] = exact_sum(a.x * b.x, a.y * b.y);
    let [t, t_rest] = exact_sum(s, a.z * b.z);
    pair(t, s_rest + t_rest)
}

/// @eq N28: e^(x + lo)
#[must_use]
pub fn exp_pair(x: f64, lo: f64) -> f64 {
    (x + lo).exp()
}

/// @eq N27: e^x − 1
#[must_use]
pub fn expm1f(x: f64) -> f64 {
    x.exp_m1()
}

/// @eq N17 N44: ln x as a pair; -∞ for x ≤ 0
#[must_use]
pub fn df_log(x: f64) -> [f64; 2] {
    pair(if x <= 0.0 { f64::NEG_INFINITY } else { x.ln() }, 0.0)
}

/// @eq N17 N44: x^y; that of 0 for x ≤ 0
#[must_use]
pub fn powf(x: f64, y: f64) -> f64 {
    if x <= 0.0 { 0.0_f64.powf(y) } else { x.powf(y) }
}

/// @eq N10: the angle of (x, y) from +x; 0 for (0, 0)
#[must_use]
pub fn atan2f(y: f64, x: f64) -> f64 {
    if x == 0.0 && y == 0.0 { 0.0 } else { y.atan2(x) }
}

/// Two numbers of moderate size, or a pair that nearly cancels.
fn pair_of_numbers(d: &mut SplitMix64) -> Vec<f32> {
    let a = (d.sign() * d.log(1e-6, 1e6)) as f32;
    let b = if d.below(2) == 0 { d.near(&[a, -a]) } else { (d.sign() * d.log(1e-6, 1e6)) as f32 };
    vec![a, b]
}

fn double(d: &mut SplitMix64) -> [f32; 2] {
    let exact = d.sign() * d.log(1e-3, 1e3);
    let hi = exact as f32;
    [hi, (exact - f64::from(hi)) as f32]
}

fn positive_double(d: &mut SplitMix64) -> [f32; 2] {
    let [hi, lo] = double(d);
    if hi < 0.0 { [-hi, -lo] } else { [hi, lo] }
}

const PAIRS: &[Region] = &[Region { name: "numbers, half of them nearly equal", share: 1, draw: pair_of_numbers }];

const DOUBLES: &[Region] = &[Region {
    name: "pairs of double-floats, a fifth nearly cancelling",
    share: 1,
    draw: |d| {
        let a = double(d);
        let b = if d.below(5) == 0 { [-a[0].next_up(), a[1]] } else { double(d) };
        [a, b].concat()
    },
}];

/// Bounds of hi and lo of an error-free operation.
const EXACT_PAIR: &[Output] =
    &[Output { name: "hi", bound: "exact", allowed: EXACT }, Output { name: "lo", bound: "exact", allowed: EXACT }];

/// hi is the rounded sum. The exact lo depends on hi, so both are tested as a sum (crates/verify/tests/equations.rs).
const ROUNDED_PAIR: &[Output] = &[
    Output { name: "hi", bound: "1 ulp", allowed: |c| c.ulps(1.0) },
    Output { name: "lo", bound: "1.5 ulp of hi", allowed: |c| 1.5 * ulp(c.exact[0]) },
];

const SIZE_OF_SUM: Axis = Axis { name: "|a + b|", log: true, of: |x| (x[0] + x[1]).abs(), column: 0, relative: true };
const SIZE: Axis = Axis { name: "|x|", log: true, of: |x| x[0].abs(), column: 0, relative: true };

/// The equations of this file.
pub(super) const EQUATIONS: &[Equation] = &[
    Equation {
        name: "two_sum",
        twin: |x| two_sum(x[0], x[1]).to_vec(),
        regions: PAIRS,
        outputs: EXACT_PAIR,
        axis: SIZE_OF_SUM,
        extreme: 1e37,
    },
    Equation {
        name: "quick_two_sum",
        twin: |x| quick_two_sum(x[0], x[1]).to_vec(),
        regions: &[Region {
            name: "the larger first",
            share: 1,
            draw: |d| {
                let pair = pair_of_numbers(d);
                if pair[0].abs() >= pair[1].abs() { pair } else { vec![pair[1], pair[0]] }
            },
        }],
        outputs: EXACT_PAIR,
        axis: SIZE_OF_SUM,
        extreme: 1e37,
    },
    Equation {
        name: "two_product",
        twin: |x| two_product(x[0], x[1]).to_vec(),
        regions: PAIRS,
        outputs: EXACT_PAIR,
        axis: SIZE,
        extreme: 1e17,
    },
    Equation {
        name: "df_add",
        twin: |x| df_add([x[0], x[1]], [x[2], x[3]]).to_vec(),
        regions: DOUBLES,
        outputs: ROUNDED_PAIR,
        axis: Axis { name: "|a + b|", log: true, of: |x| (x[0] + x[2]).abs(), column: 0, relative: true },
        extreme: 1e17,
    },
    Equation {
        name: "df_mul",
        twin: |x| df_mul([x[0], x[1]], [x[2], x[3]]).to_vec(),
        regions: DOUBLES,
        outputs: ROUNDED_PAIR,
        axis: SIZE,
        extreme: 1e17,
    },
    Equation {
        name: "df_div",
        twin: |x| df_div([x[0], x[1]], [x[2], x[3]]).to_vec(),
        regions: DOUBLES,
        outputs: ROUNDED_PAIR,
        axis: SIZE,
        extreme: 0.0,
    },
    Equation {
        name: "df_sqrt",
        twin: |x| df_sqrt([x[0], x[1]]).to_vec(),
        regions: &[Region { name: "positive", share: 1, draw: |d| positive_double(d).to_vec() }],
        outputs: ROUNDED_PAIR,
        axis: SIZE,
        extreme: 1e17,
    },
    Equation {
        name: "dot2",
        twin: |x| dot2(vector(x, 0), vector(x, 3)).to_vec(),
        regions: &[
            Region { name: "directions", share: 1, draw: |d| columns(&[d.direction(), d.direction()]) },
            Region {
                name: "nearly perpendicular",
                share: 1,
                draw: |d| {
                    let n = d.direction();
                    let angle = std::f64::consts::FRAC_PI_2 - d.log(1e-8, 0.1);
                    let l = d.at_angle(n, angle);
                    columns(&[n, l])
                },
            },
        ],
        outputs: &[
            Output {
                name: "hi",
                bound: "1 ulp + 2^-45 Σ|a b|",
                allowed: |c| {
                    let terms: f64 = (0..3).map(|k| (c.inputs[k] * c.inputs[k + 3]).abs()).sum();
                    c.ulps(1.0) + 2_f64.powi(-45) * terms
                },
            },
            Output {
                name: "lo",
                bound: "1.5 ulp of hi + 2^-45 Σ|a b|",
                allowed: |c| {
                    let terms: f64 = (0..3).map(|k| (c.inputs[k] * c.inputs[k + 3]).abs()).sum();
                    1.5 * ulp(c.exact[0]) + 2_f64.powi(-45) * terms
                },
            },
        ],
        axis: Axis {
            name: "|a·b|",
            log: true,
            of: |x| vector(x, 0).dot(vector(x, 3)).abs(),
            column: 0,
            relative: true,
        },
        extreme: 1e17,
    },
    Equation {
        name: "exp_pair",
        twin: |x| vec![exp_pair(x[0], x[1])],
        regions: &[
            Region {
                name: "all of f32's range",
                share: 2,
                draw: |d| {
                    let x = d.between(-87.3, 88.7) as f32;
                    vec![x, (d.between(-0.5, 0.5) * ulp(f64::from(x))) as f32]
                },
            },
            Region { name: "small", share: 1, draw: |d| vec![(d.sign() * d.log(1e-8, 1.0)) as f32, 0.0] },
        ],
        outputs: &[Output { name: "y", bound: "1.25 ulp", allowed: |c| c.ulps(1.25) }],
        axis: SIZE,
        extreme: 1e38,
    },
    Equation {
        name: "expm1f",
        twin: |x| vec![expm1f(x[0])],
        regions: &[
            Region { name: "all of f32's range", share: 1, draw: |d| vec![d.between(-87.3, 88.7) as f32] },
            Region { name: "small", share: 2, draw: |d| vec![(d.sign() * d.log(1e-20, 2.0)) as f32] },
        ],
        outputs: &[Output { name: "y", bound: "2 ulp", allowed: |c| c.ulps(2.0) }],
        axis: SIZE,
        extreme: 1e38,
    },
    Equation {
        name: "df_log",
        twin: |x| df_log(x[0]).to_vec(),
        regions: &[
            Region { name: "all normal numbers", share: 1, draw: |d| vec![d.log(1.2e-38, 3e38) as f32] },
            Region { name: "near 1", share: 2, draw: |d| vec![(1.0 + d.sign() * d.log(6e-8, 0.5)) as f32] },
        ],
        outputs: &[
            Output { name: "hi", bound: "1 ulp", allowed: |c| c.ulps(1.0) },
            Output { name: "lo", bound: "1.1 ulp of hi", allowed: |c| 1.1 * ulp(c.exact[0]) },
        ],
        axis: Axis { name: "|x − 1|", log: true, of: |x| (x[0] - 1.0).abs(), column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "powf",
        twin: |x| vec![powf(x[0], x[1])],
        regions: &[
            Region {
                name: "|y log2 x| < 120",
                share: 2,
                draw: |d| {
                    let x = d.log(1e-30, 1e30) as f32;
                    let reach = 120.0 / f64::from(x).log2().abs().max(1e-3);
                    vec![x, (d.sign() * d.log(1e-3, 1.0) * reach) as f32]
                },
            },
            Region {
                name: "x → 1, y to 1e7",
                share: 2,
                draw: |d| {
                    let y = d.log(1.0, 1e7);
                    let x = 1.0 - d.log(6e-8, 1.0).min(80.0 / y);
                    vec![x as f32, y as f32]
                },
            },
        ],
        outputs: &[Output { name: "z", bound: "4 ulp", allowed: |c| c.ulps(4.0) }],
        axis: Axis { name: "|y|", log: true, of: |x| x[1].abs(), column: 0, relative: true },
        extreme: 1e38,
    },
    Equation {
        name: "atan2f",
        twin: |x| vec![atan2f(x[0], x[1])],
        regions: &[Region {
            name: "every quadrant",
            share: 1,
            draw: |d| vec![(d.sign() * d.log(1e-9, 1e9)) as f32, (d.sign() * d.log(1e-9, 1e9)) as f32],
        }],
        outputs: &[Output { name: "angle", bound: "3 ulp", allowed: |c| c.ulps(3.0) }],
        axis: Axis { name: "|y/x|", log: true, of: |x| (x[0] / x[1]).abs(), column: 0, relative: true },
        extreme: 1e38,
    },
];
