//! The shipped shader functions against their f64 twins, on a device.
//!
//! [`catalogue`] joins what build.rs found in `shaders/lib/` with what `optics` says of it. [`Cases`] draws inputs and asks
//! the twin, or takes both from a vector file ([`vectors`]). [`evaluate`] runs the probe, [`judge`] compares.

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

/// Written to every output before a probe runs: a NaN that no arithmetic makes.
const POISON: u32 = 0x7fc0_dead;

/// Cases in one dispatch: 2^14 workgroups of 64, below every device's limit.
const BATCH: usize = 1 << 20;

/// One equation: the shader's side and the twin's.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    /// The tagged function and its program.
    pub probe: &'static Probe,
    /// Twin, regions, bounds.
    pub equation: &'static Equation,
}

/// Every equation that has both sides, in the order of the sources.
#[must_use]
pub fn catalogue() -> Vec<Entry> {
    let twin = |probe: &Probe| optics::equations().find(|equation| equation.name == probe.name);
    PROBES.iter().filter_map(|probe| Some(Entry { probe, equation: twin(probe)? })).collect()
}

/// The equation of that name.
///
/// # Errors
/// One sentence with the names there are.
pub fn find(name: &str) -> Result<Entry> {
    let all = catalogue();
    let found = all.iter().find(|entry| entry.probe.name == name).copied();
    found.ok_or_else(|| {
        let names: Vec<_> = all.iter().map(|entry| entry.probe.name).collect();
        anyhow::anyhow!("no function is called \"{name}\"; there are {}", names.join(", "))
    })
}

/// Inputs with what is expected of them. Columns lie one after the other, as the probe reads them.
#[derive(Debug, Clone)]
pub struct Cases {
    /// How many.
    pub count: usize,
    /// Input columns: values of f32, and whole numbers of 32 bits where the function takes such.
    pub inputs: Vec<f64>,
    /// Exact outputs, row by row; NaN where nothing is expected.
    pub exact: Vec<f64>,
    /// Output columns that something is expected of.
    pub judged: Vec<bool>,
}

impl Cases {
    /// `count` cases from the regions of the equation, each region's share of them, with the twin's outputs.
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
                        // The digits that a float has not.
                        *x = (*x + draw.below(ulp(*x) as usize) as f64).min(f64::from(u32::MAX));
                    }
                }
                rows.push(row);
            }
        }
        Self::from_rows(entry, &rows)
    }

    /// These inputs with the twin's outputs.
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

    /// One case's inputs.
    #[must_use]
    pub fn row(&self, row: usize) -> Vec<f64> {
        (0..self.inputs.len() / self.count).map(|column| self.inputs[column * self.count + row]).collect()
    }
}

fn by_columns<T: Copy + Into<f64>>(rows: &[Vec<T>], width: usize) -> Vec<f64> {
    (0..width).flat_map(|column| rows.iter().map(move |row| row[column].into())).collect()
}

/// What a probe returned.
#[derive(Debug, Clone)]
pub struct Evaluated {
    /// Output columns, one after the other.
    pub outputs: Vec<f32>,
    /// GPU time of the dispatches, without compilation: those of the second run.
    pub ms: f64,
}

/// Evaluates a function in a tier for `count` cases.
///
/// # Errors
/// When the device fails, or the function left an output unwritten.
///
/// # Panics
/// When the number of columns is not the function's.
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
        // The first run compiles; the second is timed.
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

/// The errors of one output column.
#[derive(Debug, Clone)]
pub struct Figures {
    /// Cases in which something was expected.
    pub cases: usize,
    /// Largest error in units of the last place of the exact value.
    pub max_ulp: f64,
    /// Largest relative error, where the exact value is not 0.
    pub max_rel: f64,
    /// Largest absolute error.
    pub max_abs: f64,
    /// NaN, and infinities where the exact value is none.
    pub non_finite: usize,
    /// No case exceeds its bound. The tier fast has none.
    pub pass: bool,
    /// The case nearest to its bound, or farthest beyond.
    pub worst: Option<Worst>,
}

/// One case.
#[derive(Debug, Clone)]
pub struct Worst {
    /// Its place among the cases, from 0.
    pub row: usize,
    /// Input columns.
    pub inputs: Vec<f64>,
    /// From the device.
    pub got: f32,
    /// From the twin or the file.
    pub expected: f64,
    /// Error over allowed error.
    pub excess: f64,
}

/// Absolute error of `got`: 0 where a value too small for f32's normal numbers came out as zero or as a denormal, which
/// every Vulkan device may do, and where one too large came out as infinity or as the largest number.
fn absolute_error(got: f32, exact: f64) -> f64 {
    let value = f64::from(got);
    if exact.abs() >= f64::from(f32::MAX) && value.abs() >= f64::from(f32::MAX) && value.signum() == exact.signum() {
        return 0.0;
    }
    if exact.abs() < f64::from(f32::MIN_POSITIVE) && value.abs() <= f64::from(f32::MIN_POSITIVE) {
        return 0.0;
    }
    (value - exact).abs()
}

/// Compares the outputs of a tier with what is exact: one set of figures per output column.
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
            // The tier fast promises nothing; its worst case is the one farthest beyond the stable tier's bound.
            let judged = if tier == Tier::Fast { Tier::Stable } else { tier };
            let allowed = (output.allowed)(&Case { tier: judged, inputs: &inputs, exact, column });
            // Outside of its domain an equation's bound may be no number, where a file expects the documented value:
            // exactly that is demanded.
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
        // Of equals the first: the result does not depend on how the work was cut.
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

/// Inputs from outside every domain: zeros, ones, denormals, huge numbers of either sign, in any mixture.
fn hostile(entry: &Entry, count: usize, seed: u64) -> Vec<f64> {
    let huge = entry.equation.extreme;
    let values =
        [0.0, -0.0, 1.0, -1.0, 0.5, -2.0, 1e-6, -1e-6, 1e-20, -1e-20, 1e-38, 1e-44, 1e10, huge, -huge, huge * 0.1];
    let mut draw = SplitMix64::new(seed);
    // Column by column: half of the entries are extreme, so that some cases have a single one.
    let mut value = || {
        let extreme = draw.below(2) == 0;
        let pick = values[draw.below(values.len())].clamp(-huge, huge);
        f64::from(if extreme { pick } else { draw.between(-2.0, 2.0) as f32 })
    };
    (0..count * entry.probe.inputs.len()).map(|_| value()).collect()
}

/// How many of `count` hostile cases gave a NaN, and the inputs of the first.
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
