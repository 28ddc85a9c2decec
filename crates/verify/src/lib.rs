//! Verification of the shipped shader functions against their f64 twins on a device (`etalon verify`).
//! docs/equations.md lists functions and bounds.
//!
//! [`catalogue`] joins the functions that build.rs found in `shaders/lib/` with the twins and bounds of the crate
//! `optics`. [`Cases`] draws random inputs and evaluates the twin, or takes both from a vector file ([`vectors`]).
//! [`evaluate`] runs a function on the device by its probe (a generated compute program), and [`judge`] compares.

pub mod arguments;
pub mod curve;
pub mod document;
pub mod plot;
pub mod statements;
pub mod vectors;

use std::sync::Arc;

use anyhow::{Result, ensure};
use rayon::prelude::*;

use etalon::gpu::{Buffer, Device, Frame, Place};
use etalon::optics::{self, Case, Equation, SplitMix64, Tier, ulp};
use etalon::shader::{PROBES, Probe, ProbeBind, lib};

/// Bit pattern written to every output before a probe runs: a NaN that no arithmetic produces.
const POISON: u32 = 0x7fc0_dead;

/// Magnitude below which rounding errors of f32 are denormal numbers: 2^-126 · 2^24.
pub const TINY: f64 = 1.972_152_263_052_53e-31;

/// Cases per dispatch: 2^14 workgroups of 64 invocations, below the limit of every device.
const BATCH: usize = 1 << 20;

/// An equation with its shader function and its twin.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    /// Tagged shader function and its program.
    pub probe: &'static Probe,
    /// Twin, input regions and error bounds.
    pub equation: &'static Equation,
}

/// Every equation with a shader function and a twin, in the order of the sources.
#[must_use]
pub fn catalogue() -> Vec<Entry> {
    let twin = |probe: &Probe| optics::equations().find(|equation| equation.name == probe.name);
    PROBES.iter().filter_map(|probe| Some(Entry { probe, equation: twin(probe)? })).collect()
}

/// Finds an equation by name.
///
/// # Errors
/// One sentence that lists all names.
pub fn find(name: &str) -> Result<Entry> {
    let all = catalogue();
    let found = all.iter().find(|entry| entry.probe.name == name).copied();
    found.ok_or_else(|| {
        let names: Vec<_> = all.iter().map(|entry| entry.probe.name).collect();
        anyhow::anyhow!("no function is called \"{name}\"; the functions are {}", names.join(", "))
    })
}

/// Test cases: inputs with expected outputs.
#[derive(Debug, Clone)]
pub struct Cases {
    /// Number of cases.
    pub count: usize,
    /// Inputs column by column: f32 values, or 32-bit integers for whole-number inputs.
    pub inputs: Vec<f64>,
    /// Expected outputs row by row, in f64; NaN where nothing is expected.
    pub exact: Vec<f64>,
    /// For each output column, whether it is judged.
    pub judged: Vec<bool>,
}

impl Cases {
    /// Draws `count` random cases from the input regions of the equation, in proportion to their shares; the twin gives
    /// the outputs.
    #[must_use]
    pub fn draw(entry: &Entry, count: usize, seed: u64) -> Self {
        let equation = entry.equation;
        let total: u32 = equation.regions.iter().map(|region| region.share).sum();
        let mut draw = SplitMix64::new(seed);
        let mut rows = Vec::with_capacity(count);
        let mut sum = 0;
        for region in equation.regions {
            sum += region.share;
            let end = count * sum as usize / total as usize;
            while rows.len() < end {
                let mut row: Vec<f64> = (region.draw)(&mut draw).into_iter().map(f64::from).collect();
                for (x, name) in row.iter_mut().zip(entry.probe.inputs) {
                    if entry.probe.whole.contains(name) && *x >= 16_777_216.0 {
                        // Random low digits that a float cannot hold.
                        *x = (*x + draw.below(ulp(*x) as usize) as f64).min(f64::from(u32::MAX));
                    }
                }
                rows.push(row);
            }
        }
        Self::from_rows(entry, &rows)
    }

    /// Cases with given inputs; the twin gives the outputs.
    #[must_use]
    pub fn from_rows<T: Copy + Into<f64> + Sync>(entry: &Entry, rows: &[Vec<T>]) -> Self {
        let exact = rows.par_iter().flat_map_iter(|row| {
            let inputs: Vec<f64> = row.iter().map(|&x| x.into()).collect();
            (entry.equation.twin)(&inputs)
        });
        Self {
            count: rows.len(),
            inputs: by_columns(rows, entry.probe.inputs.len()),
            exact: exact.collect(),
            judged: vec![true; entry.probe.outputs.len()],
        }
    }

    /// Expects nothing of cases with an input or an expected output between 0 and [`TINY`]: no bound can hold for them
    /// on a device that flushes denormal numbers. Returns the number of these cases.
    pub fn expect_nothing_of_tiny(&mut self) -> usize {
        let width = self.exact.len() / self.count.max(1);
        let is_tiny = |x: &f64| *x != 0.0 && x.abs() < TINY;
        let mut found = 0;
        for row in 0..self.count {
            let exact = row * width..(row + 1) * width;
            if self.row(row).iter().any(is_tiny) || self.exact[exact.clone()].iter().any(is_tiny) {
                self.exact[exact].fill(f64::NAN);
                found += 1;
            }
        }
        found
    }

    /// Inputs of one case.
    #[must_use]
    pub fn row(&self, row: usize) -> Vec<f64> {
        (0..self.inputs.len() / self.count).map(|column| self.inputs[column * self.count + row]).collect()
    }
}

fn by_columns<T: Copy + Into<f64>>(rows: &[Vec<T>], width: usize) -> Vec<f64> {
    (0..width).flat_map(|column| rows.iter().map(move |row| row[column].into())).collect()
}

/// Results of a probe.
#[derive(Debug, Clone)]
pub struct Evaluated {
    /// Outputs column by column.
    pub outputs: Vec<f32>,
    /// GPU milliseconds of the dispatches of a second run, without compilation.
    pub ms: f64,
}

/// Evaluates a function in a tier for `count` cases on the device.
///
/// # Errors
/// When the device fails, or when the function leaves an output unwritten.
///
/// # Panics
/// When the number of input columns is not that of the function.
pub fn evaluate(
    device: &Arc<Device>,
    probe: &'static Probe,
    tier: Tier,
    inputs: &[impl Copy + Into<f64>],
    count: usize,
) -> Result<Evaluated> {
    assert_eq!(inputs.len(), count * probe.inputs.len(), "input columns of {}", probe.name);
    let mut outputs = vec![0.0; count * probe.outputs.len()];
    let mut ms = 0.0;
    for first in (0..count).step_by(BATCH) {
        let length = BATCH.min(count - first);
        let part = |column: usize| {
            inputs[column * count + first..][..length].iter().map(move |&x| probe.word(column, x.into()))
        };
        let columns: Vec<u32> = (0..probe.inputs.len()).flat_map(part).collect();
        let from = Buffer::with_data(device, "inputs of a probe", &columns)?;
        let bytes = 4 * length * probe.outputs.len();
        let to = Buffer::new(device, "outputs of a probe", bytes as u64, Place::Readback)?;
        let bind = ProbeBind { probe, inputs: &from, outputs: &to };
        let constants = lib::arithmetic::Constants { arithmetic: tier as u32 };
        // The first run compiles; the second run is timed.
        for run in 0..2 {
            let mut frame = Frame::new(device);
            frame.fill("poison", &to, POISON);
            let groups = [length.div_ceil(64) as u32, 1, 1];
            frame.compute(probe.name, &bind, &constants, &(length as u32), groups)?;
            frame.read_back(&to);
            let times = frame.finish()?;
            if run == 1 {
                ms += times.iter().filter(|pass| pass.name == probe.name).map(|pass| pass.ms).sum::<f64>();
            }
        }
        to.read(|bytes| {
            let values: &[f32] = bytemuck::cast_slice(bytes);
            for column in 0..probe.outputs.len() {
                outputs[column * count + first..][..length].copy_from_slice(&values[column * length..][..length]);
            }
        });
    }
    ensure!(
        outputs.iter().all(|value| value.to_bits() != POISON),
        "evaluating {}: the device left an output unwritten",
        probe.name
    );
    Ok(Evaluated { outputs, ms })
}

/// Whether a device flushes denormal numbers, which Vulkan allows.
///
/// # Errors
/// When the device fails.
pub fn flushes_denormals(device: &Arc<Device>) -> Result<bool> {
    let sum = find("two_sum")?.probe;
    let outputs = evaluate(device, sum, Tier::Stable, &[1e-40_f32, 1e-40], 1)?.outputs;
    Ok(outputs[0] != 1e-40 + 1e-40)
}

/// Errors of one output column.
#[derive(Debug, Clone)]
pub struct Figures {
    /// Number of judged cases.
    pub cases: usize,
    /// Largest error in ulp (units in the last place) of the exact value.
    pub max_ulp: f64,
    /// Largest relative error over cases whose exact value is not 0.
    pub max_rel: f64,
    /// Largest absolute error.
    pub max_abs: f64,
    /// Number of NaN results, and of infinite results whose exact value is finite.
    pub non_finite: usize,
    /// Whether every case keeps its bound; always true for the tier fast, which has no bounds.
    pub pass: bool,
    /// Case with the largest ratio of error to bound.
    pub worst: Option<Worst>,
}

/// The worst case.
#[derive(Debug, Clone)]
pub struct Worst {
    /// Index of the case, from 0.
    pub row: usize,
    /// Inputs.
    pub inputs: Vec<f64>,
    /// Result of the device.
    pub got: f32,
    /// Expected value of the twin or the file.
    pub expected: f64,
    /// Ratio of error to allowed error.
    pub excess: f64,
}

/// Absolute error of `got`. It is 0 where the exact value underflows the normal numbers of f32 and `got` is zero or
/// denormal, which Vulkan allows, and where the exact value overflows and `got` is infinite or the largest number.
#[must_use]
pub fn absolute_error(got: f32, exact: f64) -> f64 {
    let value = f64::from(got);
    if exact.abs() >= f64::from(f32::MAX) && value.abs() >= f64::from(f32::MAX) && value.signum() == exact.signum() {
        return 0.0;
    }
    if exact.abs() < f64::from(f32::MIN_POSITIVE) && value.abs() <= f64::from(f32::MIN_POSITIVE) {
        return 0.0;
    }
    (value - exact).abs()
}

/// Compares the outputs of a tier with the expected outputs; returns figures for each output column.
#[must_use]
pub fn judge(entry: &Entry, tier: Tier, cases: &Cases, outputs: &[f32]) -> Vec<Figures> {
    let width = entry.equation.outputs.len();
    let column = |column: usize| {
        let output = &entry.equation.outputs[column];
        let each = |row: usize| {
            let exact = &cases.exact[row * width..][..width];
            if !cases.judged[column] || exact[column].is_nan() {
                return None;
            }
            let got = outputs[column * cases.count + row];
            let inputs = cases.row(row);
            let error = absolute_error(got, exact[column]);
            // The tier fast has no bounds; its worst case is measured by the bound of the tier stable.
            let judged = if tier == Tier::Fast { Tier::Stable } else { tier };
            let allowed = (output.allowed)(&Case { tier: judged, inputs: &inputs, exact, column });
            // Outside the domain of an equation the bound may be NaN although a file expects the documented value; the
            // result must then be exact.
            let allowed = if allowed.is_nan() { 0.0 } else { allowed };
            let excess = match (error.is_nan(), error <= allowed) {
                (true, _) => f64::INFINITY,
                (_, true) if allowed == 0.0 || allowed.is_infinite() => 0.0,
                _ => error / allowed,
            };
            Some((row, got, exact[column], error, excess))
        };
        let none =
            Figures { cases: 0, max_ulp: 0.0, max_rel: 0.0, max_abs: 0.0, non_finite: 0, pass: true, worst: None };
        (0..cases.count)
            .into_par_iter()
            .filter_map(each)
            .fold(
                || none.clone(),
                |mut all, (row, got, exact, error, excess)| {
                    all.cases += 1;
                    let infinite = got.is_infinite() && exact.is_finite() && error > 0.0;
                    all.non_finite += usize::from(got.is_nan() || infinite);
                    if error.is_finite() {
                        all.max_abs = all.max_abs.max(error);
                        all.max_ulp = all.max_ulp.max(error / ulp(exact));
                        if exact != 0.0 {
                            all.max_rel = all.max_rel.max(error / exact.abs());
                        }
                    }
                    all.pass &= tier == Tier::Fast || excess <= 1.0;
                    if all.worst.as_ref().is_none_or(|worst| excess > worst.excess) {
                        all.worst = Some(Worst { row, inputs: cases.row(row), got, expected: exact, excess });
                    }
                    all
                },
            )
            .reduce(|| none.clone(), merge)
    };
    (0..width).map(column).collect()
}

fn merge(a: Figures, b: Figures) -> Figures {
    let worst = match (a.worst, b.worst) {
        // Among equal cases the first wins, so that the result does not depend on the division of the work.
        (Some(x), Some(y)) => Some(if y.excess > x.excess || (y.excess == x.excess && y.row < x.row) { y } else { x }),
        (x, y) => x.or(y),
    };
    Figures {
        cases: a.cases + b.cases,
        max_ulp: a.max_ulp.max(b.max_ulp),
        max_rel: a.max_rel.max(b.max_rel),
        max_abs: a.max_abs.max(b.max_abs),
        non_finite: a.non_finite + b.non_finite,
        pass: a.pass && b.pass,
        worst,
    }
}

/// Hostile inputs, mostly outside the domain: zeros, ones, denormals and huge numbers of either sign, in random
/// combinations.
fn hostile(entry: &Entry, count: usize, seed: u64) -> Vec<f64> {
    let huge = entry.equation.extreme;
    let values =
        [0.0, -0.0, 1.0, -1.0, 0.5, -2.0, 1e-6, -1e-6, 1e-20, -1e-20, 1e-38, 1e-44, 1e10, huge, -huge, huge * 0.1];
    let mut draw = SplitMix64::new(seed);
    // Half of the entries are extreme, so that some cases have a single extreme input.
    let mut value = || {
        let extreme = draw.below(2) == 0;
        let pick = values[draw.below(values.len())].clamp(-huge, huge);
        f64::from(if extreme { pick } else { draw.between(-2.0, 2.0) as f32 })
    };
    (0..count * entry.probe.inputs.len()).map(|_| value()).collect()
}

/// Number of `count` hostile cases that return NaN, and the inputs of the first.
///
/// # Errors
/// When the device fails.
pub fn nan_of_hostile(
    device: &Arc<Device>,
    entry: &Entry,
    tier: Tier,
    count: usize,
    seed: u64,
) -> Result<(usize, Option<Vec<f64>>)> {
    if entry.equation.extreme < 0.0 {
        return Ok((0, None));
    }
    let inputs = hostile(entry, count, seed);
    let outputs = evaluate(device, entry.probe, tier, &inputs, count)?.outputs;
    let nan = |row: &usize| (0..entry.probe.outputs.len()).any(|column| outputs[column * count + row].is_nan());
    let rows: Vec<usize> = (0..count).filter(nan).collect();
    let first =
        rows.first().map(|row| (0..entry.probe.inputs.len()).map(|column| inputs[column * count + row]).collect());
    Ok((rows.len(), first))
}
