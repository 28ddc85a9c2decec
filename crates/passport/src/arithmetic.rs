//! Built-in functions and operations of GLSL on a device: their errors beside what Vulkan allows, and what becomes of
//! products that are added, of denormal numbers and of NaN.
//!
//! Read the Vulkan specification, appendix Precision and Operation of SPIR-V Instructions.

use std::f64::consts::PI;
use std::sync::Arc;

use anyhow::Result;
use ash::vk;
use etalon::gpu::{Buffer, Device, Frame, Image, ImageDesc, Place, Sampled, SamplerDesc};
use etalon::optics::{SplitMix64, ulp};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::json::short;
use crate::shader::{builtin, filter};

/// Errors of one built-in function or operation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BuiltinErrors {
    /// The function in GLSL, with its domain.
    pub name: String,
    /// Number of inputs.
    pub cases: usize,
    /// Largest error in units in the last place of the exact value.
    pub max_ulp: f64,
    /// Largest absolute error.
    pub max_abs: f64,
    /// Largest ratio of the error to what Vulkan allows.
    pub of_allowed: f64,
    /// Inputs of that ratio.
    pub worst: Vec<f32>,
}

/// What else a device's arithmetic does.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Arithmetic {
    /// Errors by function.
    pub builtins: Vec<BuiltinErrors>,
    /// Fraction of `a * b + c` that is rounded once, among inputs where that differs from rounding twice.
    pub fused: f64,
    /// The same of `precise`.
    pub precise_fused: f64,
    /// The same of `fma(a, b, c)`.
    pub fma_fused: f64,
    /// Whether a sum of denormal numbers is kept.
    pub keeps_denormal_sums: bool,
    /// Whether a denormal product is kept.
    pub keeps_denormal_products: bool,
    /// Whether 0 / 0 is NaN and `isnan` says so.
    pub knows_nan: bool,
    /// Whether 1 / 0 is infinite.
    pub knows_infinity: bool,
    /// `min(NaN, 1)`: `NaN` or `1`.
    pub min_of_nan: String,
    /// How `packHalf2x16` rounds: `nearest`, `down`, `up` or `other`.
    pub half_rounds: String,
    /// Number of weights that a linear filter gives two texels, among 65,536 places between them: 257 with eight bits.
    /// `None` in files from before it was measured.
    #[serde(default)]
    pub filter_weights: Option<usize>,
}

/// A function that is measured.
struct Measured {
    name: &'static str,
    operation: u32,
    draw: fn(&mut SplitMix64) -> [f32; 3],
    exact: fn([f64; 3]) -> f64,
    /// Absolute error that Vulkan allows, where correct rounding is off by so many ulp ([`rounding`]).
    allowed: fn([f64; 3], f64, f64) -> f64,
}

/// A random number of a sign, with an exponent in a range.
fn spread(draw: &mut SplitMix64, low: f64, high: f64, signed: bool) -> f32 {
    let sign = if signed && draw.below(2) == 1 { -1.0 } else { 1.0 };
    (sign * draw.between(low, high).exp2()) as f32
}

const MEASURED: [Measured; 15] = [
    Measured {
        name: "a + b",
        operation: 0,
        draw: |d| [spread(d, -20.0, 20.0, true), spread(d, -20.0, 20.0, true), 0.0],
        exact: |[a, b, _]| a + b,
        allowed: |_, exact, rounding| rounding * ulp(exact),
    },
    Measured {
        name: "a * b",
        operation: 1,
        draw: |d| [spread(d, -60.0, 60.0, true), spread(d, -60.0, 60.0, true), 0.0],
        exact: |[a, b, _]| a * b,
        allowed: |_, exact, rounding| rounding * ulp(exact),
    },
    Measured {
        name: "a / b",
        operation: 2,
        draw: |d| [spread(d, -60.0, 60.0, true), spread(d, -60.0, 60.0, true), 0.0],
        exact: |[a, b, _]| a / b,
        allowed: |_, exact, _| 2.5 * ulp(exact),
    },
    Measured {
        name: "sqrt(x)",
        operation: 3,
        draw: |d| [spread(d, -120.0, 120.0, false), 0.0, 0.0],
        exact: |[x, ..]| x.sqrt(),
        allowed: |_, exact, _| root(exact),
    },
    Measured {
        name: "inversesqrt(x)",
        operation: 4,
        draw: |d| [spread(d, -120.0, 120.0, false), 0.0, 0.0],
        exact: |[x, ..]| 1.0 / x.sqrt(),
        allowed: |_, exact, _| 2.0 * ulp(exact),
    },
    Measured {
        name: "exp2(x), |x| < 100",
        operation: 5,
        draw: |d| [d.between(-100.0, 100.0) as f32, 0.0, 0.0],
        exact: |[x, ..]| x.exp2(),
        allowed: |[x, ..], exact, _| (3.0 + 2.0 * x.abs()) * ulp(exact),
    },
    Measured {
        name: "log2(x)",
        operation: 6,
        draw: |d| [spread(d, -120.0, 120.0, false), 0.0, 0.0],
        exact: |[x, ..]| x.log2(),
        allowed: |[x, ..], exact, _| logarithm(x, exact),
    },
    Measured {
        name: "log2(x), 1/2 to 2",
        operation: 6,
        draw: |d| [spread(d, -1.0, 1.0, false), 0.0, 0.0],
        exact: |[x, ..]| x.log2(),
        allowed: |[x, ..], exact, _| logarithm(x, exact),
    },
    Measured {
        name: "exp(x), |x| < 80",
        operation: 7,
        draw: |d| [d.between(-80.0, 80.0) as f32, 0.0, 0.0],
        exact: |[x, ..]| x.exp(),
        allowed: |[x, ..], exact, _| (3.0 + 2.0 * x.abs()) * ulp(exact),
    },
    Measured {
        name: "log(x)",
        operation: 8,
        draw: |d| [spread(d, -120.0, 120.0, false), 0.0, 0.0],
        exact: |[x, ..]| x.ln(),
        allowed: |[x, ..], exact, _| logarithm(x, exact),
    },
    Measured {
        name: "sin(x), |x| < pi",
        operation: 9,
        draw: |d| [d.between(-PI, PI) as f32, 0.0, 0.0],
        exact: |[x, ..]| x.sin(),
        allowed: |_, _, _| 2.0_f64.powi(-11),
    },
    Measured {
        name: "cos(x), |x| < pi",
        operation: 10,
        draw: |d| [d.between(-PI, PI) as f32, 0.0, 0.0],
        exact: |[x, ..]| x.cos(),
        allowed: |_, _, _| 2.0_f64.powi(-11),
    },
    Measured {
        name: "pow(a, b), 1/16 to 16, |b| < 16",
        operation: 11,
        draw: |d| [spread(d, -4.0, 4.0, false), d.between(-16.0, 16.0) as f32, 0.0],
        exact: |[a, b, _]| a.powf(b),
        // Inherited from exp2(b * log2(a)).
        allowed: |[a, b, _], exact, rounding| {
            let product = b * a.log2();
            let error = b.abs() * logarithm(a, a.log2()) + rounding * ulp(product);
            (3.0 + 2.0 * product.abs()) * ulp(exact) + exact * (error * std::f64::consts::LN_2).exp_m1()
        },
    },
    Measured {
        name: "acos(x)",
        operation: 12,
        draw: |d| [d.between(-1.0, 1.0) as f32, 0.0, 0.0],
        exact: |[x, ..]| x.acos(),
        // Inherited from atan2(sqrt(1 - x * x), x): 4096 ulp, what the square and the difference lose, and the root.
        allowed: |[x, ..], exact, rounding| {
            let (square, rest) = (x * x, 1.0 - x * x);
            let lost = rounding * (ulp(square) + ulp(rest));
            let off = (rest + lost).sqrt() - (rest - lost).max(0.0).sqrt();
            4096.0 * ulp(exact) + off + root(rest.sqrt())
        },
    },
    Measured {
        name: "atan(y, x)",
        operation: 13,
        draw: |d| [spread(d, -20.0, 20.0, true), spread(d, -20.0, 20.0, true), 0.0],
        exact: |[y, x, _]| y.atan2(x),
        allowed: |_, exact, _| 4096.0 * ulp(exact),
    },
];

/// What Vulkan allows log and log2.
fn logarithm(x: f64, exact: f64) -> f64 {
    if (0.5..=2.0).contains(&x) { 2.0_f64.powi(-21) } else { 3.0 * ulp(exact) }
}

/// What Vulkan allows sqrt, inherited from 1 / inversesqrt: 2.5 ulp, and 2 ulp of the reciprocal, 1 to 4 of the root.
fn root(exact: f64) -> f64 {
    2.5 * ulp(exact) + 2.0 * ulp(1.0 / exact) * exact * exact
}

/// Units in the last place that correct rounding may be off. Vulkan leaves the direction to the device unless programs
/// ask for the nearest, which they do where they can.
fn rounding(device: &Device) -> f64 {
    if device.offers().rounds_to_even { 0.5 } else { 1.0 }
}

/// How halves round, by the steps above 1 that three quarters of a step and a quarter become.
fn half_rounds(steps: [u32; 2]) -> &'static str {
    match steps {
        [1, 0] => "nearest",
        [0, 0] => "down",
        [1, 1] => "up",
        _ => "other",
    }
}

/// Evaluates an operation over rows of inputs.
fn evaluate(device: &Arc<Device>, operation: u32, rows: &[[f32; 3]]) -> Result<Vec<f32>> {
    let columns: Vec<f32> = (0..3).flat_map(|column| rows.iter().map(move |row| row[column])).collect();
    let inputs = Buffer::with_data(device, "inputs of a built-in function", &columns)?;
    let outputs = Buffer::new(device, "its outputs", 4 * rows.len() as u64, Place::Readback)?;
    let mut frame = Frame::new(device);
    let bind = builtin::Bind { inputs: &inputs, outputs: &outputs };
    let push = builtin::Push { count: rows.len() as u32 };
    let groups = [rows.len().div_ceil(64) as u32, 1, 1];
    frame.compute("built-in function", &bind, &builtin::Constants { operation }, &push, groups)?;
    frame.read_back(&outputs);
    frame.finish()?;
    Ok(outputs.read(|bytes| bytemuck::pod_collect_to_vec(&bytes[..4 * rows.len()])))
}

/// Measures the errors of a function.
fn errors(device: &Arc<Device>, of: &Measured, cases: usize) -> Result<BuiltinErrors> {
    let mut draw = SplitMix64::new(u64::from(of.operation) + 1);
    let rows: Vec<[f32; 3]> = (0..cases).map(|_| (of.draw)(&mut draw)).collect();
    let outputs = evaluate(device, of.operation, &rows)?;
    let rounding = rounding(device);
    let each = |(row, &got): (&[f32; 3], &f32)| {
        let inputs = row.map(f64::from);
        let exact = (of.exact)(inputs);
        let error = (f64::from(got) - exact).abs();
        let error = if error.is_nan() { f64::INFINITY } else { error };
        let ratio = error / (of.allowed)(inputs, exact, rounding);
        [error / ulp(exact), error, if ratio.is_nan() { 0.0 } else { ratio }]
    };
    let found: Vec<[f64; 3]> = rows.par_iter().zip(&outputs).map(each).collect();
    let most = |which: usize| found.iter().map(|errors| errors[which]).fold(0.0, f64::max);
    let worst = found.iter().zip(&rows).max_by(|a, b| a.0[2].total_cmp(&b.0[2]));
    // JSON has no infinity.
    let [max_ulp, max_abs, of_allowed] = [0, 1, 2].map(|which| most(which).min(1e300));
    let (max_ulp, max_abs) = (short(max_ulp), short(max_abs));
    let worst = worst.map_or_else(Vec::new, |(_, row)| row.to_vec());
    Ok(BuiltinErrors { name: of.name.to_owned(), cases, max_ulp, max_abs, of_allowed, worst })
}

/// Fraction of results that are rounded once.
fn fused(device: &Arc<Device>, operation: u32, cases: usize) -> Result<f64> {
    let mut draw = SplitMix64::new(7);
    let mut number = || draw.between(1.0, 2.0) as f32;
    let rows: Vec<[f32; 3]> = (0..cases)
        .map(|_| {
            let (a, b) = (number(), number());
            // The product's own rounding error remains where it is taken away again.
            [a, b, -(a * b)]
        })
        .collect();
    let outputs = evaluate(device, operation, &rows)?;
    let differs = |[a, b, c]: &[f32; 3]| a.mul_add(*b, *c) != a * b + c;
    let (mut once, mut of) = (0, 0);
    for (row, got) in rows.iter().zip(&outputs).filter(|(row, _)| differs(row)) {
        of += 1;
        once += usize::from(*got == row[0].mul_add(row[1], row[2]));
    }
    Ok(short(f64::from(once as u32) / f64::from(of as u32).max(1.0)))
}

/// Number of different weights of two texels under a linear filter.
fn filter_weights(device: &Arc<Device>) -> Result<usize> {
    const PLACES: u32 = 1 << 16;
    let format = vk::Format::R32G32B32A32_SFLOAT;
    let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST;
    let image = Image::new(device, "two texels", ImageDesc::flat(format, 2, 1, usage))?;
    let texels = Buffer::with_data(device, "black and white", &[[0.0_f32; 4], [1.0; 4]])?;
    let weights = Buffer::new(device, "weights", 4 * u64::from(PLACES), Place::Readback)?;
    let mut frame = Frame::new(device);
    frame.upload("two texels", &texels, &image, 0, &[0]);
    let two_texels = Sampled { image: &image, sampler: SamplerDesc::LINEAR };
    let bind = filter::Bind { two_texels, weights: &weights };
    frame.compute("filter", &bind, &filter::Constants {}, &filter::Push { count: PLACES }, [PLACES / 64, 1, 1])?;
    frame.read_back(&weights);
    frame.finish()?;
    let mut found: Vec<u32> = weights.read(|bytes| bytemuck::pod_collect_to_vec(&bytes[..4 * PLACES as usize]));
    found.sort_unstable();
    found.dedup();
    Ok(found.len())
}

/// Measures a device's arithmetic with so many inputs for each function.
///
/// # Errors
/// When the device fails.
pub fn measure(device: &Arc<Device>, cases: usize) -> Result<Arithmetic> {
    let one = |operation: u32, row: [f32; 3]| evaluate(device, operation, &[row]).map(|values| values[0]);
    let quotient = one(2, [0.0, 0.0, 0.0])?;
    let half = |x: f32| one(17, [x, 0.0, 0.0]).map(f32::to_bits);
    // Three quarters of a step above 1, and a quarter.
    let rounded = [half(1.0 + 0.75 / 1024.0)?, half(1.0 + 0.25 / 1024.0)?];
    /// The half 1.0.
    const ONE: u32 = 0x3c00;
    Ok(Arithmetic {
        builtins: MEASURED.iter().map(|of| errors(device, of, cases)).collect::<Result<_>>()?,
        fused: fused(device, 15, cases)?,
        precise_fused: fused(device, 16, cases)?,
        fma_fused: fused(device, 14, cases)?,
        keeps_denormal_sums: one(0, [1e-40, 1e-40, 0.0])? == 1e-40 + 1e-40,
        keeps_denormal_products: one(1, [1e-20, 1e-20, 0.0])? == 1e-20 * 1e-20,
        knows_nan: quotient.is_nan() && one(19, [f32::NAN, 0.0, 0.0])? == 1.0,
        knows_infinity: one(2, [1.0, 0.0, 0.0])? == f32::INFINITY,
        min_of_nan: if one(18, [f32::NAN, 1.0, 0.0])? == 1.0 { "1".to_owned() } else { "NaN".to_owned() },
        half_rounds: half_rounds(rounded.map(|bits| bits.wrapping_sub(ONE))).to_owned(),
        filter_weights: Some(filter_weights(device)?),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The exact value of a function of one number, and what Vulkan allows under rounding to the nearest.
    fn bound(name: &str, x: f64) -> (f64, f64) {
        let of = MEASURED.iter().find(|of| of.name == name).expect("a function");
        let exact = (of.exact)([x, 0.0, 0.0]);
        (exact, (of.allowed)([x, 0.0, 0.0], exact, 0.5))
    }

    #[test]
    fn roots_inherit_the_error_of_the_reciprocal() {
        for (x, ulps) in [(4.0 * (1.0 - 1e-7), 6.5), (4.0 * (1.0 + 1e-7), 3.5)] {
            let (exact, allowed) = bound("sqrt(x)", x);
            assert!((allowed / ulp(exact) - ulps).abs() < 1e-3, "{x}: {}", allowed / ulp(exact));
        }
    }

    #[test]
    fn arc_cosines_lose_what_is_lost_near_one() {
        let mut most: f64 = 0.0;
        for i in 1..10_000_u16 {
            let x = 1.0 - f32::from(i) * f32::EPSILON / 2.0;
            let (exact, allowed) = bound("acos(x)", f64::from(x));
            let beside = allowed - 4096.0 * ulp(exact);
            let lost = (f64::from((1.0 - x * x).sqrt()).atan2(f64::from(x)) - exact).abs();
            assert!(lost <= beside, "{x}: {lost:e}, {beside:e}");
            most = most.max(lost / beside);
        }
        assert!(most > 0.1, "{most}");
        // Elsewhere nothing is lost.
        let (exact, allowed) = bound("acos(x)", 0.5);
        assert!(allowed < 4105.0 * ulp(exact), "{}", allowed / ulp(exact));
    }

    #[test]
    fn halves_are_rounded_to_a_neighbour() {
        let found = [[1, 0], [0, 0], [1, 1], [0, 1], [2, 0]].map(half_rounds);
        assert_eq!(found, ["nearest", "down", "up", "other", "other"]);
    }
}
